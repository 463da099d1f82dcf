"""From a plan's specification to a path: where it starts and ends, and which planner leads there."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import FzcliError, Problem, SpecError
from fzcli.model import RobotModel, build_model
from fzcli.model.inverse.solve import build_inverse
from fzcli.plan.detour_planner import Attempt, keeps, stretched
from fzcli.plan.inertial_goal import Departure, InertialEnd, PathLaw, build_inertial_goal, inertial_goals, path_law
from fzcli.plan.joint_path import JointPath, fastest, law_values
from fzcli.plan.plan_spec import PlanRun, PoseGoal
from fzcli.plan.planners import PLANNERS
from fzcli.plan.scene import build_scene
from fzcli.plan.world import World, build_world, rotation
from fzcli.spec.tool import with_tool

Array = NDArray[np.float64]
MOST_GOALS = 8  # final postures that are planned for, the nearest first
MET = 1e-6  # m and rad: a pose that is met
GOAL_PIECES = 64  # of a path with detours, for the base's attitude at its end


class NoPlanError(FzcliError):
    """No path was found that keeps clear; says what was tried."""


@dataclass(frozen=True)
class Task:
    """A plan to be made: ``goals``, final postures (n) in the order in which they are tried."""

    spec: PlanRun
    world: World
    start: Array
    goals: tuple[Array, ...]

    @property
    def model(self) -> RobotModel:
        """Of the robot with its tool."""
        return self.world.model

    @property
    def speeds(self) -> Array:
        """Joint speed limits (n), infinite where none is stated."""
        return self.model.tree.speed_limits

    def nominal(self, goal: Array) -> JointPath:
        """The straight joint path to a final posture in the duration that is asked for."""
        way = goal - self.start
        shortest = fastest(self.start, goal, self.speeds, np.full(len(way), np.inf), self.spec.law)
        if self.spec.duration == "fastest":
            return JointPath(self.start, way, max(shortest * (1 + 1e-9), 1e-3), self.spec.law)
        duration = max(self.spec.duration, shortest * (1 + 1e-9)) if self.spec.stretch else self.spec.duration
        return JointPath(self.start, way, duration, self.spec.law)


def prepare(spec: PlanRun) -> Task:
    """Check start and goal, and find the final postures.

    Raises SpecError: the start or every goal is in contact, a pose is out of reach or beyond the joint limits.
    """
    robot = spec.robot if spec.tool is None else with_tool(spec.robot, spec.tool)
    model = build_model(robot)
    world = build_world(model, build_scene(spec.scene), spec.start.base_position, spec.start.base_quat)
    start = np.array(spec.start.q, dtype=np.float64)
    task = Task(spec, world, start, ())
    task = replace(task, goals=tuple(_goals(task)))
    problems = list(_contacts(task))
    if problems:
        raise SpecError(problems)
    return task


def _contacts(task: Task) -> Iterator[Problem]:
    """Start or goals nearer than the margin to something: told with the pair and the distance."""
    margin, spec = task.spec.margin, task.spec
    text = _too_near(task, task.start[None, :], np.zeros(1), margin)
    if text:
        yield Problem(f"the start is {text}", field="start.q")
    if not task.world.model.floating:
        texts = []
        for goal in task.goals:
            end = np.array([task.nominal(goal).duration])
            texts.append(_too_near(task, goal[None, :], end, margin))
        if texts and all(texts):
            field = "goal.q" if spec.goal.q is not None else "goal"
            yield Problem(f"the goal is {texts[0]}", field=field)


def _too_near(task: Task, q: Array, time: Array, margin: float) -> str:
    world = task.world
    distances = world.clearance.at(q, world.scene.numbers(time), world.base_position, world.base_quat)[0]
    if not len(distances) or distances.min() >= margin:
        return ""
    worst = int(distances.argmin())
    pair = world.clearance.pairs[worst]
    if distances[worst] < 0:
        return f"in contact: {pair} overlap by {-1e3 * distances[worst]:.3g} mm"
    return f"within the margin: {pair} are {1e3 * distances[worst]:.3g} mm apart, {1e3 * margin:g} mm are asked for"


def _goals(task: Task) -> list[Array]:
    goal = task.spec.goal
    if goal.q is not None:
        return [np.array(goal.q, dtype=np.float64)]
    first = task.model.tips[0]
    poses = goal.tips or {first: PoseGoal(position=goal.position or (0.0, 0.0, 0.0), rpy=goal.rpy)}
    return _floating_goals(task, poses) if task.model.floating else _fixed_goals(task, poses)


def _fixed_goals(task: Task, poses: dict[str, PoseGoal]) -> list[Array]:
    """Final postures on a base that stands still, nearest first; of several tips, each tip's nearest one."""
    postures = [task.start]
    for tip, pose in poses.items():
        inverse = build_inverse(task.model, tip)
        position, turn = _seen(task, pose)
        found = [one for q in postures for one in inverse.solve(position, turn, near=q, windings=len(poses) == 1)]
        if not found:
            raise SpecError(_unreachable(task, inverse.branches(position, turn, near=task.start), tip))
        postures = [one.q for one in found] if len(poses) == 1 else [found[0].q]
    return postures[:MOST_GOALS]


