"""Find trajectories of a sweep by criteria that compare configurations, such as ``fixed.x > 2 * fuzzy.x``."""

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import UsageError
from fzcli.record.sweep_record import SweepRecord
from fzcli.spec.nearest import hint

Array = NDArray[np.float64]
_COMPARE: dict[str, Callable[[Array, Array], Any]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_SIGN = re.compile(r"(<=|>=|<|>)")
_FACTOR = re.compile(r"([*/])")
_NAME = re.compile(r"([A-Za-z_]\w*)\.([A-Za-z_]\w*)")


@dataclass(frozen=True)
class Found:
    """Trajectories that meet all criteria, the best first, and the value they are ranked by."""

    trajectories: NDArray[np.int64]
    ranks: Array


def configuration(record: SweepRecord, changes: Mapping[str, Any]) -> int:
    """The one configuration with these entries, such as {"controller.gain": 1000}.

    Raises UsageError when none or several have them.
    """
    fits = [
        c for c, config in enumerate(record.configs) if all(config.get(path) == v for path, v in changes.items())
    ]
    if len(fits) != 1:
        wanted = ", ".join(f"{path}={value}" for path, value in changes.items())
        raise UsageError(f"{len(fits)} configurations have {wanted}; name the entries of exactly one")
    return fits[0]


def find(
    record: SweepRecord,
    configurations: Mapping[str, int],
    criteria: Sequence[str],
    by: str,
    lowest: bool = False,
) -> Found:
    """Trajectories for which every criterion holds, ranked by an expression (highest first).

    A criterion is SIDE < SIDE (or <=, >, >=); a side is a product or quotient of numbers and
    NAME.METRIC, NAME one of ``configurations``. Comparisons with NaN do not hold.
    Raises UsageError for anything else.
    """
    values = _Values(record, configurations)
    good = np.ones(values.count, dtype=bool)
    for text in criteria:
        parts = _SIGN.split(text)
        if len(parts) != 3:
            raise UsageError(f"{text!r} is not of the form SIDE < SIDE (or <=, >, >=)")
        good &= _COMPARE[parts[1]](values.side(parts[0]), values.side(parts[2]))
    rank = values.side(by)
    order = np.argsort(rank if lowest else -rank, kind="stable")
    order = order[good[order] & ~np.isnan(rank[order])]
    return Found(values.trajectories[order], rank[order])


def drawn(record: SweepRecord, trajectory: int) -> dict[str, list[float] | float]:
    """What was drawn for a trajectory: dotted path -> number or list."""
    row = trajectory - int(record.metrics["trajectory"].min())
    found: dict[str, list[float] | float] = {}
    for path, values in record.draws.items():
        numbers = [float(number) for number in values[row]]
        found[path] = numbers if len(numbers) > 1 else numbers[0]
    return found


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted paths as nested mappings."""
    tree: dict[str, Any] = {}
    for path, value in values.items():
        *sections, name = path.split(".")
        inner = tree
        for section in sections:
            inner = inner.setdefault(section, {})
        inner[name] = value
    return tree


class _Values:
    """Sides of comparisons as columns over the trajectories."""

    def __init__(self, record: SweepRecord, configurations: Mapping[str, int]) -> None:
        self.record = record
        self.configurations = configurations
        self.trajectories: NDArray[np.int64] = np.unique(record.metrics["trajectory"]).astype(np.int64)
        self.count = len(self.trajectories)

    def side(self, text: str) -> Array:
        """A product or quotient of numbers and NAME.METRIC."""
        parts = _FACTOR.split(text)
        result = self._factor(parts[0])
        for sign, factor in zip(parts[1::2], parts[2::2], strict=True):
            with np.errstate(divide="ignore", invalid="ignore"):
                result = result * self._factor(factor) if sign == "*" else result / self._factor(factor)
        return result

    def _factor(self, text: str) -> Array:
        text = text.strip()
        match = _NAME.fullmatch(text)
        if match:
            return self._column(match[1], match[2])
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if math.isnan(number):
            raise UsageError(f"{text!r} is neither a number nor CONFIGURATION.METRIC")
        return np.full(self.count, number)

    def _column(self, name: str, metric: str) -> Array:
        if name not in self.configurations:
            raise UsageError(f"no configuration named {name!r}{hint(name, self.configurations)}")
        if metric not in self.record.metrics:
            raise UsageError(f"no metric {metric!r}{hint(metric, self.record.metrics)}")
        rows = self.record.metrics["config"] == self.configurations[name]
        order = np.argsort(self.record.metrics["trajectory"][rows], kind="stable")
        return np.asarray(self.record.metrics[metric][rows][order], dtype=float)
