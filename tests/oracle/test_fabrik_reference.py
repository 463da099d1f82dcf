"""The modified FABRIK reference against the numbers it must give, and against laws of its own."""

from dataclasses import replace

import numpy as np
import pytest

import fzcli
from fzcli.spec.robot import Base, Frame, Joint, JointType, Link, Robot, Tip
from tests.oracle.fabrik_points import UPRIGHT, Array, Chain, chain_of, classic_fabrik, classic_iteration, unit
from tests.oracle.fabrik_reference import (
    Settings,
    Task,
    advance,
    base_position,
    bounds_at,
    command,
    errors,
    followed_points,
    placed,
    start_state,
    sweep,
)
from tests.oracle.fabrik_runs import Run, attitude_error, replay, run
from tests.oracle.numpy_reference import rotation_from_quat

HOME_A = np.deg2rad([0.0, -90.0, 0.0, -90.0, 0.0, 0.0])
HOME_B = np.deg2rad([0.0, -90.0, -90.0, -90.0, 90.0, 0.0])
CAPTURE = Task(np.array([0.3, 0.5, 0.8]), unit(np.array([1.0, 1.0, -1.0])))
CYCLE = Task(np.array([-0.3578, 0.1584, 0.1277]), unit(np.array([0.7706, -0.4412, -0.4599])))
UPSTREAM = ((4,), (2,), (3,), (4,), (5,))  # K_1 = {5}, else {i+1}


@pytest.fixture(scope="module")
def ur5() -> Chain:
    return chain_of(fzcli.load_robot("ur5_free_flyer"))


@pytest.fixture(scope="module")
def ur5_fixed() -> Chain:
    robot = fzcli.load_robot("ur5_free_flyer")
    return chain_of(robot.model_copy(update={"base": robot.base.model_copy(update={"floating": False})}))


@pytest.fixture(scope="module")
def capture_from_a(ur5: Chain) -> Run:
    return run(ur5, start_state(ur5, HOME_A), CAPTURE, Settings(), 200)


def _arm(*joints: tuple[tuple[float, float, float], tuple[float, float, float]], **given: object) -> Robot:
    """A serial arm: each joint's place in the link before, and its axis; given: tip, types, parents."""
    types: dict[int, JointType] = given.get("types", {})  # type: ignore[assignment]
    parents: dict[int, str] = given.get("parents", {})  # type: ignore[assignment]
    links = [
        Link(
            name=f"link{i}",
            parent=parents.get(i, f"link{i - 1}" if i else "base"),
            at=Frame(xyz=at),
            joint=Joint(name=f"q{i}", type=types.get(i, "revolute"), axis=axis, speed=np.pi),
            mass=1.0,
            inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
        )
        for i, (at, axis) in enumerate(joints)
    ]
    tip = Tip(link=links[-1].name, xyz=given.get("tip", (0.4, 0.0, 0.0)))
    base = Base(mass=10.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0), floating=bool(given.get("floating", False)))
    return Robot(name="arm", base=base, links=tuple(links), tips={"tip": tip})


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
HERE = (0.0, 0.0, 0.0)


# Classic FABRIK


def test_classic_iterates_in_the_plane() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])
    target = np.array([1.5, 1.5])
    first = classic_iteration(points, np.ones(3), target)
    expected = [[0.0, 0.0], [0.999964, -0.008515], [1.824642, 0.557087], [1.4991, 1.502615]]
    assert np.max(np.abs(first - expected)) < 1e-6
    assert abs(np.linalg.norm(first[-1] - target) - 2.7656e-3) < 5e-8
    second = classic_iteration(first, np.ones(3), target)
    assert abs(np.linalg.norm(second[-1] - target) - 1.304e-4) < 5e-8


def test_classic_keeps_lengths_and_converges_in_space() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        points = np.cumsum(rng.normal(size=(6, 3)), axis=0)
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        target = points[0] + 0.4 * lengths.sum() * unit(rng.normal(size=3))
        result = classic_fabrik(points, target, 1e-6, 500)
        assert result.error < 1e-6
        assert np.allclose(np.linalg.norm(np.diff(result.points, axis=0), axis=1), lengths, rtol=1e-12)


