"""Rule base files: what they become, and the checks of their terms."""

import pytest

from fzcli.errors import SpecError
from fzcli.spec.load import load_rulebase, rulebase_of
from fzcli.spec.reader import read_text
from fzcli.spec.rulebase import Centroid, Rulebase, Term

GOOD = """kind: rulebase
inputs:
  error:
    range: [0, 1]
    terms: {Z: [triangle, 0, 0, 1], PL: [ramp, 0.5, 1]}
outputs:
  increment:
    range: [-1, 1]
    terms: {N: [singleton, -1], P: [trapezoid, 0, 0.5, 0.5, 1]}
rules:
- if error is Z then increment is P
- 'if error is PL then increment is N'
- >
  if error is not Z
  then increment is N
"""


def rulebase(text: str) -> Rulebase:
    return rulebase_of(read_text(text, "x.yaml"))


def problems(text: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        rulebase(text)
    return [str(problem).split("\n")[0] for problem in caught.value.problems]


def test_the_shipped_rule_base() -> None:
    loaded = load_rulebase("bulgarelli2011")
    assert loaded.name == "bulgarelli2011"
    assert list(loaded.inputs) == ["error", "oscillating"]
    assert list(loaded.inputs["oscillating"].terms) == ["OFF", "ON"]
    assert loaded.outputs["increment"].terms["PL"] == Term(shape="triangle", numbers=(5.04, 8.4, 8.4))
    assert loaded.outputs["increment"].defuzzifier == Centroid()
    assert (loaded.conjunction, loaded.disjunction, loaded.outputs["increment"].default) == ("min", "max", 0)
    assert [rule.text.split(" then ")[1] for rule in loaded.rules] == [
        "increment is PS",
        "increment is P",
        "increment is PL",
        "increment is NL",
    ]


def test_rules_keep_their_text_and_place() -> None:
    rules = rulebase(GOOD).rules
    assert [(rule.file, rule.line, rule.column) for rule in rules] == [
        ("x.yaml", 11, 3),
        ("x.yaml", 12, 4),
        ("x.yaml", 14, 3),
    ]
    assert rules[2].text == "if error is not Z then increment is N\n"


def test_connectives_defuzzifier_and_default() -> None:
    loaded = rulebase(
        GOOD.replace("kind: rulebase", "kind: rulebase\nand: prod\nor: probor").replace(
            "rules:", "    defuzzifier: {midpoint: 101}\n    default: hold\nrules:"
        )
    )
    assert (loaded.conjunction, loaded.disjunction) == ("prod", "probor")
    assert loaded.outputs["increment"].defuzzifier == Centroid(method="midpoint", samples=101)
    assert loaded.outputs["increment"].default == "hold"
    spelled = GOOD.replace("rules:", "    defuzzifier: {centroid: {method: midpoint, samples: 7}}\nrules:")
    assert rulebase(spelled).outputs["increment"].defuzzifier == Centroid(method="midpoint", samples=7)


def with_term(term: str) -> str:
    return GOOD.replace("[ramp, 0.5, 1]", term)


def with_output(line: str) -> str:
    return GOOD.replace("rules:", f"    {line}\nrules:")


TERM = "x.yaml:5:41: inputs.error.terms.PL: "


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (with_term("[ramp, 0.5, 1.2]"), TERM + "term PL of error reaches 1.2, outside the range 0 to 1"),
        (
            with_term("[gaussian, -0.5, 0.1]"),
            TERM + "term PL of error reaches -0.5, outside the range 0 to 1",
        ),
        (with_term("[triangle, 0, 1]"), TERM + "triangle needs 3 numbers (a b c), has 2"),
        (with_term("[singleton]"), TERM + "singleton needs 1 number (x), has 0"),
        (with_term("[triangle, 0, 1, 0.5]"), TERM + "triangle needs a <= b <= c and a < c, got 0, 1, 0.5"),
        (
            with_term("[trapezoid, 1, 1, 1, 1]"),
            TERM + "trapezoid needs a <= b <= c <= d and a < d, got 1, 1, 1, 1",
        ),
        (with_term("[ramp, 1, 1]"), TERM + "ramp needs a and b to differ, got 1, 1"),
        (with_term("[rectangle, 1, 0]"), TERM + "rectangle needs a < b, got 1, 0"),
        (with_term("[gaussian, 0, 0]"), TERM + "gaussian needs sigma > 0, got 0, 0"),
        (with_term("[triangel, 0, 0, 1]"), TERM + "unknown shape 'triangel'; did you mean 'triangle'?"),
        (with_term("[ramp, 0, .nan]"), TERM + "must be a finite number, got nan"),
        (with_term("[ramp, 0, true]"), TERM + "must be a plain number, got true"),
        (with_term("ramp"), TERM + "must be a shape and its numbers, e.g. [triangle, 0, 0.5, 1], got 'ramp'"),
        (
            GOOD.replace("range: [0, 1]", "range: [1, 0]"),
            "x.yaml:4:12: inputs.error.range: must rise, got 1 to 0",
        ),
        (
            GOOD.replace("Z: [", "not: [", 1),
            "x.yaml:5:13: inputs.error.terms.not: 'not' cannot stand in a rule: use "
            "letters, digits and _, no rule word",
        ),
        (
            GOOD.replace("  error:", "  my error:", 1),
            "x.yaml:3:3: inputs.my error: 'my error' cannot stand in a rule: use "
            "letters, digits and _, no rule word",
        ),
        (
            GOOD.replace("kind: rulebase", "kind: rulebase\nand: sum"),
            "x.yaml:2:6: and: must be 'min' or 'prod', got 'sum'",
        ),
        (
            GOOD.replace("kind: rulebase", "kind: rulebase\nconjunction: min"),
            "x.yaml:2:1: conjunction: unknown key; known "
            "keys: kind, name, about, and, or, inputs, outputs, rules",
        ),
        (GOOD.replace("kind: rulebase", "kind: robot"), "x.yaml:1:7: kind: rulebase is wanted, got 'robot'"),
        (
            with_output("defuzzifier: bisector"),
            "x.yaml:10:18: outputs.increment.defuzzifier: unknown defuzzifier "
            "'bisector'; write centroid or {midpoint: 1001}",
        ),
        (
            with_output("defuzzifier: {midpont: 5}"),
            "x.yaml:10:18: outputs.increment.defuzzifier: unknown defuzzifier "
            "midpont; write centroid or {midpoint: 1001}; did you mean 'midpoint'?",
        ),
        (
            with_output("defuzzifier: {midpoint: 0}"),
            "x.yaml:10:18: outputs.increment.defuzzifier: samples must be a whole "
            "number from 1 to 1000000, got 0",
        ),
        (
            with_output("default: hod"),
            "x.yaml:10:14: outputs.increment.default: must be a number or 'hold', got 'hod'",
        ),
        (GOOD[: GOOD.index("rules:")] + "rules: []\n", "x.yaml:10:8: rules: needs at least 1 item, has 0"),
        (GOOD[: GOOD.index("rules:")] + "rules: [' ']\n", "x.yaml:10:9: rules.0: a rule without text"),
        (
            GOOD.replace("terms: {N", "therms: {N"),
            "x.yaml:9:5: outputs.increment.therms: unknown key; did you mean 'terms'?",
        ),
    ],
)
def test_one_thing_wrong(text: str, message: str) -> None:
    assert problems(text) == [message]


def test_tails_of_a_gaussian_may_pass_the_range() -> None:
    assert rulebase(with_term("[gaussian, 0.9, 0.5]")).inputs["error"].terms["PL"].numbers == (0.9, 0.5)


def test_every_term_outside_is_told() -> None:
    text = with_term("[ramp, 0.5, 2]").replace("[singleton, -1]", "[singleton, -3]")
    assert [problem.partition("term ")[2] for problem in problems(text)] == [
        "PL of error reaches 2, outside the range 0 to 1",
        "N of increment reaches -3, outside the range -1 to 1",
    ]
