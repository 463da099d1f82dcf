"""From a plan's specification to a path: where it starts and ends, and which planner leads there."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import FzcliError, Problem, SpecError
from fzcli.plan.built import goal_solver_of, inverse_of, model_of
from fzcli.plan.detour_planner import Attempt
from fzcli.plan.inertial_goal import Departure, InertialEnd, inertial_goals
from fzcli.plan.joint_path import JointPath
from fzcli.plan.neural_goal import NeuralGoal, neural_goal
from fzcli.plan.plan_spec import PlanRun, PoseGoal
from fzcli.plan.planar_spec import PlanarRun
from fzcli.plan.planners import stages_of
from fzcli.plan.quaternions import rotations
from fzcli.plan.scene import build_scene
from fzcli.plan.task import MET, AnyTask, Task, rotation_of
from fzcli.plan.world import World, build_world
from fzcli.spec.robot import Robot
from fzcli.spec.tool import with_tool

__all__ = ["AnyTask", "NoPlanError", "Task", "planned_robot", "prepare", "solve"]

Array = NDArray[np.float64]
MOST_GOALS = 8  # final postures that are planned for, the nearest first
DEEP = 0.02  # m: of contact at a goal on a free base, from where on it is refused


class NoPlanError(FzcliError):
    """No path was found that keeps clear; says what was tried."""


def planned_robot(spec: PlanRun) -> Robot:
    """The robot of a plan with its tool, and with its base held if it is to be."""
    robot = spec.robot if spec.tool is None else with_tool(spec.robot, spec.tool)
    if not spec.hold_base:
        return robot
    return robot.model_copy(update={"base": robot.base.model_copy(update={"floating": False})})


def prepare(spec: PlanRun) -> Task:
    """Check start and goal, and find the final postures.

    Raises SpecError: the start or every goal is in contact, a pose is out of reach or beyond the joint limits.
    """
    model = model_of(planned_robot(spec))
    world = build_world(model, build_scene(spec.scene), spec.start.base_position, spec.start.base_quat)
    start = np.array(spec.start.q, dtype=np.float64)
    task = Task(spec, world, start, ())
    task = replace(task, neural=_asked_networks(task))
    task = replace(task, goals=tuple(_goals(task)))
    problems = list(_contacts(task))
    if problems:
        raise SpecError(problems)
    return task


def _contacts(task: Task) -> Iterator[Problem]:
    """Start or goals nearer than the margin to something: told with the pair and the distance."""
    margin, world = task.spec.margin, task.world
    text = _too_near(world, task.nominal(task.start), 0.0, margin)
    if text:
        yield Problem(f"the start is {text}", field="start.q")
    # on a free base detours move the end of the path a little: only what is hopeless is refused
    least = min(margin, -DEEP) if world.model.floating else margin
    paths = [task.nominal(goal) for goal in task.goals]
    texts = [_too_near(world, path, path.duration, least) for path in paths]
    if texts and all(texts):
        field = "goal.q" if task.spec.goal.q is not None else "goal"
        when = f" at {paths[0].duration:.4g} s, when the arm gets there" if world.scene.moving else ""
        yield Problem(f"the goal is {texts[0]}{when}", field=field)


def _too_near(world: World, path: JointPath, time: float, margin: float) -> str:
    distances = world.distances(path, np.array([time]))[0]
    if not len(distances) or distances.min() >= margin:
        return ""
    worst = int(distances.argmin())
    pair = world.clearance.pairs[worst]
    if distances[worst] < 0:
        return f"in contact: {pair} overlap by {-1e3 * distances[worst]:.3g} mm"
    return f"within the margin: {pair} are {1e3 * distances[worst]:.3g} mm apart, {1e3 * margin:g} mm are asked for"


def _asked_networks(task: Task) -> NeuralGoal | None:
    goal = task.spec.goal
    if goal.position is None or goal.rpy is None:
        return None
    position, turn = _seen(task, PoseGoal(position=goal.position, rpy=goal.rpy))
    return neural_goal(task.spec, task.model, position, np.asarray(turn), task.start)


def _goals(task: Task) -> list[Array]:
    goal = task.spec.goal
    if goal.q is not None:
        return [np.array(goal.q, dtype=np.float64)]
    if task.neural is not None and task.neural.solutions:
        return [one.q for one in task.neural.solutions[:MOST_GOALS]]
    first = task.model.tips[0]
    poses = goal.tips or {first: PoseGoal(position=goal.position or (0.0, 0.0, 0.0), rpy=goal.rpy)}
    return _floating_goals(task, poses) if task.model.floating else _fixed_goals(task, poses)


def _fixed_goals(task: Task, poses: dict[str, PoseGoal]) -> list[Array]:
    """Final postures on a base that stands still, nearest first; of several tips, each tip's nearest one."""
    postures = [task.start]
    for tip, pose in poses.items():
        inverse = inverse_of(task.model, tip)
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
    if past <= 0:
        text = f"tip {tip!r} would meet it from where the base stands, but no final joints do on the base that turns"
        return Problem(text, field=field)
    return Problem(
        f"tip {tip!r} meets it only beyond the joint limits, by {np.rad2deg(past):.3g} deg at least", field=field
    )


