"""A table of a sweep as a figure: each metric against the rows, and its differences from the first column."""

import math
import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fzcli.record.labels import spoken
from fzcli.record.table import Table
from fzcli.record.table_cells import Cell, Difference, Share, Statistic
from fzcli.record.table_lines import first_column
from fzcli.record.table_places import Value
from fzcli.spec.quantity import Signal
from fzcli.view.style import COLORS, MARKERS, dress, log_worthy, new_figure, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LONG = 24  # letters of a row's name: beyond, rows are numbered, and a key says what they are
_LINE = 0.17  # inches
_SPREAD = 0.6  # of the distance between named rows: over this the columns stand side by side
_BAR: dict[str, Any] = {"linestyle": "none", "capsize": 2.5, "linewidth": 1.2}
Panel = Callable[["Axes"], None]


@dataclass(frozen=True)
class _Abscissa:
    """Where each row stands; ``named`` rows are no numbers: columns side by side, and no line joins them."""

    places: dict[Value, float]
    named: bool
    logarithmic: bool

    def of(self, row: Value, column: int, columns: int) -> float:
        """The position of a row's point of one column."""
        shift = _SPREAD * ((column + 0.5) / columns - 0.5) if self.named else 0.0
        return self.places[row] + shift


def table_figure(table: Table, title: str = "") -> "Figure":
    """A panel a metric, one of lost runs, and one a metric's differences where there are any.

    A metric: mean (filled), median (dashed), 5-95 % (band), paper (open); a truth value: its share with
    the lower bound. Differences: mean and interval. Rows that are no numbers have points, not lines; where their names
    are long, they are numbered, with a key below the title.
    """
    panels: list[Panel] = [partial(_metric_panel, table=table, metric=one) for one in table.metrics]
    if table.lost_rule:
        panels.append(partial(_lost_panel, table=table))
    if any(cell.differences for cell in table.cells.values()):
        panels += [partial(_difference_panel, table=table, metric=one) for one in table.metrics]
    across = min(3, len(panels))
    down = -(-len(panels) // across)
    key = _key(table)
    figure = new_figure(3.6 * across + 0.4, 3.0 * down + 0.9 + _LINE * len(key))
    every = np.atleast_1d(figure.subplots(down, across, squeeze=False)).ravel()
    for axes, panel in zip(every, panels, strict=False):
        panel(axes)
        _dress_abscissa(axes, table)
    for axes in every[len(panels) :]:
        axes.remove()
    _legend(figure, table, max(2, 2 * across - 1))
    if key:
        figure.suptitle("\n".join([title, *key]), fontsize=9, x=0.01, ha="left", linespacing=1.3)
    else:
        figure.suptitle(title, fontsize=10)
    return figure


def _key(table: Table) -> list[str]:
    """A line a row whose name is too long to stand below an axis; empty where all are short."""
    names = [str(row) for row in table.rows]
    long = _abscissa(table).named and max(map(len, names)) > _LONG
    return [f"{number}  {name}" for number, name in enumerate(names, 1)] if long else []


def _abscissa(table: Table) -> _Abscissa:
    numbers = [row for row in table.rows if isinstance(row, float)]
    if len(numbers) < len(table.rows):
        return _Abscissa({row: float(index) for index, row in enumerate(table.rows)}, True, False)
    return _Abscissa({row: row for row in sorted(numbers)}, False, log_worthy(numbers))


def _dress_abscissa(axes: "Axes", table: Table) -> None:
    abscissa = _abscissa(table)
    axes.set_xlabel(table.row_key, fontsize=9)
    if abscissa.logarithmic:
        axes.set_xscale("log")
    if abscissa.named:
        wrap = 40 // len(abscissa.places)
        words = [str(row).split() for row in abscissa.places]
        slanted: dict[str, Any] = {"rotation": 35, "ha": "right", "rotation_mode": "anchor"}
        fits = max(len(word) for row in words for word in row) <= wrap
        names = ["\n".join(textwrap.wrap(str(row), wrap)) if fits else str(row) for row in abscissa.places]
        if _key(table):
            names, fits = [str(number) for number, _ in enumerate(names, 1)], True
        axes.set_xticks(list(abscissa.places.values()), names, **({} if fits else slanted))
        axes.set_xlim(-0.5, len(names) - 0.5)


def _columns(table: Table) -> Iterator[tuple[list[float], list[Cell], dict[str, Any]]]:
    """Of every column: where its points stand, their cells, and its colour and marker."""
    abscissa = _abscissa(table)
    for index, column in enumerate(table.columns):
        rows = [row for row in abscissa.places if (row, column) in table.cells]
        style = {"color": COLORS[index % len(COLORS)], "marker": MARKERS[index % len(MARKERS)], "markersize": 4.5}
        x = [abscissa.of(row, index, len(table.columns)) for row in rows]
        yield x, [table.cells[row, column] for row in rows], style


def _metric_panel(axes: "Axes", table: Table, metric: Signal) -> None:
    if metric.truth:
        _share_panel(axes, table, metric)
        return
    dress(axes, "", with_unit(metric.name, metric.unit))
    named = _abscissa(table).named
    shown: list[float] = []
    for x, cells, style in _columns(table):
        stats = [one for cell in cells if isinstance(one := cell.statistics[metric.name], Statistic)]
        mean, median = [s.mean for s in stats], [s.median for s in stats]
        low, high = [s.p05 for s in stats], [s.p95 for s in stats]
        if named:
            axes.vlines(x, low, high, color=style["color"], alpha=0.3, linewidth=5)
            axes.plot(x, median, color=style["color"], linestyle="none", marker="_", markersize=9)
            axes.plot(x, mean, linestyle="none", **style)
        else:
            axes.fill_between(x, low, high, color=style["color"], alpha=0.14, lw=0)
            axes.plot(x, median, color=style["color"], linestyle=(0, (4, 2)), linewidth=1.2)
            axes.plot(x, mean, linewidth=1.5, **style)
        _paper(axes, x, [s.paper for s in stats], style)
        shown += [value for s in stats for value in (s.mean, s.median, s.p95) if np.isfinite(value)]
        shown += [s.paper for s in stats if s.paper is not None]
    positive = [value for value in shown if value > 0]
    if log_worthy(positive):
        axes.set_yscale("log")
        axes.set_ylim(0.4 * min(positive), 2.5 * max(positive))
    elif shown and min(shown) >= 0:
        axes.set_ylim(bottom=0)


def _paper(axes: "Axes", x: Sequence[float], values: Sequence[float | None], style: dict[str, Any]) -> None:
    """Published numbers as open markers."""
    known = [(place, value) for place, value in zip(x, values, strict=True) if value is not None]
    if not known:
        return
    axes.plot(
        [place for place, _ in known], [value for _, value in known], linestyle="none", marker=style["marker"],
        markersize=7, markerfacecolor="none", markeredgecolor=style["color"], markeredgewidth=1.3,
    )  # fmt: skip


def _share_panel(axes: "Axes", table: Table, metric: Signal) -> None:
    dress(axes, "", with_unit(metric.name, "%"))
    look = _BAR if _abscissa(table).named else {**_BAR, "linestyle": "-"}
    for x, cells, style in _columns(table):
        stats = [one for cell in cells if isinstance(one := cell.statistics[metric.name], Share)]
        share, low = np.array([100 * s.share for s in stats]), np.array([100 * s.low for s in stats])
        axes.errorbar(x, share, yerr=[share - low, np.zeros(len(stats))], **style, **look)
        _paper(axes, x, [None if s.paper is None else 100 * s.paper for s in stats], style)


def _difference_panel(axes: "Axes", table: Table, metric: Signal) -> None:
    unit, scale = ("points", 100) if metric.truth else (metric.unit, 1)
    dress(axes, "", with_unit(f"{metric.name} less that\nof {first_column(table)}", unit))
    axes.axhline(0, color="#606060", linewidth=0.8)
    counts: set[int] = set()
    for x, cells, style in _columns(table):
        known = [(place, gap) for place, cell in zip(x, cells, strict=True) if (gap := _gap(cell, metric))]
        ends = np.array([(gap.mean, gap.low, gap.high) for _, gap in known]).reshape(-1, 3) * scale
        bars = [ends[:, 0] - ends[:, 1], ends[:, 2] - ends[:, 0]]
        axes.errorbar([place for place, _ in known], ends[:, 0], yerr=bars, **style, **_BAR)
        counts |= {gap.count for _, gap in known}
    if counts:
        least, most = min(counts), max(counts)
        text = f"{least} pairs" if least == most else f"{least} to {most} pairs"
        axes.set_title(text, fontsize=8, loc="right")


def _gap(cell: Cell, metric: Signal) -> Difference | None:
    gap = cell.differences.get(metric.name)
    return gap if gap is not None and math.isfinite(gap.mean) else None


def _lost_panel(axes: "Axes", table: Table) -> None:
    dress(axes, "", "lost runs [%]")
    named = _abscissa(table).named
    for x, cells, style in _columns(table):
        y = [math.nan if cell.lost is None else 100 * cell.lost / cell.runs for cell in cells]
        axes.plot(x, y, linewidth=1.5, linestyle="none" if named else "-", **style)
    axes.set_ylim(0, max(1.0, axes.get_ylim()[1]))  # all zero: an axis of whole per cent, not of 0.05
    axes.set_title(f"lost: {table.lost_rule}", fontsize=8, loc="right")


def _legend(figure: "Figure", table: Table, across: int) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = []
    named = _abscissa(table).named
    point: dict[str, Any] = {"color": "#606060", "linestyle": "none" if named else "-", "markersize": 4.5}
    for index, column in enumerate(table.columns):
        style = {"color": COLORS[index % len(COLORS)], "marker": MARKERS[index % len(MARKERS)]}
        label = spoken(table.column_key, column) if table.column_key else "all runs"
        handles.append(Line2D([], [], **{**point, **style}, label=label))
    if not all(metric.truth for metric in table.metrics):
        dashed = {"marker": "_", "markersize": 9} if named else {"linestyle": (0, (4, 2))}
        handles += [
            Line2D([], [], **{**point, "marker": "o"}, label="mean"),
            Line2D([], [], **{**point, **dashed}, label="median"),
            Patch(color="#606060", alpha=0.2, linewidth=0, label="5th to 95th percentile"),
        ]
    upright = {**point, "linestyle": "none", "marker": "|", "markersize": 10}
    if any(metric.truth for metric in table.metrics):
        handles.append(Line2D([], [], **upright, label="down to the lower 95 % bound of a share"))
    if any(cell.differences for cell in table.cells.values()):
        handles.append(Line2D([], [], **upright, label="95 % interval of a difference"))
    if table.beside:
        hollow = {**point, "linestyle": "none", "marker": "o", "markersize": 7, "markerfacecolor": "none"}
        handles.append(Line2D([], [], **hollow, label="paper"))
    across = min(len(handles), across)
    figure.legend(handles=handles, loc="outside lower center", ncols=across, fontsize=8, frameon=False)
