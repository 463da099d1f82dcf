"""Inverse kinematics: exact on all branches, named, inside the limits, wound; search for any other arm; refusals."""

import re
from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import fzcli
from fzcli.errors import SpecError
from fzcli.model import RobotModel
from fzcli.model.inverse import InverseKinematics, Solution, build_inverse, inverse_kinematics
from fzcli.spec.robot import Frame, Robot
from fzcli.spec.tool import Tool, with_tool
from tests.loop.reaching_cases import arm, skew_arm, vector
from tests.oracle.numpy_reference import NumpyReference, rotation_about, rotation_from_rpy, rotation_vector, skew

Array = NDArray[np.float64]
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
X, Y, Z, HERE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
EXACT = {"melfa_rv1a": "spherical_wrist", "ur5": "ur"}


@cache
def _inverse(robot: str, kind: str | None = None) -> InverseKinematics:
    return build_inverse(fzcli.build_model(fzcli.load_robot(robot)), kind=kind)


def _seen(reference: NumpyReference, q: Array, tip: str | None = None) -> tuple[Array, Array]:
    """The oracle's tip pose from the base frame."""
    position, rotation = reference.forward_kinematics(q, UPRIGHT, tip)
    return position + reference.reference_point(q, UPRIGHT), rotation


def _chain(model: RobotModel, q: Array) -> tuple[Array, Array]:
    """Tip poses (k, 3), (k, 3, 3) of postures (k, n) of an arm without branches, link by link in plain NumPy."""
    R, p = np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3))
    for i, link in enumerate(model.robot.links):
        p = p + R @ np.array(link.at.xyz)
        R = R @ rotation_from_rpy(link.at.rpy)
        K = skew(np.array(link.joint.axis) / np.linalg.norm(link.joint.axis))
        s, c = np.sin(q[:, i])[:, None, None], np.cos(q[:, i])[:, None, None]
        R = R @ (np.eye(3) + s * K + (1 - c) * (K @ K))
    tip = next(iter(model.robot.tips.values()))
    return p + R @ np.array(tip.xyz), R @ rotation_from_rpy(tip.rpy)


def _postures(inverse: InverseKinematics, count: int, seed: int) -> Array:
    low, high = inverse.model.tree.position_limits.T
    return np.random.default_rng(seed).uniform(low, high, (count, inverse.model.n))


def _apart(q: Array, other: Array) -> float:
    """The largest difference of angles, whole turns aside."""
    return float(np.abs((q - other + np.pi) % (2 * np.pi) - np.pi).max())


def _misses(inverse: InverseKinematics, found: list[list[Solution]], p: Array, R: Array) -> tuple[Array, Array]:
    """Largest position and rotation-entry errors of all solutions, by the plain chain."""
    of = np.repeat(np.arange(len(found)), [len(one) for one in found])
    reached, turned = _chain(inverse.model, np.array([solution.q for one in found for solution in one]))
    return np.linalg.norm(reached - p[of], axis=1), np.abs(turned - R[of]).max(axis=(1, 2))


# The closed forms


@pytest.mark.parametrize("robot", EXACT)
def test_ten_thousand_reachable_poses_are_met_exactly(robot: str) -> None:
    inverse = _inverse(robot)
    assert (inverse.kind, inverse.why) == (EXACT[robot], "")
    q = _postures(inverse, 10_000, 1)
    p, R = _chain(inverse.model, q)
    found = [inverse.solve(position, rotation) for position, rotation in zip(p, R, strict=True)]
    assert min(map(len, found)) >= 1
    distance, entry = _misses(inverse, found, p, R)
    assert max(distance.max(), entry.max()) < 1e-12  # 2e-15 found
    assert max(solution.error for one in found for solution in one) < 1e-12
    # The posture that the pose was made of is among them.
    own = [min(_apart(solution.q, given) for solution in one) for one, given in zip(found, q, strict=True)]
    assert max(own) < 1e-7


