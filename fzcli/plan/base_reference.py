"""Where the base's roll, pitch and yaw are to be: held, or led from rest to rest to new angles."""

import math
from typing import Annotated, Literal

import casadi as ca
from pydantic import Field

from fzcli.plan.reference import BaseReference
from fzcli.plan.time_laws.registry import TIME_LAWS, TimeLawName
from fzcli.spec.base import SpecModel
from fzcli.spec.quantity import Parameter
from fzcli.spec.units import Angle, Duration


class BaseHoldSpec(SpecModel):
    """Keep the angles that the base starts with."""

    kind: Literal["hold"] = "hold"


class BaseTurnSpec(SpecModel):
    """From the angles at the start to ``angles`` in ``duration``, each the short way round."""

    kind: Literal["turn"] = "turn"
    law: TimeLawName = "3-4-5"
    angles: Annotated[tuple[Angle, Angle, Angle], Field(description="roll, pitch, yaw at the end")]
    duration: Annotated[Duration, Field(gt=0, description="of the turn")]


def build_hold(spec: BaseHoldSpec) -> BaseReference:
    """q_bd is constant."""
    angles, none = ca.SX.sym("angles", 3), ca.SX.sym("none", 0)
    held, time = ca.SX.sym("constants", 3), ca.SX.sym("time")
    return _assemble({}, none, angles, angles, held, time, held, ca.SX.zeros(3))


def build_turn(spec: BaseTurnSpec) -> BaseReference:
    """q_bd(t) = start + (angles - start) s(t/T)."""
    wanted, duration = ca.SX.sym("wanted", 3), ca.SX.sym("duration")
    angles, time = ca.SX.sym("angles", 3), ca.SX.sym("time")
    symbols = ca.SX.sym("constants", 7)
    s, ds = TIME_LAWS[spec.law](time * symbols[6])
    parameters = {Parameter("base_reference.angles", 3): wanted, Parameter("base_reference.duration"): duration}
    way = wanted - angles
    way = way - 2 * math.pi * ca.floor(way * (0.5 / math.pi) + 0.5)
    constants = ca.vertcat(angles, way, 1 / duration)
    position = symbols[:3] + symbols[3:6] * s
    rates = symbols[3:6] * (ds * symbols[6])
    return _assemble(
        parameters, ca.vertcat(wanted, duration), angles, constants, symbols, time, position, rates
    )


def _assemble(
    parameters: dict[Parameter, ca.SX],
    values: ca.SX,
    start: ca.SX,
    constants: ca.SX,
    symbols: ca.SX,
    time: ca.SX,
    angles: ca.SX,
    rates: ca.SX,
) -> BaseReference:
    prepare = ca.Function("prepare", [values, start], [constants], ["parameters", "angles"], ["constants"])
    evaluate = ca.Function(
        "evaluate", [time, symbols], [angles, ca.densify(rates)], ["time", "constants"], ["angles", "rates"]
    )
    return BaseReference(prepare, evaluate, tuple(parameters))
