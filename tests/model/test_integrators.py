"""Integrators: orders at momentum, closed forms, conservation laws, and MuJoCo's RK4 beside."""

from collections.abc import Callable
from functools import cache

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ellipj

from fzcli.errors import IntegrationError, SpecError
from fzcli.model import RobotModel, build_model
from fzcli.model.free_motion import ATTITUDE, layout, momentum_motion, observe_momentum_motion, twist_motion
from fzcli.model.integrators import dormand_prince, euler, munthe_kaas, rk4
from fzcli.model.integrators.group import Rate, moved, step_function
from fzcli.spec.load import load_robot
from fzcli.spec.robot import Friction
from tests.oracle.mujoco_oracle import MujocoOracle
from tests.oracle.numpy_reference import rotation_about, rotation_from_quat, rotation_vector
from tests.oracle.random_trees import random_robot

Array = NDArray[np.float64]
Builder = Callable[[ca.Function, int | None], ca.Function]
NOTHING = np.zeros(10)
HOME = np.deg2rad([0, -90, 0, -90, 0, 0])
MOTIONS = (twist_motion, momentum_motion)
EVERYTHING = ("torque", "base_wrench", "wheel_torque", "tip_wrench", "payload")


def averaged(rate: ca.Function, attitude: int | None) -> ca.Function:
    """The trap: RK4 whose stages turn by averaged rates as if they commuted, as game engines do."""

    def advance(state: ca.SX, at: Rate, dt: ca.SX) -> ca.SX:
        first = at(state)
        second = at(moved(state, 0.5 * dt * first, attitude))
        third = at(moved(state, 0.5 * dt * second, attitude))
        fourth = at(moved(state, dt * third, attitude))
        return moved(state, dt / 6 * (first + 2 * (second + third) + fourth), attitude)

    return step_function("averaged", rate, advance)


@cache
def _flyer() -> RobotModel:
    return build_model(load_robot("robots/ur5_free_flyer.yaml"))


def _run(step: ca.Function, start: Array, dt: float, duration: float, given: Array | None = None) -> Array:
    """All states after the start, (size, steps)."""
    count = round(duration / dt)
    size = step.size1_in(1)
    held = np.zeros((size, count)) if given is None else np.broadcast_to(given[:, None], (size, count))
    return np.array(step.mapaccum(count)(start, held, np.full((1, count), dt)))


def _column(value: object) -> Array:
    return np.array(value, dtype=float)[:, 0]


# A free rigid body -----------------------------------------------------------------------------------------

MOMENTS = np.array([1.0, 2.0, 3.0])


def _rigid_body() -> ca.Function:
    """Euler's equations: state base_quat (4), angular velocity (3) in body axes; an input that does nothing."""
    state, given = ca.SX.sym("state", 7), ca.SX.sym("input", 1)
    w, moments = state[4:], ca.SX(ca.DM(MOMENTS))
    return ca.Function("body", [state, given], [ca.vertcat(w, -ca.cross(w, moments * w) / moments)])


def tumbling(moments: Array, w_start: Array, time: float) -> tuple[Array, Array]:
    """Angular velocity (3, body axes) and attitude (3, 3) of a free body whose middle component starts at 0.

    Jacobi's solution for moments in rising order and L^2 above 2 E times the middle one (Landau and Lifshitz,
    Mechanics, section 37); the precession angle by quadrature. World z is along L.
    """
    a, b, c = moments
    momentum, energy2 = float(np.linalg.norm(moments * w_start)), float(w_start @ (moments * w_start))
    square = momentum**2
    size = np.sqrt(
        [
            (energy2 * c - square) / (a * (c - a)),
            (energy2 * c - square) / (b * (c - b)),
            (square - energy2 * a) / (c * (c - a)),
        ]
    )
    pace = np.sqrt((c - b) * (square - energy2 * a) / (a * b * c))
    modulus = (b - a) * (energy2 * c - square) / ((c - b) * (square - energy2 * a))

    def rate(t: float) -> Array:
        sn, cn, dn, _ = ellipj(pace * t, modulus)
        return size * np.array([cn, sn, dn])

    def precession(t: float) -> float:
        w = rate(t)
        return float(momentum * (a * w[0] ** 2 + b * w[1] ** 2) / ((a * w[0]) ** 2 + (b * w[1]) ** 2))

    nodes, weights = np.polynomial.legendre.leggauss(16)
    half = time / 80
    middles = half * np.arange(1, 80, 2)
    angle = sum(half * w * precession(m + half * x) for m in middles for x, w in zip(nodes, weights, strict=True))
    w = rate(time)
    nutation, spin = np.arccos(c * w[2] / momentum), np.arctan2(a * w[0], b * w[1])
    x, z = np.eye(3)[0], np.eye(3)[2]
    return w, rotation_about(z, angle) @ rotation_about(x, nutation) @ rotation_about(z, spin)


