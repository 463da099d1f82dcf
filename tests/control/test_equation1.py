"""The laws' joint rates against equation 1 written down in NumPy, world axes, with numpy's own solver."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.control.constraint import constraint_of
from fzcli.control.law import LawInputs
from fzcli.control.registry import controllers
from fzcli.control.task import body_at
from fzcli.model import RobotModel, build_model
from fzcli.spec.load import load_robot, load_rulebase
from tests.oracle.numpy_reference import NumpyReference, quat_exp, quat_multiply, rotation_from_quat
from tests.oracle.numpy_reference import rotation_vector as log
from tests.oracle.plain_loop import angle_rates, roll_pitch_yaw
from tests.oracle.random_trees import random_robot

Array = NDArray[np.float64]
KP, DAMPING = 3.2, 1e-3
ROWS = {"position": slice(0, 3), "orientation": slice(3, 6), "pose": slice(0, 6)}
CONSTRAINTS = [
    ("yaw",),
    ("roll",),
    ("pitch",),
    ("roll", "pitch"),
    ("yaw", "roll"),
    ("pitch", "yaw"),
    ("roll", "pitch", "yaw"),
    ("rotation_vector",),
]
SEVEN = next(  # a floating tree of seven joints or more
    seed for seed in range(100) if random_robot(seed).base.floating and NumpyReference(random_robot(seed)).n >= 7
)
ROBOTS = {"bulgarelli4": load_robot("bulgarelli4"), "ur5": load_robot("ur5_free_flyer"), "tree": random_robot(SEVEN)}


@cache
def _model(robot: str) -> RobotModel:
    return build_model(ROBOTS[robot])


def _draw(n: int, rng: np.random.Generator) -> dict[str, Array]:
    """A state and what is wanted of it; pitch stays away from 90 deg."""
    while True:
        base_quat = rng.standard_normal(4)
        base_quat /= np.linalg.norm(base_quat)
        if abs(roll_pitch_yaw(rotation_from_quat(base_quat))[1]) < 1.2:
            break
    tip_quat = rng.standard_normal(4)
    return {
        "q": rng.uniform(-np.pi, np.pi, n),
        "base_quat": base_quat,
        "angular_momentum": rng.normal(size=3),
        "tip_position": rng.normal(size=3),
        "tip_velocity": rng.normal(size=3),
        "tip_quat": tip_quat / np.linalg.norm(tip_quat),
        "tip_rate": rng.normal(size=3),
        "base_angles": rng.uniform(-1.0, 1.0, 3),
        "base_rates": rng.normal(size=3),
        "step": np.array(7.0),
    }


def _constraint(x: dict[str, Array], W: Array, drift: Array, names: tuple[str, ...]) -> tuple[Array, Array, Array]:
    """Error, rows and wanted rate of the constraint; W and drift in world axes."""
    R = rotation_from_quat(x["base_quat"])
    if names == ("rotation_vector",):
        z, y, _ = np.eye(3)[::-1]
        wanted = np.eye(4)[0]
        for axis, angle in zip(np.eye(3)[::-1], x["base_angles"][::-1], strict=True):
            wanted = quat_multiply(wanted, quat_exp(axis * angle))
        pitch_axis = rotation_from_quat(quat_exp(z * x["base_angles"][2])) @ y
        roll_axis = rotation_from_quat(wanted)[:, 0]
        rate = x["base_rates"] @ np.array([roll_axis, pitch_axis, z])
        return log(rotation_from_quat(wanted) @ R.T), W, rate - drift
    picked = [("roll", "pitch", "yaw").index(name) for name in names]
    E = angle_rates(R)[picked]
    error = (x["base_angles"] - roll_pitch_yaw(R))[picked]
    error = (error + np.pi) % (2 * np.pi) - np.pi
    return error, E @ W, x["base_rates"][picked] - E @ drift


def joint_rates(
    oracle: NumpyReference, x: dict[str, Array], task: str, names: tuple[str, ...], gain: Array, base_damping: float
) -> Array:
    """qd = J+ v + (E - J+ J) Jc^T (Kc ec + rate), v = Kp e + xd_d, momentum's drift taken off.

    With ``base_damping``, by priority: J+ v + M^T (M M^T + base_damping E)^-1 (Kc ec + rate - Jc J+ v), M = Jc N.
    """
    q, quat = x["q"], x["base_quat"]
    position, rotation = oracle.forward_kinematics(q, quat)
    drift = np.linalg.solve(oracle.system_inertia(q, quat), x["angular_momentum"])
    J = oracle.generalized_jacobian(q, quat)[ROWS[task]]
    error = np.concatenate([x["tip_position"] - position, log(rotation_from_quat(x["tip_quat"]) @ rotation.T)])
    wanted = np.concatenate([x["tip_velocity"] - np.cross(drift, position), x["tip_rate"] - drift])
    J_plus = J.T @ np.linalg.inv(J @ J.T + DAMPING * np.eye(len(J)))
    ec, Jc, rate = _constraint(x, oracle.base_rate_map(q, quat), drift, names)
    first, N = J_plus @ (KP * error + wanted)[ROWS[task]], np.eye(len(q)) - J_plus @ J
    if base_damping:
        M = Jc @ N
        left = gain * ec + rate - Jc @ first
        return first + M.T @ np.linalg.solve(M @ M.T + base_damping * np.eye(len(M)), left)
    return first + N @ (Jc.T @ (gain * ec + rate) if len(gain) else np.zeros(len(q)))


def _evaluate(law: object, x: dict[str, Array], parameters: Array) -> dict[str, Array]:
    function = law.function  # type: ignore[attr-defined]
    given = {
        **x,
        "memory": np.array(law.memory0(parameters)),  # type: ignore[attr-defined]
        "history": np.zeros(function.size1_in("history")),
        "parameters": parameters,
    }
    return {name: np.array(value).ravel() for name, value in function(**given).items()}


@pytest.mark.parametrize("robot", list(ROBOTS))
@pytest.mark.parametrize("task", list(ROWS))
@pytest.mark.parametrize("names", CONSTRAINTS, ids="-".join)
def test_joint_rates_of_every_law(robot: str, task: str, names: tuple[str, ...]) -> None:
    model, oracle = _model(robot), NumpyReference(ROBOTS[robot])
    rng = np.random.default_rng([len(robot), len(task), CONSTRAINTS.index(names)])
    gains = rng.uniform(1, 50, 3 if names == ("rotation_vector",) else len(names))
    common = {"task": task, "constraint": names, "damping": DAMPING}
    specs = {
        "unconstrained": (common, np.zeros(0)),
        "clik": (common | {"gain": tuple(gains)}, gains),
        "fuzzy_clik": (common | {"gain": tuple(gains), "rulebase": load_rulebase("bulgarelli2011")}, gains),
    }
    specs["task_priority"] = (specs["clik"][0] | {"base_damping": DAMPING}, gains)
    specs["fuzzy_task_priority"] = (specs["fuzzy_clik"][0] | {"base_damping": DAMPING}, gains)
    for kind, (fields, gain) in specs.items():
        if kind.startswith("fuzzy") and task != "position":
            continue
        base_damping = DAMPING if kind.endswith("priority") else 0.0
        entry = controllers()[kind]
        law = entry.build(model, entry.spec.model_validate(fields))
        for _ in range(4):
            x = _draw(model.n, rng)
            own = {"task_priority": [DAMPING], "fuzzy_task_priority": [DAMPING, 0.01]}.get(kind, [])
            result = _evaluate(law, x, np.concatenate([[KP], gain, own]))
            expected = joint_rates(oracle, x, task, names, gain, base_damping)
            scale = np.abs(expected).max()
            np.testing.assert_allclose(result["command"], expected, atol=1e-10 * scale, rtol=1e-9, err_msg=kind)


def test_signals_name_what_they_hold() -> None:
    model, oracle = build_model(ROBOTS["bulgarelli4"]), NumpyReference(ROBOTS["bulgarelli4"])
    entry = controllers()["clik"]
    law = entry.build(model, entry.spec.model_validate({"gain": (3.0, 4.0), "constraint": ("pitch", "yaw")}))
    x = _draw(4, np.random.default_rng(5))
    result = _evaluate(law, x, np.array([KP, 3.0, 4.0]))
    position, _ = oracle.forward_kinematics(x["q"], x["base_quat"])
    J = oracle.generalized_jacobian(x["q"], x["base_quat"])[:3]
    _, pitch, yaw = roll_pitch_yaw(rotation_from_quat(x["base_quat"]))
    assert result["tip_error"] == pytest.approx(np.linalg.norm(x["tip_position"] - position), rel=1e-12)
    assert result["pitch"] == pytest.approx(pitch, abs=1e-12)
    assert result["yaw"] == pytest.approx(yaw, abs=1e-12)
    assert result["yaw_abs"] == pytest.approx(abs(yaw), abs=1e-12)
    assert (result["gain_pitch"], result["gain_yaw"]) == (3.0, 4.0)
    trace = np.trace(np.linalg.inv(J @ J.T + 1e-8 * np.eye(3)))
    assert result["conditioning"] == pytest.approx(trace, rel=1e-9)
    smallest = np.linalg.svd(J, compute_uv=False).min()
    assert float(law.singular_value(x["q"])) == pytest.approx(smallest, rel=1e-6)


def test_the_error_of_an_angle_goes_the_short_way_round() -> None:
    model = build_model(ROBOTS["bulgarelli4"])
    entry = controllers()["clik"]
    law = entry.build(model, entry.spec.model_validate({"gain": 1.0}))
    x = _draw(4, np.random.default_rng(1))
    x["base_quat"] = quat_exp(np.array([0.0, 0.0, 3.0]))
    x["base_angles"] = np.array([0.0, 0.0, -3.0])
    result = _evaluate(law, x, np.array([KP, 1.0]))
    assert result["yaw_error"] == pytest.approx(2 * np.pi - 6.0, abs=1e-12)


@pytest.mark.parametrize("names", CONSTRAINTS, ids="-".join)
def test_rows_are_the_derivative_of_the_angles(names: tuple[str, ...]) -> None:
    """Central differences of the error along the motion that joint rates give the base."""
    model = build_model(ROBOTS["ur5"])
    inputs = LawInputs.symbols(model.n)
    found = constraint_of(inputs, body_at(model, inputs), names)
    function = ca.Function(
        "constraint",
        [inputs.q, inputs.base_quat, inputs.angular_momentum, inputs.base_angles, inputs.base_rates],
        [found.error, found.rows],
    )
    rng = np.random.default_rng(3)
    for _ in range(5):
        x, qd, h = _draw(model.n, rng), rng.normal(size=model.n), 1e-6
        held = (np.zeros(3), np.array(roll_pitch_yaw(rotation_from_quat(x["base_quat"]))), np.zeros(3))
        rate = np.array(model.base_rate_map(x["q"], x["base_quat"])) @ qd  # world

        def error(t: float, x: dict[str, Array] = x, rate: Array = rate, held: tuple[Array, ...] = held) -> Array:
            moved = quat_multiply(quat_exp(rate * t), x["base_quat"])
            return np.array(function(x["q"], moved, *held)[0]).ravel()

        rows = np.array(function(x["q"], x["base_quat"], *held)[1])
        np.testing.assert_allclose((error(h) - error(-h)) / (2 * h), -rows @ qd, rtol=1e-6, atol=1e-7)


def test_null_space_motion_leaves_the_task_alone() -> None:
    """Without damping J (qd(Kc) - qd(0)) = 0."""
    robot: RobotModel = build_model(ROBOTS["tree"])
    oracle, entry = NumpyReference(ROBOTS["tree"]), controllers()["clik"]
    law = entry.build(robot, entry.spec.model_validate({"gain": 5.0, "damping": 0.0}))
    x = _draw(robot.n, np.random.default_rng(2))
    x["base_rates"] = np.zeros(3)
    x["angular_momentum"] = np.zeros(3)
    commands = [_evaluate(law, x, np.array([KP, gain]))["command"] for gain in (0.0, 50.0)]
    J = oracle.generalized_jacobian(x["q"], x["base_quat"])[:3]
    extra = commands[1] - commands[0]
    assert np.linalg.norm(extra) > 1e-3
    np.testing.assert_allclose(J @ extra, 0.0, atol=1e-10 * np.linalg.norm(extra))
