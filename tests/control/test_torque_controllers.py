"""Torque controllers: what accelerations their torques have on the robot that they believe in."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fzcli.control.torque.followed import base_followed, tip_followed
from fzcli.control.torque.law import TorqueInputs
from fzcli.control.torque.registry import TORQUE_CONTROLLERS
from fzcli.model import RobotModel, build_model
from fzcli.spec.load import load_robot
from tests.oracle.numpy_reference import quat_multiply

Array = NDArray[np.float64]
GAINS = {"joint_pd": {"stiffness": 50.0, "damping": [1.0, 2.0, 3.0, 4.0]}}


@pytest.fixture(scope="module")
def model() -> RobotModel:
    return build_model(load_robot("bulgarelli4"))


def _unit(quat: Array) -> Array:
    return np.asarray(quat / np.linalg.norm(quat))


def _measured(model: RobotModel, seed: int = 0) -> dict[str, Array]:
    """A random motion with momentum, and the same motion as the wanted one: no error."""
    rng = np.random.default_rng(seed)
    q, qd = np.array([0.9, -1.4, 0.3, 0.5]) + rng.uniform(-0.2, 0.2, 4), rng.uniform(-0.3, 0.3, 4)
    quat, twist, position = _unit(np.array([1.0, 0.1, -0.2, 0.1])), rng.uniform(-0.2, 0.2, 6), rng.normal(size=3)
    point, rotation, tip_twist = (np.array(x) for x in model.function("tip_state")(q, quat, qd, twist))
    wanted = {
        "q_wanted": q,
        "qd_wanted": qd,
        "qdd_wanted": rng.uniform(-1, 1, 4),
        "tip_position_wanted": position + point[:, 0],
        "tip_velocity_wanted": tip_twist[:3, 0],
        "tip_quat_wanted": _quat(rotation),
        "tip_rate_wanted": tip_twist[3:, 0],
        "base_quat_wanted": quat,
        "base_rate_wanted": twist[3:],
    }
    return {"q": q, "qd": qd, "base_position": position, "base_quat": quat, "base_twist": twist, **wanted}


def _quat(rotation: Array) -> Array:
    return np.asarray(Rotation.from_matrix(rotation).as_quat()[[3, 0, 1, 2]])


def _torque(model: RobotModel, kind: str, values: dict[str, Array], **changes: Any) -> Array:
    entry = TORQUE_CONTROLLERS[kind]
    spec = entry.spec(**{**GAINS.get(kind, {}), **changes})
    law = entry.build(model, spec)
    gains = [np.broadcast_to(spec.value_at(p.path.rpartition(".")[2]), p.size) for p in law.parameters]
    results = law.function(*values.values(), np.concatenate(gains))
    return np.array(results[0] if isinstance(results, tuple) else results)[:, 0]


def _acceleration(model: RobotModel, values: dict[str, Array], torque: Array) -> tuple[Array, Array]:
    """qdd (n) and base_acceleration (6) that torques cause."""
    moved = (values["q"], values["base_quat"], values["qd"], values["base_twist"])
    found = model.function("forward_dynamics")(*moved, torque, np.zeros(6), np.zeros(6), np.zeros(10))
    return np.array(found[0])[:, 0], np.array(found[1])[:, 0]


def test_joint_pd_is_its_formula(model: RobotModel) -> None:
    values = _measured(model)
    values["q"] = values["q"] + [0.01, -0.02, 0.03, 0.0]
    values["qd"] = values["qd"] - [0.1, 0.0, 0.0, 0.2]
    expected = [50 * -0.01 + 0.1, 50 * 0.02, 50 * -0.03, 0.2 * 4]
    np.testing.assert_allclose(_torque(model, "joint_pd", values), expected, atol=1e-12)


def test_computed_torque_gives_the_accelerations_that_it_asks_for(model: RobotModel) -> None:
    values = _measured(model)
    away, faster = np.array([0.01, -0.02, 0.005, 0.03]), np.array([0.1, 0.0, -0.2, 0.05])
    values["q_wanted"], values["qd_wanted"] = values["q"] + away, values["qd"] + faster
    qdd = _acceleration(model, values, _torque(model, "computed_torque", values, frequency=7.0, damping=0.5))[0]
    np.testing.assert_allclose(qdd, values["qdd_wanted"] + 7 * faster + 49 * away, rtol=1e-9)


def test_the_transposed_jacobian_pulls_at_the_tip(model: RobotModel) -> None:
    """J^T f: the power of the torques at any joint rates is that of the force at the tip of the free robot."""
    values = _measured(model)
    values["tip_position_wanted"] = values["tip_position_wanted"] + [0.02, 0.0, -0.01]
    torque = _torque(model, "transposed_jacobian", values, stiffness=300.0, joint_damping=0.0)
    J = np.array(model.generalized_jacobian(values["q"], values["base_quat"]))
    np.testing.assert_allclose(torque, J[:3].T @ [6.0, 0.0, -3.0], atol=1e-11)
    values["qd"] = values["qd"] + 1.0
    slowed = _torque(model, "transposed_jacobian", values, stiffness=300.0, damping=0.0, joint_damping=2.0)
    np.testing.assert_allclose(torque - slowed, 2.0 * values["qd"], atol=1e-11)


@pytest.mark.parametrize("changes", [{}, {"base": ("rotation_vector",)}, {"task": "pose", "base": ()}])
def test_robust_without_error_is_the_inverse_dynamics(model: RobotModel, changes: dict[str, Any]) -> None:
    values = _measured(model)
    qdd = _acceleration(model, values, _torque(model, "robust", values, **changes))[0]
    np.testing.assert_allclose(qdd, values["qdd_wanted"], atol=1e-9)


def test_robust_drives_tip_and_yaw_onto_their_surfaces(model: RobotModel) -> None:
    """With damping next to none, tip and yaw get the accelerations that the sliding law asks for, and no less."""
    values = _measured(model)
    before = _acceleration(model, values, _torque(model, "robust", values))
    error, slip = np.array([3e-4, -2e-4, 1e-4]), np.array([2e-3, 1e-3, -1e-3])
    values["tip_position_wanted"] = values["tip_position_wanted"] + error
    values["tip_velocity_wanted"] = values["tip_velocity_wanted"] + slip
    gains = {"rate": 10.0, "reach": 20.0, "switch": 2.0, "layer": 0.1, "tip_damping": 1e-6, "base_damping": 1e-6}
    after = _acceleration(model, values, _torque(model, "robust", values, **gains))
    J = np.array(model.generalized_jacobian(values["q"], values["base_quat"]))[:3]
    sigma = slip + 10 * error
    np.testing.assert_allclose(J @ (after[0] - before[0]), 10 * slip + 20 * sigma + 2 * sigma / 0.1, atol=1e-7)
    yaw, pitch = _yaw_and_pitch(values["base_quat"])
    row = np.array([np.cos(yaw) * np.tan(pitch), np.sin(yaw) * np.tan(pitch), 1.0])
    W = np.array(model.base_rate_map(values["q"], values["base_quat"]))
    assert abs(row @ W @ (after[0] - before[0])) < 1e-7, "the tip's correction leaves the yaw alone"


def test_followed_rows_and_rates_are_derivatives(model: RobotModel) -> None:
    """Errors differenced along the motion give their rates; along a joint's free motion, minus its row."""
    inputs = TorqueInputs.symbols(4)
    tip, base = tip_followed(model, inputs, None, pose=True), base_followed(model, inputs, ("roll", "pitch", "yaw"))
    together = ca.Function(
        "together",
        list(inputs.as_dict().values()),
        [ca.densify(x) for x in (tip.error, tip.rate, tip.rows, base.error, base.rate, base.rows)],
    )
    values = _measured(model, seed=5)
    h, W = 1e-6, np.array(model.base_rate_map(values["q"], values["base_quat"]))
    base_map = np.array(model.function("momentum_map")(values["q"], values["base_quat"])[0])
    joint_map = np.array(model.function("momentum_map")(values["q"], values["base_quat"])[1])
    for joint in range(4):
        qd = np.eye(4)[joint]
        twist = -np.linalg.solve(base_map, joint_map @ qd)  # no momentum
        np.testing.assert_allclose(twist[3:], W @ qd, atol=1e-12)
        moved = [_moved(values, qd, twist, sign * h) for sign in (-1, 1)]
        errors = [[np.array(x) for x in together(*one.values())] for one in moved]
        now = [np.array(x) for x in together(*{**values, "qd": qd, "base_twist": twist}.values())]
        still = [np.array(x) for x in together(*_standing(values).values())]
        slope = (errors[1][0] - errors[0][0]) / (2 * h)
        np.testing.assert_allclose(slope[:, 0], -now[2][:, joint], atol=1e-7)
        np.testing.assert_allclose(now[1] - still[1], slope, atol=1e-7)
        slope = (errors[1][3] - errors[0][3])[:, 0] / (2 * h)
        np.testing.assert_allclose(slope, -now[5][:, joint], atol=1e-7)
        np.testing.assert_allclose((now[4] - still[4])[:, 0], slope, atol=1e-7)


def _standing(values: dict[str, Array]) -> dict[str, Array]:
    return {**values, "qd": np.zeros(4), "base_twist": np.zeros(6)}


def _yaw_and_pitch(quat: Array) -> tuple[float, float]:
    w, x, y, z = quat
    return float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))), float(np.arcsin(2 * (w * y - x * z)))


def _moved(values: dict[str, Array], qd: Array, twist: Array, dt: float) -> dict[str, Array]:
    """The measured pose a moment later, the wanted one left alone."""
    turn = 0.5 * dt * twist[3:]
    quat = _unit(quat_multiply(np.concatenate([[1.0], turn]), values["base_quat"]))
    moved = {"q": values["q"] + dt * qd, "base_quat": quat, "base_position": values["base_position"] + dt * twist[:3]}
    return {**values, **moved}