def _quat(rotation: Array) -> Array:
    vector = rotation_vector(rotation)
    half = np.linalg.norm(vector) / 2
    return np.concatenate([[np.cos(half)], np.sin(half) * vector / (2 * half)])


START_RATE = np.array([1.1, 0.0, 1.6])


def _tumbling_error(build: Builder, dt: float, duration: float) -> float:
    step = build(_rigid_body(), 0)
    start = np.concatenate([_quat(tumbling(MOMENTS, START_RATE, 0.0)[1]), START_RATE])
    end = _run(step, start, dt, duration)[:, -1]
    rate, attitude = tumbling(MOMENTS, START_RATE, duration)
    turned = rotation_vector(rotation_from_quat(end[:4]).T @ attitude)
    return float(max(np.max(np.abs(end[4:] - rate)), np.max(np.abs(turned))))


@pytest.mark.parametrize(("build", "order"), [(euler, 1), (averaged, 2), (rk4, 4), (munthe_kaas, 4)])
def test_orders_on_a_tumbling_body(build: Builder, order: int) -> None:
    coarse, fine = (_tumbling_error(build, dt, 4.0) for dt in (0.01, 0.005))
    assert abs(np.log2(coarse / fine) - order) < 0.15, (coarse, fine)


def test_a_tumbling_body_follows_jacobis_elliptic_functions() -> None:
    assert _tumbling_error(munthe_kaas, 0.002, 20.0) <= 1e-9
    body = dormand_prince(_rigid_body(), 0, relative=1e-12, absolute=1e-12, inner_steps=5000)
    state = np.concatenate([_quat(tumbling(MOMENTS, START_RATE, 0.0)[1]), START_RATE])
    done = body.advance(state, [0.0], 20.0)
    rate, attitude = tumbling(MOMENTS, START_RATE, 20.0)
    assert np.max(np.abs(done.state[4:] - rate)) <= 1e-10
    assert np.max(np.abs(rotation_vector(rotation_from_quat(done.state[:4]).T @ attitude))) <= 1e-10


def test_a_flyer_with_locked_joints_tumbles_as_one_body() -> None:
    """Forward and inverse dynamics together: torques that hold the joints make the flyer a rigid body."""
    model = _flyer()
    q, none = np.linspace(-1.0, 1.5, 6), np.zeros(6)
    moments, axes = np.linalg.eigh(np.array(model.function("body")(q)[1]))
    axes = axes * np.sign(np.linalg.det(axes))  # principal to base axes
    rate = np.array([0.3, 0.0, 1.6])
    end_rate, end_attitude = tumbling(moments, rate, 10.0)
    attitude = tumbling(moments, rate, 0.0)[1] @ axes.T
    place, free = layout(model), twist_motion(model)
    state, given = ca.SX.sym("state", place.size), ca.SX.sym("input", 1)
    holding = model.function("free_inverse_dynamics")(
        state[place.q], state[place.quat], state[place.qd], state[place.velocity], none, none, none, NOTHING
    )[0]
    locked = ca.Function("locked", [state, given], [free(state, holding)])
    com = _column(model.com(q, _quat(attitude)))
    spin = attitude @ axes @ rate
    twist = np.concatenate([-np.cross(spin, com), spin])
    start = np.concatenate([-com, _quat(attitude), q, twist, none])
    end = _run(munthe_kaas(locked, ATTITUDE), start, 0.01, 10.0)[:, -1]
    turn = rotation_from_quat(end[place.quat])
    assert np.max(np.abs(end[place.q] - q)) <= 1e-9
    assert np.max(np.abs(rotation_vector((turn @ axes).T @ end_attitude))) <= 2e-9
    assert np.max(np.abs(axes.T @ turn.T @ end[place.velocity][3:] - end_rate)) <= 2e-9
    assert np.max(np.abs(end[place.place] + _column(model.com(end[place.q], end[place.quat])))) <= 2e-9


