"""Truth-valued metrics in tables: shares with bounds, paired differences, and their text."""

import dataclasses
import json
import math
from pathlib import Path

import factory
import numpy as np
import pytest

from fzcli.errors import RecordError
from fzcli.record.intervals import median_interval, paired_share_interval, share_bound
from fzcli.record.rollout_file import read_rollout, write_rollout
from fzcli.record.sweep_file import read_sweep, read_table_spec, write_sweep
from fzcli.record.sweep_record import SweepRecord
from fzcli.record.table import Table, build_table
from fzcli.record.table_cells import Share, Statistic, statistic_of
from fzcli.record.table_lines import percent, points
from fzcli.record.table_spec import TableSpec
from fzcli.record.table_text import records, render
from fzcli.spec.quantity import Signal

LAWS = [{"controller.kind": "fabrik"}, {"controller.kind": "dls"}]
SECTION = {"columns": "controller.kind", "show": ["arrived", "arrival_time"]}


def small() -> SweepRecord:
    """Eight targets: both laws reach four, each one more of its own, neither two."""
    arrived = np.array([1, 1, 1, 1, 1, 0, 0, 0, 1, 1, 1, 1, 0, 1, 0, 0], dtype=float)
    time = np.array([1, 2, 3, 4, 5, 0, 0, 0, 2, 4, 5, 5, 0, 9, 0, 0], dtype=float)
    record = factory.make_reaching_sweep(LAWS, (0.5, 0.5), 8)
    metrics = {**record.metrics, "arrived": arrived, "arrival_time": np.where(arrived == 1, time, np.nan)}
    return dataclasses.replace(record, metrics=metrics)


@pytest.fixture(scope="module")
def table() -> Table:
    return build_table(small(), SECTION)


def test_a_share_is_of_all_runs_with_its_exact_bound(table: Table) -> None:
    assert table.cells["all runs", "dls"].statistics["arrived"] == Share(8, 8, 5, 5 / 8, share_bound(5, 8))
    assert isinstance(table.cells["all runs", "dls"].statistics["arrival_time"], Statistic)


def test_differences_of_shares_are_paired(table: Table) -> None:
    gap = table.cells["all runs", "dls"].differences["arrived"]
    assert (gap.count, gap.mean, gap.more) == (8, 0.0, {"gained": 1, "lost": 1})
    assert (gap.low, gap.high) == paired_share_interval(1, 1, 8)


def test_differences_of_numbers_are_over_the_pairs_that_both_have_them(table: Table) -> None:
    gap = table.cells["all runs", "dls"].differences["arrival_time"]
    paired = np.array([1.0, 2.0, 2.0, 1.0])
    assert (gap.count, gap.mean) == (4, paired.mean())
    assert gap.more["median"] == np.median(paired)
    assert math.isnan(gap.more["median_low"])  # four pairs have no 95 % interval of the median
    record = factory.make_reaching_sweep(LAWS, (0.9, 0.8), 200)
    gap = build_table(record, SECTION).cells["all runs", "dls"].differences["arrival_time"]
    time = record.metrics["arrival_time"].reshape(2, 200)
    both = time[1] - time[0]
    both = both[np.isfinite(both)]
    assert gap.count == len(both) < 200
    assert (gap.more["median_low"], gap.more["median_high"]) == median_interval(both)


def test_runs_without_a_value_count_as_not_true() -> None:
    metric = Signal("arrived", "1", "reached", truth=True)
    values = np.array([1.0, np.nan, 1.0, 0.0])
    assert statistic_of(metric, values) == Share(3, 4, 2, 0.5, share_bound(2, 4))
    none = statistic_of(metric, np.full(3, np.nan))
    assert isinstance(none, Share)
    assert (none.count, none.true) == (0, 0)
    assert math.isnan(none.share)
    record = small()
    record.metrics["arrived"][9] = np.nan
    table = build_table(record, SECTION)
    gap = table.cells["all runs", "dls"].differences["arrived"]
    assert (gap.count, gap.more) == (8, {"gained": 1, "lost": 2})
    assert "A run without a value counts as not true." in render(table)
    record.metrics["arrived"][8:] = np.nan
    assert build_table(record, SECTION).cells["all runs", "dls"].differences["arrived"].count == 0


def test_a_truth_value_that_is_neither_is_refused() -> None:
    record = small()
    record.metrics["arrived"][3] = 0.5
    with pytest.raises(RecordError) as caught:
        build_table(record, SECTION)
    assert str(caught.value) == "arrived: is declared true or false (1 or 0), but a run has 0.5"


def test_nothing_is_guessed_from_the_values() -> None:
    plain = dataclasses.replace(small(), metric_info={})
    assert isinstance(build_table(plain, SECTION).cells["all runs", "dls"].statistics["arrived"], Statistic)


def test_files_know_truth_values(tmp_path: Path) -> None:
    record = small()
    write_sweep(record, tmp_path / "s.h5", table=TableSpec.of(SECTION))
    again = read_sweep(tmp_path / "s.h5")
    assert again.metric_info == record.metric_info
    assert [name for name, one in again.metric_info.items() if one.truth] == ["arrived"]
    spec = read_table_spec(tmp_path / "s.h5")
    assert spec is not None
    assert render(build_table(again, spec)) == render(build_table(record, SECTION))
    held = Signal("held", "1", "whether the target is held", truth=True)
    run = factory.make_rollout()
    run = dataclasses.replace(
        run,
        signals={**run.signals, "held": np.ones(len(run.time))},
        signal_info={**run.signal_info, "held": held},
        metrics={"arrived": 1.0},
        metric_info={"arrived": factory.REACHED["arrived"]},
    )
    write_rollout(run, tmp_path / "r.h5")
    back = read_rollout(tmp_path / "r.h5")
    assert back.signal_info["held"] == held
    assert back.signal_info["tip_error"] == run.signal_info["tip_error"]
    assert back.metric_info["arrived"].truth


