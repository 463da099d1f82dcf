"""Random scenes to plan in: a start, a goal, and obstacles in the way; the same for all configurations of a sweep."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.built import model_of
from fzcli.plan.joint_path import JointPath
from fzcli.plan.plan_spec import PlanGoal, PlanRun
from fzcli.plan.planning import planned_robot
from fzcli.plan.scene import Obstacle, build_scene
from fzcli.plan.world import World, build_world
from fzcli.sweep.scene_spec import SceneDraw

Array = NDArray[np.float64]
MIDDLE = (0.25, 0.75)  # of the path's time: where obstacles stand
LOOKED_AT = 201  # samples of the straight path
JOINTS = (-np.pi, np.pi)  # rad or m: within which joints without limits are drawn


def draw_scene(spec: PlanRun, draw: SceneDraw, random: np.random.Generator) -> dict[str, Any] | None:
    """Fields of a run, ``start``, ``goal`` and ``scene``, for the first candidate that fits; None where none does."""
    model = model_of(planned_robot(spec))
    low, high = model.tree.position_limits.T
    low, high = np.where(np.isfinite(low), low, JOINTS[0]), np.where(np.isfinite(high), high, JOINTS[1])
    base = spec.start.base_position, spec.start.base_quat
    empty = build_world(model, build_scene(()), *base)
    for _ in range(draw.most):
        start, goal = random.uniform(low, high), random.uniform(low, high)
        path = JointPath(start, goal - start, 1.0)
        tips = _tips(empty, path, random.uniform(*MIDDLE, random.integers(draw.count[0], draw.count[1] + 1)))
        drawn = [_obstacle(draw, tip, random) for tip in tips]
        obstacles = tuple(sorted(drawn, key=lambda one: one.kind, reverse=True))  # fewer kinds of scenes to build for
        world = build_world(model, build_scene((*spec.scene, *obstacles)), *base)
        apart = world.distances(path, np.linspace(0.0, 1.0, LOOKED_AT)).min(axis=1)
        if min(apart[0], apart[-1]) >= spec.margin > apart.min():
            begin = spec.start.model_copy(update={"q": tuple(start.tolist())})
            return {"start": begin, "goal": _goal(world, path, draw), "scene": (*spec.scene, *obstacles)}
    return None


def _tips(world: World, path: JointPath, times: Array) -> Array:
    """Where the tip is (T, 3) [m], world, at times (T)."""
    return np.array([_tip(world, path, time)[0] for time in times])


def _tip(world: World, path: JointPath, time: float) -> tuple[Array, Array]:
    """Position (3) [m] and rotation (3, 3) of the first tip in the world."""
    q, model = path.at(time)[0][0], world.model
    (place,), (quat,) = world.base(path, np.array([time]))
    position, turn = (np.array(part) for part in model.forward_kinematics(q, quat))
    origin = place + np.array(model.com(q, quat)).ravel() if model.floating else place
    return origin + position.ravel(), turn


def _obstacle(draw: SceneDraw, tip: Array, random: np.random.Generator) -> Obstacle:
    center = tuple((tip + random.normal(0.0, draw.spread, 3)).tolist())
    if draw.panel is None or random.random() < 0.5:
        return Obstacle.model_validate({"sphere": {"center": center, "radius": random.uniform(*draw.radius)}})
    size, turn = random.uniform(*draw.panel), random.uniform(-np.pi, np.pi, 3)
    return Obstacle.model_validate({"box": {"center": center, "rpy": tuple(turn), "size": tuple(size)}})


def _goal(world: World, path: JointPath, draw: SceneDraw) -> PlanGoal:
    if draw.goal == "joints":
        return PlanGoal(q=tuple(path.goal.tolist()), tips={})
    from scipy.spatial.transform import Rotation

    position, turn = _tip(world, path, path.duration)
    rpy = Rotation.from_matrix(turn).as_euler("xyz")
    return PlanGoal(position=tuple(position.tolist()), rpy=tuple(rpy.tolist()), tips={})
