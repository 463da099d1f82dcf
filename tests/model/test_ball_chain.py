"""FABRIK for ball joints: printed numbers, laws on random chains and trees, and honest refusals."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fzcli.errors import SpecError
from fzcli.model.ball_chain import Solution, iterate, solve
from fzcli.model.ball_tree import BallTree
from fzcli.model.joint_cone import Array, Cone, angle_between, onto_cone, unit
from tests.oracle.fabrik_points import classic_fabrik, classic_iteration

STRAIGHT = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]
ELBOW = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.1]]


def laid(
    root: Array, lengths: Array, draw: np.random.Generator, cone: float = math.pi, axis: Array | None = None
) -> Array:
    """A random chain (n+1, d): each link within ``cone`` of the one before, the first of ``axis``."""
    heading, points = axis, [root]
    for length in lengths:
        along = unit(draw.standard_normal(len(root)))
        heading = along if heading is None else onto_cone(along, heading, cone)
        points.append(points[-1] + length * heading)
    return np.array(points)


def random_chain(draw: np.random.Generator, d: int) -> tuple[BallTree, Array]:
    """A chain of 2 to 30 links in d dimensions, and a target that it can reach."""
    root, lengths = draw.standard_normal(d), draw.uniform(0.2, 1.5, int(draw.integers(2, 31)))
    return BallTree.chain(laid(root, lengths, draw)), laid(root, lengths, draw)[-1]


def random_tree(draw: np.random.Generator, d: int) -> tuple[BallTree, dict[str, Array]]:
    """A tree of 4 to 14 points whose leaves are all tips, and targets it can reach together."""
    k = int(draw.integers(4, 15))
    parents = (-1, *(int(draw.integers(max(0, j - 4), j)) for j in range(1, k)))
    lengths, poses = draw.uniform(0.2, 1.5, k), []
    for _ in range(2):
        points = np.zeros((k, d))
        for j in range(1, k):
            points[j] = points[parents[j]] + lengths[j] * unit(draw.standard_normal(d))
        poses.append(points)
    tips = {f"leaf {j}": j for j in range(k) if j not in parents}
    return BallTree(poses[0], parents, tips), {tip: poses[1][j] for tip, j in tips.items()}


def coned_chain(draw: np.random.Generator, d: int, half_angle: float) -> tuple[BallTree, Array]:
    """A chain of 2 to 15 links with a cone at each joint, and a target that it can reach within them."""
    root, lengths = draw.standard_normal(d), draw.uniform(0.2, 1.5, int(draw.integers(2, 16)))
    axis = unit(draw.standard_normal(d))
    cones = {j: Cone(half_angle) for j in range(1, len(lengths))} | {0: Cone(half_angle, tuple(axis))}
    start = laid(root, lengths, draw)  # need not obey the cones
    return BallTree.chain(start, cones=cones), laid(root, lengths, draw, half_angle, axis)[-1]


def check_laws(tree: BallTree, points: Array) -> None:
    """Lengths kept, roots fixed, cones obeyed."""
    for joint, parent in enumerate(tree.parents):
        if parent == -1:
            assert np.array_equal(points[joint], tree.points[joint])
            continue
        link = points[joint] - points[parent]
        assert np.linalg.norm(link) == pytest.approx(tree.lengths[joint], rel=1e-12)
        if (cone := tree.cones.get(parent)) is not None:
            before = tree.parents[parent]
            axis = np.array(cone.axis, dtype=float) if before == -1 else points[parent] - points[before]
            assert angle_between(unit(link), unit(axis)) <= cone.half_angle + 1e-9


def solved(tree: BallTree, targets: dict[str, Array], **settings: float) -> Solution:
    solution = solve(tree, targets, **settings)
    check_laws(tree, solution.points)
    for tip, target in targets.items():
        assert solution.residuals[tip] == math.dist(solution.points[tree.tips[tip]], target)
    assert solution.converged == (max(solution.residuals.values()) <= settings.get("tolerance", 1e-6))
    assert bool(solution.reason) != solution.converged
    return solution


def test_the_published_iterates() -> None:
    tree, target = BallTree.chain(STRAIGHT), {"tip": (1.5, 1.5)}
    once = iterate(tree, tree.points, target)
    expected = [[0.999964, -0.008515], [1.824642, 0.557087], [1.4991, 1.502615]]
    np.testing.assert_allclose(once[1:], expected, atol=5e-7)
    assert math.dist(once[-1], (1.5, 1.5)) == pytest.approx(2.7656e-3, abs=5e-8)
    twice = iterate(tree, once, target)
    assert math.dist(twice[-1], (1.5, 1.5)) == pytest.approx(1.304e-4, abs=5e-8)
    assert np.array_equal(solve(tree, target, tolerance=1e-3).points, twice)


@pytest.mark.parametrize("d", [2, 3])
def test_every_reachable_target_of_a_free_chain_is_reached(d: int) -> None:
    draw = np.random.default_rng(d)
    for _ in range(250):
        tree, target = random_chain(draw, d)
        assert solved(tree, {"tip": target}).converged


@pytest.mark.parametrize("d", [2, 3])
def test_a_free_chain_iterates_as_the_reference_does_and_never_gets_worse(d: int) -> None:
    draw = np.random.default_rng(10 + d)
    for _ in range(40):
        tree, target = random_chain(draw, d)
        target = target + draw.choice([0.0, 5.0]) * draw.standard_normal(d)  # beyond reach too
        points = tree.points
        for _ in range(15):
            before = math.dist(points[-1], target)
            expected = classic_iteration(points, np.array(tree.lengths[1:]), target)
            points = iterate(tree, points, {"tip": target})
            np.testing.assert_allclose(points, expected, atol=1e-9)
            assert math.dist(points[-1], target) <= before + 1e-14


def test_the_solver_agrees_with_the_reference_wherever_it_needs_no_help() -> None:
    draw, compared = np.random.default_rng(4), 0
    for i in range(100):
        tree, target = random_chain(draw, 2 + i % 2)
        solution, expected = solve(tree, {"tip": target}), classic_fabrik(tree.points, target, 1e-6, 1000)
        if solution.leaps == solution.nudges == 0:
            assert solution.iterations == expected.iterations
            np.testing.assert_allclose(solution.points, expected.points, atol=1e-8)
            compared += 1
    assert compared >= 80


def test_leaps_reach_what_plain_iterations_do_not() -> None:
    tree, target = BallTree.chain([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0]]), np.array([1.9999, 0.0])
    assert classic_fabrik(tree.points, target, 1e-6, 5000).error > 1e-6
    solution = solved(tree, {"tip": target})
    assert solution.converged
    assert solution.leaps > 0
    assert solution.iterations < 200


@pytest.mark.parametrize(("half_angle", "at_least"), [(0.3, 0.9), (1.0, 0.95), (3.0, 1.0)])
def test_cones_are_obeyed_and_most_targets_reached(half_angle: float, at_least: float) -> None:
    draw, reached, count = np.random.default_rng(5), 0, 30
    for i in range(count):
        tree, target = coned_chain(draw, 2 + i % 2, half_angle)
        reached += solved(tree, {"tip": target}, limit=400).converged
        far = solved(tree, {"tip": target + 100.0}, limit=60)
        assert far.reason.startswith("out of reach by ")
    assert reached >= at_least * count


def test_a_cone_at_a_branch_holds_every_outgoing_link() -> None:
    tree = BallTree(
        [[0, 0, 0], [0, 0, 1], [0.1, 0, 2], [-0.1, 0, 2]],
        (-1, 0, 1, 1),
        {"left": 2, "right": 3},
        {1: Cone(0.4), 0: Cone(0.2, (0.0, 0.0, 2.0))},
    )
    solution = solved(tree, {"left": np.array([2.0, 0, 0]), "right": np.array([-2.0, 0, 0])})
    assert not solution.converged
    for tip in (2, 3):
        assert angle_between(
            *(unit(np.diff(solution.points[[0, 1, tip]], axis=0)[i]) for i in (0, 1))
        ) == pytest.approx(0.4)


@pytest.mark.parametrize("d", [2, 3])
def test_trees_with_several_targets(d: int) -> None:
    draw, reached, count = np.random.default_rng(6 + d), 0, 40
    for _ in range(count):
        tree, targets = random_tree(draw, d)
        reached += solved(tree, targets, tolerance=1e-3).converged
    assert reached >= 0.95 * count


def test_mirrored_arms_end_mirrored() -> None:
    points = [[0, 0], [1, 0], [1.5, 0.5], [2, 1.5], [1.5, -0.5], [2, -1.5]]
    tree = BallTree(points, (-1, 0, 1, 2, 1, 4), {"up": 3, "down": 5})
    solution = solved(tree, {"up": np.array([1.2, 1.3]), "down": np.array([1.2, -1.3])})
    assert solution.converged
    np.testing.assert_array_equal(solution.points[2:4] * [1, -1], solution.points[4:])
    np.testing.assert_array_equal(solution.points[:2, 1], 0.0)


def test_the_order_of_tips_and_points_does_not_matter() -> None:
    draw, compared = np.random.default_rng(7), 0
    for i in range(20):
        tree, targets = random_tree(draw, 2 + i % 2)
        new = draw.permutation(len(tree.points))  # old index -> new index
        old = np.argsort(new)
        tips = {tip: int(new[j]) for tip, j in reversed(list(tree.tips.items()))}
        parents = tuple(int(new[p]) if (p := tree.parents[j]) >= 0 else -1 for j in old)
        one = solve(tree, targets, limit=40)
        two = solve(BallTree(tree.points[old], parents, tips), dict(reversed(list(targets.items()))), limit=40)
        if one.nudges == two.nudges == 0:
            np.testing.assert_array_equal(one.points, two.points[new])
            compared += 1
    assert compared >= 15


def test_a_tip_without_target_follows_and_another_root_rests() -> None:
    points = [[0, 0], [1, 0], [2, 0.2], [1, 1], [9, 9], [9, 8]]
    tree = BallTree(points, (-1, 0, 1, 1, -1, 4), {"hand": 2, "tail": 3, "other": 5})
    solution = solved(tree, {"hand": np.array([0.5, 1.2])})
    assert solution.converged
    assert math.dist(solution.points[3], points[3]) > 0.1
    np.testing.assert_allclose(solution.points[4:], points[4:], atol=1e-15)
    both = solved(tree, {"hand": np.array([0.5, 1.2]), "other": np.array([20.0, 9.0])})
    assert both.residuals["hand"] <= 1e-6
    assert (
        both.reason
        == "out of reach by 10 m: the target of tip 'other' is 11 m from its root, and its links span at most 1 m"
    )


def test_conflicting_targets_end_with_an_honest_residual() -> None:
    tree = BallTree([[0, 0], [0, 1], [-0.6, 1.8], [0.6, 1.8]], (-1, 0, 1, 1), {"left": 2, "right": 3})
    solution = solved(tree, {"left": np.array([-1.5, 1.0]), "right": np.array([1.5, 1.0])})
    assert not solution.converged
    assert solution.residuals == pytest.approx({"left": 0.5, "right": 0.5}, abs=1e-3)
    assert solution.reason == (
        "out of reach by 1 m: the targets of tips 'left' and 'right' are 3 m apart, "
        "and the links between span at most 2 m"
    )
    assert solution.misses[0].tips == ("left", "right")
    assert solution.misses[0].missing == pytest.approx(1.0)


def test_a_target_too_far_gets_the_chain_straight_at_it() -> None:
    solution = solved(BallTree.chain(STRAIGHT), {"tip": np.array([0.0, 4.5])})
    np.testing.assert_allclose(solution.points, [[0, 0], [0, 1], [0, 2], [0, 3]], atol=1e-15)
    assert solution.residuals["tip"] == pytest.approx(1.5)
    assert solution.reason == (
        "out of reach by 1.5 m: the target of tip 'tip' is 4.5 m from its root, and its links span at most 3 m"
    )
    edge = solved(BallTree.chain(STRAIGHT), {"tip": np.array([0.0, 3.0])})
    assert edge.converged
    assert edge.iterations == 0


def test_a_target_too_near_a_long_link_is_refused_by_the_hole() -> None:
    tree = BallTree.chain([[0, 0, 0], [0.5, 0, 0], [3.5, 0, 0], [3.5, 0.7, 0]])
    solution = solved(tree, {"tip": np.array([0.0, 0.0, 1.0])})
    assert solution.residuals["tip"] == pytest.approx(0.8)
    assert solution.reason == (
        "out of reach by 0.8 m: the target of tip 'tip' is 1 m from its root, and its links span at least 1.8 m"
    )
    assert solved(tree, {"tip": np.zeros(3)}).residuals["tip"] == pytest.approx(1.8)
    assert solved(tree, {"tip": np.array([0.0, 1.8, 0.0])}).converged


@pytest.mark.parametrize("d", [2, 3])
def test_a_straight_chain_with_its_target_on_the_line_is_nudged_off_it(d: int) -> None:
    tree = BallTree.chain(np.pad(np.array(STRAIGHT), ((0, 0), (0, d - 2))))
    target = np.array([1.5, *[0.0] * (d - 1)])
    assert classic_fabrik(tree.points, target, 1e-6, 1000).error > 0.1
    solution = solved(tree, {"tip": target})
    assert solution.converged
    assert solution.nudges > 0
    assert np.array_equal(solve(tree, {"tip": target}).points, solution.points)
    assert not np.array_equal(solve(tree, {"tip": target}, seed=1).points, solution.points)


def test_the_limit_and_a_stall_are_reasons() -> None:
    short = solved(BallTree.chain(STRAIGHT), {"tip": np.array([1.5, 1.5])}, limit=1)
    assert short.reason == (
        "iteration limit reached: tip 'tip' is 0.00276562 m off its target (iterations: 1, nudges: 0)"
    )
    stiff = BallTree.chain(ELBOW, cones={0: Cone(0.1, (1.0, 0.0)), 1: Cone(0.1)})
    stalled = solved(stiff, {"tip": np.array([-1.0, 0.5])})
    assert stalled.reason.startswith("stalled: tip 'tip' is ")
    assert stalled.reason.endswith(", nudges: 15)")


def test_links_of_no_length_and_points_that_meet_do_no_harm() -> None:
    tree = BallTree.chain([[0, 0], [1, 0], [1, 0], [0, 0], [1, 0]])
    assert solved(tree, {"tip": np.array([0.3, 1.4])}).converged
    assert solved(BallTree.chain([[0, 0], [1, 0], [0, 0]]), {"tip": np.array([0.0, 1.0])}).converged


def test_a_tip_on_its_target_is_left_as_it_is() -> None:
    tree = BallTree.chain(ELBOW)
    solution = solved(tree, {"tip": np.array(ELBOW[-1])})
    assert solution.iterations == 0
    assert np.array_equal(solution.points, ELBOW)


@given(arrays(float, (2, 3), elements=st.floats(-1, 1)), st.floats(1e-6, math.pi))
def test_a_direction_outside_a_cone_lands_on_it(pair: Array, half_angle: float) -> None:
    axis, direction = unit(pair[0], np.array([1.0, 0, 0])), unit(pair[1], np.array([0, 1.0, 0]))
    for given_direction in (direction, -axis):
        angle, turned = angle_between(given_direction, axis), onto_cone(given_direction, axis, half_angle)
        assert angle_between(turned, axis) == pytest.approx(min(angle, half_angle), abs=1e-9)
        assert angle_between(turned, given_direction) == pytest.approx(max(angle - half_angle, 0.0), abs=1e-7)


BAD_TREES = [
    (([[0, 0], [1, math.nan]], (-1, 0), {"tip": 1}), r"points\[1\]: must be finite, got \[1.0, nan\]"),
    (([[0], [1]], (-1, 0), {"tip": 1}), r"points: must be \(k, 2\) or \(k, 3\), got shape \(2, 1\)"),
    (([[0, 0], [1]], (-1, 0), {"tip": 1}), "points: must be an array of k points in 2 or 3 dimensions"),
    ((ELBOW, (-1, 0), {"tip": 2}), "parents: must give one index for each of the 3 points, got 2"),
    ((ELBOW, (-1, 0, 7), {"tip": 2}), r"parents\[2\]: must be the index of a point, 0 to 2, or -1 for a root, got 7"),
    ((ELBOW, (-1, 2, 1), {"tip": 2}), r"parents: points \[1, 2\] hang on no root: their links form a ring"),
    ((ELBOW, (-1, 0, 1), {}), "tips: at least one tip is needed"),
    ((ELBOW, (-1, 0, 1), {"tip": 3}), "tips.tip: must be the index of a point, 0 to 2, got 3"),
    ((ELBOW, (-1, 0, 1), {"tip": 1}), "tips.tip: point 1 has outgoing links: a tip ends its chain"),
    ((ELBOW, (-1, 0, 1), {"a": 2, "b": 2}), "tips: two tips share one point"),
    (([[0, 0]], (-1,), {"tip": 0}), "tips.tip: point 0 is a root and cannot move"),
]


@pytest.mark.parametrize(("parts", "text"), BAD_TREES)
def test_a_bad_tree_is_refused(parts: tuple[Array, tuple[int, ...], dict[str, int]], text: str) -> None:
    with pytest.raises(SpecError, match=f"^{text}$"):
        BallTree(*parts)


BAD_CONES = [
    ({1: Cone(0.0)}, r"cones\[1\]: half_angle must be above 0 and at most pi rad, got 0.0"),
    ({1: Cone(3.2)}, r"cones\[1\]: half_angle must be above 0 and at most pi rad, got 3.2"),
    ({1: Cone(math.nan)}, r"cones\[1\]: half_angle must be above 0 and at most pi rad, got nan"),
    ({9: Cone(1.0)}, r"cones\[9\]: names no joint: must be 0 to 3"),
    ({3: Cone(1.0)}, r"cones\[3\]: has no outgoing link to limit"),
    ({1: Cone(1.0, (1, 0))}, r"cones\[1\]: axis belongs to roots only: here the incoming link is the axis"),
    ({0: Cone(1.0)}, r"cones\[0\]: a root's cone needs an axis of 2 finite numbers, not all zero, got None"),
    ({0: Cone(1.0, (0, 0))}, r"cones\[0\]: a root's cone needs an axis of 2 finite numbers, .* got \(0, 0\)"),
]


@pytest.mark.parametrize(("cones", "text"), BAD_CONES)
def test_a_bad_cone_is_refused(cones: dict[int, Cone], text: str) -> None:
    with pytest.raises(SpecError, match=f"^{text}$"):
        BallTree.chain(STRAIGHT, cones=cones)


def test_a_cone_needs_links_with_directions_and_every_problem_is_told() -> None:
    with pytest.raises(SpecError) as caught:
        BallTree.chain([[0, 0], [1, 0], [1, 0], [2, 0]], cones={1: Cone(1.0), 2: Cone(1.0)})
    assert [str(problem) for problem in caught.value.problems] == [
        "cones[1]: its link to point 2 has length 0 and no direction",
        "cones[2]: its incoming link has length 0, so the cone has no axis",
    ]


BAD_CALLS = [
    ({"targets": {}}, "targets: at least one target is needed; tips: left hand"),
    ({"targets": {"lefthand": (1, 1)}}, "targets.lefthand: no such tip; did you mean 'left hand'[?]"),
    ({"targets": {"left hand": (1, 1, 1)}}, r"targets.left hand: must be 2 finite numbers, .* got \(1, 1, 1\)"),
    ({"targets": {"left hand": (1, math.nan)}}, r"targets.left hand: must be 2 finite numbers, .* got \(1, nan\)"),
    ({"targets": {"left hand": "up"}}, "targets.left hand: must be 2 finite numbers, .* got 'up'"),
    ({"tolerance": 0.0}, "tolerance: must be above 0 m and finite, got 0.0"),
    ({"tolerance": math.nan}, "tolerance: must be above 0 m and finite, got nan"),
    ({"limit": 0}, "limit: must be at least 1, got 0"),
]


@pytest.mark.parametrize(("changes", "text"), BAD_CALLS)
def test_a_bad_call_is_refused(changes: dict[str, object], text: str) -> None:
    tree = BallTree.chain(ELBOW, tip="left hand")
    with pytest.raises(SpecError, match=f"^{text}$"):
        solve(tree, **({"targets": {"left hand": (1.0, 1.0)}} | changes))  # type: ignore[arg-type]


def test_iterate_refuses_points_of_another_tree() -> None:
    with pytest.raises(SpecError, match=r"points: must be finite and of shape \(3, 2\), got shape \(4, 2\)"):
        iterate(BallTree.chain(ELBOW), STRAIGHT, {"tip": (1.0, 1.0)})
