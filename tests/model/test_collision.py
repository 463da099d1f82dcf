"""Clearances of whole robots against coal on frames multiplied out in NumPy; their derivatives and bounds."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.errors import SpecError
from fzcli.model import RobotModel, build_model
from fzcli.model.collision import (
    Clearance,
    ObstacleKind,
    SelfPairs,
    build_clearance,
    many,
    obstacle_numbers,
    self_pairs,
)
from fzcli.model.motion_bound import BaseSpeedBound
from fzcli.spec.load import load_robot, robot_of
from fzcli.spec.physics import rotation_of
from fzcli.spec.reader import read_text
from fzcli.spec.robot import Link
from fzcli.spec.shapes import BoxShape, CapsuleShape, Shape, SphereShape

Array = NDArray[np.float64]
KINDS: tuple[ObstacleKind, ...] = ("sphere", "capsule", "box")
ROBOTS = ("melfa_rv1a", "melfa_free_flyer", "dual_arm")


def placed(xyz: tuple[float, ...], rpy: tuple[float, ...]) -> Array:
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation_of(rpy), xyz
    return frame


def joint_frame(link: Link, value: float) -> Array:
    frame = np.eye(4)
    axis = np.array(link.joint.axis)
    if link.joint.type == "prismatic":
        frame[:3, 3] = value * axis
    elif link.joint.type != "fixed":
        skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        frame[:3, :3] = np.eye(3) + np.sin(value) * skew + (1 - np.cos(value)) * skew @ skew
    return frame


def link_frames(model: RobotModel, q: Array, base: Array) -> dict[str, Array]:
    values = dict(zip(model.joint_names, q, strict=True))
    frames = {"base": base, model.robot.base.name: base}
    for link in model.robot.links:
        own = placed(link.at.xyz, link.at.rpy) @ joint_frame(link, values.get(link.joint.name, 0.0))
        frames[link.name] = frames[link.parent] @ own
    return frames


def in_coal(shape: Shape, frame: Array) -> tuple[object, object]:
    import coal

    solid = shape.solid
    if isinstance(solid, SphereShape):
        return coal.Sphere(solid.radius), transform(frame @ placed(solid.center, (0, 0, 0)))
    if isinstance(solid, BoxShape):
        return coal.Box(*solid.size), transform(frame @ placed(solid.center, solid.rpy))
    start, end = np.array(solid.start), np.array(solid.end)
    z = (end - start) / np.linalg.norm(end - start)
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    own = np.eye(4)
    own[:3, :3], own[:3, 3] = np.column_stack([x, np.cross(z, x), z]), (start + end) / 2
    return coal.Capsule(solid.radius, np.linalg.norm(end - start)), transform(frame @ own)


def transform(frame: Array) -> object:
    import coal

    return coal.Transform3s(frame[:3, :3], frame[:3, 3])


def by_coal(model: RobotModel, clearance: Clearance, q: Array, base: Array, obstacles: list[Shape]) -> Array:
    import coal

    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    frames = link_frames(model, q, base)
    carried = [(model.robot.base.name, shape) for shape in model.robot.base.collision]
    carried += [(link.name, shape) for link in model.robot.links for shape in link.collision]
    found = []
    for pair in clearance.pairs:
        name, shape = carried[pair.solid]
        assert name == pair.link
        if pair.obstacle >= 0:
            other, frame = obstacles[pair.obstacle], np.eye(4)
        else:
            other, frame = carried[pair.second][1], frames[carried[pair.second][0]]
        a, b = in_coal(shape, frames[name]), in_coal(other, frame)
        found.append(coal.distance(*a, *b, request, coal.DistanceResult()))
    return np.array(found)


def scene(rng: np.random.Generator) -> list[Shape]:
    where = rng.uniform((-0.6, -0.6, -0.3), (0.6, 0.6, 0.9), (4, 3))
    return [
        Shape(sphere=SphereShape(center=tuple(where[0]), radius=0.1)),
        Shape(capsule=CapsuleShape(start=tuple(where[1]), end=tuple(where[2]), radius=0.05)),
        Shape(box=BoxShape(center=tuple(where[3]), rpy=tuple(rng.uniform(-3, 3, 3)), size=(0.02, 0.5, 0.3))),
    ]


def posture(model: RobotModel, rng: np.random.Generator) -> Array:
    limits = model.tree.position_limits
    return rng.uniform(np.maximum(limits[:, 0], -3), np.minimum(limits[:, 1], 3))


def base_pose(model: RobotModel, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Position, quaternion and frame."""
    if not model.floating:
        return np.zeros(3), np.array([1.0, 0, 0, 0]), np.eye(4)
    position, quat = rng.normal(size=3) * 0.2, rng.normal(size=4)
    quat /= np.linalg.norm(quat)
    w, v = quat[0], quat[1:]
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = np.eye(3) + 2 * w * skew + 2 * skew @ skew, position
    return position, quat, frame


