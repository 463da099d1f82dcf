"""RRTConnect, shortcuts, and the time law from corner to corner: the fallback where no smooth detour is found.

Our own, of some lines, because OMPL's generator is global: in one process the same seed would not give the same plan.
Kuffner and LaValle 2000.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.detour_planner import SLACK, Attempt, certified
from fzcli.plan.joint_path import JointPath, fastest
from fzcli.plan.plan_spec import PlanRun, acceleration_limits
from fzcli.plan.world import World

Array = NDArray[np.float64]
STRIDE = 0.6  # rad or m: of an extension, in the joint that goes farthest
SPACING = 0.03  # rad or m: between the postures looked at on an edge
SHORTCUTS = 300
SHORTEST = 0.1  # rad or m: of an edge, in the joint that goes farthest; a shorter one takes as long
EXTRA = (1e-3, 5e-3)  # m: kept beyond the margin for what lies between the postures, at first and if that misses


@dataclass(frozen=True)
class ChainedPath:
    """Joint paths one after the other, at rest in each corner."""

    parts: tuple[JointPath, ...]

    @property
    def duration(self) -> float:
        """Of all parts [s]."""
        return sum(part.duration for part in self.parts)

    @property
    def start(self) -> Array:
        """Where the first begins, (n)."""
        return self.parts[0].start

    @property
    def goal(self) -> Array:
        """Where the last ends, (n)."""
        return self.parts[-1].goal

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """q, qd, qdd at times (T,), each (T, n)."""
        t = np.atleast_1d(np.asarray(time, dtype=np.float64))
        edges = np.cumsum([0.0, *(part.duration for part in self.parts)])
        which = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, len(self.parts) - 1)
        found = np.zeros((3, len(t), len(self.start)))
        for i, part in enumerate(self.parts):
            mine = which == i
            if mine.any():
                found[:, mine] = np.array(part.at(t[mine] - edges[i]))
        return found[0], found[1], found[2]

    def speed_bound(self, begin: float, end: float) -> Array:
        """No joint is faster than this between two times, (n)."""
        bound, at = np.zeros(len(self.start)), 0.0
        for part in self.parts:
            if at < end and at + part.duration > begin:
                bound = np.maximum(bound, part.speed_bound(max(0.0, begin - at), min(part.duration, end - at)))
            at += part.duration
        return bound


@dataclass
class _Tree:
    """Postures (k, n) grown from a root, and the parent of each."""

    postures: list[Array]
    parents: list[int] = field(default_factory=lambda: [-1])

    def nearest(self, q: Array) -> int:
        return int(np.square(np.array(self.postures) - q).sum(axis=1).argmin())

    def add(self, q: Array, parent: int) -> int:
        self.postures.append(q)
        self.parents.append(parent)
        return len(self.postures) - 1

    def to_root(self, place: int) -> list[Array]:
        found = []
        while place >= 0:
            found.append(self.postures[place])
            place = self.parents[place]
        return found


class Edges:
    """Whether straight joint motions keep clear in a scene that stands still, the base standing as well."""

    def __init__(self, world: World, margin: float) -> None:
        self.world, self.margin = world, margin
        self.numbers = world.scene.numbers(np.zeros(1))[0]
        low, high = world.model.tree.position_limits.T
        self.low, self.high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)

    def clear(self, a: Array, b: Array) -> bool:
        """All postures from a to b, ``SPACING`` apart."""
        count = max(2, int(np.ceil(np.abs(b - a).max() / SPACING)) + 1)
        q = a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)
        world = self.world
        distances = world.clearance.at(q, self.numbers, world.base_position, world.base_quat)
        return bool(distances.min(initial=np.inf) >= self.margin)


def rrt_connect(world: World, nominal: JointPath, spec: PlanRun, iterations: int, seed: int) -> Attempt | None:
    """A path over corners, within joint speeds, from the nominal's start to its goal; None without one.

    Where obstacles or the base move, straight joint edges mean nothing by themselves: no path.
    """
    if world.scene.moving or world.model.floating:
        return None
    limits = world.model.tree.speed_limits, acceleration_limits(spec, world.model.n)
    for extra in EXTRA:
        edges, random = Edges(world, spec.margin + extra), np.random.default_rng(seed)
        corners = _connect(edges, nominal.start, nominal.goal, iterations, random)
        if corners is None:
            return None
        corners = _shortened(edges, corners, random)
        path = timed(corners, nominal, spec, *limits)
        clearance = certified(world, path, spec.margin + EXTRA[0])
        if clearance.at_least >= spec.margin - SLACK:
            length = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(corners))
            return Attempt(path, "rrt_connect", length, clearance)
    return None


def _connect(
    edges: Edges, start: Array, goal: Array, iterations: int, random: np.random.Generator
) -> list[Array] | None:
    one, other, swapped = _Tree([start]), _Tree([goal]), False
    if edges.clear(start, goal):
        return [start, goal]
    for _ in range(iterations):
        wanted = random.uniform(edges.low, edges.high)
        reached = _extend(edges, one, wanted)
        if reached is not None:
            met = _reach(edges, other, one.postures[reached])
            if met is not None:
                first, second = one.to_root(reached)[::-1], other.to_root(met)
                corners = first + second[1:]
                return corners[::-1] if swapped else corners
        one, other, swapped = other, one, not swapped
    return None


def _extend(edges: Edges, tree: _Tree, wanted: Array) -> int | None:
    """One stride towards a posture; the place of the new one."""
    near = tree.nearest(wanted)
    way = wanted - tree.postures[near]
    new = tree.postures[near] + way * min(1.0, STRIDE / max(float(np.abs(way).max()), 1e-300))
    return tree.add(new, near) if edges.clear(tree.postures[near], new) else None


def _reach(edges: Edges, tree: _Tree, wanted: Array) -> int | None:
    """Stride after stride towards a posture; its place once it is reached."""
    while True:
        place = _extend(edges, tree, wanted)
        if place is None:
            return None
        if np.array_equal(tree.postures[place], wanted) or np.abs(tree.postures[place] - wanted).max() < 1e-12:
            return place


def _shortened(edges: Edges, corners: list[Array], random: np.random.Generator) -> list[Array]:
    """Random shortcuts between points of the edges that leave none shorter than ``SHORTEST``."""
    for _ in range(SHORTCUTS):
        if len(corners) < 3:
            return corners
        i, j = sorted(random.choice(len(corners) - 1, 2, replace=False))
        a = _between(corners[i], corners[i + 1], random.random())
        b = _between(corners[j], corners[j + 1], random.random())
        if np.abs(b - a).max() >= SHORTEST and edges.clear(a, b):
            kept = [*corners[: i + 1], a, b, *corners[j + 1 :]]
            corners = [q for k, q in enumerate(kept) if k == 0 or not np.array_equal(q, kept[k - 1])]
    return _without_needless(edges, corners)


def _between(a: Array, b: Array, share: float) -> Array:
    """A point of an edge; its end where that is nearer than ``SHORTEST``."""
    length = float(np.abs(b - a).max())
    if min(share, 1 - share) * length < SHORTEST:
        return a if share < 0.5 else b
    return np.asarray(a + share * (b - a))


def _without_needless(edges: Edges, corners: list[Array]) -> list[Array]:
    """Without the corners between which and their neighbours the straight way is clear as well."""
    kept, i = [corners[0]], 0
    while i < len(corners) - 1:
        clear = (j for j in range(len(corners) - 1, i + 1, -1) if edges.clear(corners[i], corners[j]))
        i = next(clear, i + 1)
        kept.append(corners[i])
    return kept


def timed(
    corners: list[Array], nominal: JointPath, spec: PlanRun, speeds: Array, accelerations: Array
) -> ChainedPath:
    """The time law from corner to corner, as fast as the joints may, and slower where more time is asked for.

    Edges shorter than ``SHORTEST`` are taken as slowly as if they were that long: from rest to rest at full speed a
    sliver would need any acceleration.
    """
    shortest = [_shortest(b - a, speeds, accelerations, spec) for a, b in pairwise(corners)]
    total = sum(shortest) * (1 + 1e-9)
    scale = max(1.0, (nominal.duration if spec.duration != "fastest" else 0.0) / total) * (1 + 1e-9)
    parts = [
        JointPath(a, b - a, seconds * scale, spec.law)
        for a, b, seconds in zip(corners[:-1], corners[1:], shortest, strict=True)
    ]
    return ChainedPath(tuple(parts))


def _shortest(way: Array, speeds: Array, accelerations: Array, spec: PlanRun) -> float:
    """Time [s] for an edge."""
    farthest = float(np.abs(way).max())
    longer = way * (SHORTEST / farthest) if 0 < farthest < SHORTEST else way
    return max(fastest(np.zeros_like(way), longer, speeds, accelerations, spec.law), 1e-6)
