"""Tables of a sweep: statistics of its metrics by configuration, losses counted, beside published numbers."""

import csv
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError
from fzcli.loop.rollout import STATUS_NAMES
from fzcli.record.bootstrap import mean_intervals
from fzcli.record.names import INDEX_COLUMNS, signal_of
from fzcli.record.sweep_record import SweepRecord
from fzcli.record.table_spec import DEFAULT_LOST, LostRule, TableSpec
from fzcli.spec.nearest import hint
from fzcli.spec.quantity import Signal

Value = str | float


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
class Difference:
    """Mean of a metric less that of the first column, over the ``count`` trajectories both have finite.

    ``low`` and ``high``: 95 % bootstrap interval over the paired differences.
    """

    count: int
    mean: float
    low: float
    high: float


@dataclass(frozen=True)
class Cell:
    """The runs of one row and column: how many, how they ended, and the statistics of every metric."""

    runs: int
    lost: int | None
    flagged: int
    failed: int
    statistics: Mapping[str, Statistic]
    differences: Mapping[str, Difference] = field(default_factory=dict)


@dataclass(frozen=True)
class Table:
    """A sweep by row and column. ``cells`` has an entry for every pair that was run."""

    row_key: str
    column_key: str | None
    rows: tuple[Value, ...]
    columns: tuple[Value, ...]
    metrics: tuple[Signal, ...]
    cells: Mapping[tuple[Value, Value], Cell]
    lost_rule: str
    beside: str = ""
    notes: tuple[str, ...] = ()


def build_table(record: SweepRecord, spec: TableSpec | Mapping[str, Any] | Any) -> Table:
    """The table that ``spec``, a ``table:`` section, asks for.

    Mean, median, 5th and 95th percentile are over the finite values of all runs, failed ones included;
    each statistic says how many those are, and each cell how many were lost, flagged and failed.

    Raises:
        RecordError: a row, column or metric that the sweep does not have.
        UsageError: the section itself makes no sense.
    """
    spec = TableSpec.of(spec)
    check_names(record.configs, record.metrics, spec)
    rows = _values(record, spec.rows)
    columns = _values(record, spec.columns) if spec.columns else ("",)
    metrics = spec.metrics or tuple(
        name for name in record.metrics if name not in INDEX_COLUMNS and name not in record.certificate_names
    )
    lost = _lost_runs(record, spec)
    paper = _read_paper(spec)
    members = {(row, column): _members(record, spec, row, column) for row in rows for column in columns}
    members = {place: chosen for place, chosen in members.items() if chosen.size}
    differences = _differences(record, members, metrics, columns, spec)
    cells = {
        place: _cell(record, chosen, metrics, lost, paper.get(place, {}), differences.get(place, {}))
        for place, chosen in members.items()
    }
    return Table(
        row_key=spec.rows,
        column_key=spec.columns,
        rows=rows,
        columns=columns,
        metrics=tuple(signal_of(name, record.metric_info.get(name)) for name in metrics),
        cells=cells,
        lost_rule=str(LostRule.parse(spec.lost or DEFAULT_LOST)) if lost is not None else "",
        beside=spec.beside or "",
        notes=_notes(record, spec),
    )


def check_names(configs: Sequence[Mapping[str, Any]], metrics: Iterable[str], spec: TableSpec) -> None:
    """Whether a sweep of these configurations and metrics has what the table asks for.

    Raises:
        RecordError: a row, column or metric that it does not have.
        UsageError: the rule of lost runs makes no sense.
    """
    paths = dict.fromkeys(path for config in configs for path in config)
    for part, name in (("rows", spec.rows), ("columns", spec.columns)):
        if name is not None and name not in paths:
            raise RecordError(f"table: {part}: {name}: the sweep does not vary it{hint(name, paths)}")
    known = [name for name in metrics if name not in INDEX_COLUMNS]
    wanted = [("show", name) for name in spec.metrics]
    if spec.lost:
        wanted.append(("lost", LostRule.parse(spec.lost).name))
    for part, name in wanted:
        if name not in known:
            raise RecordError(f"table: {part}: {name}: the sweep has no such metric{hint(name, known)}")


