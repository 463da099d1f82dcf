"""What a run file says: pydantic models of ``kind: simulate``, with the kinds that the registries know."""

import functools
import math
import operator
from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import Field, GetJsonSchemaHandler, create_model, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from fzcli.control.registry import controllers
from fzcli.loop.replay_spec import ReplaySpec, late_events, replay_misfits, replay_model
from fzcli.plan.base_reference import BaseHoldSpec
from fzcli.plan.registry import BASE_REFERENCES, TIP_REFERENCES
from fzcli.spec.base import SpecModel
from fzcli.spec.references import RobotReference
from fzcli.spec.units import Angle, AngularMomentum, Duration, JointValue, Length, Momentum, Speed

Vector3 = tuple[float, float, float]


class MomentumSpec(SpecModel):
    """Momentum of the whole system, world axes; conserved."""

    linear: tuple[Momentum, Momentum, Momentum] = (0.0, 0.0, 0.0)
    angular: Annotated[
        tuple[AngularMomentum, AngularMomentum, AngularMomentum], Field(description="about the CoM")
    ] = (0.0, 0.0, 0.0)


class StartSpec(SpecModel):
    """Where a run starts."""

    q: Annotated[tuple[JointValue, ...], Field(min_length=1, description="joint positions, in the joints' order")]
    base_position: Annotated[
        tuple[Length, Length, Length], Field(description="origin of the base link's frame, world")
    ] = (0.0, 0.0, 0.0)
    base_quat: Annotated[
        tuple[float, float, float, float], Field(description="base attitude w, x, y, z, body to world")
    ] = (1.0, 0.0, 0.0, 0.0)
    base_rpy: Annotated[
        tuple[Angle, Angle, Angle] | None, Field(description="base attitude as roll, pitch, yaw instead")
    ] = None
    momentum: MomentumSpec = MomentumSpec()

    @model_validator(mode="after")
    def _one_attitude(self) -> "StartSpec":
        size = sum(part * part for part in self.base_quat) ** 0.5
        if abs(size - 1) > 1e-3:
            raise ValueError(f"base_quat must have length 1, it has {size:.6g}")
        if self.base_rpy is not None and "base_quat" in self.model_fields_set:
            raise ValueError("give base_quat or base_rpy, not both")
        return self

    @property
    def attitude(self) -> tuple[float, float, float, float]:
        """The base attitude as a quaternion, however it was given."""
        if self.base_rpy is None:
            return self.base_quat
        from scipy.spatial.transform import Rotation

        x, y, z, w = Rotation.from_euler("xyz", self.base_rpy).as_quat()
        return (float(w), float(x), float(y), float(z))

    @property
    def drifting(self) -> bool:
        """Whether the system starts with momentum."""
        return any((*self.momentum.linear, *self.momentum.angular))


class BoundsSpec(SpecModel):
    """Bounds of the certificate: a run that exceeds one is flagged. null: no bound."""

    tip_error: Annotated[
        float | None, Field(gt=0, description="largest tip error, m or rad: beyond, the tip is lost")
    ] = 1e-2
    linear_momentum: Annotated[float | None, Field(gt=0, description="N s")] = 1e-9
    angular_momentum: Annotated[
        float | None, Field(gt=0, description="N m s; the integrator's own error counts")
    ] = None
    quaternion_norm_error: Annotated[float | None, Field(gt=0)] = 1e-9
    joint_excess: Annotated[float | None, Field(ge=0, description="beyond a joint's position or speed limit")] = 1e-9
    singular_value: Annotated[float | None, Field(gt=0, description="smallest singular value of the task")] = None
    energy_balance: Annotated[
        float | None, Field(gt=0, description="energy error at torque level, over the largest kinetic energy")
    ] = 1e-4
    tip_deviation: Annotated[
        Length | None, Field(gt=0, description="largest, of the tip at torque level from the motion followed")
    ] = None
    yaw_deviation: Annotated[
        Angle | None, Field(gt=0, description="largest, of the base's yaw at torque level from the motion followed")
    ] = None


class StopSpec(SpecModel):
    """When a run with a target has arrived; it ends there, or unarrived ``after`` its time."""

    position: Annotated[Length, Field(gt=0, description="within this distance of the target")]
    direction: Annotated[
        Angle | None, Field(gt=0, description="and the tip's z within this angle of its direction")
    ] = None
    orientation: Annotated[
        Angle | None, Field(gt=0, description="and the tip within this angle of its orientation")
    ] = None
    speed: Annotated[
        Speed | None, Field(gt=0, description="and the tip slower than this relative to the target")
    ] = None
    after: Annotated[Duration, Field(gt=0, description="the longest that the run may take")]