@pytest.mark.parametrize("robot", EXACT)
def test_solutions_are_inside_the_limits_named_and_nearest_first(robot: str) -> None:
    inverse, counts = _inverse(robot), set()
    low, high = inverse.model.tree.position_limits.T
    q = _postures(inverse, 300, 2)
    for given, p, R in zip(q, *_chain(inverse.model, q), strict=True):
        near = given + 0.3
        found = inverse.solve(p, R, near=near)
        counts.add(len(found))
        assert len({solution.branch for solution in found}) == len(found)
        for solution in found:
            assert ((low <= solution.q) & (solution.q <= high)).all()
            assert inverse.branch(solution.q) == solution.branch
            assert solution.excess == pytest.approx(np.maximum(low - solution.q, solution.q - high).max(), abs=1e-15)
        ways = [float(((solution.q - near) ** 2).sum()) for solution in found]
        assert ways == sorted(ways)
        assert inverse.branch(given) in {solution.branch for solution in found}
    assert counts <= ({1, 2, 3, 4} if robot == "melfa_rv1a" else {2, 4, 6, 8})


def test_all_eight_branches_of_a_pose_with_limits_aside() -> None:
    inverse = _inverse("melfa_rv1a")
    q = np.deg2rad([30.0, 40.0, 100.0, -50.0, 60.0, 70.0])
    p, R = (values[0] for values in _chain(inverse.model, q[None, :]))
    np.testing.assert_allclose(p, [0.305275, 0.121096, 0.373454], atol=1e-6)  # the manual's arm
    found = inverse.solve(p, R, limits=False)
    assert {solution.branch for solution in found} == {
        f"{side}, elbow {elbow}, {wrist}"
        for side in ("front", "back")
        for elbow in ("up", "down")
        for wrist in ("flip", "noflip")
    }
    by_name = {solution.branch: solution.q for solution in found}
    assert _apart(by_name["front, elbow up, noflip"], q) < 1e-12
    # A flip turns joint 4 by half a turn and mirrors joint 5.
    flipped = by_name["front, elbow up, flip"]
    assert _apart(flipped, q + np.array([0, 0, 0, np.pi, -2 * q[4], np.pi])) < 1e-12
    assert all(solution.excess > 0 for solution in found if solution.branch.startswith("back"))
    assert [s.branch for s in inverse.solve(p, R)] == [s.branch for s in found if s.excess <= 0]


def test_the_elbow_is_up_when_it_is_above_the_line_from_shoulder_to_wrist() -> None:
    """Also behind the first axis, where joint 3's sense is the other one."""
    for robot in EXACT:
        inverse = _inverse(robot)
        for q in _postures(inverse, 200, 3):
            origins = [np.zeros(3)]
            R, p = np.eye(3), np.zeros(3)
            for link, value in zip(inverse.model.robot.links, q, strict=True):
                p = p + R @ np.array(link.at.xyz)
                R = R @ rotation_from_rpy(link.at.rpy) @ rotation_about(link.joint.axis, value)
                origins.append(p)
            # Wrist: the meeting point of the last three axes, or joint 4; axis 1 is vertical in both.
            wrist = origins[5] if robot == "melfa_rv1a" else origins[4]
            line, arm_ = wrist - origins[2], origins[3] - origins[2]
            level = np.hypot(*line[:2])
            above = (arm_ - line * (arm_ @ line) / (line @ line))[2]
            if robot == "ur5" and (wrist - origins[1])[:2] @ (_meeting(inverse, q) - origins[1])[:2] <= 0:
                continue  # the wrist reaches back over axis 1
            if min(level, abs(above)) > 1e-3 and line[:2] @ (wrist - origins[1])[:2] > 0:
                assert ("elbow up" in inverse.branch(q)) == (above > 0), (robot, q)


def _meeting(inverse: InverseKinematics, q: Array) -> Array:
    p, R = (values[0] for values in _chain(inverse.model, q[None, :]))
    return np.asarray(p - 0.0823 * R[:, 2])


def test_branches_part_at_the_singular_postures_alone() -> None:
    """The Jacobian's determinant has the sign of shoulder times elbow times wrist, everywhere."""
    for robot in EXACT:
        inverse, products = _inverse(robot), []
        assert inverse.form is not None
        for q in np.random.default_rng(4).uniform(-np.pi, np.pi, (500, 6)):
            signs = np.array(inverse.form.signs(q)).ravel()
            determinant = np.linalg.det(np.array(inverse.model.generalized_jacobian(q, UPRIGHT)))
            products.append(np.sign(determinant * signs.prod()))
        assert abs(sum(products)) == 500


