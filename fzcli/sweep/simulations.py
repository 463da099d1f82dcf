"""The shards of a sweep of simulations: draw, roll out, judge; and single runs again with every signal kept."""

from collections.abc import Callable, Iterator, Sequence
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import Problem, SpecError
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.engine import Engine
from fzcli.loop.reductions import seen
from fzcli.loop.rollout import Rollout
from fzcli.loop.run_spec import RecordSpec
from fzcli.loop.simulate import rollouts
from fzcli.loop.verdict import BOUNDED, JUDGED, OUTCOME, outcomes, status_codes
from fzcli.loop.versions import versions
from fzcli.record.shard_file import Shard
from fzcli.record.sweep_record import KeptRun
from fzcli.spec.condition import Condition
from fzcli.spec.nearest import hint
from fzcli.spec.quantity import Signal
from fzcli.spec.result import STATUS_NAMES
from fzcli.sweep.builds import Build, Builds, Rows, rows_of, split
from fzcli.sweep.crashed import note_crashed
from fzcli.sweep.kept_runs import UNSAID, Chosen, marked
from fzcli.sweep.layout import Piece
from fzcli.sweep.resolve import Sweep
from fzcli.sweep.trajectories import draw_trajectories, trial_builds

Array = NDArray[np.float64]
Progress = Callable[[int], None]


