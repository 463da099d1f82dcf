"""Bad runs to a target are refused before anything runs, with file, line, column, field and what is wrong."""

from pathlib import Path
from typing import Any

import pytest

from fzcli.errors import Problem, SpecError
from fzcli.loop.run_file import load_run

LINES = {
    "robot": "ur5_free_flyer",
    "start": "{q: [0, -90 deg, -90 deg, -90 deg, 90 deg, 0]}",
    "reference": "{kind: target, position: [0.3, 0.5, 0.8], direction: [1, 1, -1]}",
    "controller": "{kind: fabrik, restart: true}",
    "stop": "{position: 10 mm, direction: 2 deg, after: 1 s}",
}
POSITION = {
    "controller": "{kind: fabrik, task: position}",
    "reference": "{kind: target, position: [0.3, 0.5, 0.8]}",
    "stop": "{position: 10 mm, after: 1 s}",
}


def _problems(folder: Path, **lines: str | None) -> list[Problem]:
    """What is wrong with the run of `LINES`, some of them changed or (None) left out."""
    file = folder / "run.yaml"
    given = {**LINES, **lines}
    text = "".join(f"{key}: {value}\n" for key, value in {"kind": "simulate", **given}.items() if value is not None)
    file.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        load_run(file)
    for problem in caught.value.problems:
        assert str(problem).startswith(f"{problem.file}:{problem.line}:{problem.column}: {problem.field}: ")
        assert problem.line is not None
        assert problem.column is not None
    return list(caught.value.problems)


TARGET = "{{kind: target, position: [0.3, 0.5, 0.8], {}}}"
CASES: list[tuple[dict[str, str | None], tuple[int, int, str, str]]] = [
    (
        {"reference": "{kind: target, position: [0.3, .nan, 0.8]}"},
        (4, 43, "reference.position.1", "must be a finite number, got nan"),
    ),
    (
        {"reference": "{kind: target, position: [0.3, .inf, 0.8]}"},
        (4, 43, "reference.position.1", "must be a finite number, got inf"),
    ),
    (
        {"reference": TARGET.format("direction: [0, 0, 0]")},
        (4, 65, "reference.direction", "a direction of zero length points nowhere"),
    ),
    (
        {"reference": TARGET.format("direction: [0, 0, 1], rpy: [0, 0, 0]")},
        (4, 12, "reference", "give direction or rpy, not both"),
    ),
    ({"reference": "{kind: target, direction: [0, 0, 1]}"}, (4, 12, "reference.position", "is missing")),
    (
        {"stop": "{position: 0 mm, direction: 2 deg, after: 1 s}"},
        (6, 18, "stop.position", "must be > 0, got '0 mm'"),
    ),
    (
        {"stop": "{position: 10 mm, direction: -2 deg, after: 1 s}"},
        (6, 36, "stop.direction", "must be > 0, got '-2 deg'"),
    ),
    (
        {"stop": "{position: 10 mm, direction: 2 deg, after: 0 s}"},
        (6, 50, "stop.after", "must be > 0, got '0 s'"),
    ),
    (
        {"stop": None, "duration": "1 s"},
        (1, 1, "stop", "is missing: controller.restart must know when the tip has arrived"),
    ),
    (
        {"stop": None, "controller": "{kind: fabrik}"},
        (1, 1, "duration", "is missing, or stop: the reference 'target' has no end of its own"),
    ),
    (
        {"reference": "{kind: line, direction: [1, 0, 0], length: 0.1, duration: 2 s}"},
        (6, 7, "stop", "needs a reference to arrive at (target, reachable); 'line' is followed"),
    ),
    (
        {"stop": "{position: 10 mm, after: 1 s}"},
        (6, 7, "stop.direction", "is missing: the reference fixes the tip's direction"),
    ),
    (
        {"stop": "{position: 10 mm, direction: 2 deg, orientation: 2 deg, after: 1 s}"},
        (6, 56, "stop.orientation", "the reference fixes no orientation of the tip"),
    ),
    (
        {"controller": "{kind: fabrik, task: pose}"},
        (5, 34, "controller.task", "'pose' needs reference.rpy, not only a direction"),
    ),
    (
        {**POSITION, "controller": "{kind: fabrik}"},
        (5, 13, "controller.task", "'approach' needs more than the reference's position; "
         "give reference.direction, or controller.task: position"),
    ),
    (
        {"controller": "{kind: fabrik, follow: [[2], [3], [4], [5]]}"},
        (5, 36, "controller.follow", "wants a list for each of the 5 hinges, of points up to 6, the tip"),
    ),
    (
        {"controller": "{kind: fabrik, follow: [[2], [3], [4], [5], [7]]}"},
        (5, 36, "controller.follow", "wants a list for each of the 5 hinges, of points up to 6, the tip"),
    ),
    ({"controller": "{kind: fabrik, sweeps: 0}"}, (5, 36, "controller.sweeps", "must be >= 1, got 0")),
    ({"controller": "{kind: fabrik, sweep_cap: 0}"}, (5, 39, "controller.sweep_cap", "must be > 0, got 0")),
    ({"controller": "{kind: dls, damping: 0}"}, (5, 34, "controller.damping", "must be > 0.0, got 0")),
    (
        {"controller": "{kind: fabrik, restart: {seeds: 0}}"},
        (5, 45, "controller.restart.seeds", "must be >= 1, got 0"),
    ),
    (
        {"controller": "{kind: fabrik, tip: hand}"},
        (5, 33, "controller.tip", "the robot has no tip 'hand'; it has flange"),
    ),
    (
        {"reference": "{kind: reachable, displacement: [1, 2, 3]}"},
        (4, 44, "reference.displacement", "has 3 values for 6 active joints "
         "(shoulder_pan, shoulder_lift, elbow, wrist_1, wrist_2, wrist_3)"),
    ),
    ({"duration": "2 s"}, (7, 11, "duration", "stands beside stop.after; give one")),
]  # fmt: skip


