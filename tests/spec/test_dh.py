"""Standard DH tables against a product of elementary transforms, written out independently."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.errors import SpecError
from fzcli.spec.load import load_robot, robot_of
from fzcli.spec.reader import dump, read_text
from fzcli.spec.robot import Robot

Array = NDArray[np.float64]


def about(axis: int, angle: float) -> Array:
    """Elementary rotation, right-handed, about x, y or z (4, 4)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(4)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[j, i] = np.sin(angle)
    matrix[i, j] = -np.sin(angle)
    return matrix


def along(x: float, y: float, z: float) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def placed(xyz: tuple[float, ...], rpy: tuple[float, ...]) -> Array:
    return along(*xyz) @ about(2, rpy[2]) @ about(1, rpy[1]) @ about(0, rpy[0])


def link_frames(robot: Robot, q: Array) -> list[Array]:
    """Frames of a chain's links in the base's frame, joints about or along z."""
    frames, frame = [], np.eye(4)
    for link, value in zip(robot.links, q, strict=True):
        assert link.joint.axis == (0, 0, 1)
        moved = along(0, 0, value) if link.joint.type == "prismatic" else about(2, value)
        frame = frame @ placed(link.at.xyz, link.at.rpy) @ moved
        frames.append(frame)
    return frames


def random_table(seed: int) -> dict:  # type: ignore[type-arg]
    rng = np.random.default_rng(seed)
    rows = []
    for index in range(5):
        theta, alpha = rng.choice([0, np.pi / 2, -np.pi / 2, np.pi, rng.uniform(-3, 3)], 2)
        d, a = rng.uniform(-1, 1, 2)
        body = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        t = body @ np.diag(rng.uniform(1, 1.9, 3)) @ body.T
        rows.append(
            {
                "name": f"q{index}",
                "type": str(rng.choice(["revolute", "prismatic"])),
                "theta": float(theta),
                "d": float(d),
                "a": float(a),
                "alpha": float(alpha),
                "mass": float(rng.uniform(0.1, 5)),
                "com": [float(x) for x in rng.uniform(-1, 1, 3)],
                "inertia": [float(t[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))],
            }
        )
    return {
        "kind": "robot",
        "base": {
            "mass": 50,
            "inertia": [1, 1, 1],
            "mount": {
                "xyz": [float(x) for x in rng.uniform(-1, 1, 3)],
                "rpy": [0.1, float(rng.uniform(-1, 1)), -2.0],
            },
        },
        "dh": {"convention": "standard", "rows": rows},
        "tips": {"end": {}, "mid": {"link": "q2", "xyz": [0.1, 0.2, 0.3], "rpy": [0.3, -0.4, 0.5]}},
    }


def matrix_of(six: list[float] | tuple[float, ...]) -> Array:
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@pytest.mark.parametrize("seed", range(12))
def test_frames_bodies_and_tips_are_those_of_the_table(seed: int) -> None:
    table = random_table(seed)
    robot = robot_of(read_text(dump(table)))
    q = np.random.default_rng(100 + seed).uniform(-2, 2, 5)
    mount = table["base"]["mount"]
    frame = placed(mount["xyz"], mount["rpy"])
    after = []
    for row, link, link_frame, value in zip(
        table["dh"]["rows"], robot.links, link_frames(robot, q), q, strict=True
    ):
        slides = row["type"] == "prismatic"
        theta, d = row["theta"] + (0 if slides else value), row["d"] + (value if slides else 0)
        frame = frame @ about(2, theta) @ along(0, 0, d) @ along(row["a"], 0, 0) @ about(0, row["alpha"])
        after.append(frame)
        np.testing.assert_allclose(link_frame @ [*link.com, 1], frame @ [*row["com"], 1], atol=1e-13)
        turn, own = frame[:3, :3], link_frame[:3, :3]
        np.testing.assert_allclose(
            own @ matrix_of(link.inertia) @ own.T, turn @ matrix_of(row["inertia"]) @ turn.T, atol=1e-13
        )
        assert link.mass == row["mass"]
    frames = {link.name: frame for link, frame in zip(robot.links, link_frames(robot, q), strict=True)}
    end, mid = robot.tips["end"], robot.tips["mid"]
    np.testing.assert_allclose(frames[end.link] @ placed(end.xyz, end.rpy), after[-1], atol=1e-13)
    extra = placed((0.1, 0.2, 0.3), (0.3, -0.4, 0.5))
    np.testing.assert_allclose(frames[mid.link] @ placed(mid.xyz, mid.rpy), after[2] @ extra, atol=1e-13)


def test_ur5_chain_in_its_home_pose() -> None:
    robot = load_robot("ur5_free_flyer")
    frame = link_frames(robot, np.radians([0, -90, 0, -90, 0, 0]))[-1]
    tip = frame @ placed(robot.tips["flange"].xyz, robot.tips["flange"].rpy)
    # upright: height d1 - a2 - a3 + d5 over the mount, sideways -(d4 + d6)
    height = 0.2 + 0.089159 + 0.425 + 0.39225 + 0.09465
    np.testing.assert_allclose(tip[:3, 3], [0, -(0.10915 + 0.0823), height], atol=1e-15)
    assert robot.links[1].at.rpy == (np.pi / 2, 0, 0)
    assert robot.links[0].joint.speed == pytest.approx(np.pi)
    assert robot.links[0].joint.position == pytest.approx((-2 * np.pi, 2 * np.pi))


def test_the_last_frame_is_the_tip_unless_told() -> None:
    table = random_table(1)
    del table["tips"]
    robot = robot_of(read_text(dump(table)))
    assert list(robot.tips) == ["flange"]
    assert robot.tips["flange"].link == "q4_link"


def problems(text: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        robot_of(read_text(text, "x.yaml"))
    return [str(problem).split("\n")[0] for problem in caught.value.problems]


HEAD = "kind: robot\nbase: {mass: 1, inertia: [1, 1, 1]}\n"
ROW = "{name: q1, theta: 0, d: 0, a: 1, alpha: 0, mass: 0}"


def test_errors_point_into_the_table() -> None:
    two = f"{HEAD}dh:\n  convention: standard\n  rows:\n  - {ROW}\n  - {ROW}\n"
    assert problems(two) == [
        "x.yaml:7:12: dh.rows.1.name: link 'q1_link' stands twice",
        "x.yaml:7:12: dh.rows.1.name: joint 'q1' stands twice",
    ]
    one = f"{HEAD}dh: {{convention: standard, rows: [{ROW}]}}\n"
    assert problems(one + "tips: {t: {link: q7}}") == [
        "x.yaml:4:18: tips.t.link: unknown link 'q7'; known links: q1_link"
    ]
    assert problems(one.replace("standard", "modified")) == [
        "x.yaml:3:18: dh.convention: must be 'standard', got 'modified'"
    ]
    assert problems(one.replace("alpha", "alfa")) == [
        "x.yaml:3:68: dh.rows.q1.alfa: unknown key; did you mean 'alpha'?",
    ]
    assert problems(one.replace("d: 0", "d: 1 deg")) == [
        "x.yaml:3:59: dh.rows.q1.d: '1 deg' is an angle; a length is wanted, e.g. '100 mm'"
    ]
