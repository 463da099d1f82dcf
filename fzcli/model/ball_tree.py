"""Trees of links joined by ball joints: what FABRIK solves, checked once when it is made."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fzcli.errors import Problem, SpecError
from fzcli.model.joint_cone import Array, Cone

ROOT = -1  # the parent of a root


@dataclass(frozen=True, eq=False)
class BallTree:
    """Links between ball joints in two or three dimensions, with fixed roots and named tips.

    ``points`` (k, d) [m], d = 2 or 3: the joints and tips as they stand; ``parents`` (k): index of the
    point at the other end of the incoming link, -1 for a root, in any order; ``tips``: name -> index
    of a point without outgoing links; ``cones``: index of a joint -> limit of its outgoing links.
    Raises SpecError with every problem found.
    """

    points: Array
    parents: tuple[int, ...]
    tips: Mapping[str, int]
    cones: Mapping[int, Cone] = field(default_factory=dict)

    def __post_init__(self) -> None:
        points = _points(self.points)
        points.flags.writeable = False
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "parents", _parents(self.parents, len(points)))
        object.__setattr__(self, "tips", dict(self.tips))
        object.__setattr__(self, "cones", dict(self.cones))
        problems = [*_tip_problems(self), *_cone_problems(self)]
        if problems:
            raise SpecError(problems)

    @classmethod
    def chain(cls, points: ArrayLike, tip: str = "tip", cones: Mapping[int, Cone] | None = None) -> "BallTree":
        """One serial chain through ``points`` (k, d) [m]: the first is the root, the last the tip."""
        places = _points(points)
        return cls(places, tuple(range(ROOT, len(places) - 1)), {tip: len(places) - 1}, cones or {})

    @cached_property
    def order(self) -> tuple[int, ...]:
        """All points, each after its parent."""
        order = [joint for joint, parent in enumerate(self.parents) if parent == ROOT]
        for joint in order:  # grows on the way
            order.extend(self.children[joint])
        return tuple(order)

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """Per point, the points at the far ends of its outgoing links."""
        found: list[list[int]] = [[] for _ in self.parents]
        for joint, parent in enumerate(self.parents):
            if parent != ROOT:
                found[parent].append(joint)
        return tuple(tuple(joints) for joints in found)

    @cached_property
    def lengths(self) -> tuple[float, ...]:
        """Per point, the length of its incoming link [m]; 0 at a root."""
        ends = zip(self.points, self.parents, strict=True)
        return tuple(0.0 if p == ROOT else float(np.linalg.norm(here - self.points[p])) for here, p in ends)

    def path(self, joint: int) -> tuple[int, ...]:
        """The points from the root to ``joint``, both included."""
        path = [joint]
        while self.parents[path[0]] != ROOT:
            path.insert(0, self.parents[path[0]])
        return tuple(path)


def _points(points: ArrayLike) -> Array:
    try:
        places = np.array(points, dtype=float)
    except (TypeError, ValueError):
        raise SpecError(Problem("must be an array of k points in 2 or 3 dimensions", "points")) from None
    if places.ndim != 2 or places.shape[1] not in (2, 3) or len(places) == 0:
        raise SpecError(Problem(f"must be (k, 2) or (k, 3), got shape {places.shape}", "points"))
    bad = np.flatnonzero(~np.isfinite(places).all(axis=1))
    if len(bad):
        raise SpecError([Problem(f"must be finite, got {places[i].tolist()}", f"points[{i}]") for i in bad])
    return places


def _parents(parents: Sequence[int], k: int) -> tuple[int, ...]:
    found = tuple(parents)
    if len(found) != k:
        raise SpecError(Problem(f"must give one index for each of the {k} points, got {len(found)}", "parents"))
    rule = f"must be the index of a point, 0 to {k - 1}, or {ROOT} for a root"
    strange = [Problem(f"{rule}, got {p}", f"parents[{i}]") for i, p in enumerate(found) if not _within(p, ROOT, k)]
    if strange:
        raise SpecError(strange)
    rooted = {ROOT}
    while fresh := [i for i, parent in enumerate(found) if parent in rooted and i not in rooted]:
        rooted.update(fresh)
    loose = [i for i in range(k) if i not in rooted]
    if loose:
        raise SpecError(Problem(f"points {loose} hang on no root: their links form a ring", "parents"))
    return found


def _within(index: int, first: int, end: int) -> bool:
    return isinstance(index, int | np.integer) and first <= index < end


def _tip_problems(tree: BallTree) -> list[Problem]:
    if not tree.tips:
        return [Problem("at least one tip is needed", "tips")]
    problems, k = [], len(tree.points)
    for name, joint in tree.tips.items():
        if not _within(joint, 0, k):
            problems.append(Problem(f"must be the index of a point, 0 to {k - 1}, got {joint}", f"tips.{name}"))
        elif tree.parents[joint] == ROOT:
            problems.append(Problem(f"point {joint} is a root and cannot move", f"tips.{name}"))
        elif tree.children[joint]:
            problems.append(Problem(f"point {joint} has outgoing links: a tip ends its chain", f"tips.{name}"))
    if len(set(tree.tips.values())) < len(tree.tips):
        problems.append(Problem("two tips share one point", "tips"))
    return problems


def _cone_problems(tree: BallTree) -> list[Problem]:
    return [
        Problem(message, f"cones[{joint}]")
        for joint, cone in tree.cones.items()
        for message in _faults(tree, joint, cone)
    ]


def _faults(tree: BallTree, joint: int, cone: Cone) -> list[str]:
    k, d = tree.points.shape
    if not _within(joint, 0, k):
        return [f"names no joint: must be 0 to {k - 1}"]
    faults = []
    if not 0.0 < cone.half_angle <= np.pi:
        faults.append(f"half_angle must be above 0 and at most pi rad, got {cone.half_angle}")
    if not tree.children[joint]:
        faults.append("has no outgoing link to limit")
    if tree.parents[joint] != ROOT and cone.axis is not None:
        faults.append("axis belongs to roots only: here the incoming link is the axis")
    if tree.parents[joint] == ROOT:
        axis = np.array(() if cone.axis is None else cone.axis, dtype=float)
        if axis.shape != (d,) or not np.isfinite(axis).all() or not axis.any():
            faults.append(f"a root's cone needs an axis of {d} finite numbers, not all zero, got {cone.axis}")
    elif tree.lengths[joint] == 0.0:
        faults.append("its incoming link has length 0, so the cone has no axis")
    faults += [
        f"its link to point {c} has length 0 and no direction" for c in tree.children[joint] if not tree.lengths[c]
    ]
    return faults
