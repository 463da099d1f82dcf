"""Solids in robot files: how they are written, where they stand, what is refused; tools."""

import numpy as np
import pytest

from fzcli.errors import SpecError
from fzcli.model.tree import build_tree
from fzcli.spec.load import load_robot, robot_of
from fzcli.spec.physics import rotation_of
from fzcli.spec.reader import read_text
from fzcli.spec.robot import Link
from fzcli.spec.shapes import BoxShape, CapsuleShape, Shape, SphereShape, placed
from fzcli.spec.tool import Tool, with_tool

FRAMES = """kind: robot
base:
  mass: 10
  inertia: [1, 1, 1]
  collision:
    - box: {center: [0, 0, -400 mm], size: [0.8, 0.8, 80 cm], rpy: [0, 0, 90 deg]}
links:
  - name: arm
    joint: {name: q1, axis: y, type: revolute}
    mass: 0
    collision:
      - capsule: {from: [0, 0, 0], to: [0, 0, 1], radius: 50 mm}
      - sphere: {center: [0, 0, 1], radius: 0.1}
  - name: hand
    at: {xyz: [0, 0, 1], rpy: [90 deg, 0, 0]}
    mass: 0
    collision:
      - box: {center: [0, 0.2, 0], size: [0.1, 0.2, 0.3]}
tips: {tip: {link: hand, xyz: [0, 0.5, 0]}}
"""


def test_solids_are_read_with_units() -> None:
    robot = robot_of(read_text(FRAMES))
    box = robot.base.collision[0].box
    assert box is not None
    assert (box.center, box.size) == ((0, 0, -0.4), (0.8, 0.8, 0.8))
    assert box.rpy == pytest.approx((0, 0, np.pi / 2))
    assert [shape.kind for shape in robot.links[0].collision] == ["capsule", "sphere"]
    assert robot.links[0].collision[0].solid == CapsuleShape(start=(0, 0, 0), end=(0, 0, 1), radius=0.05)


def test_solids_of_welded_links_stand_in_their_carrier() -> None:
    tree = build_tree(robot_of(read_text(FRAMES)))
    assert [(solid.link, solid.body) for solid in tree.solids] == [
        ("base", -1),
        ("arm", 0),
        ("arm", 0),
        ("hand", 0),
    ]
    box = tree.solids[3].shape.box
    assert box is not None
    np.testing.assert_allclose(box.center, (0, 0, 1.2), atol=1e-15)
    np.testing.assert_allclose(box.rpy, (np.pi / 2, 0, 0), atol=1e-15)


def problems(text: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        robot_of(read_text(text, "x.yaml"))
    return [str(problem).split("\n")[0] for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("radius: 0.1", "radius: -0.1", "x.yaml:13:45: links.arm.collision.1.sphere.radius: must be > 0, got -0.1"),
        ("radius: 0.1", "radius: 1 kg", "sphere.radius: '1 kg' is a mass; a length is wanted, e.g. '100 mm'"),
        ("size: [0.1, 0.2, 0.3]", "size: [0.1, 0, 0.3]", "box.size.1: must be > 0, got 0"),
        ("to: [0, 0, 1]", "to: [0, 0, 0]", "capsule: from and to are one point; write a sphere"),
        ("- sphere:", "- spere:", "unknown key; did you mean 'sphere'?"),
        (", radius: 50 mm", "", "capsule.radius: is missing"),
        ("      - sphere: {center: [0, 0, 1], radius: 0.1}", "      - {}", "needs one of sphere, capsule and box"),
        (
            "- sphere: {center: [0, 0, 1], radius: 0.1}",
            "- {sphere: {radius: 1}, box: {size: [1, 1, 1]}}",
            "needs one of sphere, capsule and box, has sphere and box",
        ),
        (
            "      - box: {center: [0, 0.2, 0], size: [0.1, 0.2, 0.3]}",
            "      box: {size: [1, 1, 1]}",
            "collision: must be a list of solids: write '- ' before sphere, capsule or box",
        ),
    ],
)
def test_what_is_refused(old: str, new: str, message: str) -> None:
    assert FRAMES.count(old) == 1
    assert message in "\n".join(problems(FRAMES.replace(old, new)))


def test_a_placed_solid_holds_the_same_points() -> None:
    rng = np.random.default_rng(5)
    turn, shift = rotation_of(rng.uniform(-1, 1, 3)), rng.normal(size=3)
    box = Shape(box=BoxShape(center=(1, 2, 3), rpy=(0.3, -0.4, 0.5), size=(1, 2, 3)))
    moved = placed(box, turn, shift).box
    assert moved is not None
    np.testing.assert_allclose(moved.center, turn @ (1, 2, 3) + shift)
    np.testing.assert_allclose(rotation_of(moved.rpy), turn @ rotation_of((0.3, -0.4, 0.5)), atol=1e-14)
    sphere = placed(Shape(sphere=SphereShape(center=(1, 0, 0), radius=2)), turn, shift).sphere
    assert sphere is not None
    assert sphere.radius == 2
    np.testing.assert_allclose(sphere.center, turn[:, 0] + shift)


