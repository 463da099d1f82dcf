"""Runs at torque level: the motion followed is untouched, mechanics holds, and what acts does what it should."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.errors import IntegrationError, SpecError
from fzcli.loop.assemble import closed_loop, parameter_row
from fzcli.loop.compiler import find_compiler
from fzcli.loop.engine import CompiledEngine, VirtualMachine
from fzcli.loop.rollout import Rollout
from fzcli.loop.run_spec import SimulateRun
from fzcli.loop.simulate import simulate
from fzcli.model import RobotModel, build_model
from fzcli.model.algebra import rotate
from fzcli.model.attitude import rotation_matrix
from fzcli.model.free_motion import layout, momentum_motion
from fzcli.model.integrators import munthe_kaas
from fzcli.spec.load import load_robot
from tests.loop.cases import run_spec
from tests.oracle.numpy_reference import NumpyReference, rotation_from_quat
from tests.oracle.table1_robot import bulgarelli4

Array = NDArray[np.float64]
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
ROBUST = {"kind": "robust"}
PD = {"kind": "joint_pd", "stiffness": [60, 200, 400, 20], "damping": [12, 40, 80, 4]}


def _spec(controller: dict[str, Any] | None = None, **changes: Any) -> SimulateRun:
    """The calm line of the test bed for a second and a half, followed by torques."""
    replay = {"controller": controller or ROBUST} | {
        key.removeprefix("replay__"): changes.pop(key) for key in list(changes) if key.startswith("replay__")
    }
    return run_spec(replay=replay, **{"duration": 1.5, **changes})


@pytest.fixture(name="run")
def machine_run(machine: None) -> Any:
    """`simulate` in CasADi's machine."""

    def run(*args: Any, **changes: Any) -> Rollout:
        return simulate(_spec(*args, **changes))

    return run


# The motion followed ---------------------------------------------------------------------------------------


@needs_compiler
def test_the_motion_followed_is_the_run_without_a_replay() -> None:
    """To the last bit: every number of the velocity-level run stands beside those of the torque level."""
    spec = _spec(controller__kind="fuzzy_clik")
    alone, followed = simulate(spec.model_copy(update={"replay": None})), simulate(spec)
    for name in (m for m in alone.metrics if m not in ("n_steps", "attitude_error_max")):
        assert followed.metrics[f"kinematic_{name}"] == alone.metrics[name], name
    away = np.linalg.norm(followed.tip_position - alone.tip_position, axis=1)
    np.testing.assert_allclose(followed.signals["tip_deviation"], away, atol=1e-12)
    assert away.max() < 1e-6
    assert np.abs(followed.q - alone.q).max() < 2e-5


@needs_compiler
def test_bits_do_not_depend_on_lanes_or_threads_and_the_machine_agrees() -> None:
    spec = _spec(replay__errors={"each": 0.2, "masses": [1, -1, 0.5, -0.5, 1]})
    loop = closed_loop(spec, record=False)
    rows = np.tile(parameter_row(spec, loop.parameters), (130, 1))
    rows[:, 0] += np.linspace(0, 0.1, 130)
    steps = np.full(130, 40)
    wide = CompiledEngine(loop).run(rows, steps, jobs=2).metrics
    np.testing.assert_array_equal(CompiledEngine(loop, lanes=1).run(rows[:9], steps[:9]).metrics, wide[:9])
    machine = VirtualMachine(loop).run(rows[:3], steps[:3]).metrics
    np.testing.assert_allclose(machine, wide[:3], rtol=1e-6, atol=1e-12)


def test_every_controller_follows_where_the_model_is_right(run: Any) -> None:
    """Joint feedback lags behind; the others keep to the tip's way."""
    pull = {"kind": "transposed_jacobian", "stiffness": 4000, "damping": 400}
    bounds = ((ROBUST, 1e-7), ({"kind": "computed_torque"}, 1e-5), (pull, 1e-3), (PD, 1e-3))
    for controller, bound in bounds:
        found = run(controller)
        assert found.status.name == "ok", controller
        assert found.metrics["tip_deviation_max"] < bound, controller
        assert found.certificate["energy_balance_max"] < 1e-8, controller
        assert found.certificate["angular_momentum_max"] < 1e-12, controller


def test_wrong_masses_mislead_joints_but_not_the_robust_controller(run: Any) -> None:
    errors = {"each": 0.2, "masses": [1, -1, 0.5, -0.5, 1], "inertias": [-1, 1, 0.5, -1, 0]}
    robust, plain = (run(c, replay__errors=errors, duration=4.0) for c in (ROBUST, {"kind": "computed_torque"}))
    assert robust.metrics["tip_deviation_max"] < 2e-4
    assert robust.metrics["yaw_deviation_max"] < 2e-3
    assert plain.metrics["tip_deviation_max"] > 10 * robust.metrics["tip_deviation_max"]


