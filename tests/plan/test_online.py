"""What comes into sight on the way: detours from the state of motion, stops, and what is reported."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import fzcli
from fzcli.errors import SpecError
from fzcli.loop.execution import Execution, execute, mission_of
from fzcli.loop.rollout import Rollout
from fzcli.plan.belief import believed, changed
from fzcli.plan.braked_path import BrakedPath
from fzcli.plan.detour_search import Budget, SpentError
from fzcli.plan.joint_path import Detour, JointPath
from fzcli.plan.online import return_steps
from fzcli.plan.plan import Plan
from fzcli.plan.scene import Obstacle, build_scene
from fzcli.record.execution_file import as_rollout
from fzcli.spec.reader import read_text

Array = NDArray[np.float64]
START, GOAL = np.radians([-60, 20, 100, 0, 40, 0]), np.radians([60, 40, 80, 0, 60, 0])
RUN = """
kind: plan
robot: melfa_rv1a
tool: {xyz: [0, 0, 0.1]}
start: {q: [-60 deg, 20 deg, 100 deg, 0, 40 deg, 0]}
goal: {q: [60 deg, 40 deg, 80 deg, 0, 60 deg, 0]}
duration: 4 s
margin: 10 mm
planner: {kind: detour, weights: [1, 1, 1, 0.3, 0.3, 0.05]}
scene:
"""
DRIFTER = """
  - {name: drifter, sphere: {center: [0.3, 0.3, 0.4], radius: 0.05}, velocity: [0, -0.1, 0], seen_at_step: 8}