def test_classic_says_how_far_a_target_is_out_of_reach() -> None:
    points = np.array([[0.0, 0.0], [3.0, 0.0], [4.0, 0.0]])
    far = classic_fabrik(points, np.array([0.0, 4.5]), 1e-3)
    near = classic_fabrik(points, np.array([0.0, 1.5]), 1e-3)
    assert (far.missing, near.missing) == (0.5, 0.5)
    assert far.iterations == near.iterations == 0


# Chain points


def test_chain_points_of_the_ur5(ur5: Chain) -> None:
    assert np.max(np.abs(ur5.lengths - [0.10915, 0.425, 0.39225, 0.09465, 0.0823])) < 1e-15
    assert ur5.hinges == 5
    assert ur5.square
    assert ur5.approach
    points, axes = ur5.at(np.zeros(6))
    first = np.array([0.0, 0.0, 0.2 + 0.089159])  # O1, and z1 = -y at q = 0
    assert np.allclose(axes[1], [0.0, -1.0, 0.0], atol=1e-15)
    assert np.allclose(points[0], first, atol=1e-15)
    assert np.allclose(points[1], first + 0.10915 * axes[1], atol=1e-15)
    assert np.allclose(points[2], points[1] + [-0.425, 0.0, 0.0], atol=1e-15)


def test_links_are_square_to_their_hinges_and_keep_their_length() -> None:
    rng = np.random.default_rng(3)
    for _ in range(10):
        given = [(tuple(rng.normal(size=3)), tuple(rng.normal(size=3))) for _ in range(5)]
        chain = chain_of(_arm(*given, tip=tuple(rng.normal(size=3)), floating=True))  # skew axes
        for q in rng.uniform(-np.pi, np.pi, (5, 5)):
            points, axes = chain.at(q)
            links = np.diff(points, axis=0)
            assert np.allclose(np.linalg.norm(links, axis=1), chain.lengths, atol=1e-12)
            assert np.max(np.abs(np.sum(links * axes, axis=1))) < 1e-12


def test_a_spherical_wrist_has_a_link_of_length_zero() -> None:
    chain = chain_of(_arm((HERE, Z), (HERE, Y), (X, X), (HERE, Y), (HERE, X), tip=(0.1, 0.0, 0.0)))
    assert chain.hinges == 4
    assert np.allclose(chain.lengths, [0.0, 1.0, 0.0, 0.1])


