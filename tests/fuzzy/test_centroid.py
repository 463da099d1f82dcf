"""The closed-form centroid against an exact integration of the polygon over x."""

import casadi as ca
import numpy as np
import pytest
from fuzzy_cases import small, term

from fzcli.errors import SpecError
from fzcli.fuzzy.centroid import centroid_sums, order
from fzcli.fuzzy.check import method
from fzcli.fuzzy.surface import build_surface
from fzcli.spec.rulebase import Centroid, Output


def height(sets, firings, x):
    """max_k min(firing_k, trapezoid_k) at points x, straight from the definition."""
    y = np.zeros_like(x)
    for (a, b, c, d), firing in zip(sets, firings, strict=True):
        rise = np.where(x < b, (x - a) / (b - a) if b > a else 0.0, 1.0)
        fall = np.where(x > c, (d - x) / (d - c) if d > c else 0.0, 1.0)
        y = np.maximum(y, np.clip(np.minimum(rise, fall), 0.0, firing))
    return y


def polygon_centroid(sets, firings):
    """Centroid by two-point Gauss sums between all crossings of all sides: exact for the polygon."""
    lines = [(0.0, firing) for firing in firings]  # y = slope x + offset
    for a, b, c, d in sets:
        lines += [(1 / (b - a), -a / (b - a))] if b > a else []
        lines += [(-1 / (d - c), d / (d - c))] if d > c else []
    slopes, offsets = np.array(lines).T
    i, j = np.triu_indices(len(lines), 1)
    apart = slopes[i] != slopes[j]
    crossings = (offsets[j] - offsets[i])[apart] / (slopes[i] - slopes[j])[apart]
    corners = np.unique(np.concatenate([np.ravel(sets), crossings]))
    corners = corners[(corners >= np.min(sets)) & (corners <= np.max(sets))]
    middle, half = (corners[1:] + corners[:-1]) / 2, np.diff(corners) / 2
    nodes = np.concatenate([middle - half / np.sqrt(3), middle + half / np.sqrt(3)])
    y = height(sets, firings, nodes) * np.tile(half, 2)
    return float(np.dot(nodes, y) / np.sum(y))


def random_sets(rng):
    """One to six trapezoids with ordered corners; on a coarse grid, so that sides coincide and stand."""
    count = rng.integers(1, 7)
    grid = rng.integers(0, 12, (count, 4)) / 4 if rng.random() < 0.6 else rng.uniform(-3, 3, (count, 4))
    sets = np.sort(np.sort(grid, axis=1), axis=0)
    return sets if np.all(sets[:, 3] > sets[:, 0]) else random_sets(rng)


def test_closed_form_equals_polygon_integration():
    rng = np.random.default_rng(2011)
    for _ in range(400):
        sets = random_sets(rng)
        levels = ca.SX.sym("levels", len(sets))
        sums = centroid_sums([tuple(row) for row in sets], ca.vertsplit(levels))
        function = ca.Function("sums", [levels], list(sums))
        for _ in range(4):
            firings = rng.random(len(sets)) * (rng.random(len(sets)) < 0.8)
            if firings.max() > 0.0:
                moment, area = map(float, function(firings))
                assert area > 0.0
                assert moment / area == pytest.approx(polygon_centroid(sets, firings), rel=0, abs=1e-10)


def test_equal_sets_count_once():
    sums = centroid_sums([(0.0, 1.0, 2.0, 4.0)] * 4, [ca.SX(x) for x in (0.3, 0.7, 0.7, 0.2)])
    alone = centroid_sums([(0.0, 1.0, 2.0, 4.0)], [ca.SX(0.7)])
    np.testing.assert_allclose([float(x) for x in sums], [float(x) for x in alone], rtol=1e-14)


def test_order_needs_all_four_corners():
    assert order([(1.0, 2.0, 2.0, 3.0), (0.0, 1.0, 1.0, 2.0)]) == [1, 0]
    assert order([(0.0, 1.0, 1.0, 9.0), (1.0, 2.0, 2.0, 3.0)]) is None


def surface_value(output, x, *rules):
    rules = rules or ("if x is LOW then y is A", "if x is HIGH then y is B")
    return float(build_surface(small(output, rules))(x)[0])


def test_order_of_definition_does_not_matter():
    a, b = term("triangle", 0, 1, 2), term("triangle", 1, 3, 4)
    direct = surface_value(Output(range=(0, 4), terms={"A": a, "B": b}), 0.3)
    swapped = surface_value(Output(range=(0, 4), terms={"B": b, "A": a}), 0.3)
    assert direct == swapped
    assert direct == pytest.approx(polygon_centroid([(0, 1, 1, 2), (1, 3, 3, 4)], [0.7, 0.3]), abs=1e-14)


def test_ramps_and_sets_over_the_edge_end_at_the_range():
    terms = {"A": term("triangle", -2, 0, 2), "B": term("ramp", 1, 3)}
    expected = polygon_centroid([(0, 0, 0, 2), (1, 3, 4, 4)], [0.6, 0.4])
    assert surface_value(Output(range=(0, 4), terms=terms), 0.4) == pytest.approx(expected, abs=1e-14)


def test_a_range_far_from_zero_loses_no_digits():
    a, b = (1e8, 1e8 + 1, 1e8 + 1, 1e8 + 2), (1e8 + 1, 1e8 + 3, 1e8 + 3, 1e8 + 4)
    terms = {"A": term("trapezoid", *a), "B": term("trapezoid", *b)}
    value = surface_value(Output(range=(1e8, 1e8 + 4), terms=terms), 0.3)
    expected = 1e8 + polygon_centroid(np.array([a, b]) - 1e8, [0.7, 0.3])
    assert value == pytest.approx(expected, rel=2e-16)


UNORDERED = {"A": term("triangle", 0, 1, 4), "B": term("triangle", 1, 2, 3)}
CURVED = {"A": term("gaussian", 1, 0.4), "B": term("triangle", 1, 2, 3)}
HALF_CUT = {"A": term("triangle", -1, 0.5, 1), "B": term("triangle", 1, 2, 3)}


@pytest.mark.parametrize("terms", [UNORDERED, CURVED, HALF_CUT])
def test_sets_without_closed_form_fall_back_to_midpoints(terms):
    fallback = Output(range=(0, 4), terms=terms)
    sampled = Output(range=(0, 4), terms=terms, defuzzifier=Centroid(method="midpoint", samples=1001))
    assert method(fallback, terms) == "midpoint"
    assert surface_value(fallback, 0.3) == surface_value(sampled, 0.3)
    with pytest.raises(SpecError, match=r"outputs\.y\.defuzzifier: the exact centroid needs trapezoids"):
        surface_value(Output(range=(0, 4), terms=terms, defuzzifier=Centroid(method="exact")), 0.3)


def test_midpoints_converge_to_the_exact_centroid():
    terms = {"A": term("triangle", 0, 1, 2.5), "B": term("trapezoid", 1, 2, 3, 4)}
    exact = surface_value(Output(range=(0, 4), terms=terms), 0.35)
    for samples, bound in ((101, 1e-3), (1001, 1e-5), (10001, 1e-7)):
        sampled = Centroid(method="midpoint", samples=samples)
        value = surface_value(Output(range=(0, 4), terms=terms, defuzzifier=sampled), 0.35)
        assert abs(value - exact) < bound


def test_singletons_give_the_weighted_average():
    terms = {"A": term("singleton", -1), "B": term("singleton", 3)}
    assert surface_value(Output(range=(-2, 4), terms=terms), 0.25) == pytest.approx(0.75 * -1 + 0.25 * 3)
