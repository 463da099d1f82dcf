"""Configurations as short text."""

from typing import Any

import pytest

from fzcli.record.labels import labels, leaves, shown, spoken

KIND = "controller.kind"


def test_leaves_take_nested_mappings_apart() -> None:
    entries = {"controller": {"kind": "dls", "restart": {"patience": 3}}, "start.q": [0, 1], "scene": {}}
    assert leaves(entries) == {
        "controller.kind": "dls",
        "controller.restart.patience": 3,
        "start.q": [0, 1],
        "scene": {},
    }


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "null"),
        (True, "true"),
        (10, "10"),
        (10.0, "10"),
        (1e-8, "1e-08"),
        (0.1234567891, "0.1234567891"),
        ("30 deg", "30 deg"),
        ([0, -1.5, "90 deg"], "[0, -1.5, 90 deg]"),
        ({"average": 10, "window": None}, "{average: 10, window: null}"),
    ],
)
def test_values_are_shown_as_the_file_would_have_them(value: Any, text: str) -> None:
    assert shown(value) == text


def test_only_names_speak_for_themselves() -> None:
    assert spoken(KIND, "dls") == "dls"
    assert spoken("controller.restart", False) == "restart false"
    assert spoken("controller.restart", "false") == "restart false"  # a heading made of a truth value
    assert spoken("step", "10 ms") == "step 10 ms"
    assert spoken("controller.gain", 10.0) == "gain 10"


@pytest.mark.parametrize(
    ("entries", "expected"),
    [
        ([{}], ["all runs"]),
        ([{KIND: "dls"}, {KIND: "dls"}], ["all runs", "all runs"]),
        ([{KIND: "n1", "a.gain": 1}, {KIND: "n10", "a.gain": 1}], ["n1", "n10"]),
        ([{"controller": {"kind": "fabrik", "sweeps": 5}}, {KIND: "dls"}], ["fabrik, sweeps 5", "dls"]),
        ([{"a.restart": False}, {}], ["restart false", "unchanged"]),
        ([{"a.seed": None}, {"a.seed": {"root": 1}}], ["seed null", "root 1"]),
        ([{"a.kind": "dls"}, {"b.kind": "dls"}], ["a.kind dls", "b.kind dls"]),
        ([{"a.q": 1}, {"a.q": 1.0}, {"a.q": 1}], ["a.q 1", "a.q 1 (2)", "a.q 1"]),
    ],
)
def test_labels_tell_unlike_sets_apart(entries: list[dict[str, Any]], expected: list[str]) -> None:
    assert labels(entries) == expected


def test_a_set_that_changes_nothing_is_named_by_what_its_run_has() -> None:
    runs = [{"controller": {"restart": False, "gain": 1}}, {"controller": {"restart": True, "gain": 1}}]
    assert labels([{"controller.restart": False}, {}], lambda: runs) == ["restart false", "restart true"]
