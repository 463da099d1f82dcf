"""Which configurations share a cell, what the cells are called, and which runs are pairs."""

import dataclasses
import json
from typing import Any

import factory
import numpy as np
import pytest

from fzcli.record.sweep_record import SweepRecord
from fzcli.record.table import Table, build_table
from fzcli.record.table_text import render

KIND, RESTART, VARIANT = "controller.kind", "controller.restart", "controller.variant"


def sweep(configs: list[dict[str, Any]], runs: list[dict[str, Any]] | None = None, count: int = 20) -> SweepRecord:
    """A sweep of these configurations; ``runs``, their complete runs, stand in its specification."""
    record = factory.make_reaching_sweep(configs, (0.8,) * len(configs), count)
    if runs is None:
        return record
    text = json.dumps({"kind": "sweep", "configurations": [{"run": run} for run in runs]})
    return dataclasses.replace(record, provenance=dataclasses.replace(record.provenance, spec_text=text))


def table_of(record: SweepRecord, **section: Any) -> Table:
    return build_table(record, {"show": ["arrived", "restarts"], **section})


@pytest.mark.parametrize(
    ("values", "rows"),
    [
        ([False, True], ("false", "true")),
        ([None, 2], ("null", 2.0)),
        ([[0, 1], "90 deg"], ("[0, 1]", "90 deg")),
        ([{"kind": "dls", "damping": 1}, {"kind": "fabrik", "damping": 1}], ("dls", "fabrik")),
        ([None, {"patience": 3}], ("restart null", "patience 3")),
        ([{"patience": 3}, {"patience": 3}], ("{patience: 3}",)),
    ],
)
def test_values_of_any_kind_head_rows(values: list[Any], rows: tuple[Any, ...]) -> None:
    record = sweep([{RESTART: value} for value in values])
    assert table_of(record, rows=RESTART).rows == rows


def test_a_path_within_a_mapping_may_head_rows() -> None:
    record = sweep([{"controller": {"kind": "dls"}}, {"controller": {"kind": "fabrik"}}])
    assert table_of(record, rows=KIND).rows == ("dls", "fabrik")


def test_an_entry_that_is_not_set_has_the_value_of_the_complete_run() -> None:
    configs = [{RESTART: False}, {VARIANT: "n1"}]
    runs = [{"controller": {"restart": False, "variant": "n10"}}, {"controller": {"restart": True, "variant": "n1"}}]
    assert table_of(sweep(configs, runs), rows=RESTART).rows == ("false", "true")
    assert table_of(sweep(configs, runs), rows=VARIANT).rows == ("n10", "n1")
    assert table_of(sweep(configs), rows=RESTART).rows == ("false", "-")  # the specification does not say


def test_values_with_units_stand_in_si_beside_values_of_complete_runs() -> None:
    record = sweep([{"step": "20 ms"}, {}], [{"step": 0.02}, {"step": 0.01}])
    assert table_of(record, rows="step").rows == (0.02, 0.01)


def test_short_forms_stay_as_written_beside_complete_runs() -> None:
    """`true` stands for a whole mapping in the complete run; who does not set it may have the same."""
    whole = {"seeds": 16, "at_start": False}
    configs = [{}, {RESTART: True}, {RESTART: {"at_start": True}}, {VARIANT: "n1"}]
    runs = [{"controller": {"restart": one}} for one in (None, whole, {**whole, "at_start": True}, whole)]
    table = table_of(sweep(configs, runs), columns=RESTART, rows=VARIANT)
    assert table.columns == ("restart null", "restart true", "at_start true")
    assert [set(table.cells) & {(row, "restart true") for row in table.rows}] == [
        {("-", "restart true"), ("n1", "restart true")}
    ]


def test_an_entry_that_one_law_does_not_have_is_a_dash() -> None:
    runs = [{"controller": {"kind": "fabrik", "variant": "n1"}}, {"controller": {"kind": "dls"}}]
    record = sweep([{KIND: "fabrik", VARIANT: "n1"}, {KIND: "dls"}], runs)
    assert table_of(record, rows=VARIANT).rows == ("n1", "-")


def test_without_rows_each_configuration_has_its_own() -> None:
    record = sweep([{KIND: "fabrik", VARIANT: "n1"}, {KIND: "fabrik", VARIANT: "n10"}, {KIND: "dls"}])
    table = table_of(record)
    assert (table.row_key, table.rows, table.columns) == ("configuration", ("fabrik, n1", "fabrik, n10", "dls"), ("",))
    assert table_of(record, rows="configuration") == table


