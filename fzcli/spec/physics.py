"""Rigid-body facts that every robot file is checked for, and the rotations its dialects need."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vector3 = tuple[float, float, float]
Inertia6 = tuple[float, float, float, float, float, float]

_NO_INERTIA: Inertia6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_TOLERANCE = 1e-9  # of the largest principal moment: tables print few digits


def check_body(mass: float, inertia: Sequence[float]) -> None:
    """Check that a body with this mass [kg] and inertia (xx yy zz xy xz yz, kg m2, about its CoM) can exist.

    Raises:
        ValueError: mass < 0, mass 0 with inertia, inertia not positive definite, or principal moments
            that break the triangle inequality.
    """
    if mass < 0:
        raise ValueError(f"mass must be > 0, got {mass:g} kg")
    if mass == 0:
        if any(inertia):
            raise ValueError("mass must be > 0, got 0 kg with an inertia (both 0: a massless frame)")
        return
    small, middle, large = np.linalg.eigvalsh(tensor(inertia)).tolist()
    moments = f"{small:.6g}, {middle:.6g}, {large:.6g} kg m2"
    if small <= 0:
        raise ValueError(f"inertia must be positive definite, its principal moments are {moments}")
    if small + middle < large * (1 - _TOLERANCE):
        raise ValueError(
            f"no body has the principal moments {moments}: "
            f"{small:.6g} + {middle:.6g} < {large:.6g} breaks the triangle inequality"
        )


def tensor(inertia: Sequence[float]) -> Array:
    """The 3x3 matrix of xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=np.float64)


def turned_inertia(rotation: Array, inertia: Array) -> Inertia6:
    """R I R^T as xx, yy, zz, xy, xz, yz."""
    t = rotation @ inertia @ rotation.T
    return (float(t[0, 0]), float(t[1, 1]), float(t[2, 2]), float(t[0, 1]), float(t[0, 2]), float(t[1, 2]))


def vector(numbers: Sequence[float] | Array) -> Vector3:
    """Three numbers as a tuple of floats, without negative zeros."""
    x, y, z = (float(number) + 0.0 for number in numbers)
    return (x, y, z)


def rotation_of(rpy: Sequence[float]) -> Array:
    """R = Rz(yaw) Ry(pitch) Rx(roll); quarter turns give exact zeros and ones."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in rpy)
    rotation = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return snapped(rotation)


def rpy_of(rotation: Array) -> Vector3:
    """Roll, pitch and yaw of a rotation matrix; at pitch +-90 deg, where only a sum counts, yaw is 0."""
    r = rotation
    level = math.hypot(r[0, 0], r[1, 0])
    pitch = math.atan2(-r[2, 0], level)
    if level < 1e-9:
        return vector((math.atan2(-r[1, 2], r[1, 1]), pitch, 0.0))
    return vector((math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0])))


def snapped(rotation: Array) -> Array:
    """The matrix with entries within 1e-15 of -1, 0 and 1 made exact: cos(pi/2) is not quite zero."""
    whole = np.round(rotation)
    return np.where(np.abs(rotation - whole) < 1e-15, whole, rotation) + 0.0