def _seen(task: Task, pose: PoseGoal) -> tuple[Array, Array | None]:
    """A pose in the world from the base at the start."""
    R = rotations(task.world.base_quat)
    position = R.T @ (np.array(pose.position) - task.world.base_position)
    return position, None if pose.rpy is None else R.T @ rotation_of(pose)


def _floating_goals(task: Task, poses: dict[str, PoseGoal]) -> list[Array]:
    """Final postures at which the straight path leads the tips to their poses in the world, the base turning."""
    for tip, pose in poses.items():
        if pose.rpy is None:
            text = "rpy is needed: on a free base the whole pose of a tip is met"
            raise SpecError(Problem(text, field=f"goal.tips.{tip}.rpy" if task.spec.goal.tips else "goal.rpy"))
    departure = Departure(task.start, task.world.base_quat, task.world.base_position)
    solver = goal_solver_of(task.model, tuple(poses))
    if len(poses) == 1:
        (tip, pose), = poses.items()
        inverse = inverse_of(task.model, tip)
        ends = inertial_goals(solver, inverse, departure, (np.array(pose.position), rotation_of(pose)))
        if not ends:
            raise SpecError(_unreachable(task, inverse.branches(*_seen(task, pose), near=task.start), tip))
        return [end.q for end in ends[:MOST_GOALS]]
    targets = [(np.array(pose.position), rotation_of(pose)) for pose in poses.values()]
    end: InertialEnd = solver.solve(departure, targets, _guess(task, poses))
    if end.error > MET:
        missing = f"{1e3 * end.distance:.4g} mm and {np.rad2deg(end.angle):.3g} deg missing"
        raise SpecError(Problem(f"not met on the free base: {missing}", field="goal.tips"))
    low, high = task.model.tree.position_limits.T
    past = np.maximum(low - end.q, end.q - high)
    if past.max() > MET:
        joint = task.model.joint_names[int(past.argmax())]
        text = f"met only with joint {joint!r} {np.rad2deg(past.max()):.3g} deg beyond its limits"
        raise SpecError(Problem(text, field="goal.tips"))
    return [end.q]


def _guess(task: Task, poses: dict[str, PoseGoal]) -> Array:
    """Every tip's posture with the base where it starts, limits left aside: the nearest of those that meet its pose."""
    q = task.start
    for tip, pose in poses.items():
        found = inverse_of(task.model, tip).branches(*_seen(task, pose), near=q)
        good = [one for one in found if one.distance + one.angle <= MET] or found[:1]
        near, joints = q, task.model.carriers(tip)
        best = min(good, key=lambda one: float(np.square(one.q - near).sum()))
        q = q.copy()
        q[joints] = best.q[joints]
    return q


def solve(task: AnyTask) -> Attempt:
    """The first path that keeps clear: stage after stage of the planner, each over the goals in their order.

    Raises NoPlanError when none is found, saying what was tried.
    """
    tried: list[str] = []
    for stage in stages_of(task.spec):
        tried.append(stage.about)
        for goal in task.goals[: stage.goals]:
            attempt = task.find(stage, goal)
            if attempt is not None:
                return attempt
    goals = f"{len(task.goals)} final posture{'s' if len(task.goals) > 1 else ''}"
    aside = " and off singularities" if isinstance(task.spec, PlanarRun) else ""
    clear = f"no path keeps {1e3 * task.spec.margin:g} mm clear{aside}"
    raise NoPlanError(f"{clear} for {goals}; tried: {'; '.join(tried)}")
