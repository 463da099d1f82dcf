"""The half-cycloidal detour of Parsa 2008: four half-cycloids, out and back, added to a path for a while."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
PEAK = 2.0  # of B, at u = 2
PEAK_SPEED = 2.0  # of B'
PEAK_ACCELERATION = np.pi  # of B''


def bump(u: Array) -> Array:
    """B(u): u - sin(pi u)/pi on 0..2, 4 - u + sin(pi u)/pi on 2..4, 0 elsewhere; any shape.

    Equations 7 to 10 of Parsa 2008 are misprinted: read sin(pi s)/pi with the local phase s of each segment,
    and add L in the third and fourth. B has two continuous derivatives; its third jumps at 0, 2 and 4.
    """
    p = np.clip(u, 0.0, 4.0)
    wave = np.sin(np.pi * p) / np.pi
    return np.where(p < 2.0, p - wave, 4.0 - p + wave)


def bump_rate(u: Array) -> Array:
    """B'(u)."""
    rate = 1.0 - np.cos(np.pi * u)
    return np.where((u <= 0.0) | (u >= 4.0), 0.0, np.where(u < 2.0, rate, -rate))


def bump_acceleration(u: Array) -> Array:
    """B''(u)."""
    pace = np.pi * np.sin(np.pi * u)
    return np.where((u <= 0.0) | (u >= 4.0), 0.0, np.where(u < 2.0, pace, -pace))


def window_phase(time: Array, begin: float, end: float, dwell: float = 0.0) -> tuple[Array, float]:
    """u of a window from ``begin`` to ``end`` [s] that stands at u = 2 for ``dwell`` [s] in its middle, and du/dt.

    The rest before, within and after the dwell costs nothing in smoothness: B' and B'' vanish at u = 0, 2 and 4.
    """
    pace = 4.0 / (end - begin - dwell)
    out = np.clip((time - begin) * pace, 0.0, 2.0)
    back = np.clip((time - begin - dwell) * pace, 2.0, 4.0) - 2.0
    return out + back, pace