def test_a_sweep_of_one_configuration_has_a_table() -> None:
    table = table_of(sweep([{}]))
    assert table.rows == ("all runs",)
    assert table.cells["all runs", ""].runs == 20


def test_configurations_as_columns_are_compared_in_one_row() -> None:
    record = sweep([{KIND: "fabrik", VARIANT: "n10"}, {KIND: "dls", "controller.damping": 0.05}])
    table = table_of(record, columns="configuration")
    assert (table.rows, table.columns) == (("all runs",), ("fabrik, n10", "dls, damping 0.05"))
    assert table.cells["all runs", "dls, damping 0.05"].differences["arrived"].count == 20


def test_entries_that_go_along_with_the_columns_do_not_part_rows_or_pairs() -> None:
    """Two laws, each with settings of its own, with and without a restart: pairs all the same."""
    laws = [{KIND: "fabrik", VARIANT: "n10"}, {KIND: "dls", "controller.damping": 0.05}]
    record = sweep([{**law, RESTART: restart} for restart in (True, False) for law in laws])
    for rows in (RESTART, "configuration"):
        table = table_of(record, rows=rows, columns=KIND)
        assert len(table.rows) == 2
        assert table.notes == ()
        assert [table.cells[row, "dls"].differences["restarts"].count for row in table.rows] == [20, 20]


def test_pooled_configurations_are_paired_by_what_they_differ_in() -> None:
    record = sweep([{KIND: kind, "start.home": home} for kind in ("fabrik", "dls") for home in ("A", "B")])
    values = record.metrics["restarts"]
    values[:] = np.repeat([1.0, 2.0, 11.0, 32.0], 20)
    table = table_of(record, rows=KIND)
    assert table.notes == ("each cell pools 2 values of start.home: A, B",)
    table = table_of(record, columns=KIND, rows=KIND)
    assert table.cells["dls", "dls"].differences == {}
    table = build_table(record, {"rows": "controller.kind", "columns": "start.home", "show": ["restarts"]})
    assert table.cells["dls", "B"].differences["restarts"].mean == 21
    flat = dataclasses.replace(record, configs=[{**config, "all": 1} for config in record.configs])
    table = build_table(flat, {"rows": "all", "columns": KIND, "show": ["restarts"]})
    gap = table.cells[1.0, "dls"].differences["restarts"]
    assert (gap.count, gap.mean) == (40, 20.0)  # A with A, 10, and B with B, 30


def test_rows_are_paired_each_by_what_they_pool() -> None:
    """The first row pools two variants of one law, and has no pairs; the second pools nothing."""
    laws = [{KIND: "fabrik", VARIANT: "n1"}, {KIND: "fabrik", VARIANT: "n10"}, {KIND: "dls"}]
    record = sweep([*({**law, RESTART: False} for law in laws), *({**law, RESTART: True} for law in laws[1:])])
    table = table_of(record, rows=RESTART, columns=KIND)
    assert [table.cells[row, "dls"].differences["restarts"].count for row in ("false", "true")] == [0, 20]


def test_columns_without_common_runs_have_no_pairs() -> None:
    record = sweep([{KIND: "fabrik", VARIANT: "n1"}, {KIND: "fabrik", VARIANT: "n10"}, {KIND: "dls"}])
    runs = [{"controller": config} for config in ({"variant": "n1"}, {"variant": "n10"}, {})]
    record = dataclasses.replace(sweep(record.configs, runs), metrics=record.metrics)
    table = build_table(
        dataclasses.replace(record, configs=[{**config, "all": 1} for config in record.configs]),
        {"rows": "all", "columns": KIND, "show": ["arrived", "restarts"]},
    )
    cell = table.cells[1.0, "dls"]
    assert [cell.differences[name].count for name in ("arrived", "restarts")] == [0, 0]
    assert table.notes == ("some cells pool 2 values of controller.variant: n1, n10",)
    pairs = [line.split() for line in render(table).splitlines() if line.lstrip().startswith("pairs")]
    assert pairs == [["pairs", "0", "0"]]


def test_configurations_that_do_not_differ_are_told() -> None:
    runs = [{"controller": {"restart": True}}] * 2
    table = table_of(sweep([{RESTART: True}, {}], runs), rows=RESTART)
    assert table.rows == ("true",)
    assert table.notes == ("some cells pool configurations that do not differ",)
