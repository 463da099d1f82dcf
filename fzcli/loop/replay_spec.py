"""What the section ``replay:`` of a run or a plan says: the motion again, by torques, on a robot with inertia."""

from collections.abc import Iterator
from functools import cache, reduce
from operator import or_
from typing import Annotated, Any, Literal

from pydantic import Field, create_model, field_validator, model_validator

from fzcli.control.torque.registry import TORQUE_CONTROLLERS
from fzcli.spec.base import SpecModel
from fzcli.spec.physics import check_body
from fzcli.spec.references import RobotReference
from fzcli.spec.robot import Robot
from fzcli.spec.robot_file import InertiaNumbers
from fzcli.spec.units import AngularSpeed, Duration, Force, Frequency, Length, Mass, Speed, Torque

Force3 = tuple[Force, Force, Force]
Torque3 = tuple[Torque, Torque, Torque]
_Share = Annotated[float, Field(ge=-1, le=1)]


class ErrorsSpec(SpecModel):
    """By what the robot differs from what the controllers believe: (1 + all) (1 + each masses) times each mass."""

    all: Annotated[float, Field(gt=-1, description="of all masses and inertias alike, 0.2: 20 % more")] = 0.0
    each: Annotated[float, Field(gt=-1, lt=1, description="of each body by its share, 0.2: up to 20 %")] = 0.0
    masses: Annotated[
        _Share | tuple[_Share, ...], Field(description="shares of each, -1 to 1: one, or the base's, then one a joint")
    ] = 1.0
    inertias: Annotated[_Share | tuple[_Share, ...], Field(description="the same, of inertias about the CoM")] = 1.0

    @model_validator(mode="after")
    def _shares_of_something(self) -> "ErrorsSpec":
        given = [name for name in ("masses", "inertias") if name in self.model_fields_set]
        if given and "each" not in self.model_fields_set:
            raise ValueError(f"{given[0]} are shares of 'each', which is missing")
        return self


class GraspSpec(SpecModel):
    """A rigid payload that the tip seizes: an inelastic impact, momentum conserved."""

    at: Annotated[Duration, Field(ge=0, description="when")]
    mass: Annotated[Mass, Field(gt=0)]
    com: Annotated[tuple[Length, Length, Length], Field(description="centre of mass, tip axes")] = (0.0, 0.0, 0.0)
    inertia: Annotated[InertiaNumbers, Field(description="about the CoM, tip axes: xx yy zz [xy xz yz]")]
    velocity: Annotated[tuple[Speed, Speed, Speed], Field(description="of the payload at the tip before, world")] = (
        0.0,
        0.0,
        0.0,
    )
    rate: Annotated[
        tuple[AngularSpeed, AngularSpeed, AngularSpeed], Field(description="angular, of the payload before, world")
    ] = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _exists(self) -> "GraspSpec":
        check_body(self.mass, self.inertia)
        return self


class WrenchSpec(SpecModel):
    """A force and a moment from outside for a while, world axes."""

    on: Annotated[Literal["base", "tip"], Field(description="at the origin of the base's or the tip's frame")]
    force: Force3 = (0.0, 0.0, 0.0)
    moment: Torque3 = (0.0, 0.0, 0.0)
    begin: Annotated[Duration, Field(ge=0)] = 0.0
    end: Annotated[Duration | None, Field(gt=0, description="none: as long as the run")] = None

    @model_validator(mode="after")
    def _acts(self) -> "WrenchSpec":
        if self.end is not None and self.end <= self.begin:
            raise ValueError(f"ends at {self.end:g} s, not after its begin at {self.begin:g} s")
        if not any((*self.force, *self.moment)):
            raise ValueError("has neither a force nor a moment")
        return self


class AttitudeSpec(SpecModel):
    """Attitude control of the base: moment = I (frequency^2 error + 2 damping frequency rate), I of the whole robot."""

    by: Annotated[Literal["wheels", "thrusters"], Field(description="reaction wheels take up the momentum, or jets")]
    hold: Annotated[
        Literal["start", "motion"], Field(description="the attitude at the start, or that of the motion followed")
    ] = "start"
    frequency: Annotated[Frequency, Field(gt=0, description="natural, rad/s")] = 1.0
    damping: Annotated[float, Field(gt=0, description="ratio of critical damping")] = 1.0
    limit: Annotated[Torque | None, Field(gt=0, description="of the moment about each of the base's axes")] = None


def _once(value: Any) -> Any:
    """One payload, though a list is understood. Raises ValueError for a second one."""
    if isinstance(value, list | tuple):
        if len(value) > 1:
            times = [f"at {one['at']}" for one in value[:2] if isinstance(one, dict) and "at" in one]
            when = f", {' and '.join(times)}" if times else ""
            raise ValueError(f"a payload is grasped twice{when}; a tip holds one")
        return value[0] if value else None
    return value


