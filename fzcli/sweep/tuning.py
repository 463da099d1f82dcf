"""Numbers of a run tuned by differential evolution over a sweep's trajectories, judged by those it did not see.

Storn, Price: Differential Evolution, J. Global Optimization 11 (1997), as SciPy has it. Its course hangs on the seed
and the results alone, so that a journal of results is all that it takes to go on: what is in it is not run again.
"""

import json
import math
import os
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import FzcliError, RecordError, SpecError, UnfinishedError
from fzcli.loop.assemble import closed_loop
from fzcli.loop.events import make_engine
from fzcli.loop.file_lock import HeldError, locked
from fzcli.loop.reductions import seen
from fzcli.loop.run_spec import SimulateRun
from fzcli.loop.versions import versions
from fzcli.model import RobotModel, build_model
from fzcli.record.hdf5 import replacing
from fzcli.spec.condition import Condition
from fzcli.spec.hashing import spec_hash
from fzcli.spec.nearest import hint
from fzcli.sweep.builds import Builds, rows_of
from fzcli.sweep.meaning import SHORT, meaning_of
from fzcli.sweep.trajectories import draw_trajectories, trial_builds
from fzcli.sweep.tune_scores import Change, Runs, Score, append, joined, read_journal
from fzcli.sweep.tune_spec import Tuning
from fzcli.sweep.vary import changed, rounded

Array = NDArray[np.float64]
Tell = Callable[[str, int, int], None]
Stop = Callable[[], bool]


@dataclass(frozen=True)
class Tuned:
    """The best candidate, and how it and what it is compared with do where it was sought and where it was not.

    ``before`` is the baseline: the file's own numbers, where it names no other.
    """

    identity: str
    values: dict[str, float]
    before: Score
    after: Score
    held_out_before: Score | None
    held_out_after: Score | None
    held_out_change: Change | None
    evaluations: int
    seed: int
    versions: dict[str, str]

    def to_json(self) -> str:
        """Text that ``from_json`` turns back."""
        return json.dumps(asdict(self), indent=1) + "\n"

    @staticmethod
    def from_json(text: str) -> "Tuned":
        """Raises ValueError, KeyError or TypeError for anything else."""
        data = json.loads(text)
        for name in ("before", "after", "held_out_before", "held_out_after"):
            data[name] = None if data[name] is None else Score(**data[name])
        change = data["held_out_change"]
        return Tuned(**{**data, "held_out_change": None if change is None else Change(**change)})


def identity_of(tuning: Tuning) -> str:
    """The hash of all that the result depends on."""
    return spec_hash([meaning_of(tuning.sweep).identity, tuning.section.model_dump(mode="json")])


def tune_to(
    tuning: Tuning, path: Path, jobs: int | None = None, tell: Tell | None = None, stop: Stop | None = None
) -> Tuned:
    """Tune, and write the result as JSON to ``path``; a finished one is read from there.

    Raises UnfinishedError when it was stopped: the same call goes on from there. Raises SpecError, FilterError.
    """
    identity = identity_of(tuning)
    try:
        done = Tuned.from_json(path.read_text(encoding="utf-8"))
        if done.identity == identity:
            return done
    except (OSError, ValueError, KeyError, TypeError):
        pass
    journal = path.with_name(f"{path.stem}-{identity[:SHORT]}.jsonl")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with locked(journal, wait=False), tempfile.TemporaryDirectory(prefix="fzcli-") as scratch:
            found = _Search(tuning, journal, Path(scratch), jobs or os.cpu_count() or 1, tell, stop).run(identity)
            with replacing(path) as stream:
                stream.write(found.to_json().encode())
            journal.unlink()
    except HeldError:
        raise FzcliError(f"{journal}: another process tunes this") from None
    except OSError as error:
        raise RecordError(f"{path}: cannot be written: {error.strerror or error}") from error
    return found


