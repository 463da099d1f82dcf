"""What mechanics demands of a rollout, judged by the independent NumPy oracle."""

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.loop.rollout import Rollout
from fzcli.loop.simulate import simulate
from tests.loop.cases import run_spec
from tests.oracle.numpy_reference import NumpyReference, quat_multiply, rotation_from_quat, rotation_vector
from tests.oracle.table1_robot import bulgarelli4

pytestmark = pytest.mark.usefixtures("machine")
Array = NDArray[np.float64]
P, L = [0.3, -0.2, 0.1], [0.05, 0.02, -0.04]
MOMENTUM = {"start__momentum": {"linear": P, "angular": L}}
ORACLE = NumpyReference(bulgarelli4())


def _momentum(rollout: Rollout, k: int) -> Array:
    return ORACLE.momentum(rollout.q[k], rollout.base_quat[k], rollout.qd[k], rollout.base_twist[k])


@pytest.mark.parametrize("changes", [{}, MOMENTUM], ids=["at rest", "with momentum"])
def test_momentum_over_fifteen_seconds(changes: dict[str, object]) -> None:
    """Linear and angular momentum of the recorded motion, at every 25th sample."""
    rollout = simulate(run_spec(duration=15.0, **changes))
    expected = np.array(P + L if changes else [0.0] * 6)
    assert rollout.time[-1] == pytest.approx(15.0)
    for k in range(0, len(rollout.time), 25):
        residual = _momentum(rollout, k) - expected
        assert np.abs(residual[:3]).max() <= 1e-12
        assert np.abs(residual[3:]).max() <= 1e-12, "rates at a sample keep the angular momentum exactly"
    assert rollout.certificate["linear_momentum_max"] <= 1e-12


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("midpoint", 2)])
@pytest.mark.parametrize("changes", [{}, MOMENTUM], ids=["at rest", "with momentum"])
def test_the_angular_residual_shows_the_order(method: str, order: int, changes: dict[str, object]) -> None:
    def residual(step: float) -> float:
        certificate = simulate(run_spec(method=method, step=step, **changes)).certificate
        return certificate["angular_momentum_max"]

    coarse, middle, fine = residual(0.02), residual(0.01), residual(0.005)
    for ratio in (coarse / middle, middle / fine):
        assert 0.85 * 2**order < ratio < 1.15 * 2**order


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("midpoint", 2)])
@pytest.mark.parametrize("changes", [{}, MOMENTUM], ids=["at rest", "with momentum"])
def test_the_tip_error_has_the_order_of_the_method(method: str, order: int, changes: dict[str, object]) -> None:
    """With momentum too: the drift is taken off, the tip keeps to its line in the world."""
    errors = [
        simulate(run_spec(method=method, step=step, controller__damping=1e-12, **changes)).metrics["tip_error_max"]
        for step in (0.02, 0.01, 0.005)
    ]
    for coarse, fine in itertools.pairwise(errors):
        assert 0.85 * 2**order < coarse / fine < 1.2 * 2**order
    assert errors[-1] < 1e-4


@pytest.mark.parametrize("changes", [{}, MOMENTUM], ids=["at rest", "with momentum"])
def test_the_centre_of_mass_moves_uniformly(changes: dict[str, object]) -> None:
    rollout = simulate(run_spec(start__base_position=[1.0, 2.0, 3.0], start__base_rpy=[0.1, -0.2, 0.3], **changes))
    centres = np.array(
        [
            position + ORACLE.com(q, quat)
            for position, q, quat in zip(rollout.base_position, rollout.q, rollout.base_quat, strict=True)
        ]
    )
    velocity = np.array(P) / ORACLE.mass() if changes else np.zeros(3)
    np.testing.assert_allclose(centres, centres[0] + rollout.time[:, None] * velocity, atol=1e-13)
    np.testing.assert_allclose(rollout.base_position[0], [1.0, 2.0, 3.0], atol=1e-15)


@pytest.mark.parametrize("changes", [{}, MOMENTUM], ids=["at rest", "with momentum"])
def test_tip_and_pose_are_the_oracle_s(changes: dict[str, object]) -> None:
    rollout = simulate(run_spec(duration=3.0, start__base_rpy=[0.1, -0.2, 0.3], **changes))
    for k in range(0, len(rollout.time), 50):
        q, quat = rollout.q[k], rollout.base_quat[k]
        position, rotation = ORACLE.forward_kinematics(q, quat)
        world = rollout.base_position[k] + ORACLE.com(q, quat) + position
        np.testing.assert_allclose(rollout.tip_position[k], world, atol=1e-13)
        np.testing.assert_allclose(rotation_from_quat(rollout.tip_quat[k]), rotation, atol=1e-12)


