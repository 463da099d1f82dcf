"""Plans that make no sense are refused in words, at their place in the file, and nothing is written."""

from pathlib import Path

import pytest

import fzcli
from fzcli.errors import SpecError
from fzcli.plan.planning import NoPlanError

GOAL = "goal: {q: [60 deg, 40 deg, 80 deg, 0, 60 deg, 0]}"
PLAN = f"""kind: plan
robot: melfa_rv1a
tool: {{xyz: [0, 0, 0.1]}}
start: {{q: [-60 deg, 20 deg, 100 deg, 0, 40 deg, 0]}}
{GOAL}
duration: 4 s
margin: 10 mm
scene:
  - sphere: {{center: [0.338, 0, 0.345], radius: 0.05}}
planner: {{kind: detour, weights: [1, 1, 1, 0.3, 0.3, 0.05]}}
"""
TO_THE_GOAL = "\n    waypoints: {times: [0 s, 4 s], positions: [[0.9, 0.9, 0.9], [0.17, 0.29, 0.32]]}"


def refused(tmp_path: Path, old: str, new: str) -> str:
    """What is said of the plan with one change; raises AssertionError where a file is left."""
    assert old in PLAN
    file = tmp_path / "plan.yaml"
    file.write_text(PLAN.replace(old, new, 1))
    with pytest.raises((SpecError, NoPlanError)) as caught:
        fzcli.plan(file, output=tmp_path / "plan.h5")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plan.yaml"]
    return str(caught.value).replace(f"{tmp_path}/", "")


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (
            "[0.338, 0, 0.345]",
            "[0.17, -0.29, 0.44]",
            "plan.yaml:4:12: start.q: the start is in contact: J6_link and sphere 1 overlap by 53.6 mm",
        ),
        (
            "[0.338, 0, 0.345], radius: 0.05",
            "[0.17, -0.31, 0.35], radius: 0.1",
            "plan.yaml:4:12: start.q: the start is in contact: J6_link and sphere 1 overlap by",
        ),
        (
            "[0.338, 0, 0.345]",
            "[0.17, 0.29, 0.32]",
            "plan.yaml:5:11: goal.q: the goal is in contact: J6_link and sphere 1 overlap by 76.6 mm",
        ),
        (
            "radius: 0.05}",
            "radius: 0.05}" + TO_THE_GOAL,
            "plan.yaml:5:11: goal.q: the goal is in contact: J6_link and sphere 1 overlap by 76.6 mm at 4 s, "
            "when the arm gets there",
        ),
        (
            GOAL,
            "goal: {position: [1.2, 0, 0.5], rpy: [180 deg, 0, 0]}",
            "plan.yaml:5:18: goal.position: out of reach of tip 'flange': 822.8 mm missing",
        ),
        (
            GOAL,
            "goal: {tips: {flange: {position: [1.2, 0, 0.5]}}}",
            "plan.yaml:5:23: goal.tips.flange: out of reach of tip 'flange': 620 mm missing",
        ),
        (
            GOAL,
            "goal: {position: [-0.3, 0, 0.3], rpy: [180 deg, 0, 180 deg]}",
            "plan.yaml:5:18: goal.position: tip 'flange' meets it only beyond the joint limits, by 30 deg at least",
        ),
        (
            "[60 deg, 40 deg",
            "[160 deg, 40 deg",
            "plan.yaml:5:11: goal.q: joint 'J1' is 2.793, outside its limits -2.618 to 2.618",
        ),
        (
            "[-60 deg, 20 deg",
            "[-60 deg, 130 deg",
            "plan.yaml:4:12: start.q: joint 'J2' is 2.269, outside its limits -1.047 to 2.094",
        ),
        ("q: [-60 deg", "q: [-60 mm", "plan.yaml:4:13: start.q.0: '-60 mm' is a length; an angle is wanted"),
        ("4 s", "0 s", "plan.yaml:6:11: duration: must be > 0 or 'fastest', got '0 s'"),
        ("10 mm", "-1 mm", "plan.yaml:7:9: margin: must be >= 0, got '-1 mm'"),
        ("radius: 0.05", "radius: -0.05", "plan.yaml:9:49: scene.0.sphere.radius: must be > 0, got -0.05"),
        (
            "0.3, 0.3, 0.05",
            "0.3, 0.05",
            "plan.yaml:10:34: planner.weights: has 5 values for 6 active joints (J1, J2, J3, J4, J5, J6)",
        ),
        ("0.3, 0.05]", "0.3, 0]", "plan.yaml:10:34: planner.weights: every weight must be above 0"),
        (
            GOAL,
            "goal: {tips: {hand: {position: [0.3, 0, 0.5]}}}",
            "plan.yaml:5:21: goal.tips.hand: the robot has no tip 'hand'; it has flange",
        ),
        (GOAL, "goal: {}", "plan.yaml:5:7: goal: needs one of q, position and tips"),
        ("detour,", "detuor,", "plan.yaml:10:17: planner.kind: unknown kind 'detuor'; did you mean 'detour'?"),
        (
            "robot: melfa_rv1a",
            "robot: bulgarelli4",
            "plan.yaml:4:12: start.q: has 6 values for 4 active joints (q1, q2, q3, q4)",
        ),
    ],
)
def test_a_bad_plan_is_refused_at_its_place(tmp_path: Path, old: str, new: str, text: str) -> None:
    assert text in refused(tmp_path, old, new)


