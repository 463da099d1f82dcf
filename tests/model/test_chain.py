"""Chain points of serial arms: the oracle's, square to their hinges, of constant length; the reach; refusals."""

import re
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

import fzcli
from fzcli.errors import SpecError
from fzcli.model import RobotModel
from fzcli.spec.robot import Robot, Tip
from tests.loop.reaching_cases import arm, skew_arm, vector
from tests.oracle.fabrik_points import UPRIGHT, chain_of
from tests.oracle.fabrik_points import Chain as OracleChain

Array = NDArray[np.float64]
X, Y, Z, HERE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


def _arms() -> Iterator[Robot]:
    rng = np.random.default_rng(17)
    for i in range(16):
        yield skew_arm(rng, 2 + i % 6, floating=i % 2 == 0)
    yield fzcli.load_robot("ur5")
    yield fzcli.load_robot("ur5_free_flyer")
    yield arm((HERE, Z), (HERE, Y), (X, X), (HERE, Y), (HERE, X), tip=(0.1, 0.0, 0.0))  # spherical wrist


def _from_reference(model: RobotModel, chain: OracleChain, q: Array) -> tuple[Array, Array]:
    """Points (m+1, 3) and axes (m, 3), from the CoM on a free base."""
    points, axes = (np.array(v).T for v in model.function("chain")(q))
    return points + chain.body.reference_point(q, UPRIGHT), axes


def test_points_and_axes_are_the_oracle_s() -> None:
    rng, worst = np.random.default_rng(1), 0.0
    for robot in _arms():
        model, chain = fzcli.build_model(robot), chain_of(robot)
        own = model.chain()
        assert (own.hinges, own.square, own.approach) == (chain.hinges, chain.square, chain.approach)
        np.testing.assert_allclose(own.lengths, chain.lengths, atol=1e-14)
        for q in rng.uniform(-np.pi, np.pi, (10, model.n)):
            points, axes = _from_reference(model, chain, q)
            expected, expected_axes = chain.at(q)
            worst = max(worst, np.abs(points - expected).max(), np.abs(axes - expected_axes).max())
    assert worst < 1e-13  # 3e-15 found


def test_links_are_square_to_their_hinges_and_keep_their_lengths() -> None:
    rng = np.random.default_rng(2)
    for robot in _arms():
        model = fzcli.build_model(robot)
        for q in rng.uniform(-2 * np.pi, 2 * np.pi, (10, model.n)):
            points, axes = (np.array(v).T for v in model.function("chain")(q))
            links = np.diff(points, axis=0)
            np.testing.assert_allclose(np.linalg.norm(links, axis=1), model.chain().lengths, atol=1e-13)
            assert np.abs((links * axes).sum(axis=1)).max() < 1e-13
            np.testing.assert_allclose(points[-1], np.array(model.function("tip")(q)[0]).ravel(), atol=1e-14)


def test_the_chain_points_of_the_ur5_are_the_paper_s() -> None:
    chain = fzcli.build_model(fzcli.load_robot("ur5_free_flyer")).chain()
    np.testing.assert_allclose(chain.lengths, [0.10915, 0.425, 0.39225, 0.09465, 0.0823], atol=1e-15)
    assert (chain.joints, chain.square, chain.approach) == ((0, 1, 2, 3, 4), True, True)
    assert (chain.free, chain.free_sense) == (5, 1)


# Reach


def _distances(model: RobotModel, seed: int, count: int) -> Array:
    """Of the tip, from the CoM on a free base, else from the first chain point, at random postures."""
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, model.n))
    points = np.array(model.function("chain").map(count)(q.T)[0]).T.reshape(count, -1, 3)
    return np.linalg.norm(points[:, -1] - (0.0 if model.floating else points[:, 0]), axis=1)


@pytest.mark.parametrize("floating", [True, False], ids=["free", "fixed"])
def test_no_posture_is_out_of_reach(floating: bool) -> None:
    """20,000 postures of 10 random arms, one with a link much longer than the others, and of the UR5."""
    rng = np.random.default_rng(4)
    robots = [skew_arm(rng, 2 + i % 6, floating) for i in range(9)]
    robots += [arm((HERE, Z), ((0.1, 0, 0), Y), tip=(3.0, 0.1, 0.2), floating=floating, com=(0.2, 0.1, 0.3))]
    robots += [fzcli.load_robot("ur5_free_flyer" if floating else "ur5")]
    for i, robot in enumerate(robots):
        model = fzcli.build_model(robot)
        near, far = model.chain().reach
        found = _distances(model, i, 2000)
        assert near - 1e-12 <= found.min()
        assert found.max() <= far + 1e-12


