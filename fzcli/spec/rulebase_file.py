"""The rule base file that users write, and the checks of its terms."""

from collections.abc import Callable
from typing import Annotated, Any, Literal, get_args

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, WithJsonSchema, field_validator

from fzcli.spec.base import SpecModel
from fzcli.spec.nearest import hint, shown
from fzcli.spec.rulebase import Centroid, Shape, Term
from fzcli.spec.units import quantity

_SHAPES: tuple[str, ...] = get_args(Shape)
_GRAMMAR = {"if", "then", "is", "and", "or", "not", "with"}

# shape: names of its numbers, the rule that they obey, and the test of it
_RULES: dict[str, tuple[str, str, Callable[..., bool]]] = {
    "triangle": ("a b c", "a <= b <= c and a < c", lambda a, b, c: a <= b <= c and a < c),
    "trapezoid": ("a b c d", "a <= b <= c <= d and a < d", lambda a, b, c, d: a <= b <= c <= d and a < d),
    "ramp": ("a b", "a and b to differ", lambda a, b: a != b),
    "rectangle": ("a b", "a < b", lambda a, b: a < b),
    "singleton": ("x", "", lambda x: True),
    "gaussian": ("mean sigma", "sigma > 0", lambda mean, sigma: sigma > 0),
}
_TERM_SCHEMA = {
    "type": "array",
    "prefixItems": [{"enum": list(_SHAPES)}],
    "items": {"type": "number"},
    "minItems": 2,
    "maxItems": 5,
    "description": "; ".join(f"[{shape}, {rule[0].replace(' ', ', ')}]" for shape, rule in _RULES.items()),
}
_DEFUZZIFIER_SCHEMA = {
    "anyOf": [
        {"enum": ["centroid"]},
        {
            "type": "object",
            "properties": {"midpoint": {"type": "integer", "minimum": 1}},
            "required": ["midpoint"],
            "additionalProperties": False,
        },
        {
            "type": "object",
            "properties": {
                "centroid": {
                    "type": "object",
                    "properties": {
                        "method": {"enum": ["exact", "midpoint"]},
                        "samples": {"type": "integer", "minimum": 1},
                    },
                    "additionalProperties": False,
                }
            },
            "required": ["centroid"],
            "additionalProperties": False,
        },
    ],
    "description": "centroid (exact), or {midpoint: 1001} for sums over that many cells",
}
_MAX_SAMPLES = 1_000_000


def _term(value: Any) -> Any:
    """``[triangle, 0, 0.5, 1]`` -> shape and numbers, checked."""
    if isinstance(value, Term):
        return value
    if not isinstance(value, list | tuple) or not value:
        raise ValueError(f"must be a shape and its numbers, e.g. [triangle, 0, 0.5, 1], got {shown(value)}")
    shape, *rest = value
    if shape not in _SHAPES:
        raise ValueError(f"unknown shape {shown(shape)}{hint(shape, _SHAPES, 'known shapes')}")
    names, rule, holds = _RULES[shape]
    if len(rest) != len(names.split()):
        count = len(names.split())
        raise ValueError(f"{shape} needs {count} number{'s' * (count > 1)} ({names}), has {len(rest)}")
    numbers = [quantity(number, "plain number") for number in rest]
    if not holds(*numbers):
        raise ValueError(f"{shape} needs {rule}, got {', '.join(f'{number:g}' for number in numbers)}")
    return {"shape": shape, "numbers": numbers}


def _defuzzifier(value: Any) -> Any:
    if isinstance(value, Centroid):
        return value
    if value == "centroid":
        return {}
    keys = set(value) if isinstance(value, dict) else set()
    if keys == {"midpoint"}:
        return {"method": "midpoint", "samples": _samples(value["midpoint"])}
    if keys == {"centroid"} and isinstance(value["centroid"], dict):
        inner = value["centroid"]
        return {**inner, "samples": _samples(inner["samples"])} if "samples" in inner else inner
    named = shown(value) if not keys else " and ".join(sorted(map(str, keys)))
    near = hint(named.strip("'"), ["centroid", "midpoint"])
    near = near if "did you mean" in near else ""
    raise ValueError(f"unknown defuzzifier {named}; write centroid or {{midpoint: 1001}}{near}")


def _samples(count: Any) -> int:
    if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= _MAX_SAMPLES:
        raise ValueError(f"samples must be a whole number from 1 to {_MAX_SAMPLES}, got {shown(count)}")
    return count


def _word(text: str) -> str:
    if not text.isidentifier() or text.lower() in _GRAMMAR:
        raise ValueError(f"{shown(text)} cannot stand in a rule: use letters, digits and _, no rule word")
    return text


Word = Annotated[str, AfterValidator(_word)]
TermNumbers = Annotated[Term, BeforeValidator(_term), WithJsonSchema(_TERM_SCHEMA)]
Defuzzifier = Annotated[Centroid, BeforeValidator(_defuzzifier), WithJsonSchema(_DEFUZZIFIER_SCHEMA)]


class InputFile(SpecModel):
    """An input variable: its range and its terms."""

    range: tuple[float, float]
    terms: dict[Word, TermNumbers] = Field(min_length=1)

    @field_validator("range")
    @classmethod
    def _is_ordered(cls, limits: tuple[float, float]) -> tuple[float, float]:
        if limits[0] >= limits[1]:
            raise ValueError(f"must rise, got {limits[0]:g} to {limits[1]:g}")
        return limits


class OutputFile(InputFile):
    """An output variable: also how it becomes one number, and its value when no rule fires."""

    defuzzifier: Defuzzifier = Centroid()
    default: float | Literal["hold"] = 0.0


class RulebaseFile(SpecModel):
    """A Mamdani rule base as written."""

    model_config = ConfigDict(populate_by_name=False)

    kind: Literal["rulebase"]
    name: str | None = Field(default=None, description="default: the file's name")
    about: str = ""
    conjunction: Literal["min", "prod"] = Field(default="min", alias="and", description="what 'and' means")
    disjunction: Literal["max", "probor"] = Field(default="max", alias="or", description="what 'or' means")
    inputs: dict[Word, InputFile] = Field(min_length=1)
    outputs: dict[Word, OutputFile] = Field(min_length=1)
    rules: tuple[Annotated[str, Field(min_length=1)], ...] = Field(min_length=1)
