"""The largest positions, speeds and accelerations of a path's joints: looked for from knot to knot."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.base_ride import Path

Array = NDArray[np.float64]
PIECE = 401  # samples from knot to knot: a peak of a detour or a law is missed by less than 3e-5 of its height
ASIDE = 1e-9  # of the duration: how close to a knot, where accelerations may jump, both of its sides are looked at


def peak_times(path: Path, begin: float = 0.0, end: float | None = None) -> Array:
    """Times (T,) [s] between two (default: the whole path), so close that hardly a peak lies between them.

    ``PIECE`` times from each knot to the next, and the knots. Equal samples of a whole path would miss what a narrow
    detour or the corner of a law does.
    """
    last = path.duration if end is None else end
    edges = np.unique([begin, *(knot for knot in path.knots if begin < knot < last), last])
    aside = ASIDE * path.duration
    pieces = [np.linspace(a + aside, b - aside, PIECE) for a, b in pairwise(edges.tolist())]
    return np.concatenate([edges, *pieces])


def limit_excess(
    states: tuple[Array, Array, Array], positions: Array, speeds: Array, accelerations: Array
) -> dict[str, float]:
    """By how much q, qd, qdd (T, n) exceed limits (n, 2), (n) and (n) at most, 0 for not at all; by name."""
    q, qd, qdd = states
    low, high = positions.T
    return {
        "joint_limit_excess_max": max(0.0, float((low - q).max()), float((q - high).max())),
        "joint_speed_excess_max": max(0.0, float((np.abs(qd) - speeds).max())),
        "joint_acceleration_excess_max": max(0.0, float((np.abs(qdd) - accelerations).max())),
    }
