"""Tables of a sweep against plain NumPy, and their text."""

import csv
import dataclasses
import io
import json
from pathlib import Path

import factory
import numpy as np
import pytest
from scipy import stats

from fzcli.errors import RecordError, UsageError
from fzcli.record.table import Table, build_table
from fzcli.record.table_lines import short
from fzcli.record.table_spec import LostRule, TableSpec
from fzcli.record.table_text import records, render

RUNS = Path(__file__).parents[2] / "runs"
RECORD = factory.make_sweep(200)
PLAIN = {key: value for key, value in factory.TABLE.items() if key != "beside"}


@pytest.fixture(scope="module")
def table() -> Table:
    return build_table(RECORD, TableSpec.of(factory.TABLE, (RUNS,)))


def chosen(kind: str, gain: float) -> np.ndarray:
    index = RECORD.configs.index({"controller.kind": kind, "controller.gain": gain})
    return RECORD.metrics["config"] == index


@pytest.mark.parametrize("kind", ["clik", "fuzzy_clik"])
@pytest.mark.parametrize("gain", [10.0, 500.0, 5000.0])
def test_statistics_are_those_of_numpy(table: Table, kind: str, gain: float) -> None:
    rows = chosen(kind, gain)
    cell = table.cells[gain, kind]
    assert cell.runs == 200
    assert cell.lost == np.sum(~(RECORD.metrics["tip_error_max"][rows] <= 1e-2))
    assert cell.failed == np.sum(RECORD.metrics["status"][rows] == 2)
    assert cell.flagged == np.sum(RECORD.metrics["status"][rows] == 1)
    for metric in table.metrics:
        values = RECORD.metrics[metric.name][rows]
        values = values[np.isfinite(values)]
        one = cell.statistics[metric.name]
        assert one.count == len(values)
        assert one.mean == values.mean()
        assert one.median == np.median(values)
        assert (one.p05, one.p95) == tuple(np.quantile(values, [0.05, 0.95]))


def test_failed_runs_are_counted_not_dropped(table: Table) -> None:
    cell = table.cells[5000.0, "clik"]
    assert cell.failed > 0
    assert cell.statistics["tip_error_mean"].count == cell.runs - cell.failed
    assert cell.lost is not None
    assert cell.lost >= cell.failed  # a run without a finite tip error counts as lost
    text = render(table)
    assert f"{cell.failed} failed" in text
    assert "finite in" in text


def test_the_papers_numbers_stand_beside(table: Table) -> None:
    assert table.cells[1000.0, "clik"].statistics["tip_error_mean"].paper == 0.0013
    assert table.cells[5000.0, "fuzzy_clik"].statistics["yaw_abs_mean"].paper == 0.001
    assert all(one.paper is not None for cell in table.cells.values() for one in cell.statistics.values())


def test_differences_are_paired_and_their_interval_is_scipys(table: Table) -> None:
    ours = RECORD.metrics["yaw_abs_mean"][chosen("fuzzy_clik", 500.0)]
    fixed = RECORD.metrics["yaw_abs_mean"][chosen("clik", 500.0)]
    gap = table.cells[500.0, "fuzzy_clik"].differences["yaw_abs_mean"]
    assert gap.count == 200
    assert gap.mean == pytest.approx((ours - fixed).mean(), rel=1e-12)
    expected = stats.bootstrap(
        (ours - fixed,),
        np.mean,
        n_resamples=20_000,
        method="percentile",
        random_state=np.random.default_rng(1),
    ).confidence_interval
    width = expected.high - expected.low
    assert gap.low == pytest.approx(expected.low, abs=0.1 * width)
    assert gap.high == pytest.approx(expected.high, abs=0.1 * width)
    failed = np.isnan(RECORD.metrics["tip_error_mean"][chosen("clik", 5000.0)]).sum()
    assert table.cells[5000.0, "fuzzy_clik"].differences["tip_error_mean"].count == 200 - failed
    assert table.cells[500.0, "clik"].differences == {}


def test_pairing_ignores_the_order_of_the_runs(table: Table) -> None:
    order = np.random.default_rng(3).permutation(len(RECORD.metrics["config"]))
    shuffled = dataclasses.replace(RECORD, metrics={name: v[order] for name, v in RECORD.metrics.items()})
    again = build_table(shuffled, PLAIN)
    for place, cell in again.cells.items():
        for name, gap in cell.differences.items():
            known = table.cells[place].differences[name]
            assert (gap.count, gap.low, gap.high) == (known.count, known.low, known.high)


def test_csv_reads_back_exactly(table: Table) -> None:
    rows = list(csv.DictReader(io.StringIO(render(table, "csv"))))
    expected = list(records(table))
    assert len(rows) == len(expected) > 300
    for row, known in zip(rows, expected, strict=True):
        assert float(row["controller.gain"]) == known["controller.gain"]
        assert row["controller.kind"] == known["controller.kind"]
        assert float(row["value"]) == known["value"]


def test_json_is_one_record_a_line(table: Table) -> None:
    text = render(table, "json")
    assert json.loads(text) == list(records(table))
    assert len(text.splitlines()) == len(json.loads(text)) + 2


