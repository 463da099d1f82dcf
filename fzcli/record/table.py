"""Tables of a sweep: statistics of its metrics by configuration, losses counted, beside published numbers."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError
from fzcli.record.names import INDEX_COLUMNS, signal_of
from fzcli.record.sweep_record import SweepRecord
from fzcli.record.table_beside import read_paper
from fzcli.record.table_cells import Cell, Difference, differences, statistic_of
from fzcli.record.table_places import CONFIGURATION, Place, Value, has_entry, places_of
from fzcli.record.table_spec import DEFAULT_LOST, LostRule, TableSpec
from fzcli.spec.nearest import hint
from fzcli.spec.quantity import Signal
from fzcli.spec.result import STATUS_NAMES


@dataclass(frozen=True)
class Table:
    """A sweep by row and column. ``cells`` has an entry for every pair that was run."""

    row_key: str
    column_key: str | None
    rows: tuple[Value, ...]
    columns: tuple[Value, ...]
    metrics: tuple[Signal, ...]
    cells: Mapping[Place, Cell]
    lost_rule: str
    beside: str = ""
    notes: tuple[str, ...] = ()


def build_table(record: SweepRecord, spec: TableSpec | Mapping[str, Any] | Any) -> Table:
    """The table that ``spec``, a ``table:`` section, asks for.

    Mean, median, 5th and 95th percentile are over the finite values of all runs, failed ones included;
    each statistic says how many those are, and each cell how many were lost, flagged and failed.

    Raises:
        RecordError: a row, column or metric that the sweep does not have, or a metric declared true or
            false with other values.
        UsageError: the section itself makes no sense.
    """
    spec = TableSpec.of(spec)
    check_names(record.configs, record.metrics, spec)
    names = spec.metrics or tuple(
        name for name in record.metrics if name not in INDEX_COLUMNS and name not in record.certificate_names
    )
    metrics = tuple(signal_of(name, record.metric_info.get(name)) for name in names)
    lost = _lost_runs(record, spec)
    paper = read_paper(spec)
    places = places_of(record, spec.rows, spec.columns)
    members = places.members(record)
    gaps = differences(record, places, members, metrics)
    cells = {
        place: _cell(record, chosen, metrics, lost, paper.get(place, {}), gaps.get(place, {}))
        for place, chosen in members.items()
    }
    return Table(
        row_key=spec.rows,
        column_key=spec.columns,
        rows=places.rows,
        columns=places.columns,
        metrics=metrics,
        cells=cells,
        lost_rule=str(LostRule.parse(spec.lost or DEFAULT_LOST)) if lost is not None else "",
        beside=spec.beside or "",
        notes=places.notes,
    )


def check_names(configs: Sequence[Mapping[str, Any]], metrics: Iterable[str], spec: TableSpec) -> None:
    """Whether a sweep of these configurations and metrics has what the table asks for.

    Raises:
        RecordError: a row, column or metric that it does not have.
        UsageError: the rule of lost runs makes no sense.
    """
    paths = dict.fromkeys(path for config in configs for path in config)
    for part, name in (("rows", spec.rows), ("columns", spec.columns)):
        if name is not None and name != CONFIGURATION and not any(has_entry(config, name) for config in configs):
            near = hint(name, [*paths, CONFIGURATION])
            raise RecordError(f"table: {part}: {name}: the sweep does not vary it{near}")
    known = [name for name in metrics if name not in INDEX_COLUMNS]
    wanted = [("show", name) for name in spec.metrics]
    if spec.lost:
        wanted.append(("lost", LostRule.parse(spec.lost).name))
    for part, name in wanted:
        if name not in known:
            raise RecordError(f"table: {part}: {name}: the sweep has no such metric{hint(name, known)}")


def _lost_runs(record: SweepRecord, spec: TableSpec) -> NDArray[np.bool_] | None:
    """Which runs are lost; None when the sweep has no metric to tell by."""
    rule = LostRule.parse(spec.lost or DEFAULT_LOST)
    if rule.name not in record.metrics:
        return None
    values = np.asarray(record.metrics[rule.name], dtype=np.float64)
    held = {
        ">": values <= rule.limit,
        ">=": values < rule.limit,
        "<": values >= rule.limit,
        "<=": values > rule.limit,
    }
    return ~held[rule.sign]


def _cell(
    record: SweepRecord,
    chosen: NDArray[np.intp],
    metrics: Sequence[Signal],
    lost: NDArray[np.bool_] | None,
    paper: Mapping[str, float],
    gaps: Mapping[str, Difference],
) -> Cell:
    status = np.asarray(record.metrics["status"])[chosen]
    statistics = {
        one.name: statistic_of(one, record.metrics[one.name][chosen], paper.get(one.name)) for one in metrics
    }
    return Cell(
        runs=int(chosen.size),
        lost=None if lost is None else int(lost[chosen].sum()),
        flagged=int((status == STATUS_NAMES.index("flagged")).sum()),
        failed=int((status == STATUS_NAMES.index("failed")).sum()),
        statistics=statistics,
        differences=gaps,
    )
