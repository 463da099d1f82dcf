"""A table as text: for people (rich, md) and for programs (csv, json)."""

import csv
import io
import json
import math
import textwrap
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Literal

from fzcli.errors import UsageError
from fzcli.record.table import Cell, Table, Value

Format = Literal["rich", "csv", "json", "md"]
FORMATS: tuple[Format, ...] = ("rich", "csv", "json", "md")


def render(table: Table, format: str = "rich", width: int = 110, color: bool = False) -> str:
    """The table as text in one of FORMATS; ``width`` and ``color`` matter to rich alone.

    Raises:
        UsageError: the format is unknown.
    """
    if format == "rich":
        return _rich(table, width, color)
    if format == "md":
        return _markdown(table)
    if format == "csv":
        return _csv(table)
    if format == "json":
        return _json(table)
    raise UsageError(f"table format {format!r}: expected one of {', '.join(FORMATS)}")


def records(table: Table) -> Iterator[dict[str, Any]]:
    """The table tidy: one record a cell and statistic; counts have no metric."""
    for row, column in ((row, column) for column in table.columns for row in table.rows):
        cell = table.cells.get((row, column))
        if cell is None:
            continue
        head = {table.row_key: row} | ({table.column_key: column} if table.column_key else {})
        for name in ("runs", "lost", "flagged", "failed"):
            if getattr(cell, name) is not None:
                yield {**head, "metric": "", "unit": "", "statistic": name, "value": getattr(cell, name)}
        for metric in table.metrics:
            for statistic, value in _statistics(cell, metric.name).items():
                yield {
                    **head,
                    "metric": metric.name,
                    "unit": metric.unit,
                    "statistic": statistic,
                    "value": value,
                }


def _statistics(cell: Cell, metric: str) -> dict[str, float]:
    one = cell.statistics[metric]
    values: dict[str, float] = {"mean": one.mean, "median": one.median, "p05": one.p05, "p95": one.p95}
    values["count"] = one.count
    if one.paper is not None:
        values["paper"] = one.paper
    gap = cell.differences.get(metric)
    if gap is not None:
        values |= {"difference": gap.mean, "difference_low": gap.low, "difference_high": gap.high}
        values["difference_count"] = gap.count
    return values


