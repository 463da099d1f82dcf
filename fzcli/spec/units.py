"""Numbers with units: SI numbers as they are, text such as '30 deg' converted and dimension-checked.

class Run(SpecModel):
    step: Annotated[Duration, Field(gt=0)]      # 0.01 or "10 ms"
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from numbers import Real
from typing import Annotated, Any, get_args

from pydantic import BaseModel, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from fzcli.spec.nearest import hint, shown

Exponents = tuple[int, int, int, int]  # of m, kg, s, rad

_UNITS: dict[str, tuple[float, Exponents]] = {
    "m": (1.0, (1, 0, 0, 0)),
    "km": (1e3, (1, 0, 0, 0)),
    "cm": (1e-2, (1, 0, 0, 0)),
    "mm": (1e-3, (1, 0, 0, 0)),
    "um": (1e-6, (1, 0, 0, 0)),
    "kg": (1.0, (0, 1, 0, 0)),
    "g": (1e-3, (0, 1, 0, 0)),
    "t": (1e3, (0, 1, 0, 0)),
    "s": (1.0, (0, 0, 1, 0)),
    "ms": (1e-3, (0, 0, 1, 0)),
    "us": (1e-6, (0, 0, 1, 0)),
    "min": (60.0, (0, 0, 1, 0)),
    "h": (3600.0, (0, 0, 1, 0)),
    "rad": (1.0, (0, 0, 0, 1)),
    "mrad": (1e-3, (0, 0, 0, 1)),
    "deg": (math.pi / 180, (0, 0, 0, 1)),
    "rev": (2 * math.pi, (0, 0, 0, 1)),
    "rpm": (2 * math.pi / 60, (0, 0, -1, 1)),
    "Hz": (1.0, (0, 0, -1, 0)),
    "N": (1.0, (1, 1, -2, 0)),
    "mN": (1e-3, (1, 1, -2, 0)),
    "J": (1.0, (2, 1, -2, 0)),
    "W": (1.0, (2, 1, -3, 0)),
}
_NUMBER = re.compile(r"\s*([-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?)\s*(.*?)\s*", re.DOTALL)
_FACTOR = re.compile(r"([A-Za-z]+)(?:\^|\*\*)?([0-9])?")
_TEXT = 60  # longest text that is looked at as a quantity


@dataclass(frozen=True)
class Dimension:
    """A kind of quantity: its name with article, SI unit, an example, and exponents of m, kg, s, rad."""

    name: str
    unit: str
    example: str
    exponents: Exponents


_DIMENSIONS = (
    Dimension("an angle", "rad", "30 deg", (0, 0, 0, 1)),
    Dimension("a length", "m", "100 mm", (1, 0, 0, 0)),
    Dimension("a duration", "s", "10 ms", (0, 0, 1, 0)),
    Dimension("a mass", "kg", "16 kg", (0, 1, 0, 0)),
    Dimension("a moment of inertia", "kg m2", "0.5 kg m2", (2, 1, 0, 0)),
    Dimension("a speed", "m/s", "50 mm/s", (1, 0, -1, 0)),
    Dimension("an angular speed", "rad/s", "180 deg/s", (0, 0, -1, 1)),
    Dimension("an acceleration", "m/s2", "0.1 m/s2", (1, 0, -2, 0)),
    Dimension("an angular acceleration", "rad/s2", "90 deg/s2", (0, 0, -2, 1)),
    Dimension("a frequency", "1/s", "5 Hz", (0, 0, -1, 0)),
    Dimension("a momentum", "kg m/s", "2 N s", (1, 1, -1, 0)),
    Dimension("an angular momentum", "kg m2/s", "2 N m s", (2, 1, -1, 0)),
    Dimension("a force", "N", "5 N", (1, 1, -2, 0)),
    Dimension("a torque", "N m", "2 N m", (2, 1, -2, 0)),
    Dimension("a rotational damping", "N m s/rad", "0.5 N m s/rad", (2, 1, -1, -1)),
    Dimension("a damping", "N s/m", "20 N s/m", (0, 1, -1, 0)),
    Dimension("a plain number", "1", "0.5", (0, 0, 0, 0)),
)
_BY_NAME = {dimension.name.partition(" ")[2]: dimension for dimension in _DIMENSIONS}
_BY_EXPONENTS = {dimension.exponents: dimension for dimension in reversed(_DIMENSIONS)}


@lru_cache(maxsize=1024)
def _unit(unit: str, text: str) -> tuple[float, Exponents]:
    """Factor to SI and exponents of a unit such as ``kg m2``, ``deg/s`` or ``1/s``."""
    top, slash, bottom = unit.partition("/")
    above = re.split(r"[\s*·]+", top.replace("**", "^").strip())
    factors = [(part, 1) for part in above if part not in ("", "1")]
    if slash:
        factors.append((bottom.strip(), -1))
    scale, total = 1.0, [0, 0, 0, 0]
    for part, sign in factors:
        match = _FACTOR.fullmatch(part)
        if match is None:
            raise ValueError(f"cannot read the unit in {text}; write it like 'kg m2', 'deg/s' or '1/s'")
        if match[1] not in _UNITS:
            raise ValueError(f"unknown unit '{match[1]}' in {text}{hint(match[1], _UNITS)}")
        factor, exponents = _UNITS[match[1]]
        power = sign * int(match[2] or 1)
        scale *= factor**power
        total = [have + power * more for have, more in zip(total, exponents, strict=True)]
    return scale, (total[0], total[1], total[2], total[3])


def quantity(value: object, *wanted: str) -> float:
    """A number (SI) or text with a unit as a float in SI units.

    ``wanted`` names the dimensions that are allowed: angle, length, duration, mass, moment of inertia,
    speed, angular speed, acceleration, frequency, momentum, angular momentum, torque, plain number...

    Raises:
        ValueError: not a number, not finite, an unknown unit or another dimension.
    """
    dimensions = [_BY_NAME[name] for name in wanted]
    if isinstance(value, str):
        return _from_text(value, dimensions)
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ValueError(f"must be {_wanted(dimensions)}, got {shown(value)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    return _finite(number, value)


def _from_text(value: str, dimensions: list[Dimension]) -> float:
    text = shown(value)
    match = _NUMBER.fullmatch(value) if len(value) <= _TEXT else None
    if match is None:
        raise ValueError(f"must be {_wanted(dimensions)}, got {text}")
    if not match[2]:
        unit = _units(dimensions)
        raise ValueError(f"{text} is text without a unit; write the number without quotes ({unit})")
    scale, exponents = _unit(match[2], text)
    if exponents not in [dimension.exponents for dimension in dimensions]:
        other = _BY_EXPONENTS.get(exponents)
        have = f"is {other.name}" if other else "has another dimension"
        names = " or ".join(dimension.name for dimension in dimensions)
        raise ValueError(f"{text} {have}; {names} is wanted, e.g. {_examples(dimensions)}")
    return _finite(float(match[1]) * scale, value)


def _finite(number: float, value: object) -> float:
    if not math.isfinite(number):
        raise ValueError(f"must be a finite number, got {shown(value)}")
    return number


def _examples(dimensions: list[Dimension]) -> str:
    return " or ".join(f"'{dimension.example}'" for dimension in dimensions)


def _units(dimensions: list[Dimension]) -> str:
    return " or ".join(dimension.unit for dimension in dimensions)


def _wanted(dimensions: list[Dimension]) -> str:
    names = " or ".join(dimension.name for dimension in dimensions)
    if dimensions[0].unit == "1":
        return names
    return f"{names}: a number in {_units(dimensions)}, or {_examples(dimensions)}"


class Quantity:
    """Annotation that makes a float field take quantities: ``Annotated[float, Quantity("angle")]``."""

    def __init__(self, *wanted: str) -> None:
        self.wanted = wanted
        self.dimensions = [_BY_NAME[name] for name in wanted]

    def convert(self, value: object) -> float:
        """The value in SI units; see ``quantity``."""
        return quantity(value, *self.wanted)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.convert, core_schema.float_schema())

    def __get_pydantic_json_schema__(self, _: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        unit = _units(self.dimensions)
        if unit == "1":
            return {"type": "number"}
        text = {"type": "string", "pattern": r"^\s*[-+]?[0-9.]"}
        about = f"[{unit}] a number, or text with a unit such as {_examples(self.dimensions)}"
        return {"anyOf": [{"type": "number"}, text], "description": about}


Angle = Annotated[float, Quantity("angle")]
Length = Annotated[float, Quantity("length")]
Duration = Annotated[float, Quantity("duration")]
Mass = Annotated[float, Quantity("mass")]
InertiaMoment = Annotated[float, Quantity("moment of inertia")]
Speed = Annotated[float, Quantity("speed")]
AngularSpeed = Annotated[float, Quantity("angular speed")]
JointValue = Annotated[float, Quantity("angle", "length")]
JointSpeed = Annotated[float, Quantity("angular speed", "speed")]
JointAcceleration = Annotated[float, Quantity("angular acceleration", "acceleration")]
Frequency = Annotated[float, Quantity("frequency")]
Momentum = Annotated[float, Quantity("momentum")]
AngularMomentum = Annotated[float, Quantity("angular momentum")]
Force = Annotated[float, Quantity("force")]
Torque = Annotated[float, Quantity("torque")]
JointEffort = Annotated[float, Quantity("torque", "force")]
JointDamping = Annotated[float, Quantity("rotational damping", "damping")]


def unit_at(model: BaseModel, path: str) -> str:
    """The SI unit of the field at a dotted path of a model, "1" for a plain number, "" for other than numbers."""
    *sections, name = path.split(".")
    for section in sections:
        model = getattr(model, section)
    field = type(model).model_fields[name]
    found = [mark for mark in field.metadata if isinstance(mark, Quantity)] or list(_marks(field.annotation))
    if found:
        return " or ".join(dict.fromkeys(dimension.unit for mark in found for dimension in mark.dimensions))
    value = getattr(model, name)
    while isinstance(value, tuple) and value:
        value = value[0]
    return "1" if isinstance(value, int | float) and not isinstance(value, bool) else ""


def _marks(annotation: Any) -> Iterator[Quantity]:
    for part in get_args(annotation):
        if isinstance(part, Quantity):
            yield part
        else:
            yield from _marks(part)
