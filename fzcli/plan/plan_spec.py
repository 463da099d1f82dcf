"""What a plan file says: pydantic models of ``kind: plan``."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from fzcli.learn.neural_inverse import NeuralIkSpec
from fzcli.model.collision import quaternion_from_rpy
from fzcli.plan.online_spec import ExecutionSpec
from fzcli.plan.scene import Obstacle, doubled_names
from fzcli.plan.time_laws.registry import TimeLawName
from fzcli.spec.base import SpecModel
from fzcli.spec.references import RobotReference
from fzcli.spec.tool import Tool
from fzcli.spec.units import Angle, Duration, JointAcceleration, JointValue, Length

Point = tuple[Length, Length, Length]
SHORTEST, LONGEST = 1e-6, 1e5  # s: of a path


class PlanStart(SpecModel):
    """Where a plan starts, at rest."""

    q: Annotated[tuple[JointValue, ...], Field(min_length=1, description="joint positions, in the joints' order")]
    base_position: Annotated[Point, Field(description="origin of the base link's frame, world")] = (0.0, 0.0, 0.0)
    base_rpy: Annotated[tuple[Angle, Angle, Angle], Field(description="attitude of the base, world")] = (0.0, 0.0, 0.0)

    @property
    def base_quat(self) -> tuple[float, float, float, float]:
        """The base's attitude w, x, y, z, body to world."""
        w, x, y, z = quaternion_from_rpy(self.base_rpy).tolist()
        return (w, x, y, z)


class PoseGoal(SpecModel):
    """Where a tip is to be, in the world."""

    position: Annotated[Point, Field(description="of the tip, world")]
    rpy: Annotated[tuple[Angle, Angle, Angle] | None, Field(description="orientation of the tip, world; none: any")] = (
        None
    )


class PlanGoal(SpecModel):
    """Where a plan ends: joint positions, or the pose of a tip; one tip or several."""

    q: Annotated[tuple[JointValue, ...] | None, Field(description="joint positions, in the joints' order")] = None
    position: Annotated[Point | None, Field(description="of the first tip, world")] = None
    rpy: Annotated[tuple[Angle, Angle, Angle] | None, Field(description="orientation of the first tip, world")] = None
    tips: Annotated[dict[str, PoseGoal], Field(default_factory=dict, description="poses of named tips")]

    @model_validator(mode="after")
    def _one_goal(self) -> "PlanGoal":
        given = [name for name in ("q", "position", "tips") if getattr(self, name)]
        if len(given) != 1:
            raise ValueError(f"needs one of q, position and tips{', has ' + ' and '.join(given) if given else ''}")
        if self.rpy is not None and self.position is None:
            raise ValueError("rpy stands beside position")
        return self


def in_order(window: tuple[int, int]) -> tuple[int, int]:
    """A window of steps whose begin lies before its end. Raises ValueError otherwise."""
    if not 0 <= window[0] < window[1]:
        raise ValueError("the window's begin must lie before its end")
    return window