# The UR5 flyer ---------------------------------------------------------------------------------------------


def _start(q: Array, qd: Array, rate: Array) -> tuple[Array, Array, Array, float]:
    """States of both motions at rest of the CoM, the momentum (6) and the kinetic energy."""
    model, quat = _flyer(), np.array([1.0, 0.0, 0.0, 0.0])
    drifting = _column(model.momentum(q, quat, qd, np.concatenate([np.zeros(3), rate])))
    twist = np.concatenate([-drifting[:3] / model.mass, rate])
    momentum, com = (_column(x) for x in model.function("system_momentum")(q, quat, qd, twist, NOTHING))
    energy = float(model.function("kinetic_energy")(q, quat, qd, twist, NOTHING))
    by_twist = np.concatenate([np.zeros(3), quat, q, twist, qd])
    by_momentum = np.concatenate([com, quat, q, momentum, qd])
    return by_twist, by_momentum, momentum, energy


def _twenty(direction: Array) -> Array:
    """The base rate in this direction at which the flyer at HOME, joints at rest, has |L| = 20 N m s."""
    momentum = _start(HOME, np.zeros(6), direction)[2]
    return direction * (20.0 / float(np.linalg.norm(momentum[3:])))


def _momenta(states: Array) -> Array:
    """The momentum (6, steps) that the states of a twist motion mean."""
    place, momentum = layout(_flyer()), _flyer().function("system_momentum").map(states.shape[1])
    parts = [states[part] for part in (place.q, place.quat, place.qd, place.velocity)]
    return np.array(momentum(*parts, np.zeros((10, states.shape[1])))[0])


def _angular_error(states: Array, momentum: Array) -> float:
    return float(np.max(np.linalg.norm(_momenta(states)[3:] - momentum[3:, None], axis=0)))


def _mujoco_error(start: Array, momentum: Array, dt: float, duration: float) -> float:
    place, oracle = layout(_flyer()), MujocoOracle(_flyer().robot, dt)
    oracle.place(*(start[part] for part in (place.q, place.quat, place.qd, place.velocity)))
    rows = oracle.run(round(duration / dt))
    position, velocity = rows[:, :13], rows[:, 13:]
    turned = np.array([rotation_from_quat(x[3:7]) @ v[3:6] for x, v in zip(position, velocity, strict=True)])
    states = np.hstack([position[:, :13], velocity[:, :3], turned, velocity[:, 6:]]).T
    return _angular_error(states, momentum)


def test_angular_momentum_of_a_turning_flyer_with_its_twist_as_state() -> None:
    """A turn about nearly the same axis, joints below 3 rad/s: the trap shows where the fourth order holds.

    How much momentum a step costs hangs on how fast the free joints whip: see the next test.
    """
    start, _, momentum, _ = _start(HOME, np.zeros(6), _twenty(np.array([1.2, 0.3, 0.1])))
    assert abs(np.linalg.norm(momentum[3:]) - 20.0) < 1e-9
    step, trap = (build(twist_motion(_flyer()), ATTITUDE) for build in (munthe_kaas, averaged))
    assert _angular_error(_run(step, start, 0.01, 10.0), momentum) <= 5e-9
    assert _angular_error(_run(step, start, 0.002, 10.0), momentum) <= 1e-11
    assert _angular_error(_run(trap, start, 0.01, 10.0), momentum) >= 1e-7


