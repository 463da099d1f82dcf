"""The surface as a whole: the paper's rule base worked by hand, defaults, hold, and its cost."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from fuzzy_cases import bulgarelli2011, small, term, texts

from fzcli.fuzzy.audit import audit
from fzcli.fuzzy.check import method
from fzcli.fuzzy.surface import build_surface, singletons
from fzcli.spec.load import load_rulebase
from fzcli.spec.rulebase import Centroid, Input, Output


def values(surface, *inputs):
    return [output.full().ravel() for output in surface(*inputs)]


def test_names_and_shapes():
    surface = build_surface(bulgarelli2011())
    assert surface.name_in() == ["error", "oscillating"]
    assert surface.name_out() == ["increment", "firing_strength"]
    assert surface.size_out("firing_strength") == (4, 1)
    assert surface.is_a("SXFunction")


@pytest.mark.parametrize(
    ("error", "oscillating", "increment", "strengths"),
    [
        (0, 0, 1.26, [1, 0, 0, 0]),  # symmetric triangles: their tops, however clipped
        (0.05, 0, 1.26, [0.5, 0, 0, 0]),
        (0.4, 0, 4.2, [0, 1, 0, 0]),
        (0.55, 0, 4.2, [0, 0.5, 0, 0]),
        (1, 0, (5.04 + 8.4 + 8.4) / 3, [0, 0, 1, 0]),  # a triangle's centroid
        (7, 0, 7.28, [0, 0, 1, 0]),  # beyond the range: as at its end
        (0, 1, (-1660 - 1660 - 830) / 3, [0, 0, 0, 1]),  # one joint oscillates: strongly negative
        (1, 10, -1383 - 1 / 3, [0, 0, 0, 1]),
        # NL clipped at 1/2 has area 311.25 and moment -415030; PS at 1/2 has .945 and 1.1907
        (0, 0.5, (0.945 * 1.26 + 0.5 * 415 * (-1660 + 207.5) + 103.75 * -1106.6666666666667) / 312.195, None),
    ],
)
def test_bulgarelli2011_by_hand(error, oscillating, increment, strengths):
    crisp, firing = values(build_surface(bulgarelli2011()), error, oscillating)
    assert crisp[0] == pytest.approx(increment, rel=1e-13)
    if strengths is not None:
        np.testing.assert_allclose(firing, strengths, atol=1e-15)


def test_cost_of_the_paper_surface():
    assert build_surface(bulgarelli2011()).n_instructions() <= 155


def test_shipped_rulebase_is_the_one_tested_here():
    shipped = load_rulebase(Path(__file__).parents[2] / "rulebases" / "bulgarelli2011.yaml")
    expected = bulgarelli2011()
    assert shipped.inputs == expected.inputs
    assert shipped.outputs == expected.outputs
    assert [rule.text for rule in shipped.rules] == [rule.text for rule in expected.rules]
    assert method(shipped.outputs["increment"], shipped.outputs["increment"].terms) == "exact"


GAP = {"A": term("triangle", 1, 2, 3)}


def gap_output(default, terms=None, **options):
    return Output(range=(0, 4), terms=terms or GAP, default=default, **options)


@pytest.mark.parametrize("terms", [GAP, {"A": term("singleton", 2)}, {"A": term("gaussian", 2, 0.2)}])
@pytest.mark.parametrize("default", [0.0, -7.5])
def test_default_where_nothing_fires(terms, default):
    surface = build_surface(small(gap_output(default, terms), ["if x is HIGH then y is A"]))
    assert values(surface, 0.0)[0] == default
    assert values(surface, 1e-9)[0] == pytest.approx(2.0, rel=1e-9)


def test_hold_keeps_the_previous_value():
    surface = build_surface(small(gap_output("hold"), ["if x is HIGH then y is A"]))
    assert surface.name_in() == ["x", "y_previous"]
    assert values(surface, 0.0, 3.25)[0] == 3.25
    assert values(surface, 0.5, 3.25)[0] == pytest.approx(2.0)


def test_finite_inputs_give_finite_outputs():
    surface = build_surface(bulgarelli2011())
    extremes = [0.0, -0.0, 5e-324, 1e-300, 1e-17, 0.1, 1.0, 1e300, -1e300, 1.7e308]
    for error in extremes:
        for oscillating in extremes:
            crisp, firing = values(surface, error, oscillating)
            assert -1660 <= crisp[0] <= 8.4
            assert np.all((firing >= 0.0) & (firing <= 1.0))


def test_weight_scales_a_rule_and_zero_removes_it():
    terms = {"A": term("singleton", 0), "B": term("singleton", 1)}
    rules = [
        "if x is LOW then y is A with 0.5",
        "if x is HIGH then y is B with 1",
        "if x is LOW then y is B with 0",
    ]
    crisp, firing = values(build_surface(small(Output(range=(0, 1), terms=terms), rules)), 0.4)
    np.testing.assert_allclose(firing, [0.3, 0.4, 0.0])
    assert crisp[0] == pytest.approx(0.4 / 0.7)


def test_product_and_probabilistic_sum():
    terms = {"A": term("singleton", 1)}
    rules = ["if x is LOW and x is HIGH then y is A", "if x is LOW or x is HIGH then y is A"]
    output = Output(range=(0, 1), terms=terms)
    surface = build_surface(small(output, rules, conjunction="prod", disjunction="probor"))
    np.testing.assert_allclose(values(surface, 0.3)[1], [0.21, 0.79])


def test_two_outputs():
    rulebase = small(gap_output(0.0), ["if x is LOW then y is A and z is B", "if x is HIGH then z is A"])
    other = Output(range=(0, 1), terms={"A": term("singleton", 0), "B": term("singleton", 1)}, default=0.5)
    rulebase = rulebase.model_copy(update={"outputs": {**rulebase.outputs, "z": other}})
    surface = build_surface(rulebase)
    assert surface.name_out() == ["y", "z", "firing_strength"]
    assert [float(v[0]) for v in values(surface, 0.25)[:2]] == pytest.approx([2.0, 0.75])


def test_surface_runs_inside_a_scalar_graph():
    """Called on SX it dissolves into scalar operations, as a compiled loop needs."""
    surface = build_surface(bulgarelli2011(Centroid(method="midpoint", samples=50)))
    symbols = [ca.SX.sym(name) for name in surface.name_in()]
    whole = ca.Function("whole", symbols, surface.call(symbols))
    assert float(whole(0.3, 0.2)[0]) == float(surface(0.3, 0.2)[0])


def test_audit_of_the_paper_finds_nothing():
    assert audit(bulgarelli2011()) == []


def test_audit_finds_gaps_idle_terms_and_dead_rules():
    rules = texts(
        "if error is Z and error is PM then increment is P",
        "if oscillating is ON and error is PL then increment is NL",
    )
    findings = audit(bulgarelli2011(rules=rules))
    assert findings[:3] == [
        "no rule reads error is PS",
        "no rule reads error is P",
        "no rule reads oscillating is OFF",
    ]
    assert "no rule concludes increment is PL" in findings
    assert "rule 1 never fires: if error is Z and error is PM then increment is P" in findings
    assert findings[-1].startswith("increment: no rule fires on 70 % of the inputs' ranges, e.g. at error = ")


def test_audit_names_the_fallback_and_idle_outputs():
    terms = {"A": term("triangle", 0, 1, 4), "B": term("triangle", 1, 2, 3)}
    rules = ["if x is LOW then y is A", "if x is HIGH then y is B"]
    rulebase = small(Output(range=(0, 4), terms=terms), rules)
    idle = Output(range=(0, 1), terms={"C": term("singleton", 0)})
    findings = audit(rulebase.model_copy(update={"outputs": {**rulebase.outputs, "z": idle}}))
    assert findings == [
        "no rule concludes z is C",
        "y: its terms have no exact centroid; midpoint sums are used",
        "z: no rule concludes it, so it always takes its default",
    ]


def test_hold_in_audit():
    rulebase = small(gap_output("hold"), ["if x is HIGH then y is A"])
    band = Input(range=(0, 1), terms={"HIGH": term("ramp", 0.5, 1)})
    findings = audit(rulebase.model_copy(update={"inputs": {"x": band}}))
    assert findings == ["y: no rule fires on 50 % of the inputs' ranges, e.g. at x = 0.25"]


def test_singletons_may_be_moved_at_run_time():
    terms = {"LOW": term("singleton", -3.7), "MIDDLE": term("singleton", 0), "IDLE": term("singleton", 5)}
    terms["HIGH"] = term("singleton", 8.1)
    rules = ["if x is LOW then y is LOW", "if x is HIGH then y is HIGH with 0.3", "if x is not LOW then y is MIDDLE"]
    rulebase = small(Output(range=(-10, 10), terms=terms), rules)
    fixed, free = build_surface(rulebase), build_surface(rulebase, free=True)
    assert free.name_in() == ["x", "y_positions"]
    assert singletons(rulebase, "y") == ("LOW", "MIDDLE", "HIGH")
    for x in np.linspace(-0.2, 1.2, 41):
        assert values(free, x, [-3.7, 0, 8.1])[0] == pytest.approx(values(fixed, x)[0], rel=1e-14, abs=1e-15)
    assert singletons(bulgarelli2011(), "increment") == ()
    assert build_surface(bulgarelli2011(), free=True).name_in() == ["error", "oscillating"]
