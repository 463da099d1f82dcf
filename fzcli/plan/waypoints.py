"""Straight tip lines from point to point, at rest in every point."""

from typing import Annotated, Literal

import casadi as ca
from pydantic import Field, model_validator

from fzcli.model import RobotModel
from fzcli.model.attitude import exponential, multiply
from fzcli.plan.reference import Start, TipMotion, TipReference, tip_reference
from fzcli.plan.time_laws.registry import TIME_LAWS, TimeLawName
from fzcli.spec.base import SpecModel
from fzcli.spec.quantity import Parameter
from fzcli.spec.units import Angle, Duration, Length

Point = tuple[Length, Length, Length]
Turn = tuple[Angle, Angle, Angle]


class WaypointsSpec(SpecModel):
    """Segments between points, each with its own duration and time law from rest to rest."""

    kind: Literal["waypoints"] = "waypoints"
    law: TimeLawName = "3-4-5"
    points: Annotated[tuple[Point, ...], Field(min_length=1, description="the points to visit, in order")]
    relative: Annotated[
        bool, Field(description="points are displacements from the tip's start, world axes; else world positions")
    ] = False
    durations: Annotated[tuple[Duration, ...], Field(description="of the segments, one a point")]
    turns: Annotated[
        tuple[Turn, ...] | None,
        Field(description="rotation vector of every segment, world axes; none: the attitude is kept"),
    ] = None

    @model_validator(mode="after")
    def _one_each(self) -> "WaypointsSpec":
        for name in ("durations", "turns"):
            given = getattr(self, name)
            if given is not None and len(given) != len(self.points):
                raise ValueError(f"{name} has {len(given)} entries for {len(self.points)} points")
        if any(duration <= 0 for duration in self.durations):
            raise ValueError("every duration must be above 0 s")
        return self


def build(spec: WaypointsSpec, model: RobotModel, tip: str | None = None) -> TipReference:
    """Points and durations are run-time parameters; their number is built in."""
    k = len(spec.points)
    points, durations, turns = ca.SX.sym("points", 3 * k), ca.SX.sym("durations", k), ca.SX.sym("turns", 3 * k)
    start = Start.symbols(model.n)
    position = start.tip_position
    corners = [position]
    for i in range(k):
        point = points[3 * i : 3 * i + 3]
        corners.append(position + point if spec.relative else point - start.com)
    legs = ca.vertcat(*(corners[i + 1] - corners[i] for i in range(k)))
    turned = turns if spec.turns is not None else ca.SX.zeros(3 * k)
    constants = ca.vertcat(position, start.tip_quat, legs, turned, durations)
    symbols = ca.SX.sym("constants", constants.shape[0])
    x0, quat0, leg, turn, seconds = ca.vertsplit(symbols, [0, 3, 7, 7 + 3 * k, 7 + 6 * k, 7 + 7 * k])
    time = ca.SX.sym("time")
    motion = _travel(time, x0, quat0, leg, turn, seconds, spec)
    parameters = {Parameter("reference.points", 3 * k): points, Parameter("reference.durations", k): durations}
    if spec.turns is not None:
        parameters[Parameter("reference.turns", 3 * k)] = turns
    return tip_reference(
        parameters=parameters,
        start=start,
        constants=constants,
        symbols=symbols,
        time=time,
        motion=motion,
        duration=ca.sum1(durations),
    )


def _travel(
    time: ca.SX, x0: ca.SX, quat0: ca.SX, leg: ca.SX, turn: ca.SX, seconds: ca.SX, spec: WaypointsSpec
) -> TipMotion:
    position, velocity, quat, rate = x0, ca.SX.zeros(3), quat0, ca.SX.zeros(3)
    begin = ca.SX(0)
    for i in range(seconds.shape[0]):
        way, spin = leg[3 * i : 3 * i + 3], turn[3 * i : 3 * i + 3]
        s, ds = TIME_LAWS[spec.law]((time - begin) / seconds[i])
        speed = ds / seconds[i]
        position, velocity = position + way * s, velocity + way * speed
        quat, rate = multiply(exponential(spin * s), quat), rate + spin * speed
        begin = begin + seconds[i]
    return TipMotion(position, velocity, quat, rate)
