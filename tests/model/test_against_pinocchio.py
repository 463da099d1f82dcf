"""Every quantity of the model against Pinocchio: random trees, random states, replayable by seed."""

from functools import cache

import numpy as np
import pytest

from fzcli.model import RobotModel, build_model
from tests.oracle.pinocchio_oracle import PinocchioOracle
from tests.oracle.random_trees import random_robot, random_states

SEEDS = range(42)
STATES = 8
TOLERANCE = 1e-12  # relative to the largest entry of the reference, at least 1


@cache
def _pair(seed: int) -> tuple[RobotModel, PinocchioOracle]:
    robot = random_robot(seed)
    return build_model(robot), PinocchioOracle(robot)


def _check(actual: object, expected: np.ndarray, what: str) -> None:
    actual = np.array(actual, dtype=float)
    if expected.ndim == 1:
        assert actual.shape == (len(expected), 1), f"{what}: shape {actual.shape}"
        actual = actual[:, 0]
    assert actual.shape == expected.shape, f"{what}: shape {actual.shape}, expected {expected.shape}"
    assert np.all(np.isfinite(actual)), f"{what}: not finite"
    error = np.max(np.abs(actual - expected)) / max(1.0, np.max(np.abs(expected)))
    assert error <= TOLERANCE, f"{what}: relative error {error:.2e}"


@pytest.mark.parametrize("seed", SEEDS)
def test_joints_and_tips_are_named_in_order(seed: int) -> None:
    model, oracle = _pair(seed)
    assert model.joint_names == oracle.joint_names
    assert model.n == oracle.n
    assert model.tips == tuple(oracle.robot.tips)


@pytest.mark.parametrize("seed", SEEDS)
def test_tips(seed: int) -> None:
    model, oracle = _pair(seed)
    for index, s in random_states(model.n, seed, STATES):
        for tip in (None, *model.tips):
            where = f"seed {seed}, state {index}, tip {tip}"
            position, rotation = model.forward_kinematics(s.q, s.base_quat, tip=tip)
            expected = oracle.forward_kinematics(s.q, s.base_quat, tip)
            _check(position, expected[0], f"{where}, position")
            _check(rotation, expected[1], f"{where}, rotation")
            jacobian = model.generalized_jacobian(s.q, s.base_quat, tip=tip)
            _check(jacobian, oracle.generalized_jacobian(s.q, s.base_quat, tip), f"{where}, J_g")


@pytest.mark.parametrize("seed", SEEDS)
def test_whole_system(seed: int) -> None:
    model, oracle = _pair(seed)
    for index, s in random_states(model.n, seed, STATES):
        where = f"seed {seed}, state {index}"
        state = (s.q, s.base_quat)
        _check(model.com(*state), oracle.com(*state), f"{where}, com")
        _check(model.base_rate_map(*state), oracle.base_rate_map(*state), f"{where}, base_rate_map")
        h_b, h_bm = model.momentum_map(*state)
        expected_b, expected_bm = oracle.momentum_map(*state)
        _check(h_b, expected_b, f"{where}, H_b")
        _check(h_bm, expected_bm, f"{where}, H_bm")
        momentum = model.momentum(*state, s.qd, s.base_twist)
        _check(momentum, oracle.momentum(*state, s.qd, s.base_twist), f"{where}, momentum")
        _check(model.generalized_inertia(s.q), oracle.generalized_inertia(s.q), f"{where}, M")
