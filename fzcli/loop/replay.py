"""A recorded run against the base's true motion under the same joint motion, integrated far more finely."""

import math

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
PIECES = 8  # a step, of fourth order: some thousand times finer than the step itself
ATTITUDE_ERROR = "attitude_error_max"


def attitude_error(path_piece: ca.Function, q: Array, base_quat: Array) -> float:
    """Largest angle [rad] between the recorded attitudes (T, 4) and those that the joints' path q (T, n) leads to.

    Joints move straight from sample to sample. At zero momentum the turn over a step hangs on the joints alone, so
    that all steps are integrated side by side, each in ``PIECES`` pieces of fourth order.
    """
    steps = len(q) - 1
    if steps < 1 or not (np.isfinite(q).all() and np.isfinite(base_quat).all()):
        return 0.0 if steps < 1 else float("nan")
    way = (np.diff(q, axis=0) / PIECES).T
    piece = path_piece.map(steps)
    turns, now = np.tile([[1.0], [0.0], [0.0], [0.0]], (1, steps)), q[:-1].T
    for _ in range(PIECES):
        turns, now = (np.array(values) for values in piece(turns, now, way))
    worst, true = 0.0, base_quat[0]
    for turn, recorded in zip(turns.T, base_quat[1:], strict=True):
        true = _product(true, turn)
        worst = max(worst, _angle(true, recorded))
    return worst


def _product(a: Array, b: Array) -> Array:
    product = np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])])
    return np.asarray(product / np.sqrt(product @ product))


def _angle(a: Array, b: Array) -> float:
    """Between two attitudes, precise for small ones."""
    sign = 1.0 if a @ b >= 0 else -1.0
    return 4.0 * math.asin(min(1.0, float(np.linalg.norm(a - sign * b)) / 2.0))
