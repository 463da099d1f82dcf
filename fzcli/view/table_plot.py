"""A table of a sweep as a figure: each metric against the rows, a line a column."""

from typing import TYPE_CHECKING

import numpy as np

from fzcli.record.table import Statistic, Table, Value
from fzcli.view.style import COLORS, MARKERS, dress, log_worthy, new_figure, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def table_figure(table: Table, title: str = "") -> "Figure":
    """A panel a metric and one of lost runs: mean (filled), median (dashed), 5-95 % (band), paper (open)."""
    panels = len(table.metrics) + (1 if table.lost_rule else 0)
    across = min(3, panels)
    down = -(-panels // across)
    figure = new_figure(3.6 * across + 0.4, 3.0 * down + 0.9)
    all_axes = np.atleast_1d(figure.subplots(down, across, squeeze=False)).ravel()
    for axes, metric in zip(all_axes, table.metrics, strict=False):
        _metric_panel(axes, table, metric.name)
        dress(axes, table.row_key, with_unit(metric.name, metric.unit))
    if table.lost_rule:
        _lost_panel(all_axes[panels - 1], table)
    for axes in all_axes[panels:]:
        axes.remove()
    _legend(figure, table)
    figure.suptitle(title, fontsize=10)
    return figure


def _positions(table: Table) -> tuple[dict[Value, float], bool]:
    """Where each row stands on the abscissa, and whether that is a logarithmic axis."""
    numbers = [row for row in table.rows if isinstance(row, float)]
    if len(numbers) < len(table.rows):
        return {row: float(index) for index, row in enumerate(table.rows)}, False
    return {row: row for row in sorted(numbers)}, log_worthy(numbers)


def _abscissa(axes: "Axes", table: Table) -> None:
    positions, logarithmic = _positions(table)
    if logarithmic:
        axes.set_xscale("log")
    elif any(isinstance(row, str) for row in table.rows):
        axes.set_xticks(list(positions.values()), [str(row) for row in positions])


def _metric_panel(axes: "Axes", table: Table, metric: str) -> None:
    positions, _ = _positions(table)
    shown: list[float] = []
    for index, column in enumerate(table.columns):
        stats: list[tuple[float, Statistic]] = [
            (place, table.cells[row, column].statistics[metric])
            for row, place in positions.items()
            if (row, column) in table.cells
        ]
        x = [place for place, _ in stats]
        color, marker = COLORS[index % len(COLORS)], MARKERS[index % len(MARKERS)]
        axes.fill_between(
            x, [s.p05 for _, s in stats], [s.p95 for _, s in stats], color=color, alpha=0.14, lw=0
        )
        axes.plot(x, [s.median for _, s in stats], color=color, linestyle=(0, (4, 2)), linewidth=1.2)
        axes.plot(x, [s.mean for _, s in stats], color=color, marker=marker, markersize=4.5, linewidth=1.5)
        paper = [(place, s.paper) for place, s in stats if s.paper is not None]
        axes.plot(
            *([list(side) for side in zip(*paper, strict=True)] or [[], []]),
            linestyle="none", marker=marker, markersize=7, markerfacecolor="none", markeredgecolor=color,
            markeredgewidth=1.3,
        )  # fmt: skip
        shown += [value for _, s in stats for value in (s.mean, s.median, s.p95) if np.isfinite(value)]
        shown += [value for _, value in paper]
    _abscissa(axes, table)
    positive = [value for value in shown if value > 0]
    if log_worthy(positive):
        axes.set_yscale("log")
        axes.set_ylim(0.4 * min(positive), 2.5 * max(positive))
    elif shown and min(shown) >= 0:
        axes.set_ylim(bottom=0)


def _lost_panel(axes: "Axes", table: Table) -> None:
    positions, _ = _positions(table)
    for index, column in enumerate(table.columns):
        cells = [(place, table.cells.get((row, column))) for row, place in positions.items()]
        points = [
            (place, 100 * cell.lost / cell.runs) for place, cell in cells if cell and cell.lost is not None
        ]
        color, marker = COLORS[index % len(COLORS)], MARKERS[index % len(MARKERS)]
        x, y = [place for place, _ in points], [share for _, share in points]
        axes.plot(x, y, color=color, marker=marker, markersize=4.5, linewidth=1.5)
    _abscissa(axes, table)
    axes.set_ylim(0, max(1.0, axes.get_ylim()[1]))  # all zero: an axis of whole per cent, not of 0.05
    dress(axes, table.row_key, "lost runs [%]")
    axes.set_title(f"lost: {table.lost_rule}", fontsize=8, loc="right")


def _legend(figure: "Figure", table: Table) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = []
    for index, column in enumerate(table.columns):
        color, marker = COLORS[index % len(COLORS)], MARKERS[index % len(MARKERS)]
        label = f"{column:g}" if isinstance(column, float) else column or "all runs"
        handles.append(Line2D([], [], color=color, marker=marker, markersize=4.5, label=label))
    grey = "#606060"
    handles += [
        Line2D([], [], color=grey, marker="o", markersize=4.5, label="mean"),
        Line2D([], [], color=grey, linestyle=(0, (4, 2)), label="median"),
        Patch(color=grey, alpha=0.2, linewidth=0, label="5th to 95th percentile"),
    ]
    if table.beside:
        hollow = Line2D(
            [], [], color=grey, linestyle="none", marker="o", markersize=7, markerfacecolor="none"
        )
        hollow.set_label("paper")
        handles.append(hollow)
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=8, frameon=False)