@pytest.mark.parametrize(
    ("share", "count", "text"),
    [(0.982, 500, "98.2 %"), (1.0, 500, "100.0 %"), (0.9999, 10_000, "99.99 %"), (0.5, 2, "50.0 %"), (0.0, 1, "0.0 %")],
)
def test_shares_have_the_decimals_of_one_run(share: float, count: int, text: str) -> None:
    assert percent(share, count) == text


def test_bounds_are_rounded_outwards() -> None:
    assert percent(0.96699, 500, math.floor) == "96.6 %"
    assert percent(0.967, 500, math.floor) == "96.7 %"
    assert points(-0.01234, 500, math.floor) == "-1.3 pp"
    assert points(0.01234, 500, math.ceil) == "+1.3 pp"
    assert points(0.0, 500) == "0.0 pp"
    assert points(-0.0001, 500) == "0.0 pp"
    assert percent(math.nan, 1) == points(math.nan, 0) == "-"


TEXT = """\
controller.kind = fabrik

                                        arrival time
  configuration               arrived            [s]
 ────────────────────────────────────────────────────
  all runs        share        62.5 %
  8 runs          at least     28.9 %
                  mean                             3
                  median                           3
                  95th pct                       4.8
                  finite in         8              5

controller.kind = dls

                                         arrival time
  configuration                arrived            [s]
 ─────────────────────────────────────────────────────
  all runs        share         62.5 %
  8 runs          at least      28.9 %
                  mean                              5
                  median                            5
                  95th pct                        8.2
                  finite in          8              5
                  - fabrik      0.0 pp            1.5
                    from      -40.1 pp              1
                    to        +40.1 pp              2
                    pairs            8              4

share: of runs for which it is true; at least: its one-sided lower 95 % bound (Clopper-Pearson).
- fabrik: mean difference from fabrik over the pairs: same trajectory, both finite; 95 % bootstrap interval.
- fabrik, of shares: percentage points (pp) over all pairs; 95 % score interval for pairs (Tango).
"""


def test_the_text_of_shares(table: Table) -> None:
    assert render(table) == TEXT
    assert share_bound(5, 8) == pytest.approx(0.289, abs=1e-3)
    assert paired_share_interval(1, 1, 8) == pytest.approx((-0.40004, 0.40004), abs=1e-5)


def test_markdown_of_shares(table: Table) -> None:
    text = render(build_table(small(), {**SECTION, "show": ["arrived"]}), "md")
    assert text == (
        "**controller.kind = fabrik**\n\n"
        "| configuration |  | arrived | runs | flagged | failed |\n"
        "| ---: | :--- | ---: | ---: | ---: | ---: |\n"
        "| all runs | share | 62.5 % | 8 | 0 | 0 |\n"
        "|  | at least | 28.9 % |  |  |  |\n\n"
        "**controller.kind = dls**\n\n"
        "| configuration |  | arrived | runs | flagged | failed |\n"
        "| ---: | :--- | ---: | ---: | ---: | ---: |\n"
        "| all runs | share | 62.5 % | 8 | 0 | 0 |\n"
        "|  | at least | 28.9 % |  |  |  |\n"
        "|  | - fabrik | 0.0 pp |  |  |  |\n"
        "|  | from | -40.1 pp |  |  |  |\n"
        "|  | to | +40.1 pp |  |  |  |\n"
        "|  | pairs | 8 |  |  |  |\n\n"
        "share: of runs for which it is true; at least: its one-sided lower 95 % bound (Clopper-Pearson).  \n"
        "- fabrik, of shares: percentage points (pp) over all pairs; 95 % score interval for pairs (Tango).\n"
    )


def test_exports_have_shares_as_fractions(table: Table) -> None:
    rows = [row for row in records(table) if row["controller.kind"] == "dls" and row["metric"] == "arrived"]
    low, high = paired_share_interval(1, 1, 8)
    assert {row["statistic"]: row["value"] for row in rows} == {
        "share": 0.625,
        "share_low": share_bound(5, 8),
        "true": 5,
        "count": 8,
        "difference": 0.0,
        "difference_low": low,
        "difference_high": high,
        "difference_gained": 1,
        "difference_lost": 1,
        "difference_count": 8,
    }
    assert {row["unit"] for row in rows} == {"1"}
    assert json.loads(render(table, "json"))[0]["configuration"] == "all runs"
    assert render(table, "csv").splitlines()[0] == "configuration,controller.kind,metric,unit,statistic,value"


def test_all_runs_true_is_no_certainty() -> None:
    record = small()
    record.metrics["arrived"][:] = 1.0
    cell = build_table(record, SECTION).cells["all runs", "dls"]
    one, gap = cell.statistics["arrived"], cell.differences["arrived"]
    assert isinstance(one, Share)
    assert (one.share, one.low) == (1.0, pytest.approx(0.05 ** (1 / 8)))
    assert gap.low < gap.mean == 0 < gap.high


@pytest.mark.parametrize("width", [80, 110])
def test_tables_of_shares_fit_the_terminal(width: int) -> None:
    configs = [
        {"controller.kind": kind, "controller.restart": restart}
        for kind in ("fabrik_with_a_long_name", "dls")
        for restart in (True, False)
    ]
    record = factory.make_reaching_sweep(configs, (0.9, 0.8, 0.9, 0.7))
    for section in ({}, {"columns": "configuration"}, {"columns": "controller.kind", "rows": "controller.restart"}):
        text = render(build_table(record, section), "rich", width)
        assert "…" not in text
        assert max(map(len, text.splitlines())) <= width
