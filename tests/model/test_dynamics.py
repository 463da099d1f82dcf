"""Dynamics against Pinocchio and MuJoCo, and the laws of mechanics; random trees, replayable by seed."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from fzcli.errors import SpecError
from fzcli.model import RobotModel, build_model
from fzcli.spec.robot import Frame, Friction, Joint, Link, Robot
from tests.oracle.mujoco_oracle import MujocoOracle
from tests.oracle.numpy_reference import NumpyReference, rotation_from_quat
from tests.oracle.pinocchio_oracle import pin_model
from tests.oracle.random_trees import State, random_inertia, random_robot, random_states

Array = NDArray[np.float64]
SEEDS = range(42)
FLOATING = [seed for seed in SEEDS if random_robot(seed).base.floating]
STATES = 4
TOLERANCE = 1e-10  # relative to the largest entry of the reference, at least 1
NOTHING, NO_WRENCH = np.zeros(10), np.zeros(6)


@cache
def _robot(seed: int) -> Robot:
    return random_robot(seed)


@cache
def _model(seed: int) -> RobotModel:
    return build_model(_robot(seed))


@cache
def _mujoco(seed: int) -> MujocoOracle:
    return MujocoOracle(_robot(seed))


def _numbers(value: object) -> Array:
    found = np.array(value, dtype=float)
    return found[:, 0] if found.shape[1] == 1 else found


def _close(actual: Array, expected: Array, what: str, tolerance: float = TOLERANCE) -> None:
    assert actual.shape == expected.shape, f"{what}: shape {actual.shape}, expected {expected.shape}"
    scale = max(1.0, float(np.max(np.abs(expected), initial=0.0)))
    error = float(np.max(np.abs(actual - expected), initial=0.0)) / scale
    assert error <= tolerance, f"{what}: relative error {error:.2e}"


def _twist(seed: int, s: State) -> Array:
    """The state's base twist; a fixed base does not move."""
    return s.base_twist if _robot(seed).base.floating else NO_WRENCH


class Pin:
    """Pinocchio's values in our terms: world axes at the base frame's origin, classical acceleration."""

    def __init__(self, robot: Robot) -> None:
        self.model, self.frames = pin_model(robot)
        self.model.gravity = pin.Motion.Zero()
        self.data = self.model.createData()

    def _velocity(self, s: State, twist: Array) -> tuple[Array, Array, Array]:
        turn = rotation_from_quat(s.base_quat)
        w, x, y, z = s.base_quat
        where = np.concatenate([np.zeros(3), [x, y, z, w], s.q])
        return where, np.concatenate([turn.T @ twist[:3], turn.T @ twist[3:], s.qd]), turn

    def mass_matrix(self, s: State) -> Array:
        where, _, turn = self._velocity(s, NO_WRENCH)
        upper = np.triu(pin.crba(self.model, self.data, where))
        full = upper + np.triu(upper, 1).T
        both = np.eye(len(full))
        both[:3, :3] = both[3:6, 3:6] = turn.T
        return both.T @ full @ both

    def inverse_dynamics(self, s: State, twist: Array, acceleration: Array, qdd: Array) -> Array:
        """(base wrench, joint forces), (6 + n): its spatial acceleration is the classical less w x v."""
        where, velocity, turn = self._velocity(s, twist)
        linear = turn.T @ acceleration[:3] - np.cross(velocity[3:6], velocity[:3])
        rate = np.concatenate([linear, turn.T @ acceleration[3:], qdd])
        found = np.array(pin.rnea(self.model, self.data, where, velocity, rate))
        return np.concatenate([turn @ found[:3], turn @ found[3:6], found[6:]])

    def forward_dynamics(self, s: State, twist: Array, forces: Array) -> tuple[Array, Array]:
        """(base_acceleration, qdd) by the articulated body algorithm under forces (6 + n)."""
        where, velocity, turn = self._velocity(s, twist)
        turned = np.concatenate([turn.T @ forces[:3], turn.T @ forces[3:6], forces[6:]])
        found = np.array(pin.aba(self.model, self.data, where, velocity, turned))
        linear = turn @ (found[:3] + np.cross(velocity[3:6], velocity[:3]))
        return np.concatenate([linear, turn @ found[3:6]]), found[6:]


@cache
def _pin(seed: int) -> Pin:
    return Pin(_robot(seed))


def _drawn(seed: int, index: int, size: int) -> Array:
    return np.random.default_rng((77, seed, index)).uniform(-10, 10, size)


