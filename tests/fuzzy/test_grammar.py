"""The grammar: precedence, the syntax tree, and error messages that point at the word."""

import numpy as np
import pytest
from fuzzy_cases import bulgarelli2011, term, texts

from fzcli.errors import SpecError
from fzcli.fuzzy.check import check_rulebase
from fzcli.fuzzy.grammar import And, Is, Not, Or, Rule, parse_rules
from fzcli.fuzzy.surface import build_surface
from fzcli.spec.load import load_rulebase
from fzcli.spec.rulebase import Input, Output, Rulebase, RuleText

HEAD = "if error is Z then increment is PS"


def parsed(text):
    (rule,) = parse_rules(bulgarelli2011(rules=texts(text)))
    return rule


def message(text, **place):
    with pytest.raises(SpecError) as caught:
        parse_rules(bulgarelli2011(rules=(RuleText(text=text, **place),)))
    return str(caught.value)


def test_tree_of_a_whole_rule():
    text = "IF (error is Z or error IS PS) And Not oscillating is ON then increment is PS with .5"
    condition = And((Or((Is("error", "Z"), Is("error", "PS"))), Not(Is("oscillating", "ON"))))
    assert parsed(text) == Rule(condition, (Is("increment", "PS"),), 0.5)


def test_is_not_equals_not():
    assert parsed("if error is not Z then increment is P") == parsed("if not error is Z then increment is P")


def test_conclusions_joined_by_and():
    rule = parsed("if error is Z then increment is PS and increment is P with 1e-1")
    assert rule.conclusions == (Is("increment", "PS"), Is("increment", "P"))
    assert rule.weight == 0.1


def random_condition(rng, depth):
    """Text of a condition over crisp inputs a, b, c and the same as a Python expression."""
    kind = rng.integers(5) if depth else 0
    if kind == 0:
        name = rng.choice(list("abc"))
        negated = rng.random() < 0.3
        return f"{name} is {'not ' * negated}T", f"{'not ' * negated}{name}"
    left, right = random_condition(rng, depth - 1), random_condition(rng, depth - 1)
    if kind == 1:
        return f"not {left[0]}", f"not {left[1]}"
    if kind == 2:
        return f"( {left[0]})", f"({left[1]})"
    joint = "and" if kind == 3 else "or"
    return f"{left[0]} {joint.upper()} {right[0]}", f"{left[1]} {joint} {right[1]}"


def test_precedence_is_that_of_python():
    """On crisp inputs a rule fires exactly when the same words, read by Python, are true."""
    rng = np.random.default_rng(1)
    conditions = [random_condition(rng, 4) for _ in range(200)]
    rulebase = Rulebase(
        inputs={name: Input(range=(0, 1), terms={"T": term("ramp", 0, 1)}) for name in "abc"},
        outputs={"y": Output(range=(0, 1), terms={"T": term("singleton", 1)})},
        rules=texts(*(f"if {text} then y is T" for text, _ in conditions)),
    )
    surface = build_surface(rulebase)
    for corner in np.ndindex(2, 2, 2):
        names = dict(zip("abc", map(bool, corner), strict=True))
        truth = [float(eval(python, {}, names)) for _, python in conditions]
        np.testing.assert_array_equal(surface(*corner)[1].full().ravel(), truth)


def test_redundant_parentheses_change_nothing():
    plain = parsed("if error is Z or error is PS and not oscillating is ON then increment is PS")
    wrapped = parsed("if((error is Z)or((error is PS)and(not(oscillating is ON))))then increment is PS")
    assert plain == wrapped


def test_unknown_term_has_place_caret_and_suggestion():
    text = message("if error is PZ then increment is PS", file="rb.yaml", line=7, column=5)
    assert text == (
        "rb.yaml:7:17: rules.0: 'error' has no term 'PZ'; did you mean 'Z'?\n"
        "    if error is PZ then increment is PS\n"
        "                ^^"
    )


