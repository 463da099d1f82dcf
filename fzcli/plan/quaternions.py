"""Unit quaternions w x y z, body to world, many at a time."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def exponential(turns: Array) -> Array:
    """Unit quaternions (..., 4) of rotation vectors (..., 3) [rad]."""
    half = 0.5 * np.sqrt((turns * turns).sum(axis=-1, keepdims=True))
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * turns], axis=-1)


def product(a: Array, b: Array) -> Array:
    """Quaternion products a b, (..., 4)."""
    s, v, t, w = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    return np.concatenate([s * t - (v * w).sum(axis=-1, keepdims=True), s * w + t * v + np.cross(v, w)], axis=-1)


def rotations(quats: Array) -> Array:
    """R (..., 3, 3), body to world, of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(quats, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))
