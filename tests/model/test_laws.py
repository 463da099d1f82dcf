"""Laws of mechanics that the model must hold, whatever the robot."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.errors import SpecError
from fzcli.model import RobotModel, build_model
from tests.oracle.numpy_reference import NumpyReference, quat_multiply, rotation_from_quat
from tests.oracle.random_trees import State, random_robot, random_state, random_states

Array = NDArray[np.float64]
SEEDS = range(36)
STATES = 4
FLOATING = [seed for seed in SEEDS if random_robot(seed).base.floating]


@cache
def _model(seed: int) -> RobotModel:
    return build_model(random_robot(seed))


def _free_twist(model: RobotModel, s: State) -> Array:
    """Base twist (6,) of the free motion: turning by W, its origin moved so that the CoM stands still."""
    rate = np.array(model.base_rate_map(s.q, s.base_quat)) @ s.qd
    at_rest = np.array(model.momentum(s.q, s.base_quat, s.qd, np.concatenate([np.zeros(3), rate])))
    return np.concatenate([-at_rest[:3, 0] / model.mass, rate])


def _column(value: object) -> Array:
    return np.array(value, dtype=float)[:, 0]


@pytest.mark.parametrize("seed", FLOATING)
def test_the_base_rate_map_gives_zero_momentum(seed: int) -> None:
    model, reference = _model(seed), NumpyReference(random_robot(seed))
    for index, s in random_states(model.n, seed, STATES):
        twist = _free_twist(model, s)
        parts = [np.array(block) for block in model.momentum_map(s.q, s.base_quat)]
        scale = max(1.0, np.max(np.abs(parts[1] @ s.qd)))
        by_model = model.momentum(s.q, s.base_quat, s.qd, twist)
        by_sums = reference.momentum(s.q, s.base_quat, s.qd, twist)
        for what, momentum in (("model", _column(by_model)), ("sum over bodies", by_sums)):
            error = np.max(np.abs(momentum)) / scale
            assert error <= 1e-12, f"seed {seed}, state {index}, {what}: {error:.2e}"


@pytest.mark.parametrize("seed", SEEDS)
def test_generalized_inertia_is_symmetric_and_positive(seed: int) -> None:
    model = _model(seed)
    for index, s in random_states(model.n, seed, STATES):
        M = np.array(model.generalized_inertia(s.q))
        scale = np.max(np.abs(M))
        assert np.max(np.abs(M - M.T)) <= 1e-13 * scale, f"seed {seed}, state {index}"
        assert np.linalg.eigvalsh(M)[0] > 0.0, f"seed {seed}, state {index}"


@pytest.mark.parametrize("seed", SEEDS)
def test_generalized_inertia_is_twice_the_kinetic_energy_of_the_free_motion(seed: int) -> None:
    model, reference = _model(seed), NumpyReference(random_robot(seed))
    for index, s in random_states(model.n, seed, STATES):
        twist = _free_twist(model, s) if model.floating else np.zeros(6)
        energy = reference.kinetic_energy(s.q, s.base_quat, s.qd, twist)
        by_inertia = 0.5 * float(s.qd @ np.array(model.generalized_inertia(s.q)) @ s.qd)
        scale = max(energy, reference.kinetic_energy(s.q, s.base_quat, s.qd, np.zeros(6)))
        assert abs(by_inertia - energy) <= 1e-12 * scale, f"seed {seed}, state {index}"


@pytest.mark.parametrize("seed", SEEDS)
def test_turning_the_whole_system_turns_every_vector(seed: int) -> None:
    model = _model(seed)
    for index, s in random_states(model.n, seed, STATES):
        turn = random_state(1, np.random.default_rng((seed, index))).base_quat
        R, turned = rotation_from_quat(turn), quat_multiply(turn, s.base_quat)
        both = np.kron(np.eye(2), R)
        where = f"seed {seed}, state {index}"

        def same(seen: object, expected: Array, what: str, where: str = where) -> None:
            error = np.max(np.abs(np.array(seen) - expected)) / max(1.0, np.max(np.abs(expected)))
            assert error <= 1e-12, f"{where}, {what}: {error:.2e}"

        for tip in model.tips:
            position, rotation = model.forward_kinematics(s.q, s.base_quat, tip=tip)
            new_position, new_rotation = model.forward_kinematics(s.q, turned, tip=tip)
            same(new_position, R @ np.array(position), f"{tip} position")
            same(new_rotation, R @ np.array(rotation), f"{tip} rotation")
            jacobian = np.array(model.generalized_jacobian(s.q, s.base_quat, tip=tip))
            same(model.generalized_jacobian(s.q, turned, tip=tip), both @ jacobian, f"{tip} J_g")
        rate = np.array(model.base_rate_map(s.q, s.base_quat))
        same(model.base_rate_map(s.q, turned), R @ rate, "base_rate_map")
        momentum = np.array(model.momentum(s.q, s.base_quat, s.qd, s.base_twist))
        new_momentum = model.momentum(s.q, turned, s.qd, both @ s.base_twist)
        same(new_momentum, both @ momentum, "momentum")


@pytest.mark.parametrize("seed", SEEDS)
def test_a_moving_base_adds_no_spin_and_a_turning_one_no_drift_of_its_com(seed: int) -> None:
    model, reference = _model(seed), NumpyReference(random_robot(seed))
    for index, s in random_states(model.n, seed, STATES):
        where, still = f"seed {seed}, state {index}", np.zeros(model.n)
        v, w = s.base_twist[:3], s.base_twist[3:]
        carried = _column(model.momentum(s.q, s.base_quat, still, np.concatenate([v, np.zeros(3)])))
        np.testing.assert_allclose(carried[:3], model.mass * v, rtol=1e-13, atol=1e-12, err_msg=where)
        np.testing.assert_allclose(carried[3:], 0.0, atol=1e-11, err_msg=where)
        about_com = np.concatenate([-np.cross(w, _column(model.com(s.q, s.base_quat))), w])
        spun = _column(model.momentum(s.q, s.base_quat, still, about_com))
        inertia = reference.system_inertia(s.q, s.base_quat)
        np.testing.assert_allclose(spun[:3], 0.0, atol=1e-11, err_msg=where)
        expected = inertia @ w
        tolerance = 1e-12 * max(1.0, float(np.max(np.abs(inertia))))
        np.testing.assert_allclose(spun[3:], expected, rtol=0, atol=tolerance, err_msg=where)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_two_signs_of_a_quaternion_are_one_attitude(seed: int) -> None:
    model = _model(seed)
    for _, s in random_states(model.n, seed, 1):
        one, other = (np.array(model.generalized_jacobian(s.q, q)) for q in (s.base_quat, -s.base_quat))
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("seed", FLOATING[:8])
def test_an_infinite_base_is_a_fixed_one(seed: int) -> None:
    robot = random_robot(seed)
    heavy = robot.base.model_copy(
        update={"mass": 1e12, "com": (0.0, 0.0, 0.0), "inertia": (1e12, 1e12, 1e12, 0.0, 0.0, 0.0)}
    )
    floating = build_model(robot.model_copy(update={"base": heavy}))
    fixed = build_model(robot.model_copy(update={"base": robot.base.model_copy(update={"floating": False})}))
    for index, s in random_states(fixed.n, seed, STATES):
        for tip in fixed.tips:
            expected = np.array(fixed.generalized_jacobian(s.q, s.base_quat, tip=tip))
            seen = np.array(floating.generalized_jacobian(s.q, s.base_quat, tip=tip))
            np.testing.assert_allclose(seen, expected, atol=1e-7, err_msg=f"seed {seed}, state {index}")


def test_an_unknown_tip_is_refused_by_name() -> None:
    model = _model(2)
    with pytest.raises(SpecError, match=r"no tip 'nose'; the robot has .*hull"):
        model.generalized_jacobian(np.zeros(model.n), [1, 0, 0, 0], tip="nose")


def test_a_robot_without_active_joints_is_refused() -> None:
    robot = random_robot(3)
    links = tuple(
        link.model_copy(update={"joint": link.joint.model_copy(update={"type": "fixed"})})
        for link in robot.links
    )
    with pytest.raises(SpecError, match="the robot has no active joint"):
        build_model(robot.model_copy(update={"links": links}))