@pytest.mark.parametrize(
    ("rule", "expected", "word"),
    [
        ("if eror is Z then increment is PS", "there is no input 'eror'; did you mean 'error'?", "eror"),
        ("if q is Z then increment is PS", "there is no input 'q'; inputs: error, oscillating", "q"),
        (
            "if increment is PS then increment is PS",
            "'increment' is an output, but an input is needed",
            "increm",
        ),
        ("if error is Z then error is Z", "'error' is an input, but an output is needed", "error is Z$"),
        ("if error is Z then increment is ps", "did you mean 'PS'?", "ps"),
        ("if error Z then increment is PS", "expected 'is' after 'error', found 'Z'", "Z"),
        ("error is Z then increment is PS", "a rule starts with 'if', found 'error'", "error"),
        ("if error is then increment is PS", "expected a term of 'error', found 'then'", "then"),
        ("if error is Z increment is PS", "expected 'and', 'or' or 'then', found 'increment'", "increment"),
        ("if (error is Z then increment is PS", "expected 'and', 'or' or ')', found 'then'", "then"),
        ("if error is Z) then increment is PS", "expected 'and', 'or' or 'then', found ')'", ")"),
        ("if and then increment is PS", "expected an input, 'not' or '(', found 'and'", "and"),
        (HEAD + " or increment is P", "expected 'and', 'with' or the end of the rule, found 'or'", "or in"),
        (HEAD + " with 1.5", "a weight lies in 0 to 1, not 1.5", "1.5"),
        (HEAD + " with -0.1", "a weight lies in 0 to 1, not -0.1", "-0.1"),
        (HEAD + " with much", "expected a weight from 0 to 1, found 'much'", "much"),
        ("if error is Z then increment is not PS", "'not' belongs to conditions", "not"),
        ("if error = Z then increment is PS", "expected 'is' after 'error', found '='", "="),
        ("if " + "(" * 70 + "error is Z", "nested deeper than 64 levels", None),
    ],
)
def test_errors_point_at_the_word(rule, expected, word):
    first, line, caret = message(rule, file="rb.yaml", line=3, column=10).split("\n")
    assert expected in first
    if word is not None:
        offset = rule.index(word.rstrip("$")) if not word.endswith("$") else rule.rindex(word[:-1])
        assert first.startswith(f"rb.yaml:3:{10 + offset}: rules.0: ")
        assert caret.index("^") == line.index(rule) + offset


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ("", "a rule starts with 'if', found the end of the rule"),
        ("if error is Z", "expected 'and', 'or' or 'then', found the end of the rule"),
        ("if error is Z then", "expected an output, found the end of the rule"),
        (HEAD + " with ", "expected a weight from 0 to 1, found the end of the rule"),
    ],
)
def test_errors_at_the_end_point_past_it(rule, expected):
    first, _, caret = message(rule).split("\n")
    assert expected in first
    assert caret == "    " + " " * len(rule.rstrip()) + "^"


def test_place_in_a_file(tmp_path):
    path = tmp_path / "rb.yaml"
    path.write_text(
        "kind: rulebase\n"
        "inputs: {x: {range: [0, 1], terms: {ON: [ramp, 0, 1]}}}\n"
        "outputs: {y: {range: [0, 1], terms: {BIG: [ramp, 0, 1]}}}\n"
        "rules:\n"
        "  - if x is ON then y is BIG\n"
        "  - 'if x is OF then y is BIG'\n"
    )
    with pytest.raises(SpecError) as caught:
        parse_rules(load_rulebase(path))
    assert str(caught.value).startswith(f"{path}:6:14: rules.1: 'x' has no term 'OF'; terms: ON\n")


def test_all_errors_of_all_rules_at_once():
    rules = texts("if eror is Z and oscillating is OF then incr is PS", HEAD, "if error is X then")
    with pytest.raises(SpecError) as caught:
        check_rulebase(bulgarelli2011(rules=rules))
    fields = [problem.field for problem in caught.value.problems]
    assert fields == ["rules.0"] * 3 + ["rules.2"] * 2
    assert "'oscillating' has no term 'OF'; did you mean 'OFF'?" in str(caught.value)


def test_a_word_on_a_further_line_keeps_its_line():
    text = message("if error is Z\n  then increment is XX", file="rb.yaml", line=4, column=5)
    assert text.startswith("rb.yaml:5: rules.0: 'increment' has no term 'XX'")
    assert text.endswith("      then increment is XX\n" + " " * 24 + "^^")
