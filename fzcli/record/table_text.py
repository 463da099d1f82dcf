"""A table as text: for people (rich, md) and for programs (csv, json)."""

import csv
import io
import json
import math
from collections.abc import Iterator
from typing import Any, Literal

from fzcli.errors import UsageError
from fzcli.record.table import Table
from fzcli.record.table_cells import Cell, Share
from fzcli.record.table_lines import blocks, cell_lines, heading, lead, legend, lost_text, unit_text
from fzcli.record.table_rich import rich_text

Format = Literal["rich", "csv", "json", "md"]
FORMATS: tuple[Format, ...] = ("rich", "csv", "json", "md")


def render(table: Table, format: str = "rich", width: int = 110, color: bool = False) -> str:
    """The table as text in one of FORMATS; ``width`` and ``color`` matter to rich alone.

    Raises:
        UsageError: the format is unknown.
    """
    if format == "rich":
        return rich_text(table, width, color)
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
    values: dict[str, float]
    if isinstance(one, Share):
        values = {"share": one.share, "share_low": one.low, "true": one.true}
    else:
        values = {"mean": one.mean, "median": one.median, "p05": one.p05, "p95": one.p95}
    values["count"] = one.count
    if one.paper is not None:
        values["paper"] = one.paper
    gap = cell.differences.get(metric)
    if gap is not None:
        values |= {"difference": gap.mean, "difference_low": gap.low, "difference_high": gap.high}
        values |= {f"difference_{name}": value for name, value in gap.more.items()}
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


def _markdown(table: Table) -> str:
    lost = ["lost"] if table.lost_rule else []
    header = [table.row_key, "", *(f"{metric.name} {unit_text(metric)}" for metric in table.metrics)]
    header += ["runs", *lost, "flagged", "failed"]
    parts = []
    for title, cells in blocks(table):
        lines = [f"**{title}**", ""] if title else []
        lines += [_pipes(header), _pipes(["---:", ":---", *["---:"] * (len(header) - 2)])]
        for row, cell in cells:
            inner = cell_lines(table, cell)
            counts = [str(cell.runs), *([lost_text(cell)] if lost else []), str(cell.flagged), str(cell.failed)]
            for number, line in enumerate(inner):
                shown = counts if number == lead(inner) else [""] * len(counts)
                lines.append(_pipes([heading(row) if number == 0 else "", *line, *shown]))
        parts.append("\n".join(lines))
    return "\n\n".join([*parts, "  \n".join(legend(table))]) + "\n"


def _pipes(cells: list[str]) -> str:
    return "| " + " | ".join(cell.strip().replace("|", "\\|") for cell in cells) + " |"