def test_errors_are_a_robot_of_other_masses(run: Any) -> None:
    """A replay on a robot by file, and one whose errors make the same of the run's own."""
    robot = load_robot("bulgarelli4")
    parts = [part.model_copy(update={"mass": 1.1 * part.mass}) for part in (robot.base, *robot.links)]
    heavier = [part.model_copy(update={"inertia": tuple(1.1 * x for x in part.inertia)}) for part in parts]
    other = robot.model_copy(update={"base": heavier[0], "links": tuple(heavier[1:])})
    by_robot, by_errors = run(replay__robot=other), run(replay__errors={"all": 0.1})
    np.testing.assert_allclose(by_robot.q, by_errors.q, atol=1e-12)
    np.testing.assert_allclose(by_robot.signals["torque"], by_errors.signals["torque"], atol=1e-9)


# Mechanics -------------------------------------------------------------------------------------------------


def test_momentum_is_kept_as_an_independent_engine_counts_it(run: Any) -> None:
    """With momentum of its own at the start; every tenth sample."""
    momentum = {"linear": [0.3, -0.2, 0.1], "angular": [0.05, 0.02, -0.04]}
    found, oracle = run({"kind": "computed_torque"}, start__momentum=momentum), NumpyReference(bulgarelli4())
    for k in range(0, len(found.time), 10):
        total = oracle.momentum(found.q[k], found.base_quat[k], found.qd[k], found.base_twist[k])
        np.testing.assert_allclose(total, [0.3, -0.2, 0.1, 0.05, 0.02, -0.04], atol=1e-11)
    assert found.metrics["joint_deviation_max"] < 1e-4


def test_what_the_arm_does_to_the_base_changes_its_momentum(run: Any) -> None:
    """Nothing else acts on it: the force's impulse is its linear momentum; torques hold still over a step here."""
    found = run(duration=2.0, replay__substeps=1)
    force, momentum = found.signals["base_reaction"][:, :3], found.signals["base_momentum"][:, :3]
    impulse = np.concatenate([[np.zeros(3)], np.cumsum(force[:-1] * 0.01, axis=0)])
    assert np.abs(momentum).max() > 1e-3
    np.testing.assert_allclose(momentum, impulse, atol=0.01 * np.abs(momentum).max())


def test_velocity_and_torque_level_agree() -> None:
    """One q(t) over 15 s, the attitude by a fourth-order step on both: base pose within 1e-7 rad and m."""
    model = build_model(load_robot("ur5_free_flyer"))
    place = layout(model)
    by_torque, times = _by_torque(model, place), np.arange(1501) * 0.01
    by_speed = _by_speed(model)
    apart = by_torque[place.q].T - np.array([np.array(_path(model, ca.DM(t))[0])[:, 0] for t in times])
    assert np.abs(apart).max() < 1e-7, "the same q(t)"
    quats = by_torque[place.quat].T
    turned = 2 * np.linalg.norm([_difference(a, b) for a, b in zip(quats, by_speed, strict=True)], axis=1)
    assert np.linalg.norm(quats[-1, 1:]) > 0.01, "the base has turned"
    assert turned.max() < 1e-7
    coms = np.array(model.function("com").map(1501)(by_torque[place.q], quats.T)).T
    others = np.array(model.function("com").map(1501)(by_torque[place.q], by_speed.T)).T
    assert np.abs(by_torque[place.place].T - by_torque[place.place].T[0]).max() < 1e-12
    assert np.linalg.norm(coms - others, axis=1).max() < 1e-7


def _path(model: RobotModel, t: Any) -> tuple[Any, Any, Any]:
    """q, qd, qdd (n) of a smooth motion from rest."""
    size, pace = ca.DM([0.5, -0.4, 0.6, 0.3, -0.5, 0.4]), ca.DM([0.4, 0.6, 0.5, 0.8, 0.7, 0.9])
    first = ca.DM([0.3, -1.2, 1.0, -0.6, 0.8, 0.2])
    return (
        first + size * (1 - ca.cos(pace * t)),
        size * pace * ca.sin(pace * t),
        size * pace**2 * ca.cos(pace * t),
    )


