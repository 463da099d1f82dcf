"""What a plan file says whose robot is a planar 3-RRR."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, WithJsonSchema, model_validator

from fzcli.model.planar_3rrr import JOINTS, MODES
from fzcli.plan.plan_spec import DetourFields, PlanFields, PlanRun
from fzcli.plan.scene import Obstacle
from fzcli.spec.any_robot import load_any_robot
from fzcli.spec.base import SpecModel
from fzcli.spec.nearest import hint
from fzcli.spec.planar import Planar3RRR
from fzcli.spec.references import BESIDE
from fzcli.spec.shapes import CapsuleShape
from fzcli.spec.units import Angle, Length

Steps = tuple[str | int, ...]
BRANCHES: tuple[str, ...] = tuple(f"{mode} det{sign}" for mode in MODES for sign in "+-")
FOREIGN = {
    "tool": "a planar_3rrr carries no tool",
    "hold_base": "the base of a planar_3rrr stands still",
    "ik": "the inverse kinematics of a planar_3rrr are closed and exact",
}  # fields of other plans


def _robot(value: Any, info: ValidationInfo) -> Any:
    return load_any_robot(value, (info.context or {}).get(BESIDE)) if isinstance(value, str) else value


def _branch(name: str) -> str:
    if name not in (*BRANCHES, *MODES):
        known = hint(name, BRANCHES, "such as '+++' or")
        raise ValueError(f"must be a working mode, with the sign of det A where that is needed, got {name!r}{known}")
    return name


class PlanarEnd(SpecModel):
    """Where a path of a planar 3-RRR starts or ends, at rest: a pose of its platform, or angles of its drives."""

    pose: Annotated[
        tuple[Length, Length, Angle] | None, Field(description="x, y and angle of the platform, base frame")
    ] = None
    q: Annotated[tuple[Angle, Angle, Angle] | None, Field(description="angles of the driven joints")] = None

    @model_validator(mode="after")
    def _one(self) -> "PlanarEnd":
        if (self.pose is None) == (self.q is None):
            raise ValueError("needs one of pose and q" + (", has both" if self.q else ""))
        return self


class PlanarDetourSpec(DetourFields):
    """Least half-cycloidal detours by optimisation, then what ``fallbacks`` name, in their order."""

    fallbacks: Annotated[
        tuple[Literal["three_detours"], ...], Field(description="tried where one detour does not do")
    ] = ("three_detours",)


class PlanarRun(PlanFields):
    """One plan of a planar 3-RRR, which keeps its branch: its working mode and the sign of det A."""

    robot: Annotated[
        Planar3RRR, BeforeValidator(_robot), WithJsonSchema({"type": "string", "description": "a name or a path"})
    ]
    branch: Annotated[
        str | None,
        AfterValidator(_branch),
        Field(description="working mode, such as '+-+', and sign of det A, such as '+-+ det-', where it is not unique"),
    ] = None
    start: PlanarEnd
    goal: PlanarEnd
    off_singular: Annotated[
        float,
        Field(gt=0, description="least sine of the elbows, and least |det A|; unit: distal link cubed times radius"),
    ] = 0.1
    planner: PlanarDetourSpec = PlanarDetourSpec()


AnyRun = PlanRun | PlanarRun


def planar_misfits(spec: PlanarRun) -> Iterator[tuple[Steps, str]]:
    """Where a plan does not fit its robot: the field's path, and what is wrong with it."""
    drives = spec.robot.drives
    low, high = drives.position or (-np.inf, np.inf)
    for part, end in (("start", spec.start), ("goal", spec.goal)):
        for i, value in enumerate(end.q or ()):
            if not low <= value <= high:
                text = f"{JOINTS[i]} is {value:.4g}, outside its limits {low:.4g} to {high:.4g}"
                yield (part, "q", i), text
    for path, numbers in ((("planner", "weights"), spec.planner.weights), (("accelerations",), spec.accelerations)):
        if numbers is not None and len(numbers) != len(JOINTS):
            yield path, f"has {len(numbers)} values for 3 driven joints ({', '.join(JOINTS)})"
        elif path == ("accelerations",) and numbers is not None and min(numbers) <= 0:
            yield path, "every acceleration must be above 0"
    if spec.duration == "fastest" and drives.speed is None:
        yield ("duration",), "is needed: the robot's drives have no speed limit"
    named = [one.name for one in spec.scene if one.name]
    for name in {name for name in named if named.count(name) > 1}:
        yield ("scene",), f"two obstacles are called {name!r}"
    for i, one in enumerate(spec.scene):
        text = _off_plane(one)
        if text:
            yield ("scene", i), text


def _off_plane(one: Obstacle) -> str:
    """Why an obstacle does not suit a robot that lives in the plane z = 0."""
    if one.kind == "box":
        return "a planar_3rrr goes round spheres and capsules; write the box as capsules"
    solid = one.solid
    points = [solid.start, solid.end] if isinstance(solid, CapsuleShape) else [one.middle]
    heights = [point[2] for point in points] + [one.velocity[2], *one.spin[:2]]
    heights += [place[2] for place in one.waypoints.positions] if one.waypoints else []
    return "must lie and move in the plane z = 0 of a planar_3rrr, and turn about z" if any(heights) else ""
