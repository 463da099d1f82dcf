"""Final joints of a free-floating arm: its tip at an inertial pose on the true plant, whatever the path."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

import fzcli
from fzcli.errors import SpecError
from fzcli.model import RobotModel
from fzcli.model.gauss_magnus import path_piece
from fzcli.model.inverse import build_inverse
from fzcli.plan.inertial_goal import (
    Departure,
    InertialGoal,
    PathLaw,
    build_inertial_goal,
    inertial_goals,
    path_law,
)
from fzcli.spec.tool import Tool, with_tool
from tests.oracle.numpy_reference import NumpyReference, quat_exp, quat_multiply, rotation_from_quat, rotation_vector

Array = NDArray[np.float64]
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
START, GOAL = np.deg2rad([-60.0, 20.0, 100.0, 0.0, 40.0, 0.0]), np.deg2rad([60.0, 40.0, 80.0, 0.0, 60.0, 0.0])
NEARER = np.deg2rad([20.0, 0.0, 120.0, 10.0, 50.0, 0.0])  # GOAL's pose drifts out of reach on the free base


@cache
def _model(name: str) -> RobotModel:
    robot = fzcli.load_robot(name)
    return fzcli.build_model(with_tool(robot, Tool(xyz=(0.0, 0.0, 0.1))) if name.startswith("melfa") else robot)


@cache
def _goal(name: str) -> InertialGoal:
    return build_inertial_goal(_model(name))


def _ridden(reference: NumpyReference, departure: Departure, path: Array) -> tuple[Array, Array, Array]:
    """Base attitude, and tip pose in the world, after a path (k, n) of joints, by the oracle's momentum alone."""
    quat = departure.base_quat
    for before, after in pairwise(path):
        quat = quat_multiply(quat, quat_exp(_turn(reference, 0.5 * (before + after), after - before)))
    com = departure.base_position + reference.com(departure.q, departure.base_quat)
    position, rotation = reference.forward_kinematics(path[-1], quat)
    return quat, position + com, rotation


def _turn(reference: NumpyReference, q: Array, way: Array) -> Array:
    """The base's turn, base axes, for a short way of the joints at zero momentum."""
    inertia = reference.system_inertia(q, UPRIGHT)
    return -np.linalg.solve(inertia, reference.joint_angular_momentum(q, UPRIGHT) @ way)


def _line(start: Array, goal: Array, pieces: int) -> Array:
    return np.asarray(start + np.linspace(0, 1, pieces + 1)[:, None] * (goal - start))


def test_the_nominal_free_floating_case() -> None:
    """The base turns 9.1257 deg and the tip ends where the prototype's did; a fixed base's tip elsewhere."""
    model, goal = _model("melfa_free_flyer"), _goal("melfa_free_flyer")
    departure = Departure(START)
    fixed = np.array(fzcli.build_model(model.robot).function("arm")(GOAL))[:, -1]
    np.testing.assert_allclose(fixed, [0.17213, 0.29814, 0.31745], atol=6e-6)
    far = np.array([0.17620, 0.16611, 0.35614])
    end = goal.solve(departure, [(far, np.eye(3))], GOAL, steps=0)
    assert np.rad2deg(2 * np.arccos(abs(end.base_quat[0]))) == pytest.approx(9.1257, abs=1e-4)
    assert end.distance < 1e-5


def test_the_tip_meets_the_pose_where_the_fixed_base_plan_would_have_put_it() -> None:
    model, goal = _model("melfa_free_flyer"), _goal("melfa_free_flyer")
    reference, place = NumpyReference(model.robot), np.array([0.3, -0.2, 0.5])
    departure = Departure(START, quat_exp(np.array([0.2, -0.1, 0.4])), place)
    R0 = rotation_from_quat(departure.base_quat)
    at_rest = reference.forward_kinematics(NEARER, UPRIGHT)
    position = R0 @ (at_rest[0] + reference.com(NEARER, UPRIGHT)) + place
    rotation = R0 @ at_rest[1]
    end = goal.solve(departure, [(position, rotation)], NEARER)
    assert end.error < 1e-9
    assert end.steps <= 5
    quat, reached, turned = _ridden(reference, departure, _line(START, end.q, 1000))
    assert np.linalg.norm(reached - position) < 1e-6
    assert np.linalg.norm(rotation_vector(turned.T @ rotation)) < 1e-6
    assert abs(quat @ end.base_quat) == pytest.approx(1, abs=1e-12)
    com = place + reference.com(START, departure.base_quat)
    np.testing.assert_allclose(end.base_position, com - reference.com(end.q, quat), atol=1e-6)


