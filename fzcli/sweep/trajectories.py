"""The drawn trajectories of a sweep, filtered where it asks for a filter."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from fzcli.errors import FzcliError
from fzcli.loop.engine import Batch
from fzcli.loop.run_spec import SimulateRun
from fzcli.spec.base import SpecModel
from fzcli.spec.condition import Condition
from fzcli.spec.quantity import Metric
from fzcli.sweep.builds import Builds, rows_of, split
from fzcli.sweep.draws import candidates, sources
from fzcli.sweep.resolve import Sweep, with_values

Array = NDArray[np.float64]
FULL = 16  # candidates that are tried together at least, so that lanes are full
TOGETHER, MOST_TOGETHER = 64, 1024  # the same, and at most, where those that need not be run are left out


class FilterError(FzcliError):
    """A filter that lets too little through."""


@dataclass(frozen=True)
class Drawing:
    """``values`` (trajectories, k) as drawn, and ``candidates`` (trajectories): how many were tried for each."""

    values: Array
    candidates: NDArray[np.int64]


def trial_builds(sweep: Sweep, like: Builds | None = None) -> Builds:
    """For the runs that candidates are tried with: they end as soon as they cannot pass. ``like``: as of `Builds`."""
    return Builds(like=like, wanted=_conditions(sweep))


def _conditions(sweep: Sweep) -> tuple[Condition, ...]:
    keep_if = sweep.file.trajectories.keep_if
    return () if keep_if is None else tuple(Condition.of(text) for text in keep_if.that)


def draw_trajectories(sweep: Sweep, builds: Builds, places: range, jobs: int = 1) -> Drawing:
    """Draw the trajectories of these places, counted from the first; with a filter, candidates until one passes.

    ``builds``: `trial_builds`. Raises FilterError when a trajectory passes none of the candidates it may try.
    """
    plan, count = sweep.file.trajectories, len(places)
    random = list(sources(plan, sweep.draws, places))
    if sweep.filter is None or plan.keep_if is None:
        values = candidates(sweep.draws, random)
        _check(sweep, values, [plan.first + place for place in places])
        return Drawing(values, np.ones(count, dtype=np.int64))
    trials = _Trials(sweep, builds, sweep.filter, _conditions(sweep), jobs)
    values, tried = np.zeros((count, sum(one.size for one in sweep.draws))), np.zeros(count, dtype=np.int64)
    waiting, most = np.arange(count), plan.keep_if.most
    while len(waiting) and tried[waiting[0]] < most:
        share = (count - len(waiting) + 1) / (tried.sum() + 1)
        ahead = trials.ahead(len(waiting), most - int(tried[waiting[0]]), share)
        every = candidates(sweep.draws, [random[place] for _ in range(ahead) for place in waiting])
        block = every.reshape(ahead, len(waiting), -1)
        _check(sweep, block[0], [plan.first + places[int(place)] for place in waiting])
        passed = trials.passed(every, len(waiting))
        found, first = passed.any(axis=0), passed.argmax(axis=0)
        values[waiting] = block[first, np.arange(len(waiting))]
        tried[waiting] += np.where(found, first + 1, ahead)
        waiting = waiting[~found]
    if not len(waiting):
        return Drawing(values, tried)
    raise FilterError(
        f"trajectories.keep_if: trajectory {plan.first + places[int(waiting[0])]} passed none of {most} "
        f"candidates ({count - len(waiting)} of {count} trajectories found); loosen the conditions"
    )


@dataclass(frozen=True)
class _Trials:
    """The filter's run on candidates."""

    sweep: Sweep
    builds: Builds
    run: SimulateRun
    conditions: tuple[Condition, ...]
    jobs: int

    def ahead(self, waiting: int, left: int, share: float) -> int:
        """Candidates of each trajectory that are tried together; the first that passes is it.

        ``share``: of those tried so far, how many passed. Of normal numbers one at a time: a candidate beyond the first
        that passes must not be refused for its values.
        """
        if any(one.distribution == "normal" for one in self.sweep.draws):
            return 1
        fewest, most = FULL // waiting, FULL // waiting
        if self.builds.of(self.run).decides:  # those beyond the first that passes are drawn, but hardly run
            fewest, most = TOGETHER // waiting, MOST_TOGETHER // waiting
        return max(1, min(left, most, max(fewest, math.ceil(2 / share))))

    def passed(self, values: Array, waiting: int) -> NDArray[np.bool_]:
        """Which of the candidates (first ones of all trajectories, then second ones) pass, (candidates, trajectories).

        Not all that are behind the first that passes.
        """
        passed = np.zeros(len(values), dtype=bool)
        for rows in rows_of(self.builds, self.run, self.sweep.draws, values, np.arange(len(values))):
            engine = rows.build.engine(record=False)
            series = rows.runs % waiting if rows.build.decides else None
            batch = engine.run(rows.parameters, rows.steps, jobs=self.jobs, series=series)
            passed[rows.runs] = _meets(engine.loop.metrics, batch, self.conditions)
        return passed.reshape(-1, waiting)


def _check(sweep: Sweep, rows: Array, indices: Sequence[int]) -> None:
    """A normal distribution has no ends that could be checked beforehand, so that its numbers are.

    Raises FilterError for a number that the field could not have in a file.
    """
    for one in sweep.draws:
        if one.distribution != "normal":
            continue
        spec = next((spec for spec in sweep.specs if spec.has(one.path)), None)
        if spec is not None:
            for values, index in zip(rows, indices, strict=True):
                _check_field(spec, one.path, split(sweep.draws, values)[one.path], index)


def _check_field(spec: SimulateRun, path: str, values: Array, index: int) -> None:
    changed = with_values(spec, {path: values})
    section = getattr(changed, path.partition(".")[0])
    part = section if isinstance(section, SpecModel) else changed
    try:
        type(part).model_validate({name: getattr(part, name) for name in type(part).model_fields})
    except ValidationError as error:
        text = error.errors()[0]["msg"]
        numbers = ", ".join(f"{value:.6g}" for value in values)
        raise FilterError(
            f"trajectories.draw.{path}: trajectory {index} drew {numbers}: {text}; draw it uniformly"
        ) from None


def _meets(
    metrics: tuple[Metric, ...], batch: Batch, conditions: tuple[Condition, ...]
) -> NDArray[np.bool_]:
    """Which runs meet all conditions; one that was stopped meets none."""
    names = [metric.name for metric in metrics]
    good = np.asarray(batch.stops == 0)
    for condition in conditions:
        good &= condition.met_by(batch.metrics[:, names.index(condition.metric)])
    return good
