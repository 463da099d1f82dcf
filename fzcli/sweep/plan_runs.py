"""Run a sweep of plans: a trajectory at a time, in processes; judge every plan by the whole arm at all times."""

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import FzcliError, SpecError
from fzcli.loop.simulate import versions
from fzcli.plan.plan import Plan
from fzcli.plan.plan_spec import PlanRun
from fzcli.plan.planning import NoPlanError, prepare, solve
from fzcli.plan.result import CERTIFICATE, METRICS, as_plan
from fzcli.record.plan_file import as_rollout
from fzcli.record.sweep_record import KeptRun, SweepRecord
from fzcli.record.table import check_names
from fzcli.record.table_spec import TableSpec
from fzcli.spec.hashing import spec_hash
from fzcli.spec.quantity import Signal
from fzcli.spec.reader import dump
from fzcli.spec.result import STATUS_NAMES, Provenance
from fzcli.spec.units import unit_at
from fzcli.sweep.plan_sweep import PlanDrawing, PlanSweep

Array = NDArray[np.float64]
Tell = Callable[[str, int, int], None]
METHODS = ("straight", "detour", "three_detours", "rrt_connect", "paper")
TRUTHS = {
    "claimed": "the planner gave a path",
    "solved": "the path keeps margin, limits and speeds at all times, and meets the goal",
    "contact": "the whole arm meets something on the path; of the paths that were given",
    "within_speeds": "no joint is faster than its limit; of the paths that were given",
}
INFO = {
    **{name: Signal(name, "1", text, truth=True) for name, text in TRUTHS.items()},
    "plan_time": Signal("plan_time", "s", "wall time of planning, on the machine that ran it; no result depends on it"),
    "method": Signal("method", "1", "; ".join(f"{code}: {name}" for code, name in enumerate(METHODS))),
    **{name: Signal(name, *about) for name, about in {**METRICS, **CERTIFICATE}.items()},
}
RANK = "path_length"  # by which the kept runs are chosen among those with a path
ROLES = ("best", "median", "worst")
Row = dict[str, float]


def run_plans(
    sweep: PlanSweep, table: TableSpec | None, jobs: int, tell: Tell, argv: Sequence[str] = ()
) -> SweepRecord:
    """Plan all trajectories by all configurations; nothing but ``plan_time`` depends on ``jobs``.

    Raises FilterError where a trajectory gets no scene, SpecError for a table of what there is not.
    """
    if table is not None:
        check_table(sweep, table)
    plan, configs = sweep.file.trajectories, len(sweep.specs)
    drawing = PlanDrawing(tuple(sweep.specs), sweep.draws, sweep.file.scenes, plan.seed)
    indices = range(plan.first, plan.first + plan.count)
    found = []
    tell("planning", 0, plan.count * configs)
    for rows, drawn in _each(drawing, indices, jobs):
        found.append((rows, drawn))
        tell("planning", len(found) * configs, plan.count * configs)
    runs = [rows[c] for c in range(configs) for rows, _ in found]
    metrics: dict[str, NDArray[Any]] = {name: np.array([row.get(name, np.nan) for row in runs]) for name in INFO}
    metrics["config"] = np.repeat(np.arange(configs), plan.count)
    metrics["trajectory"] = np.tile(np.array(indices), configs)
    metrics["status"] = np.array([row["status"] for row in runs], dtype=np.int8)
    origin = _origin(sweep, argv)
    paths = {path: np.array([drawn[path] for _, drawn in found]) for path in found[0][1]}
    return SweepRecord(
        configs=sweep.changes,
        metrics=metrics,
        metric_info={**INFO, **_units(sweep, paths)},
        certificate_names=tuple(CERTIFICATE),
        draws=paths,
        draw_info={},
        kept=tuple(_kept(sweep, drawing, metrics, origin)),
        provenance=origin,
    )


def check_table(sweep: PlanSweep, table: TableSpec) -> None:
    """Raises SpecError, placed, where the table asks for what the sweep has not."""
    try:
        check_names(sweep.changes, INFO, table)
    except FzcliError as error:
        text = str(error).removeprefix("table: ")
        raise SpecError(sweep.document.problem(text, ("table",))) from None