def test_windings_are_all_that_the_limits_allow() -> None:
    inverse = _inverse("ur5")
    low, high = inverse.model.tree.position_limits.T
    q = _postures(inverse, 1, 5)
    p, R = (values[0] for values in _chain(inverse.model, q))
    single, wound = inverse.solve(p, R), inverse.solve(p, R, windings=True)
    assert len(wound) == 64 * len(single)  # two turns a joint
    assert len({tuple(np.round(solution.q, 6)) for solution in wound}) == len(wound)
    for solution in wound:
        assert ((low <= solution.q) & (solution.q <= high)).all()
        assert min(_apart(solution.q, one.q) for one in single if one.branch == solution.branch) < 1e-12
    near = wound[-1].q
    assert np.array_equal(inverse.solve(p, R, near=near)[0].q, near)


def test_a_winding_at_a_limit_is_kept() -> None:
    inverse = _inverse("melfa_rv1a")
    q = np.deg2rad([-150.0, 30.0, 155.0, 160.0, 90.0, 200.0])
    p, R = (values[0] for values in _chain(inverse.model, q[None, :]))
    found = inverse.solve(p, R, near=q)
    np.testing.assert_allclose(found[0].q, q, atol=1e-7)
    assert found[0].excess <= 0.0
    turned = [solution.q[5] for solution in inverse.solve(p, R, windings=True) if abs(solution.q[4] - q[4]) < 1e-6]
    assert sorted(np.rad2deg(turned)) == pytest.approx([-160.0, 200.0], abs=1e-5)


# Singular postures


@pytest.mark.parametrize(
    ("robot", "degrees"),
    [
        ("melfa_rv1a", (0, 0, 90, 0, 0, 0)),
        ("melfa_rv1a", (-60, 20, 100, 70, 0, 40)),
        ("melfa_rv1a", (-60, 20, 100, 0, 1e-7, 0)),
        ("ur5", (0, -90, 0, -90, 0, 0)),
        ("ur5", (0, 0, 0, 0, 0, 0)),
        ("ur5", (20, -70, -60, -30, 180, 50)),
        ("ur5", (20, -70, 0, -30, 1e-7, 50)),
    ],
)
def test_singular_postures_are_met_too(robot: str, degrees: tuple[float, ...]) -> None:
    inverse, q = _inverse(robot), np.deg2rad(np.array(degrees, float))
    p, R = (values[0] for values in _chain(inverse.model, q[None, :]))
    for near in (None, q):
        found = inverse.solve(p, R, near=near)
        assert found
        distance, entry = _misses(inverse, [found], p[None], R[None])
        assert max(distance.max(), entry.max()) < 1e-9
    # Near q the free joint is q's own. A stretched elbow leaves half the digits, on an almost locked wrist a quarter.
    assert _apart(found[0].q, q) < 1e-3


# Any geometry


def _wrists() -> Iterator[Robot]:
    """Arms with a spherical wrist on skew mounts: leaning first axes, shifted shoulders and elbows, oblique wrists."""
    rng = np.random.default_rng(6)
    for k in range(12):
        lean = vector(np.array([0.0, 1.0, 0.0]) + (0.4 * rng.normal(size=3) if k % 2 else 0.0))
        oblique = vector(np.array([0.0, 1.0, 0.0]) + (0.3 * rng.normal(size=3) if k % 3 == 2 else 0.0))
        sense = vector(np.array(lean) * (-1.0 if k % 4 == 0 else 1.0))
        yield arm(
            (vector(rng.normal(size=3)), Z),
            (vector(0.3 * rng.normal(size=3)), lean),
            (vector(0.5 * rng.normal(size=3)), sense),
            (vector(0.5 * rng.normal(size=3)), X),
            (HERE, oblique),
            (HERE, X if k % 3 else Z),
            tip=vector(0.2 * rng.normal(size=3)),
            tip_rpy=vector(rng.normal(size=3)),
        )