STARTS = [(home, draw) for home in ("straight", "elbow", "zero") for draw in range(3)]


@pytest.mark.parametrize(("home", "draw"), STARTS)
def test_momentum_as_a_state_is_kept_in_any_tumble_beside_mujoco(home: str, draw: int) -> None:
    """|L| = 20 N m s about any axis, joints up to 40 rad/s; a twist as state, MuJoCo's or ours, loses 1e-9 to 1e-3."""
    q = {"straight": HOME, "elbow": np.deg2rad([0, -90, -90, -90, 90, 0]), "zero": np.zeros(6)}[home]
    direction = np.random.default_rng((20, draw)).standard_normal(3)
    at_one = _start(q, np.zeros(6), direction)[2]
    by_twist, start, momentum, energy = _start(q, np.zeros(6), direction * 20 / np.linalg.norm(at_one[3:]))
    step = munthe_kaas(momentum_motion(_flyer()), ATTITUDE)
    for dt, bound, energy_bound in ((0.01, 5e-9, 2e-3), (0.002, 1e-11, 1e-5)):
        states, energies = _seen(_run(step, start, dt, 10.0))
        assert _angular_error(states, momentum) <= min(bound, _mujoco_error(by_twist, momentum, dt, 10.0))
        assert np.max(np.abs(_momenta(states)[:3])) <= 1e-11
        assert np.max(np.abs(energies / energy - 1)) <= energy_bound


def _seen(states: Array) -> tuple[Array, Array]:
    """States of a momentum motion as those of a twist motion, and the kinetic energies."""
    model, place, count = _flyer(), layout(_flyer()), states.shape[1]
    position, twist = (
        np.array(x) for x in observe_momentum_motion(model).map(count)(states, np.zeros((6, count)))
    )
    parts = [states[part] for part in (place.q, place.quat, place.qd)]
    energies = np.array(model.function("kinetic_energy").map(count)(*parts, twist, np.zeros((10, count))))
    return np.vstack([position, parts[1], parts[0], twist, parts[2]]), energies


def _flyer_errors(build: Builder, momentum: float, steps: tuple[float, ...]) -> list[float]:
    """Distance in q and attitude from a tight Dormand-Prince run after 2 s, a step size each."""
    model = _flyer()
    qd = np.array([0.3, -0.2, 0.4, 0.1, -0.3, 0.2])
    rate = _twenty(np.array([1.2, 0.3, 0.1])) * momentum / 20.0
    if momentum == 0:
        rate = _column(model.base_rate_map(HOME, [1, 0, 0, 0]) @ ca.DM(qd))
    start = _start(HOME, qd, rate)[0]
    motion, place = twist_motion(model), layout(model)
    exact = dormand_prince(motion, ATTITUDE, relative=1e-13, absolute=1e-13).advance(start, np.zeros(6), 2.0).state
    step, errors = build(motion, ATTITUDE), []
    for dt in steps:
        end = _run(step, start, dt, 2.0)[:, -1]
        turned = rotation_vector(rotation_from_quat(end[place.quat]).T @ rotation_from_quat(exact[place.quat]))
        errors.append(float(max(np.max(np.abs(turned)), np.max(np.abs(end[place.q] - exact[place.q])))))
    return errors


@pytest.mark.parametrize(("build", "order"), [(euler, 1), (averaged, 2), (rk4, 4), (munthe_kaas, 4)])
def test_orders_of_the_flyer_at_momentum(build: Builder, order: int) -> None:
    coarse, fine = _flyer_errors(build, 20.0, (0.02, 0.01))
    assert abs(np.log2(coarse / fine) - order) < 0.3, (coarse, fine)


