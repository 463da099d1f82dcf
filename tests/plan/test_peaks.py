"""What lies between samples: peaks of narrow detours and corners of laws, the whole clearance, every tip, rounding."""

from pathlib import Path

import numpy as np
import pytest

import fzcli
from fzcli.plan.detour_planner import stretched
from fzcli.plan.joint_path import Detour, JointPath
from fzcli.plan.load import load_plan
from fzcli.plan.peaks import peak_times
from fzcli.plan.plan import Plan
from fzcli.plan.planning import solve
from fzcli.plan.time_laws.registry import TIME_LAWS, TimeLawName

START, TRAVEL = np.deg2rad([-60.0, 20.0, 100.0]), np.deg2rad([120.0, 20.0, -20.0])
ANYTHING = np.full(3, np.inf)


def narrow(law: TimeLawName) -> JointPath:
    detours = (Detour(np.array([0.1, -0.4, 0.2]), 1.2371, 1.3219), Detour(np.array([0.0, 0.3, 0.1]), 0.0, 4.0, 0.5))
    return JointPath(START, TRAVEL, 4.0, law, detours)


@pytest.mark.parametrize("law", TIME_LAWS)
def test_no_peak_is_missed_by_more_than_told(law: TimeLawName) -> None:
    path = narrow(law)
    found, fine = path.at(peak_times(path)), path.at(np.linspace(0.0, 4.0, 400_001))
    for near, true in zip(found, fine, strict=True):
        np.testing.assert_array_less(np.abs(true).max(axis=0) * (1 - 3e-5), np.abs(near).max(axis=0))


@pytest.mark.parametrize("law", TIME_LAWS)
def test_a_stretched_path_keeps_speeds_and_accelerations_between_samples(law: TimeLawName) -> None:
    path = narrow(law)
    for limits in ((np.array([2.0, 1.0, 1.5]), ANYTHING), (ANYTHING, np.array([20.0, 9.0, 5.0]))):
        slow = stretched(path, *limits)
        _, qd, qdd = slow.at(np.linspace(0.0, slow.duration, 400_001))
        ratio = max((np.abs(qd) / limits[0]).max(), np.sqrt((np.abs(qdd) / limits[1]).max()))
        assert 0.999 < ratio <= 1.0


def made(*sets: str) -> Plan:
    return fzcli.plan("moving_obstacle", sets=sets)


def test_the_clearance_of_a_clear_path_is_its_smallest() -> None:
    plan = made("scene=[{sphere: {center: [0, 0.5, 0.9], radius: 0.05}}]")
    sure = plan.certificate
    assert plan.method == "straight"
    assert sure["clearance_min"] <= plan.clearance.min() + 1e-9
    assert sure["clearance_at_least"] >= sure["clearance_min"] - 1.001e-4


def test_among_moving_obstacles_a_detour_keeps_accelerations() -> None:
    """No more time is asked for there: the detour itself is gentle enough."""
    free = made("margin=0.06")
    most = 0.8 * free.metrics["acceleration_max"]
    limits = f"accelerations=[{', '.join(6 * [f'{most:.6f}'])}]"
    plan = made("margin=0.06", limits)
    assert (plan.status.name, plan.method) == ("ok", "detour")
    task = load_plan("moving_obstacle", ["margin=0.06", limits])
    path = solve(task).path
    assert np.abs(path.at(np.linspace(0.0, path.duration, 100_001))[2]).max() <= most


def test_without_margin_nothing_may_touch_between_samples() -> None:
    assert made("margin=0").certificate["clearance_at_least"] >= -1e-6


def test_the_goal_is_missed_by_the_worst_tip(tmp_path: Path) -> None:
    """Also where the goal says nothing of the robot's first tip."""
    file = tmp_path / "plan.yaml"
    file.write_text(
        """kind: plan
robot: dual_arm
start: {q: [0, 0, 90 deg, 0, 40 deg, 0, 0, 0, 90 deg, 0, 40 deg, 0]}
goal: {tips: {right: {position: [0.2032502, -0.2828350, 0.5917356], rpy: [3.1319984, 0.8732074, -2.8013581]}}}
"""
    )
    assert fzcli.plan(file).certificate["goal_error_max"] < 1e-6


def test_a_goal_at_a_joint_limit_is_no_excess() -> None:
    """By rounding, start + (goal - start) lies beyond the goal."""
    start, limit = -0.46801654095285605, float(np.deg2rad(90.0))
    assert start + (limit - start) > limit
    plan = made(
        "planner={kind: detour, window: [0, 20], fallbacks: []}",
        f"start.q=[-1.0471, 0.349, 1.7453, 0, {start!r}, 0]",
        f"goal.q=[1.0471, 0.698, 1.396, 0, {limit!r}, 0]",
    )
    assert (plan.status.name, plan.method) == ("ok", "detour")