def _parallels() -> Iterator[Robot]:
    """Arms of three parallel axes and two that meet, offsets everywhere."""
    rng = np.random.default_rng(7)
    for k in range(12):
        lean = vector(np.array([0.0, 1.0, 0.0]) + (0.4 * rng.normal(size=3) if k % 2 else 0.0))
        back = vector(-np.array(lean))
        fifth = vector(np.cross(lean, rng.normal(size=3)) + (0.2 * rng.normal(size=3) if k % 3 == 2 else 0.0))
        yield arm(
            (vector(rng.normal(size=3)), Z),
            (vector(0.3 * rng.normal(size=3)), lean),
            (vector(0.5 * rng.normal(size=3)), back if k % 4 == 1 else lean),
            (vector(0.5 * rng.normal(size=3)), back if k % 4 == 2 else lean),
            (vector(0.2 * rng.normal(size=3)), fifth),
            (HERE, lean if k % 2 else vector(rng.normal(size=3))),
            tip=vector(0.2 * rng.normal(size=3)),
            tip_rpy=vector(rng.normal(size=3)),
        )


@pytest.mark.parametrize(("arms", "kind"), [(_wrists, "spherical_wrist"), (_parallels, "ur")])
def test_the_geometry_is_found_whatever_the_frames(arms: object, kind: str) -> None:
    for robot in arms():  # type: ignore[operator]
        inverse = build_inverse(fzcli.build_model(robot))
        assert inverse.kind == kind, inverse.why
        q = np.random.default_rng(8).uniform(-np.pi, np.pi, (40, 6))
        p, R = _chain(inverse.model, q)
        found = [inverse.solve(position, rotation) for position, rotation in zip(p, R, strict=True)]
        distance, entry = _misses(inverse, found, p, R)
        assert max(distance.max(), entry.max()) < 1e-9
        for given, one in zip(q, found, strict=True):
            assert min(_apart(solution.q, given) for solution in one) < 1e-6
            assert all(inverse.branch(solution.q) == solution.branch for solution in one)


def test_a_geometry_that_is_special_only_almost_is_finished_by_newton_steps() -> None:
    """Robot files give pi/2 in nine digits; axes are then parallel or meet to about 1e-9."""
    robot = fzcli.load_robot("ur5")
    rounded = [
        link.model_copy(update={"at": link.at.model_copy(update={"rpy": tuple(round(a, 8) for a in link.at.rpy)})})
        for link in robot.links
    ]
    inverse = build_inverse(fzcli.build_model(robot.model_copy(update={"links": tuple(rounded)})))
    assert inverse.kind == "ur"
    q = _postures(inverse, 200, 9)
    p, R = _chain(inverse.model, q)
    found = [inverse.solve(position, rotation) for position, rotation in zip(p, R, strict=True)]
    distance, entry = _misses(inverse, found, p, R)
    assert max(distance.max(), entry.max()) < 1e-9


# Frames: floating bases, several tips, tools


def test_the_pose_is_relative_to_the_base_frame_on_a_free_base() -> None:
    robot = fzcli.load_robot("ur5_free_flyer")
    model, reference = fzcli.build_model(robot), NumpyReference(robot)
    for q in np.random.default_rng(10).uniform(-3, 3, (20, 6)):
        found = inverse_kinematics(model, *_seen(reference, q), near=q)
        assert found[0].branch.startswith("shoulder")
        np.testing.assert_allclose(found[0].q, q, atol=1e-7)


@pytest.mark.parametrize("tip", ["left", "right"])
def test_joints_that_do_not_carry_the_tip_stay(tip: str) -> None:
    robot = fzcli.load_robot("dual_arm")
    model, reference = fzcli.build_model(robot), NumpyReference(robot)
    mine = model.carriers(tip)
    others = sorted(set(range(model.n)) - set(mine))
    low, high = model.tree.position_limits.T
    for q in np.random.default_rng(11).uniform(low, high, (20, model.n)):
        near = 0.5 * (low + high) + 0.1
        near[mine] = q[mine]
        found = inverse_kinematics(model, *_seen(reference, q, tip), tip=tip, near=near)
        np.testing.assert_allclose(found[0].q[mine], q[mine], atol=1e-6)
        assert all((solution.q[others] == near[others]).all() for solution in found)


@pytest.mark.parametrize("kind", [None, "numeric"])
def test_a_tool_extends_the_tip(kind: str | None) -> None:
    robot = fzcli.load_robot("melfa_rv1a")
    tool = Tool(xyz=(0.02, -0.03, 0.1), rpy=(0.3, 0.2, -0.4), radius=0.03)
    longer = NumpyReference(with_tool(robot, tool))
    inverse = build_inverse(fzcli.build_model(robot), tool=Frame(xyz=tool.xyz, rpy=tool.rpy), kind=kind)
    for q in _postures(inverse, 20, 12):
        found = inverse.solve(*_seen(longer, q), near=q)
        np.testing.assert_allclose(found[0].q, q, atol=1e-6)


