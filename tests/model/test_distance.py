"""Signed distances against coal on random pairs, in contact and apart, and their gradients."""

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.model.distance import Ball, Box, Capsule, Solid, point_box, segment_box, segment_segment, signed_distance

Array = NDArray[np.float64]
PAIRS = 10_000
SIZES = {"ball": 4, "capsule": 7, "box": 15}


def solid(kind: str, numbers: ca.SX) -> Solid:
    if kind == "ball":
        return Ball(numbers[:3], numbers[3])
    if kind == "capsule":
        return Capsule(numbers[:3], numbers[3:6], numbers[6])
    return Box(ca.reshape(numbers[6:15], 3, 3), numbers[:3], numbers[3:6])


def function(one: str, other: str) -> ca.Function:
    a, b = ca.SX.sym("a", SIZES[one]), ca.SX.sym("b", SIZES[other])
    distance = signed_distance(solid(one, a), solid(other, b))
    return ca.Function("distance", [a, b], [distance, ca.gradient(distance, ca.vertcat(a, b))])


def turn(rng: np.random.Generator) -> Array:
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return np.asarray(q * np.sign(np.linalg.det(q)))


def drawn(kind: str, rng: np.random.Generator) -> Array:
    center = rng.normal(size=3) * 10 ** rng.uniform(-1.5, 0.1)
    if kind == "ball":
        return np.array([*center, rng.uniform(0.01, 0.4)])
    if kind == "capsule":
        way = np.where(rng.random(3) < 0.3, 0, rng.normal(size=3))
        way = way / np.linalg.norm(way) if way.any() else np.eye(3)[0]
        return np.array([*center, *(center + way * 10 ** rng.uniform(-2, 0.2)), rng.uniform(0.01, 0.3)])
    rotation = turn(rng) if rng.random() < 0.8 else np.eye(3)
    return np.array([*center, *rng.uniform(0.01, 0.6, 3), *rotation.T.ravel()])


def in_coal(kind: str, numbers: Array) -> tuple[object, object]:
    import coal

    if kind == "ball":
        return coal.Sphere(numbers[3]), coal.Transform3s(np.eye(3), numbers[:3])
    if kind == "box":
        return coal.Box(*(2 * numbers[3:6])), coal.Transform3s(numbers[6:].reshape(3, 3).T, numbers[:3])
    start, end = numbers[:3], numbers[3:6]
    length = np.linalg.norm(end - start)
    z = (end - start) / length
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    frame = np.column_stack([x, np.cross(z, x), z])
    return coal.Capsule(numbers[6], length), coal.Transform3s(frame, (start + end) / 2)


def by_coal(one: str, a: Array, other: str, b: Array) -> float:
    import coal

    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    return float(coal.distance(*in_coal(one, a), *in_coal(other, b), request, coal.DistanceResult()))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("ball", "ball"),
        ("ball", "capsule"),
        ("ball", "box"),
        ("capsule", "capsule"),
        ("capsule", "box"),
        ("box", "box"),
    ],
)
def test_coal_finds_the_same_distances_and_depths(one: str, other: str) -> None:
    pytest.importorskip("coal")
    rng = np.random.default_rng([1, SIZES[one], SIZES[other]])
    pairs = [(drawn(one, rng), drawn(other, rng)) for _ in range(PAIRS)]
    a, b = (np.array(side).T for side in zip(*pairs, strict=True))
    distances, gradients = (np.array(out) for out in function(one, other)(a, b))
    expected = np.array([by_coal(one, x, other, y) for x, y in pairs])
    touching = np.count_nonzero(expected < 0) / PAIRS
    assert 0.05 < touching < 0.95  # both cases are met
    difference = np.abs(distances[0] - expected)
    # coal iterates (GJK, EPA): its own tolerance is 1e-6, almost always kept far below
    assert difference.max() < 2e-6
    assert np.quantile(difference, 0.999) < 2e-12
    assert np.isfinite(gradients).all()


@pytest.mark.parametrize(
    ("one", "other"), [("ball", "capsule"), ("ball", "box"), ("capsule", "capsule"), ("capsule", "box")]
)
def test_gradients_are_those_of_finite_differences(one: str, other: str) -> None:
    rng = np.random.default_rng([2, SIZES[one], SIZES[other]])
    f = function(one, other)
    size = SIZES[one] + SIZES[other]
    kinks = 0  # where two features are equally near, only one-sided slopes exist
    for _ in range(300):
        x = np.concatenate([drawn(one, rng), drawn(other, rng)])
        gradient = np.array(f(x[: SIZES[one]], x[SIZES[one] :])[1]).ravel()
        left, right = (_slopes(f, x, sign * 1e-7, SIZES[one]) for sign in (-1, 1))
        assert gradient.shape == (size,)
        if np.allclose(left, right, atol=1e-5):
            np.testing.assert_allclose(gradient, (left + right) / 2, atol=1e-5)
        else:
            kinks += 1
            assert (np.abs(gradient) <= np.maximum(np.abs(left), np.abs(right)) + 1).all()
    assert kinks < 30


