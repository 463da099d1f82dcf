"""A straight tip line from where the tip starts, with an optional turn on the way."""

from typing import Annotated, Literal

import casadi as ca
from pydantic import Field, field_validator

from fzcli.model import RobotModel
from fzcli.model.algebra import dot
from fzcli.model.attitude import exponential, multiply
from fzcli.plan.reference import Start, TipMotion, TipReference, tip_reference
from fzcli.plan.time_laws.registry import TIME_LAWS, TimeLawName
from fzcli.spec.base import SpecModel
from fzcli.spec.quantity import Parameter
from fzcli.spec.units import Angle, Duration, Length


class LineSpec(SpecModel):
    """x_d = x_0 + direction length s(t/T), world axes; R_d = exp(turn s) R_0."""

    kind: Literal["line"] = "line"
    law: TimeLawName = "3-4-5"
    direction: Annotated[tuple[float, float, float], Field(description="of the motion, world axes; any length")]
    length: Annotated[Length, Field(ge=0, description="of the tip's displacement")]
    duration: Annotated[Duration, Field(gt=0, description="of the motion")]
    turn: Annotated[
        tuple[Angle, Angle, Angle], Field(description="rotation vector of the tip's turn, world axes")
    ] = (0.0, 0.0, 0.0)

    @field_validator("direction")
    @classmethod
    def _not_zero(cls, value: tuple[float, float, float]) -> tuple[float, float, float]:
        if not any(value):
            raise ValueError("a direction of zero length points nowhere")
        if not 1e-100 < sum(part * part for part in value) < 1e100:
            raise ValueError("the direction's length must lie between 1e-50 and 1e50")
        return value


def build(spec: LineSpec, model: RobotModel, tip: str | None = None) -> TipReference:
    """The line's direction, length, duration and turn are run-time parameters."""
    direction, length = ca.SX.sym("direction", 3), ca.SX.sym("length")
    duration, turn = ca.SX.sym("duration"), ca.SX.sym("turn", 3)
    start = Start.symbols(model.n)
    way = direction * (length / ca.sqrt(dot(direction, direction)))
    constants = ca.vertcat(start.tip_position, way, 1 / duration, start.tip_quat, turn)
    symbols = ca.SX.sym("constants", constants.shape[0])
    x0, along, pace, quat0, turned = ca.vertsplit(symbols, [0, 3, 6, 7, 11, 14])
    time = ca.SX.sym("time")
    s, ds = TIME_LAWS[spec.law](time * pace)
    speed = ds * pace
    motion = TipMotion(x0 + along * s, along * speed, multiply(exponential(turned * s), quat0), turned * speed)
    return tip_reference(
        parameters={
            Parameter("reference.direction", 3): direction,
            Parameter("reference.length"): length,
            Parameter("reference.duration"): duration,
            Parameter("reference.turn", 3): turn,
        },
        start=start,
        constants=constants,
        symbols=symbols,
        time=time,
        motion=motion,
        duration=duration,
    )
