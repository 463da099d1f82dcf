"""Quantities: SI numbers, text with units, and the checks of their dimensions."""

import contextlib
import math
from typing import Annotated, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field, TypeAdapter, ValidationError

from fzcli.spec import units
from fzcli.spec.units import quantity


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("30 deg", "angle", math.pi / 6),
        ("30deg", "angle", math.pi / 6),
        ("-1.5 rad", "angle", -1.5),
        ("180 deg/s", "angular speed", math.pi),
        ("10 rpm", "angular speed", math.pi / 3),
        ("10 ms", "duration", 0.01),
        ("2 min", "duration", 120.0),
        ("0.5 m", "length", 0.5),
        ("100 mm", "length", 0.1),
        ("1e2 mm", "length", 0.1),
        ("16 kg", "mass", 16.0),
        ("2 N m s", "angular momentum", 2.0),
        ("2 kg m2/s", "angular momentum", 2.0),
        ("2 N*m*s", "angular momentum", 2.0),
        ("3 N s", "momentum", 3.0),
        ("3 kg m/s", "momentum", 3.0),
        ("0.576 kg m^2", "moment of inertia", 0.576),
        ("0.576 kg*m**2", "moment of inertia", 0.576),
        ("5760 kg cm2", "moment of inertia", 0.576),
        ("3.2 1/s", "frequency", 3.2),
        ("5 Hz", "frequency", 5.0),
        ("90 deg/s2", "angular acceleration", math.pi / 2),
        ("4 N m", "torque", 4.0),
        ("4 J", "torque", 4.0),
        ("5 mN", "force", 0.005),
    ],
)
def test_text_with_a_unit_becomes_si(text: str, dimension: str, value: float) -> None:
    assert quantity(text, dimension) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("value", "wanted", "message"),
    [
        ("10 kg", ["duration"], "'10 kg' is a mass; a duration is wanted, e.g. '10 ms'"),
        (
            "10 ms",
            ["angle", "length"],
            "'10 ms' is a duration; an angle or a length is wanted, e.g. '30 deg' or '100 mm'",
        ),
        ("1 m3", ["length"], "'1 m3' has another dimension; a length is wanted, e.g. '100 mm'"),
        ("30 degs", ["angle"], "unknown unit 'degs' in '30 degs'; did you mean 'deg'?"),
        ("30 °", ["angle"], "cannot read the unit in '30 °'; write it like 'kg m2', 'deg/s' or '1/s'"),
        ("1 m/s/s", ["speed"], "cannot read the unit in '1 m/s/s'; write it like 'kg m2', 'deg/s' or '1/s'"),
        ("1 kg/m s", ["mass"], "cannot read the unit in '1 kg/m s'; write it like 'kg m2', 'deg/s' or '1/s'"),
        ("30", ["angle"], "'30' is text without a unit; write the number without quotes (rad)"),
        ("fast", ["speed"], "must be a speed: a number in m/s, or '50 mm/s', got 'fast'"),
        ("", ["mass"], "must be a mass: a number in kg, or '16 kg', got ''"),
        (True, ["mass"], "must be a mass: a number in kg, or '16 kg', got true"),
        (None, ["mass"], "must be a mass: a number in kg, or '16 kg', got nothing"),
        ([1], ["mass"], "must be a mass: a number in kg, or '16 kg', got [1]"),
        (math.nan, ["mass"], "must be a finite number, got nan"),
        (math.inf, ["mass"], "must be a finite number, got inf"),
        (10**400, ["mass"], None),
        ("1e999 kg", ["mass"], "must be a finite number, got '1e999 kg'"),
        ("3 m", ["plain number"], "'3 m' is a length; a plain number is wanted, e.g. '0.5'"),
        ("abc", ["plain number"], "must be a plain number, got 'abc'"),
    ],
)
def test_what_is_no_such_quantity_is_refused(value: Any, wanted: list[str], message: str | None) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011 -- the text is compared below
        quantity(value, *wanted)
    if message is not None:
        assert str(caught.value) == message


@given(st.floats(-1e100, 1e100), st.sampled_from(["m", "kg", "s", "rad"]))
def test_si_text_is_exact(number: float, unit: str) -> None:
    dimension = {"m": "length", "kg": "mass", "s": "duration", "rad": "angle"}[unit]
    assert quantity(f"{number!r} {unit}", dimension) == number
    assert quantity(number, dimension) == number


@given(st.text(max_size=80))
def test_any_text_is_a_number_or_a_value_error(text: str) -> None:
    with contextlib.suppress(ValueError):  # anything else would be a crash
        assert math.isfinite(quantity(text, "length"))


def test_bounds_hold_after_conversion() -> None:
    step = TypeAdapter(Annotated[units.Duration, Field(gt=0, le=1)])
    assert step.validate_python("10 ms") == 0.01
    for bad in ("0 s", "2 s", -1):
        with pytest.raises(ValidationError):
            step.validate_python(bad)


def test_the_json_schema_takes_numbers_and_text_and_names_the_unit() -> None:
    schema = TypeAdapter(units.AngularSpeed).json_schema()
    assert [item["type"] for item in schema["anyOf"]] == ["number", "string"]
    assert schema["description"] == "[rad/s] a number, or text with a unit such as '180 deg/s'"


def test_every_type_takes_its_own_example() -> None:
    for name in (
        "Angle",
        "Length",
        "Duration",
        "Mass",
        "InertiaMoment",
        "Speed",
        "AngularSpeed",
        "JointValue",
        "JointSpeed",
        "Frequency",
        "Momentum",
        "AngularMomentum",
        "Force",
        "Torque",
    ):
        annotated = getattr(units, name)
        for dimension in annotated.__metadata__[0].dimensions:
            assert isinstance(TypeAdapter(annotated).validate_python(dimension.example), float)
