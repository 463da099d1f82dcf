"""What a rule base file becomes: variables, terms and rules as text with their places."""

from typing import Literal

from pydantic import Field

from fzcli.spec.base import SpecModel

Shape = Literal["triangle", "trapezoid", "ramp", "rectangle", "singleton", "gaussian"]


class Term(SpecModel):
    """A fuzzy set: its shape and the shape's numbers.

    triangle a b c; trapezoid a b c d; ramp a b (0 at a, 1 at b, either direction);
    rectangle a b; singleton x; gaussian mean sigma.
    """

    shape: Shape
    numbers: tuple[float, ...]


class Input(SpecModel):
    """An input variable; values are clipped to its range."""

    range: tuple[float, float]
    terms: dict[str, Term] = Field(min_length=1)


class Centroid(SpecModel):
    """Centre of gravity: exact closed form, or midpoint sums over ``samples`` equal cells of the range."""

    method: Literal["exact", "midpoint"] = "exact"
    samples: int = 1001


class Output(SpecModel):
    """An output variable; ``default`` is its value when no rule fires ("hold" keeps the last one)."""

    range: tuple[float, float]
    terms: dict[str, Term] = Field(min_length=1)
    defuzzifier: Centroid = Centroid()
    default: float | Literal["hold"] = 0.0


class RuleText(SpecModel):
    """One rule as written, with its place for error messages (line and column of its first character)."""

    text: str
    file: str | None = None
    line: int | None = None
    column: int | None = None


class Rulebase(SpecModel):
    """A Mamdani rule base: min implication (clipping), max aggregation."""

    kind: Literal["rulebase"] = "rulebase"
    name: str = ""
    about: str = ""
    conjunction: Literal["min", "prod"] = "min"
    disjunction: Literal["max", "probor"] = "max"
    inputs: dict[str, Input] = Field(min_length=1)
    outputs: dict[str, Output] = Field(min_length=1)
    rules: tuple[RuleText, ...] = Field(min_length=1)
