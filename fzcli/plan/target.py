"""A target in the world to arrive at, standing still, drifting or tumbling."""

import math
from typing import Annotated, Literal

import casadi as ca
from pydantic import Field, field_validator, model_validator

from fzcli.model import RobotModel
from fzcli.model.algebra import cross, dot
from fzcli.model.attitude import exponential, multiply, rotation_matrix
from fzcli.plan.reference import AimName, Start, TipMotion, TipReference, tip_reference
from fzcli.spec.base import SpecModel
from fzcli.spec.quantity import Parameter
from fzcli.spec.units import Angle, AngularSpeed, Length, Speed

Point = tuple[Length, Length, Length]
STILL = (0.0, 0.0, 0.0)


class TargetSpec(SpecModel):
    """Where the tip is to arrive: a position, with a direction of its z or an orientation where one is given.

    A tumbling target turns with ``spin`` about ``centre``, which moves with ``velocity``.
    """

    kind: Literal["target"] = "target"
    position: Annotated[Point, Field(description="of the tip, world, at the start of the run")]
    direction: Annotated[
        tuple[float, float, float] | None, Field(description="of the tip's z, world axes; any length")
    ] = None
    rpy: Annotated[
        tuple[Angle, Angle, Angle] | None, Field(description="orientation of the tip as roll, pitch, yaw, world axes")
    ] = None
    velocity: Annotated[tuple[Speed, Speed, Speed], Field(description="of the target, world axes")] = STILL
    spin: Annotated[
        tuple[AngularSpeed, AngularSpeed, AngularSpeed], Field(description="angular velocity of the target, world axes")
    ] = STILL
    centre: Annotated[
        Point | None, Field(description="that the target turns about; its own position by default")
    ] = None

    @field_validator("direction")
    @classmethod
    def _not_zero(cls, value: tuple[float, float, float] | None) -> tuple[float, float, float] | None:
        if value is not None and not any(value):
            raise ValueError("a direction of zero length points nowhere")
        if value is not None and not 1e-100 < sum(part * part for part in value) < 1e100:
            raise ValueError("the direction's length must lie between 1e-50 and 1e50")
        return value

    @model_validator(mode="after")
    def _one_attitude(self) -> "TargetSpec":
        if self.direction is not None and self.rpy is not None:
            raise ValueError("give direction or rpy, not both")
        return self

    @property
    def aim(self) -> AimName:
        """What is fixed."""
        return "direction" if self.direction is not None else "pose" if self.rpy is not None else "position"

    @property
    def moving(self) -> bool:
        """Whether the target does not stand still."""
        return any((*self.velocity, *self.spin))


def build(spec: TargetSpec, model: RobotModel, tip: str | None = None) -> TipReference:
    """Position, direction or orientation, velocity, spin and centre are run-time parameters."""
    position, velocity, spin = ca.SX.sym("position", 3), ca.SX.sym("velocity", 3), ca.SX.sym("spin", 3)
    parameters = {
        Parameter("reference.position", 3): position,
        Parameter("reference.velocity", 3): velocity,
        Parameter("reference.spin", 3): spin,
    }
    start = Start.symbols(model.n)
    quat = start.tip_quat
    if spec.direction is not None:
        direction = ca.SX.sym("direction", 3)
        parameters[Parameter("reference.direction", 3)] = direction
        quat = quaternion_to(direction / ca.sqrt(dot(direction, direction)))
    elif spec.rpy is not None:
        angles = ca.SX.sym("rpy", 3)
        parameters[Parameter("reference.rpy", 3)] = angles
        quat = quaternion_from_rpy(angles)
    centre = position
    if spec.centre is not None:
        centre = ca.SX.sym("centre", 3)
        parameters[Parameter("reference.centre", 3)] = centre
    constants = ca.vertcat(centre - start.com, position - centre, velocity, spin, quat)
    symbols = ca.SX.sym("constants", 16)
    origin, arm, speed, rate, quat0 = ca.vertsplit(symbols, [0, 3, 6, 9, 12, 16])
    time = ca.SX.sym("time")
    turn = exponential(rate * time)
    carried = ca.mtimes(rotation_matrix(turn), arm)
    motion = TipMotion(origin + speed * time + carried, speed + cross(rate, carried), multiply(turn, quat0), rate)
    return tip_reference(
        parameters=parameters,
        start=start,
        constants=constants,
        symbols=symbols,
        time=time,
        motion=motion,
        duration=ca.SX(math.inf),
        aim=spec.aim,
    )


def quaternion_to(direction: ca.SX) -> ca.SX:
    """The least turn that lays z on a unit vector (3), as a quaternion (4); about x where it is -z."""
    x, y, z = direction[0], direction[1], direction[2]
    across = x * x + y * y
    up = ca.if_else(z < 0, across / (1 - z), 1 + z)  # 1 + z, without cancellation near -z
    size = 1 / ca.sqrt(ca.fmax(up * up + across, 1e-300))
    return ca.if_else(across + up > 0, ca.vertcat(up * size, -y * size, x * size, 0), ca.vertcat(0, 1, 0, 0))


def quaternion_from_rpy(rpy: ca.SX) -> ca.SX:
    """Rz(yaw) Ry(pitch) Rx(roll) as a quaternion (4)."""
    axes = ca.SX.eye(3)
    roll, pitch, yaw = (exponential(axes[:, i] * rpy[i]) for i in range(3))
    return multiply(yaw, multiply(pitch, roll))
