"""Run a sweep: draw, compile, roll out, judge, keep the few runs worth keeping."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import FzcliError, Problem, SpecError
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.reductions import seen
from fzcli.loop.rollout import Rollout
from fzcli.loop.run_spec import SimulateRun
from fzcli.loop.simulate import provenance, rollouts
from fzcli.loop.verdict import BOUNDED, JUDGED, OUTCOME, outcomes, status_codes
from fzcli.record.hdf5 import Precision
from fzcli.record.sweep_file import write_sweep
from fzcli.record.sweep_record import KeptRun, SweepRecord
from fzcli.record.table import check_names
from fzcli.record.table_spec import TableSpec
from fzcli.spec.document import Document
from fzcli.spec.library import find, shipped_root
from fzcli.spec.nearest import hint
from fzcli.spec.quantity import Signal
from fzcli.spec.reader import read
from fzcli.spec.result import Provenance
from fzcli.spec.sets import apply_sets
from fzcli.spec.units import unit_at
from fzcli.sweep.builds import Build, Builds, Rows, rows_of, split
from fzcli.sweep.plan_runs import run_plans
from fzcli.sweep.plan_sweep import PlanSweep, resolve_plans
from fzcli.sweep.resolve import Sweep, resolve
from fzcli.sweep.sweep_spec import Condition
from fzcli.sweep.trajectories import Drawing, draw_trajectories

Array = NDArray[np.float64]
Tell = Callable[[str, int, int], None]
ROLES = ("best", "median", "worst")


def load_sweep(run: str | Path, sets: Sequence[str] = ()) -> Sweep | PlanSweep:
    """A sweep by path or name, resolved. Raises SpecError with every problem found."""
    return resolve_any(read(run if isinstance(run, Path) or run == "-" else find("runs", run)), sets)


def resolve_any(document: Document, sets: Sequence[str] = ()) -> Sweep | PlanSweep:
    """A sweep of simulations or of plans, as its file says. Raises SpecError with every problem found."""
    document = apply_sets(document, sets) if sets else document
    plans = isinstance(document.value, dict) and document.value.get("run") == "plan"
    return resolve_plans(document) if plans else resolve(document)


def table_spec(sweep: Sweep | PlanSweep) -> TableSpec | None:
    """How the sweep asks to be tabulated; published numbers are sought beside its file, then shipped."""
    if sweep.file.table is None:
        return None
    folders = [sweep.document.path.parent] if sweep.document.path else []
    return TableSpec.of(sweep.file.table, (*folders, shipped_root() / "runs"))


def save_sweep(sweep: Sweep | PlanSweep, record: SweepRecord, path: str | Path) -> None:
    """Write the record of a sweep, with its table section inside."""
    precision: Precision = "f8" if isinstance(sweep, PlanSweep) else sweep.specs[0].record.precision
    write_sweep(record, path, precision, table_spec(sweep))


def run_sweep(
    sweep: Sweep | PlanSweep, jobs: int | None = None, tell: Tell | None = None, argv: Sequence[str] = ()
) -> SweepRecord:
    """Run all configurations on all trajectories; the result does not depend on ``jobs``.

    ``tell(what, done, total)`` reports progress. Raises FilterError when a filtered draw finds nothing.
    """
    jobs = jobs or os.cpu_count() or 1
    tell = tell or _silent
    if isinstance(sweep, PlanSweep):
        return run_plans(sweep, table_spec(sweep), jobs, tell, argv)
    builds = Builds()
    for spec in [*sweep.specs, *([sweep.filter] if sweep.filter else [])]:
        _check_rank(spec, builds.of(spec))
    _check_table(sweep, builds)
    _check_filter(sweep, builds)
    tell("compiling", 0, 1)
    builds.compile(record=False, jobs=jobs)
    drawing = draw_trajectories(sweep, builds, jobs, tell)
    count = sweep.file.trajectories.count
    every = [
        row
        for c, spec in enumerate(sweep.specs)
        for row in rows_of(builds, spec, sweep.draws, drawing.values, np.arange(count) + c * count)
    ]
    metrics = _roll_out(sweep, every, jobs, tell)
    loops = list({id(rows.build): rows.build.loop for rows in every}.values())
    tell("recording", 0, 1)
    origin = _provenance(sweep, every[0], argv)
    return SweepRecord(
        configs=sweep.changes,
        metrics=metrics,
        metric_info={**_metric_info(loops), **_field_info(sweep)},
        certificate_names=_certificate_names(loops),
        draws=_draws_by_path(sweep, drawing),
        draw_info={"candidates": drawing.candidates, "accepted": count} if sweep.filter else {},
        kept=_kept(sweep, every, metrics, origin, jobs),
        provenance=origin,
    )


def _check_table(sweep: Sweep, builds: Builds) -> None:
    spec = table_spec(sweep)
    if spec is not None:
        loops = [builds.of(one).loop for one in sweep.specs]
        try:
            check_names(sweep.changes, _metric_info(loops), spec)
        except FzcliError as error:
            text = str(error).removeprefix("table: ")
            raise SpecError(sweep.document.problem(text, ("table",))) from None


def _check_filter(sweep: Sweep, builds: Builds) -> None:
    """The conditions of a filter must speak of metrics that its run has."""
    keep_if = sweep.file.trajectories.keep_if
    if sweep.filter is None or keep_if is None:
        return
    names = [metric.name for metric in builds.of(sweep.filter).loop.metrics]
    problems = [
        sweep.document.problem(f"no metric {wanted!r}{hint(wanted, names)}", ("trajectories", "keep_if", "that", i))
        for i, wanted in enumerate(Condition.of(text).metric for text in keep_if.that)
        if wanted not in names
    ]
    if problems:
        raise SpecError(problems)


def _check_rank(spec: SimulateRun, build: Build) -> None:
    names = [metric.name for metric in build.loop.metrics]
    if "rank_by" in spec.record.model_fields_set and spec.record.rank_by not in names:
        text = f"no metric {spec.record.rank_by!r}{hint(spec.record.rank_by, names)}"
        raise SpecError(Problem(text, field="record.rank_by"))


def _silent(what: str, done: int, total: int) -> None:
    """Nobody listens."""


def _roll_out(sweep: Sweep, every: list[Rows], jobs: int, tell: Tell) -> dict[str, NDArray[Any]]:
    count, configs = sweep.file.trajectories.count, len(sweep.specs)
    total = count * configs
    names = list(dict.fromkeys(metric.name for rows in every for metric in rows.build.loop.metrics))
    columns: dict[str, NDArray[Any]] = {name: np.full(total, np.nan) for name in names}
    ends, stops = np.zeros(total), np.zeros(total, dtype=np.int64)
    done = 0

    def progress(runs: int) -> None:
        nonlocal done
        done += runs
        tell("running", done, total)

    known: list[set[str]] = [set() for _ in range(configs)]
    for build, members in _by_build(every):
        runs = np.concatenate([rows.runs for rows in members])
        parameters = np.concatenate([rows.parameters for rows in members])
        steps = np.concatenate([rows.steps for rows in members])
        for c in {int(run) // count for run in runs}:
            known[c] |= {metric.name for metric in build.loop.metrics}
        batch = build.engine(record=False).run(parameters, steps, jobs=jobs, progress=progress)
        for i, metric in enumerate(build.loop.metrics):
            columns[metric.name][runs] = seen(batch.metrics[:, i])
        ends[runs], stops[runs] = batch.ends, batch.stops
    columns["n_steps"] = ends
    columns["config"] = np.repeat(np.arange(configs), count)
    columns["trajectory"] = np.tile(np.arange(count) + sweep.file.trajectories.first, configs)
    status = np.zeros(total, dtype=np.int8)
    for c, spec in enumerate(sweep.specs):
        part = slice(c * count, (c + 1) * count)
        own = {name: columns[name][part] for name in (*BOUNDED, *JUDGED) if name in known[c]}
        status[part] = status_codes(own, stops[part], spec.bounds)
    columns["status"] = status
    if "arrived" in columns:
        columns["outcome"] = outcomes(columns)
    return columns


def _by_build(every: list[Rows]) -> list[tuple[Any, list[Rows]]]:
    groups: dict[int, list[Rows]] = {}
    for rows in every:
        groups.setdefault(id(rows.build), []).append(rows)
    return [(members[0].build, members) for members in groups.values()]


def _metric_info(loops: list[ClosedLoop]) -> dict[str, Signal]:
    info = {m.name: Signal(m.name, m.unit, m.long_name, truth=m.truth) for loop in loops for m in loop.metrics}
    info["n_steps"] = Signal("n_steps", "1", "steps taken")
    info["outcome"] = OUTCOME
    return info


def _field_info(sweep: Sweep) -> dict[str, Signal]:
    """Units of the fields that differ between runs, by dotted path."""
    paths = {path for changes in sweep.changes for path in changes} | {one.path for one in sweep.draws}
    found = {}
    for path in sorted(paths):
        spec = next((spec for spec in sweep.specs if spec.has(path)), None)
        if spec is not None:
            found[path] = Signal(path, unit_at(spec, path), f"{path} of the run")
    return found


def _certificate_names(loops: list[ClosedLoop]) -> tuple[str, ...]:
    names = [m.name for loop in loops for m in loop.metrics if m.name in loop.certificate_names or m.name in BOUNDED]
    return tuple(dict.fromkeys(names))


def _draws_by_path(sweep: Sweep, drawing: Drawing) -> dict[str, Array]:
    if not sweep.draws:
        return {}
    parts = split(sweep.draws, drawing.values.T)
    return {path: np.ascontiguousarray(values.T) for path, values in parts.items()}


def _provenance(sweep: Sweep, rows: Rows, argv: Sequence[str]) -> Provenance:
    engine = rows.build.engine(record=False)
    return provenance(SweepMeaning(sweep), engine, argv, sweep.file.trajectories.seed)


class SweepMeaning:
    """What a sweep's identity is made of: its resolved runs and draws, not its text."""

    def __init__(self, sweep: Sweep) -> None:
        self.sweep = sweep

    def model_dump(self, mode: str) -> dict[str, Any]:
        """Resolved, as plain data."""
        sweep = self.sweep
        return {
            "kind": "sweep",
            "trajectories": sweep.file.trajectories.model_dump(mode=mode, by_alias=True),
            "filter": sweep.filter.model_dump(mode=mode) if sweep.filter else None,
            "configurations": [
                {"changes": changes, "run": spec.model_dump(mode=mode)}
                for changes, spec in zip(sweep.changes, sweep.specs, strict=True)
            ],
        }