def test_poses_that_straight_paths_reach_are_found() -> None:
    """Of the UR5, joints moved by up to 60 deg, which turns its base by tens of degrees."""
    model, goal = _model("ur5_free_flyer"), _goal("ur5_free_flyer")
    inverse, piece, rng = build_inverse(model), path_piece(_model("ur5_free_flyer")), np.random.default_rng(2)
    reference, steps = NumpyReference(model.robot), []
    own = 0
    for _ in range(15):
        start = rng.uniform(-2, 2, 6)
        wanted = start + rng.uniform(-1.0, 1.0, 6)
        departure = Departure(start, quat_exp(rng.normal(size=3)), rng.normal(size=3))
        quat, q = departure.base_quat, start
        for _ in range(64):
            quat, q = (np.array(values).ravel() for values in piece(quat, q, (wanted - start) / 64))
        position, rotation = reference.forward_kinematics(wanted, quat)
        position = position + departure.base_position + reference.com(start, departure.base_quat)
        ends = inertial_goals(goal, inverse, departure, (position, rotation))
        assert ends
        own += min(float(np.abs(end.q - wanted).max()) for end in ends) < 1e-5
        ways = [float(((end.q - start) ** 2).sum()) for end in ends]
        assert ways == sorted(ways)
        assert all(end.error < 1e-9 for end in ends)
        steps += [end.steps for end in ends]
    assert own >= 14  # 15 found
    assert np.median(steps) <= 3


def _bent(n: int, pieces: int) -> tuple[PathLaw, Array]:
    """A path whose first two joints make a smooth detour, with a share that starts and ends slowly; its samples."""
    swing = np.zeros(n)
    swing[:2] = 0.5, -0.4

    def share(s: Array) -> tuple[Array, Array]:
        return s**3 * (6 * s**2 - 15 * s + 10), 30 * s**2 * (1 - s) ** 2

    def offset(s: Array) -> tuple[Array, Array]:
        return swing[:, None] * np.sin(np.pi * s) ** 2, swing[:, None] * np.pi * np.sin(2 * np.pi * s)

    s = np.linspace(0, 1, 1001)
    return path_law(n, share, offset, pieces), np.vstack([share(s)[0], offset(s)[0]]).T


def test_a_path_with_detours_ends_at_the_pose_too() -> None:
    model, goal = _model("melfa_free_flyer"), _goal("melfa_free_flyer")
    reference, departure = NumpyReference(model.robot), Departure(START)
    position, rotation = reference.forward_kinematics(NEARER, UPRIGHT)
    position = position + reference.com(NEARER, UPRIGHT)
    ends = {}
    for pieces in (8, 16, 32):
        law, samples = _bent(6, pieces)
        end = goal.solve(departure, [(position, rotation)], NEARER, law)
        assert end.error < 1e-9
        path = START + samples[:, :1] * (end.q - START) + samples[:, 1:]
        ends[pieces] = float(np.linalg.norm(_ridden(reference, departure, path)[1] - position))
    assert ends[16] < 5e-6
    assert ends[8] / ends[16] > 8  # of fourth order
    assert ends[32] < 1e-6
    straight = goal.solve(departure, [(position, rotation)], NEARER)
    assert np.abs(straight.q - end.q).max() > 1e-3  # the detour turns the base