def test_energy_balance_under_torques_friction_and_wrenches() -> None:
    robot = _flyer().robot
    viscous = (0.5, 0.5, 0.2, 0.005, 0.005, 0.001)
    links = [
        link.model_copy(update={"joint": link.joint.model_copy(update={"friction": Friction(viscous=v)})})
        for link, v in zip(robot.links, viscous, strict=True)
    ]
    model = build_model(robot.model_copy(update={"links": tuple(links)}))
    start, by_momentum, _, _ = _start(HOME, np.zeros(6), np.array([0.2, -0.3, 0.4]))
    inputs = ("torque", "base_wrench", "tip_wrench")
    place = layout(model, inputs, work=True)
    kinetic = model.function("kinetic_energy")
    states = [np.append(start, 0.0), np.append(by_momentum, 0.0)]
    motions = [motion(model, inputs, work=True) for motion in MOTIONS]
    observe = observe_momentum_motion(model, inputs, work=True)
    on_tip = np.array([0.2, -0.1, 0.3, 2e-4, 1e-4, 3e-4])  # the last link weighs 0.19 kg
    energy, worst, most, dt = [], [0.0, 0.0], 0.0, 0.002
    steps = [munthe_kaas(motion, ATTITUDE) for motion in motions]
    for k in range(1501):
        t = k * dt
        torque = np.array([2.0, 3.0, 1.5, 0.05, 0.05, 0.001]) * np.sin(2 * t + np.arange(6))
        given = np.concatenate([torque, 2 * np.cos(t + np.arange(6)), on_tip * np.sin(3 * t)])
        twists = [states[0][place.velocity], _column(observe(states[1], given)[1])]
        now = [
            float(kinetic(s[place.q], s[place.quat], s[place.qd], twist, NOTHING))
            for s, twist in zip(states, twists, strict=True)
        ]
        energy, most = energy or now, max(most, *now)
        worst = [max(w, abs(e - e0 - s[-1])) for w, e, e0, s in zip(worst, now, energy, states, strict=True)]
        states = [_column(step(s, given, dt)) for step, s in zip(steps, states, strict=True)]
    assert most > 2 * energy[0]
    assert max(worst) <= 1e-8 * most, (worst, most)


def test_momentum_is_changed_by_what_acts_from_outside_and_shared_with_wheels() -> None:
    model, dt = _flyer(), 0.005
    start, by_momentum, momentum, _ = _start(HOME, np.full(6, 0.1), np.array([0.2, -0.3, 0.4]))
    inputs = ("torque", "base_wrench", "wheel_torque")
    place = layout(model, inputs)
    given = np.concatenate([[0.5, 0.2, 0.1, 0.01, 0.01, 0.0], [1.0, -2.0, 0.5, 0.0, 0.0, 0.0], [0.3, -0.2, 0.1]])
    stored = np.array([1.0, -2.0, 0.5])
    first = np.concatenate([start, stored])
    states = _run(munthe_kaas(twist_motion(model, inputs), ATTITUDE), first, dt, 2.0, given)
    end = states[:, -1]
    assert np.max(np.abs(end[place.wheels] - stored + 2.0 * given[12:15])) <= 1e-12
    total = _momenta(states)[:, -1]
    assert np.max(np.abs(total[:3] - momentum[:3] - 2.0 * given[6:9])) <= 1e-7
    first = np.concatenate([by_momentum, stored])
    first[place.velocity] += np.concatenate([np.zeros(3), stored])  # the wheels' share is in the momentum
    other = _run(munthe_kaas(momentum_motion(model, inputs), ATTITUDE), first, dt, 2.0, given)[:, -1]
    carried = total[3:] + rotation_from_quat(end[place.quat]) @ end[place.wheels]
    assert np.max(np.abs(other[place.velocity][3:] - carried)) <= 1e-7
    assert np.max(np.abs(other[place.q] - end[place.q])) <= 1e-7
    assert np.max(np.abs(other[place.quat] - end[place.quat])) <= 1e-7


