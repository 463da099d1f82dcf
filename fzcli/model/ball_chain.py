"""FABRIK for chains and trees of ball joints, with a report of what was reached and what was not.

Source: A. Aristidou and J. Lasenby, "FABRIK: a fast, iterative solver for the inverse kinematics
problem", Graphical Models 73 (2011) 243-260: the iteration, sub-bases, joint limits.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fzcli.errors import Problem, SpecError
from fzcli.model.ball_reach import Miss, line_pose, misses
from fzcli.model.ball_tree import ROOT, BallTree
from fzcli.model.joint_cone import Array, onto_cone, unit
from fzcli.spec.nearest import hint, shown

WINDOW = 10  # iterations over which progress is judged
SLOW = 0.5  # an error above this share of the one a window ago: leaps are tried
STALLED = 0.999  # a best error above this share of the one a window ago: no progress
# How far a stalled pose is shaken, in link lengths: first off a line, then into another fold, then anywhere.
NUDGES = (0.01, 0.1, 0.3, *[1.0] * 6, *[3.0] * 6)

Goals = Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Solution:
    """Where FABRIK ended.

    ``points`` (k, d) [m]; ``residuals``: tip -> distance left to its target [m]; ``iterations`` made;
    ``leaps`` and ``nudges``: how often slow progress was extrapolated, and a stalled pose shaken;
    ``misses``: what no pose can reach, and by how much; ``reason``: why not converged, else empty.
    """

    points: Array
    converged: bool
    iterations: int
    residuals: Mapping[str, float]
    reason: str
    misses: tuple[Miss, ...]
    leaps: int
    nudges: int


def solve(
    tree: BallTree, targets: Mapping[str, ArrayLike], *, tolerance: float = 1e-6, limit: int = 1000, seed: int = 0
) -> Solution:
    """Bring tips to their ``targets`` (tip -> (d,) [m]), each to within ``tolerance`` [m].

    Tips without a target follow. Every iteration is FABRIK's own; where progress is slow, the last step
    is also extrapolated and kept if nearer; where it ends short, the pose is shaken (random, by
    ``seed``) and tried again, within ``limit`` iterations for each root. The chain of one target out of
    reach is laid straight at it. A target not reached is a `Solution` with its reason; targets and
    settings that make no sense raise SpecError.
    """
    goals = _goals(tree, targets)
    _check(tolerance, limit)
    missed = tuple(miss for miss in misses(tree, goals) if miss.missing > tolerance)
    points = _backward(tree, tree.points, tree.points) if tree.cones else tree.points
    searches, reasons = [], []
    for group in _by_root(tree, goals):
        beyond = [miss for miss in missed if set(miss.tips) <= set(group)]
        search = _Search(tree, group, points, tolerance, limit)
        search.run(bool(beyond), np.random.default_rng(np.random.SeedSequence(seed)))
        points = search.best
        searches.append(search)
        if not search.done:
            reasons += [miss.text for miss in beyond] or [search.verdict()]
    return Solution(
        points.copy(),
        all(search.done for search in searches),
        sum(search.iterations for search in searches),
        {tip: residual for search in searches for tip, residual in search.residuals(points).items()},
        "; ".join(reasons),
        missed,
        sum(search.leaps for search in searches),
        sum(search.nudges for search in searches),
    )


def iterate(tree: BallTree, points: ArrayLike, targets: Mapping[str, ArrayLike]) -> Array:
    """One iteration of FABRIK, forward and backward stage, from ``points`` (k, d) to the next [m].

    Lengths, roots and cones are those of ``tree``. The tip of a chain without cones never ends farther
    off (each stage moves no point by more than the one before it); those of trees may. Raises SpecError
    as `solve` does.
    """
    start = np.array(points, dtype=float)
    if start.shape != tree.points.shape or not np.isfinite(start).all():
        raise SpecError(Problem(f"must be finite and of shape {tree.points.shape}, got shape {start.shape}", "points"))
    return _iterate(tree, start, _goals(tree, targets))


class _Search:
    """The best points so far for the targets of one root, and what they cost."""

    def __init__(self, tree: BallTree, goals: Goals, points: Array, tolerance: float, limit: int) -> None:
        self.tree, self.goals, self.tolerance, self.limit = tree, goals, tolerance, limit
        self.best, self.error, self.done = points, math.inf, False
        self.iterations = self.leaps = self.nudges = 0
        self.keep(points)

    def run(self, hopeless: bool, draw: np.random.Generator) -> None:
        """From the best points: a straight pose if one serves, iterations, nudges unless hopeless."""
        if len(self.goals) == 1 and not self.done:
            ((tip, goal),) = self.goals.items()
            laid = line_pose(self.tree, self.best, tip, goal, self.tolerance)
            if laid is not None:
                self.keep(_backward(self.tree, self.best, laid))
                if not self.tree.cones:
                    return  # nothing comes nearer
        self.descend(self.best)
        for size in () if hopeless else NUDGES:
            if self.done or self.iterations >= self.limit:
                return
            shake = size * np.array(self.tree.lengths)[:, None] * draw.standard_normal(self.best.shape)
            self.nudges += 1
            self.descend(_backward(self.tree, self.best, self.best + shake))

    def keep(self, points: Array) -> float:
        """The error of ``points``: the root of the residuals' sum of squares [m]."""
        residuals = self.residuals(points).values()
        error = math.hypot(*residuals)
        if error < self.error:
            self.best, self.error, self.done = points, error, max(residuals) <= self.tolerance
        return error

    def residuals(self, points: Array) -> dict[str, float]:
        """Tip -> distance left to its target [m]."""
        return {tip: math.dist(points[self.tree.tips[tip]], goal) for tip, goal in self.goals.items()}

    def verdict(self) -> str:
        """Why it ended short of targets that nothing is known to keep out of reach."""
        residuals = self.residuals(self.best)
        worst = max(residuals, key=residuals.__getitem__)
        why = "iteration limit reached" if self.iterations >= self.limit else "stalled"
        return (
            f"{why}: tip {worst!r} is {residuals[worst]:.6g} m off its target "
            f"(iterations: {self.iterations}, nudges: {self.nudges})"
        )

    def descend(self, points: Array) -> None:
        """Iterate from ``points`` until done, stalled or at the limit."""
        errors, reach = [self.keep(points)], 1.0
        while not self.done and self.iterations < self.limit:
            self.iterations += 1
            ahead = _iterate(self.tree, points, self.goals)
            error = self.keep(ahead)
            if len(errors) > WINDOW and error > SLOW * errors[-WINDOW]:
                leap = _backward(self.tree, ahead, ahead + reach * (ahead - points))
                landed = self.keep(leap)
                nearer = landed < error
                reach = 2.0 * reach if nearer else max(reach / 4.0, 1.0)
                if nearer:
                    ahead, error, self.leaps = leap, landed, self.leaps + 1
            points = ahead
            errors.append(error)
            if len(errors) > 2 * WINDOW and min(errors[-WINDOW:]) > STALLED * min(errors[:-WINDOW]):
                return


