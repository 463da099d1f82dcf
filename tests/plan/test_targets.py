"""Targets to arrive at: directions and orientations, drift and tumble, and targets known to be reachable."""

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import fzcli
from fzcli.model import RobotModel
from fzcli.plan.registry import TIP_REFERENCES
from fzcli.plan.target import TargetSpec, quaternion_from_rpy, quaternion_to
from tests.loop.reaching_cases import HOME_A, skew_arm, unit
from tests.oracle.fabrik_reference import base_turn
from tests.oracle.numpy_reference import (
    NumpyReference,
    quat_exp,
    quat_multiply,
    rotation_from_quat,
    rotation_from_rpy,
    rotation_vector,
)

Array = NDArray[np.float64]
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
MODEL = fzcli.build_model(fzcli.load_robot("ur5_free_flyer"))
TUMBLING = {
    "position": (0.4, 0.5, 0.7),
    "velocity": (-0.02, 0.03, 0.01),
    "spin": (0.3, -0.5, 0.8),
    "centre": (0.75, 0.6, 0.6),
}


class Target:
    """A reference to arrive at as plain numbers, of a run that starts at q, base_quat with its CoM at ``com``."""

    def __init__(self, kind: str, fields: dict[str, object], model: RobotModel = MODEL, q: Array = HOME_A,
                 quat: Array = UPRIGHT, com: Array | None = None) -> None:  # fmt: skip
        entry = TIP_REFERENCES[kind]
        spec = entry.spec.model_validate(fields)
        self.reference = entry.build(spec, model, None)
        self.com = np.zeros(3) if com is None else com
        position, rotation = (np.array(v) for v in model.forward_kinematics(q, quat))
        x, y, z, w = Rotation.from_matrix(rotation).as_quat()
        values = [np.ravel(spec.value_at(p.path.removeprefix("reference."))) for p in self.reference.parameters]
        start = (q, quat, position.ravel(), np.array([w, x, y, z]), self.com)
        self.constants = self.reference.prepare(np.concatenate(values), *start)

    def at(self, time: float) -> list[Array]:
        """position (from the CoM), velocity, quat, rate."""
        return [np.array(v).ravel() for v in self.reference.evaluate(time, self.constants)]


def _z(quat: Array) -> Array:
    return rotation_from_quat(quat)[:, 2]


# Directions and orientations


def _quaternions_to(directions: Array) -> Array:
    d = ca.SX.sym("d", 3)
    return np.array(ca.Function("f", [d], [quaternion_to(d)]).map(len(directions))(directions.T)).T


