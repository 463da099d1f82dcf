"""The one contract of all time laws."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class TimeLaw:
    """s from 0 to 1 over a phase t/T from 0 to 1, at rest at both ends and constant beyond.

    ``evaluate``: phase -> s, ds/dphase, d2s/dphase2. ``peak_speed``, ``peak_acceleration``: the largest
    magnitudes of the derivatives. ``smooth``: how many derivatives are continuous everywhere, ends included.
    ``corners``: phases within at which the formula changes.
    """

    evaluate: Callable[[ca.SX], tuple[ca.SX, ca.SX, ca.SX]]
    peak_speed: float
    peak_acceleration: float
    smooth: int
    corners: tuple[float, ...] = ()

    def __call__(self, phase: ca.SX) -> tuple[ca.SX, ca.SX]:
        """s and ds/dphase."""
        s, ds, _ = self.evaluate(phase)
        return s, ds


def clipped(phase: ca.SX) -> ca.SX:
    """The phase within [0, 1]."""
    return ca.fmin(1.0, ca.fmax(0.0, phase))