# The search


def test_the_search_meets_reachable_poses_of_the_ur5_from_the_middle() -> None:
    """The protocol of TRAC-IK's own comparison: random reachable poses, mid-range start, 1e-5."""
    inverse = _inverse("ur5", "numeric")
    q = _postures(inverse, 10_000, 13)
    p, R = _chain(inverse.model, q)
    found = [inverse.solve(*pose, tolerance=1e-5) for pose in zip(p, R, strict=True)]
    assert np.mean([len(one) == 1 for one in found]) >= 0.999  # all of them found
    distance, entry = _misses(inverse, found, p, R)
    assert max(distance.max(), entry.max()) < 1e-5


def test_the_search_keeps_to_narrow_limits() -> None:
    inverse = _inverse("melfa_rv1a", "numeric")
    q = _postures(inverse, 300, 14)
    p, R = _chain(inverse.model, q)
    found = [inverse.solve(*pose) for pose in zip(p, R, strict=True)]
    assert np.mean([len(one) == 1 for one in found]) >= 0.99
    assert all(solution.excess <= 0 for one in found for solution in one)
    distance, entry = _misses(inverse, found, p, R)
    assert max(distance.max(), entry.max()) < 1e-9


@pytest.mark.parametrize("n", [2, 4, 5, 7, 9])
def test_the_search_serves_any_number_of_joints(n: int) -> None:
    inverse = build_inverse(fzcli.build_model(skew_arm(np.random.default_rng(n), n, floating=n % 2 == 0)))
    assert inverse.kind == "numeric"
    reference = NumpyReference(inverse.model.robot)
    for q in np.random.default_rng(15).uniform(-np.pi, np.pi, (20, n)):
        p, R = _seen(reference, q)
        found = inverse.solve(p, R)
        assert found, q
        reached, turned = _seen(reference, found[0].q)
        assert np.linalg.norm(reached - p) < 1e-9
        assert np.linalg.norm(rotation_vector(turned.T @ R)) < 1e-9
        assert found[0].branch == ""


def test_the_search_moves_sliding_joints() -> None:
    robot = arm((HERE, Z), (Z, X), (X, Y), (X, Z), (HERE, Y), (HERE, X), types={1: "prismatic"}, limits=(-2.0, 2.0))
    inverse, reference = build_inverse(fzcli.build_model(robot)), NumpyReference(robot)
    assert inverse.why == "spherical_wrist: it has not six hinges; ur: it has not six hinges"
    for q in np.random.default_rng(16).uniform(-2, 2, (20, 6)):
        p, R = _seen(reference, q)
        found = inverse.solve(p, R)
        assert found
        np.testing.assert_allclose(_seen(reference, found[0].q)[0], p, atol=1e-9)
        assert (np.abs(found[0].q) <= 2.0).all()


@pytest.mark.parametrize("robot", ["bulgarelli4", "planar3", "ur5"])
def test_a_position_alone_is_met_with_any_rotation(robot: str) -> None:
    inverse, reference = _inverse(robot), NumpyReference(fzcli.load_robot(robot))
    for q in np.random.default_rng(17).uniform(-1.5, 1.5, (20, inverse.model.n)):
        p, _ = _seen(reference, q)
        found = inverse.solve(p, near=q + 0.1)
        np.testing.assert_allclose(_seen(reference, found[0].q)[0], p, atol=1e-9)
        assert found[0].angle == 0.0
        assert np.abs(found[0].q - q).max() < 1.0  # it stays about where it began


def test_the_same_seed_finds_the_same_posture() -> None:
    inverse = _inverse("ur5", "numeric")
    q = _postures(inverse, 40, 18)
    for p, R in zip(*_chain(inverse.model, q), strict=True):
        one, two = (inverse.solve(p, R, seed=3)[0] for _ in range(2))
        assert np.array_equal(one.q, two.q)


# Out of reach, and bad input


