"""Everything that can be wrong with a rule base, found at once, before anything is built."""

import re
from collections.abc import Iterable
from typing import Literal

from fzcli.errors import Problem, SpecError
from fzcli.fuzzy.centroid import order
from fzcli.fuzzy.grammar import KEYWORDS, Rule, read_rules
from fzcli.fuzzy.terms import Trapezoid, corners, cut, term_problem
from fzcli.spec.rulebase import Input, Output, Rulebase

FALLBACK_SAMPLES = 1001
Method = Literal["exact", "midpoint", "singletons"]

# CasADi names a function's inputs and outputs by letters, digits and single underscores.
_VARIABLE = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*")
_WORD = re.compile(r"[^\W\d]\w*")
_RESERVED = frozenset({"null", "jac", "hess", "firing_strength"})


def check_rulebase(rulebase: Rulebase) -> tuple[Rule, ...]:
    """Parse the rules and check names, ranges, terms and defuzzifiers.

    Returns:
        The parsed rules, in the order of the text.

    Raises:
        SpecError: every problem of the variables, then every problem of the rules.
    """
    problems = _name_problems(rulebase)
    for name, variable in rulebase.inputs.items():
        problems += _variable_problems(variable, f"inputs.{name}")
    for name, output in rulebase.outputs.items():
        problems += _variable_problems(output, f"outputs.{name}")
    rules, rule_problems = read_rules(rulebase)
    problems += rule_problems
    if not problems:
        for name, output in rulebase.outputs.items():
            problems += _defuzzifier_problems(output, used_terms(name, output, rules), f"outputs.{name}")
    if problems:
        raise SpecError(problems)
    return rules


def used_terms(name: str, output: Output, rules: Iterable[Rule]) -> tuple[str, ...]:
    """The terms of an output that some rule concludes, in the order of their definition."""
    concluded = {
        conclusion.term
        for rule in rules
        for conclusion in rule.conclusions
        if conclusion.variable == name and rule.weight > 0.0
    }
    return tuple(term for term in output.terms if term in concluded)


def method(output: Output, used: Iterable[str]) -> Method:
    """How an output is defuzzified once only its used terms count.

    Outputs whose terms are all singletons take their weighted average. The exact centroid needs
    trapezoids whose corners can all be ordered; where they are not (or curved), and the exact
    method was not asked for by name, ``FALLBACK_SAMPLES`` midpoints stand in for it.
    """
    terms = [output.terms[name] for name in used]
    if all(term.shape == "singleton" for term in terms):
        return "singletons"
    if output.defuzzifier.method == "midpoint":
        return "midpoint"
    return "midpoint" if ordered_sets(output, used) is None else "exact"


def ordered_sets(output: Output, used: Iterable[str]) -> list[tuple[str, Trapezoid]] | None:
    """The used terms as trapezoids inside the range, in order; None when the closed form does not apply."""
    names = tuple(used)
    sets: list[Trapezoid] = []
    for name in names:
        trapezoid = corners(output.terms[name], output.range)
        inside = None if trapezoid is None else cut(trapezoid, output.range)
        if inside is None:
            return None
        sets.append(inside)
    indices = order(sets)
    return None if indices is None else [(names[index], sets[index]) for index in indices]


def _name_problems(rulebase: Rulebase) -> list[Problem]:
    problems = []
    taken: set[str] = set(_RESERVED) | {f"{name}_previous" for name in rulebase.outputs}
    for field, names in (("inputs", rulebase.inputs), ("outputs", rulebase.outputs)):
        for name in names:
            if not _VARIABLE.fullmatch(name) or name.lower() in KEYWORDS:
                message = f"'{name}' cannot name a variable; use letters, digits and single underscores"
                problems.append(Problem(message, f"{field}.{name}"))
            elif name in taken:
                problems.append(Problem(f"the name '{name}' is taken", f"{field}.{name}"))
            taken.add(name)
    return problems


def _variable_problems(variable: Input | Output, field: str) -> list[Problem]:
    lower, upper = variable.range
    if not lower < upper:
        return [Problem(f"a range goes up, not from {lower:g} to {upper:g}", f"{field}.range")]
    problems = []
    for name, term in variable.terms.items():
        place = f"{field}.terms.{name}"
        if not _WORD.fullmatch(name) or name.lower() in KEYWORDS:
            problems.append(Problem(f"'{name}' cannot name a term in a rule; use one plain word", place))
        wrong = term_problem(term, variable.range)
        if wrong:
            problems.append(Problem(wrong, place))
    return problems


def _defuzzifier_problems(output: Output, used: tuple[str, ...], field: str) -> list[Problem]:
    centroid = output.defuzzifier
    place = f"{field}.defuzzifier"
    if centroid.samples < 1:
        return [Problem(f"midpoint needs at least one sample, not {centroid.samples}", place)]
    singletons = [name for name in used if output.terms[name].shape == "singleton"]
    if singletons and len(singletons) < len(used):
        message = f"singletons ({', '.join(singletons)}) have no area to weigh against the other terms"
        return [Problem(message, f"{field}.terms")]
    asked = "method" in centroid.model_fields_set
    if singletons and asked and centroid.method == "midpoint":
        return [Problem("midpoint sums cannot see singletons; leave the defuzzifier out", place)]
    if asked and centroid.method == "exact" and not singletons and ordered_sets(output, used) is None:
        message = (
            "the exact centroid needs trapezoids (triangle, ramp, rectangle) with corners that rise from term"
            " to term and no slope cut by the range; write {midpoint: 1001} for these terms"
        )
        return [Problem(message, place)]
    return []