def _balls(*lengths: float, floating: bool) -> Robot:
    """Links along x on ball joints of three crossing hinges each; the first at the base's centre."""
    joints = []
    for length in (0.0, *lengths[:-1]):
        joints += [((length, 0.0, 0.0), X), (HERE, Z), (HERE, Y)]
    return arm(*joints, tip=(lengths[-1], 0.0, 0.0), floating=floating)


@pytest.mark.parametrize("floating", [True, False], ids=["free", "fixed"])
def test_the_bounds_are_all_but_attained_by_ball_joints(floating: bool) -> None:
    """The nearest and the farthest of 20,000 postures lie within 5e-4 of the reach."""
    model = fzcli.build_model(_balls(0.6, 0.2, floating=floating))
    near, far = model.chain().reach
    found = _distances(model, 5, 20_000)
    assert near > 0.2
    assert 0 <= found.min() - near < 5e-4 * far
    assert 0 <= far - found.max() < 5e-4 * far


@pytest.mark.parametrize("floating", [True, False], ids=["free", "fixed"])
def test_a_plane_arm_attains_its_bounds_stretched_and_folded(floating: bool) -> None:
    """Hinges and centres of mass on one line: the virtual manipulator's links stretch with the arm's."""
    robot = arm((X, Z), (X, Z), ((5.0, 0, 0), Z), tip=(0.2, 0.0, 0.0), floating=floating, com=(0.1, 0.0, 0.0))
    model = fzcli.build_model(robot)
    near, far = model.chain().reach
    folded = np.array(np.meshgrid(*[[0.0, np.pi]] * 3)).reshape(3, -1).T
    points = [np.array(model.function("chain")(q)[0]).T for q in folded]
    found = [np.linalg.norm(p[-1] - (0.0 if floating else p[0])) for p in points]
    assert near > 1.0
    assert max(found) == pytest.approx(far, abs=1e-14)
    assert min(found) == pytest.approx(near, abs=1e-14)


def test_joints_beside_the_tip_s_own_leave_the_reach_open() -> None:
    robot = arm((HERE, Z), (X, Y), (X, Y), parents={2: "base"}, floating=True)
    robot = robot.model_copy(update={"tips": {"tip": Tip(link="link1", xyz=X)}})
    assert fzcli.build_model(robot).chain().reach == (0.0, np.inf)


# Branches, tips and refusals


def test_every_tip_of_a_branched_robot_has_a_chain_of_its_own() -> None:
    rng = np.random.default_rng(6)
    joints = [(vector(rng.normal(size=3)), vector(rng.normal(size=3))) for _ in range(5)]
    robot = arm(*joints, parents={3: "link0"}, floating=True)
    tips = {"left": Tip(link="link2", xyz=(0.3, 0.1, 0.2)), "right": Tip(link="link4", xyz=(0.1, 0.2, -0.3))}
    model = fzcli.build_model(robot.model_copy(update={"tips": tips}))
    assert (model.chain().joints, model.chain("left").joints, model.chain("right").joints) == (
        (0, 1, 2),
        (0, 1, 2),
        (0, 3, 4),
    )
    for tip in tips:
        for q in rng.uniform(-np.pi, np.pi, (5, 5)):
            points, axes = (np.array(v).T for v in model.function("chain", tip)(q))
            links = np.diff(points, axis=0)
            np.testing.assert_allclose(np.linalg.norm(links, axis=1), model.chain(tip).lengths, atol=1e-13)
            assert np.abs((links * axes).sum(axis=1)).max() < 1e-13
            np.testing.assert_allclose(points[-1], np.array(model.function("tip", tip)(q)[0]).ravel(), atol=1e-14)


@pytest.mark.parametrize(
    ("robot", "text"),
    [
        (arm((HERE, Z), (X, Y), (X, Y), types={1: "prismatic"}), "joint 'q1' slides: chain points need hinges"),
        (arm((HERE, Z), (X, X), tip=X), "tip 'tip' is moved by 1 hinge(s): chain points need at least 2"),
        (arm((HERE, Z)), "tip 'tip' is moved by 1 hinge(s): chain points need at least 2"),
        (
            arm((HERE, Z), (X, Y), (X, Z), (HERE, Y), tip=HERE),
            "joint 'q2' has no foot point: its axis passes through the tip, as the next one's does",
        ),
    ],
    ids=["slides", "one hinge", "one joint", "no foot point"],
)
def test_arms_without_chain_points_are_refused(robot: Robot, text: str) -> None:
    with pytest.raises(SpecError, match=re.escape(text)):
        fzcli.build_model(robot).chain()


def test_a_tip_on_the_base_is_refused() -> None:
    robot = arm((HERE, Z), (X, Y))
    robot = robot.model_copy(update={"tips": {"hull": Tip(link="base", xyz=X)}})
    with pytest.raises(SpecError, match=re.escape("tip 'hull' is moved by 0 hinge(s): chain points need at least 2")):
        fzcli.build_model(robot).chain()
