"""Attitude functions against plain NumPy and against their own inverses."""

from collections.abc import Callable

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.model import attitude
from tests.oracle import numpy_reference, plain_loop

Array = NDArray[np.float64]


def _call(function: Callable[..., ca.SX], *values: Array) -> Array:
    symbols = [ca.SX.sym(f"a{i}", *np.atleast_2d(value).T.shape) for i, value in enumerate(values)]
    if values[0].ndim == 2:
        symbols = [ca.SX.sym("a", *values[0].shape)]
    result = np.array(ca.Function("f", symbols, [ca.densify(function(*symbols))])(*values))
    return result[:, 0] if result.shape[1] == 1 else result


def _quats(count: int) -> list[Array]:
    rng = np.random.default_rng(7)
    return [q / np.linalg.norm(q) for q in rng.standard_normal((count, 4))]


def test_rotation_matrix_and_product() -> None:
    for a, b in zip(_quats(20), reversed(_quats(20)), strict=True):
        R = _call(attitude.rotation_matrix, a)
        np.testing.assert_allclose(R, numpy_reference.rotation_from_quat(a), atol=1e-15)
        product = _call(attitude.multiply, a, b)
        np.testing.assert_allclose(product, numpy_reference.quat_multiply(a, b), atol=1e-15)
        np.testing.assert_allclose(
            _call(attitude.multiply, a, _call(attitude.conjugate, a)), [1, 0, 0, 0], atol=1e-15
        )


def test_exponential_is_exact_at_any_size() -> None:
    rng = np.random.default_rng(8)
    for angle in (0.0, 1e-12, 1e-6, 1e-3, 0.3, 1.0, 3.1, 200.0):
        axis = rng.standard_normal(3)
        turn = angle * axis / np.linalg.norm(axis)
        exact = numpy_reference.quat_exp(turn)
        np.testing.assert_allclose(_call(attitude.exponential, turn), exact, atol=1e-13)


def test_attitude_step_turns_about_body_axes_and_keeps_the_norm() -> None:
    rng = np.random.default_rng(9)
    for quat in _quats(20):
        turn = rng.uniform(-0.5, 0.5, 3)
        stepped = _call(attitude.attitude_step, quat, turn)
        assert abs(np.linalg.norm(stepped) - 1.0) <= 4e-16
        expected = numpy_reference.quat_multiply(quat, numpy_reference.quat_exp(turn))
        np.testing.assert_allclose(stepped, expected, atol=1e-14)


def test_rotation_vector_inverts_the_exponential() -> None:
    rng = np.random.default_rng(10)
    for scale in (0.0, 1e-12, 1e-9, 1e-8, 1e-7, 1e-3, 1.0):
        turn = scale * rng.uniform(-1.0, 1.0, 3)
        quat = numpy_reference.quat_exp(turn)
        for sign in (1.0, -1.0):
            seen = _call(attitude.rotation_vector, sign * quat)
            np.testing.assert_allclose(seen, turn, atol=1e-14 * max(scale, 1e-3))
    half_turn = _call(attitude.rotation_vector, np.array([0.0, 0.0, 1.0, 0.0]))
    np.testing.assert_allclose(half_turn, [0.0, np.pi, 0.0], atol=1e-15)


def test_quaternion_from_matrix_in_every_branch() -> None:
    cases = [*_quats(40), *np.eye(4), np.array([1e-9, 1.0, 0.0, 0.0]), np.array([0.5, 0.5, 0.5, 0.5])]
    for quat in cases:
        R = numpy_reference.rotation_from_quat(quat / np.linalg.norm(quat))
        seen = _call(attitude.quaternion_from_matrix, R)
        np.testing.assert_allclose(numpy_reference.rotation_from_quat(seen), R, atol=1e-14)


def test_roll_pitch_yaw_and_their_rates() -> None:
    rng = np.random.default_rng(11)
    for _ in range(30):
        angles = rng.uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1])
        R = numpy_reference.rotation_from_rpy(angles)
        np.testing.assert_allclose(_call(attitude.roll_pitch_yaw, R), angles, atol=1e-12)
        rows = _call(attitude.angle_rate_rows, R)
        scale = 1.0 / np.cos(angles[1])
        np.testing.assert_allclose(rows @ R.T, plain_loop.angle_rates(R), atol=1e-13 * scale**2)
        w, h = rng.uniform(-1.0, 1.0, 3), 1e-6
        after, before = (
            np.array(
                plain_loop.roll_pitch_yaw(R @ numpy_reference.rotation_about(w, sign * h * np.linalg.norm(w)))
            )
            for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(rows @ w, (after - before) / (2 * h), atol=1e-8 * scale**3)
