"""Collision geometry of URDFs: primitives, meshes in capsules, and what cannot be read."""

from pathlib import Path

import numpy as np
import pytest

from fzcli.errors import SpecError
from fzcli.model import build_model
from fzcli.model.collision import build_clearance
from fzcli.spec.load import load_robot
from fzcli.spec.physics import rotation_of
from fzcli.spec.shapes import Shape
from fzcli.spec.urdf_shapes import bounding_capsule

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
URDF = f"""<robot name="thing">
  <link name="body">{INERTIAL}
    <collision><origin xyz="0 0 -0.2" rpy="0 0 0.5"/><geometry><box size="1 2 0.4"/></geometry></collision>
  </link>
  <link name="arm">{INERTIAL}
    <collision><origin xyz="0.1 0.2 0.3" rpy="1.5707963267948966 0 0"/>
      <geometry><cylinder radius="0.05" length="0.8"/></geometry></collision>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <link name="hand">{INERTIAL}
    <collision><origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/>
      <geometry><mesh filename="package://thing/meshes/hand.obj" scale="2 1 1"/></geometry></collision>
  </link>
  <joint name="q1" type="continuous"><parent link="body"/><child link="arm"/></joint>
  <joint name="q2" type="continuous"><parent link="arm"/><child link="hand"/><origin xyz="0 0 2"/></joint>
</robot>
"""
CORNERS = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.1, 0.1) for z in (-0.05, 0.05)]


def written(folder: Path, text: str = URDF, mesh: bool = True) -> Path:
    path = folder / "thing" / "urdf" / "thing.urdf"
    path.parent.mkdir(parents=True)
    path.write_text(text)
    if mesh:
        (folder / "thing" / "meshes").mkdir()
        lines = [f"v {x} {y} {z}" for x, y, z in CORNERS] + [f"f {i} {i + 1} {i + 2}" for i in range(1, 7)]
        (folder / "thing" / "meshes" / "hand.obj").write_text("\n".join(lines) + "\n")
    return path


def inside(shape: Shape, points: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    solid = shape.capsule or shape.sphere
    assert solid is not None
    start, end = (solid.center, solid.center) if shape.sphere else (solid.start, solid.end)  # type: ignore[union-attr]
    way = np.subtract(end, start)
    share = np.clip((points - start) @ way / max(way @ way, 1e-300), 0, 1)
    return np.asarray(np.linalg.norm(points - start - share[:, None] * way, axis=1) <= solid.radius + 1e-9)


def test_primitives_and_a_mesh(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path))
    box = robot.base.collision[0].box
    assert box is not None
    assert (box.center, box.size) == ((0, 0, -0.2), (1, 2, 0.4))
    np.testing.assert_allclose(box.rpy, (0, 0, 0.5), atol=1e-15)
    arm, hand = robot.links
    cylinder, ball = arm.collision
    assert cylinder.capsule is not None
    np.testing.assert_allclose(cylinder.capsule.start, (0.1, 0.6, 0.3), atol=1e-15)
    np.testing.assert_allclose(cylinder.capsule.end, (0.1, -0.2, 0.3), atol=1e-15)
    assert (cylinder.capsule.radius, ball.kind) == (0.05, "sphere")
    points = np.array(CORNERS) * (2, 1, 1) @ rotation_of((0, 0, np.pi / 2)).T + (0, 0, 1)
    assert inside(hand.collision[0], points).all()
    assert hand.collision[0].solid.radius < 0.12  # type: ignore[union-attr]
    assert not hand.unread
    assert len(build_clearance(build_model(robot), ["sphere"]).pairs) > 3


def test_a_mesh_that_cannot_be_read_is_told_when_it_matters(tmp_path: Path) -> None:
    path = written(tmp_path, mesh=False)
    robot = load_robot(path)
    assert robot.links[1].unread == ("mesh 'package://thing/meshes/hand.obj': no such file",)
    model = build_model(robot)
    with pytest.raises(SpecError, match=r"collision of link 'hand' is not known: mesh 'package.*: no such file; give"):
        build_clearance(model, [])
    named = tmp_path / "mine.yaml"
    named.write_text(
        "kind: robot\nurdf: thing/urdf/thing.urdf\n"
        "base: {collision: [{sphere: {radius: 1}}]}\n"
        "collision: {hand: [{sphere: {radius: 50 mm}}]}\n"
    )
    mine = load_robot(named)
    assert [shape.kind for shape in (*mine.base.collision, *mine.links[1].collision)] == ["sphere", "sphere"]
    assert not mine.links[1].unread
    build_clearance(build_model(mine), [])
    named.write_text("kind: robot\nurdf: thing/urdf/thing.urdf\ncollision: {hnd: []}\n")
    with pytest.raises(SpecError, match="collision: unknown link 'hnd'; did you mean 'hand'"):
        load_robot(named)


def test_a_file_that_is_no_mesh(tmp_path: Path) -> None:
    path = written(tmp_path)
    (tmp_path / "thing" / "meshes" / "hand.obj").write_text("nothing of the kind")
    assert len(load_robot(path).links[1].unread) == 1


def test_a_solid_without_extent(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"link 'arm': <collision>: radius: Input should be greater than 0"):
        load_robot(written(tmp_path, URDF.replace('sphere radius="0.1"', 'sphere radius="0"')))


def volume(shape: Shape) -> float:
    solid = shape.capsule or shape.sphere
    assert solid is not None
    length = np.linalg.norm(np.subtract(shape.capsule.end, shape.capsule.start)) if shape.capsule else 0.0
    return float(np.pi * solid.radius**2 * (length + 4 / 3 * solid.radius))


@pytest.mark.parametrize("seed", range(20))
def test_bounding_capsules_hold_all_points_and_little_else(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.05, 1, 3)
    turn = rotation_of(rng.uniform(-3, 3, 3))
    points = rng.uniform(-1, 1, (200, 3)) * size @ turn.T + rng.normal(size=3)
    shape = bounding_capsule(points)
    assert inside(shape, points).all()
    radius, length = float(np.linalg.norm(np.sort(size)[:2])), 2 * size.max()
    assert volume(shape) < 1.2 * np.pi * radius**2 * (length + 4 / 3 * radius)  # the cylinder about the longest edge


def test_a_single_point_and_a_line() -> None:
    assert bounding_capsule(np.zeros((1, 3))).kind == "sphere"
    line = np.outer(np.linspace(0, 1, 5), (0, 1, 0))
    shape = bounding_capsule(line)
    assert inside(shape, line).all()
    assert shape.solid.radius < 1e-5  # type: ignore[union-attr]