class Simulations:
    """What runs any shard of a sweep; threads may share one. ``jobs``: threads in one shard."""

    def __init__(self, sweep: Sweep, identity: str, jobs: int = 1) -> None:
        self.sweep = sweep
        self.identity = identity
        self.jobs = jobs
        self._builds = Builds()
        self._trials = Builds()  # of the filter
        self._lock = Lock()
        self._compiled = False

    def check(self) -> None:
        """Raises SpecError where a filter or a rank asks for a metric that its run has not."""
        for spec in self.sweep.specs:
            names = [metric.name for metric in self._builds.of(spec).loop.metrics]
            _check_rank(spec.record, names)
        _check_filter(self.sweep, self._builds)

    def metric_info(self) -> dict[str, Signal]:
        """What the metrics of all configurations are."""
        return _metric_info([self._builds.of(spec).loop for spec in self.sweep.specs])

    def compile(self, jobs: int) -> None:
        """Make all engines, several compilers at a time."""
        with self._lock:
            if not self._compiled:
                for spec in self.sweep.specs:
                    self._builds.of(spec)
                self._trials = trial_builds(self.sweep, self._builds)
                if self.sweep.filter is not None:
                    self._trials.of(self.sweep.filter)
                self._trials.compile(record=False, jobs=jobs)
                self._compiled = True

    def shard(self, piece: Piece, skip: frozenset[int] = frozenset(), progress: Progress | None = None) -> Shard:
        """Run a shard; rows in ``skip`` are not run but recorded as crashed.

        Raises FilterError where a trajectory finds no candidate.
        """
        self.compile(self.jobs)
        drawing = draw_trajectories(self.sweep, self._trials, piece.places, self.jobs)
        every = list(self._rows(piece, drawing.values, skip))
        columns, status = self._roll_out(piece, every, skip, progress)
        loops = list({id(rows.build): rows.build.loop for rows in every}.values())
        info = _metric_info(loops)
        note_crashed(columns, info, piece.runs, skip)
        record = [self.sweep.specs[config].record for config in piece.configs]
        chosen = marked(record, self.sweep.file.trajectories.first, piece, status, skip)
        return Shard(
            identity=self.identity,
            index=piece.index,
            columns=columns,
            status=status,
            info=info,
            certificate_names=_certificate_names(loops),
            draws=self._by_path(drawing.values),
            candidates=drawing.candidates,
            versions=versions(),
            crashed=tuple(sorted(skip)),
            kept=self._recorded(every, chosen) if chosen else (),
        )

    def probe(self, piece: Piece, rows: range) -> None:
        """Run only these rows of a shard, for nothing but to see whether they come back."""
        self.compile(self.jobs)
        drawing = draw_trajectories(self.sweep, self._trials, piece.places, self.jobs)
        others = frozenset(range(piece.runs)) - frozenset(rows)
        self._roll_out(piece, list(self._rows(piece, drawing.values, others)), others, None)

    def recorded(self, chosen: Sequence[Chosen], drawn: Array) -> tuple[KeptRun, ...]:
        """Runs again with every signal kept. ``drawn``: (runs, k), as in their shards."""
        every = []
        for config in dict.fromkeys(one.config for one in chosen):
            mine = np.array([i for i, one in enumerate(chosen) if one.config == config])
            with self._lock:
                every += rows_of(self._builds, self.sweep.specs[config], self.sweep.draws, drawn[mine], mine)
        return self._recorded(every, dict(enumerate(chosen)))

    def _rows(self, piece: Piece, drawn: Array, skip: frozenset[int]) -> Iterator[Rows]:
        """For rows in ``skip`` nothing is built: that alone may end the process."""
        count = len(piece.places)
        for i, config in enumerate(piece.configs):
            mine = np.array([j for j in range(count) if i * count + j not in skip], dtype=np.int64)
            if not mine.size:
                continue
            with self._lock:  # a drawn field may ask for another build
                yield from rows_of(
                    self._builds, self.sweep.specs[config], self.sweep.draws, drawn[mine], mine + i * count
                )

    def _roll_out(
        self, piece: Piece, every: list[Rows], skip: frozenset[int], progress: Progress | None
    ) -> tuple[dict[str, Array], NDArray[np.int8]]:
        count = len(piece.places)
        names = dict.fromkeys(metric.name for rows in every for metric in rows.build.loop.metrics)
        columns: dict[str, Array] = {name: np.full(piece.runs, np.nan) for name in names}
        ends, stops = np.full(piece.runs, np.nan), np.zeros(piece.runs, dtype=np.int64)
        known: list[set[str]] = [set() for _ in piece.configs]
        for build, runs, parameters, steps in _by_build(every, skip):
            for i in np.unique(runs // count).tolist():
                known[i] |= {metric.name for metric in build.loop.metrics}
            batch = self._engine(build, record=False).run(parameters, steps, jobs=self.jobs, progress=progress)
            for i, metric in enumerate(build.loop.metrics):
                columns[metric.name][runs] = seen(batch.metrics[:, i])
            ends[runs], stops[runs] = batch.ends, batch.stops
        columns["n_steps"] = ends
        status = np.zeros(piece.runs, dtype=np.int8)
        for i, config in enumerate(piece.configs):
            part = slice(i * count, (i + 1) * count)
            own = {name: columns[name][part] for name in (*BOUNDED, *JUDGED) if name in known[i]}
            status[part] = status_codes(own, stops[part], self.sweep.specs[config].bounds)
        status[list(skip)] = STATUS_NAMES.index("failed")
        if "arrived" in columns:
            columns["outcome"] = outcomes(columns)
        return columns, status

    def _recorded(self, every: list[Rows], chosen: dict[int, Chosen]) -> tuple[KeptRun, ...]:
        """``chosen``: those of the rows that are kept."""
        kept: dict[int, Rollout] = {}
        unwanted = frozenset(int(run) for rows in every for run in rows.runs) - chosen.keys()
        for build, runs, parameters, steps in _by_build(every, unwanted):
            engine = self._engine(build, record=True)
            batch = engine.run(parameters, steps, record=True, jobs=self.jobs)
            bounds = [self.sweep.specs[chosen[int(run)].config].bounds for run in runs]
            found = rollouts(engine, batch, bounds, [UNSAID] * len(runs))
            kept.update(zip(runs.tolist(), found, strict=True))
        first = self.sweep.file.trajectories.first
        return tuple(KeptRun(one.config, first + one.place, one.role, kept[row]) for row, one in chosen.items())

    def _engine(self, build: Build, record: bool) -> Engine:
        with self._lock:
            return build.engine(record)

    def _by_path(self, values: Array) -> dict[str, Array]:
        if not self.sweep.draws:
            return {}
        parts = split(self.sweep.draws, values.T)
        return {path: np.ascontiguousarray(part.T) for path, part in parts.items()}


def _by_build(
    every: list[Rows], skip: frozenset[int]
) -> Iterator[tuple[Build, NDArray[np.int64], Array, NDArray[np.int64]]]:
    """The runs of each build together, without those to skip."""
    groups: dict[int, list[Rows]] = {}
    for rows in every:
        groups.setdefault(id(rows.build), []).append(rows)
    for members in groups.values():
        runs = np.concatenate([rows.runs for rows in members])
        wanted = ~np.isin(runs, list(skip)) if skip else np.ones(len(runs), dtype=bool)
        if wanted.any():
            parameters = np.concatenate([rows.parameters for rows in members])[wanted]
            steps = np.concatenate([rows.steps for rows in members])[wanted]
            yield members[0].build, runs[wanted], parameters, steps


def _metric_info(loops: Sequence[ClosedLoop]) -> dict[str, Signal]:
    info = {m.name: Signal(m.name, m.unit, m.long_name, truth=m.truth) for loop in loops for m in loop.metrics}
    info["n_steps"] = Signal("n_steps", "1", "steps taken")
    info["outcome"] = OUTCOME
    return info


def _certificate_names(loops: Sequence[ClosedLoop]) -> tuple[str, ...]:
    names = [m.name for loop in loops for m in loop.metrics if m.name in loop.certificate_names or m.name in BOUNDED]
    return tuple(dict.fromkeys(names))


def _check_rank(record: RecordSpec, names: list[str]) -> None:
    asked = record.rank_by != RecordSpec().rank_by
    if asked and record.rank_by not in names:
        raise SpecError(Problem(f"no metric {record.rank_by!r}{hint(record.rank_by, names)}", field="record.rank_by"))


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
