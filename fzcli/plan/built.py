"""What is built once a process for a robot, and serves all plans made with it: its model and Functions about it."""

import weakref
from collections.abc import Callable, Hashable
from typing import TypeVar

from fzcli.model import RobotModel, build_model
from fzcli.model.inverse.solve import InverseKinematics, build_inverse
from fzcli.model.planar_3rrr import build_planar_model
from fzcli.model.planar_body import PlanarBody, build_body
from fzcli.plan.inertial_goal import InertialGoal, build_inertial_goal
from fzcli.spec.hashing import spec_hash
from fzcli.spec.planar import Planar3RRR
from fzcli.spec.robot import Robot

MOST = 16  # models kept; the one built first goes first

Part = TypeVar("Part")
_MODELS: dict[str, RobotModel] = {}
_BODIES: dict[str, PlanarBody] = {}
_PARTS: dict[int, dict[Hashable, object]] = {}


def model_of(robot: Robot) -> RobotModel:
    """The model of a robot, the same one for equal robots."""
    key = spec_hash(robot)
    if key not in _MODELS:
        if len(_MODELS) >= MOST:
            del _MODELS[next(iter(_MODELS))]
        _MODELS[key] = build_model(robot)
    return _MODELS[key]


def planar_body_of(robot: Planar3RRR) -> PlanarBody:
    """A planar 3-RRR with its bodies, the same ones for equal robots. Raises SpecError where it has no solids."""
    key = spec_hash(robot)
    if key not in _BODIES:
        if len(_BODIES) >= MOST:
            del _BODIES[next(iter(_BODIES))]
        _BODIES[key] = build_body(build_planar_model(robot))
    return _BODIES[key]


def part_of(model: RobotModel, key: Hashable, build: Callable[[], Part]) -> Part:
    """What ``build`` makes for a model, made once under ``key`` and kept as long as the model lives."""
    if id(model) not in _PARTS:
        _PARTS[id(model)] = {}
        weakref.finalize(model, _PARTS.pop, id(model), None)
    parts = _PARTS[id(model)]
    if key not in parts:
        parts[key] = build()
    return parts[key]  # type: ignore[return-value]


def inverse_of(model: RobotModel, tip: str) -> InverseKinematics:
    """The inverse kinematics of a tip."""
    return part_of(model, ("inverse", tip), lambda: build_inverse(model, tip))


def goal_solver_of(model: RobotModel, tips: tuple[str, ...]) -> InertialGoal:
    """The solver of final joints for the poses of tips in the world."""
    return part_of(model, ("goal", tips), lambda: build_inertial_goal(model, tips))