def test_markdown_has_rows_of_equal_width(table: Table) -> None:
    text = render(table, "md")
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in lines} == {11}
    assert "**controller.kind = fuzzy_clik**" in text


@pytest.mark.parametrize("width", [100, 120])
def test_the_terminal_table_fits_and_cuts_nothing(table: Table, width: int) -> None:
    text = render(table, "rich", width)
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text
    lost = [f"{cell.lost} ({cell.lost / 2:.1f} %)" for cell in table.cells.values() if cell.lost is not None]
    assert len(lost) == 10
    assert all(one in text for one in lost)
    assert "lost: tip_error_max > 0.01" in text
    assert "\x1b" not in text
    assert "\x1b" in render(table, "rich", width, color=True)


def test_a_table_without_columns_lists_every_metric() -> None:
    half = [index for index, config in enumerate(RECORD.configs) if config["controller.kind"] == "clik"]
    rows = np.isin(RECORD.metrics["config"], half)
    record = dataclasses.replace(
        RECORD, configs=RECORD.configs[:5], metrics={name: v[rows] for name, v in RECORD.metrics.items()}
    )
    table = build_table(record, {"rows": "controller.gain"})
    assert "tip_error_max" in [metric.name for metric in table.metrics]
    assert "momentum_angular_max" not in [metric.name for metric in table.metrics]
    assert table.cells[10.0, ""].runs == 200
    text = render(table, width=100)
    assert "…" not in text
    assert text.count("median") == 2 * 5  # more metrics than fit side by side: two blocks of five rows


def test_pooling_over_a_third_entry_is_said() -> None:
    configs = [{**config, "step": 0.01 if index % 2 else 0.02} for index, config in enumerate(RECORD.configs)]
    table = build_table(dataclasses.replace(RECORD, configs=configs), {**PLAIN, "rows": "step"})
    assert table.notes == ("each cell pools 5 values of controller.gain: 10, 100, 500, 1000, 5000",)
    assert "Note: each cell pools 5 values of controller.gain" in render(table)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (
            {"rows": "controller.gian"},
            RecordError,
            "table: rows: controller.gian: the sweep does not vary it",
        ),
        ({"rows": "controller.gian"}, RecordError, "; did you mean 'controller.gain'?"),
        (
            {"show": ["tip_eror_mean"]},
            RecordError,
            "table: show: tip_eror_mean: the sweep has no such metric",
        ),
        ({"show": ["tip_eror_mean"]}, RecordError, "; did you mean 'tip_error_mean'?"),
        ({"lost": "tip_error > 1"}, RecordError, "table: lost: tip_error: the sweep has no such metric"),
        ({"lost": "tip_error_max == 1"}, UsageError, "table: lost: 'tip_error_max == 1' is not of the form"),
        ({"rows": ""}, UsageError, "table: rows: empty, name an entry of the grid or list"),
        ({"sort": "x"}, UsageError, "table: unknown entry 'sort'; it takes rows, columns"),
        ({"beside": "nowhere.csv"}, RecordError, "table: beside: nowhere.csv: no such file"),
    ],
)
def test_errors_name_the_part_and_the_nearest(change: dict, error: type[Exception], message: str) -> None:
    with pytest.raises(error) as caught:
        build_table(RECORD, {**PLAIN, **change})
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("gain,controller.kind,yaw_abs_mean\n10,clik,1\n", "no column controller.gain; did you mean"),
        ("controller.gain,controller.kind,yaw_abs_mean\n10,clik,x1\n", "entry 1: could not convert"),
        ("controller.gain,controller.kind,yaw_abs_mean\n10,clik,1,2\n", "entry 1: "),
    ],
)
def test_a_bad_file_of_published_numbers_is_refused(text: str, message: str) -> None:
    spec = dataclasses.replace(TableSpec.of(PLAIN), beside="p.csv", beside_text=text)
    with pytest.raises(RecordError) as caught:
        build_table(RECORD, spec)
    assert f"table: beside: p.csv: {message}" in str(caught.value)


def test_lost_rules() -> None:
    assert LostRule.parse(" x_max>=1e-2") == LostRule("x_max", ">=", 0.01)
    table = build_table(RECORD, {**PLAIN, "lost": "yaw_abs_max < 0.01"})
    rows = chosen("clik", 10.0)
    assert table.cells[10.0, "clik"].lost == np.sum(RECORD.metrics["yaw_abs_max"][rows] < 0.01)
    bare = {name: values for name, values in RECORD.metrics.items() if name != "tip_error_max"}
    table = build_table(dataclasses.replace(RECORD, metrics=bare), PLAIN)
    assert table.cells[10.0, "clik"].lost is None
    assert "lost" not in {record["statistic"] for record in records(table)}


def test_short_numbers() -> None:
    shown = [
        short(x)
        for x in (0.0, 2.5e-5, -7.6e-5, 0.0013, 0.544, 999.9, 1234.5, 1.5e9, float("nan"), float("inf"))
    ]
    assert shown == ["0", "2.5e-5", "-7.6e-5", "0.0013", "0.544", "1e+03", "1234", "1.5e+09", "-", "inf"]


def test_an_unknown_format_is_refused(table: Table) -> None:
    with pytest.raises(UsageError, match=r"table format 'xls': expected one of rich, csv, json, md"):
        render(table, "xls")
