"""Unit vectors and the cone limit of a ball joint, in two or three dimensions."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TINY = float(np.finfo(float).tiny)  # numbers below have lost digits: no direction
OPPOSITE = 1e-12  # a unit vector less far than this off a line is on it


@dataclass(frozen=True)
class Cone:
    """Rotational limit of a ball joint: its outgoing links stay within ``half_angle`` [rad] of an axis.

    The axis is the direction of the incoming link; at a root, which has none, it is ``axis`` (d,),
    of any length. Checked where it joins a `BallTree`: 0 < half_angle <= pi.
    """

    half_angle: float
    axis: tuple[float, ...] | None = None


def unit(v: Array, fallback: Array | None = None) -> Array:
    """v (d,) scaled to length one; where v is zero or denormal, ``fallback`` (d,) scaled, or zero without one."""
    length = math.hypot(*v)
    if length >= TINY:
        return v / length
    return np.zeros_like(v) if fallback is None else unit(fallback)


def angle_between(a: Array, b: Array) -> float:
    """The angle [rad] of two unit vectors (d,), to full precision near 0 and pi too."""
    return 2.0 * math.atan2(math.hypot(*(a - b)), math.hypot(*(a + b)))


def onto_cone(direction: Array, axis: Array, half_angle: float) -> Array:
    """The unit vector (d,) nearest to ``direction`` within ``half_angle`` [rad] of ``axis``; both unit (d,).

    One outside is turned onto the cone in the plane that it spans with the axis. One opposite to the
    axis spans no plane: it is turned towards the coordinate axis most square to it.
    """
    if angle_between(direction, axis) <= half_angle:
        return direction
    side = direction - (direction @ axis) * axis
    if math.hypot(*side) < OPPOSITE:
        side = np.eye(len(axis))[int(np.argmin(np.abs(axis)))]
    side = unit(side)
    side = unit(side - (side @ axis) * axis)  # also where the first remainder was mostly rounding
    return unit(math.cos(half_angle) * axis + math.sin(half_angle) * side)