class ReplaySpec(SpecModel):
    """The run's motion as the reference of a torque controller, on a robot that has inertia, friction and limits."""

    controller: Any
    robot: Annotated[
        RobotReference | None,
        Field(description="that is moved, where it is another than the controllers' (the run's own)"),
    ] = None
    errors: Annotated[ErrorsSpec | None, Field(description="of that robot's masses and inertias")] = None
    substeps: Annotated[
        int, Field(ge=1, le=1000, description="torque control and integration steps in one step of the run")
    ] = 5
    integrator: Literal["munthe_kaas", "rk4", "euler", "dormand_prince"] = "munthe_kaas"
    tolerance: Annotated[float, Field(gt=0, description="relative and absolute, of dormand_prince alone")] = 1e-9
    attitude: Annotated[AttitudeSpec | None, Field(description="control of a free base; none: it floats")] = None
    grasp: GraspSpec | None = None
    wrenches: tuple[WrenchSpec, ...] = ()

    @field_validator("grasp", mode="before")
    @classmethod
    def _grasped_once(cls, value: Any) -> Any:
        return _once(value)

    @property
    def inputs(self) -> tuple[str, ...]:
        """What acts on the robot, as `fzcli.model.free_motion` names it."""
        on = {wrench.on for wrench in self.wrenches}
        by: str = self.attitude.by if self.attitude else ""
        asked = {
            "base_wrench": "base" in on or by == "thrusters",
            "wheel_torque": by == "wheels",
            "tip_wrench": "tip" in on,
            "payload": self.grasp is not None,
            "mass_factors": self.errors is not None,
            "inertia_factors": self.errors is not None,
        }
        return ("torque", *(name for name, wanted in asked.items() if wanted))


@cache
def replay_model() -> type[ReplaySpec]:
    """ReplaySpec with its controller bound to the kinds that exist."""
    return create_model("ReplaySpec", __base__=ReplaySpec, controller=(_controllers(), ...))


def _controllers() -> Any:
    kinds: Any = reduce(or_, (entry.spec for entry in TORQUE_CONTROLLERS.values()))
    return Annotated[kinds, Field(discriminator="kind")]


Misfit = tuple[tuple[str | int, ...], str]
SAME = 1e-9  # s


def late_events(spec: ReplaySpec, end: float) -> Iterator[Misfit]:
    """Events that begin when the motion is over at ``end`` [s]: the field's path below the section, and why not."""
    times: list[tuple[tuple[str | int, ...], float]] = [] if spec.grasp is None else [(("grasp", "at"), spec.grasp.at)]
    times += [(("wrenches", i, "begin"), wrench.begin) for i, wrench in enumerate(spec.wrenches)]
    for path, begin in times:
        if begin > end + SAME:
            yield path, f"begins at {begin:.9g} s, after the end of the run at {end:.9g} s"


def replay_misfits(robot: Robot, spec: ReplaySpec) -> Iterator[Misfit]:
    """Where a replay does not fit the run's robot: the field's path below the section, and what is wrong with it."""
    names = _joints(robot)
    if spec.robot is not None:
        moved = _joints(spec.robot)
        if moved != names:
            yield ("robot",), f"has joints {', '.join(moved)}; the run's robot has {', '.join(names)}"
        elif spec.robot.base.floating != robot.base.floating:
            yield ("robot",), "must have a base of the same kind as the run's robot, floating or fixed"
        for name in robot.tips:
            if name not in spec.robot.tips:
                yield ("robot",), f"has no tip {name!r}; the run's robot has one"
    bodies = f"the base, then {len(names)} joints ({', '.join(names)})"
    for field in ("masses", "inertias"):
        given = getattr(spec.errors, field, None)
        if isinstance(given, tuple) and len(given) != len(names) + 1:
            yield ("errors", field), f"has {len(given)} values for {bodies}"
    if spec.attitude is not None and not robot.base.floating:
        yield ("attitude",), "a fixed base needs no attitude control"
    for field in ("stiffness", "damping"):
        gains = getattr(spec.controller, field, None)
        if isinstance(gains, tuple) and len(gains) != len(names):
            yield ("controller", field), f"has {len(gains)} values for {len(names)} active joints ({', '.join(names)})"
    tip = getattr(spec.controller, "tip", None)
    if tip is not None and tip not in robot.tips:
        yield ("controller", "tip"), f"the robot has no tip {tip!r}; it has {', '.join(robot.tips)}"


def _joints(robot: Robot) -> list[str]:
    return [link.joint.name for link in robot.links if link.joint.type != "fixed"]
