"""Reports, wrong masses and grasps of the moving robot: against its other functions, and the laws of mechanics."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.model import RobotModel, build_model
from fzcli.model.free_motion import FACTORS, layout, momentum_motion, observe_momentum_motion
from fzcli.model.grasped import grasped_state
from fzcli.model.motion_report import com_offset, motion_report
from fzcli.spec.load import load_robot
from fzcli.spec.robot import Base, Link, Robot
from tests.oracle.numpy_reference import rotation_from_quat
from tests.oracle.random_trees import random_robot, random_states

Array = NDArray[np.float64]
INPUTS = ("torque", "base_wrench", "wheel_torque", "tip_wrench", "payload")
EMPTY = np.zeros(10)
LOAD = np.array([3.0, 0.1, -0.2, 0.05, 0.2, 0.3, 0.25, 0.01, 0.0, 0.02])
SEEDS = (1, 4, 6, 9)  # 6 stands on a fixed base


def _column(value: object) -> Array:
    return np.array(value, dtype=float).ravel()


class Moving:
    """A random robot in a random state of motion, under random loads."""

    def __init__(self, seed: int, payload: Array = EMPTY) -> None:
        self.model = build_model(random_robot(seed))
        self.state = next(random_states(self.model.n, seed, 1))[1]
        rng = np.random.default_rng(seed)
        n = self.model.n
        self.twist = self.state.base_twist if self.model.floating else np.zeros(6)
        self.torque, self.wheels = rng.uniform(-2, 2, n), rng.uniform(-1, 1, 3)
        self.on_base, self.on_tip, self.turning = (rng.uniform(-2, 2, k) for k in (6, 6, 3))
        self.payload = payload
        self.given = np.concatenate([self.torque, self.on_base, self.turning, self.on_tip, payload])

    @property
    def own(self) -> tuple[Array, Array, Array, Array]:
        """q, base_quat, qd, base_twist."""
        return self.state.q, self.state.base_quat, self.state.qd, self.twist

    def vector(self, payload: Array) -> Array:
        """The state of `momentum_motion`, base frame at the origin."""
        momentum, com = (_column(x) for x in self.model.function("system_momentum")(*self.own, payload))
        momentum[3:] += rotation_from_quat(self.state.base_quat) @ self.wheels
        place = com if self.model.floating else np.zeros(3)
        momentum = momentum if self.model.floating else np.zeros(6)
        q, quat, qd, _ = self.own
        return np.concatenate([place, quat, q, momentum, qd, self.wheels])


@pytest.mark.parametrize("seed", SEEDS)
def test_the_report_is_what_the_other_functions_say(seed: int) -> None:
    its = Moving(seed, LOAD)
    found = [_column(x) for x in motion_report(its.model, INPUTS)(its.vector(LOAD), its.given)]
    position, twist, energy, momentum, _, reaction = found
    np.testing.assert_allclose(position, 0.0, atol=1e-12)
    np.testing.assert_allclose(twist, its.twist, atol=1e-11)
    assert energy[0] == pytest.approx(float(its.model.function("kinetic_energy")(*its.own, LOAD)), rel=1e-11)
    expected = _column(its.model.function("system_momentum")(*its.own, LOAD)[0])
    np.testing.assert_allclose(momentum, expected, atol=1e-10)
    R = rotation_from_quat(its.state.base_quat)
    by_wheels = np.concatenate([np.zeros(3), R @ (its.turning - np.cross(R.T @ its.twist[3:], its.wheels))])
    on_base = its.on_base + (by_wheels if its.model.floating else 0)
    moved = its.model.function("forward_dynamics")(*its.own, its.torque, on_base, its.on_tip, LOAD)
    behind = its.model.function("inverse_dynamics")(*its.own, *moved, its.on_tip, LOAD)
    np.testing.assert_allclose(reaction, _column(behind[2]), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_base_s_momentum_is_that_of_its_body(seed: int) -> None:
    its = Moving(seed)
    base = its.model.tree.base
    found = _column(motion_report(its.model, INPUTS)(its.vector(EMPTY), its.given)[4])
    R = rotation_from_quat(its.state.base_quat)
    velocity, rate = R.T @ its.twist[:3], R.T @ its.twist[3:]
    linear = base.mass * velocity + np.cross(rate, base.first_moment)
    about_origin = base.tensor @ rate + np.cross(base.first_moment, velocity)
    com = R.T @ _column(its.model.com(its.state.q, its.state.base_quat))
    expected = np.concatenate([R @ linear, R @ (about_origin - np.cross(com, linear))])
    np.testing.assert_allclose(found, expected if its.model.floating else 0, atol=1e-11)


def _heavier(robot: Robot, masses: Array, inertias: Array) -> Robot:
    """The robot with factors on its bodies, the base first; it has no fixed joints."""
    parts: list[Base | Link] = [robot.base, *robot.links]
    changed = [
        part.model_copy(update={"mass": part.mass * mass, "inertia": tuple(value * inertia for value in part.inertia)})
        for part, mass, inertia in zip(parts, masses, inertias, strict=True)
    ]
    return robot.model_copy(update={"base": changed[0], "links": tuple(changed[1:])})


def test_factors_are_a_robot_of_other_masses() -> None:
    rng = np.random.default_rng(3)
    robot = load_robot("bulgarelli4")
    masses, inertias = rng.uniform(0.8, 1.2, 5), rng.uniform(0.8, 1.2, 5)
    model, other = build_model(robot), build_model(_heavier(robot, masses, inertias))
    state = np.concatenate([rng.normal(size=3), [0.5, 0.5, -0.5, 0.5], rng.normal(size=4), rng.normal(size=10)])
    torque = rng.normal(size=4)
    given = np.concatenate([torque, masses, inertias])
    inputs = ("torque", *FACTORS)
    for build in (momentum_motion, observe_momentum_motion, motion_report):
        found, expected = build(model, inputs)(state, given), build(other)(state, torque)
        pairs = zip(*(parts if isinstance(parts, tuple) else (parts,) for parts in (found, expected)), strict=True)
        for a, b in pairs:
            np.testing.assert_allclose(_column(a), _column(b), rtol=1e-10, atol=1e-11)
    offset = _column(com_offset(model, inputs)(state[7:11], state[3:7], given))
    np.testing.assert_allclose(offset, _column(other.com(state[7:11], state[3:7])), atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_grasp_passes_the_momentum_on(seed: int) -> None:
    """The jump is that of `grasp`; momentum of robot and payload together is what it was."""
    its = Moving(seed, LOAD)
    own = np.random.default_rng(seed).uniform(-1, 1, 6)
    before = its.vector(EMPTY)
    after = _column(grasped_state(its.model, INPUTS)(before, its.given, own))
    place = layout(its.model, INPUTS)
    qd, twist = (_column(x) for x in its.model.function("grasp")(*its.own, LOAD, own))
    np.testing.assert_allclose(after[place.qd], qd, rtol=1e-10, atol=1e-10)
    assert np.array_equal(after[place.q], before[place.q])
    assert np.array_equal(after[place.quat], before[place.quat])
    position, found = (_column(x) for x in observe_momentum_motion(its.model, INPUTS)(after, its.given))
    np.testing.assert_allclose(position, 0.0, atol=1e-11)
    np.testing.assert_allclose(found, twist if its.model.floating else 0, atol=1e-9)
    if its.model.floating:
        together = _linear(its.model, before, own, its)
        np.testing.assert_allclose(after[place.velocity][:3], together, rtol=1e-9, atol=1e-9)


def _linear(model: RobotModel, before: Array, own: Array, its: Moving) -> Array:
    """Linear momentum of the robot and of the payload that flies by itself."""
    rotation = np.array(model.function("tip_state")(*its.own)[1])
    velocity = own[:3] + np.cross(own[3:], rotation @ LOAD[1:4])
    return before[layout(model, INPUTS).velocity][:3] + LOAD[0] * velocity


def test_the_energy_that_a_grasp_takes_is_booked_as_work() -> None:
    its = Moving(1, LOAD)
    before = np.append(its.vector(EMPTY), 0.7)
    after = _column(grasped_state(its.model, INPUTS, work=True)(before, its.given, np.zeros(6)))
    report = motion_report(its.model, INPUTS, work=True)
    empty = np.concatenate([its.given[:-10], EMPTY])
    gained = float(report(after, its.given)[2]) - float(report(before, empty)[2])
    assert after[-1] - before[-1] == pytest.approx(gained, rel=1e-11)
    assert gained < 0, "a payload at rest takes energy from the robot"