def test_wheels_alone_leave_the_total_momentum() -> None:
    model = _flyer()
    inputs = ("wheel_torque",)
    place = layout(model, inputs)
    start, _, momentum, _ = _start(HOME, np.zeros(6), np.array([0.2, -0.3, 0.4]))
    stored = np.array([1.0, -2.0, 0.5])
    given = np.array([0.5, -0.2, 0.3])
    states = _run(munthe_kaas(twist_motion(model, inputs), ATTITUDE), np.append(start, stored), 0.005, 3.0, given)
    totals = _momenta(states)[3:]
    wheels = zip(states[place.quat].T, states[place.wheels].T, strict=True)
    turned = np.array([rotation_from_quat(quat) @ wheel for quat, wheel in wheels])
    assert np.max(np.abs(totals + turned.T - (momentum[3:] + stored)[:, None])) <= 1e-8


def test_a_fixed_base_stays() -> None:
    model = build_model(load_robot("robots/ur5.yaml"))
    assert not model.floating
    place = layout(model)
    start = np.concatenate([np.zeros(3), [1, 0, 0, 0], HOME, np.zeros(6), np.full(6, 0.3)])
    ends = [_run(munthe_kaas(motion(model), ATTITUDE), start, 0.005, 1.0)[:, -1] for motion in MOTIONS]
    for end in ends:
        assert np.array_equal(end[: place.q.start], start[: place.q.start])
        assert not np.any(end[place.velocity])
        assert np.max(np.abs(end[place.q] - HOME)) > 0.1
    assert np.allclose(ends[0], ends[1], rtol=0, atol=1e-13)


def test_inputs_that_do_not_act_cost_nothing() -> None:
    model = _flyer()
    assert twist_motion(model).n_instructions() < 2000
    assert momentum_motion(model).n_instructions() < 2000
    assert munthe_kaas(momentum_motion(model), ATTITUDE).n_instructions() < 8000
    assert twist_motion(model, EVERYTHING).n_instructions() < 2700
    with pytest.raises(SpecError, match="no input 'torqe'; the motion takes torque, base_wrench"):
        twist_motion(model, ("torqe",))


@pytest.mark.parametrize("seed", [1, 4, 9])
def test_both_states_tell_of_one_motion(seed: int) -> None:
    model = build_model(random_robot(seed))
    rng = np.random.default_rng(seed)
    place, n = layout(model, EVERYTHING), model.n
    draw = {name: rng.uniform(-1, 1, size) for name, size in (("twist", 6), ("qd", n), ("q", n), ("wheels", 3))}
    payload = np.concatenate([[3.0], rng.uniform(-0.2, 0.2, 3), [0.2, 0.3, 0.25, 0.01, 0.0, 0.02]])
    given = np.concatenate([rng.uniform(-3, 3, n), rng.uniform(-3, 3, 15), payload])
    quat = rng.standard_normal(4)
    quat /= np.linalg.norm(quat)
    own = (draw["q"], quat, draw["qd"], draw["twist"])
    momentum, com = (_column(x) for x in model.function("system_momentum")(*own, payload))
    momentum[3:] += rotation_from_quat(quat) @ draw["wheels"]
    by_twist = np.concatenate([np.zeros(3), quat, draw["q"], draw["twist"], draw["qd"], draw["wheels"]])
    by_momentum = np.concatenate([com, quat, draw["q"], momentum, draw["qd"], draw["wheels"]])
    first = _column(twist_motion(model, EVERYTHING)(by_twist, given))
    second = _column(momentum_motion(model, EVERYTHING)(by_momentum, given))
    scale = np.max(np.abs(first))
    assert np.max(np.abs(first[3 : 6 + n] - second[3 : 6 + n])) <= 1e-11 * scale  # attitude and q
    assert np.max(np.abs(first[12 + n :] - second[12 + n :])) <= 1e-11 * scale  # qd and wheels
    position, twist = (_column(x) for x in observe_momentum_motion(model, EVERYTHING)(by_momentum, given))
    assert np.max(np.abs(position)) <= 1e-12
    assert np.max(np.abs(twist - draw["twist"])) <= 1e-11
    assert place.size == len(by_twist)


