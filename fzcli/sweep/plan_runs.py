"""The shards of a sweep of plans; every plan is judged by the whole arm at all times."""

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import SpecError
from fzcli.loop.versions import versions
from fzcli.plan.plan import Plan
from fzcli.plan.plan_spec import PlanRun
from fzcli.plan.planning import NoPlanError, prepare, solve
from fzcli.plan.result import CERTIFICATE, METRICS, as_plan
from fzcli.record.plan_file import as_rollout
from fzcli.record.shard_file import Shard
from fzcli.record.sweep_record import KeptRun
from fzcli.spec.hashing import spec_hash
from fzcli.spec.nearest import hint
from fzcli.spec.quantity import Signal
from fzcli.spec.reader import dump
from fzcli.spec.result import STATUS_NAMES, Provenance
from fzcli.sweep.crashed import note_crashed
from fzcli.sweep.kept_runs import Chosen, marked, records_of
from fzcli.sweep.layout import Piece
from fzcli.sweep.plan_sweep import PlanDrawing, PlanSweep

Array = NDArray[np.float64]
Progress = Callable[[int], None]
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
Row = dict[str, float]
_CRASHED_ROW = {"status": float(STATUS_NAMES.index("failed"))}


class Plans:
    """What runs any shard of a sweep of plans; nothing but ``plan_time`` depends on where it runs."""

    def __init__(self, sweep: PlanSweep, identity: str) -> None:
        self.sweep = sweep
        self.identity = identity
        self.jobs = 1
        self._drawing = PlanDrawing(tuple(sweep.specs), sweep.draws, sweep.file.scenes, sweep.file.trajectories)

    def check(self) -> None:
        """Raises SpecError where a rank asks for a metric that plans have not."""
        for record in records_of(self.sweep):
            if record.rank_by not in INFO:
                text = f"no metric {record.rank_by!r}{hint(record.rank_by, INFO)}"
                raise SpecError(self.sweep.document.problem(text, ("record", "rank_by")))

    def metric_info(self) -> dict[str, Signal]:
        """What the metrics of plans are."""
        return dict(INFO)

    def compile(self, jobs: int) -> None:
        """Plans are not compiled."""

    def shard(self, piece: Piece, skip: frozenset[int] = frozenset(), progress: Progress | None = None) -> Shard:
        """Plan a shard; rows in ``skip`` are not planned but recorded as crashed.

        Raises FilterError where a trajectory gets no scene.
        """
        count = len(piece.places)
        rows: list[Row] = [_CRASHED_ROW] * piece.runs
        drawn: list[dict[str, Any]] = []
        for j, place in enumerate(piece.places):
            trajectory = self._drawing.trajectory(place)
            drawn.append(trajectory.drawn)
            for i, config in enumerate(piece.configs):
                if i * count + j not in skip:
                    rows[i * count + j] = row_of(trajectory.specs[config])
                if progress:
                    progress(1)
        columns = {name: np.array([row.get(name, np.nan) for row in rows]) for name in INFO}
        info = dict(INFO)
        note_crashed(columns, info, piece.runs, skip)
        status = np.array([row["status"] for row in rows], dtype=np.int8)
        records = records_of(self.sweep)
        chosen = marked([records[c] for c in piece.configs], self.sweep.file.trajectories.first, piece, status, skip)
        return Shard(
            identity=self.identity,
            index=piece.index,
            columns=columns,
            status=status,
            info=info,
            certificate_names=tuple(CERTIFICATE),
            draws={path: np.array([one[path] for one in drawn]) for path in drawn[0]},
            candidates=np.ones(count, dtype=np.int64),
            versions=versions(),
            crashed=tuple(sorted(skip)),
            kept=self.recorded(list(chosen.values()), np.zeros(0)),
        )

    def probe(self, piece: Piece, rows: range) -> None:
        """Plan only these rows of a shard, for nothing but to see whether they come back."""
        count = len(piece.places)
        for j, place in enumerate(piece.places):
            for i, config in enumerate(piece.configs):
                if i * count + j in rows:
                    row_of(self._drawing.trajectory(place).specs[config])

    def recorded(self, chosen: Sequence[Chosen], drawn: Array) -> tuple[KeptRun, ...]:
        """Plans made again with their paths; one that was not found is not kept."""
        return tuple(self._recorded(chosen))

    def _recorded(self, chosen: Sequence[Chosen]) -> Iterator[KeptRun]:
        plan = self.sweep.file.trajectories
        for one in chosen:
            spec = self._drawing.trajectory(one.place).specs[one.config]
            resolved = spec.model_dump(mode="json")
            found, _ = _plan(spec, Provenance(dump(resolved), spec_hash(resolved), "vm", plan.seed, versions()))
            if found is not None:
                yield KeptRun(one.config, plan.first + one.place, one.role, as_rollout(found))


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