def _csv(table: Table) -> str:
    keys = [table.row_key] + ([table.column_key] if table.column_key else [])
    stream = io.StringIO()
    writer = csv.DictWriter(stream, [*keys, "metric", "unit", "statistic", "value"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(records(table))
    return stream.getvalue()


def _json(table: Table) -> str:
    lines = []
    for record in records(table):
        clean = {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in record.items()}
        lines.append(json.dumps(clean))
    return "[\n" + ",\n".join(lines) + "\n]\n"


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


def _heading(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else value


def _blocks(table: Table) -> Iterator[tuple[str, list[tuple[Value, Cell]]]]:
    """Per column value: its title, and its cells by row."""
    for column in table.columns:
        title = f"{table.column_key} = {_heading(column)}" if table.column_key else ""
        yield title, [(row, table.cells[row, column]) for row in table.rows if (row, column) in table.cells]


def _lines(table: Table, cell: Cell) -> list[list[str]]:
    """Lines of one cell: a label, then a number for every metric."""
    names = [metric.name for metric in table.metrics]
    stats = [cell.statistics[name] for name in names]
    lines = []
    if table.beside:
        lines.append(["paper", *(short(one.paper) if one.paper is not None else "" for one in stats)])
    lines.append(["mean", *(short(one.mean) for one in stats)])
    lines.append(["median", *(short(one.median) for one in stats)])
    lines.append(["95th pct", *(short(one.p95) for one in stats)])
    if any(one.count < cell.runs for one in stats):
        lines.append(["finite in", *(str(one.count) for one in stats)])
    if cell.differences:
        gaps = [cell.differences.get(name) for name in names]
        lines.append([f"- {_heading(table.columns[0])}", *(short(gap.mean) if gap else "" for gap in gaps)])
        lines.append(["  from", *(short(gap.low) if gap else "" for gap in gaps)])
        lines.append(["  to", *(short(gap.high) if gap else "" for gap in gaps)])
    return lines


def _lost(cell: Cell) -> str:
    return "" if cell.lost is None else f"{cell.lost} ({100 * cell.lost / cell.runs:.1f} %)"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f"[{unit}]"


def _footer(table: Table) -> list[str]:
    lines = []
    if table.lost_rule:
        lines.append(f"lost: {table.lost_rule}. Means include lost and failed runs with finite values.")
    if table.beside:
        lines.append(f"paper: {table.beside}.")
    if any(cell.differences for cell in table.cells.values()):
        first = _heading(table.columns[0])
        lines.append(
            f"- {first}: mean over the same trajectories less that of {first}; 95 % bootstrap interval."
        )
    return [*lines, *(f"Note: {note}." for note in table.notes)]


def _rich(table: Table, width: int, color: bool) -> str:
    from rich.console import Console
    from rich.text import Text

    stream = io.StringIO()
    system: Literal["standard"] | None = "standard" if color else None
    console = Console(file=stream, width=width, force_terminal=color, color_system=system, highlight=False)
    label = max(8, *(len(line[0]) for cell in table.cells.values() for line in _lines(table, cell)))
    side, column = 32 + label, 15  # what labels and counts take at most, and a metric
    share = max(1, (width - side) // column)
    for title, cells in _blocks(table):
        for start in range(0, len(table.metrics), share):
            part = replace(table, metrics=table.metrics[start : start + share])
            console.print(_rich_block(part, title, cells))
    for line in _footer(table):
        console.print(Text(line, style="dim"))
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines()) + "\n"


def _rich_block(table: Table, title: str, cells: list[tuple[Value, Cell]]) -> Any:
    from rich import box
    from rich.table import Table as RichTable
    from rich.text import Text

    grid = RichTable(title=title or None, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)
    grid.add_column(Text(table.row_key.replace(".", ".\n")), no_wrap=True)
    grid.add_column("", no_wrap=True)
    for metric in table.metrics:
        words = textwrap.wrap(metric.name.replace("_", " "), 13)
        grid.add_column(Text("\n".join([*words, _unit(metric.unit)]).rstrip()), justify="right", no_wrap=True)
    grid.add_column("lost", justify="right", no_wrap=True)
    for row, cell in cells:
        lines = _lines(table, cell)
        side = [_heading(row), f"{cell.runs} runs"]
        side += [
            f"{count} {name}" for name, count in (("flagged", cell.flagged), ("failed", cell.failed)) if count
        ]
        lines += [[""] * (1 + len(table.metrics))] * (len(side) - len(lines))
        side += [""] * (len(lines) - len(side))
        for number, (line, head) in enumerate(zip(lines, side, strict=True)):
            last = _lost(cell) if line[0] == "mean" else ""
            style = {"paper": "cyan", "mean": "bold"}.get(line[0], "")
            texts = [
                Text(head, style="bold" if number == 0 else "dim"),
                *(Text(one, style=style) for one in line),
            ]
            grid.add_row(*texts, Text(last, style="bold"), end_section=number == len(lines) - 1)
    return grid


def _markdown(table: Table) -> str:
    header = [table.row_key, "", *(f"{metric.name} {_unit(metric.unit)}" for metric in table.metrics)]
    header += ["runs", "lost", "flagged", "failed"]
    parts = []
    for title, cells in _blocks(table):
        lines = [f"**{title}**", ""] if title else []
        lines += [_pipes(header), _pipes(["---:", ":---", *["---:"] * (len(header) - 2)])]
        for row, cell in cells:
            for number, line in enumerate(_lines(table, cell)):
                counts = [str(cell.runs), _lost(cell), str(cell.flagged), str(cell.failed)]
                shown = counts if line[0] == "mean" else [""] * len(counts)
                lines.append(_pipes([_heading(row) if number == 0 else "", *line, *shown]))
        parts.append("\n".join(lines))
    return "\n\n".join([*parts, "  \n".join(_footer(table))]) + "\n"


def _pipes(cells: list[str]) -> str:
    return "| " + " | ".join(cell.strip().replace("|", "\\|") for cell in cells) + " |"