@pytest.mark.parametrize(("lines", "expected"), CASES, ids=[f"{case[1][2]} {i}" for i, case in enumerate(CASES)])
def test_a_bad_run_is_refused_at_its_place(
    lines: dict[str, str | None], expected: tuple[int, int, str, str], tmp_path: Path
) -> None:
    (problem,) = _problems(tmp_path, **lines)
    assert (problem.line, problem.column, problem.field, problem.message) == expected
    assert problem.file.endswith("run.yaml")


@pytest.mark.parametrize("points", ["[5]", "[]", "[-1]"])
def test_a_hinge_cannot_follow_a_point_before_it(points: str, tmp_path: Path) -> None:
    controller = f"{{kind: fabrik, follow: [[2], [3], [4], [5], {points}]}}"
    (problem,) = _problems(tmp_path, controller=controller)
    assert problem.line == 5
    assert problem.field.startswith("controller")
    assert f"hinge 5 can turn towards points 6 and beyond, got {points}" in problem.message


# Robots


def _link(i: int, axis: str = "z", at: str = "[1, 0, 0]", joint: str = "revolute", speed: str = "180 deg/s") -> str:
    return (
        f"  - {{name: l{i}, at: {{xyz: {at}}}, joint: {{name: q{i}, type: {joint}, axis: {axis}, speed: {speed}}}, "
        "mass: 1, inertia: [0.01, 0.01, 0.01]}\n"
    )


def _robot(folder: Path, links: list[str], tip: str) -> str:
    text = "kind: robot\nbase: {mass: 10, inertia: [1, 1, 1]}\nlinks:\n" + "".join(links)
    text += f"tips: {{tip: {{link: l{len(links) - 1}, {tip}}}}}\n"
    (folder / "arm.yaml").write_text(text, encoding="utf-8")
    return str(folder / "arm.yaml")


ARM = "xyz: [0.4, 0, 0]"
ROBOTS: dict[str, tuple[list[str], str, str, str, str]] = {  # links, tip, controller, field, text
    "slides": (
        [_link(0), _link(1, "x", joint="prismatic", speed="1 m/s"), _link(2, "y")],
        ARM,
        "{kind: fabrik, task: position}",
        "robot",
        "joint 'q1' slides: chain points need hinges",
    ),
    "no foot point": (
        [_link(0), _link(1, "y"), _link(2), _link(3, "y", "[0, 0, 0]")],
        "xyz: [0, 0, 0]",
        "{kind: fabrik, task: position}",
        "robot",
        "joint 'q2' has no foot point: its axis passes through the tip, as the next one's does",
    ),
    "one hinge": (
        [_link(0)],
        ARM,
        "{kind: fabrik, task: position}",
        "robot",
        "tip 'tip' is moved by 1 hinge(s): chain points need at least 2",
    ),
    "z off the link": (
        [_link(0), _link(1, "y"), _link(2, "y")],
        ARM,
        "{kind: fabrik}",
        "controller.task",
        "'approach' needs a tip whose z points along the last link",
    ),
    "search, z off the link": (
        [_link(0), _link(1, "y"), _link(2, "y")],
        ARM,
        "{kind: dls, restart: true}",
        "controller.task",
        "'approach' needs a tip whose z points along the last link",
    ),
    "search, slides": (
        [_link(0), _link(1, "x", joint="prismatic", speed="1 m/s"), _link(2, "y")],
        ARM,
        "{kind: dls, task: position, restart: true}",
        "robot",
        "joint 'q1' slides: chain points need hinges",
    ),
}


@pytest.mark.parametrize("name", list(ROBOTS))
def test_an_arm_that_the_law_cannot_move_is_refused(name: str, tmp_path: Path) -> None:
    links, tip, controller, field, text = ROBOTS[name]
    given: dict[str, Any] = {"robot": _robot(tmp_path, links, tip), "start": f"{{q: {[0] * len(links)}}}"}
    position = {} if field == "controller.task" else {k: v for k, v in POSITION.items() if k != "controller"}
    (problem,) = _problems(tmp_path, **given, controller=controller, **position)
    assert problem.field == field
    assert text in problem.message
    assert problem.line == (2 if field == "robot" else 5)


def test_no_roll_without_a_free_last_joint(tmp_path: Path) -> None:
    links = [_link(0), _link(1, "y"), _link(2, "y")]
    (problem,) = _problems(
        tmp_path,
        robot=_robot(tmp_path, links, f"{ARM}, rpy: [0, 90 deg, 0]"),
        start="{q: [0, 0, 0]}",
        controller="{kind: fabrik, task: pose}",
        reference="{kind: target, position: [0.3, 0.5, 0.8], rpy: [0, 0, 0]}",
        stop="{position: 10 mm, orientation: 2 deg, after: 1 s}",
    )
    assert (problem.line, problem.column, problem.field) == (5, 34, "controller.task")
    assert "'pose' needs a last joint whose axis carries the tip, to roll it" in problem.message


def test_a_joint_that_may_not_move_is_refused_in_the_robot_s_file(tmp_path: Path) -> None:
    robot = _robot(tmp_path, [_link(0), _link(1, "y", speed="0 deg/s"), _link(2, "y")], ARM)
    (problem,) = _problems(tmp_path, robot=robot, start="{q: [0, 0, 0]}", **POSITION)
    assert problem.file.endswith("arm.yaml")
    assert (problem.line, problem.field) == (5, "links.l1.joint.speed")
    assert problem.message == "must be > 0, got '0 deg/s'"
