"""The planar 3-RRR: golden numbers, loops that close, every real assembly found, Jacobians, singularities."""

import casadi as ca
import numpy as np
import pytest

from fzcli.errors import SpecError
from fzcli.model.planar_3rrr import MODES, Planar3RRRModel, build_planar_model, mode_signs
from fzcli.model.planar_forward import _closing
from fzcli.spec.any_robot import load_any_robot
from fzcli.spec.planar import Legs, Planar3RRR, Triangle

GOLDEN = np.array([0.05, -0.03, 0.2])


@pytest.fixture(scope="module")
def model() -> Planar3RRRModel:
    robot = load_any_robot("rrr_planar")
    assert isinstance(robot, Planar3RRR)
    return build_planar_model(robot)


def uneven(rng: np.random.Generator) -> Planar3RRRModel:
    """A robot without any symmetry."""

    def triangle(radius: float) -> Triangle:
        angles = np.radians([210, 330, 90]) + rng.uniform(-0.3, 0.3, 3)
        return Triangle(radius=radius, angles=(float(angles[0]), float(angles[1]), float(angles[2])))

    legs = Legs(proximal=float(rng.uniform(0.2, 0.3)), distal=float(rng.uniform(0.2, 0.3)))
    robot = Planar3RRR(kind="planar_3rrr", base=triangle(0.4), platform=triangle(0.12), legs=legs)
    return build_planar_model(robot)


def poses(model: Planar3RRRModel, rng: np.random.Generator, count: int) -> np.ndarray:
    tried = 200 * count
    found = np.column_stack([rng.uniform(-0.3, 0.3, (tried, 2)), rng.uniform(-np.pi, np.pi, tried)])
    return found[model.reachable(found)][:count]


def test_golden_numbers(model: Planar3RRRModel) -> None:
    first, second = (model.inverse_many(GOLDEN[None], mode)[0] for mode in ("+++", "++-"))
    assert np.degrees(first) == pytest.approx([65.391656, 206.30369, -36.627925], abs=1e-6)
    assert np.degrees(second[2]) == pytest.approx(-132.999699, abs=1e-6)
    determinants = [np.linalg.det(np.array(model.jacobians(GOLDEN, theta)[0])) for theta in (first, second)]
    assert determinants == pytest.approx([3.543e-3, -2.025e-3], abs=5e-7)


def test_all_eight_inverse_branches_close_the_loops_and_are_told_apart(model: Planar3RRRModel) -> None:
    for pose in poses(model, np.random.default_rng(1), 100):
        theta = model.inverse(pose)
        assert theta.shape == (8, 3)
        closure = np.array(model.function("closure")(pose, ca.DM(theta.T)))
        assert np.abs(closure).max() < 1e-14
        assert [mode for mode, _ in model.labels(np.tile(pose, (8, 1)), theta)] == list(MODES)


@pytest.mark.parametrize("symmetric", [True, False])
def test_forward_finds_every_real_pose(model: Planar3RRRModel, symmetric: bool) -> None:
    rng = np.random.default_rng(2)
    counts = set()
    for _ in range(60):
        one = model if symmetric else uneven(rng)
        pose = poses(one, rng, 1)[0]
        theta = one.inverse(pose)[rng.integers(8)]
        found = one.forward(theta)
        counts.add(len(found))
        assert np.abs(found - pose).max(axis=1).min() < 1e-9
        closure = np.array(one.function("closure")(ca.DM(found.T), theta))
        assert np.abs(closure).max() < 1e-12
        assert len(found) == changes_of_sign(one, theta)
        assert (np.diff(found[:, 2]) > 0).all()
    assert counts <= {2, 4, 6}
    assert len(counts) > 1


def changes_of_sign(model: Planar3RRRModel, theta: np.ndarray) -> int:
    """How often the closing condition changes its sign over a fine grid of platform angles."""
    legs = model.robot.legs
    elbows = np.array(model.robot.base.corners) + legs.proximal * np.column_stack([np.cos(theta), np.sin(theta)])
    grid = np.linspace(0, 2 * np.pi, 40_001)
    values = _closing(elbows, np.array(model.robot.platform.corners), legs.distal, grid)
    return int((np.sign(values[1:]) != np.sign(values[:-1])).sum())