class RecordSpec(SpecModel):
    """What a result file holds; a word alone says which runs of a sweep are kept with their trajectories."""

    keep: Annotated[
        Literal["ends", "metrics", "failures", "full"],
        Field(description="runs of a sweep kept whole: best, median and worst a configuration; none; failed; all"),
    ] = "ends"
    every: Annotated[int | None, Field(ge=1, description="keep every n-th trajectory instead")] = None
    best: Annotated[int | None, Field(ge=1, description="keep the n best of each configuration instead")] = None
    precision: Annotated[Literal["f4", "f8"], Field(description="of trajectories; metrics are f8 always")] = "f4"
    rank_by: Annotated[str, Field(description="metric by which a sweep's best, median and worst runs are kept")] = (
        "tip_error_mean"
    )

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        whole = handler.resolve_ref_schema(handler(core))
        return {"anyOf": [whole["properties"]["keep"], whole]}

    @model_validator(mode="before")
    @classmethod
    def _word(cls, value: Any) -> Any:
        return {"keep": value} if isinstance(value, str) else value

    @model_validator(mode="after")
    def _one_choice(self) -> "RecordSpec":
        if sum((self.keep != "ends", self.every is not None, self.best is not None)) > 1:
            raise ValueError("give one of keep, every and best")
        return self


class SimulateRun(SpecModel):
    """One closed-loop run. The fields ``controller``, ``reference`` and ``base_reference`` have kinds."""

    kind: Literal["simulate"] = "simulate"
    about: str = ""
    robot: RobotReference
    start: StartSpec
    reference: Any
    base_reference: Any = BaseHoldSpec()
    controller: Any
    step: Annotated[Duration, Field(gt=0, description="control and integration step")] = 0.01
    method: Annotated[
        Literal["euler", "midpoint", "gauss_magnus"],
        Field(
            description="explicit Euler or midpoint; gauss_magnus: attitude to 4th order, joint rates held over a step"
        ),
    ] = "euler"
    plant: Annotated[
        Literal["kinematic", "translation_only"],
        Field(description="the base follows momentum; or it only translates, the true turn being carried along"),
    ] = "kinematic"
    replay: Annotated[
        ReplaySpec | None, Field(description="the run's motion followed at torque level; none: the run itself")
    ] = None
    duration: Annotated[Duration | None, Field(gt=0, description="of the run; that of the reference by default")] = None
    stop: Annotated[StopSpec | None, Field(description="when the tip has arrived at its target")] = None
    bounds: BoundsSpec = BoundsSpec()
    record: RecordSpec = RecordSpec()
    compare: Annotated[
        dict[str, dict[str, Any]],
        Field(default_factory=dict, description="variants run and drawn beside this run: name -> {field: value}"),
    ]


def misfits(spec: SimulateRun) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Where a run does not fit its robot: the field's path, and what is wrong with it."""
    names = [link.joint.name for link in spec.robot.links if link.joint.type != "fixed"]
    if len(spec.start.q) != len(names):
        yield ("start", "q"), f"has {len(spec.start.q)} values for {len(names)} active joints ({', '.join(names)})"
    if spec.start.drifting and not spec.robot.base.floating:
        yield ("start", "momentum"), "a robot on a fixed base has no momentum of its own"
    length = spec.duration or (spec.stop and spec.stop.after) or getattr(spec.reference, "duration", None)
    if length is None and spec.reference.kind in ("hold", "target", "reachable"):
        missing = "is missing: the reference" if spec.reference.kind == "hold" else "is missing, or stop: the reference"
        yield ("duration",), f"{missing} {spec.reference.kind!r} has no end of its own"
    elif isinstance(length, float) and spec.step > length:
        yield ("step",), f"{spec.step:g} s is longer than the run, {length:g} s"
    yield from _unaimed(spec)
    displacement = getattr(spec.reference, "displacement", None)
    if displacement is not None and len(displacement) != len(names):
        text = f"has {len(displacement)} values for {len(names)} active joints ({', '.join(names)})"
        yield ("reference", "displacement"), text
    tip = getattr(spec.controller, "tip", None)
    check = controllers()[spec.controller.kind].misfits
    if check is not None:
        yield from check(spec.robot, spec.controller)
    if spec.replay is not None:
        for path, text in replay_misfits(spec.robot, spec.replay):
            yield ("replay", *path), text
    if tip is not None and tip not in spec.robot.tips:
        yield ("controller", "tip"), f"the robot has no tip {tip!r}; it has {', '.join(spec.robot.tips)}"