@pytest.mark.parametrize("seed", SEEDS)
def test_mass_matrix(seed: int) -> None:
    model = _model(seed)
    for index, s in random_states(model.n, seed, STATES):
        blocks = [np.array(block) for block in model.function("mass_matrix")(s.q, s.base_quat, NOTHING)]
        full = np.block([[blocks[0], blocks[1]], [blocks[1].T, blocks[2]]])
        where = f"seed {seed}, state {index}"
        _close(full, _pin(seed).mass_matrix(s), f"{where}, Pinocchio")
        free = slice(0 if model.floating else 6, None)
        _close(full[free, free], _mujoco(seed).mass_matrix(s.q, s.base_quat), f"{where}, MuJoCo")


@pytest.mark.parametrize("seed", SEEDS)
def test_bias_forces(seed: int) -> None:
    model = _model(seed)
    for index, s in random_states(model.n, seed, STATES):
        twist, where = _twist(seed, s), f"seed {seed}, state {index}"
        base, joints = model.function("bias_forces")(s.q, s.base_quat, s.qd, twist, NOTHING)
        found = np.concatenate([_numbers(base), _numbers(joints)])
        expected = _pin(seed).inverse_dynamics(s, twist, NO_WRENCH, np.zeros(model.n))
        _close(found, expected, f"{where}, Pinocchio")
        free = slice(0 if model.floating else 6, None)
        _close(found[free], _mujoco(seed).bias(s.q, s.base_quat, s.qd, twist), f"{where}, MuJoCo")


@pytest.mark.parametrize("seed", SEEDS)
def test_inverse_dynamics(seed: int) -> None:
    model = _model(seed)
    for index, s in random_states(model.n, seed, STATES):
        draw, twist = _drawn(seed, index, model.n + 6), _twist(seed, s)
        qdd, acceleration = draw[6:], draw[:6] if model.floating else NO_WRENCH
        torque, wrench, _ = model.function("inverse_dynamics")(
            s.q, s.base_quat, s.qd, twist, qdd, acceleration, NO_WRENCH, NOTHING
        )
        expected = _pin(seed).inverse_dynamics(s, twist, acceleration, qdd)
        found, where = np.concatenate([_numbers(wrench), _numbers(torque)]), f"seed {seed}, state {index}"
        _close(found, expected, f"{where}, Pinocchio")
        free = slice(0 if model.floating else 6, None)
        rates = np.concatenate([acceleration, qdd])[free]
        _close(found[free], _mujoco(seed).forces(s.q, s.base_quat, s.qd, twist, rates), f"{where}, MuJoCo")


@pytest.mark.parametrize("seed", SEEDS)
def test_forward_dynamics(seed: int) -> None:
    model = _model(seed)
    for index, s in random_states(model.n, seed, STATES):
        forces, twist = _drawn(seed, index, model.n + 6), _twist(seed, s)
        qdd, acceleration = model.function("forward_dynamics")(
            s.q, s.base_quat, s.qd, twist, forces[6:], forces[:6], NO_WRENCH, NOTHING
        )
        where = f"seed {seed}, state {index}"
        free = slice(0 if model.floating else 6, None)
        found = np.concatenate([_numbers(acceleration), _numbers(qdd)])
        expected = _mujoco(seed).acceleration(s.q, s.base_quat, s.qd, twist, forces[free])
        _close(found[free], expected, f"{where}, MuJoCo")
        if model.floating:
            by_pin = np.concatenate(_pin(seed).forward_dynamics(s, twist, forces))
            _close(found, by_pin, f"{where}, Pinocchio")
        else:
            _close(_numbers(acceleration), NO_WRENCH, f"{where}, fixed base")


@pytest.mark.parametrize("seed", FLOATING[::4])
def test_free_inverse_dynamics_undoes_forward_dynamics(seed: int) -> None:
    model = _model(seed)
    for index, s in random_states(model.n, seed, 2):
        for tip in model.tips[-2:]:
            draw = _drawn(seed, index, model.n + 12)
            torque, on_base, on_tip = draw[12:], draw[:6], draw[6:12]
            state, payload = (s.q, s.base_quat, s.qd, s.base_twist), _payload(seed, index)
            qdd, moved = model.function("forward_dynamics", tip)(*state, torque, on_base, on_tip, payload)
            again, same = model.function("free_inverse_dynamics", tip)(*state, qdd, on_base, on_tip, payload)
            where = f"seed {seed}, state {index}, tip {tip}"
            _close(_numbers(again), torque, f"{where}, torque")
            _close(_numbers(same), _numbers(moved), f"{where}, base")
            by_recursion, wrench, _ = model.function("inverse_dynamics", tip)(*state, qdd, moved, on_tip, payload)
            _close(_numbers(by_recursion), torque, f"{where}, recursion")
            _close(_numbers(wrench), on_base, f"{where}, recursion, base")


