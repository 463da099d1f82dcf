"""Damped least squares on the generalized Jacobian: the formula of each task, speeds, limits, and convergence."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import fzcli
from fzcli.control.registry import controllers
from fzcli.model import RobotModel
from tests.control.test_fabrik_law import OnePeriod
from tests.loop.reaching_cases import arm, skew_arm
from tests.oracle.fabrik_reference import State
from tests.oracle.numpy_reference import NumpyReference, quat_exp, quat_multiply, rotation_from_quat
from tests.oracle.random_trees import random_state

Array = NDArray[np.float64]
PERIOD, GAIN, DAMPING = 0.01, 7.0, 0.2
ROBOT = fzcli.load_robot("ur5_free_flyer")
ORACLE = NumpyReference(ROBOT)


def _quat_of(rotation: Array) -> Array:
    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return np.array([w, x, y, z])


def _by_hand(oracle: NumpyReference, state: State, target: Array, quat: Array, task: str) -> Array:
    """dq (n) before speeds and limits: J^T (J J^T + damping^2 E)^-1 gain e period, world axes."""
    position, rotation = oracle.forward_kinematics(state.q, state.quat)
    jacobian, error = oracle.generalized_jacobian(state.q, state.quat), target - state.anchor - position
    wanted = rotation_from_quat(quat)
    if task == "pose":
        error = np.concatenate([error, Rotation.from_matrix(wanted @ rotation.T).as_rotvec()])
    elif task == "approach":  # the turn that lays z on the wanted z, and no row about z
        z, d = rotation[:, 2], wanted[:, 2]
        across = np.cross(z, d)
        error = np.concatenate([error, across / np.linalg.norm(across) * np.arctan2(np.linalg.norm(across), z @ d)])
        jacobian[3:] -= np.outer(z, z @ jacobian[3:])
    else:
        jacobian = jacobian[:3]
    square = jacobian @ jacobian.T + DAMPING**2 * np.eye(len(jacobian))
    return PERIOD * jacobian.T @ np.linalg.solve(square, GAIN * error)


def _law(robot: object, task: str) -> OnePeriod:
    return OnePeriod(robot, {"kind": "dls", "task": task, "gain": GAIN, "damping": DAMPING})


def _limited(model: RobotModel, dq: Array, q: Array) -> Array:
    """All joints scaled alike to the speeds, then the joint limits."""
    caps, limits = np.array(model.tree.speed_limits) * PERIOD, model.tree.position_limits
    dq = dq / max(1.0, float((np.abs(dq) / caps).max()))
    return np.clip(dq, np.minimum(limits[:, 0] - q, 0), np.maximum(limits[:, 1] - q, 0))


@pytest.mark.parametrize("task", ["position", "approach", "pose"])
def test_the_formula(task: str) -> None:
    """Near targets, which no speed limits, and far ones, which are scaled; one joint near its limit."""
    law, rng, worst = _law(ROBOT, task), np.random.default_rng(1), 0.0
    for i in range(100):
        q = rng.uniform(-3, 3, 6)
        q[i % 6] = 2 * np.pi - rng.choice([0.0, 0.001, 1.0])
        state = State(q, random_state(6, rng).base_quat, rng.normal(size=3))
        position, rotation = ORACLE.forward_kinematics(q, state.quat)
        size = 10.0 ** rng.uniform(-4, 0)
        target = state.anchor + position + size * rng.normal(size=3)
        quat = quat_multiply(quat_exp(size * rng.normal(size=3)), _quat_of(rotation))
        expected = _limited(law.model, _by_hand(ORACLE, state, target, quat, task), q)
        worst = max(worst, float(np.abs(law(state, target, quat) - expected).max()))
    assert worst <= 1e-9  # 2e-12 found


def test_a_sliding_joint_takes_part() -> None:
    """Least squares need no chain points; speeds in m/s beside those in rad/s."""
    place = (0.4, 0.0, 0.0)
    robot = arm((place, (0, 0, 1)), (place, (1, 0, 0)), (place, (0, 1, 0)), (place, (0, 0, 1)),
                types={1: "prismatic"}, floating=True, com=(0.1, 0.05, 0.0))  # fmt: skip
    oracle, law, rng = NumpyReference(robot), _law(robot, "position"), np.random.default_rng(2)
    for _ in range(20):
        state = State(rng.uniform(-1, 1, 4), random_state(4, rng).base_quat, rng.normal(size=3))
        target = state.anchor + oracle.forward_kinematics(state.q, state.quat)[0] + 0.1 * rng.normal(size=3)
        expected = _limited(law.model, _by_hand(oracle, state, target, np.array([1.0, 0, 0, 0]), "position"), state.q)
        np.testing.assert_allclose(law(state, target, np.array([1.0, 0, 0, 0])), expected, atol=1e-9)


def test_all_joints_are_scaled_alike() -> None:
    """A target far away: the fastest joint goes at its speed, the way is that of the unlimited formula."""
    rng = np.random.default_rng(3)
    robot = skew_arm(rng, 5, True)
    oracle, law = NumpyReference(robot), _law(robot, "position")
    for _ in range(20):
        state = State(rng.uniform(-3, 3, 5), random_state(5, rng).base_quat, rng.normal(size=3))
        target = state.anchor + oracle.forward_kinematics(state.q, state.quat)[0] + 50 * rng.normal(size=3)
        dq = law(state, target, np.array([1.0, 0, 0, 0]))
        way = _by_hand(oracle, state, target, np.array([1.0, 0, 0, 0]), "position")
        assert np.abs(dq).max() == pytest.approx(np.pi * PERIOD, rel=1e-12)
        np.testing.assert_allclose(dq / np.linalg.norm(dq), way / np.linalg.norm(way), atol=1e-10)


@pytest.mark.parametrize("task", ["approach", "pose"])
def test_at_the_target_nothing_moves_and_nothing_is_lost(task: str) -> None:
    """Also for a direction straight against the tip's z, where no way round is nearer: finite, and no turn."""
    law, rng = _law(ROBOT, task), np.random.default_rng(4)
    for _ in range(10):
        state = State(rng.uniform(-3, 3, 6), random_state(6, rng).base_quat, rng.normal(size=3))
        position, rotation = ORACLE.forward_kinematics(state.q, state.quat)
        quat = _quat_of(rotation)
        assert np.abs(law(state, state.anchor + position, quat)).max() < 1e-7
        turned = quat_multiply(quat, np.array([0.0, 1.0, 0.0, 0.0]))  # half a turn about the tip's x
        assert np.isfinite(law(state, state.anchor + position, turned)).all()


def test_gain_and_damping_are_run_time_parameters() -> None:
    law = controllers()["dls"].build(fzcli.build_model(ROBOT), controllers()["dls"].spec())
    assert [parameter.path for parameter in law.parameters] == ["controller.gain", "controller.damping"]
    spec = controllers()["dls"].spec()
    assert (spec.gain, spec.damping) == (20.0, 0.05)
