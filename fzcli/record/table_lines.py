"""The lines of a table that people read: numbers, labels and legends, the same in every layout."""

import math
from collections.abc import Callable, Iterator, Sequence

from fzcli.record.labels import shown, spoken
from fzcli.record.table import Table
from fzcli.record.table_cells import Cell, Difference, Share, Statistic
from fzcli.record.table_places import CONFIGURATION, Value
from fzcli.spec.quantity import Signal

_LONGEST = 14  # characters of the label of a difference

_NUMBERS: tuple[tuple[str, Callable[[Statistic], str]], ...] = (
    ("mean", lambda one: short(one.mean)),
    ("median", lambda one: short(one.median)),
    ("95th pct", lambda one: short(one.p95)),
)
_SHARES: tuple[tuple[str, Callable[[Share], str]], ...] = (
    ("share", lambda one: percent(one.share, one.runs)),
    ("at least", lambda one: percent(one.low, one.runs, math.floor)),
)


def short(value: float | None) -> str:
    """A number with three significant digits, in the shorter of the two notations."""
    if value is None or math.isnan(value):
        return "-"
    if 1000 <= abs(value) < 1e5:
        return f"{value:.0f}"
    if value != 0 and abs(value) < 1e-3:
        mantissa, exponent = f"{value:.2e}".split("e")
        return f"{float(mantissa):g}e{int(exponent)}"
    return f"{value:.3g}"


def percent(share: float, count: int, rounded: Callable[[float], int] = round) -> str:
    """A share of ``count`` in per cent, with as many decimals as one of them makes; bounds round outwards."""
    return "-" if math.isnan(share) else f"{_hundredths(share, count, rounded)} %"


def points(difference: float, count: int, rounded: Callable[[float], int] = round) -> str:
    """A difference of shares of ``count`` in percentage points, with its sign."""
    if math.isnan(difference):
        return "-"
    text = _hundredths(difference, count, rounded)
    return f"{text} pp" if float(text) <= 0 else f"+{text} pp"


def _hundredths(share: float, count: int, rounded: Callable[[float], int]) -> str:
    decimals = max(1, math.ceil(math.log10(count)) - 2)
    return f"{rounded(round(100 * share * 10**decimals, 6)) / 10**decimals:.{decimals}f}"


def heading(value: Value) -> str:
    """What heads a row."""
    return shown(value)


def unit_text(metric: Signal) -> str:
    """The unit of a metric in brackets, empty where it has none."""
    return "" if metric.unit == "1" else f"[{metric.unit}]"


def blocks(table: Table) -> Iterator[tuple[str, list[tuple[Value, Cell]]]]:
    """Per column: its title, and its cells by row."""
    for column in table.columns:
        title = f"{table.column_key} = {heading(column)}" if table.column_key else ""
        if table.column_key == CONFIGURATION:
            title = heading(column)
        yield title, [(row, table.cells[row, column]) for row in table.rows if (row, column) in table.cells]


def cell_lines(table: Table, cell: Cell) -> list[list[str]]:
    """Lines of one cell: a label, then a text for every metric."""
    stats = [cell.statistics[metric.name] for metric in table.metrics]
    lines = []
    if table.beside:
        lines.append(["paper", *map(_paper, stats)])
    if any(isinstance(one, Share) for one in stats):
        lines += [[label, *(text(one) if isinstance(one, Share) else "" for one in stats)] for label, text in _SHARES]
    if any(isinstance(one, Statistic) for one in stats):
        lines += [
            [label, *(text(one) if isinstance(one, Statistic) else "" for one in stats)] for label, text in _NUMBERS
        ]
    if any(one.count < cell.runs for one in stats):
        lines.append(["finite in", *(str(one.count) for one in stats)])
    if cell.differences:
        lines += _difference_lines(table, [cell.differences.get(metric.name) for metric in table.metrics])
    return lines


def lead(lines: Sequence[Sequence[str]]) -> int:
    """The number of the line that leads a cell: the first that is not published."""
    return 1 if lines[0][0] == "paper" else 0


def _paper(one: Statistic | Share) -> str:
    if one.paper is None:
        return ""
    return percent(one.paper, one.runs) if isinstance(one, Share) else short(one.paper)


def _difference_lines(table: Table, gaps: Sequence[Difference | None]) -> list[list[str]]:
    def line(label: str, value: Callable[[Difference], float], rounded: Callable[[float], int]) -> list[str]:
        texts = [label]
        for metric, gap in zip(table.metrics, gaps, strict=True):
            if gap is None:
                texts.append("")
            else:
                texts.append(points(value(gap), gap.count, rounded) if metric.truth else short(value(gap)))
        return texts

    return [
        line(difference_label(table), lambda gap: gap.mean, round),
        line("  from", lambda gap: gap.low, math.floor),
        line("  to", lambda gap: gap.high, math.ceil),
        ["  pairs", *(str(gap.count) if gap else "" for gap in gaps)],
    ]


def first_column(table: Table) -> str:
    """The column that differences are from, in words."""
    return spoken(table.column_key or "", table.columns[0])


def difference_label(table: Table) -> str:
    """Of the line of differences; the legend says from what where that is too long."""
    label = f"- {first_column(table)}"
    return label if len(label) <= _LONGEST else "difference"


def lost_text(cell: Cell) -> str:
    """How many runs of a cell are lost."""
    return "" if cell.lost is None else f"{cell.lost} ({100 * cell.lost / cell.runs:.1f} %)"


def legend(table: Table) -> list[str]:
    """What the lines mean, and what a reader must know."""
    stats = [one for cell in table.cells.values() for one in cell.statistics.values()]
    lines = []
    if table.lost_rule:
        lines.append(f"lost: {table.lost_rule}. Means include lost and failed runs with finite values.")
    if any(isinstance(one, Share) for one in stats):
        lines.append("share: of runs for which it is true; at least: its one-sided lower 95 % bound (Clopper-Pearson).")
    if any(isinstance(one, Share) and 0 < one.count < one.runs for one in stats):
        lines.append("A run without a value counts as not true.")
    if table.beside:
        lines.append(f"paper: {table.beside}.")
    if any(cell.differences for cell in table.cells.values()):
        lines += _difference_legend(table)
    return [*lines, *(f"Note: {note}." for note in table.notes)]


def _difference_legend(table: Table) -> list[str]:
    label, first = difference_label(table), first_column(table)
    lines = []
    if not all(metric.truth for metric in table.metrics):
        pairs = "pairs: same trajectory, both finite"
        lines.append(f"{label}: mean difference from {first} over the {pairs}; 95 % bootstrap interval.")
    if any(metric.truth for metric in table.metrics):
        method = "95 % score interval for pairs (Tango)"
        lines.append(f"{label}, of shares: percentage points (pp) over all pairs; {method}.")
    return lines