@pytest.mark.parametrize("seed", SEEDS)
def test_generalized_inertia_is_the_schur_complement(seed: int) -> None:
    model = _model(seed)
    for index, s in random_states(model.n, seed, 2):
        held, mixed, joints = (np.array(b) for b in model.function("mass_matrix")(s.q, s.base_quat, NOTHING))
        expected = joints - mixed.T @ np.linalg.solve(held, mixed) if model.floating else joints
        _close(np.array(model.generalized_inertia(s.q)), expected, f"seed {seed}, state {index}")


@pytest.mark.parametrize("seed", SEEDS[::2])
def test_tip_wrench_acts_through_the_tips_jacobian(seed: int) -> None:
    model, pinocchio = _model(seed), _pin(seed)
    for index, s in random_states(model.n, seed, 2):
        for tip in model.tips:
            wrench, twist = _drawn(seed, index, 6), _twist(seed, s)
            where, _, turn = pinocchio._velocity(s, twist)
            frame = pinocchio.frames[tip]
            jacobian = pin.computeFrameJacobian(
                pinocchio.model, pinocchio.data, where, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            expected = jacobian.T @ wrench
            none = np.zeros(model.n)
            state = (s.q, s.base_quat, none, NO_WRENCH, none, NO_WRENCH)
            torque, base, _ = model.function("inverse_dynamics", tip)(*state, wrench, NOTHING)
            found = -np.concatenate([turn.T @ _numbers(base)[:3], turn.T @ _numbers(base)[3:], _numbers(torque)])
            _close(found, expected, f"seed {seed}, state {index}, tip {tip}")


def _payload(seed: int, index: int) -> Array:
    rng = np.random.default_rng((78, seed, index))
    return np.concatenate([[rng.uniform(1, 30)], rng.uniform(-0.5, 0.5, 3), random_inertia(rng, 1.0)])


def _with_payload(robot: Robot, tip: str, payload: Array) -> Robot:
    """The robot with the payload as a link welded to the tip."""
    place = robot.tips[tip]
    extra = Link(
        name="payload",
        parent=place.link,
        at=Frame(xyz=place.xyz, rpy=place.rpy),
        joint=Joint(name="weld", type="fixed"),
        mass=payload[0],
        com=tuple(payload[1:4]),
        inertia=tuple(payload[4:]),
    )
    return robot.model_copy(update={"links": (*robot.links, extra)})


@pytest.mark.parametrize("seed", SEEDS[2::6])
def test_a_payload_is_a_link_welded_to_the_tip(seed: int) -> None:
    robot, model = _robot(seed), _model(seed)
    for tip in (model.tips[0], model.tips[-1]):
        for index, s in random_states(model.n, seed, 1):
            payload, forces, twist = _payload(seed, index), _drawn(seed, index, model.n + 12), _twist(seed, s)
            welded = build_model(_with_payload(robot, tip, payload))
            state, where = (s.q, s.base_quat), f"seed {seed}, state {index}, tip {tip}"
            for name, arguments in {
                "mass_matrix": state,
                "bias_forces": (*state, s.qd, twist),
                "kinetic_energy": (*state, s.qd, twist),
                "system_momentum": (*state, s.qd, twist),
                "forward_dynamics": (*state, s.qd, twist, forces[12:], forces[:6], forces[6:12]),
            }.items():
                found = model.function(name, tip).call([*arguments, payload])
                expected = welded.function(name, tip).call([*arguments, NOTHING])
                for a, b in zip(found, expected, strict=True):
                    _close(np.array(a), np.array(b), f"{where}, {name}")


@pytest.mark.parametrize("seed", SEEDS[::2])
def test_momentum_passes_through_a_grasp(seed: int) -> None:
    model, robot = _model(seed), _robot(seed)
    for index, s in random_states(model.n, seed, 2):
        for tip in model.tips:
            payload, twist, own = _payload(seed, index), _twist(seed, s), _drawn(seed, index, 6) / 5
            grasp = model.function("grasp", tip)
            qd, after = (_numbers(x) for x in grasp(s.q, s.base_quat, s.qd, twist, payload, own))
            welded = NumpyReference(_with_payload(robot, tip, payload))
            body = welded.bodies(s.q, s.base_quat)["payload"]
            where = f"seed {seed}, state {index}, tip {tip}"
            com_velocity = own[:3] + np.cross(own[3:], body.com - body.origin)
            load = np.concatenate([body.mass * com_velocity, body.inertia @ own[3:]])
            load[3:] += np.cross(body.com, load[:3])  # about the base frame's origin
            carried = np.hstack([_at_com(body.com, np.eye(3)), np.vstack([body.jv, body.jw])])
            before, there = _mass(model, tip, s, NOTHING), _mass(model, tip, s, payload)
            expected = before @ np.concatenate([twist, s.qd])
            expected += carried.T @ np.concatenate([body.mass * com_velocity, body.inertia @ own[3:]])
            free = slice(0 if model.floating else 6, None)
            found = there @ np.concatenate([after, qd])
            _close(found[free], expected[free], f"{where}, generalized momentum")
            if model.floating:
                _close(found[:6], (before @ np.concatenate([twist, s.qd]))[:6] + load, f"{where}, momentum")


def _at_com(com: Array, eye: Array) -> Array:
    """The twist (6, 6) of a point at com per base twist."""
    x, y, z = com
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.block([[eye, -cross], [np.zeros((3, 3)), eye]])


def _mass(model: RobotModel, tip: str, s: State, payload: Array) -> Array:
    blocks = [np.array(b) for b in model.function("mass_matrix", tip)(s.q, s.base_quat, payload)]
    return np.block([[blocks[0], blocks[1]], [blocks[1].T, blocks[2]]])


@pytest.mark.parametrize("seed", SEEDS[::5])
def test_a_payload_that_moves_with_the_tip_changes_no_velocity(seed: int) -> None:
    model, robot = _model(seed), _robot(seed)
    for _, s in random_states(model.n, seed, 2):
        tip, payload, twist = model.tips[0], _payload(seed, 0), _twist(seed, s)
        body = NumpyReference(_with_payload(robot, tip, payload)).bodies(s.q, s.base_quat)["payload"]
        rate = twist[3:] + body.jw @ s.qd
        at_com = twist[:3] + np.cross(twist[3:], body.com) + body.jv @ s.qd
        own = np.concatenate([at_com + np.cross(rate, body.origin - body.com), rate])
        qd, after = model.function("grasp", tip)(s.q, s.base_quat, s.qd, twist, payload, own)
        _close(_numbers(qd), s.qd, "qd")
        _close(_numbers(after), twist, "base_twist")


@pytest.mark.parametrize("seed", SEEDS)
def test_kinetic_energy_and_momentum(seed: int) -> None:
    model, reference = _model(seed), NumpyReference(_robot(seed))
    for index, s in random_states(model.n, seed, STATES):
        state = (s.q, s.base_quat, s.qd, s.base_twist)
        where = f"seed {seed}, state {index}"
        energy = model.function("kinetic_energy")(*state, NOTHING)
        _close(np.array(energy)[0], np.array([reference.kinetic_energy(*state)]), f"{where}, energy")
        momentum, com = model.function("system_momentum")(*state, NOTHING)
        _close(_numbers(momentum), reference.momentum(*state), f"{where}, momentum")
        _close(_numbers(com), reference.com(s.q, s.base_quat), f"{where}, com")


@pytest.mark.parametrize("seed", SEEDS[::4])
def test_power_is_the_rate_of_kinetic_energy(seed: int) -> None:
    robot = _rough(_robot(seed))
    model = build_model(robot)
    for index, s in random_states(model.n, seed, 2):
        tip, twist = model.tips[index % len(model.tips)], _twist(seed, s)
        draw = _drawn(seed, index, model.n + 12)
        forces = (draw[12:], draw[:6], draw[6:12])
        qdd, acceleration = model.function("forward_dynamics", tip)(
            s.q, s.base_quat, s.qd, twist, *forces, NOTHING
        )
        power = model.function("power", tip)(s.q, s.base_quat, s.qd, twist, *forces)
        total = sum(float(np.sum(np.array(part))) for part in (power if model.floating else (*power[:2], power[3])))
        blocks = _mass(model, tip, s, NOTHING)
        bias = [_numbers(b) for b in model.function("bias_forces", tip)(s.q, s.base_quat, s.qd, twist, NOTHING)]
        velocity = np.concatenate([twist, s.qd])
        moved = blocks @ np.concatenate([_numbers(acceleration), _numbers(qdd)]) + np.concatenate(bias)
        _close(np.array([total]), np.array([velocity @ moved]), f"seed {seed}, state {index}")
        assert np.all(np.array(power[1]) <= 0)


def _rough(robot: Robot) -> Robot:
    """The robot with friction in every other joint."""
    links = []
    for index, link in enumerate(robot.links):
        friction = Friction(viscous=0.4, coulomb=2.0, smoothing=0.05) if index % 2 == 0 else None
        if link.joint.type != "fixed":
            link = link.model_copy(update={"joint": link.joint.model_copy(update={"friction": friction})})
        links.append(link)
    return robot.model_copy(update={"links": tuple(links)})


def test_friction_brakes_and_is_part_of_both_directions() -> None:
    rough, smooth = build_model(_rough(_robot(9))), _model(9)
    _, s = next(random_states(smooth.n, 9, 1))
    drag = _numbers(rough.function("friction")(s.qd))
    rates = np.abs(drag) > 0
    assert 0 < rates.sum() < smooth.n
    speed = s.qd[rates]
    expected = 0.4 * speed + 2.0 * speed / np.sqrt(speed**2 + 0.05**2)
    _close(drag[rates], expected, "friction")
    state, torque = (s.q, s.base_quat, s.qd, s.base_twist), _drawn(9, 0, smooth.n)
    rest = (NO_WRENCH, NO_WRENCH, NOTHING)
    qdd, _ = rough.function("forward_dynamics")(*state, torque, *rest)
    without, _ = smooth.function("forward_dynamics")(*state, torque - drag, *rest)
    _close(_numbers(qdd), _numbers(without), "forward")
    again, _ = rough.function("free_inverse_dynamics")(*state, qdd, *rest)
    _close(_numbers(again), torque, "inverse")


def test_torques_are_limited_where_the_spec_says_so() -> None:
    robot = _robot(3)
    links = [link.model_copy(update={"joint": link.joint.model_copy(update={"effort": 5.0})}) for link in robot.links]
    limited = build_model(robot.model_copy(update={"links": tuple(links)}))
    asked = np.linspace(-20, 20, limited.n)
    assert np.array_equal(_numbers(limited.function("limited_torque")(asked)), np.clip(asked, -5, 5))
    assert np.array_equal(_numbers(_model(3).function("limited_torque")(asked)), asked)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_held_base_feels_the_opposite_of_what_holds_it(seed: int) -> None:
    model = _model(seed)
    for index, s in random_states(model.n, seed, 2):
        qdd = _drawn(seed, index, model.n)
        still = (s.q, s.base_quat, s.qd, NO_WRENCH, qdd, NO_WRENCH, NO_WRENCH, NOTHING)
        _, held, reaction = (_numbers(x) for x in model.function("inverse_dynamics")(*still))
        _close(reaction, -held, f"seed {seed}, state {index}")


def test_the_reaction_is_what_moves_a_free_base() -> None:
    model, robot = _model(0), _robot(0)
    _, s = next(random_states(model.n, 0, 1))
    state, torque = (s.q, s.base_quat, s.qd, s.base_twist), _drawn(0, 0, model.n)
    qdd, moved = model.function("forward_dynamics")(*state, torque, NO_WRENCH, NO_WRENCH, NOTHING)
    _, _, reaction = model.function("inverse_dynamics")(*state, qdd, moved, NO_WRENCH, NOTHING)
    base = NumpyReference(robot).bodies(s.q, s.base_quat)["base"]
    a, w = _numbers(moved), s.base_twist[3:]
    at_com = a[:3] + np.cross(a[3:], base.com) + np.cross(w, np.cross(w, base.com))
    force = base.mass * at_com
    moment = base.inertia @ a[3:] + np.cross(w, base.inertia @ w) + np.cross(base.com, force)
    _close(_numbers(reaction), np.concatenate([force, moment]), "reaction")


def test_a_joint_that_moves_no_inertia_is_refused_by_name() -> None:
    robot = _robot(0)
    parents = {link.parent for link in robot.links}
    leaf = next(link for link in robot.links if link.name not in parents and link.joint.type != "fixed")
    bare = leaf.model_copy(update={"mass": 0.0, "inertia": (0.0,) * 6})
    links = tuple(bare if link.name == leaf.name else link for link in robot.links)
    model = build_model(robot.model_copy(update={"links": links}))
    with pytest.raises(SpecError) as caught:
        model.function("forward_dynamics")
    assert str(caught.value) == (
        f"links: joint {leaf.joint.name!r} moves no inertia, so that no torque has a finite effect on it; "
        f"give link {leaf.name!r} a mass and an inertia, or make the joint fixed"
    )
