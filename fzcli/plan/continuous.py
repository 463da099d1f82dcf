"""The whole path against the whole scene at all times: certified clearance and times of contact.

A distance at the middle of a stretch of time, less what can change in half of it, bounds it on all of the
stretch. Stretches that this leaves open are halved, so that no contact between samples is missed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fzcli.model import RobotModel
from fzcli.model.collision import ORIGIN, UPRIGHT, Clearance, Pair, many
from fzcli.model.motion_bound import BaseSpeedBound
from fzcli.plan.scene import Scene

Array = NDArray[np.float64]
BasePose = Callable[[Array], tuple[Array, Array]]
CELLS = 32  # stretches to start from, each with its own bounds of all speeds
BUDGET = 200_000  # postures looked at, at most
TOLERANCE = 1e-5  # m
RESOLUTION = 1e-4  # s


class TimedPath(Protocol):
    """A joint path in time: q, qd, qdd (T, n) at times (T,), and a bound (n) of |qd| between two times."""

    def at(self, time: Array) -> tuple[Array, Array, Array]: ...

    def speed_bound(self, begin: float, end: float) -> Array: ...


@dataclass(frozen=True)
class Motion:
    """What moves during a check: a robot's joints, its base and the obstacles.

    ``base``: increasing times (T,) -> positions (T, 3) [m] and quaternions (T, 4) of the base frame in the world;
    needed on a floating base, whose speed is bounded from the joints' at zero momentum.
    """

    model: RobotModel
    path: TimedPath
    scene: Scene
    base: BasePose | None = None


@dataclass(frozen=True)
class PathClearance:
    """The smallest distance met on a path.

    ``clearance`` [m]: the smallest that was seen, at ``time`` [s], of ``pair``; ``at_least`` [m]: no smaller one
    exists on the path; ``samples``: postures looked at. ``pair`` is None where nothing can be met.
    """

    clearance: float
    at_least: float
    time: float
    pair: Pair | None
    samples: int


@dataclass(frozen=True)
class Stretches:
    """Stretches of time in order: middles and half lengths [s], the cell that each lies in."""

    middle: Array
    half: Array
    cell: NDArray[np.intp]

    @staticmethod
    def between(begin: float, end: float) -> tuple["Stretches", list[tuple[float, float]]]:
        """The stretches to start from, one a cell, and the cells' begins and ends [s]."""
        edges = np.linspace(begin, end, CELLS + 1)
        half = np.diff(edges) / 2
        cells = list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
        return Stretches(edges[:-1] + half, half, np.arange(CELLS)), cells

    def some(self, chosen: NDArray[np.bool_]) -> "Stretches":
        return Stretches(self.middle[chosen], self.half[chosen], self.cell[chosen])

    def halved(self) -> "Stretches":
        quarter = 0.5 * self.half
        middle = np.column_stack([self.middle - quarter, self.middle + quarter]).ravel()
        return Stretches(middle, np.repeat(quarter, 2), np.repeat(self.cell, 2))


class Bounds(Protocol):
    """What a check asks: the stretches ``start`` to begin with, and distances with what they can change by."""

    @property
    def start(self) -> Stretches: ...

    def at(self, stretches: Stretches) -> tuple[Array, Array]:
        """Distances (T, m) at the middles of stretches and how far each can change within (T, m), [m]."""
        ...


class _Bounds:
    """Distances at the middles of stretches, and how far they can change within each."""

    def __init__(self, clearance: Clearance, motion: Motion, begin: float, end: float) -> None:
        self.clearance, self.motion = clearance, motion
        if motion.model.floating and motion.base is None:
            raise ValueError("a floating base moves along the path: its poses are needed")
        self.start, cells = Stretches.between(begin, end)
        self.joints = np.array([motion.path.speed_bound(*cell) for cell in cells])
        self.obstacles = np.array([motion.scene.speed_bounds(*cell) for cell in cells])
        self.base = np.zeros((2, CELLS))
        if motion.model.floating:
            self.base = np.array(BaseSpeedBound(motion.model.tree)(self.joints))

    def at(self, stretches: Stretches) -> tuple[Array, Array]:
        """Distances (T, m) and how far each can change (T, m), [m]."""
        time, cell, half = stretches.middle, stretches.cell, stretches.half[:, None]
        position, quat = (np.array(ORIGIN), np.array(UPRIGHT))
        if self.motion.base is not None:
            position, quat = self.motion.base(time)
        distance, reach = many(
            self.clearance.bounds,
            self.motion.path.at(time)[0],
            position,
            quat,
            self.motion.scene.numbers(time),
            self.joints[cell] * half,
            self.base[0, cell][:, None] * half,
            self.base[1, cell][:, None] * half,
            self.obstacles[cell] * half,
        )
        return distance, reach


