"""A table for the terminal: as many metrics side by side as fit, in blocks one below the other."""

import io
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Literal

from fzcli.record.table import Table
from fzcli.record.table_cells import Cell
from fzcli.record.table_lines import blocks, cell_lines, heading, lead, legend, lost_text, unit_text
from fzcli.record.table_places import Value
from fzcli.spec.quantity import Signal

_GAP = 3  # characters between two columns
_WIDEST = 13  # characters of a metric's name on one line
_LABEL = 22  # of a row's


def rich_text(table: Table, width: int, color: bool) -> str:
    """The table in lines of at most ``width`` characters where its widest metric allows."""
    from rich.console import Console
    from rich.text import Text

    stream = io.StringIO()
    system: Literal["standard"] | None = "standard" if color else None
    console = Console(file=stream, width=width, force_terminal=color, color_system=system, highlight=False)
    for part, title, cells in _parts(table, width):
        console.print(_grid(part, title, cells))
    for line in legend(table):
        console.print(Text(line, style="dim"))
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines()) + "\n"


def _parts(table: Table, width: int) -> Iterator[tuple[Table, str, list[tuple[Value, Cell]]]]:
    """The table cut into blocks: a title, and the metrics that fit side by side."""
    cells = list(table.cells.items())
    lines = [line for _, cell in cells for line in cell_lines(table, cell)]
    sides = [text for (row, _), cell in cells for text in _side(row, cell)]
    left = max(map(len, [*_key_lines(table.row_key), *sides]))
    right = max(len(lost_text(cell)) for _, cell in cells) + _GAP if table.lost_rule else 0
    free = width - left - right - max(len(line[0]) for line in lines) - 2 * _GAP
    widths = [
        max(map(len, [*_name_lines(metric), *(line[1 + index] for line in lines)])) + _GAP
        for index, metric in enumerate(table.metrics)
    ]
    for title, rows in blocks(table):
        start = 0
        while start < len(widths):
            stop = start + 1
            while stop < len(widths) and sum(widths[start : stop + 1]) <= free:
                stop += 1
            yield replace(table, metrics=table.metrics[start:stop]), title, rows
            start = stop


def _key_lines(key: str) -> list[str]:
    return key.replace(".", ".\n").split("\n")


def _name_lines(metric: Signal) -> list[str]:
    return [*textwrap.wrap(metric.name.replace("_", " "), _WIDEST), *filter(None, [unit_text(metric)])]


def _side(row: Value, cell: Cell) -> list[str]:
    """What stands beside a cell: its row, and how many runs it has and how they ended."""
    counts = (("flagged", cell.flagged), ("failed", cell.failed))
    ends = [f"{count} {name}" for name, count in counts if count]
    return [*(textwrap.wrap(heading(row), _LABEL) or [""]), f"{cell.runs} runs", *ends]


def _grid(table: Table, title: str, cells: Sequence[tuple[Value, Cell]]) -> Any:
    from rich import box
    from rich.table import Table as RichTable
    from rich.text import Text

    grid = RichTable(title=title or None, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)
    grid.add_column(Text("\n".join(_key_lines(table.row_key))), no_wrap=True)
    grid.add_column("", no_wrap=True)
    for metric in table.metrics:
        grid.add_column(Text("\n".join(_name_lines(metric))), justify="right", no_wrap=True)
    if table.lost_rule:
        grid.add_column("lost", justify="right", no_wrap=True)
    for row, cell in cells:
        lines, side = cell_lines(table, cell), _side(row, cell)
        first, named = lead(lines), len(side) - len(_side("", cell)) + 1
        lines += [[""] * (1 + len(table.metrics))] * (len(side) - len(lines))
        side += [""] * (len(lines) - len(side))
        for number, (line, head) in enumerate(zip(lines, side, strict=True)):
            style = "bold" if number == first else "cyan" if line[0] == "paper" else ""
            texts = [Text(head, style="bold" if number < named else "dim"), *(Text(one, style=style) for one in line)]
            if table.lost_rule:
                texts.append(Text(lost_text(cell) if number == first else "", style="bold"))
            grid.add_row(*texts, end_section=number == len(lines) - 1)
    return grid
