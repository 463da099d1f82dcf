"""Recorded torques drive an independent plant, Pinocchio's, which must move as the record says."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml
from numpy.typing import NDArray

import fzcli
from fzcli.loop.rollout import Rollout
from fzcli.record.rollout_file import read_rollout
from fzcli.spec.load import load_robot
from fzcli.spec.robot import Frame, Friction, Joint, Link, Robot
from tests.loop.cases import raw_run
from tests.oracle.numpy_reference import rotation_from_quat
from tests.oracle.pinocchio_oracle import pin_model

pytestmark = pytest.mark.usefixtures("machine")
Array = NDArray[np.float64]
DT, GRASP = 0.01, 60  # s; the sample at which the payload is seized
MASSES, INERTIAS = np.array([1.0, -1, 0.5, -0.5, 1]), np.array([-1.0, 1, 0.5, -1, 0])
LOAD = {"mass": 0.8, "com": [0.05, -0.02, 0.1], "inertia": [0.01, 0.02, 0.015]}
PAYLOAD_TWIST = np.array([0.05, -0.02, 0.03, 0.1, 0.2, -0.1])  # at the tip, world axes
ON_BASE, ON_TIP = np.array([0.3, -0.2, 0.1, 0.05, 0.02, -0.03]), np.array([0.1, 0.05, -0.1, 0.01, -0.02, 0.01])
ROUGH = {"viscous": 0.05, "coulomb": 0.02, "smoothing": 0.05}
MOMENTUM = {"linear": [0.3, -0.2, 0.1], "angular": [0.05, 0.02, -0.04]}


def _robot() -> Robot:
    """The test bed with rough joints."""
    robot, rough = load_robot("bulgarelli4"), Friction(**ROUGH)
    links = [
        link.model_copy(update={"joint": link.joint.model_copy(update={"friction": rough})}) for link in robot.links
    ]
    return robot.model_copy(update={"links": tuple(links)})


def _moved(robot: Robot, loaded: bool) -> Robot:
    """The robot that the errors mean, with or without the payload welded to its tip."""
    parts = [
        part.model_copy(update={"mass": part.mass * (1 + 0.2 * mass), "inertia": _scaled(part.inertia, inertia)})
        for part, mass, inertia in zip((robot.base, *robot.links), MASSES, INERTIAS, strict=True)
    ]
    place = robot.tips["hand"]
    load = Link(
        name="payload",
        parent=place.link,
        at=Frame(xyz=place.xyz, rpy=place.rpy),
        joint=Joint(name="weld", type="fixed"),
        mass=LOAD["mass"],
        com=LOAD["com"],
        inertia=(*LOAD["inertia"], 0.0, 0.0, 0.0),
    )
    links = (*parts[1:], load) if loaded else tuple(parts[1:])
    return robot.model_copy(update={"base": parts[0], "links": links})


def _scaled(inertia: tuple[float, ...], share: float) -> tuple[float, ...]:
    return tuple(value * (1 + 0.2 * share) for value in inertia)


class Plant:
    """Pinocchio's articulated-body algorithm under RK4 on its own manifold; wheels and friction by formula."""

    def __init__(self, robot: Robot) -> None:
        self.model, frames = pin_model(robot)
        self.model.gravity = pin.Motion.Zero()
        self.data, self.tip = self.model.createData(), frames["hand"]

    def tip_jacobian(self, q: Array) -> Array:
        """(6, 6 + n): world axes at the tip."""
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return np.array(pin.computeFrameJacobian(self.model, self.data, q, self.tip, world))

    def forces(self, q: Array, v: Array, torque: Array, wheels: Array, stored: Array) -> Array:
        """Generalized forces: wrenches on base and tip, wheels of momentum ``stored``, motors and friction."""
        turn = pin.Quaternion(q[3:7]).toRotationMatrix()
        on_base = np.concatenate([turn.T @ ON_BASE[:3], turn.T @ ON_BASE[3:] + wheels - np.cross(v[3:6], stored)])
        speed = v[6:]
        drag = ROUGH["viscous"] * speed + ROUGH["coulomb"] * speed / np.hypot(speed, ROUGH["smoothing"])
        return np.concatenate([on_base, torque - drag]) + self.tip_jacobian(q).T @ ON_TIP

    def step(self, q: Array, v: Array, torque: Array, wheels: Array, stored: Array) -> tuple[Array, Array]:
        """q and v after `DT` under torques and wheel torques that stand still."""

        def slope(share: float, speed: Array, pace: Array) -> tuple[Array, Array]:
            place, fast = pin.integrate(self.model, q, share * DT * speed), v + share * DT * pace
            given = self.forces(place, fast, torque, wheels, stored - share * DT * wheels)
            return fast, np.array(pin.aba(self.model, self.data, place, fast, given))

        none = np.zeros_like(v)
        first = slope(0.0, none, none)
        second = slope(0.5, *first)
        third = slope(0.5, *second)
        fourth = slope(1.0, *third)
        mean = [(a + 2 * (b + c) + d) / 6 for a, b, c, d in zip(first, second, third, fourth, strict=True)]
        return pin.integrate(self.model, q, DT * mean[0]), v + DT * mean[1]

    def momentum(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Momentum (6) about the CoM, world axes, and the CoM."""
        total = np.array(pin.computeCentroidalMomentum(self.model, self.data, q, v).vector)
        return total, np.array(self.data.com[0])

    def reaction(self, q: Array, v: Array, given: Array) -> Array:
        """What the arm exerts on the base (6), world axes, by the recursive Newton-Euler algorithm."""
        rate = pin.aba(self.model, self.data, q, v, given)
        outer = pin.StdVec_Force()
        for _ in range(self.model.njoints):
            outer.append(pin.Force.Zero())
        pin.framesForwardKinematics(self.model, self.data, q)
        frame, place = self.model.frames[self.tip], self.data.oMf[self.tip]
        at_tip = pin.Force(place.rotation.T @ ON_TIP[:3], place.rotation.T @ ON_TIP[3:])
        outer[frame.parentJoint] = frame.placement.act(at_tip)
        pin.rnea(self.model, self.data, q, v, rate, outer)
        turn, total = pin.Quaternion(q[3:7]).toRotationMatrix(), pin.Force.Zero()
        for child in (j for j in range(2, self.model.njoints) if self.model.parents[j] == 1):
            total = total + self.data.liMi[child].act(self.data.f[child])
        return -np.concatenate([turn @ total.linear, turn @ total.angular])


def _state(found: Rollout, k: int) -> tuple[Array, Array]:
    w, x, y, z = found.base_quat[k]
    turn = rotation_from_quat(found.base_quat[k])
    twist = found.base_twist[k]
    place = np.concatenate([found.base_position[k], [x, y, z, w], found.q[k]])
    return place, np.concatenate([turn.T @ twist[:3], turn.T @ twist[3:], found.qd[k]])


@pytest.fixture(name="found")
def recorded(tmp_path: Path) -> Rollout:
    """A replay in which all acts at once, as its file has it; torques stand still over a step."""
    replay: dict[str, Any] = {
        "controller": {"kind": "computed_torque", "frequency": 5.0},
        "substeps": 1,
        "errors": {"each": 0.2, "masses": MASSES.tolist(), "inertias": INERTIAS.tolist()},
        "grasp": {"at": GRASP * DT, **LOAD, "velocity": PAYLOAD_TWIST[:3].tolist(), "rate": PAYLOAD_TWIST[3:].tolist()},
        "wrenches": [
            {"on": "base", "force": ON_BASE[:3].tolist(), "moment": ON_BASE[3:].tolist()},
            {"on": "tip", "force": ON_TIP[:3].tolist(), "moment": ON_TIP[3:].tolist()},
        ],
        "attitude": {"by": "wheels", "frequency": 0.3},
    }
    run = raw_run(replay=replay, duration=1.2, start__momentum=MOMENTUM, record={"precision": "f8"})
    source = yaml.safe_load(Path("robots/bulgarelli4.yaml").read_text())
    for link in source["links"]:
        link["joint"]["friction"] = ROUGH
    (tmp_path / "rough.yaml").write_text(yaml.safe_dump(source))
    (tmp_path / "run.yaml").write_text(yaml.safe_dump(run | {"robot": "rough.yaml"}))
    fzcli.simulate(tmp_path / "run.yaml", output=tmp_path / "run.h5")
    return read_rollout(tmp_path / "run.h5")


def test_an_independent_plant_moves_as_recorded(found: Rollout) -> None:
    """Before the grasp and after it; the grasp itself: see below."""
    empty, loaded = (Plant(_moved(_robot(), held)) for held in (False, True))
    torque, stored = found.signals["torque"], found.signals["wheel_momentum"]
    assert np.abs(stored).max() > 0.02
    assert np.abs(np.diff(found.q, axis=0)).max() > 1e-3
    for plant, begin, end in ((empty, 0, GRASP - 1), (loaded, GRASP, len(found.time) - 1)):
        q, v = _state(found, begin)
        for k in range(begin, end):
            wheels = -(stored[k + 1] - stored[k]) / DT
            q, v = plant.step(q, v, torque[k], wheels, stored[k])
        expected = _state(found, end)
        np.testing.assert_allclose(q, expected[0], atol=1e-7)
        np.testing.assert_allclose(v, expected[1], atol=1e-7)


def test_linear_and_angular_momentum_pass_through_the_grasp(found: Rollout) -> None:
    """Of robot and payload together, about their common CoM; generalized, so that no joint felt a motor."""
    empty, loaded = (Plant(_moved(_robot(), held)) for held in (False, True))
    torque, stored = found.signals["torque"], found.signals["wheel_momentum"]
    before = _state(found, GRASP - 1)
    wheels = -(stored[GRASP] - stored[GRASP - 1]) / DT
    q, v = empty.step(*before, torque[GRASP - 1], wheels, stored[GRASP - 1])
    after, seen = _state(found, GRASP)
    np.testing.assert_allclose(q, after, atol=1e-9)
    assert np.abs(seen - v).max() > 0.01, "the payload was not at rest beside the tip"
    pin.framesForwardKinematics(empty.model, empty.data, q)
    place = empty.data.oMf[empty.tip]
    turn, com = place.rotation, place.rotation @ np.array(LOAD["com"])
    speed = PAYLOAD_TWIST[:3] + np.cross(PAYLOAD_TWIST[3:], com)
    linear = LOAD["mass"] * speed
    angular = turn @ np.diag(LOAD["inertia"]) @ turn.T @ PAYLOAD_TWIST[3:]
    (robot, robot_com), (total, common) = empty.momentum(q, v), loaded.momentum(after, seen)
    np.testing.assert_allclose(total[:3], robot[:3] + linear, atol=1e-9)
    own = np.cross(robot_com - common, robot[:3]) + np.cross(place.translation + com - common, linear) + angular
    np.testing.assert_allclose(total[3:], robot[3:] + own, atol=1e-9)
    brought = empty.tip_jacobian(q).T @ np.concatenate([linear, angular + np.cross(com, linear)])
    masses = [np.array(pin.crba(p.model, p.data, q)) for p in (empty, loaded)]
    masses = [np.triu(one) + np.triu(one, 1).T for one in masses]
    np.testing.assert_allclose(masses[1] @ seen, masses[0] @ v + brought, atol=1e-9)


def test_momentum_grows_by_what_acts_alone_the_wheels_share_included(found: Rollout) -> None:
    """Impulse of both wrenches, their moments about the CoM by the trapezoidal rule over the samples."""
    plant = Plant(_moved(_robot(), loaded=True))
    carried, moments = [], []
    for k in range(GRASP, len(found.time)):
        q, v = _state(found, k)
        total, com = plant.momentum(q, v)
        carried.append(total[3:] + rotation_from_quat(found.base_quat[k]) @ found.signals["wheel_momentum"][k])
        arms = (q[:3] - com, found.tip_position[k] - com)
        moments.append(sum(w[3:] + np.cross(arm, w[:3]) for arm, w in zip(arms, (ON_BASE, ON_TIP), strict=True)))
    impulse = sum((a + b) * DT / 2 for a, b in pairwise(moments))
    np.testing.assert_allclose(carried[-1] - carried[0], impulse, atol=1e-6)


def test_reaction_and_momentum_of_the_base_are_pinocchios(found: Rollout) -> None:
    empty, loaded = (Plant(_moved(_robot(), held)) for held in (False, True))
    stored = found.signals["wheel_momentum"]
    for k in (0, 17, GRASP - 1, GRASP, GRASP + 20, len(found.time) - 2):
        plant = loaded if k >= GRASP else empty
        q, v = _state(found, k)
        given = plant.forces(q, v, found.signals["torque"][k], -(stored[k + 1] - stored[k]) / DT, stored[k])
        np.testing.assert_allclose(found.signals["base_reaction"][k], plant.reaction(q, v, given), atol=1e-9)
        turn, com = rotation_from_quat(found.base_quat[k]), plant.momentum(q, v)[1]
        own = plant.model.inertias[1] * pin.Motion(v[:6])
        linear, angular = turn @ own.linear, turn @ own.angular
        expected = np.concatenate([linear, angular + np.cross(q[:3] - com, linear)])
        np.testing.assert_allclose(found.signals["base_momentum"][k], expected, atol=1e-10)