def test_the_attitudes_on_the_way_are_those_of_the_plant() -> None:
    model, goal = _model("ur5_free_flyer"), _goal("ur5_free_flyer")
    start, end = np.array([0.1, -1.5, 0.4, -1.0, 0.3, 0.0]), np.array([1.0, -2.0, -0.5, -0.4, 1.2, 0.6])
    departure = Departure(start, quat_exp(np.array([0.3, 0.2, -0.5])))
    quats, quat, q = goal.attitudes(departure, end, path_law(6, pieces=20)), departure.base_quat, start
    assert quats.shape == (21, 4)
    for expected in quats[1:]:
        quat, q = (np.array(values).ravel() for values in path_piece(model)(quat, q, (end - start) / 20))
        np.testing.assert_allclose(quat, expected, atol=1e-14)
    np.testing.assert_array_equal(goal.base_after(departure, end, path_law(6, pieces=20))[0], quats[-1])


def test_newton_s_jacobian_is_that_of_finite_differences() -> None:
    goal, rng = _goal("ur5_free_flyer"), np.random.default_rng(3)
    departure, end = Departure(rng.uniform(-1, 1, 6)), rng.uniform(-1, 1, 6)
    law, _ = _bent(6, 4)
    target = np.concatenate([rng.normal(size=3), rotation_from_quat(quat_exp(rng.normal(size=3))).ravel("F")])

    def error(q: Array) -> tuple[Array, Array]:
        quat, slope = goal._along(departure, q, law)
        value, jacobian = goal.miss(quat, slope, q, target)
        return np.array(value).ravel(), np.array(jacobian)

    h, columns = 1e-6, []
    for e in np.eye(6):
        columns.append((error(end + h * e)[0] - error(end - h * e)[0]) / (2 * h))
    np.testing.assert_allclose(error(end)[1], np.array(columns).T, atol=1e-8)


def test_both_arms_of_a_pair_meet_their_poses_at_once() -> None:
    model = _model("dual_arm")
    goal, reference = build_inertial_goal(model, ["left", "right"]), NumpyReference(model.robot)
    low, high = model.tree.position_limits.T
    start = np.random.default_rng(4).uniform(low, high)
    wanted = np.clip(start + 0.6, low, high)
    departure, law = Departure(start), path_law(12)
    quat = goal.attitudes(departure, wanted, law)[-1]
    com = reference.com(start, UPRIGHT)
    poses = [reference.forward_kinematics(wanted, quat, tip) for tip in ("left", "right")]
    targets = [(position + com, rotation) for position, rotation in poses]
    end = goal.solve(departure, targets, wanted + 0.1, law)
    assert end.error < 1e-9
    np.testing.assert_allclose(end.q, wanted, atol=1e-6)
    one = build_inertial_goal(model, ["right"]).solve(departure, targets[1:], start, law)
    assert one.error < 1e-9
    assert (one.q[:6] == start[:6]).all()  # the left arm stays


def test_a_fixed_base_stays() -> None:
    model, goal = _model("melfa_rv1a"), _goal("melfa_rv1a")
    reference, place, turn = NumpyReference(model.robot), np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 0.7])
    departure = Departure(START, quat_exp(turn), place)
    position, rotation = reference.forward_kinematics(GOAL, quat_exp(turn))
    ends = inertial_goals(goal, build_inverse(model), departure, (position + place, rotation))
    np.testing.assert_allclose(ends[0].q, GOAL, atol=1e-9)
    np.testing.assert_array_equal(ends[0].base_quat, departure.base_quat)
    np.testing.assert_array_equal(ends[0].base_position, place)


def test_a_pose_out_of_reach_has_no_end() -> None:
    model, goal = _model("melfa_free_flyer"), _goal("melfa_free_flyer")
    target = np.array([2.0, 0.0, 0.3]), np.eye(3)
    assert inertial_goals(goal, build_inverse(model), Departure(START), target) == []
    assert goal.solve(Departure(START), [target], GOAL).distance > 1


def test_an_unknown_tip_is_refused() -> None:
    with pytest.raises(SpecError, match=r"^tip: no tip 'hand'; the robot has left, right$"):
        build_inertial_goal(_model("dual_arm"), ["hand"])
