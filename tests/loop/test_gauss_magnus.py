"""The base's attitude over a step: orders of the three integrators, the plant check, and a straight joint path."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

import fzcli
from fzcli.loop.plant import Plant, kinematic_plant
from fzcli.model import RobotModel
from fzcli.model.gauss_magnus import path_piece
from tests.loop.reaching_cases import HOME_A
from tests.oracle.fabrik_reference import base_turn
from tests.oracle.fabrik_runs import attitude_error
from tests.oracle.numpy_reference import NumpyReference, quat_exp, quat_multiply, rotation_from_quat

Array = NDArray[np.float64]
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
MOMENTUM = np.array([2.0, -3.0, 2.5])  # N m s: the base alone would turn with 0.3 to 0.5 rad/s


@cache
def _ur5() -> tuple[RobotModel, NumpyReference]:
    robot = fzcli.load_robot("ur5_free_flyer")
    return fzcli.build_model(robot), NumpyReference(robot)


@cache
def _plant(translation_only: bool = False) -> Plant:
    return kinematic_plant(_ur5()[0], translation_only, fourth_order=True)


@cache
def _stepped(method: str) -> ca.Function:
    """(state, joint rates, angular momentum, dt) -> state."""
    plant, dt = _plant(), ca.SX.sym("dt")
    state, command, L = ca.SX.sym("state", plant.state_size), ca.SX.sym("command", 6), ca.SX.sym("L", 3)
    rate = plant.rate(state, command, L)
    if method == "midpoint":
        rate = plant.rate(plant.advance(state, rate, 0.5 * dt), command, L)
    if method == "gauss_magnus":
        assert plant.magnus is not None
        rate = plant.magnus(state, command, L, dt)
    return ca.Function("stepped", [state, command, L, dt], [plant.advance(state, rate, dt)])


def _rates(time: float) -> Array:
    """A smooth joint motion, rad/s; within a step it is held."""
    return np.array([1.5, -1.0, 2.0, -1.5, 1.0, 0.5]) * np.cos(time * np.array([1.0, 1.3, 0.7, 1.6, 0.9, 1.1]))


def _attitude(method: str, pieces: int, momentum: Array) -> Array:
    """After 1.2 s in 12 stretches of constant joint rates, each in ``pieces`` steps."""
    state, step = np.concatenate([HOME_A + 0.3, quat_exp(np.array([0.2, -0.4, 0.1]))]), _stepped(method)
    for k in range(12):
        for _ in range(pieces):
            state = np.array(step(state, _rates(0.1 * k), momentum, 0.1 / pieces)).ravel()
    return state[6:]


def _fine(momentum: Array) -> Array:
    """The same by the oracle's angular momentum: classic Runge-Kutta on the quaternion, 20 steps a stretch."""
    oracle = _ur5()[1]

    def rate(q: Array, quat: Array, qd: Array) -> Array:
        inertia = oracle.system_inertia(q, quat)
        w = np.linalg.solve(inertia, momentum - oracle.joint_angular_momentum(q, quat) @ qd)
        return 0.5 * quat_multiply(np.concatenate([[0.0], w]), quat)

    q, quat, h = HOME_A + 0.3, quat_exp(np.array([0.2, -0.4, 0.1])), 0.1 / 20
    for k in range(12):
        qd = _rates(0.1 * k)
        for _ in range(20):
            a = rate(q, quat, qd)
            b = rate(q + 0.5 * h * qd, quat + 0.5 * h * a, qd)
            c = rate(q + 0.5 * h * qd, quat + 0.5 * h * b, qd)
            d = rate(q + h * qd, quat + h * c, qd)
            q, quat = q + h * qd, quat + h / 6 * (a + 2 * b + 2 * c + d)
    return quat / np.linalg.norm(quat)


@pytest.mark.parametrize("momentum", [np.zeros(3), MOMENTUM], ids=["at rest", "with momentum"])
@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("midpoint", 2), ("gauss_magnus", 4)])
def test_the_order_of_the_attitude(method: str, order: int, momentum: Array) -> None:
    true = _attitude("gauss_magnus", 64, momentum)
    errors = [attitude_error(true, _attitude(method, pieces, momentum)) for pieces in (1, 2, 4)]
    for ratio in (errors[0] / errors[1], errors[1] / errors[2]):
        assert 0.8 * 2**order < ratio < 1.25 * 2**order, errors


@pytest.mark.parametrize("momentum", [np.zeros(3), MOMENTUM], ids=["at rest", "with momentum"])
def test_the_limit_is_the_oracle_s(momentum: Array) -> None:
    assert attitude_error(_fine(momentum), _attitude("gauss_magnus", 64, momentum)) < 1e-8