@pytest.mark.parametrize("changes", [{}, MOMENTUM], ids=["at rest", "with momentum"])
def test_pose_and_twist_of_the_base_belong_together(changes: dict[str, object]) -> None:
    """Central differences of position and attitude over half the midpoint run's step give the twist."""
    rollout = simulate(run_spec(step=0.001, duration=4.0, method="midpoint", **changes))
    dt = 0.001
    for k in range(100, 3900, 200):
        velocity = (rollout.base_position[k + 1] - rollout.base_position[k - 1]) / (2 * dt)
        np.testing.assert_allclose(rollout.base_twist[k, :3], velocity, atol=2e-7)
        before, after = (rotation_from_quat(rollout.base_quat[i]) for i in (k - 1, k + 1))
        rate = rotation_vector(after @ before.T) / (2 * dt)
        np.testing.assert_allclose(rollout.base_twist[k, 3:], rate, atol=2e-7)


def test_joint_speeds_are_the_differences_of_the_joints() -> None:
    """Explicit Euler: q(k+1) = q(k) + step qd(k), and the base turns by its rate in base axes."""
    rollout = simulate(run_spec(duration=2.0, **MOMENTUM))
    np.testing.assert_allclose(np.diff(rollout.q, axis=0), 0.01 * rollout.qd[:-1], atol=1e-15)
    for k in range(0, 200, 20):
        quat, rate = rollout.base_quat[k], rollout.base_twist[k, 3:]
        turn = 0.01 * rate
        angle = np.linalg.norm(turn)
        step = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * turn / angle])
        np.testing.assert_allclose(rollout.base_quat[k + 1], quat_multiply(step, quat), atol=1e-15)


def test_the_quaternion_keeps_its_norm_for_long() -> None:
    momentum = [0.02, -0.01, 0.015]
    rollout = simulate(run_spec(duration=40.0, start__momentum__angular=momentum, reference={"kind": "hold"}))
    assert np.abs(np.linalg.norm(rollout.base_quat, axis=1) - 1).max() < 1e-14
    assert rollout.certificate["quaternion_norm_error_max"] < 1e-14


def test_a_given_attitude_is_normalised_at_the_start() -> None:
    rollout = simulate(run_spec(duration=0.1, start__base_quat=[0.8004, 0.6, 0.0, 0.0]))
    assert abs(np.linalg.norm(rollout.base_quat[0]) - 1) < 1e-15


def test_a_fixed_base_stays() -> None:
    """On a fixed base the arm alone follows the line, and the base's yaw cannot be moved."""
    spec = run_spec(controller__kind="unconstrained", start__base_position=[0.0, 1.0, 0.0])
    base = spec.robot.base.model_copy(update={"floating": False})
    robot = spec.robot.model_copy(update={"base": base})
    rollout = simulate(spec.model_copy(update={"robot": robot}))
    assert rollout.status.name == "ok"
    np.testing.assert_array_equal(rollout.base_position, np.tile([0.0, 1.0, 0.0], (len(rollout.time), 1)))
    np.testing.assert_array_equal(rollout.base_quat, np.tile([1.0, 0.0, 0.0, 0.0], (len(rollout.time), 1)))
    np.testing.assert_array_equal(rollout.base_twist, 0.0)
    assert rollout.metrics["tip_error_max"] < 1e-3
    moved = rollout.tip_position[-1] - rollout.tip_position[0]
    direction = np.array(spec.reference.direction)
    np.testing.assert_allclose(moved, 0.4 * direction / np.linalg.norm(direction), atol=1e-5)
    assert "linear_momentum_max" not in rollout.certificate


def test_a_closed_motion_turns_the_base() -> None:
    """Angular momentum is not integrable: after a closed tip path the free base has turned."""
    square = [[0.3, 0, 0], [0.3, 0.3, 0], [0, 0.3, 0], [0, 0, 0]]
    reference = {"kind": "waypoints", "relative": True, "points": square, "durations": [5.0] * 4}
    rollout = simulate(run_spec(controller__kind="unconstrained", reference=reference))
    np.testing.assert_allclose(rollout.tip_position[-1], rollout.tip_position[0], atol=1e-4)
    assert 2 * np.linalg.norm(rollout.base_quat[-1, 1:]) > 1e-3