def _each(drawing: PlanDrawing, indices: range, jobs: int) -> Iterator[tuple[list[Row], dict[str, Any]]]:
    """The rows of every trajectory, in order."""
    if min(jobs, len(indices)) == 1:
        yield from (_planned(drawing, index) for index in indices)
        return
    fresh = multiprocessing.get_context("spawn")  # a fork would copy locks that other threads hold
    with ProcessPoolExecutor(min(jobs, len(indices)), fresh, _begin, (drawing,)) as pool:
        try:
            yield from pool.map(_work, indices)
        finally:
            pool.shutdown(cancel_futures=True)


_given: list[PlanDrawing] = []  # what this process works on


def _begin(drawing: PlanDrawing) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process hears it and ends the others
    _given[:] = [drawing]


def _work(index: int) -> tuple[list[Row], dict[str, Any]]:
    return _planned(_given[0], index)


def _planned(drawing: PlanDrawing, index: int) -> tuple[list[Row], dict[str, Any]]:
    trajectory = drawing.trajectory(index)
    return [row_of(spec) for spec in trajectory.specs], trajectory.drawn


def row_of(spec: PlanRun) -> Row:
    """One plan, made and measured; without a path the row says only that, and the time it took."""
    begin = time.perf_counter()
    plan, seconds = _plan(spec)
    seconds = seconds or time.perf_counter() - begin
    if plan is None:
        return {"claimed": 0.0, "solved": 0.0, "plan_time": seconds, "status": float(STATUS_NAMES.index("failed"))}
    return {
        "claimed": 1.0,
        "solved": float(plan.status.name == "ok"),
        "contact": float(plan.certificate["clearance_min"] < 0),
        "within_speeds": float(plan.certificate["joint_speed_excess_max"] == 0),
        "plan_time": seconds,
        "method": float(METHODS.index(plan.method.partition(",")[0])),
        "status": float(plan.status.code),
        **plan.metrics,
        **plan.certificate,
    }


def _plan(spec: PlanRun, origin: Provenance | None = None) -> tuple[Plan | None, float]:
    """The plan, and the time to its certified path [s]; none where start or goal make no sense or no path is found."""
    begin = time.perf_counter()
    try:
        task = prepare(spec)
        attempt = solve(task)
    except (SpecError, NoPlanError):
        return None, 0.0
    seconds = time.perf_counter() - begin
    return as_plan(task, attempt, origin or Provenance("", "", "")), seconds


def _kept(
    sweep: PlanSweep, drawing: PlanDrawing, metrics: dict[str, NDArray[Any]], origin: Provenance
) -> Iterator[KeptRun]:
    """Best, median and worst plan of every configuration, made again with its path."""
    for c in range(len(sweep.specs)):
        mine = np.flatnonzero((metrics["config"] == c) & (metrics["claimed"] == 1))
        order = mine[np.argsort(metrics[RANK][mine], kind="stable")]
        chosen: dict[int, str] = {}
        for role, place in zip(ROLES, (0, (len(order) - 1) // 2, len(order) - 1), strict=True):
            if len(order):
                chosen.setdefault(int(metrics["trajectory"][order[place]]), role)
        for index, role in chosen.items():
            spec = drawing.trajectory(index).specs[c]
            resolved = spec.model_dump(mode="json")
            own = replace(origin, spec_text=dump(resolved), spec_hash=spec_hash(resolved))
            plan, _ = _plan(spec, own)
            if plan is not None:
                yield KeptRun(c, index, role, as_rollout(plan))


def _origin(sweep: PlanSweep, argv: Sequence[str]) -> Provenance:
    """What a sweep's identity is made of: its resolved runs and draws, not its text."""
    plan, scenes = sweep.file.trajectories, sweep.file.scenes
    resolved = {
        "kind": "sweep",
        "run": "plan",
        "trajectories": plan.model_dump(mode="json", by_alias=True),
        "scenes": None if scenes is None else scenes.model_dump(mode="json"),
        "configurations": [
            {"changes": changes, "run": spec.model_dump(mode="json")}
            for changes, spec in zip(sweep.changes, sweep.specs, strict=True)
        ],
    }
    return Provenance(dump(resolved), spec_hash(resolved), "vm", plan.seed, versions(), tuple(argv))


def _units(sweep: PlanSweep, drawn: dict[str, Array]) -> dict[str, Signal]:
    """Units of the fields that differ between runs, by dotted path."""
    found = {}
    for path in sorted({path for changes in sweep.changes for path in changes} | set(drawn)):
        spec = next((spec for spec in sweep.specs if spec.has(path)), None)
        if spec is not None:
            found[path] = Signal(path, unit_at(spec, path), f"{path} of the run")
    return found
