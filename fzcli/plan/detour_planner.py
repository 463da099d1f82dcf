"""The planner of smooth detours: least weighted detour first, then wider and more of them, then a tree search."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.continuous import Motion, PathClearance, path_clearance
from fzcli.plan.detour_search import BEST, DetourProblem, Window, WindowProblem, patterns
from fzcli.plan.joint_path import JointPath
from fzcli.plan.world import Path, World

Array = NDArray[np.float64]
SIDE = 3  # steps that a window stands out beyond what is met, on either side
POLISHES = 4  # times that the margin is raised by what was missed between samples
CERTIFIED = 1e-4  # m: how sharply the clearance of a plan is certified
SLACK = 1e-6  # m: by which a margin may be missed
LOOKED_AT = 201  # samples of the nominal path


@dataclass(frozen=True)
class Attempt:
    """A path that keeps clear, how it was found, its cost, and its certified clearance."""

    path: Path
    method: str
    cost: float
    clearance: PathClearance


def certified(world: World, path: Path, enough: float) -> PathClearance:
    """The clearance of a whole path at all times; above ``enough`` [m] nobody asks."""
    base = (lambda times: _poses(world, path, times)) if world.model.floating else _standing(world)
    motion = Motion(world.model, path, world.scene, base)
    return path_clearance(world.clearance, motion, 0.0, path.duration, tolerance=CERTIFIED, enough=enough)


def _standing(world: World) -> Callable[[Array], tuple[Array, Array]]:
    return lambda times: (
        np.tile(world.base_position, (len(times), 1)),
        np.tile(world.base_quat, (len(times), 1)),
    )


def _poses(world: World, path: Path, times: Array) -> tuple[Array, Array]:
    """Of the free base at times in any order."""
    order = np.argsort(times, kind="stable")
    position, quat = world.base(path, times[order])
    back = np.argsort(order, kind="stable")
    return position[back], quat[back]


def keeps(world: World, path: Path, margin: float) -> PathClearance | None:
    """The certified clearance of a path where it keeps the margin, else None."""
    found = certified(world, path, margin + 10 * CERTIFIED)
    return found if found.at_least >= margin - SLACK - CERTIFIED and found.clearance >= margin - SLACK else None


def met_windows(world: World, path: Path, margin: float) -> list[Window]:
    """When a path comes nearer than the margin, looked at in ``LOOKED_AT`` samples [s]."""
    times = np.linspace(0.0, path.duration, LOOKED_AT)
    near = world.distances(path, times).min(axis=1, initial=np.inf) < margin
    edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
    return [(float(times[a]), float(times[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def candidate_windows(met: Sequence[Window], duration: float, steps: int) -> list[tuple[Window, ...]]:
    """Windows for one detour: ``SIDE`` steps about all that is met, in whole steps, and the whole path."""
    step = duration / steps
    begin = max(0, int(np.floor(met[0][0] / step + 1e-9)) - SIDE)
    end = min(steps, int(np.ceil(met[-1][1] / step - 1e-9)) + SIDE)
    return [((begin * step, end * step),), ((0.0, duration),)]


def one_detour(problem: DetourProblem, margin: float, steps: int) -> Attempt | None:
    """The cheapest of the single detours found: from no detour, then from sign patterns of the first joints."""
    met = met_windows(problem.world, problem.nominal, margin)
    if not met:
        return _clear(problem, margin)
    shapes = [WindowProblem(problem, windows) for windows in candidate_windows(met, problem.nominal.duration, steps)]
    n = len(problem.nominal.start)
    for shape in shapes:
        found = _polished(problem, shape, np.zeros(n), margin, "detour")
        if found is not None:
            return found
    starts = [(shape, x) for shape in shapes for x in patterns(n)]
    starts.sort(key=lambda start: start[0].violation(start[1]))
    attempts = [_polished(problem, shape, x, margin, "detour") for shape, x in starts[:BEST]]
    good = [attempt for attempt in attempts if attempt is not None]
    return min(good, key=lambda attempt: attempt.cost) if good else None


def _clear(problem: DetourProblem, margin: float) -> Attempt | None:
    clearance = keeps(problem.world, problem.nominal, margin)
    return None if clearance is None else Attempt(problem.nominal, "straight", 0.0, clearance)


def three_detours(problem: DetourProblem, margin: float, steps: int) -> Attempt | None:
    """Three overlapping detours over the whole path."""
    T, n = problem.nominal.duration, len(problem.nominal.start)
    shape = WindowProblem(problem, ((0.0, 0.5 * T), (0.25 * T, 0.75 * T), (0.5 * T, T)))
    starts = [np.concatenate(parts) for x in patterns(n) for parts in ((x, x, x), (x, x, 0 * x), (0 * x, x, x))]
    starts.sort(key=shape.violation)
    for x in [np.zeros(3 * n), *starts[:BEST]]:
        found = _polished(problem, shape, x, margin, "three_detours")
        if found is not None:
            return found
    return None


def _polished(problem: DetourProblem, shape: WindowProblem, x: Array, margin: float, method: str) -> Attempt | None:
    """Optimise, certify at all times, and ask for as much more as was missed between the samples."""
    wanted = margin
    for _ in range(POLISHES):
        x, good = shape.optimise(x, wanted)
        if not good:
            return None
        path = problem.path(shape.windows, x)
        clearance = certified(problem.world, path, margin + 10 * CERTIFIED)
        short = margin - min(clearance.at_least + CERTIFIED, clearance.clearance)
        if short <= SLACK:
            return Attempt(path, method, float((shape.weights * x * x).sum()), clearance)
        wanted += 1.2 * short + CERTIFIED
    return None


def stretched(path: JointPath, speeds: Array) -> JointPath:
    """The same path in as much more time as its fastest joint needs."""
    times = np.linspace(0.0, path.duration, 1001)
    with np.errstate(invalid="ignore"):
        ratio = float((np.abs(path.at(times)[1]) / speeds).max(initial=0.0))
    if ratio <= 1.0:
        return path
    ratio *= 1 + 1e-4  # between the samples
    detours = tuple(replace(d, begin=d.begin * ratio, end=d.end * ratio, dwell=d.dwell * ratio) for d in path.detours)
    return replace(path, duration=path.duration * ratio, detours=detours)
