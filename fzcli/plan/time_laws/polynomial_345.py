"""The 3-4-5 polynomial."""

import math

import casadi as ca

from fzcli.plan.time_laws.law import TimeLaw, clipped


def evaluate(phase: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """s = 6 p^5 - 15 p^4 + 10 p^3 (Parsa 2008, equation 6); velocity and acceleration vanish at both ends."""
    p = clipped(phase)
    p2 = p * p
    rest = 1.0 - p
    s = p2 * p * (10.0 + p * (6.0 * p - 15.0))
    return s, 30.0 * p2 * (rest * rest), 60.0 * p * rest * (1.0 - 2.0 * p)


LAW = TimeLaw(evaluate, peak_speed=1.875, peak_acceleration=10.0 / math.sqrt(3.0), smooth=2)