def test_a_pose_out_of_reach_has_no_solution_and_says_by_how_much() -> None:
    inverse = _inverse("melfa_rv1a")
    stretched = np.deg2rad([0.0, 90.0, 90.0 - np.rad2deg(np.arctan2(0.16, 0.09)), 0.0, 0.0, 0.0])
    p, R = (values[0] for values in _chain(inverse.model, stretched[None, :]))
    shoulder = np.array([0.0, 0.0, 0.3])
    wrist = p - 0.072 * R[:, 2]
    ahead = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    for by in (1e-3, 0.1, 2.0):
        assert inverse.solve(p + by * ahead, R) == []
        best = inverse.branches(p + by * ahead, R)[0]
        span = 0.25 + np.hypot(0.16, 0.09) - np.linalg.norm(wrist - shoulder)
        assert best.distance == pytest.approx(by - span, abs=1e-12)
        assert best.angle < 1e-7
    assert len(inverse.branches(p, R)) == 8


def test_a_pose_beyond_a_limit_names_the_excess() -> None:
    inverse = _inverse("melfa_rv1a")
    q = np.deg2rad([155.0, 30.0, 100.0, 20.0, 40.0, 10.0])
    p, R = (values[0] for values in _chain(inverse.model, q[None, :]))
    assert all(np.deg2rad(155.0) - solution.q[0] > 1e-3 for solution in inverse.solve(p, R))
    beyond = min(inverse.solve(p, R, limits=False, near=q), key=lambda one: float(np.abs(one.q - q).max()))
    assert np.rad2deg(beyond.excess) == pytest.approx(5.0, abs=1e-9)


def test_a_roughly_written_rotation_is_made_one() -> None:
    inverse = _inverse("ur5")
    q = _postures(inverse, 1, 19)
    p, R = (values[0] for values in _chain(inverse.model, q))
    found = inverse.solve(p, np.round(R, 5))
    assert found
    assert found[0].error < 1e-12
    assert np.abs(_chain(inverse.model, found[0].q[None, :])[1][0] - R).max() < 2e-5


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"position": [0.0, 0.1]}, "position: must be 3 finite numbers, not [0.  0.1]"),
        ({"position": [0.0, 0.1, np.nan]}, "position: must be 3 finite numbers, not [0.  0.1 nan]"),
        ({"rotation": np.zeros((2, 3))}, "rotation: must be 3 x 3 finite numbers, not of shape (2, 3)"),
        ({"rotation": 2 * np.eye(3)}, "rotation: is no rotation: its columns are off square or unit length by 3"),
        ({"rotation": np.diag([1.0, 1.0, -1.0])}, "rotation: is no rotation: it mirrors"),
        ({"near": [0.0] * 5}, "near: must be 6 finite numbers, not [0. 0. 0. 0. 0.]"),
    ],
)
def test_bad_targets_are_named(change: dict[str, Array], text: str) -> None:
    given: dict[str, Array] = {"position": np.array([0.3, 0.1, 0.4]), "rotation": np.eye(3), **change}
    with pytest.raises(SpecError, match=f"^{re.escape(text)}$"):
        _inverse("ur5").solve(given["position"], given["rotation"], near=given.get("near"))


@pytest.mark.parametrize(
    ("robot", "kind", "text"),
    [
        ("ur5", "spherical_wrist", "the axes of wrist_1, wrist_2 and wrist_3 miss one point by 0.0473 m"),
        ("melfa_rv1a", "ur", "the axes of J2 and J4 are not parallel"),
        ("bulgarelli4", "ur", "it has not six hinges"),
    ],
)
def test_an_arm_without_the_geometry_is_refused_by_name(robot: str, kind: str, text: str) -> None:
    with pytest.raises(SpecError, match=re.escape(f"kind: the arm has no such closed form: {kind}: {text}")):
        _inverse(robot, kind)


def test_unknown_names_are_refused() -> None:
    model = fzcli.build_model(fzcli.load_robot("ur5"))
    with pytest.raises(SpecError, match=r"^kind: no inverse kinematics 'ikfast'; known: spherical_wrist, ur, numeric$"):
        build_inverse(model, kind="ikfast")
    with pytest.raises(SpecError, match=r"^tip: no tip 'hand'; the robot has flange$"):
        inverse_kinematics(model, [0, 0, 1], tip="hand")