"""


def followed(scene: str, *sets: str) -> Execution:
    return execute(mission_of(read_text(RUN + scene), sets))


def path() -> JointPath:
    bend = Detour(np.radians([5, -20, 10, 0, 15, 0]), 0.6, 3.2)
    return JointPath(START, GOAL - START, 4.0, detours=(bend,))


def test_returns_are_tried_longest_first() -> None:
    assert return_steps(8, 20) == (20, 16, 14, 12)
    assert return_steps(0, 20) == (20, 8, 6, 4)
    assert return_steps(13, 20) == (20, 19, 17)
    assert return_steps(18, 20) == (20,)


@pytest.mark.parametrize("back", [0.0, 0.7])
@pytest.mark.parametrize("length", [0.1, 0.8])
def test_a_braked_path_is_smooth_and_no_faster(length: float, back: float) -> None:
    whole = path()
    halt = BrakedPath(whole, 1.8, length, 6.0, back)
    before = np.linspace(0, 1.8, 50)
    for braked, own in zip(halt.at(before), whole.at(before), strict=True):
        np.testing.assert_array_equal(braked, own)
    time, step = np.linspace(0, 6, 6001), 1e-5
    q, qd, qdd = halt.at(time)
    later, sooner = halt.at(time + step), halt.at(time - step)
    np.testing.assert_allclose((later[0] - sooner[0]) / (2 * step), qd, atol=1e-6)
    np.testing.assert_allclose((later[1] - sooner[1])[1:-1] / (2 * step), qdd[1:-1], atol=2e-2)
    assert np.abs(qd).max() <= np.abs(whole.at(time)[1]).max() + 1e-12
    np.testing.assert_allclose(q[-1], whole.at(np.array([1.8 + length / 2 - back]))[0][0], atol=1e-12)
    np.testing.assert_allclose(halt.goal, q[-1], atol=1e-12)
    assert not qd[time >= halt.rest].any()
    for begin, end in np.sort(np.random.default_rng(1).uniform(0, 6, (40, 2))):
        inside = np.abs(halt.at(np.linspace(begin, end, 200))[1]).max(axis=0)
        assert (inside <= halt.speed_bound(begin, end) + 1e-12).all()
    assert halt.progress(np.array([halt.when(1.82)]))[0][0] == pytest.approx(1.82, abs=1e-12)


def test_a_detour_from_the_state_of_motion_is_c2() -> None:
    whole = path()
    more = replace(whole, detours=(*whole.detours, Detour(np.radians([9, 9, -9, 5, 5, 5]), 1.7, 4.0)))
    at = np.array([1.7 - 1e-12, 1.7, 1.7 + 1e-12])
    for one, other in zip(more.at(at), whole.at(at), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    assert np.abs(whole.at(at)[1]).max() > 0.5  # it is under way


def test_beliefs() -> None:
    ways = {"times": (1.0, 2.0), "positions": ((0, 0, 0), (0.5, 0, 0))}
    told = Obstacle.model_validate({"sphere": {"radius": 0.1}, "waypoints": ways})
    seen = told.model_copy(update={"seen_at_step": 3})
    body = {"from": (0, 0, 0), "to": (0, 0, 1), "radius": 0.1}
    turning = Obstacle.model_validate({"capsule": body, "spin": (1, 0, 0), "velocity": (0, 1, 0), "seen_within": 0.3})
    scene = build_scene([told, seen, turning])
    none, some = believed(scene, (), 1.5), believed(scene, (1, 2), 1.5)
    assert none.names == some.names == scene.names
    late = np.array([1.5, 1.9, 3.0])
    np.testing.assert_array_equal(none.numbers(late)[:, :4], scene.numbers(late)[:, :4])
    assert np.abs(none.numbers(late)[:, 4:]).max(axis=1).min() > 1e3
    np.testing.assert_allclose(some.numbers(late)[:, 4:8], [[0.25, 0, 0, 0.1], [0.45, 0, 0, 0.1], [1, 0, 0, 0.1]])
    np.testing.assert_allclose(some.numbers(late)[:, 8:], scene.numbers(late)[:, 8:], atol=1e-12)
    assert not changed(some, believed(scene, (1, 2), 1.9), 1.9, 3.0)
    assert changed(some, believed(scene, (1, 2), 2.1), 2.1, 3.0)
    assert changed(none, some, 1.5, 3.0)


def test_a_budget_ends() -> None:
    budget = Budget(2)
    budget.spend()
    budget.spend()
    with pytest.raises(SpentError):
        budget.spend()
    assert budget.used == 2


def test_led_round_what_is_seen_on_the_way() -> None:
    found = followed(DRIFTER)
    (event,) = found.events
    assert (event.step, event.answer.kind, found.plan.status.name) == (8, "detour", "ok")
    assert 0 < event.answer.evaluations <= 200
    assert found.plan.clearance.min() >= 0.01 - 1e-6
    assert found.plan.certificate["knot_jump_max"] < 1e-9
    assert found.plan.certificate["joint_speed_excess_max"] == 0
    before = found.plan.time <= 1.8
    straight = JointPath(START, GOAL - START, 4.0).at(found.plan.time[before])[0]
    np.testing.assert_array_equal(found.plan.q[before], straight)  # the motion changes one step after the sight
    again = followed(DRIFTER)
    np.testing.assert_array_equal(again.plan.q, found.plan.q)


def test_without_an_answer_it_is_hit() -> None:
    status = followed(DRIFTER, "execution.answer=none").plan.status
    assert status.name == "failed"
    assert "contact: J6_link and drifter overlap by 62.5 mm at 2.24" in status.reason
    assert "execution.answer: detour" in status.advice


@pytest.mark.parametrize(
    ("sets", "reason"),
    [
        (("execution.answer=stop",), "J6_link and drifter would overlap by 62.5 mm at 2.25 s"),
        (("execution.evaluations=3",), "no detour found in 3 evaluations"),
    ],
)
def test_a_stop_is_smooth_clear_and_reported(sets: tuple[str, ...], reason: str) -> None:
    found = followed(DRIFTER, *sets)
    assert isinstance(found.path, BrakedPath)
    assert found.plan.status.name == "flagged"
    assert found.plan.status.reason.startswith("stopped on the path at ")
    assert reason in found.plan.status.reason
    assert found.plan.certificate["clearance_at_least"] >= 0.01 - 1e-4
    assert found.plan.certificate["knot_jump_max"] < 1e-9
    assert found.plan.certificate["joint_speed_excess_max"] == 0
    assert not found.plan.qd[-1].any()


def test_a_stop_keeps_accelerations() -> None:
    gentle = "accelerations=[4, 4, 4, 4, 4, 4]"
    found = followed(DRIFTER, "execution.answer=stop", gentle)
    assert np.abs(found.plan.qdd).max() <= 4
    assert np.abs(followed(DRIFTER, "execution.answer=stop").plan.qdd).max() > 4


def test_a_free_base_is_led_round_as_well() -> None:
    ball = "  - {sphere: {center: [0.35, 0.05, 0.4], radius: 0.04}, velocity: [0, 0.02, 0], seen_at_step: 8}\n"
    text = (RUN + ball).replace("melfa_rv1a", "melfa_free_flyer")
    found = execute(mission_of(read_text(text)))
    assert found.plan.base_quat[-1, 0] < 0.999  # it turns
    assert found.plan.certificate["clearance_min"] > 0
    assert found.plan.certificate["knot_jump_max"] < 1e-9


def test_seen_by_range_and_seen_to_move() -> None:
    run = fzcli.simulate("online_obstacle")
    assert run.status.name == "ok"
    assert run.metrics["replans"] == 2
    assert run.metrics["sights"] == 5  # two in sight, and three changes of the one that moves
    assert run.certificate["clearance_min"] >= 0.01 - 1e-6
    assert run.certificate["knot_jump_max"] < 1e-9
    np.testing.assert_array_equal(np.unique(run.signals["replans"]), [0, 1, 2])
    assert np.count_nonzero(run.signals["replan_time"]) == 5
    assert run.metrics["replan_time_max"] == run.signals["replan_time"].max()
    assert (run.signals["path_rate"] == 1).all()


def test_a_plan_with_nothing_unknown_is_followed_as_it_is(tmp_path: Path) -> None:
    run, plan = fzcli.simulate("melfa_obstacle", output=tmp_path / "run.h5"), fzcli.plan("melfa_obstacle")
    assert isinstance(run, Rollout)
    assert isinstance(plan, Plan)
    np.testing.assert_array_equal(run.q, plan.q)
    assert run.metrics["sights"] == 0
    assert (tmp_path / "run.h5").exists()


def test_a_stop_in_the_record() -> None:
    run = as_rollout(followed(DRIFTER, "execution.answer=stop"))
    assert run.metrics["stopped"] == 1
    assert run.signals["path_rate"][0] == 1
    assert run.signals["path_rate"][-1] == 0
    assert run.signals["path_rate"].min() < 0  # it went back
    assert "clearance" in run.signals
    assert run.signal_info["replan_time"].unit == "s"


SPHERE = """
  - {{name: ball, sphere: {{center: {center}, radius: {radius}}}, velocity: {velocity}, seen_at_step: {step}}}
