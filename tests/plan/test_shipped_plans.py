"""The plans that are shipped: found, certified, smooth, and clear by a check that shares nothing with the planner."""

from functools import cache

import numpy as np
import pytest
from independent import clearances, frame, link_frames, ridden, turned
from numpy.typing import NDArray

from fzcli.plan.load import load_plan, make_plan
from fzcli.plan.plan import Plan
from fzcli.plan.planning import Task, solve
from fzcli.plan.world import Path
from fzcli.spec.tool import with_tool

Array = NDArray[np.float64]
PLANS = ("melfa_obstacle", "melfa_fig9_15", "moving_obstacle", "free_flyer_panels")
SAMPLES = 401


@cache
def made(name: str) -> tuple[Task, Plan, Path]:
    task = load_plan(f"runs/{name}.yaml")
    return task, make_plan(task), solve(task).path


def bases(task: Task, path: Path, times: Array) -> list[Array]:
    if not task.model.floating:
        return [np.eye(4)] * len(times)
    return ridden(task.model.robot, path, path.duration, times)


@pytest.mark.parametrize("name", PLANS)
def test_certificates(name: str) -> None:
    task, plan, _ = made(name)
    sure = plan.certificate
    assert plan.status.name == "ok"
    assert sure["clearance_min"] >= task.spec.margin - 1e-6
    assert sure["clearance_at_least"] >= task.spec.margin - 2e-4
    assert sure["clearance_at_least"] <= sure["clearance_min"]
    assert sure["knot_jump_max"] <= 1e-9
    assert sure["joint_limit_excess_max"] == 0.0
    assert sure["joint_speed_excess_max"] <= 1e-9
    assert sure["goal_error_max"] <= 1e-5
    assert plan.time[1] - plan.time[0] <= 0.01 + 1e-12
    assert plan.metrics["duration"] == task.spec.duration


@pytest.mark.parametrize("name", PLANS)
def test_the_detour_is_needed(name: str) -> None:
    task, plan, path = made(name)
    assert plan.detours
    straight = task.nominal(path.goal)
    assert task.world.distances(straight, np.linspace(0.0, straight.duration, SAMPLES)).min() < -0.03


@pytest.mark.parametrize("name", PLANS)
def test_two_derivatives_without_jumps(name: str) -> None:
    """Velocity and acceleration are the derivatives of the position, also across the knots; rest at both ends."""
    _, _, path = made(name)
    h = 1e-5 * path.duration
    times = np.linspace(2 * h, path.duration - 2 * h, 4001)
    _, qd, qdd = path.at(times)
    early, late = path.at(times - h), path.at(times + h)
    np.testing.assert_allclose((late[0] - early[0]) / (2 * h), qd, atol=1e-5 * np.abs(qd).max())
    np.testing.assert_allclose((late[1] - early[1]) / (2 * h), qdd, atol=2e-3 * np.abs(qdd).max())
    assert np.abs(np.diff(qdd, axis=0)).max() < 0.02 * np.abs(qdd).max()
    for time in (0.0, path.duration):
        _, speed, force = path.at(np.array([time]))
        np.testing.assert_allclose([speed, force], 0.0, atol=1e-12)


@pytest.mark.parametrize("name", PLANS)
def test_coal_finds_no_pair_nearer_than_the_margin(name: str) -> None:
    pytest.importorskip("coal")
    task, plan, path = made(name)
    every = max(1, (len(plan.time) - 1) // (SAMPLES - 1))
    times = plan.time[::every]
    assert len(times) >= SAMPLES
    q = path.at(times)[0]
    own = {frozenset((pair.link, pair.other)) for pair in task.world.clearance.pairs if pair.obstacle < 0}
    found = clearances(task.spec, q, times, iter(bases(task, path, times)), own)
    assert found.min() >= task.spec.margin - 1e-6
    assert found.min() == pytest.approx(plan.certificate["clearance_min"], abs=2e-4)
    np.testing.assert_allclose(found, plan.clearance[::every], atol=2e-7)


def test_the_pose_in_the_world_is_met_on_a_base_that_rides_along() -> None:
    """The tip's end by a plant of our own: frames in NumPy, momentum body by body, an adaptive integrator."""
    task, plan, path = made("free_flyer_panels")
    goal = task.spec.goal
    assert task.spec.tool is not None
    robot = with_tool(task.spec.robot, task.spec.tool)
    base = ridden(robot, path, path.duration, np.array([0.0, path.duration]))[-1]
    np.testing.assert_allclose(plan.base_position[-1], base[:3, 3], atol=1e-6)
    tip = next(iter(robot.tips.values()))
    end = link_frames(robot, path.goal, base)[tip.link] @ frame(tip.xyz, turned(tip.rpy))
    np.testing.assert_allclose(end[:3, 3], goal.position, atol=5e-6)
    np.testing.assert_allclose(end[:3, :3], turned(goal.rpy), atol=5e-6)
    assert plan.metrics["base_turn"] > np.deg2rad(10.0)


def test_the_paper_detour_stands_in_steps_8_to_12() -> None:
    task, plan, path = made("melfa_fig9_15")
    step = path.duration / task.spec.steps
    (detour,) = plan.detours
    assert (detour.begin, detour.end) == pytest.approx((8 * step, 12 * step))
    peaks = np.abs(np.rad2deg(detour.peak))
    assert min(peaks[[1, 2, 4]]) > 5
    assert max(peaks[[3, 5]]) < 0.1
    met = np.linspace(0.0, path.duration, 4001)
    near = met[task.world.distances(task.nominal(path.goal), met).min(axis=1) < 0] / step
    assert (near[0], near[-1]) == pytest.approx((8.705, 11.295), abs=0.01)


def test_the_procedure_of_the_paper_touches_what_it_does_not_look_at() -> None:
    task = load_plan("runs/melfa_fig9_15.yaml", ["planner={kind: paper}"])
    plan = make_plan(task)
    assert plan.status.name == "failed"
    assert plan.status.reason.startswith("contact: J6_link and sphere 1 overlap by ")
    assert "detour" in plan.status.advice


def test_the_ball_is_met_on_its_way() -> None:
    """Where it stands at the start, or at the end, the straight path would be clear all the time."""
    task, _, path = made("moving_obstacle")
    straight = task.nominal(path.goal)
    times = np.linspace(0.0, path.duration, SAMPLES)
    for place in (0.0, path.duration):
        numbers = np.tile(task.world.scene.numbers([place]), (SAMPLES, 1))
        found = task.world.clearance.at(straight.at(times)[0], numbers)
        assert found.min() > task.spec.margin
    still = load_plan("runs/moving_obstacle.yaml", ["scene.0.velocity=[0, 0, 0]"])
    assert not make_plan(still).detours


def test_the_golden_detour() -> None:
    """Window from step 5 to 15, and the least weighted squares of its peaks, of an earlier and other programme."""
    task, plan, path = made("melfa_obstacle")
    (detour,) = plan.detours
    step = path.duration / task.spec.steps
    assert (detour.begin, detour.end) == pytest.approx((5 * step, 15 * step))
    assert plan.metrics["cost"] == pytest.approx(0.0415, rel=0.02)
    assert plan.metrics["speed_ratio_max"] == pytest.approx(0.3125, rel=0.01)