def _by_torque(model: RobotModel, place: Any) -> Array:
    """States (k, T) under the inverse dynamics of the path, with feedback that keeps rounding down."""
    state, none = ca.SX.sym("state", place.size + 1), ca.SX.zeros(6)
    q, qd, quat = state[place.q], state[place.qd], state[place.quat]
    wanted = _path(model, state[-1])
    qdd = wanted[2] + 20 * (wanted[1] - qd) + 100 * (wanted[0] - q)
    rate = ca.mtimes(model.function("body")(q)[4], qd)
    twist = ca.vertcat(ca.SX.zeros(3), rotate(rotation_matrix(quat), rate))  # the speed of the origin does not matter
    torque = model.function("free_inverse_dynamics")(q, quat, qd, twist, qdd, none, none, ca.SX.zeros(10))[0]
    motion = ca.vertcat(momentum_motion(model)(state[:-1], torque), 1)
    step = munthe_kaas(ca.Function("rate", [state, ca.SX.sym("none", 0)], [motion], ["state", "input"], ["rate"]), 3)
    first = np.zeros(place.size + 1)
    first[place.quat.start] = 1
    first[place.q] = np.array(_path(model, ca.DM(0.0))[0])[:, 0]
    first[place.place] = np.array(model.com(first[place.q], [1, 0, 0, 0]))[:, 0]
    found = np.array(step.mapaccum(1500)(first, np.zeros((0, 1500)), 0.01))
    return np.hstack([first[:, None], found])


def _by_speed(model: RobotModel) -> Array:
    """Base attitudes (T, 4) at zero momentum along the path."""
    state = ca.SX.sym("state", 5)
    q, qd, _ = _path(model, state[4])
    rate = ca.vertcat(ca.mtimes(model.function("body")(q)[4], qd), 1)
    step = munthe_kaas(ca.Function("rate", [state, ca.SX.sym("none", 0)], [rate], ["state", "input"], ["rate"]), 0)
    first = np.array([1.0, 0, 0, 0, 0])
    found = np.array(step.mapaccum(1500)(first, np.zeros((0, 1500)), 0.01))
    return np.hstack([first[:, None], found])[:4].T


def _difference(a: Array, b: Array) -> Array:
    """Half the rotation vector (3) between two attitudes that are close."""
    return np.asarray(a[0] * b[1:] - b[0] * a[1:] - np.cross(a[1:], b[1:]))


# What acts -------------------------------------------------------------------------------------------------


def _limited(effort: float) -> dict[str, Any]:
    robot = load_robot("bulgarelli4")
    links = tuple(
        link.model_copy(update={"joint": link.joint.model_copy(update={"effort": effort})}) for link in robot.links
    )
    return {"robot": robot.model_copy(update={"links": links})}


def test_torques_stay_within_their_limits(run: Any) -> None:
    free, found = run(), run(**_limited(0.01))
    assert np.abs(free.signals["torque"]).max() > 0.02
    assert np.abs(found.signals["torque"]).max() == pytest.approx(0.01)
    assert 0.3 < found.metrics["saturated_mean"] <= 1
    assert found.metrics["torque_max"] == pytest.approx(0.01)
    assert found.metrics["tip_deviation_max"] > 100 * free.metrics["tip_deviation_max"]


def test_a_payload_is_grasped_once_and_its_momentum_taken_along(run: Any) -> None:
    load = {"at": 0.5, "mass": 2.0, "inertia": [0.02, 0.02, 0.02], "velocity": [0.1, -0.05, 0.02]}
    found = run(replay__grasp=load)
    k = 50
    np.testing.assert_allclose(found.q[k - 1], found.q[k], atol=5e-3)
    total = found.signals["kinetic_energy"]
    assert total[k] > 1.5 * total[k - 1], "the payload flew against the arm"
    assert found.certificate["linear_momentum_max"] < 1e-12
    assert found.certificate["energy_balance_max"] < 1e-7
    moved = found.base_position[-1] - run().base_position[-1]
    assert np.abs(moved).max() > 1e-3, "robot and payload fly on together"


def test_a_force_on_the_base_sets_the_robot_in_motion(run: Any) -> None:
    wrench = {"on": "base", "force": [2.0, 0.0, -1.0], "begin": 0.2, "end": 0.7}
    found, oracle = run({"kind": "computed_torque"}, replay__wrenches=[wrench]), NumpyReference(bulgarelli4())
    k = len(found.time) - 1
    total = oracle.momentum(found.q[k], found.base_quat[k], found.qd[k], found.base_twist[k])
    np.testing.assert_allclose(total[:3], [1.0, 0.0, -0.5], atol=1e-10)


def test_a_moment_on_the_tip_turns_the_robot(run: Any) -> None:
    wrench = {"on": "tip", "moment": [0.0, 0.0, 0.05]}
    found, oracle = run({"kind": "computed_torque"}, replay__wrenches=[wrench]), NumpyReference(bulgarelli4())
    total = oracle.momentum(found.q[-1], found.base_quat[-1], found.qd[-1], found.base_twist[-1])
    np.testing.assert_allclose(total[3:], [0.0, 0.0, 0.075], atol=1e-10)


