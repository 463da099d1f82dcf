"""Membership functions at their corners, on their slopes and beyond their range."""

import casadi as ca
import numpy as np
import pytest
from fuzzy_cases import small, term

from fzcli.errors import SpecError
from fzcli.fuzzy.check import check_rulebase
from fzcli.fuzzy.terms import cut, membership
from fzcli.spec.rulebase import Centroid, Input, Output, Rulebase, RuleText


def degree(shape, numbers, x, limits=(0, 10)):
    point = ca.SX.sym("x")
    return float(ca.Function("degree", [point], [membership(term(shape, *numbers), point, limits)])(x))


@pytest.mark.parametrize(
    ("shape", "numbers", "points"),
    [
        ("triangle", (2, 4, 8), {0: 0, 2: 0, 3: 0.5, 4: 1, 6: 0.5, 8: 0, 9: 0}),
        ("triangle", (2, 2, 4), {1.999: 0, 2: 1, 3: 0.5, 5: 0}),
        ("triangle", (2, 4, 4), {1: 0, 3: 0.5, 4: 1, 4.001: 0}),
        ("triangle", (0, 0, 10), {0: 1, 5: 0.5, 10: 0}),
        ("triangle", (-5, 5, 15), {0: 0.5, 5: 1, 10: 0.5}),
        ("trapezoid", (1, 2, 4, 8), {0: 0, 1.5: 0.5, 2: 1, 3: 1, 4: 1, 6: 0.5, 9: 0}),
        ("trapezoid", (-2, -1, 4, 5), {0: 1, 4.5: 0.5, 5: 0, 10: 0}),
        ("trapezoid", (2, 2, 4, 4), {1.999: 0, 2: 1, 4: 1, 4.001: 0}),
        ("ramp", (2, 4), {0: 0, 3: 0.5, 4: 1, 10: 1}),
        ("ramp", (4, 2), {0: 1, 3: 0.5, 4: 0, 10: 0}),
        ("ramp", (-10, 20), {0: 1 / 3, 5: 0.5, 10: 2 / 3}),
        ("rectangle", (2, 4), {1.999: 0, 2: 1, 3: 1, 4: 1, 4.001: 0}),
        ("rectangle", (0, 10), {0: 1, 5: 1, 10: 1}),
        ("singleton", (3,), {2.999: 0, 3: 1, 3.001: 0}),
        ("gaussian", (5, 2), {5: 1, 7: np.exp(-0.5), 1: np.exp(-2)}),
    ],
)
def test_membership(shape, numbers, points):
    for x, expected in points.items():
        assert degree(shape, numbers, x) == pytest.approx(expected, abs=1e-15)


def test_membership_stays_between_zero_and_one():
    rng = np.random.default_rng(3)
    for _ in range(300):
        corners = np.sort(rng.integers(-3, 14, 4) + rng.choice([0.0, 0.37], 4))
        if corners[0] < corners[3]:
            values = [degree("trapezoid", corners, x) for x in [*corners.clip(0, 10), *rng.uniform(0, 10, 5)]]
            assert min(values) >= 0.0
            assert max(values) <= 1.0


def test_cut_refuses_a_slope():
    assert cut((-1, 0, 1, 3), (0, 4)) == (0, 0, 1, 3)
    assert cut((-1, 1, 1, 3), (0, 4)) is None
    assert cut((1, 2, 3, 5), (0, 4)) is None
    assert cut((1, 2, 5, 6), (0, 4)) == (1, 2, 4, 4)


def problems(x, y=None, rules=("if x is A then y is A",), **options):
    rulebase = Rulebase(
        inputs={"x": x},
        outputs={"y": y or Output(range=(0, 1), terms={"A": term("triangle", 0, 0.5, 1)}, **options)},
        rules=tuple(RuleText(text=rule) for rule in rules),
    )
    with pytest.raises(SpecError) as caught:
        check_rulebase(rulebase)
    return str(caught.value)


@pytest.mark.parametrize(
    ("shape", "numbers", "expected"),
    [
        ("triangle", (0, 1), "triangle takes 3 numbers, not 2"),
        ("triangle", (0, 2, 1), "the numbers of a triangle do not decrease: 0, 2, 1"),
        ("triangle", (1, 1, 1), "a triangle without width; use singleton"),
        ("ramp", (1, 1), "a ramp from 1 to itself has no slope; use rectangle"),
        ("gaussian", (0, -1), "the sigma of a gaussian is positive, not -1"),
        ("triangle", (5, 6, 7), "lies outside the range 0 to 1"),
        ("ramp", (2, 3), "lies outside the range 0 to 1"),
        ("singleton", (-1,), "lies outside the range 0 to 1"),
    ],
)
def test_wrong_terms(shape, numbers, expected):
    assert (
        problems(Input(range=(0, 1), terms={"A": term(shape, *numbers)})) == f"inputs.x.terms.A: {expected}"
    )


def test_wrong_names_and_ranges():
    ramp = {"A": term("ramp", 0, 1)}
    assert problems(Input(range=(1, 1), terms=ramp)) == "inputs.x.range: a range goes up, not from 1 to 1"
    text = problems(Input(range=(0, 1), terms={**ramp, "not": term("ramp", 1, 0)}))
    assert text == "inputs.x.terms.not: 'not' cannot name a term in a rule; use one plain word"
    rulebase = Rulebase(
        inputs={"a b": Input(range=(0, 1), terms=ramp), "y": Input(range=(0, 1), terms=ramp)},
        outputs={"y": Output(range=(0, 1), terms=ramp)},
        rules=(RuleText(text="if y is A then y is A"),),
    )
    with pytest.raises(SpecError) as caught:
        check_rulebase(rulebase)
    assert [str(problem) for problem in caught.value.problems] == [
        "inputs.a b: 'a b' cannot name a variable; use letters, digits and single underscores",
        "outputs.y: the name 'y' is taken",
    ]


def test_wrong_defuzzifiers():
    areas = {"A": term("triangle", 0, 0.5, 1), "B": term("singleton", 0.5)}
    rules = ("if x is LOW then y is A", "if x is HIGH then y is B")

    def text(output):
        with pytest.raises(SpecError) as caught:
            check_rulebase(small(output, rules))
        return str(caught.value)

    assert text(Output(range=(0, 1), terms=areas)).startswith("outputs.y.terms: singletons (B) have no area")
    none = Output(range=(0, 1), terms=areas, defuzzifier=Centroid(method="midpoint", samples=0))
    assert text(none) == "outputs.y.defuzzifier: midpoint needs at least one sample, not 0"
    points = {"A": term("singleton", 0), "B": term("singleton", 1)}
    sampled = Output(range=(0, 1), terms=points, defuzzifier=Centroid(method="midpoint", samples=10))
    assert text(sampled).startswith("outputs.y.defuzzifier: midpoint sums cannot see singletons")