class _Search:
    """One run of the evolution."""

    def __init__(
        self, tuning: Tuning, journal: Path, scratch: Path, jobs: int, tell: Tell | None, stop: Stop | None
    ) -> None:
        self.tuning, self.section, self.sweep = tuning, tuning.section, tuning.sweep
        self.journal, self.scratch, self.jobs = journal, scratch, jobs
        self.tell = tell or (lambda what, done, total: None)
        self.stop = stop or (lambda: False)
        self.model: RobotModel = build_model(self.sweep.specs[0].robot)
        self.builds = Builds(self.model, partial(make_engine, folder=scratch))  # of the file's own numbers
        self.known = read_journal(journal)
        self._check()
        count = self.sweep.file.trajectories.count
        self.seen = range(max(1, count - int(count * self.section.held_out)))
        self.tell("drawing", 0, 1)
        self.drawn = draw_trajectories(self.sweep, trial_builds(self.sweep), range(count), jobs).values

    def run(self, identity: str) -> Tuned:
        """The whole evolution."""
        from scipy.optimize import differential_evolution

        for spec in self.sweep.specs:
            self.builds.of(spec).engine(record=False)
        own = self._baseline(self.seen).score
        generations, ways = self.section.generations, list(self.section.vary.values())
        share = len(self.sweep.specs) * len(self.seen) / own.runs * (1.0 - self.section.margin)
        self.allowed, self.unit = math.floor(own.lost * share + 1e-9), own.mean
        bounds = [(math.log(v.low), math.log(v.high)) if v.logarithmic else (v.low, v.high) for v in ways]
        found = differential_evolution(
            lambda x: self._costs(np.atleast_2d(x.T)),
            bounds,
            maxiter=generations,
            init=self._first(bounds),
            rng=self.section.seed,
            tol=0.0,
            polish=False,
            updating="deferred",
            vectorized=True,
        )
        values = self._values(found.x)
        rest = range(len(self.seen), len(self.drawn))
        judge, judged = (self._baseline(rest), self._runs(values, rest)) if rest else (None, None)
        return Tuned(
            identity=identity,
            values=dict(zip(self.section.vary, values, strict=True)),
            before=own,
            after=self._score(values, self.seen),
            held_out_before=judge.score if judge else None,
            held_out_after=judged.score if judged else None,
            held_out_change=judged.change_from(judge) if judge and judged else None,
            evaluations=len(self.known),
            seed=self.section.seed,
            versions=dict(versions()),
        )

    def _first(self, bounds: Sequence[tuple[float, float]]) -> Array:
        """The first generation: a Sobol sequence over the bounds."""
        from scipy.stats import qmc

        points = qmc.Sobol(len(bounds), rng=self.section.seed)
        unit = np.concatenate([points.random(1) for _ in range(self.section.candidates)])
        low, high = np.array(bounds).T
        return np.asarray(low + (high - low) * unit)

    def _values(self, x: Array) -> tuple[float, ...]:
        """The numbers that a point of the search means."""
        ways = self.section.vary.values()
        return tuple(rounded(math.exp(v) if way.logarithmic else v) for v, way in zip(x, ways, strict=True))

    def _costs(self, points: Array) -> Array:
        """One cost a candidate, several candidates at a time. Raises UnfinishedError when it is to stop."""
        every = [self._values(point) for point in points]
        new = [values for values in dict.fromkeys(every) if values not in self.known]
        total = self.section.candidates * (self.section.generations + 1)
        with ThreadPoolExecutor(self.jobs) as pool:
            scores = pool.map(partial(self._unless_stopped, part=self.seen), new)
            for values, score in zip(new, scores, strict=True):
                if score is None:
                    done = f"{len(self.known)} candidates are tried, of about {total}"
                    raise UnfinishedError(f"stopped; {done}, in {self.journal}")
                self.known[values] = score
                append(self.journal, values, score)
                self.tell("tuning", len(self.known), total)
        return np.array([self._cost(self.known[values]) for values in every])

    def _unless_stopped(self, values: tuple[float, ...], part: range) -> Score | None:
        return None if self.stop() else self._score(values, part)

    def _cost(self, score: Score) -> float:
        """The mean, with each lost run beyond those of the file's own numbers as bad as its whole mean."""
        if not math.isfinite(score.mean):
            return 1e6 * self.unit
        return score.mean + self.unit * max(0, score.lost - self.allowed)

    def _score(self, values: tuple[float, ...], part: range) -> Score:
        """Of a candidate; the worst there is where it makes no sense as a run."""
        found = self._runs(values, part)
        runs = len(self.sweep.specs) * len(part)
        return Score(math.inf, runs, runs) if found is None else found.score

    def _baseline(self, part: range) -> Runs:
        """What the candidates are compared with."""
        if not self.tuning.baseline:
            return joined([self._metrics(spec, part, self.builds) for spec in self.sweep.specs])
        builds = Builds(engine=partial(make_engine, folder=self.scratch))
        return joined([self._metrics(spec, part, builds) for spec in self.tuning.baseline])

    def _runs(self, values: tuple[float, ...], part: range) -> Runs | None:
        """All configurations on some trajectories with these values; None where they make no sense as a run."""
        every = []
        for spec in self.sweep.specs:
            run = changed(spec, self.section.vary, values)
            if run is None:
                return None
            builds = Builds(self.model, partial(make_engine, folder=self.scratch), self.builds)
            try:
                every.append(self._metrics(run, part, builds))
            except SpecError:  # shapes that cross each other, for example
                return None
        return joined(every)

    def _metrics(self, run: SimulateRun, part: range, builds: Builds) -> tuple[Array, NDArray[np.bool_]]:
        metric, gone = np.full(len(part), np.nan), np.zeros(len(part), dtype=bool)
        condition = None if self.section.lost is None else Condition.of(self.section.lost)
        drawn = self.drawn[part.start : part.stop]
        for rows in rows_of(builds, run, self.sweep.draws, drawn, np.arange(len(part))):
            names = [one.name for one in rows.build.loop.metrics]
            batch = rows.build.engine(record=False).run(rows.parameters, rows.steps)
            metric[rows.runs] = seen(batch.metrics[:, names.index(self.section.minimise)])
            bad = batch.stops != 0
            if condition is not None:
                values = seen(batch.metrics[:, names.index(condition.metric)])
                bad = condition.met_by(values) | ~np.isfinite(values)
            gone[rows.runs] = bad
        return metric, gone

    def _check(self) -> None:
        """Raises SpecError where a metric is asked for that the run has not."""
        specs = (self.sweep.specs[0], *self.tuning.baseline)
        loops = [closed_loop(spec, record=False) for spec in specs]
        names = [metric.name for metric in loops[0].metrics if all(metric in loop.metrics for loop in loops)]
        wanted = {"minimise": self.section.minimise}
        if self.section.lost is not None:
            wanted["lost"] = Condition.of(self.section.lost).metric
        problems = [
            self.tuning.document.problem(f"no metric {name!r}{hint(name, names)}", ("tune", field))
            for field, name in wanted.items()
            if name not in names
        ]
        if problems:
            raise SpecError(problems)