def _unreachable(task: Task, nearest: list, tip: str) -> Problem:  # type: ignore[type-arg]
    field = "goal.position" if task.spec.goal.position is not None else f"goal.tips.{tip}"
    best = nearest[0]
    if best.distance > MET or best.angle > MET:
        turn = f" and {np.rad2deg(best.angle):.3g} deg" if best.angle > MET else ""
        missing = f"{1e3 * best.distance:.4g} mm{turn}"
        return Problem(f"out of reach of tip {tip!r}: {missing} missing", field=field)
    past = min(one.excess for one in nearest if one.distance <= MET and one.angle <= MET)
    return Problem(
        f"tip {tip!r} meets it only beyond the joint limits, by {np.rad2deg(past):.3g} deg at least", field=field
    )


def _seen(task: Task, pose: PoseGoal) -> tuple[Array, Array | None]:
    """A pose in the world from the base at the start."""
    R = rotation(task.world.base_quat)
    position = R.T @ (np.array(pose.position) - task.world.base_position)
    return position, None if pose.rpy is None else R.T @ _rotation_of(pose)


def _rotation_of(pose: PoseGoal) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_euler("xyz", pose.rpy or (0.0, 0.0, 0.0)).as_matrix())


def _floating_goals(task: Task, poses: dict[str, PoseGoal]) -> list[Array]:
    """Final postures at which the straight path leads the tips to their poses in the world, the base turning."""
    for tip, pose in poses.items():
        if pose.rpy is None:
            text = "rpy is needed: on a free base the whole pose of a tip is met"
            raise SpecError(Problem(text, field=f"goal.tips.{tip}.rpy" if task.spec.goal.tips else "goal.rpy"))
    departure = Departure(task.start, task.world.base_quat, task.world.base_position)
    solver = build_inertial_goal(task.model, tuple(poses))
    if len(poses) == 1:
        (tip, pose), = poses.items()
        inverse = build_inverse(task.model, tip)
        ends = inertial_goals(solver, inverse, departure, (np.array(pose.position), _rotation_of(pose)))
        if not ends:
            raise SpecError(_unreachable(task, inverse.branches(*_seen(task, pose), near=task.start), tip))
        return [end.q for end in ends[:MOST_GOALS]]
    guess = _fixed_goals(task, poses)[0]
    targets = [(np.array(pose.position), _rotation_of(pose)) for pose in poses.values()]
    end: InertialEnd = solver.solve(departure, targets, guess)
    if end.error > MET:
        missing = f"{1e3 * end.distance:.4g} mm and {np.rad2deg(end.angle):.3g} deg missing"
        raise SpecError(Problem(f"not met on the free base: {missing}", field="goal.tips"))
    return [end.q]


def poses_of(task: Task) -> dict[str, tuple[Array, Array]]:
    """Position (3) and rotation (3, 3) in the world that each tip of the goal is to have; none for joint goals."""
    goal = task.spec.goal
    poses = dict(goal.tips)
    if goal.position is not None:
        poses[task.model.tips[0]] = PoseGoal(position=goal.position, rpy=goal.rpy)
    return {tip: (np.array(pose.position), _rotation_of(pose)) for tip, pose in poses.items()}


def meeting(task: Task, attempt: Attempt) -> Attempt | None:
    """The path with its final joints moved so that it meets the goal in the world in spite of its detours.

    The base's attitude at the end hangs on the whole path. None where the moved path does not keep clear.
    """
    path = attempt.path
    if not isinstance(path, JointPath):
        return None
    poses = poses_of(task)
    solver = build_inertial_goal(task.model, tuple(poses))
    departure = Departure(task.start, task.world.base_quat, task.world.base_position)
    end = solver.solve(departure, list(poses.values()), path.goal, _law_of(path))
    if end.error > MET:
        return None
    moved = replace(path, travel=end.q - path.start)
    moved = stretched(moved, task.speeds) if task.spec.stretch else moved
    clearance = keeps(task.world, moved, task.spec.margin)
    return None if clearance is None else replace(attempt, path=moved, clearance=clearance)


def _law_of(path: JointPath) -> PathLaw:
    """The path as the solver of final joints wants it: over s from 0 to 1."""

    def share(s: Array) -> tuple[Array, Array]:
        values = law_values(path.law, s)
        return values[0], values[1]

    def offset(s: Array) -> tuple[Array, Array]:
        found = np.zeros((2, len(path.start), len(s)))
        for detour in path.detours:
            place, rate, _ = detour.at(s * path.duration)
            found += np.array([place.T, rate.T * path.duration])
        return found[0], found[1]

    return path_law(len(path.start), share, offset, pieces=GOAL_PIECES)


def solve(task: Task) -> Attempt:
    """The first path that keeps clear, over the goals in their order.

    Raises NoPlanError when none is found, saying what was tried.
    """
    plan = PLANNERS[task.spec.planner.kind]
    tried: list[str] = []
    for goal in task.goals:
        attempt = plan(task.world, task.nominal(goal), task.spec, tried)
        if attempt is not None and task.model.floating and task.spec.goal.q is None:
            attempt = meeting(task, attempt)
            tried.append("final joints on the free base")
        if attempt is not None:
            return attempt
    goals = f"{len(task.goals)} final posture{'s' if len(task.goals) > 1 else ''}"
    what = "; ".join(dict.fromkeys(tried)) or "the straight joint path"
    raise NoPlanError(f"no path keeps {1e3 * task.spec.margin:g} mm clear for {goals}; tried: {what}")