def _iterate(tree: BallTree, points: Array, goals: Goals) -> Array:
    return _backward(tree, points, _forward(tree, points, goals))


def _forward(tree: BallTree, points: Array, goals: Goals) -> Array:
    """Aims (k, d): targets at the tips, then each joint a link's length from its child, roots let go.

    A joint that several links pull goes to the centroid of where they want it. Joints that none pulls
    stay. Cones are left to the backward stage: narrow ones held here as well stall more often.
    """
    aims = points.copy()
    pulls: list[list[Array]] = [[] for _ in tree.parents]
    wanted = {tree.tips[tip]: goal for tip, goal in goals.items()}
    for joint in reversed(tree.order):
        if joint in wanted:
            aims[joint] = wanted[joint]
        elif pulls[joint]:
            aims[joint] = _centroid(pulls[joint])
        else:
            continue
        parent = tree.parents[joint]
        if parent != ROOT:
            away = unit(points[parent] - aims[joint], points[parent] - points[joint])
            pulls[parent].append(aims[joint] + tree.lengths[joint] * away)
    return aims


def _backward(tree: BallTree, points: Array, aims: Array) -> Array:
    """Points (k, d) from the fixed roots outwards: each link points at its aim (k, d), within its cone.

    A link whose aim is its own start keeps the direction it has in ``points``.
    """
    placed, heading = tree.points.copy(), np.zeros_like(points)
    for joint in tree.order:
        parent, cone = tree.parents[joint], tree.cones.get(joint)
        if parent == ROOT:
            heading[joint] = 0.0 if cone is None or cone.axis is None else unit(np.array(cone.axis, dtype=float))
            continue
        along = unit(aims[joint] - placed[parent], points[joint] - points[parent])
        limit = tree.cones.get(parent)
        if limit is not None:
            along = onto_cone(along, heading[parent], limit.half_angle)
        heading[joint] = along
        placed[joint] = placed[parent] + tree.lengths[joint] * along
    return placed


def _centroid(places: list[Array]) -> Array:
    """The mean (d,), by exact sums: the same to the last bit in whatever order they come."""
    return np.array([math.fsum(values) / len(places) for values in zip(*places, strict=True)])


def _by_root(tree: BallTree, goals: Goals) -> list[Goals]:
    """The targets of each root's tree apart: they do not move each other's joints."""
    groups: dict[int, dict[str, Array]] = {}
    for tip, goal in goals.items():
        groups.setdefault(tree.path(tree.tips[tip])[0], {})[tip] = goal
    return list(groups.values())


def _goals(tree: BallTree, targets: Mapping[str, ArrayLike]) -> dict[str, Array]:
    problems, goals, d = [], {}, tree.points.shape[1]
    if not targets:
        problems.append(Problem("at least one target is needed" + hint("", tree.tips, "tips"), "targets"))
    for tip, target in sorted(targets.items()):  # whatever order they are given in
        if tip not in tree.tips:
            problems.append(Problem("no such tip" + hint(tip, tree.tips, "tips"), f"targets.{tip}"))
            continue
        goal = _vector(target)
        if goal.shape != (d,) or not np.isfinite(goal).all():
            problems.append(
                Problem(f"must be {d} finite numbers, as the points have, got {shown(target)}", f"targets.{tip}")
            )
        goals[tip] = goal
    if problems:
        raise SpecError(problems)
    return goals


def _vector(value: ArrayLike) -> Array:
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError):
        return np.array(math.nan)


def _check(tolerance: float, limit: int) -> None:
    problems = []
    if not 0.0 < tolerance < math.inf:
        problems.append(Problem(f"must be above 0 m and finite, got {tolerance}", "tolerance"))
    if limit < 1:
        problems.append(Problem(f"must be at least 1, got {limit}", "limit"))
    if problems:
        raise SpecError(problems)
