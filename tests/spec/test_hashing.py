"""The identity of a spec."""

import hashlib
import math
from pathlib import Path

import pytest

from fzcli.spec.hashing import spec_hash
from fzcli.spec.load import load_robot


def test_the_order_of_keys_does_not_count_and_every_bit_does() -> None:
    one = spec_hash({"a": 0.1, "b": [1, {"c": "x", "d": None}]})
    assert one == spec_hash({"b": (1, {"d": None, "c": "x"}), "a": 0.1})
    assert one != spec_hash({"a": math.nextafter(0.1, 1), "b": [1, {"c": "x", "d": None}]})
    assert one != spec_hash({"a": 0.1, "b": [{"c": "x", "d": None}, 1]})
    assert spec_hash(-0.0) != spec_hash(0.0)
    assert len(one) == 64


def test_models_and_paths_are_taken() -> None:
    robot = load_robot("planar3")
    assert spec_hash(robot) == spec_hash(robot.model_dump()) == spec_hash({**robot.model_dump()})
    assert spec_hash(robot) != spec_hash(robot.model_copy(update={"name": "other"}))
    assert spec_hash(Path("a/b")) == spec_hash("a/b")


def test_the_value_is_stable() -> None:
    canonical = rb'{"a":"\u00e9","b":1e-08}'
    assert spec_hash({"b": 1e-8, "a": "é"}) == hashlib.sha256(canonical).hexdigest()


def test_what_has_no_canonical_form_is_refused() -> None:
    with pytest.raises(ValueError, match="Out of range float"):
        spec_hash({"a": math.nan})
    with pytest.raises(TypeError, match="cannot hash a set"):
        spec_hash({"a": {1}})
