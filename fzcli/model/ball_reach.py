"""How far a target of a ball-joint tree is out of reach, and the pose that comes nearest to it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from fzcli.model.ball_tree import BallTree
from fzcli.model.joint_cone import Array, unit


@dataclass(frozen=True)
class Miss:
    """A target, or two of them together, out of reach by ``missing`` [m] whatever the joints do."""

    tips: tuple[str, ...]
    missing: float
    text: str


def misses(tree: BallTree, goals: Mapping[str, Array]) -> tuple[Miss, ...]:
    """Each target (tip -> (d,) [m]) that its links cannot reach, and each two that theirs cannot both.

    Ball joints without cones reach a whole ring: no farther than the sum of the lengths, no nearer
    than the longest link less all the others. Cones only take away from it.
    """
    found = []
    for tip, goal in goals.items():
        path = tree.path(tree.tips[tip])
        found.append(_miss(tree, (tip,), math.dist(goal, tree.points[path[0]]), path[1:]))
    for one, two in combinations(sorted(goals), 2):
        first, second = tree.path(tree.tips[one]), tree.path(tree.tips[two])
        if first[0] == second[0]:
            between = sorted(set(first) ^ set(second))
            found.append(_miss(tree, (one, two), math.dist(goals[one], goals[two]), between))
    return tuple(miss for miss in found if miss.missing > 0.0)


def ring(lengths: Sequence[float]) -> tuple[float, float]:
    """The smallest and the largest distance [m] that ball-jointed links of these lengths [m] span."""
    reach, longest = math.fsum(lengths), max(lengths, default=0.0)
    return max(2.0 * longest - reach, 0.0), reach


def line_pose(tree: BallTree, points: Array, tip: str, goal: Array, tolerance: float) -> Array | None:
    """``points`` (k, d) with one tip's chain laid on the line to a target at the ring's edge or beyond it.

    Too far: every link points at the target. Too near: the longest does and the others point back.
    None where the target lies more than ``tolerance`` [m] within the ring, where bends are needed.
    """
    path = tree.path(tree.tips[tip])
    lengths = np.array([tree.lengths[joint] for joint in path[1:]])
    root = points[path[0]]
    distance, (near, far) = math.dist(goal, root), ring(lengths.tolist())
    if distance >= far - tolerance:
        along = np.cumsum(lengths)
    elif near > 0.0 and distance <= near + tolerance:
        along = np.cumsum(np.where(np.arange(len(lengths)) == np.argmax(lengths), lengths, -lengths))
    else:
        return None
    ahead = unit(goal - root, unit(points[path[-1]] - root, np.eye(len(root))[0]))
    laid = points.copy()
    laid[list(path[1:])] = root + along[:, None] * ahead
    return laid


def _miss(tree: BallTree, tips: tuple[str, ...], distance: float, links: Sequence[int]) -> Miss:
    near, far = ring([tree.lengths[joint] for joint in links])
    missing = max(distance - far, near - distance, 0.0)
    span = f"at most {far:.6g} m" if distance > far else f"at least {near:.6g} m"
    text = f"the target of tip {tips[0]!r} is {distance:.6g} m from its root, and its links span {span}"
    if len(tips) == 2:
        names = " and ".join(map(repr, tips))
        text = f"the targets of tips {names} are {distance:.6g} m apart, and the links between span {span}"
    return Miss(tips, missing, f"out of reach by {missing:.6g} m: {text}")