@pytest.mark.parametrize("name", ROBOTS)
def test_coal_finds_the_same_clearances(name: str) -> None:
    pytest.importorskip("coal")
    model = build_model(load_robot(name))
    clearance = build_clearance(model, KINDS)
    rng = np.random.default_rng(10)
    for _ in range(50):
        obstacles, q = scene(rng), posture(model, rng)
        position, quat, frame = base_pose(model, rng)
        numbers = np.concatenate([obstacle_numbers(shape) for shape in obstacles])
        found = clearance.at(q[None], numbers, position, quat)[0]
        np.testing.assert_allclose(found, by_coal(model, clearance, q, frame, obstacles), atol=1e-9)


@pytest.mark.parametrize("name", ROBOTS)
def test_derivatives_are_those_of_finite_differences(name: str) -> None:
    model = build_model(load_robot(name))
    clearance = build_clearance(model, KINDS)
    rng = np.random.default_rng(11)
    checked = 0
    for _ in range(20):
        numbers = np.concatenate([obstacle_numbers(shape) for shape in scene(rng)])
        q, (position, quat, _) = posture(model, rng), base_pose(model, rng)
        _, by_q, by_base = (np.array(part) for part in clearance.jacobian(q, position, quat, numbers))
        step, size = 1e-6, model.n + 6
        moves = np.vstack([np.zeros(size), step * np.eye(size), -step * np.eye(size)])
        turned = np.array([twisted(quat, move[model.n + 3 :]) for move in moves])
        d = clearance.at(q + moves[:, : model.n], numbers, position + moves[:, model.n : model.n + 3], turned)
        right, left = (d[1 : 1 + size] - d[0]) / step, (d[0] - d[1 + size :]) / step
        smooth = np.isclose(left, right, atol=1e-4)
        checked += np.count_nonzero(smooth)
        exact = np.hstack([by_q, by_base]).T
        np.testing.assert_allclose(exact[smooth], ((left + right) / 2)[smooth], atol=1e-4)
        assert smooth.mean() > 0.8
    assert checked > 1000


def twisted(quat: Array, turn: Array) -> Array:
    w, v = quat[0], quat[1:]
    return np.concatenate([[w - turn @ v / 2], v + (w * turn + np.cross(turn, v)) / 2])


def test_pairs_of_the_robot_itself() -> None:
    model = build_model(load_robot("melfa_free_flyer"))
    own = self_pairs(model)
    assert [str(pair) for pair in own.watched] == [
        "base and J2_link",
        "base and J3_link",
        "base and J4_link",
        "base and J6_link",
        "J2_link and J6_link",
    ]
    assert [(str(pair), reason) for pair, reason in own.left_out] == [
        ("J2_link and J3_link", "one joint between them"),
        ("J3_link and J4_link", "one joint between them"),
        ("J2_link and J4_link", "in contact at all of 1000 postures"),
        ("J3_link and J6_link", "70 mm apart at all of 1000 postures"),  # the wrist's middle is nearest, bent or not
        ("J4_link and J6_link", "in contact at all of 1000 postures"),
    ]
    assert own == self_pairs(model)


def test_both_arms_are_watched_against_each_other() -> None:
    own = self_pairs(build_model(load_robot("dual_arm")), samples=200)
    between = [pair for pair in own.watched if pair.link.startswith("left") and pair.other.startswith("right")]
    assert len(between) == 16


def test_a_fixed_base_may_stand_on_an_obstacle() -> None:
    robot = load_robot("melfa_free_flyer")
    grounded = robot.model_copy(update={"base": robot.base.model_copy(update={"floating": False})})
    links = [pair.link for pair in build_clearance(build_model(grounded), ["box"]).pairs if pair.obstacle >= 0]
    assert links == ["J2_link", "J3_link", "J4_link", "J6_link"]
    floating = build_clearance(build_model(robot), ["box"], ["panel"])
    assert str(floating.pairs[floating.with_obstacles[0]]) == "base and panel"


def test_robots_without_solids_are_refused() -> None:
    with pytest.raises(SpecError, match="robot 'planar3' has no solids to judge collisions by; give its links"):
        build_clearance(build_model(load_robot("planar3")), ["sphere"])


