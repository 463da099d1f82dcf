"""Planning round obstacles: smooth detours beside the paper's own procedure and RRTConnect of OMPL.

Run by itself: python benchmarks/planning.py [scenes] [seconds for RRTConnect]. Every path is judged by the whole arm
at all times, whoever made it.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import SpecError
from fzcli.plan.detour_planner import Attempt, certified
from fzcli.plan.planning import NoPlanError, Task, prepare, solve
from fzcli.plan.result import EXCESS, as_plan
from fzcli.plan.rrt_planner import EXTRA, Edges, timed
from fzcli.spec.result import Provenance
from fzcli.sweep.execute import load_sweep
from fzcli.sweep.plan_sweep import PlanDrawing

Array = NDArray[np.float64]
RANGE = 0.8  # rad: longest extension of a tree
SIMPLIFIED = 1.0  # s: of shortcuts
WARM = 5  # scenes planned first and not counted


@dataclass(frozen=True)
class Row:
    """What a planner gave for one scene: whether, how well, in what time [s]."""

    claimed: bool
    clear: bool
    seconds: float
    path_length: float = np.nan
    duration: float = np.nan
    acceleration: float = np.nan


def ompl_missing() -> str:
    """Why OMPL cannot be measured; nothing where it can. Its random numbers are seeded, its messages silenced."""
    try:
        from ompl import util
    except ImportError as error:
        return str(error)
    util.RNG.setSeed(1)
    util.setLogLevel(util.LogLevel.LOG_NONE)
    return ""


def ompl_attempt(task: Task, seconds: float) -> Attempt | None:
    """RRTConnect and shortcuts of OMPL with straight edges checked by fzcli's distances, 3-4-5 by segment."""
    from ompl import base, geometric

    world, nominal = task.world, task.nominal(task.goals[0])
    edges, n = Edges(world, task.spec.margin + EXTRA[0]), world.model.n
    space = base.RealVectorStateSpace(n)
    bounds = base.RealVectorBounds(n)
    for j, (low, high) in enumerate(zip(edges.low, edges.high, strict=True)):
        bounds.setLow(j, float(low))
        bounds.setHigh(j, float(high))
    space.setBounds(bounds)
    information = base.SpaceInformation(space)

    def posture(state: object) -> Array:
        return np.array([state[j] for j in range(n)])  # type: ignore[index]

    class Straight(base.MotionValidator):  # type: ignore[misc, name-defined]
        """All postures of an edge in one call."""

        def checkMotion(self, one: object, other: object) -> bool:  # noqa: N802
            return edges.clear(posture(one), posture(other))

    validator = Straight(information)
    information.setMotionValidator(validator)
    information.setStateValidityChecker(lambda state: edges.clear(posture(state), posture(state)))
    information.setup()
    problem = base.ProblemDefinition(information)
    ends = [information.allocState(), information.allocState()]
    for state, q in zip(ends, (nominal.start, nominal.goal), strict=True):
        for j in range(n):
            state[j] = float(q[j])
    problem.setStartAndGoalStates(*ends)
    planner = geometric.RRTConnect(information)
    planner.setRange(RANGE)
    planner.setProblemDefinition(problem)
    planner.setup()
    if not planner.solve(seconds) or not problem.hasExactSolution():
        return None
    found = problem.getSolutionPath()
    geometric.PathSimplifier(information).simplify(found, SIMPLIFIED)
    corners = [posture(state) for state in found.getStates()]
    path = timed(corners, nominal, task.spec, task.speeds, task.accelerations)
    length = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(corners))
    return Attempt(path, "rrt_connect", length, certified(world, path, task.spec.margin + EXTRA[0]))


def measured(make: Callable[[], tuple[Task, Attempt | None]]) -> Row:
    """Time a planner and measure its path."""
    begin = time.perf_counter()
    try:
        task, attempt = make()
    except (SpecError, NoPlanError):
        attempt = None
    seconds = time.perf_counter() - begin
    if attempt is None:
        return Row(False, False, seconds)
    plan = as_plan(task, attempt, Provenance("", "", ""))
    clear = plan.certificate["clearance_min"] >= 0 and plan.certificate["joint_speed_excess_max"] <= EXCESS
    return Row(True, clear, seconds, *(plan.metrics[k] for k in ("path_length", "duration", "acceleration_max")))


def planning(count: int = 200, seconds: float = 12.0) -> None:
    """Plan every scene of runs/scenes200.yaml four ways, and by OMPL where it is installed, and print the table."""
    missing = ompl_missing()
    if missing:
        print(f"left out: RRTConnect of OMPL ({missing})")
    sweep = load_sweep("scenes200")
    drawing = PlanDrawing(tuple(sweep.specs), sweep.draws, sweep.file.scenes, sweep.file.trajectories.seed)
    names = ["detours alone", "detours, then fallbacks", "RRTConnect of fzcli", "the paper's procedure"]
    if not missing:
        names.append(f"RRTConnect of OMPL, {seconds:g} s")
    rows: dict[str, list[Row]] = {name: [] for name in names}
    for i in (*range(WARM), *range(count)):  # the first only make what all plans of a process share
        specs = drawing.trajectory(i).specs
        for name, spec in zip(names, specs, strict=False):
            rows[name].append(measured(lambda spec=spec: ((task := prepare(spec)), solve(task))))
        if not missing:
            theirs = measured(lambda spec=specs[0]: ((task := prepare(spec)), ompl_attempt(task, seconds)))
            rows[names[-1]].append(theirs)
    rows = {name: found[WARM:] for name, found in rows.items()}
    _report(rows, beside=None if missing else names[-1])


def _report(rows: dict[str, list[Row]], beside: str | None) -> None:
    columns = ("claimed", "clear", "of OMPL's", "length", "duration", "peak acc.", "median", "95 %", "longest")
    print(f"\n{'':30}" + "".join(f"{name:>11}" for name in columns))
    print(f"{'':30}" + "".join(f"{unit:>11}" for unit in ("", "", "", "rad", "s", "rad/s2", "ms", "ms", "ms")))
    theirs = np.array([row.clear for row in rows[beside]]) if beside else np.zeros(0, dtype=bool)
    for name, mine in rows.items():
        clear = np.array([row.clear for row in mine])
        numbers = np.array([[row.path_length, row.duration, row.acceleration] for row in mine])
        with np.errstate(all="ignore"):
            middle = np.nanmedian(numbers, axis=0) if np.isfinite(numbers).any() else [np.nan] * 3
        times = 1e3 * np.array([row.seconds for row in mine])
        share = f"{(clear & theirs).sum() / max(theirs.sum(), 1):.1%}" if beside else "-"
        cells = [f"{sum(row.claimed for row in mine)}", f"{clear.sum()}", share, *(f"{v:.3g}" for v in middle)]
        cells += [f"{value:.0f}" for value in (*np.quantile(times, [0.5, 0.95]), times.max())]
        print(f"{name:30}" + "".join(f"{cell:>11}" for cell in cells))


if __name__ == "__main__":
    planning(*(kind(word) for kind, word in zip((int, float), sys.argv[1:], strict=False)))
