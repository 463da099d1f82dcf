"""--set: what the options change, and what they leave alone."""

from typing import Any

import pytest

from fzcli.errors import SpecError
from fzcli.spec.reader import read_text
from fzcli.spec.sets import apply_sets

TEXT = """
controller: {kind: clik, gain: 10}
links:
- {name: a, mass: 1}
- {name: b, mass: 2}
grid: {controller.kind: [clik]}
empty:
"""


def applied(*options: str) -> Any:
    return apply_sets(read_text(TEXT), options).value


def test_values_are_yaml() -> None:
    assert applied("controller.gain=1e-3")["controller"]["gain"] == 0.001
    assert applied("controller.gain=30 deg")["controller"]["gain"] == "30 deg"
    assert applied("controller.kind=OFF")["controller"]["kind"] == "OFF"
    assert applied("controller.gain=[1, 2]")["controller"]["gain"] == [1, 2]
    assert applied("controller={kind: x}")["controller"] == {"kind": "x"}
    assert applied("controller.kind=a=b")["controller"]["kind"] == "a=b"


def test_list_items_by_number_and_by_name() -> None:
    assert applied("links.0.mass=5")["links"][0] == {"name": "a", "mass": 5}
    assert applied("links.b.mass=5")["links"][1] == {"name": "b", "mass": 5}
    with pytest.raises(SpecError, match="no item 'bb' among 2, numbered from 0 to 1; did you mean 'b'"):
        applied("links.bb.mass=5")


def test_keys_that_do_not_exist_are_made() -> None:
    assert applied("controller.task=pose")["controller"]["task"] == "pose"
    assert applied("reference.law=3-4-5")["reference"] == {"law": "3-4-5"}
    assert applied("empty.key=1")["empty"] == {"key": 1}


def test_dotted_keys_are_found_and_joined_by_new_ones() -> None:
    assert applied("grid.controller.kind=[fuzzy]")["grid"] == {"controller.kind": ["fuzzy"]}
    assert applied("grid.controller.gain=[1]")["grid"]["controller.gain"] == [1]


def test_later_options_win_and_the_document_stays() -> None:
    document = read_text(TEXT)
    assert apply_sets(document, ["controller.gain=1", "controller.gain=2"]).value["controller"]["gain"] == 2
    assert document.value["controller"]["gain"] == 10