def test_the_least_turn_lays_z_on_any_direction() -> None:
    directions = np.random.default_rng(1).normal(size=(1000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for direction, quat in zip(directions, _quaternions_to(directions), strict=True):
        assert np.linalg.norm(quat) == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_allclose(_z(quat), direction, atol=1e-12)
        assert abs(quat[3]) < 1e-16, "no turn about z itself"


def test_the_least_turn_at_and_next_to_the_poles() -> None:
    """Down to the rounding of a direction next to -z, where the turn's axis is lost: 1.5e-6 rad at most."""
    near = [[np.sin(e), 0.0, -np.cos(e)] for e in (0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1.3e-6, 1.5e-6, 1e-5, 1e-3)]
    directions = np.array([[0.0, 0.0, 1.0], [1e-9, 0.0, 1.0], *near])
    for direction, quat in zip(directions, _quaternions_to(directions), strict=True):
        assert np.linalg.norm(quat) == pytest.approx(1.0, abs=1e-3)
        apart = np.arctan2(np.linalg.norm(np.cross(_z(quat), direction)), _z(quat) @ direction)
        assert apart < 2e-6, direction


def test_roll_pitch_yaw_as_everywhere() -> None:
    angles = ca.SX.sym("angles", 3)
    function = ca.Function("f", [angles], [quaternion_from_rpy(angles)])
    for rpy in np.random.default_rng(2).uniform(-np.pi, np.pi, (50, 3)):
        quat = np.array(function(rpy)).ravel()
        np.testing.assert_allclose(rotation_from_quat(quat), rotation_from_rpy(rpy), atol=1e-14)


def test_a_direction_may_have_any_length() -> None:
    for size in (1e-40, 1e-3, 1.0, 1e40):
        target = Target("target", {"position": (0, 0, 1), "direction": (3 * size, -4 * size, 0.0)})
        np.testing.assert_allclose(_z(target.at(0.0)[2]), [0.6, -0.8, 0.0], atol=1e-15)


@pytest.mark.parametrize(
    ("fields", "aim"), [({}, "position"), ({"direction": (0, 0, 1)}, "direction"), ({"rpy": (0, 0, 1)}, "pose")]
)
def test_what_is_given_is_the_aim(fields: dict[str, object], aim: str) -> None:
    target = Target("target", {"position": (0.1, 0.2, 0.3), **fields})
    assert target.reference.aim == aim


# Motion


@pytest.mark.parametrize("attitude", [{}, {"direction": (1.0, 0.5, -0.3)}, {"rpy": (0.3, -0.2, 2.0)}])
@pytest.mark.parametrize("centred", [True, False])
def test_rates_are_the_derivatives(attitude: dict[str, object], centred: bool) -> None:
    target = Target("target", TUMBLING | attitude | ({} if centred else {"centre": None}))
    h = 1e-5
    for time in np.random.default_rng(3).uniform(0.1, 30.0, 40):
        before, now, after = (target.at(time + shift) for shift in (-h, 0.0, h))
        np.testing.assert_allclose(now[1], (after[0] - before[0]) / (2 * h), atol=2e-9)
        turned = rotation_from_quat(after[2]) @ rotation_from_quat(before[2]).T
        np.testing.assert_allclose(now[3], rotation_vector(turned) / (2 * h), atol=2e-9)
        assert np.linalg.norm(now[2]) == pytest.approx(1.0, abs=1e-14)


def test_a_tumbling_target_turns_as_one_body_about_its_centre() -> None:
    """Position, direction and centre by the rotation vector spin x time, against SciPy's."""
    com = np.array([0.01, -0.02, 0.2])
    target = Target("target", TUMBLING | {"direction": (1.0, 0.5, -0.3)}, com=com)
    position, velocity, spin, centre = (np.array(TUMBLING[k]) for k in ("position", "velocity", "spin", "centre"))
    for time in (0.0, 0.7, 5.0, 40.0):
        turn = Rotation.from_rotvec(spin * time)
        place, _, quat, _ = target.at(time)
        np.testing.assert_allclose(place + com, centre + velocity * time + turn.apply(position - centre), atol=1e-13)
        np.testing.assert_allclose(_z(quat), turn.apply(unit(np.array([1.0, 0.5, -0.3]))), atol=1e-13)


def test_a_spin_about_its_own_point_leaves_the_point() -> None:
    target = Target("target", {"position": (0.1, 0.2, 0.3), "spin": (1.0, 2.0, 3.0), "direction": (0, 1, 0)})
    for time in (0.0, 1.0, 9.0):
        np.testing.assert_allclose(target.at(time)[0], [0.1, 0.2, 0.3], atol=1e-15)
    assert np.linalg.norm(_z(target.at(1.0)[2]) - _z(target.at(0.0)[2])) > 0.1


def test_a_target_has_no_end() -> None:
    target = Target("target", {"position": (0.1, 0.2, 0.3)})
    assert float(target.reference.duration(np.zeros(9))) == np.inf
    assert TargetSpec(position=(0, 0, 0)).moving is False
    assert TargetSpec(position=(0, 0, 0), spin=(0, 0, 1)).moving is True


# Targets known to be reachable


def _pose_after(oracle: NumpyReference, q: Array, quat: Array, way: Array, pieces: int) -> tuple[Array, Array]:
    """Tip pose from the CoM after a straight joint path at zero momentum, in equal pieces."""
    step = way / pieces
    for _ in range(pieces):
        quat, q = quat_multiply(quat, quat_exp(base_turn(oracle, q, step, "gauss_magnus"))), q + step
    return oracle.forward_kinematics(q, quat / np.linalg.norm(quat))


def test_a_reachable_target_is_where_the_joints_lead() -> None:
    """The UR5 and a skew arm, half a turn a joint at most: to 2e-5 m and rad of a path in 200 pieces."""
    rng = np.random.default_rng(4)
    for robot in (fzcli.load_robot("ur5_free_flyer"), skew_arm(rng, 4, True), fzcli.load_robot("ur5")):
        model, oracle = fzcli.build_model(robot), NumpyReference(robot)
        for _ in range(2):
            q, way = rng.uniform(-2, 2, model.n), rng.uniform(-np.pi, np.pi, model.n)
            quat = quat_exp(rng.normal(size=3))
            target = Target("reachable", {"displacement": tuple(way), "aim": "pose"}, model, q, quat)
            position, rotation = _pose_after(oracle, q, quat, way, 200)
            place, velocity, tip_quat, rate = target.at(3.0)
            np.testing.assert_allclose(place, position, atol=2e-5)
            np.testing.assert_allclose(rotation_from_quat(tip_quat), rotation, atol=2e-5)
            assert not np.any([velocity, rate])


def test_no_displacement_is_the_tip_itself() -> None:
    quat = quat_exp(np.array([0.3, -0.2, 0.5]))
    target = Target("reachable", {"displacement": (0.0,) * 6}, quat=quat)
    position, rotation = (np.array(v) for v in MODEL.forward_kinematics(HOME_A, quat))
    np.testing.assert_allclose(target.at(0.0)[0], position.ravel(), atol=1e-15)
    np.testing.assert_allclose(rotation_from_quat(target.at(0.0)[2]), rotation, atol=1e-14)


@pytest.mark.parametrize(
    ("kind", "fields", "text"),
    [
        ("target", {"position": (0, 0, 0), "direction": (0, 0, 0)}, "a direction of zero length points nowhere"),
        ("target", {"position": (0, 0, 0), "direction": (1e-60, 0, 0)}, "the direction's length must lie between"),
        ("target", {"position": (0, 0, 0), "direction": (1, 0, 0), "rpy": (0, 0, 0)}, "give direction or rpy"),
        ("target", {"position": (0, float("nan"), 0)}, "must be a finite number, got nan"),
        ("target", {"position": (0, 0)}, "position"),
        ("target", {"direction": (0, 0, 1)}, "position"),
        ("reachable", {"displacement": ()}, "at least 1 item"),
        ("reachable", {"displacement": (1, float("inf"))}, "must be a finite number, got inf"),
        ("reachable", {"displacement": (1,), "aim": "way"}, "'position', 'direction' or 'pose'"),
    ],
)
def test_bad_targets_are_refused_in_words(kind: str, fields: dict[str, object], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        TIP_REFERENCES[kind].spec.model_validate(fields)