def never_reached(spec: SimulateRun) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Times that the run is over before: the field's path, and what is wrong with it."""
    lasting = spec.stop.after if spec.stop is not None else spec.duration
    end = lasting or getattr(spec.reference, "duration", None) or sum(getattr(spec.reference, "durations", ()))
    end = math.ceil(end / spec.step - 1e-9) * spec.step
    if spec.replay is not None:
        for path, text in late_events(spec.replay, end):
            yield ("replay", *path), text
    restart = getattr(spec.controller, "restart", None)
    if restart is not None and "stall" in restart.model_fields_set and restart.stall > end:
        text = f"{restart.stall:.9g} s without progress cannot pass in a run of {end:.9g} s"
        yield ("controller", "restart", "stall"), text


def _loose_search(spec: SimulateRun) -> Iterator[tuple[tuple[str, ...], str]]:
    """A search must not be content with postures from which the run has not arrived."""
    restart = getattr(spec.controller, "restart", None)
    if restart is None or spec.stop is None:
        return
    limits = {"distance": ("position", spec.stop.position), "angle": ("direction", spec.stop.direction)}
    for field, (bound, limit) in limits.items():
        given = getattr(restart, field)
        if given is not None and limit is not None and given > limit:
            text = f"is looser than stop.{bound}: a posture would be driven to that has not arrived"
            yield ("controller", "restart", field), text


_FIXED = {"direction": "direction", "pose": "position and orientation"}


def _unaimed(spec: SimulateRun) -> Iterator[tuple[tuple[str, ...], str]]:
    """Where target, stop condition and the controller's task do not fit together."""
    aim, task = getattr(spec.reference, "aim", ""), getattr(spec.controller, "task", "")
    if spec.stop is None:
        if getattr(spec.controller, "restart", None) is not None:
            yield ("stop",), "is missing: controller.restart must know when the tip has arrived"
    elif not aim:
        yield ("stop",), f"needs a reference to arrive at (target, reachable); {spec.reference.kind!r} is followed"
    elif spec.duration is not None:
        yield ("duration",), "stands beside stop.after; give one"
    else:
        for field, wanted in (("direction", "direction"), ("orientation", "pose")):
            given = getattr(spec.stop, field)
            if aim == wanted and given is None:
                yield ("stop", field), f"is missing: the reference fixes the tip's {field}"
            if aim != wanted and given is not None:
                yield ("stop", field), f"the reference fixes no {field} of the tip"
        free = {"direction": ("position",), "pose": ("position", "approach", "orientation")}.get(aim, ())
        if task in free and getattr(spec.stop, "direction" if aim == "direction" else "orientation") is not None:
            yield ("controller", "task"), f"{task!r} leaves free what stop waits for: the tip's {_FIXED[aim]}"
    yield from _loose_search(spec)
    if aim == "position" and task in ("approach", "pose", "orientation"):
        hint = "; give reference.direction, or controller.task: position" if task == "approach" else ""
        yield ("controller", "task"), f"{task!r} needs more than the reference's position{hint}"
    elif aim == "direction" and task in ("pose", "orientation"):
        yield ("controller", "task"), f"{task!r} needs reference.rpy, not only a direction"


@cache
def simulate_model() -> type[SimulateRun]:
    """SimulateRun with its open fields bound to the kinds that exist, for validation and JSON Schema."""
    replay: Any = replay_model() | None
    return create_model(
        "SimulateRun",
        __base__=SimulateRun,
        reference=(_union(kind.spec for kind in TIP_REFERENCES.values()), ...),
        base_reference=(_union(kind.spec for kind in BASE_REFERENCES.values()), BaseHoldSpec()),
        controller=(_union(entry.spec for entry in controllers().values()), ...),
        replay=(replay, None),
    )


def _union(specs: Any) -> Any:
    return Annotated[functools.reduce(operator.or_, specs), Field(discriminator="kind")]
