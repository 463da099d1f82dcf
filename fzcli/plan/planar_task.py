"""From the plan of a planar 3-RRR as written to a task: where it starts and ends, and on which branch it stays."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import Problem, SpecError
from fzcli.model.planar_3rrr import JOINTS, MODES, Planar3RRRModel
from fzcli.plan.built import planar_body_of
from fzcli.plan.continuous import PathClearance
from fzcli.plan.detour_planner import CERTIFIED, Attempt
from fzcli.plan.joint_path import JointPath
from fzcli.plan.plan_spec import acceleration_limits
from fzcli.plan.planar_spec import AnyRun, PlanarEnd, PlanarRun
from fzcli.plan.planar_world import PlanarWorld, build_planar_world
from fzcli.plan.planners import Stage
from fzcli.plan.scene import Obstacle, Scene, build_scene
from fzcli.plan.task import nominal_path
from fzcli.plan.world import Path
from fzcli.spec.shapes import CapsuleShape

Array = NDArray[np.float64]
MEASURES = (*(f"the sine of leg {i}'s elbow" for i in (1, 2, 3)), "|det A|")


@dataclass(frozen=True)
class Assembly:
    """The robot put together: joint angles ``theta`` (3) [rad], ``pose`` (3) of the platform, and its branch."""

    theta: Array
    pose: Array
    branch: str


@dataclass(frozen=True)
class PlanarTask:
    """A plan to be made: from ``start`` to ``goal``, on one branch. See `fzcli.plan.planning.Task`."""

    spec: PlanarRun
    world: PlanarWorld
    first: Assembly
    goal: Assembly

    @property
    def goals(self) -> tuple[Array, ...]:
        """The one final posture (3)."""
        return (self.goal.theta,)

    @property
    def speeds(self) -> Array:
        """Joint speed limits (3), infinite where none is stated."""
        return self.world.model.tree.speed_limits

    @property
    def accelerations(self) -> Array:
        """Joint acceleration limits (3), infinite where none is given."""
        return acceleration_limits(self.spec, self.world.model.n)

    def nominal(self, goal: Array) -> JointPath:
        """The straight joint path to a final posture in the duration that is asked for."""
        return nominal_path(self.spec, self.first.theta, goal, (self.speeds, self.accelerations))

    def find(self, stage: Stage, goal: Array) -> Attempt | None:
        """A path that keeps clear of obstacles and singularities, by one stage of the planner."""
        return stage.find(self.world, self.nominal(goal), self.spec)

    def among(self, spec: AnyRun, scene: Scene) -> "PlanarTask":
        """The same start and goal among other obstacles, as another spec says them. Raises TypeError for its kind."""
        if not isinstance(spec, PlanarRun):
            raise TypeError("the plan of another kind of robot")
        return replace(self, spec=spec, world=self.world.among(scene))

    def judged(self, path: Path) -> PathClearance:
        """The certified clearance of a path from obstacles."""
        return self.world.certified_parts(path, CERTIFIED)[0]


def prepare_planar(spec: PlanarRun) -> PlanarTask:
    """Check start and goal.

    Raises SpecError: out of reach, on another branch, near a singularity, in contact, or beyond the joint limits.
    """
    body = planar_body_of(spec.robot)
    first = _start(spec, body.model)
    world = build_planar_world(
        body, build_scene(spec.scene), first.theta, first.pose, spec.margin, spec.off_singular
    )
    task = PlanarTask(spec, world, first, first)
    task = replace(task, goal=_goal(spec, task))
    problems = list(_problems(task))
    if problems:
        raise SpecError(problems)
    return task


def assemblies(model: Planar3RRRModel, end: PlanarEnd) -> list[Assembly]:
    """All ways in which the robot can be put together at a pose or at joint angles. Raises SpecError: out of reach."""
    if end.q is not None:
        poses = model.forward(end.q)
        thetas = np.tile(np.array(end.q, dtype=float), (len(poses), 1))
    else:
        thetas = model.inverse(end.pose)
        poses = np.tile(np.array(end.pose, dtype=float), (len(thetas), 1))
    labels = model.labels(poses, thetas) if len(poses) else []
    if end.pose is not None:
        labels = [(mode, sign) for mode, (_, sign) in zip(MODES, labels, strict=True)]
    return [
        Assembly(theta, pose, f"{mode} det{'+' if sign > 0 else '-'}")
        for theta, pose, (mode, sign) in zip(thetas, poses, labels, strict=True)
    ]


def _start(spec: PlanarRun, model: Planar3RRRModel) -> Assembly:
    field = "start.pose" if spec.start.pose is not None else "start.q"
    found = _assembled(model, spec.start, field)
    chosen = [one for one in found if spec.branch is None or one.branch.startswith(spec.branch)]
    if len(chosen) == 1:
        return replace(chosen[0], theta=_wound(model, chosen[0].theta, chosen[0].theta, field))
    branches = ", ".join(f"'{one.branch}'" for one in found)
    if not chosen:
        text = f"there is no {spec.branch!r} at the start, which can be on {branches}"
        raise SpecError(Problem(text, field="branch"))
    if spec.branch is None:
        raise SpecError(Problem(f"branch is needed: the start can be on {branches}", field=field))
    poses = " or ".join(f"({x:.4g} m, {y:.4g} m, {angle:.4g} rad)" for x, y, angle in (one.pose for one in chosen))
    raise SpecError(Problem(f"{spec.branch!r} does not say which pose: {poses}; give the pose", field=field))


def _goal(spec: PlanarRun, task: PlanarTask) -> Assembly:
    """The goal on the start's branch; of several assemblies at joint angles the one nearest to the start's pose."""
    model, field = task.world.body.model, "goal.pose" if spec.goal.pose is not None else "goal.q"
    own, found = task.first.branch, _assembled(model, spec.goal, field)
    chosen = [one for one in found if one.branch == own]
    if chosen:
        best = min(chosen, key=lambda one: float(np.square(one.pose - task.first.pose).sum()))
        wound = best.theta if spec.goal.q is not None else _wound(model, best.theta, task.first.theta, field)
        return replace(best, theta=wound)
    mode = [one.branch for one in found if one.branch[:3] == own[:3]]
    every = ", ".join(sorted({f"'{one.branch}'" for one in found}))
    there = f"is on '{mode[0]}' there" if len(mode) == 1 else f"can be on {every} there"
    text = f"the start is on {own!r}, and the robot {there}: every path between them crosses a singularity"
    raise SpecError(Problem(text, field=field))


def _assembled(model: Planar3RRRModel, end: PlanarEnd, field: str) -> list[Assembly]:
    try:
        found = assemblies(model, end)
    except SpecError as error:
        raise SpecError([Problem(f"out of reach: {one.message}", field=field) for one in error.problems]) from None
    if not found:
        raise SpecError(Problem("the robot cannot be put together at these joint angles", field=field))
    return found


def _wound(model: Planar3RRRModel, theta: Array, near: Array, field: str) -> Array:
    """The same angles by whole turns, within the limits, nearest to others. Raises SpecError where there are none."""
    low, high = model.limits.T
    turns = 2 * np.pi * np.arange(-3, 4)
    found = np.zeros(3)
    for i in range(3):
        nearest = theta[i] + 2 * np.pi * np.round((near[i] - theta[i]) / (2 * np.pi))
        able = [value for value in nearest + turns if low[i] <= value <= high[i]]
        if not able:
            text = f"{JOINTS[i]} would be {nearest:.4g}, outside its limits {low[i]:.4g} to {high[i]:.4g}"
            raise SpecError(Problem(text, field=field))
        found[i] = min(able, key=lambda value: abs(value - nearest))
    return found


def _problems(task: PlanarTask) -> Iterator[Problem]:
    """Start or goal in contact, nearer to an obstacle than the margin, or near a singularity."""
    spec, world = task.spec, task.world
    nominal = task.nominal(task.goal.theta)
    ends = (("start", task.first, 0.0, spec.start), ("goal", task.goal, nominal.duration, spec.goal))
    for name, one, time, end in ends:
        field = f"{name}.pose" if end.pose is not None else f"{name}.q"
        measures = world.measures(one.pose[None], one.theta[None])[0]
        if measures.min() < spec.off_singular:
            what, value = MEASURES[int(measures.argmin())], float(measures.min())
            asked = f"off_singular asks for {spec.off_singular:g}"
            yield Problem(f"the {name} is near a singularity: {what} is {value:.3g}, {asked}", field=field)
        when = f" at {time:.4g} s, when the robot gets there" if time > 0 and world.scene.moving else ""
        text = _too_near(world, one, time, spec.margin)
        if text:
            yield Problem(f"the {name} is {text}{when}", field=field)


def _too_near(world: PlanarWorld, one: Assembly, time: float, margin: float) -> str:
    pairs = world.clearance.scene.pairs
    inside = [each.name for each in world.scene.named if _within(world, one, each, time)]
    if inside:
        return f"in contact: {inside[0]} stands inside the platform"
    found = world.columns(one.theta[None], one.pose[None], np.array([time]))[0, : len(pairs)]
    if not len(pairs) or found.min() >= margin:
        return ""
    worst = int(found.argmin())
    if found[worst] < 0:
        return f"in contact: {pairs[worst]} overlap by {-1e3 * found[worst]:.3g} mm"
    apart, asked = 1e3 * found[worst], 1e3 * margin
    return f"within the margin: {pairs[worst]} are {apart:.3g} mm apart, {asked:g} mm are asked for"


def _within(world: PlanarWorld, one: Assembly, obstacle: Obstacle, time: float) -> bool:
    """Whether an obstacle's middle lies within the platform's sides, out of touch with all of them."""
    corners = np.array(world.body.model.function("points")(one.pose, one.theta)[1]).T
    numbers = obstacle.numbers([time])[0]
    point = 0.5 * (numbers[:2] + numbers[3:5]) if isinstance(obstacle.solid, CapsuleShape) else numbers[:2]
    sides = np.roll(corners, -1, axis=0) - corners
    ways = point - corners
    turns = sides[:, 0] * ways[:, 1] - sides[:, 1] * ways[:, 0]
    return bool((turns > 0).all() or (turns < 0).all())