@pytest.mark.parametrize(
    ("robot", "text"),
    [
        (_arm((HERE, Z), (X, Y), (X, Y), types={1: "prismatic"}), "joint 'q1' slides: chain points need hinges"),
        (_arm((HERE, Z), (X, Y), (X, Y), parents={2: "link0"}), "joint 'q2' branches off"),
        (_arm((HERE, Z), (X, X), tip=X), "'arm' has 1 hinges that move the tip: at least 2 are needed"),
        (_arm((HERE, Z), (X, Y), (X, Z), (HERE, Y), tip=HERE), "joint 'q2' has no foot point"),
    ],
)
def test_arms_without_chain_points_are_refused(robot: Robot, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        chain_of(robot)


# The law


def test_followed_points() -> None:
    assert followed_points("literal", 5, True) == ((1,), (2,), (3,), (4,), (5,))
    assert followed_points("N1", 5, True) == ((1, 4, 5), (2, 4, 5), (3, 4, 5), (4, 5), (5,))
    assert followed_points("N10", 3, False) == ((1, 3), (2, 3), (3,))


def test_points_after_a_sweep_are_those_of_the_turned_joints(ur5: Chain) -> None:
    state = start_state(ur5, HOME_B)
    for variant in ("literal", "N1"):
        points, axes = placed(ur5, state)
        bounds = bounds_at(ur5, state.q, 0.2)
        dq, moved, turned = sweep(ur5, points, axes, CAPTURE, Settings(variant=variant), bounds, held=True)
        after = replace(state, q=state.q + np.append(dq, 0.0), anchor=state.anchor)
        points, axes = ur5.at(after.q)
        assert np.allclose(moved, points + base_position(ur5, state), atol=1e-12)
        assert np.allclose(turned, axes, atol=1e-12)


DEADLOCK = Task(np.array([0.874356, 0.191770, 0.055072]))


def _deadlock(variant: str) -> Run:
    chain = chain_of(_arm((HERE, Z), ((0.2, 0.0, 0.0), Y), ((0.4, 0.0, 0.0), Y)))
    return run(chain, start_state(chain, np.array([0.0, -0.5, 0.9])), DEADLOCK, Settings(variant=variant), 30)


def test_literal_deadlock() -> None:
    stuck = _deadlock("literal")
    assert not stuck.done
    assert np.max(np.abs(stuck.error - 0.19792)) < 1e-5
    assert np.max(np.abs(stuck.states[-1].q - stuck.states[-2].q)) < 1e-9


def test_n1_cures_the_deadlock() -> None:
    cured = _deadlock("N1")
    assert cured.done
    assert cured.steps == 7
    assert abs(cured.error[-1] - 2.85e-3) < 5e-6
    assert np.max(np.abs(cured.states[-1].q - [0.2146, -0.5836, 1.0128])) < 1e-4


def test_literal_circles_with_period_nine(ur5_fixed: Chain) -> None:
    settings = Settings(variant="literal", clamped=False)
    stuck = run(ur5_fixed, start_state(ur5_fixed, HOME_B), CYCLE, settings, 300)
    assert not stuck.done
    assert np.max(np.abs(stuck.error[-30:] - 0.4298)) < 2e-4
    last = stuck.states[-1].q
    away = [np.max(np.abs(stuck.states[-1 - k].q - last)) for k in range(1, 15)]
    assert int(np.argmin(away)) + 1 == 9


@pytest.mark.parametrize(("variant", "steps"), [("N1", 149), ("N10", 110)])
def test_the_cycle_is_broken(ur5: Chain, variant: str, steps: int) -> None:
    result = run(ur5, start_state(ur5, HOME_B), CYCLE, Settings(variant=variant), 200)
    assert result.done
    assert result.steps == steps


def _check_arrival(result: Run, steps: int, millimetres: float, degrees: float, turned: float) -> None:
    assert result.done
    assert result.steps == steps
    assert abs(1e3 * result.error[-1] - millimetres) < 6e-3
    assert abs(np.rad2deg(result.angle[-1]) - degrees) < 6e-3
    assert abs(np.rad2deg(attitude_error(UPRIGHT, result.states[-1].quat)) - turned) < 6e-3


def test_capture_from_home_a(capture_from_a: Run) -> None:
    _check_arrival(capture_from_a, 44, 4.29, 1.90, 29.59)
    q = np.rad2deg(capture_from_a.states[-1].q)
    assert np.max(np.abs(q[:5] - [75.84, -150.69, -34.49, -58.11, 79.20])) < 6e-3
    history = capture_from_a.error[[0, 10, 20, 30, 40, 44]]
    assert np.max(np.abs(history - [0.8538, 0.6843, 0.4544, 0.2394, 0.0498, 0.0043])) < 5.1e-5


def test_capture_from_home_b(ur5: Chain) -> None:
    _check_arrival(run(ur5, start_state(ur5, HOME_B), CAPTURE, Settings(), 200), 52, 6.37, 0.09, 22.48)


def test_following_the_last_hinge_only_takes_the_papers_time(ur5: Chain) -> None:
    settings = Settings(variant="N1", followed=UPSTREAM)
    assert run(ur5, start_state(ur5, HOME_A), CAPTURE, settings, 100).steps == 62


def test_speeds_and_limits_hold(ur5: Chain) -> None:
    rng = np.random.default_rng(8)
    for variant in ("literal", "N1", "N10", "dls"):
        for _ in range(5):
            q = rng.uniform(-2.0 * np.pi, 2.0 * np.pi, 6)
            q[rng.integers(6)] = 2.0 * np.pi
            dq = command(ur5, start_state(ur5, q), CYCLE, Settings(variant=variant))
            assert np.max(np.abs(dq)) <= np.pi * 0.01 * (1.0 + 1e-12)
            assert np.max(np.abs(q + dq)) <= 2.0 * np.pi * (1.0 + 1e-15)


def test_a_direction_off_the_last_link_is_refused() -> None:
    chain = chain_of(_arm((HERE, Z), ((0.2, 0.0, 0.0), Y), ((0.4, 0.0, 0.0), Y)))
    state = start_state(chain, np.zeros(3))
    with pytest.raises(ValueError, match="a direction needs the tip's z along the last link"):
        command(chain, state, Task(DEADLOCK.target, np.array(Z)), Settings())


# The base


def test_plant_check(ur5: Chain) -> None:
    start = start_state(ur5, HOME_A)
    goal = np.deg2rad([60.0, -120.0, -40.0, -60.0, 80.0, 0.0])
    end = advance(ur5, start, goal - HOME_A, "gauss_magnus", 100)
    points, _ = placed(ur5, end)
    assert np.max(np.abs(1e3 * base_position(ur5, end) - [-9.658, -11.654, 7.750])) < 6e-4
    assert abs(np.rad2deg(attitude_error(UPRIGHT, end.quat)) - 18.59174) < 6e-6
    turned = rotation_from_quat(end.quat)
    assert np.max(np.abs(turned[0] - [0.9767189, 0.0517222, -0.2081948])) < 1e-7
    assert np.max(np.abs(points[-1] - [0.297905, 0.286564, 1.000903])) < 1e-6
    assert np.max(np.abs(unit(points[-1] - points[-2]) - [0.676397, 0.640890, -0.362970])) < 1e-6


@pytest.mark.parametrize(("method", "low", "high"), [("euler", 0.5, 0.7), ("midpoint", 0.002, 0.003)])
def test_attitude_errors_of_the_simple_integrators(ur5: Chain, method: str, low: float, high: float) -> None:
    result = run(ur5, start_state(ur5, HOME_A), CAPTURE, Settings(base=method), 200)
    true = replay(ur5, result.states, "gauss_magnus", 1)
    assert low < np.rad2deg(attitude_error(true[-1].quat, result.states[-1].quat)) < high


def test_attitude_error_of_gauss_magnus(ur5: Chain, capture_from_a: Run) -> None:
    true = replay(ur5, capture_from_a.states)
    assert np.rad2deg(attitude_error(true[-1].quat, capture_from_a.states[-1].quat)) < 1e-4


@pytest.mark.parametrize(("home", "miss"), [(HOME_A, 0.2457), (HOME_B, 0.2075)])
def test_a_plan_by_translation_only_misses(ur5: Chain, home: Array, miss: float) -> None:
    plan = run(ur5, start_state(ur5, home), CAPTURE, Settings(base="translation_only"), 200)
    assert plan.done
    error, _ = errors(ur5, replay(ur5, plan.states, "gauss_magnus", 1)[-1], CAPTURE)
    assert abs(error - miss) < 1e-4


# Restart and baseline

# Reachable from home B; without a restart the law of that name settles beside it.
STALLING = {
    "N10": Task(np.array([0.0277, 0.1124, 0.2700]), unit(np.array([0.6428, 0.4830, -0.5946]))),
    "dls": Task(np.array([-0.2679, 0.5726, 0.4020]), unit(np.array([-0.0498, -0.3665, 0.9291]))),
}


@pytest.mark.parametrize("variant", ["N10", "dls"])
def test_a_restart_frees_a_stalled_run(ur5: Chain, variant: str) -> None:
    settings = Settings(variant=variant, restart=True, seeds=3, rounds=4, segments=3)
    result = run(ur5, start_state(ur5, HOME_B), STALLING[variant], settings, 400)
    assert result.done
    assert result.restarts > result.empty
    q = np.array([state.q for state in result.states])
    assert np.max(np.abs(np.diff(q, axis=0))) <= np.pi * 0.01 * (1.0 + 1e-9)


def test_least_squares_arrives(ur5: Chain) -> None:
    result = run(ur5, start_state(ur5, HOME_A), CAPTURE, Settings(variant="dls"), 300)
    assert result.done