@pytest.mark.parametrize("by", ["wheels", "thrusters"])
def test_attitude_control_holds_the_base(run: Any, by: str) -> None:
    """Wheels take up the momentum, so that it is kept; thrusters bring it from outside."""
    free = run({"kind": "computed_torque"}, duration=3.0)
    held = run({"kind": "computed_torque"}, duration=3.0, replay__attitude={"by": by, "frequency": 5.0})
    turned = [2 * np.linalg.norm(one.base_quat[:, 1:], axis=1).max() for one in (free, held)]
    assert turned[1] < 0.2 * turned[0]
    oracle = NumpyReference(bulgarelli4())
    total = oracle.momentum(held.q[-1], held.base_quat[-1], held.qd[-1], held.base_twist[-1])
    if by == "wheels":
        stored = rotation_from_quat(held.base_quat[-1]) @ held.signals["wheel_momentum"][-1]
        assert np.linalg.norm(stored) > 1e-3
        np.testing.assert_allclose(total[3:] + stored, 0.0, atol=1e-11)
    else:
        assert np.linalg.norm(total[3:]) > 1e-3


def test_a_fixed_base_stays_and_feels_the_arm(run: Any) -> None:
    robot = load_robot("bulgarelli4")
    fixed = robot.model_copy(update={"base": robot.base.model_copy(update={"floating": False})})
    found = run(robot=fixed, controller__kind="unconstrained")
    np.testing.assert_array_equal(found.base_quat, np.tile([1.0, 0.0, 0.0, 0.0], (len(found.time), 1)))
    np.testing.assert_array_equal(found.base_twist, 0.0)
    assert found.metrics["tip_deviation_max"] < 1e-6
    assert found.metrics["reaction_force_max"] > 1e-3


# Integrators, and what is refused --------------------------------------------------------------------------


def test_the_adaptive_integrator_agrees_with_the_fixed_one(run: Any) -> None:
    fixed, adaptive = (run(duration=0.3, replay__integrator=name) for name in ("munthe_kaas", "dormand_prince"))
    np.testing.assert_allclose(adaptive.q, fixed.q, atol=1e-9)
    np.testing.assert_allclose(adaptive.base_quat, fixed.base_quat, atol=1e-9)


HARSH = {"kind": "joint_pd", "stiffness": 1e6, "damping": 1e5}


def test_a_step_that_is_too_large_ends_with_a_status(run: Any) -> None:
    found = run(HARSH, replay__substeps=1)
    assert found.status.name == "failed"
    assert "unstable at 0" in found.status.reason
    assert "the step of torque control and integration is too large for these gains" in found.status.reason
    assert found.status.advice.startswith("raise replay.substeps or lower the gains of replay.controller")


def test_the_adaptive_integrator_refuses_it_by_name(run: Any) -> None:
    with pytest.raises(IntegrationError, match=r"dormand_prince: a step of 0\.01 s is too large: 200 inner steps"):
        run(HARSH, replay__substeps=1, replay__integrator="dormand_prince")


@pytest.mark.parametrize(
    ("replay", "text"),
    [
        (
            {"grasp": [{"at": "3 s", "mass": 1, "inertia": [1, 1, 1]}, {"at": "5 s", "mass": 1, "inertia": [1, 1, 1]}]},
            "replay.grasp: a payload is grasped twice, at 3 s and at 5 s; a tip holds one",
        ),
        ({"controller": {"kind": "joint_pd", "stiffness": -1, "damping": 1}}, "replay.controller.stiffness"),
        ({"controller": {"kind": "robst"}}, "replay.controller.kind: unknown kind 'robst'; did you mean 'robust'?"),
        ({"errors": {"each": 0.2, "masses": [1, 1]}}, "replay.errors.masses: has 2 values for the base, then 4 joints"),
        ({"errors": {"all": -1}}, "replay.errors.all"),
        ({"robot": "ur5_free_flyer"}, "replay.robot: has joints shoulder_pan, shoulder_lift"),
        ({"controller": {"kind": "robust", "tip": "foot"}}, "replay.controller.tip: the robot has no tip 'foot'"),
        ({"substeps": 0}, "replay.substeps"),
    ],
)
def test_bad_input_is_named(replay: dict[str, Any], text: str) -> None:
    with pytest.raises(SpecError) as caught:
        run_spec(replay={"controller": ROBUST, **replay})
    assert text in str(caught.value)


def test_a_link_without_inertia_is_named() -> None:
    robot = load_robot("bulgarelli4")
    last = robot.links[-1].model_copy(update={"mass": 0.0, "inertia": (0.0,) * 6})
    spec = _spec(robot=robot.model_copy(update={"links": (*robot.links[:-1], last)}))
    with pytest.raises(SpecError, match="joint 'q4' moves no inertia, so that no torque has a finite effect on it"):
        simulate(spec)