def test_a_step_at_rest_is_the_oracle_s_turn() -> None:
    rng, oracle = np.random.default_rng(1), _ur5()[1]
    for _ in range(50):
        q, dq, quat = rng.uniform(-3, 3, 6), rng.uniform(-0.5, 0.5, 6), quat_exp(rng.normal(size=3))
        state = np.array(_stepped("gauss_magnus")(np.concatenate([q, quat]), dq / 0.01, np.zeros(3), 0.01)).ravel()
        expected = quat_multiply(quat, quat_exp(base_turn(oracle, q, dq, "gauss_magnus")))
        assert attitude_error(expected, state[6:]) < 1e-14
        np.testing.assert_allclose(state[:6], q + dq, atol=1e-15)


def test_the_step_does_not_depend_on_the_period_at_rest() -> None:
    """At zero momentum the turn hangs on the joints' path alone, however slowly it is gone."""
    q, dq = HOME_A, np.array([0.3, -0.2, 0.4, 0.1, -0.3, 0.2])
    slow, fast = (
        np.array(_stepped("gauss_magnus")(np.concatenate([q, UPRIGHT]), dq / dt, np.zeros(3), dt)).ravel()
        for dt in (1e-6, 1e6)
    )
    np.testing.assert_allclose(slow, fast, atol=1e-14)


def test_a_resting_arm_with_momentum_turns_as_one_body() -> None:
    """Joints at rest: angular momentum about the CoM is kept by a body that tumbles freely."""
    oracle, state, energy = _ur5()[1], np.concatenate([HOME_A, UPRIGHT]), []
    for _ in range(200):
        inertia = oracle.system_inertia(HOME_A, state[6:])
        energy.append(MOMENTUM @ np.linalg.solve(inertia, MOMENTUM))
        state = np.array(_stepped("gauss_magnus")(state, np.zeros(6), MOMENTUM, 0.05)).ravel()
    assert attitude_error(UPRIGHT, state[6:]) > 0.5
    assert np.ptp(energy) < 1e-6 * np.mean(energy)


def test_a_plant_that_only_translates_carries_the_true_attitude_behind() -> None:
    plant = _plant(True)
    assert plant.magnus is not None
    assert plant.truth is not None
    q, dq, quat = HOME_A, np.full(6, 0.2), quat_exp(np.array([0.1, 0.2, 0.3]))
    state = np.concatenate([q, quat, quat])
    for _ in range(5):
        rate = plant.magnus(state, dq / 0.01, np.zeros(3), 0.01)
        state = np.array(plant.advance(state, rate, 0.01)).ravel()
    np.testing.assert_allclose(state[6:10], quat, atol=1e-15)
    expected, q = quat, HOME_A
    for _ in range(5):
        expected = quat_multiply(expected, quat_exp(base_turn(_ur5()[1], q, dq, "gauss_magnus")))
        q = q + dq
    assert attitude_error(expected, np.array(plant.truth(state)).ravel()) < 1e-14


def test_the_plant_check() -> None:
    """From home A along a straight line of the joints, from rest."""
    model, oracle = _ur5()
    goal = np.deg2rad([60.0, -120.0, -40.0, -60.0, 80.0, 0.0])
    quat, q, way = UPRIGHT, HOME_A, (goal - HOME_A) / 100
    piece = path_piece(model)
    for _ in range(100):
        quat, q = (np.array(v).ravel() for v in piece(quat, q, way))
    moved = oracle.com(HOME_A, UPRIGHT) - oracle.com(q, quat)
    assert np.abs(1e3 * moved - [-9.658, -11.654, 7.750]).max() < 6e-4
    assert np.rad2deg(attitude_error(UPRIGHT, quat)) == pytest.approx(18.59174, abs=6e-6)
    np.testing.assert_allclose(rotation_from_quat(quat)[0], [0.9767189, 0.0517222, -0.2081948], atol=1e-7)
    tip, rotation = oracle.forward_kinematics(q, quat)
    np.testing.assert_allclose(tip + oracle.com(HOME_A, UPRIGHT), [0.297905, 0.286564, 1.000903], atol=1e-6)
    np.testing.assert_allclose(rotation[:, 2], [0.676397, 0.640890, -0.362970], atol=1e-6)


def test_a_path_on_a_fixed_base_does_not_turn_it() -> None:
    model = fzcli.build_model(fzcli.load_robot("ur5"))
    quat, q = (np.array(v).ravel() for v in path_piece(model)(UPRIGHT, HOME_A, np.ones(6)))
    np.testing.assert_array_equal(quat, UPRIGHT)
    np.testing.assert_array_equal(q, HOME_A + 1)