def _plain(value: Any) -> Value:
    """A configuration value that can head a row: numbers as floats, everything else as text."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return value if isinstance(value, str) else json.dumps(value)


def _values(record: SweepRecord, path: str) -> tuple[Value, ...]:
    return tuple(dict.fromkeys(_plain(config.get(path)) for config in record.configs))


def _members(record: SweepRecord, spec: TableSpec, row: Value, column: Value) -> NDArray[np.intp]:
    """Indices of the runs of one cell."""
    chosen = [
        index
        for index, config in enumerate(record.configs)
        if _plain(config.get(spec.rows)) == row
        and (spec.columns is None or _plain(config.get(spec.columns)) == column)
    ]
    return np.flatnonzero(np.isin(record.metrics["config"], chosen))


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
    metrics: tuple[str, ...],
    lost: NDArray[np.bool_] | None,
    paper: Mapping[str, float],
    differences: Mapping[str, Difference],
) -> Cell:
    status = np.asarray(record.metrics["status"])[chosen]
    return Cell(
        runs=int(chosen.size),
        lost=None if lost is None else int(lost[chosen].sum()),
        flagged=int((status == STATUS_NAMES.index("flagged")).sum()),
        failed=int((status == STATUS_NAMES.index("failed")).sum()),
        statistics={name: _statistic(record.metrics[name][chosen], paper.get(name)) for name in metrics},
        differences=differences,
    )


def _statistic(values: NDArray[Any], paper: float | None) -> Statistic:
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    if not finite.size:
        return Statistic(0, math.nan, math.nan, math.nan, math.nan, paper)
    p05, median, p95 = (float(value) for value in np.quantile(finite, [0.05, 0.5, 0.95]))
    with np.errstate(over="ignore"):  # diverged runs may sum to inf: then the mean is inf, and says so
        mean = float(finite.mean())
    return Statistic(int(finite.size), mean, median, p05, p95, paper)


def _differences(
    record: SweepRecord,
    members: Mapping[tuple[Value, Value], NDArray[np.intp]],
    metrics: tuple[str, ...],
    columns: tuple[Value, ...],
    spec: TableSpec,
) -> dict[tuple[Value, Value], dict[str, Difference]]:
    """Paired differences of every column from the first, resampled together where the counts agree."""
    samples: list[tuple[tuple[Value, Value], str, NDArray[np.float64]]] = []
    pair_of = _pair_numbers(record, spec)
    for (row, column), chosen in members.items():
        first = members.get((row, columns[0]))
        if column == columns[0] or first is None:
            continue
        _, ours, theirs = np.intersect1d(pair_of[chosen], pair_of[first], return_indices=True)
        for name in metrics:
            values = np.asarray(record.metrics[name], dtype=np.float64)
            with np.errstate(invalid="ignore", over="ignore"):
                gap = values[chosen[ours]] - values[first[theirs]]
            samples.append(((row, column), name, gap[np.isfinite(gap)]))
    found: dict[tuple[Value, Value], dict[str, Difference]] = {}
    for count in {gap.size for _, _, gap in samples if gap.size}:
        alike = [item for item in samples if item[2].size == count]
        gaps = np.array([gap for _, _, gap in alike])
        for (place, name, _), mean, (low, high) in zip(
            alike, gaps.mean(axis=1), mean_intervals(gaps), strict=True
        ):
            found.setdefault(place, {})[name] = Difference(count, float(mean), float(low), float(high))
    return found


def _pair_numbers(record: SweepRecord, spec: TableSpec) -> NDArray[np.int64]:
    """A number a run that two runs share when only the table's column tells them apart."""
    rest = [
        json.dumps(
            {path: value for path, value in sorted(config.items()) if path != spec.columns}, default=str
        )
        for config in record.configs
    ]
    kinds = {text: number for number, text in enumerate(dict.fromkeys(rest))}
    kind_of = np.array([kinds[text] for text in rest], dtype=np.int64)
    trajectory = np.asarray(record.metrics["trajectory"], dtype=np.int64)
    span = int(trajectory.max(initial=0)) + 1
    return kind_of[np.asarray(record.metrics["config"], dtype=np.int64)] * span + trajectory


def _notes(record: SweepRecord, spec: TableSpec) -> tuple[str, ...]:
    """What a reader must know: entries of the grid over which the cells are pooled."""
    paths = dict.fromkeys(path for config in record.configs for path in config)
    cells: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for config in record.configs:
        place = (str(config.get(spec.rows)), str(config.get(spec.columns)) if spec.columns else "")
        cells.setdefault(place, []).append(config)
    notes = []
    for path in (path for path in paths if path not in (spec.rows, spec.columns)):
        inside = [dict.fromkeys(str(config.get(path)) for config in members) for members in cells.values()]
        pooled = [values for values in inside if len(values) > 1]
        if pooled:
            met = {value for cell in pooled for value in cell}
            values = [v for v in dict.fromkeys(str(config.get(path)) for config in record.configs) if v in met]
            who = "each cell pools" if len(pooled) == len(cells) else "some cells pool"
            notes.append(f"{who} {len(values)} values of {path}: {', '.join(values)}")
    return tuple(notes)


def _read_paper(spec: TableSpec) -> dict[tuple[Value, Value], dict[str, float]]:
    """The published numbers by row, column and metric; empty entries of the file are left out."""
    if not spec.beside_text:
        return {}
    lines = [line for line in spec.beside_text.splitlines() if line.strip() and not line.startswith("#")]
    reader = csv.DictReader(lines)
    names = reader.fieldnames or []
    for key in (spec.rows, spec.columns):
        if key is not None and key not in names:
            raise RecordError(f"table: beside: {spec.beside}: no column {key}{hint(key, names)}")
    found: dict[tuple[Value, Value], dict[str, float]] = {}
    for number, line in enumerate(reader, start=1):
        place = (
            _number_or_text(line[spec.rows]),
            _number_or_text(line[spec.columns]) if spec.columns else "",
        )
        try:
            cell = {
                name: float(text)
                for name, text in line.items()
                if name not in (spec.rows, spec.columns) and text
            }
        except (TypeError, ValueError) as error:
            raise RecordError(f"table: beside: {spec.beside}: entry {number}: {error}") from error
        found[place] = cell
    return found


def _number_or_text(text: str) -> Value:
    try:
        return float(text)
    except ValueError:
        return text
