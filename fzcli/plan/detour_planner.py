"""The planner of smooth detours: least weighted detour first, then wider and more of them, then a tree search."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.continuous import PathClearance
from fzcli.plan.detour_search import BEST, DetourProblem, WindowProblem, patterns
from fzcli.plan.joint_path import JointPath
from fzcli.plan.window_ride import Window
from fzcli.plan.world import AnyWorld, Path

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


def certified(
    world: AnyWorld, path: Path, enough: float, begin: float = 0.0, end: float | None = None
) -> PathClearance:
    """The clearance of a path at all times from ``begin`` to ``end`` [s], its own; above ``enough`` [m] nobody asks."""
    last = path.duration if end is None else end
    return world.certified(path, begin, last, CERTIFIED, enough)


def keeps(world: AnyWorld, path: Path, margin: float) -> PathClearance | None:
    """The certified clearance of a path where it keeps the margin, else None."""
    found = certified(world, path, margin + 10 * CERTIFIED)
    return found if found.at_least >= margin - SLACK - CERTIFIED and found.clearance >= margin - SLACK else None


def met_windows(world: AnyWorld, path: Path, margin: float) -> list[Window]:
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


def one_detour(
    problem: DetourProblem, margin: float, steps: int, window: tuple[int, int] | None = None
) -> Attempt | None:
    """The cheapest of the single detours found: from no detour, then from sign patterns of the first joints.

    It stands in the ``window`` of steps, where one is asked for.
    """
    met = met_windows(problem.world, problem.nominal, margin)
    if not met:
        return _clear(problem, margin)
    step = problem.nominal.duration / steps
    windows = candidate_windows(met, problem.nominal.duration, steps)
    if window is not None:
        windows = [((window[0] * step, min(window[1], steps) * step),)]
    shapes = [WindowProblem(problem, one) for one in windows]
    n = len(problem.nominal.start)
    for shape in shapes:
        found = polished(problem, shape, np.zeros(n), margin, "detour")
        if found is not None:
            return found
    tried = np.array(list(patterns(n)))
    starts = [(one, shape, x) for shape in shapes for one, x in zip(shape.violations(tried), tried, strict=True)]
    starts.sort(key=lambda start: float(start[0]))
    attempts = [polished(problem, shape, x, margin, "detour") for _, shape, x in starts[:BEST]]
    good = [attempt for attempt in attempts if attempt is not None]
    return min(good, key=lambda attempt: attempt.cost) if good else None


def _clear(problem: DetourProblem, margin: float) -> Attempt | None:
    clearance = keeps(problem.world, problem.nominal, margin)
    return None if clearance is None else Attempt(problem.nominal, "straight", 0.0, clearance)


def three_detours(problem: DetourProblem, margin: float) -> Attempt | None:
    """Three overlapping detours over the whole path."""
    T, n = problem.nominal.duration, len(problem.nominal.start)
    shape = WindowProblem(problem, ((0.0, 0.5 * T), (0.25 * T, 0.75 * T), (0.5 * T, T)))
    starts = np.array([[*a, *b, *c] for x in patterns(n) for a, b, c in ((x, x, x), (x, x, 0 * x), (0 * x, x, x))])
    best = starts[np.argsort(shape.violations(starts), kind="stable")[: BEST // 2]]
    for x in [np.zeros(3 * n), *best]:
        found = polished(problem, shape, x, margin, "three_detours")
        if found is not None:
            return found
    return None


def polished(problem: DetourProblem, shape: WindowProblem, x: Array, margin: float, method: str) -> Attempt | None:
    """Optimise, certify at all times, and ask for as much more as was missed between the samples."""
    wanted = margin
    for _ in range(POLISHES):
        x, good = shape.optimise(x, wanted)
        if not good:
            return None
        path = problem.path(shape.windows, x)
        past = shape.past_limits(path)
        if past > 0:
            shape.spare_more(2 * past)
            continue
        clearance = certified(problem.world, path, margin + 10 * CERTIFIED, problem.begin)
        short = margin - min(clearance.at_least + CERTIFIED, clearance.clearance)
        if short <= SLACK:
            return Attempt(path, method, float((shape.weights * x * x).sum()), clearance)
        wanted += 1.2 * short + CERTIFIED
    return None


def stretched(path: JointPath, speeds: Array, accelerations: Array) -> JointPath:
    """The same path in as much more time as its fastest joint needs."""
    _, qd, qdd = path.at(np.linspace(0.0, path.duration, 1001))
    ratio = float((np.abs(qd) / speeds).max(initial=0.0))
    ratio = max(ratio, float(np.sqrt((np.abs(qdd) / accelerations).max(initial=0.0))))
    if ratio <= 1.0 + 1e-6:
        return path
    ratio *= 1 + 1e-4  # between the samples
    detours = tuple(replace(d, begin=d.begin * ratio, end=d.end * ratio, dwell=d.dwell * ratio) for d in path.detours)
    return replace(path, duration=path.duration * ratio, detours=detours)
