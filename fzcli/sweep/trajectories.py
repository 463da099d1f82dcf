"""The drawn trajectories of a sweep, filtered where it asks for a filter."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from fzcli.errors import FzcliError
from fzcli.loop.engine import Batch
from fzcli.spec.base import SpecModel
from fzcli.sweep.builds import Builds, rows_of, split
from fzcli.sweep.draws import candidate, sources
from fzcli.sweep.resolve import Sweep, with_values
from fzcli.sweep.sweep_spec import Condition

Array = NDArray[np.float64]


class FilterError(FzcliError):
    """A filter that lets too little through."""


@dataclass(frozen=True)
class Drawing:
    """``values`` (trajectories, k) as drawn, and ``candidates`` (trajectories): how many were tried for each."""

    values: Array
    candidates: NDArray[np.int64]


def draw_trajectories(sweep: Sweep, builds: Builds, places: range, jobs: int = 1) -> Drawing:
    """Draw the trajectories of these places, counted from the first; with a filter, candidates until one passes.

    Raises FilterError when a trajectory passes none of the candidates it may try.
    """
    plan, count = sweep.file.trajectories, len(places)
    random = list(sources(plan, sweep.draws, places))
    values, tried = np.zeros((count, sum(one.size for one in sweep.draws))), np.zeros(count, dtype=np.int64)
    keep_if = plan.keep_if if sweep.filter is not None else None
    conditions = [Condition.of(text) for text in keep_if.that] if keep_if else []
    waiting = np.arange(count)
    for _ in range(keep_if.most if keep_if else 1):
        for place in waiting:
            values[place] = candidate(sweep.draws, random[place])
            _check(sweep, values[place], plan.first + places[int(place)])
        tried[waiting] += 1
        if keep_if:
            waiting = waiting[~_pass(sweep, builds, values[waiting], conditions, jobs)]
        if not keep_if or not len(waiting):
            return Drawing(values, tried)
    most, unlucky = keep_if.most if keep_if else 1, plan.first + places[int(waiting[0])]
    raise FilterError(
        f"trajectories.keep_if: trajectory {unlucky} passed none of {most} "
        f"candidates ({count - len(waiting)} of {count} trajectories found); loosen the conditions"
    )


def _check(sweep: Sweep, values: Array, index: int) -> None:
    """A normal distribution has no ends that could be checked beforehand, so that its numbers are.

    Raises FilterError for a number that the field could not have in a file.
    """
    if not any(one.distribution == "normal" for one in sweep.draws):
        return
    parts = split(sweep.draws, values)
    for one in sweep.draws:
        spec = next((spec for spec in sweep.specs if spec.has(one.path)), None)
        if one.distribution != "normal" or spec is None:
            continue
        changed = with_values(spec, {one.path: parts[one.path]})
        section = getattr(changed, one.path.partition(".")[0])
        part = section if isinstance(section, SpecModel) else changed
        try:
            type(part).model_validate({name: getattr(part, name) for name in type(part).model_fields})
        except ValidationError as error:
            text = error.errors()[0]["msg"]
            numbers = ", ".join(f"{value:.6g}" for value in parts[one.path])
            raise FilterError(
                f"trajectories.draw.{one.path}: trajectory {index} drew {numbers}: {text}; draw it uniformly"
            ) from None


def _pass(
    sweep: Sweep, builds: Builds, values: Array, conditions: list[Condition], jobs: int
) -> NDArray[np.bool_]:
    """Which candidates meet all conditions; a run that was stopped meets none."""
    passed = np.ones(len(values), dtype=bool)
    if sweep.filter is None:
        return passed
    for rows in rows_of(builds, sweep.filter, sweep.draws, values, np.arange(len(values))):
        batch = rows.build.engine(record=False).run(rows.parameters, rows.steps, jobs=jobs)
        passed[rows.runs] = _meets(rows.build.engine(record=False).loop.metrics, batch, conditions)
    return passed


def _meets(metrics: tuple[object, ...], batch: Batch, conditions: list[Condition]) -> NDArray[np.bool_]:
    names = [getattr(metric, "name", "") for metric in metrics]
    good = np.asarray(batch.stops == 0)
    for condition in conditions:
        values = batch.metrics[:, names.index(condition.metric)]
        compare = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal}[condition.sign]
        good &= compare(values, condition.limit)
    return good