"""
AT_GOAL = {"center": "[0.172, 0.698, 0.317]", "radius": "0.06", "velocity": "[0, -0.1, 0]", "step": "8"}
IN_THE_WAY = {"center": "[0.311, -0.125, 0.355]", "radius": "0.06", "velocity": "[0, 0, 0]", "step": "8"}


LOW = "accelerations=[1.5, 1.5, 1.5, 1.5, 1.5, 1.5]"


@pytest.mark.parametrize(
    ("scene", "name", "said"),
    [(SPHERE.format(**AT_GOAL), "flagged", "^stopped on the path at "), (DRIFTER, "failed", "^contact: ")],
)
def test_a_stop_harder_than_the_stated_accelerations_says_so(scene: str, name: str, said: str) -> None:
    """None of the stops is gentler; the largest acceleration is the certificate's."""
    plan = followed(scene, "execution.answer=stop", LOW).plan
    most = plan.metrics["acceleration_max"]
    assert plan.status.name == name
    assert re.search(said, plan.status.reason)
    told = re.search(r"; the stop takes (J\d) to ([\d.]+) rad/s2, beyond its limit of 1.5 rad/s2", plan.status.reason)
    assert told is not None
    assert float(told[2]) == pytest.approx(most, rel=1e-5)
    assert plan.certificate["joint_acceleration_excess_max"] == pytest.approx(most - 1.5, rel=1e-5)
    joint = plan.joint_names.index(told[1])
    assert np.abs(plan.qdd[:, joint]).max() == pytest.approx(most, rel=1e-2)


def test_an_obstacle_that_will_cover_the_goal() -> None:
    found = followed(SPHERE.format(**AT_GOAL))
    assert found.plan.status.name == "flagged"
    assert "the goal is covered: J6_link and ball will be in contact at 4 s" in found.plan.status.reason
    assert found.plan.certificate["clearance_min"] >= 0.01 - 1e-6
    assert found.events[0].answer.evaluations == 0  # nobody searches in vain


def test_a_known_obstacle_that_will_cover_the_goal(tmp_path: Path) -> None:
    known = SPHERE.format(**AT_GOAL).replace(", seen_at_step: 8", "")
    (tmp_path / "run.yaml").write_text(RUN + known)
    for answer in (fzcli.plan, fzcli.simulate):
        with pytest.raises(SpecError, match="the goal is in contact: J6_link and ball overlap by"):
            answer(tmp_path / "run.yaml")


def test_what_is_too_near_already_is_still_not_touched() -> None:
    beside = {"center": "[0.171, -0.706, 0.461]", "radius": "0.05", "velocity": "[0.05, 0.32, -0.07]", "step": "8"}
    assert followed(SPHERE.format(**beside), "execution.answer=none").plan.status.name == "failed"
    found = followed(SPHERE.format(**beside))
    assert 0.005 < found.events[0].answer.margin < 0.01  # no more can be kept
    assert found.plan.certificate["clearance_min"] > 0.005
    assert found.plan.status.name == "flagged"
    assert "J6_link and ball come within 5.65 mm" in found.plan.status.reason
    assert "see it earlier" in found.plan.status.advice


def test_first_seen_in_contact() -> None:
    found = followed(SPHERE.format(**IN_THE_WAY))
    assert found.plan.status.name == "failed"
    assert "contact: J6_link and ball overlap by" in found.plan.status.reason
    assert "in contact already when it is seen, at 1.6 s: J6_link and ball overlap by" in found.plan.status.reason
    assert "see it earlier (seen_at_step, seen_within)" in found.plan.status.advice


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"radius": "-50 mm"}, "scene.ball.sphere.radius: must be > 0, got '-50 mm'"),
        ({"step": "-1"}, "scene.ball.seen_at_step: must be >= 0, got -1"),
        ({"step": "20"}, "scene.ball.seen_at_step: comes after the last step: the path has 20"),
        ({"step": "8, seen_within: 0.2"}, "scene.ball: give seen_at_step or seen_within, not both"),
    ],
)
def test_what_is_refused(changes: dict[str, str], text: str) -> None:
    with pytest.raises(SpecError) as caught:
        followed(SPHERE.format(**{**IN_THE_WAY, **changes}))
    assert text in str(caught.value)