# Dormand and Prince ----------------------------------------------------------------------------------------


def test_the_adaptive_method_keeps_its_tolerance() -> None:
    state = np.concatenate([_quat(tumbling(MOMENTS, START_RATE, 0.0)[1]), START_RATE])
    attitude = tumbling(MOMENTS, START_RATE, 5.0)[1]
    errors, counts = [], []
    for tolerance in (1e-6, 1e-9, 1e-12):
        done = dormand_prince(_rigid_body(), 0, tolerance, tolerance).advance(state, [0.0], 5.0)
        errors.append(float(np.max(np.abs(rotation_vector(rotation_from_quat(done.state[:4]).T @ attitude)))))
        counts.append(done.taken)
    assert all(error <= 50 * tolerance for error, tolerance in zip(errors, (1e-6, 1e-9, 1e-12), strict=True)), errors
    assert counts[0] < counts[1] < counts[2]
    assert 3.0 < counts[1] / counts[0] < 5.0  # a thousandth of the error for 1000^(1/5) = 4 times the steps
    assert 3.0 < counts[2] / counts[1] < 5.0


def test_inner_steps_carry_over_from_one_step_to_the_next() -> None:
    body = dormand_prince(_rigid_body(), 0, 1e-8, 1e-8)
    state = np.concatenate([[1.0, 0.0, 0.0, 0.0], START_RATE])
    inner, refused = None, []
    for _ in range(5):
        done = body.advance(state, [0.0], 1.0, inner)
        state, inner = done.state, done.inner
        refused.append(done.refused)
    assert refused[0] > 0
    assert sum(refused[1:]) <= 2
    assert abs(np.linalg.norm(state[:4]) - 1) <= 1e-15


def test_a_step_too_large_is_refused_by_name() -> None:
    names = ("turn x", "turn y", "turn z", "rate x", "rate y", "rate z")
    body = dormand_prince(_rigid_body(), 0, 1e-12, 1e-12, inner_steps=10, names=names)
    with pytest.raises(IntegrationError) as caught:
        body.advance(np.concatenate([[1.0, 0.0, 0.0, 0.0], START_RATE]), [0.0], 5.0)
    text = str(caught.value)
    assert text.startswith("dormand_prince: a step of 5 s is too large: 10 inner steps, the last of 0.0")
    assert "; the error is worst in turn " in text or "; the error is worst in rate " in text
    assert text.endswith(
        "Shorten the step, allow more inner steps or loosen the tolerance (relative 1e-12, absolute 1e-12)"
    )


def test_a_rate_that_is_not_finite_is_refused() -> None:
    x, given = ca.SX.sym("x", 1), ca.SX.sym("input", 1)
    explosive = dormand_prince(ca.Function("f", [x, given], [x * x]), None)
    with pytest.raises(IntegrationError, match="dormand_prince: a step of 2 s is too large"):
        explosive.advance([1.0], [0.0], 2.0)


def test_methods_take_plain_vectors() -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 1)
    swing = ca.Function("swing", [x, u], [ca.vertcat(x[1], u - x[0])])
    for build, least in ((euler, 1e-1), (rk4, 1e-7), (munthe_kaas, 1e-7)):
        end = _run(build(swing, None), np.array([1.0, 0.0]), 0.01, 2.0, np.array([0.5]))[:, -1]
        assert abs(end[0] - 0.5 - 0.5 * np.cos(2.0)) <= least
    done = dormand_prince(swing, None, 1e-12, 1e-12).advance([1.0, 0.0], [0.5], 2.0)
    assert abs(done.state[0] - 0.5 - 0.5 * np.cos(2.0)) <= 1e-11
