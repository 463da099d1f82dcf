"""Which of the angles theta + 2 pi k a hinge takes: the one inside its limits next to a given posture, or all."""

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fzcli.model.inverse.arm import Arm

Array = NDArray[np.float64]
SLACK = 1e-9  # rad or m past a limit that counts as rounding, and is cut off
TURN = 2 * math.pi


def nearest_windings(arm: Arm, q: Array, near: Array) -> Array:
    """Postures q (k, m) with each hinge wound to inside its limits, next to ``near`` (m) there.

    A hinge with no winding inside its limits takes the one that is least outside.
    """
    low, high = arm.limits.T
    turn = arm.periods
    wound = q + turn * np.round((near - q) / TURN)
    past = np.maximum(wound - high, low - wound)
    if past.max() <= SLACK:
        return wound
    wound = wound - turn * np.ceil(np.maximum(wound - high - SLACK, 0.0) / TURN)
    wound = wound + turn * np.ceil(np.maximum(low - SLACK - wound, 0.0) / TURN)
    below = wound - turn
    return np.asarray(np.where((wound > high + SLACK) & (low - below < wound - high), below, wound))


def all_windings(arm: Arm, q: Array, near: Array) -> Array:
    """All postures (k, m) that the windings of q (m) inside the limits make.

    A hinge without limits, or with no winding inside them, is wound as by `nearest_windings`.
    """
    single = nearest_windings(arm, q[None, :], near)[0]
    choices = []
    for i, (low, high) in enumerate(arm.limits):
        first = math.ceil((low - SLACK - q[i]) / TURN) if math.isfinite(low) else 1
        last = math.floor((high + SLACK - q[i]) / TURN) if math.isfinite(high) else 0
        if arm.bodies[i].prismatic or math.inf in (high, -low) or first > last:
            choices.append([single[i]])
        else:
            choices.append([q[i] + TURN * k for k in range(first, last + 1)])
    return np.array(list(product(*choices)))


def excess(arm: Arm, q: Array) -> Array:
    """How far [rad or m] the worst joint of each posture q (k, m) is past its limits, (k); negative inside."""
    return np.asarray(np.maximum(arm.limits[:, 0] - q, q - arm.limits[:, 1]).max(axis=1))