SLIDER = """kind: robot
base: {mass: 10, inertia: [1, 2, 3], com: [0.1, 0, 0]}
links:
  - name: turn
    at: {xyz: [0.1, 0, 0.2], rpy: [0.3, 0.2, 0.1]}
    joint: {name: q1, axis: [1, 2, 3], type: revolute}
    mass: 2
    com: [0, 0.1, 0.2]
    inertia: [0.1, 0.1, 0.15]
    collision: [{capsule: {from: [0, 0, 0], to: [0, 0, 1], radius: 50 mm}}]
  - name: slide
    at: {xyz: [0, 0, 1], rpy: [0.5, 0, 1]}
    joint: {name: q2, axis: x, type: prismatic, position: [-0.5, 0.8]}
    mass: 3
    com: [0.1, 0, 0]
    inertia: [0.1, 0.1, 0.1]
    collision: [{box: {center: [0, 0.2, 0], rpy: [0.1, 0.2, 0.3], size: [0.1, 0.2, 0.3]}}]
  - name: hand
    at: {xyz: [0.2, 0, 0]}
    joint: {name: q3, axis: y, type: continuous}
    mass: 1
    com: [0, 0, 0.3]
    inertia: [0.1, 0.1, 0.1]
    collision: [{sphere: {center: [0, 0, 0.3], radius: 0.1}}]
  - name: side
    parent: base
    at: {xyz: [0, -0.3, 0]}
    joint: {name: q4, axis: z, type: revolute}
    mass: 2
    com: [0.2, 0, 0]
    inertia: [0.1, 0.2, 0.2]
    collision: [{box: {center: [0.3, 0, 0], size: [0.6, 0.1, 0.1]}}]
tips: {tip: {link: hand}}
"""


def models() -> list[RobotModel]:
    return [build_model(robot_of(read_text(SLIDER))), *(build_model(load_robot(name)) for name in ROBOTS)]


@pytest.mark.parametrize("index", range(4))
def test_no_distance_changes_by_more_than_its_bound(index: int) -> None:
    model = models()[index]
    clearance = build_clearance(model, KINDS, own=self_pairs(model, samples=100))
    rng = np.random.default_rng([12, index])
    center = np.zeros(3) if model.tree.base.mass == 0 else model.tree.base.first_moment / model.tree.base.mass
    tight = 0.0
    for _ in range(150):
        size = 10 ** rng.uniform(-4, 0)
        numbers = np.concatenate([obstacle_numbers(shape) for shape in scene(rng)])
        q, (position, quat, _) = posture(model, rng), base_pose(model, rng)
        dq = rng.normal(size=model.n) * size * (rng.random(model.n) < 0.4)
        turn = rng.normal(size=3) * size * float(model.floating)
        shift = rng.normal(size=3) * size * float(model.floating)
        moved = numbers.copy()
        drift = rng.normal(size=(3, 3)) * size
        for k, start in enumerate((0, 4, 11)):
            moved[start : start + 3] += drift[k]
        moved[7:10] += drift[1]
        after_quat = rotated(quat, turn)
        after = position + shift + rotation(quat) @ center - rotation(after_quat) @ center
        before_d, reach = many(
            clearance.bounds,
            q,
            position,
            quat,
            numbers,
            np.abs(dq),
            np.array([np.linalg.norm(shift)]),
            np.array([np.linalg.norm(turn)]),
            np.linalg.norm(drift, axis=1),
        )
        after_d = clearance.at((q + dq)[None], moved, after, after_quat)
        change = np.abs(after_d - before_d)
        assert (change <= reach + 1e-12).all()
        tight = max(tight, float((change / (reach + 1e-12)).max()))
    assert tight > 0.9  # and no bound is wasteful everywhere


def rotation(quat: Array) -> Array:
    w, v = quat[0], quat[1:]
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.asarray(np.eye(3) + 2 * w * skew + 2 * skew @ skew)


def rotated(quat: Array, turn: Array) -> Array:
    angle = float(np.linalg.norm(turn))
    w, v = np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * turn
    return np.array([w * quat[0] - v @ quat[1:], *(w * quat[1:] + quat[0] * v + np.cross(v, quat[1:]))])


@pytest.mark.parametrize("index", [0, 2, 3])
def test_the_free_base_is_never_faster_than_its_bound(index: int) -> None:
    model = models()[index]
    bound = BaseSpeedBound(model.tree)
    center = model.tree.base.first_moment / model.tree.base.mass
    rng = np.random.default_rng(13)
    closest = 0.0
    for _ in range(500):
        q, qd = posture(model, rng), rng.normal(size=model.n) * (rng.random(model.n) < 0.6)
        h_base, h_joints = (np.array(part) for part in model.momentum_map(q, [1, 0, 0, 0]))
        twist = -np.linalg.solve(h_base, h_joints @ qd)
        linear, angular = bound(np.abs(qd))
        found = np.linalg.norm(twist[:3] + np.cross(twist[3:], center)), np.linalg.norm(twist[3:])
        assert found[0] <= linear + 1e-12
        assert found[1] <= angular + 1e-12
        closest = max(closest, found[0] / max(linear, 1e-9))
    assert closest > 0.2


def test_a_slide_without_limits_on_a_free_base_is_refused() -> None:
    model = build_model(robot_of(read_text(SLIDER.replace(", position: [-0.5, 0.8]", ""))))
    with pytest.raises(SpecError, match="joint 'q2' slides without limits: nothing bounds the base's motion"):
        BaseSpeedBound(model.tree)


def test_no_pairs_at_all() -> None:
    model = build_model(load_robot("melfa_rv1a"))
    none = build_clearance(model, [], own=SelfPairs((), ()))
    assert none.at(np.zeros((3, 6))).shape == (3, 0)