def test_joints_that_cannot_be_assembled_have_no_pose(model: Planar3RRRModel) -> None:
    away = np.radians([210.0, 330.0, 90.0])  # all elbows point outward
    assert model.forward(away).shape == (0, 3)


def test_forward_where_two_assemblies_meet(model: Planar3RRRModel) -> None:
    """On the type II surface the pose is a double root: found, if less precisely."""
    region = np.random.default_rng(4).uniform([-0.1, -0.1, -0.34], [0.1, 0.1, 0.34], (500, 3))
    signs = np.array([sign for _, sign in model.labels(region, model.inverse_many(region, "++-"))])
    low, high = region[signs < 0][0], region[signs > 0][0]
    for _ in range(60):
        middle = (low + high) / 2
        found = model.inverse_many(middle[None], "++-")
        low, high = (low, middle) if model.labels(middle[None], found)[0][1] > 0 else (middle, high)
    near = model.forward(found[0])
    assert np.abs(near - low).max(axis=1).min() < 1e-5


def test_jacobians_by_finite_differences(model: Planar3RRRModel) -> None:
    rng = np.random.default_rng(3)
    for pose in poses(model, rng, 20):
        mode = MODES[rng.integers(8)]
        theta = model.inverse_many(pose[None], mode)[0]
        A, b = (np.array(part) for part in model.jacobians(pose, theta))
        if np.abs(b).min() < 1e-3:
            continue
        h = 1e-7
        ahead, behind = (model.inverse_many(pose + sign * h * np.eye(3), mode) for sign in (1, -1))
        rates = (ahead - behind).T / (2 * h)  # theta' of unit pose rates, a column each
        assert np.abs(A - b.reshape(3, 1) * rates).max() < 1e-5


def test_inverse_function_agrees_and_is_symbolic(model: Planar3RRRModel) -> None:
    function = model.function("inverse")
    for mode in MODES:
        assert np.array(function(GOLDEN, mode_signs(mode))).ravel() == pytest.approx(
            model.inverse_many(GOLDEN[None], mode)[0], abs=1e-14
        )
    pose = ca.SX.sym("pose", 3)
    assert isinstance(function(pose, mode_signs("+++")), ca.SX)


def test_newton_doubles_the_digits(model: Planar3RRRModel) -> None:
    theta = model.inverse_many(GOLDEN[None], "+++")[0]
    pose, errors = GOLDEN + np.array([2e-3, -1e-3, 5e-3]), []
    for _ in range(3):
        pose = np.array(model.function("newton")(pose, theta)).ravel()
        errors.append(float(np.abs(pose - GOLDEN).max()))
    assert errors[0] < 1e-3
    assert errors[1] < 1e-8
    assert errors[2] < 1e-15


def test_type_one_is_a_stretched_leg(model: Planar3RRRModel) -> None:
    d = np.array([0.5, 0.0])  # leg 1 stretched along x
    foot, corner = np.array(model.robot.base.corners[0]), np.array(model.robot.platform.corners[0])
    pose = np.array([*(foot + 0.999999999 * d - corner), 0.0])
    theta = model.inverse_many(pose[None], "+++")
    assert abs(model.measures(pose[None], theta)[0, 0]) < 1e-3


def test_points_join_the_links(model: Planar3RRRModel) -> None:
    theta = model.inverse(GOLDEN)[3]
    elbows, corners = (np.array(part).T for part in model.function("points")(GOLDEN, theta))
    assert np.linalg.norm(elbows - np.array(model.robot.base.corners), axis=1) == pytest.approx(0.25)
    assert np.linalg.norm(elbows - corners, axis=1) == pytest.approx(0.25)


def test_errors_name_what_is_wrong(model: Planar3RRRModel) -> None:
    with pytest.raises(SpecError, match=r"leg 2 would have to span 0\.6\d* m; it spans 0 to 0\.5 m"):
        model.inverse([-0.3, 0.1, 0.0])
    with pytest.raises(SpecError, match=r"no working mode '\+\+'; there are \+\+\+, "):
        mode_signs("++")
    with pytest.raises(SpecError, match="no function 'jacobian'; there are inverse, jacobians, "):
        model.function("jacobian")


def test_limits_are_those_of_the_file(model: Planar3RRRModel) -> None:
    assert model.speeds == pytest.approx(np.pi)
    assert np.isinf(model.limits).all()