def test_a_start_within_the_margin_is_told_apart_from_contact(tmp_path: Path) -> None:
    text = refused(tmp_path, "margin: 10 mm", "margin: 200 mm")
    assert "plan.yaml:4:12: start.q: the start is within the margin: " in text
    assert " mm apart, 200 mm are asked for" in text


def test_a_goal_on_a_free_base_needs_its_whole_pose(tmp_path: Path) -> None:
    old, new = f"robot: melfa_rv1a{PLAN.partition('robot: melfa_rv1a')[2].partition('duration')[0]}", (
        "robot: melfa_free_flyer\ntool: {xyz: [0, 0, 0.1]}\nstart: {q: [-60 deg, 20 deg, 100 deg, 0, 40 deg, 0]}\n"
        "goal: {position: [0.3, 0, 0.5]}\n"
    )
    assert "plan.yaml:5:7: goal.rpy: rpy is needed: on a free base the whole pose of a tip is met" in refused(
        tmp_path, old, new
    )


def test_where_there_is_no_way_nothing_is_written(tmp_path: Path) -> None:
    """A wall from the floor up between start and goal, before the arm and behind it."""
    wall = "\n".join(f"  - box: {{center: [{x}, 0, 1], size: [1.8, 0.02, 2]}}" for x in (-1.03, 1.03))
    text = refused(
        tmp_path,
        "  - sphere: {center: [0.338, 0, 0.345], radius: 0.05}\nplanner: {kind: detour,",
        f"{wall}\nplanner: {{kind: detour, iterations: 20,",
    )
    assert "no path keeps 10 mm clear for 1 final posture; tried: one detour; three detours; RRTConnect, 20 i" in text


def test_among_moving_obstacles_no_tree_is_said_to_have_been_tried(tmp_path: Path) -> None:
    text = refused(
        tmp_path,
        "0.345], radius: 0.05}\nplanner: {kind: detour, weights: [1, 1, 1, 0.3, 0.3, 0.05]}",
        "0.345], radius: 0.05}\n    velocity: [0, 0, 1 mm/s]\nplanner: {kind: rrt_connect}",
    )
    assert "tried: RRTConnect, which is for bases and scenes that stand still" in text


def test_two_obstacles_of_one_name(tmp_path: Path) -> None:
    two = "  - {name: ball, sphere: {center: [0.338, 0, 0.345], radius: 0.05}}\n"
    text = refused(tmp_path, "  - sphere: {center: [0.338, 0, 0.345], radius: 0.05}\n", two + two)
    assert "scene: two obstacles are called 'ball'" in text
