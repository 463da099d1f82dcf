"""How well runs do: scores, their change, and the journal of those that candidates had."""

import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """Of a candidate: the mean of the metric over runs that have it, runs that are lost, and all runs."""

    mean: float
    lost: int
    runs: int


@dataclass(frozen=True)
class Change:
    """A mean less that of the baseline, and its standard error over the trajectories, in pairs."""

    mean: float
    error: float


@dataclass(frozen=True)
class Runs:
    """What runs of one or more configurations gave: the metric (configurations, trajectories), and which are lost."""

    metric: Array
    lost: NDArray[np.bool_]

    @property
    def score(self) -> Score:
        """Over all runs."""
        finite = self.metric[np.isfinite(self.metric)]
        return Score(float(finite.mean()) if len(finite) else math.inf, int(self.lost.sum()), self.lost.size)

    def change_from(self, other: "Runs") -> Change:
        """Over the trajectories that both have the metric of."""
        mine, theirs = (np.where(np.isfinite(one.metric), one.metric, np.nan) for one in (self, other))
        both = np.isfinite(mine).any(axis=0) & np.isfinite(theirs).any(axis=0)
        gaps = np.nanmean(mine[:, both], axis=0) - np.nanmean(theirs[:, both], axis=0)
        if len(gaps) < 2:
            return Change(math.nan, math.nan)
        return Change(float(gaps.mean()), float(gaps.std(ddof=1) / math.sqrt(len(gaps))))


def joined(columns: Sequence[tuple[Array, NDArray[np.bool_]]]) -> Runs:
    """Those of one or more configurations: their metric and which are lost, each (trajectories)."""
    metric, lost = zip(*columns, strict=True)
    return Runs(np.array(metric), np.array(lost))


def read_journal(journal: Path) -> dict[tuple[float, ...], Score]:
    """What was found before; a line that was cut short does not count."""
    known: dict[tuple[float, ...], Score] = {}
    try:
        lines = journal.read_text(encoding="utf-8").splitlines()
    except OSError:
        return known
    for line in lines:
        try:
            values, mean, lost, runs = json.loads(line)
            known[tuple(values)] = Score(mean, lost, runs)
        except (ValueError, TypeError):
            continue
    return known


def append(journal: Path, values: tuple[float, ...], score: Score) -> None:
    """One more candidate, safe on the disk."""
    with journal.open("a", encoding="utf-8") as file:
        file.write("\n" + json.dumps([list(values), score.mean, score.lost, score.runs]))
        file.flush()
        os.fsync(file.fileno())
