"""The model's rates against central differences of poses along motions that conserve momentum."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.model import RobotModel, build_model
from tests.oracle.numpy_reference import (
    NumpyReference,
    quat_exp,
    quat_multiply,
    rotation_from_quat,
    rotation_vector,
    skew,
)
from tests.oracle.random_trees import State, random_robot, random_states

Array = NDArray[np.float64]
SEEDS = range(36)
STATES = 8
H = 3e-6  # s: truncation and rounding about equal
TOLERANCE = 1e-7
FLOATING = [seed for seed in SEEDS if random_robot(seed).base.floating]
FIXED = [seed for seed in range(64) if not random_robot(seed).base.floating]


@cache
def _model(seed: int) -> RobotModel:
    return build_model(random_robot(seed))


def _unit(s: State) -> Array:
    return s.qd / np.linalg.norm(s.qd)


def _moved(model: RobotModel, s: State, qd: Array, h: float) -> tuple[Array, Array]:
    """Joints and attitude h seconds along the motion; its error of order h^2 is even in h and cancels."""
    rate = np.array(model.base_rate_map(s.q, s.base_quat)) @ qd
    return s.q + h * qd, quat_multiply(quat_exp(h * rate), s.base_quat)


def _tip(model: RobotModel, q: Array, quat: Array, tip: str) -> tuple[Array, Array]:
    position, rotation = model.forward_kinematics(q, quat, tip=tip)
    return np.array(position)[:, 0], np.array(rotation)


def _check_jacobian(seed: int, states: int) -> None:
    model = _model(seed)
    for index, s in random_states(model.n, seed, states):
        qd = _unit(s)
        after, before = _moved(model, s, qd, H), _moved(model, s, qd, -H)
        for tip in model.tips:
            (p1, r1), (p0, r0) = _tip(model, *after, tip), _tip(model, *before, tip)
            seen = np.concatenate([p1 - p0, rotation_vector(r1 @ r0.T)]) / (2 * H)
            twist = np.array(model.generalized_jacobian(s.q, s.base_quat, tip=tip)) @ qd
            error = np.max(np.abs(seen - twist))
            assert error <= TOLERANCE, f"seed {seed}, state {index}, tip {tip}: {error:.2e}"


@pytest.mark.parametrize("seed", FLOATING)
def test_generalized_jacobian_is_the_rate_of_the_inertial_tip_pose(seed: int) -> None:
    _check_jacobian(seed, STATES)


@pytest.mark.parametrize("seed", FIXED)
def test_generalized_jacobian_on_a_fixed_base(seed: int) -> None:
    model = _model(seed)
    assert not model.floating
    for _, s in random_states(model.n, seed, 2):
        assert not np.any(np.array(model.base_rate_map(s.q, s.base_quat)))
    _check_jacobian(seed, STATES)


@pytest.mark.parametrize("seed", FLOATING)
def test_base_rate_map_keeps_the_bodies_angular_momentum_zero(seed: int) -> None:
    """Angular momentum from differences of the bodies' poses alone: no Jacobian but W is involved."""
    model, reference = _model(seed), NumpyReference(random_robot(seed))
    for index, s in random_states(model.n, seed, STATES):
        qd = _unit(s)
        now = reference.bodies(s.q, s.base_quat)
        after, before = (_moved(model, s, qd, h) for h in (H, -H))
        com, com1, com0 = (reference.com(*state) for state in ((s.q, s.base_quat), after, before))
        bodies1, bodies0 = reference.bodies(*after), reference.bodies(*before)
        total, scale = np.zeros(3), 1.0
        for name, body in now.items():
            one, zero = bodies1[name], bodies0[name]
            velocity = ((one.com - com1) - (zero.com - com0)) / (2 * H)
            rate = rotation_vector(one.rotation @ zero.rotation.T) / (2 * H)
            part = body.inertia @ rate + body.mass * np.cross(body.com - com, velocity)
            total, scale = total + part, scale + float(np.linalg.norm(part))
        error = np.max(np.abs(total)) / scale
        assert error <= TOLERANCE, f"seed {seed}, state {index}: {error:.2e} of {scale:.3g} N m s"


@pytest.mark.parametrize("seed", SEEDS)
def test_linear_momentum_map_is_the_rate_of_the_com(seed: int) -> None:
    model = _model(seed)
    for index, s in random_states(model.n, seed, STATES):
        h_b, h_bm = (np.array(block) for block in model.momentum_map(s.q, s.base_quat))
        com_by_joints = h_bm[:3] / model.mass
        for j, unit in enumerate(np.eye(model.n)):
            seen = np.array(model.com(s.q + H * unit, s.base_quat) - model.com(s.q - H * unit, s.base_quat))
            error = np.max(np.abs(seen[:, 0] / (2 * H) - com_by_joints[:, j]))
            assert error <= TOLERANCE, f"seed {seed}, state {index}, {model.joint_names[j]}: {error:.2e}"
        com_by_turning = h_b[:3, 3:] / model.mass
        for axis in range(3):
            turn = H * np.eye(3)[axis]
            quats = [quat_multiply(quat_exp(sign * turn), s.base_quat) for sign in (1, -1)]
            seen = np.array(model.com(s.q, quats[0]) - model.com(s.q, quats[1]))
            error = np.max(np.abs(seen[:, 0] / (2 * H) - com_by_turning[:, axis]))
            assert error <= TOLERANCE, f"seed {seed}, state {index}, turn about axis {axis}: {error:.2e}"


def test_helpers_of_this_test_know_rotations() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        turn = rng.uniform(-1.0, 1.0, 3)
        np.testing.assert_allclose(rotation_vector(rotation_from_quat(quat_exp(turn))), turn, atol=1e-14)
        small = 1e-8 * turn
        expected = np.eye(3) + skew(small)
        np.testing.assert_allclose(rotation_from_quat(quat_exp(small)), expected, atol=1e-15)
