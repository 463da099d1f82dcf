"""Scenes: how obstacles are written, where they are at a time, how fast they are, what is refused."""

from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from fzcli.errors import SpecError
from fzcli.model.collision import obstacle_numbers, quaternion_from_rpy
from fzcli.plan.quaternions import exponential, product, rotations
from fzcli.plan.scene import Obstacle, build_scene
from fzcli.spec.parse import parse
from fzcli.spec.physics import rotation_of
from fzcli.spec.reader import read_text

SCENE = """
- sphere: {center: [0.338, 0, 345 mm], radius: 50 mm}
- name: strut
  capsule: {from: [0, 0, 0], to: [0, 0, 1], radius: 0.1}
  velocity: [10 cm/s, 0, 0]
  spin: [90 deg/s, 0, 0]
- box: {center: [1, 0, 0], size: [2, 1, 0.02], rpy: [0, 0, 90 deg]}
  spin: [0, 0, 90 deg/s]
- sphere: {radius: 0.2}
  waypoints: {times: [1, 2, 4], positions: [[0, 0, 0], [1, 0, 0], [1, 1, 0]]}
"""


def read(text: str) -> tuple[Obstacle, ...]:
    found: Any = parse(read_text(text, "scene.yaml"), tuple[Obstacle, ...])  # type: ignore[arg-type]
    return tuple(found)


def test_obstacles_move_as_written() -> None:
    scene = build_scene(read(SCENE))
    assert scene.kinds == ("sphere", "capsule", "box", "sphere")
    assert scene.names == ("sphere 1", "strut", "box 3", "sphere 4")
    assert scene.moving
    numbers = scene.numbers([0, 1, 3])
    np.testing.assert_allclose(numbers[:, :4], np.tile([0.338, 0, 0.345, 0.05], (3, 1)))
    np.testing.assert_allclose(numbers[0, 4:11], [0, 0, 0, 0, 0, 1, 0.1], atol=1e-15)
    # a quarter turn about x lays the strut along -y
    np.testing.assert_allclose(numbers[1, 4:11], [0.1, 0.5, 0.5, 0.1, -0.5, 0.5, 0.1], atol=1e-15)
    np.testing.assert_allclose(numbers[1, 11:14], [1, 0, 0])
    np.testing.assert_allclose(np.abs(numbers[1, 14:18]), np.abs(quaternion_from_rpy((0, 0, np.pi))), atol=1e-15)
    np.testing.assert_allclose(numbers[:, -4:], [[0, 0, 0, 0.2], [0, 0, 0, 0.2], [1, 0.5, 0, 0.2]])
    assert numbers.shape == (3, 4 + 7 + 10 + 4)


def test_speeds_and_their_bounds() -> None:
    _, strut, panel, ball = read(SCENE)
    np.testing.assert_allclose(strut.velocity_at([0, 5]), [[0.1, 0, 0]] * 2)
    assert strut.speed_bound(0, 1) == pytest.approx(0.1 + np.pi / 2 * 0.5)
    assert panel.speed_bound(0, 1) == pytest.approx(np.pi / 2 * np.linalg.norm([2, 1, 0.02]) / 2)
    np.testing.assert_allclose(
        ball.velocity_at([0, 1, 1.5, 2, 4]),
        [[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0.5, 0], [0, 0, 0]],
    )
    bounds = [ball.speed_bound(*times) for times in ((0, 1), (0, 1.1), (1.9, 2.1), (2, 3), (4, 9))]
    assert bounds == [0, 1, 1, 0.5, 0]


def test_no_point_is_faster_than_the_bound() -> None:
    rng = np.random.default_rng(20)
    for obstacle in read(SCENE):
        for _ in range(200):
            begin = rng.uniform(0, 5)
            end = begin + 10 ** rng.uniform(-4, -1)
            early, late = obstacle.numbers([begin, end])
            way = np.linalg.norm((late - early)[:3])
            if obstacle.kind == "capsule":
                way = max(way, np.linalg.norm((late - early)[3:6]))
            assert way <= obstacle.speed_bound(begin, end) * (end - begin) + 1e-12


def test_rotations_agree() -> None:
    rng = np.random.default_rng(21)
    for _ in range(20):
        rpy = rng.uniform(-3, 3, 3)
        w, x, y, z = quaternion_from_rpy(rpy)
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        np.testing.assert_allclose(np.eye(3) + 2 * w * skew + 2 * skew @ skew, rotation_of(rpy), atol=1e-14)
        np.testing.assert_allclose(rotations(np.array([w, x, y, z])), rotation_of(rpy), atol=1e-14)
    quarter = exponential(np.array([[0, 0, np.pi / 2], [0, 0, 0]]))
    np.testing.assert_allclose(rotations(quarter)[0], rotation_of((0, 0, np.pi / 2)), atol=1e-15)
    np.testing.assert_allclose(quarter[1], [1, 0, 0, 0])
    one, other = exponential(rng.normal(size=(2, 9, 3)))
    np.testing.assert_allclose(rotations(product(one, other)), rotations(one) @ rotations(other), atol=1e-14)


def test_an_empty_scene() -> None:
    scene = build_scene([])
    assert scene.numbers([0.0, 1.0]).shape == (2, 0)
    assert scene.speed_bounds(0, 1).shape == (0,)
    assert not scene.moving


def test_numbers_of_a_standing_solid_are_those_of_its_shape() -> None:
    for obstacle in read(SCENE)[:3]:
        np.testing.assert_allclose(obstacle.numbers([0.0])[0], obstacle_numbers(obstacle), atol=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "- sphere: {center: [0, 0, 0], radius: -50 mm}",
            "scene.yaml:1:39: 0.sphere.radius: must be > 0, got '-50 mm'",
        ),
        ("- {name: a, velocity: [1, 0, 0]}", "needs one of sphere, capsule and box"),
        (
            "- {sphere: {radius: 1}, velocity: [1, 0, 0], waypoints: {times: [0], positions: [[0, 0, 0]]}}",
            "give velocity or waypoints, not both",
        ),
        (
            "- {sphere: {radius: 1}, waypoints: {times: [0, 1], positions: [[0, 0, 0]]}}",
            "positions has 1 entries for 2 times",
        ),
        (
            "- {sphere: {radius: 1}, waypoints: {times: [1, 1], positions: [[0, 0, 0], [1, 1, 1]]}}",
            "times must increase",
        ),
        ("- {sphere: {radius: 1}, velocity: [1 m, 0, 0]}", "'1 m' is a length; a speed is wanted, e.g. '50 mm/s'"),
        ("- {cylinder: {radius: 1}}", "unknown key"),
    ],
)
def test_what_is_refused(text: str, message: str) -> None:
    with pytest.raises(SpecError) as caught:
        read(text)
    assert message in str(caught.value)


def test_two_obstacles_of_one_name() -> None:
    ball = {"sphere": {"radius": 1}, "name": "ball"}
    two = TypeAdapter(tuple[Obstacle, ...]).validate_python([ball, ball])
    with pytest.raises(ValueError, match="two obstacles are called 'ball'"):
        build_scene(two)