def capsule_of(link: Link, index: int = 0) -> CapsuleShape:
    capsule = link.collision[index].capsule
    assert capsule is not None
    return capsule


def test_the_rv1a_carries_its_capsules_on_the_dh_origins() -> None:
    links = {link.joint.name: link for link in load_robot("melfa_rv1a").links}
    found = {name: capsule_of(links[name]) for name in ("J2", "J3", "J4", "J6")}
    lengths = {name: np.linalg.norm(np.subtract(one.end, one.start)) for name, one in found.items()}
    assert lengths == pytest.approx({"J2": 0.25, "J3": 0.09, "J4": 0.16, "J6": 0.072})
    assert [one.radius for one in found.values()] == [0.055, 0.055, 0.045, 0.035]
    assert not links["J1"].collision
    assert not links["J5"].collision


def test_two_arms_and_one_free_flyer_are_the_same_arm() -> None:
    one, free, two = (load_robot(name) for name in ("melfa_rv1a", "melfa_free_flyer", "dual_arm"))
    assert not one.base.floating
    assert free.base.floating
    assert free.links == one.links
    for mine, left, right in zip(one.links, two.links[:6], two.links[6:], strict=True):
        for other in (left, right):
            assert (other.joint.position, other.joint.speed, other.mass) == (
                pytest.approx(mine.joint.position),
                pytest.approx(mine.joint.speed),
                mine.mass,
            )
            if mine.mass:
                np.testing.assert_allclose(other.com, mine.com, atol=1e-12)
            np.testing.assert_allclose(other.inertia, mine.inertia, atol=1e-8)
            for a, b in zip(other.collision, mine.collision, strict=True):
                assert a.solid.radius == b.solid.radius  # type: ignore[union-attr]
                np.testing.assert_allclose(a.capsule.start, b.capsule.start, atol=1e-12)  # type: ignore[union-attr]
                np.testing.assert_allclose(a.capsule.end, b.capsule.end, atol=1e-12)  # type: ignore[union-attr]


def test_a_straight_tool_lengthens_the_last_capsule() -> None:
    robot = load_robot("melfa_rv1a")
    tooled = with_tool(robot, Tool(xyz=(0, 0, 0.1), rpy=(0, 0, 0.5)))
    before, after = capsule_of(robot.links[-1]), capsule_of(tooled.links[-1])
    assert len(tooled.links[-1].collision) == 1
    assert np.linalg.norm(np.subtract(after.end, after.start)) == pytest.approx(0.172)
    assert after.start == before.start
    np.testing.assert_allclose(after.end, tooled.tips["flange"].xyz, atol=1e-15)
    np.testing.assert_allclose(
        rotation_of(tooled.tips["flange"].rpy),
        rotation_of(robot.tips["flange"].rpy) @ rotation_of((0, 0, 0.5)),
        atol=1e-14,
    )
    assert robot.links[:-1] == tooled.links[:-1]


@pytest.mark.parametrize("tool", [Tool(xyz=(0.1, 0, 0.1)), Tool(xyz=(0, 0, -0.1)), Tool(xyz=(0, 0, 0.1), radius=0.01)])
def test_any_other_tool_is_a_capsule_of_its_own(tool: Tool) -> None:
    robot = load_robot("melfa_rv1a")
    last = with_tool(robot, tool).links[-1]
    assert last.collision[0] == robot.links[-1].collision[0]
    own = capsule_of(last, 1)
    assert own.radius == (tool.radius or 0.035)
    assert own.start == robot.tips["flange"].xyz


def test_a_tool_nobody_knows_the_thickness_of() -> None:
    robot = robot_of(read_text(FRAMES))
    with pytest.raises(SpecError, match="tool: radius is missing: no capsule of link 'hand' ends at the tip"):
        with_tool(robot, Tool(xyz=(0, 0.1, 0)))
    own = capsule_of(with_tool(robot, Tool(xyz=(0, 0.1, 0), radius=0.02)).links[1], 1)
    assert (own.start, own.end) == ((0, 0.5, 0), (0, 0.6, 0))
    assert with_tool(robot, Tool(rpy=(0.1, 0, 0))).links == robot.links
    with pytest.raises(SpecError, match="no tip 'hnd'; known tips: tip"):
        with_tool(robot, Tool(), "hnd")
    bare = load_robot("planar3")
    assert with_tool(bare, Tool(xyz=(0.2, 0, 0))).links == bare.links