def _kept(
    sweep: Sweep, every: list[Rows], metrics: dict[str, NDArray[Any]], origin: Provenance, jobs: int
) -> tuple[KeptRun, ...]:
    """Best, median and worst run of every configuration, run again with every signal kept."""
    chosen = _chosen(sweep, metrics)
    kept: dict[int, Rollout] = {}
    for build, members in _by_build(every):
        runs = np.concatenate([rows.runs for rows in members])
        wanted = np.flatnonzero(np.isin(runs, list(chosen)))
        if not len(wanted):
            continue
        parameters = np.concatenate([rows.parameters for rows in members])[wanted]
        steps = np.concatenate([rows.steps for rows in members])[wanted]
        engine = build.engine(record=True)
        batch = engine.run(parameters, steps, record=True, jobs=jobs)
        count = sweep.file.trajectories.count
        bounds = [sweep.specs[int(run) // count].bounds for run in runs[wanted]]
        found = rollouts(engine, batch, bounds, [origin] * len(wanted))
        kept.update(dict(zip((int(run) for run in runs[wanted]), found, strict=True)))
    return tuple(
        KeptRun(int(metrics["config"][run]), int(metrics["trajectory"][run]), role, kept[run])
        for run, role in chosen.items()
    )


def _chosen(sweep: Sweep, metrics: dict[str, NDArray[Any]]) -> dict[int, str]:
    """Run -> role. Runs are ranked by one metric, those without a number last; ties by index."""
    count = sweep.file.trajectories.count
    chosen: dict[int, str] = {}
    for c, spec in enumerate(sweep.specs):
        rank = metrics.get(spec.record.rank_by)
        values = np.zeros(count) if rank is None else np.nan_to_num(rank[c * count : (c + 1) * count], nan=np.inf)
        order = np.argsort(values, kind="stable") + c * count
        for role, place in zip(ROLES, (0, (count - 1) // 2, count - 1), strict=True):
            chosen.setdefault(int(order[place]), role)
    return chosen


def unexpected_failures(sweep: Sweep | PlanSweep, record: SweepRecord) -> int:
    """Failed runs of configurations that were not expected to fail."""
    expected = sweep.file.expect_failures
    if expected is True:
        return 0
    failed = record.metrics["status"] == 2
    total = 0
    for c, changes in enumerate(record.configs):
        excused = isinstance(expected, dict) and all(changes.get(path) == value for path, value in expected.items())
        if not excused:
            total += int((failed & (record.metrics["config"] == c)).sum())
    return total
