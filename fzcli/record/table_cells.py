"""The statistics of a table's cells: of numbers, of truth values, and of paired differences between columns."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError
from fzcli.record.intervals import mean_intervals, median_interval, paired_share_interval, share_bound
from fzcli.record.sweep_record import SweepRecord
from fzcli.record.table_places import Place, Places
from fzcli.spec.quantity import Signal

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Statistic:
    """One metric over the runs of a cell: of the ``count`` runs that have a finite value."""

    count: int
    mean: float
    median: float
    p05: float
    p95: float
    paper: float | None = None


@dataclass(frozen=True)
class Share:
    """One truth-valued metric over the runs of a cell: ``true`` of ``runs``, of which ``count`` have a value.

    A run without a value counts as not true; where no run has one there is no share (nan).
    ``low``: one-sided lower 95 % bound of ``share`` (Clopper-Pearson).
    """

    count: int
    runs: int
    true: int
    share: float
    low: float
    paper: float | None = None


@dataclass(frozen=True)
class Difference:
    """Mean of a metric less that of the first column, over the ``count`` trajectories both have finite.

    ``low`` and ``high``: 95 % interval, by bootstrap over the paired differences. Of truth values it is
    the difference of the shares, with the score interval for pairs. ``more``: of numbers ``median`` of
    the paired differences, with the 95 % interval ``median_low`` to ``median_high``; of truth values the
    pairs true here alone, ``gained``, and there alone, ``lost``.
    """

    count: int
    mean: float
    low: float
    high: float
    more: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Cell:
    """The runs of one row and column: how many, how they ended, and the statistics of every metric."""

    runs: int
    lost: int | None
    flagged: int
    failed: int
    statistics: Mapping[str, Statistic | Share]
    differences: Mapping[str, Difference] = field(default_factory=dict)


def statistic_of(metric: Signal, values: NDArray[Any], paper: float | None = None) -> Statistic | Share:
    """The statistics of one metric over the runs of a cell (n).

    Raises:
        RecordError: the metric is declared true or false, and a value is neither.
    """
    every = np.asarray(values, dtype=np.float64)
    finite = every[np.isfinite(every)]
    if metric.truth:
        return _share(metric, every, int(finite.size), paper)
    if not finite.size:
        return Statistic(0, math.nan, math.nan, math.nan, math.nan, paper)
    p05, median, p95 = (float(value) for value in np.quantile(finite, [0.05, 0.5, 0.95]))
    with np.errstate(over="ignore"):  # diverged runs may sum to inf: then the mean is inf, and says so
        mean = float(finite.mean())
    return Statistic(int(finite.size), mean, median, p05, p95, paper)


def _share(metric: Signal, values: Array, count: int, paper: float | None) -> Share:
    neither = values[~np.isnan(values) & (values != 0) & (values != 1)]
    if neither.size:
        raise RecordError(f"{metric.name}: is declared true or false (1 or 0), but a run has {neither[0]:g}")
    if count == 0:
        return Share(0, values.size, 0, math.nan, math.nan, paper)
    true = int((values == 1).sum())
    return Share(count, values.size, true, true / values.size, share_bound(true, values.size), paper)


def differences(
    record: SweepRecord, places: Places, members: Mapping[Place, NDArray[np.intp]], metrics: Sequence[Signal]
) -> dict[Place, dict[str, Difference]]:
    """Paired differences of every column from the first, by place and metric."""
    pairs = _pairs(record, places, members)
    found: dict[Place, dict[str, Difference]] = {place: {} for place in pairs}
    gaps: list[tuple[Place, str, Array]] = []
    for place, (ours, theirs) in pairs.items():
        for metric in metrics:
            values = np.asarray(record.metrics[metric.name], dtype=np.float64)
            if metric.truth:
                found[place][metric.name] = _share_difference(values[ours], values[theirs])
                continue
            with np.errstate(invalid="ignore", over="ignore"):
                gap = values[ours] - values[theirs]
            gaps.append((place, metric.name, gap[np.isfinite(gap)]))
    for place, name, difference in _mean_differences(gaps):
        found[place][name] = difference
    return found


def _pairs(
    record: SweepRecord, places: Places, members: Mapping[Place, NDArray[np.intp]]
) -> dict[Place, tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Runs of each place beside those of its row in the first column that they are paired with."""
    number = places.pair_numbers(record)
    found = {}
    for (row, column), chosen in members.items():
        first = members.get((row, places.columns[0]))
        if column == places.columns[0] or first is None:
            continue
        _, ours, theirs = np.intersect1d(number[chosen], number[first], return_indices=True)
        found[row, column] = (chosen[ours], first[theirs])
    return found


def _share_difference(ours: Array, theirs: Array) -> Difference:
    """Runs without a value count as not true; without any on one side there is no difference."""
    if not (np.isfinite(ours).any() and np.isfinite(theirs).any()):
        return Difference(0, math.nan, math.nan, math.nan)
    gained = int(((ours == 1) & (theirs != 1)).sum())
    lost = int(((ours != 1) & (theirs == 1)).sum())
    low, high = paired_share_interval(gained, lost, ours.size)
    return Difference(ours.size, (gained - lost) / ours.size, low, high, {"gained": gained, "lost": lost})


def _mean_differences(gaps: Sequence[tuple[Place, str, Array]]) -> list[tuple[Place, str, Difference]]:
    """Of every sample of paired differences; those of one size are resampled together."""
    found = []
    for count in dict.fromkeys(gap.size for _, _, gap in gaps):
        alike = [item for item in gaps if item[2].size == count]
        samples = np.array([gap for _, _, gap in alike])
        ends = mean_intervals(samples) if count > 1 else np.full((len(alike), 2), math.nan)
        for (place, name, gap), (low, high) in zip(alike, ends, strict=True):
            mean = float(gap.mean()) if count else math.nan
            found.append((place, name, Difference(count, mean, float(low), float(high), _median(gap))))
    return found


def _median(gap: Array) -> dict[str, float]:
    low, high = median_interval(gap)
    return {"median": float(np.median(gap)) if gap.size else math.nan, "median_low": low, "median_high": high}