def _slopes(f: ca.Function, x: Array, step: float, cut: int) -> Array:
    moved = x[:, None] + step * np.eye(len(x))
    values = np.array(f(moved[:cut], moved[cut:])[0]).ravel()
    return np.asarray((values - float(f(x[:cut], x[cut:])[0])) / step)


def point(*numbers: float) -> ca.SX:
    return ca.SX(ca.DM(numbers))


HALF = (0.3, 0.2, 0.1)


@pytest.mark.parametrize(
    ("start", "end", "expected"),
    [
        ((0.5, 0, 0), (0.5, 0, 0), 0.2),  # a point
        ((0.6, 0.6, 0.6), (0.6, 0.6, 0.6), np.sqrt(0.3**2 + 0.4**2 + 0.5**2)),
        ((-1, 0, 0.25), (1, 0, 0.25), 0.15),  # parallel to a face, over it
        ((-1, 0, 0.1), (1, 0, 0.1), 0),  # in the plane of a face
        ((0, 0, -1), (0, 0, 1), -0.2),  # pierces it: the shortest way out is sideways
        ((-1, 0, 0), (1, 0, 0), -0.1),
        ((0, 0, 0), (0, 0, 0), -0.1),
        ((0.3, 0.2, 0.1), (1, 1, 1), 0),  # starts in a corner
        ((0.2, 0.5, -1), (0.2, 0.5, 1), 0.3),  # beside an edge, along it
    ],
)
def test_segments_and_boxes_in_special_positions(
    start: tuple[float, ...], end: tuple[float, ...], expected: float
) -> None:
    a, b = ca.SX.sym("a", 3), ca.SX.sym("b", 3)
    distance = segment_box(a, b, point(*HALF))
    f = ca.Function("f", [a, b], [distance, ca.gradient(distance, ca.vertcat(a, b))])
    value, gradient = f(start, end)
    assert float(value) == pytest.approx(expected, abs=2e-12)
    assert float(f(end, start)[0]) == pytest.approx(expected, abs=2e-12)
    assert np.isfinite(np.array(gradient)).all()
    assert float(ca.norm_2(gradient)) < 2


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-200, 1e-16, 1e-12, 1e-9, 1e-8, 1e-7, 1e-5, 1e-3])
@pytest.mark.parametrize("gap", [0.0, 1e-9, 0.1])
def test_segments_that_are_parallel_or_nearly_so(angle: float, gap: float) -> None:
    a, b, c, d = (ca.SX.sym(name, 3) for name in "abcd")
    distance = segment_segment(a, b, c, d)
    f = ca.Function("f", [a, b, c, d], [distance, ca.gradient(distance, ca.vertcat(a, b, c, d))])
    value, gradient = f((-1, 0, 0), (1, 0, 0), (-1, -angle, gap), (1, angle, gap))
    assert float(value) == pytest.approx(gap, abs=2e-8)
    assert np.isfinite(np.array(gradient)).all()
    assert float(ca.norm_2(gradient)) < 2.0001  # no point counts for more than its own motion
    if gap == 0.1:
        assert float(value) == pytest.approx(gap, abs=1e-14)


def test_points_and_boxes() -> None:
    f = ca.Function("f", [p := ca.SX.sym("p", 3)], [point_box(p, point(*HALF))])
    for where, expected in (((0, 0, 0), -0.1), ((0.25, 0, 0), -0.05), ((0.3, 0, 0), 0), ((0.3, 0.5, 0.5), 0.5)):
        assert float(f(where)) == pytest.approx(expected, abs=2e-14)


def test_the_order_of_two_solids_does_not_matter() -> None:
    rng = np.random.default_rng(3)
    for one, other in (("ball", "box"), ("capsule", "box"), ("ball", "capsule"), ("box", "box")):
        f, g = function(one, other), function(other, one)
        for _ in range(50):
            a, b = drawn(one, rng), drawn(other, rng)
            assert float(f(a, b)[0]) == pytest.approx(float(g(b, a)[0]), abs=1e-13)


def test_a_moved_solid_changes_no_distance_by_more_than_it_moved() -> None:
    rng = np.random.default_rng(4)
    f = function("capsule", "box")
    for _ in range(2000):
        a, b = drawn("capsule", rng), drawn("box", rng)
        moved = a.copy()
        moved[:6] += rng.normal(size=6) * 10 ** rng.uniform(-4, 0)
        way = max(np.linalg.norm((moved - a)[:3]), np.linalg.norm((moved - a)[3:6]))
        assert abs(float(f(a, b)[0]) - float(f(moved, b)[0])) <= way + 1e-13
