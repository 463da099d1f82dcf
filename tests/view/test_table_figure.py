"""The figure of a table: what its panels show for shares, differences and rows that are no numbers."""

from typing import Any

import factory
import numpy as np
import pytest

from fzcli.record.table import Table, build_table
from fzcli.record.table_cells import Share
from fzcli.view.table_plot import table_figure

KIND, RESTART = "controller.kind", "controller.restart"
CONFIGS = [{KIND: kind, RESTART: restart} for kind in ("fabrik", "dls") for restart in (True, False)]
RECORD = factory.make_reaching_sweep(CONFIGS, (0.9, 0.8, 0.9, 0.7), 200)


def table_of(**section: Any) -> Table:
    return build_table(RECORD, {"show": ["arrived", "arrival_time"], **section})


def ends_of_bars(axes: Any) -> list[list[float]]:
    """Lower and upper end of every upright error bar, in the order drawn."""
    return [[float(y) for y in path[:, 1]] for bars in axes.collections for path in bars.get_segments() if len(path)]


def test_panels_are_metrics_then_differences() -> None:
    figure = table_figure(table_of(rows=RESTART, columns=KIND))
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "arrived [%]",
        "arrival time [s]",
        "arrived less that\nof fabrik [points]",
        "arrival time less that\nof fabrik [s]",
    ]
    assert {axes.get_xlabel() for axes in figure.axes} == {RESTART}
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == [
        "fabrik",
        "dls",
        "mean",
        "median",
        "5th to 95th percentile",
        "down to the lower 95 % bound of a share",
        "95 % interval of a difference",
    ]


def test_bars_are_the_bounds() -> None:
    table = table_of(rows=RESTART, columns=KIND)
    arrived, _, shares, times = table_figure(table).axes
    expected = []
    for kind in ("fabrik", "dls"):
        for restart in ("true", "false"):
            one = table.cells[restart, kind].statistics["arrived"]
            assert isinstance(one, Share)
            expected.append([100 * one.low, 100 * one.share])
    np.testing.assert_allclose(ends_of_bars(arrived), expected)
    for axes, name, scale in ((shares, "arrived", 100), (times, "arrival_time", 1)):
        gaps = [table.cells[restart, "dls"].differences[name] for restart in ("true", "false")]
        np.testing.assert_allclose(ends_of_bars(axes), [[scale * gap.low, scale * gap.high] for gap in gaps])
    assert shares.get_title(loc="right") == "200 pairs"
    counts = [table.cells[restart, "dls"].differences["arrival_time"].count for restart in ("true", "false")]
    assert times.get_title(loc="right") == f"{min(counts)} to {max(counts)} pairs"


def test_rows_that_are_no_numbers_are_not_joined() -> None:
    figure = table_figure(table_of(rows=RESTART, columns=KIND))
    for axes in figure.axes:
        lines = [line for line in axes.lines if len(line.get_xdata()) > 1 and line.get_color() != "#606060"]
        assert {line.get_linestyle() for line in lines} == {"None"}
        assert [text.get_text() for text in axes.get_xticklabels()] == ["true", "false"]
    fabrik, dls = (line for line in figure.axes[0].lines if line.get_marker() in ("o", "s"))
    assert (np.asarray(fabrik.get_xdata()) < np.asarray(dls.get_xdata())).all()  # side by side


def test_rows_of_numbers_are_joined() -> None:
    configs = [{KIND: kind, "controller.gain": gain} for kind in ("fabrik", "dls") for gain in (1.0, 2.0)]
    record = factory.make_reaching_sweep(configs, (0.9, 0.8, 0.9, 0.7), 100)
    table = build_table(record, {"rows": "controller.gain", "columns": KIND, "show": ["arrived", "restarts"]})
    arrived, restarts, *_ = table_figure(table).axes
    assert arrived.lines[0].get_linestyle() == "-"
    assert [line.get_linestyle() for line in restarts.lines[:2]] == ["--", "-"]


@pytest.mark.parametrize("section", [{}, {"columns": "configuration"}, {"show": ["arrived"]}])
def test_configurations_are_named(section: dict[str, Any]) -> None:
    figure = table_figure(table_of(**section))
    ticks = [text.get_text().replace("\n", " ") for text in figure.axes[0].get_xticklabels()]
    names = ["fabrik, restart true", "fabrik, restart false", "dls, restart true", "dls, restart false"]
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    if "columns" in section:
        assert (ticks, legend[:4]) == (["all runs"], names)
    else:
        assert (ticks, legend[0]) == (names, "all runs")


def test_long_names_of_many_rows_are_slanted_not_broken() -> None:
    names = [f"law_of_a_long_name_{index}" for index in range(8)]
    record = factory.make_reaching_sweep([{KIND: name} for name in names], (0.8,) * 8, 50)
    axes = table_figure(build_table(record, {"rows": KIND, "show": ["arrived"]})).axes[0]
    assert [text.get_text() for text in axes.get_xticklabels()] == names
    assert {text.get_rotation() for text in axes.get_xticklabels()} == {35}