def path_clearance(
    clearance: Clearance,
    motion: Motion,
    begin: float,
    end: float,
    *,
    tolerance: float = TOLERANCE,
    enough: float = np.inf,
    budget: int = BUDGET,
) -> PathClearance:
    """The smallest distance of all pairs between two times, certified.

    ``clearance - at_least`` is at most ``tolerance`` [m] unless the budget ends first, or both are above
    ``enough`` [m], from where on nobody asks.

    Raises:
        ValueError: a floating base without its poses.
    """
    if not clearance.pairs:
        return PathClearance(np.inf, np.inf, begin, None, 0)
    bounds = _Bounds(clearance, motion, begin, end)
    return least_of(bounds, clearance.pairs, tolerance=tolerance, enough=enough, budget=budget)


def least_of(
    bounds: Bounds, pairs: Sequence[Pair], *, tolerance: float = TOLERANCE, enough: float = np.inf, budget: int = BUDGET
) -> PathClearance:
    """The smallest of the distances of ``pairs`` in the time of some bounds; see `path_clearance`."""
    stretches, samples, at_least = bounds.start, 0, np.inf
    best, when, which = np.inf, float(stretches.middle[0]), 0
    while len(stretches.middle):
        distance, reach = bounds.at(stretches)
        samples += len(distance)
        row, column = np.unravel_index(int(distance.argmin()), distance.shape)
        if distance[row, column] < best:
            best, when, which = float(distance[row, column]), float(stretches.middle[row]), int(column)
        lower = (distance - reach).min(axis=1)
        open_ones = lower < min(best - tolerance, enough)
        if samples + 2 * np.count_nonzero(open_ones) > budget:
            open_ones[:] = False
        at_least = min(at_least, float(lower[~open_ones].min(initial=np.inf)))
        stretches = stretches.some(open_ones).halved()
    return PathClearance(best, min(at_least, best), when, pairs[which], samples)


def contact_windows(
    clearance: Clearance,
    motion: Motion,
    begin: float,
    end: float,
    *,
    margin: float = 0.0,
    resolution: float = RESOLUTION,
) -> list[tuple[float, float]]:
    """The times [s] between which some distance may be below ``margin`` [m]; at all others none is.

    Ends are found to ``resolution`` [s]; windows that come closer than that are one.

    Raises:
        ValueError: a floating base without its poses.
    """
    if not clearance.pairs:
        return []
    bounds = _Bounds(clearance, motion, begin, end)
    stretches = bounds.start
    found: list[tuple[float, float]] = []
    while len(stretches.middle):
        distance, reach = bounds.at(stretches)
        near = (distance - reach).min(axis=1) < margin
        inside = (distance + reach).min(axis=1) < margin
        settled = near & (inside | (stretches.half <= 0.5 * resolution))
        done = stretches.some(settled)
        found += zip((done.middle - done.half).tolist(), (done.middle + done.half).tolist(), strict=True)
        stretches = stretches.some(near & ~settled).halved()
    return _merged(sorted(found), resolution)


def _merged(pieces: list[tuple[float, float]], gap: float) -> list[tuple[float, float]]:
    windows: list[tuple[float, float]] = []
    for start, stop in pieces:
        if windows and start - windows[-1][1] < gap:
            windows[-1] = (windows[-1][0], max(stop, windows[-1][1]))
        else:
            windows.append((start, stop))
    return windows
