"""Rest-to-rest time laws s(t/T) from 0 to 1, by name."""

from collections.abc import Callable

import casadi as ca

TimeLaw = Callable[[ca.SX], tuple[ca.SX, ca.SX]]


def polynomial_345(phase: ca.SX) -> tuple[ca.SX, ca.SX]:
    """s and ds/dphase of the 3-4-5 polynomial, phase clipped to [0, 1].

    s = 6 p^5 - 15 p^4 + 10 p^3 (Parsa 2008); velocity and acceleration vanish at both ends.
    """
    p = ca.fmin(1.0, ca.fmax(0.0, phase))
    p2 = p * p
    rest = 1.0 - p
    return p2 * p * (10.0 + p * (6.0 * p - 15.0)), 30.0 * p2 * (rest * rest)


TIME_LAWS: dict[str, TimeLaw] = {"3-4-5": polynomial_345}