class DetourFields(SpecModel):
    """Least half-cycloidal detours by optimisation."""

    kind: Literal["detour"] = "detour"
    weights: Annotated[
        tuple[float, ...] | None, Field(description="of the squared peaks in the cost, one a joint; 1 by default")
    ] = None
    window: Annotated[
        tuple[int, int] | None,
        Field(description="steps between which one detour stands; by default as many as it takes"),
    ] = None

    @field_validator("weights")
    @classmethod
    def _positive(cls, weights: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if weights is not None and min(weights, default=1.0) <= 0:
            raise ValueError("every weight must be above 0")
        return weights

    @field_validator("window")
    @classmethod
    def _in_order(cls, window: tuple[int, int] | None) -> tuple[int, int] | None:
        return None if window is None else in_order(window)


class DetourPlannerSpec(DetourFields):
    """Least half-cycloidal detours by optimisation, then what ``fallbacks`` name, in their order."""

    fallbacks: Annotated[
        tuple[Literal["three_detours", "rrt_connect"], ...], Field(description="tried where one detour does not do")
    ] = ("three_detours", "rrt_connect")
    iterations: Annotated[int, Field(ge=1, description="of rrt_connect")] = 20_000
    seed: Annotated[int, Field(ge=0, description="of rrt_connect")] = 0


class PaperPlannerSpec(SpecModel):
    """The procedure of Parsa 2008: the gripper alone, looked at in whole steps, a fixed window, trial and error."""

    kind: Literal["paper"] = "paper"
    window: Annotated[tuple[int, int], Field(description="steps between which the detour stands")] = (8, 12)
    joints: Annotated[tuple[int, ...], Field(min_length=1, description="that may be modified, counted from 1")] = (
        1,
        2,
        3,
        5,
    )
    increment: Annotated[Angle, Field(gt=0, description="by which the detour grows from trial to trial")] = 0.0873

    @field_validator("window")
    @classmethod
    def _in_order(cls, window: tuple[int, int]) -> tuple[int, int]:
        return in_order(window)


class RrtPlannerSpec(SpecModel):
    """RRTConnect of OMPL, shortcuts, and the time law from corner to corner, at rest in each."""

    kind: Literal["rrt_connect"] = "rrt_connect"
    iterations: Annotated[int, Field(ge=1)] = 20_000
    seed: Annotated[int, Field(ge=0)] = 0


PlannerSpec = Annotated[
    DetourPlannerSpec | PaperPlannerSpec | RrtPlannerSpec, Field(discriminator="kind")
]
PLANNER_SPECS: dict[str, type[SpecModel]] = {
    "detour": DetourPlannerSpec,
    "paper": PaperPlannerSpec,
    "rrt_connect": RrtPlannerSpec,
}


class ExactIkSpec(SpecModel):
    """The arm's closed form where it has one, else a search."""

    kind: Literal["exact"] = "exact"


class PlanFields(SpecModel):
    """What every plan says, whatever its robot."""

    kind: Literal["plan"] = "plan"
    about: str = ""
    law: TimeLawName = "3-4-5"
    duration: Annotated[
        Annotated[Duration, Field(gt=0, ge=SHORTEST, le=LONGEST)] | Literal["fastest"],
        Field(description="of the path; fastest: what joint speeds allow"),
    ] = "fastest"
    accelerations: Annotated[
        tuple[JointAcceleration, ...] | None, Field(description="the largest of each joint, in the joints' order")
    ] = None
    stretch: Annotated[
        bool, Field(description="the duration may grow where joint speeds and accelerations ask for it")
    ] = True
    steps: Annotated[
        int, Field(ge=4, le=10_000, description="parts of the duration, by which windows are counted")
    ] = 20
    margin: Annotated[Length, Field(ge=0, description="distance to keep from everything")] = 0.0
    scene: Annotated[tuple[Obstacle, ...], Field(description="what is not to be touched")] = ()
    execution: Annotated[ExecutionSpec, Field(description="how `fzcli simulate` follows the plan")] = ExecutionSpec()


class PlanRun(PlanFields):
    """One plan."""

    robot: RobotReference
    tool: Annotated[Tool | None, Field(description="a rigid tool on the first tip")] = None
    hold_base: Annotated[bool, Field(description="a free base is held where it starts; the joints alone move")] = False
    start: PlanStart
    goal: PlanGoal
    ik: Annotated[
        ExactIkSpec | NeuralIkSpec, Field(discriminator="kind", description="what finds postures for a goal's pose")
    ] = ExactIkSpec()
    planner: PlannerSpec = DetourPlannerSpec()
    replay: Annotated[
        Any, Field(description="`fzcli simulate` follows the plan at torque level; fields as of a simulation's replay")
    ] = None


def acceleration_limits(spec: PlanFields, n: int) -> np.ndarray:
    """Joint acceleration limits (n) [rad/s2 or m/s2], infinite where none is given."""
    return np.full(n, np.inf) if spec.accelerations is None else np.array(spec.accelerations, dtype=np.float64)


def common_misfits(spec: PlanFields, planner: SpecModel) -> Iterator[tuple[tuple[str, ...], str]]:
    """What does not fit in a plan, whatever its robot: names that stand twice, a window beyond the last step."""
    for name in doubled_names(spec.scene):
        yield ("scene",), f"two obstacles are called {name!r}"
    window = getattr(planner, "window", None)
    if window is not None and window[1] > spec.steps:
        yield ("planner", "window"), f"ends at step {window[1]}; the path has {spec.steps}"


def plan_misfits(spec: PlanRun) -> Iterator[tuple[tuple[str, ...], str]]:
    """Where a plan does not fit its robot: the field's path, and what is wrong with it."""
    joints = [link.joint for link in spec.robot.links if link.joint.type != "fixed"]
    names = ", ".join(joint.name for joint in joints)
    for part, q in (("start", spec.start.q), ("goal", spec.goal.q)):
        if q is None:
            continue
        if len(q) != len(joints):
            yield (part, "q"), f"has {len(q)} values for {len(joints)} active joints ({names})"
            continue
        for joint, value in zip(joints, q, strict=True):
            low, high = joint.position or (-np.inf, np.inf)
            if not low <= value <= high:
                text = f"joint {joint.name!r} is {value:.4g}, outside its limits {low:.4g} to {high:.4g}"
                yield (part, "q"), text
    weights = getattr(spec.planner, "weights", None)
    if weights is not None and len(weights) != len(joints):
        yield ("planner", "weights"), f"has {len(weights)} values for {len(joints)} active joints ({names})"
    if spec.accelerations is not None and len(spec.accelerations) != len(joints):
        text = f"has {len(spec.accelerations)} values for {len(joints)} active joints ({names})"
        yield ("accelerations",), text
    elif spec.accelerations is not None and min(spec.accelerations) <= 0:
        yield ("accelerations",), "every acceleration must be above 0"
    for number in getattr(spec.planner, "joints", ()):
        if not 1 <= number <= len(joints):
            yield ("planner", "joints"), f"there is no joint {number}; the robot has {len(joints)}"
    for tip in spec.goal.tips:
        if tip not in spec.robot.tips:
            yield ("goal", "tips", tip), f"the robot has no tip {tip!r}; it has {', '.join(spec.robot.tips)}"
    yield from common_misfits(spec, spec.planner)
    if spec.duration == "fastest" and any(joint.speed is None for joint in joints):
        yield ("duration",), "is needed: not every joint of the robot has a speed limit"
