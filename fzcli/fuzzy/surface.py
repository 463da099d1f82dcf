"""A rule base as one function: crisp inputs to crisp outputs and the strength of every rule."""

from functools import reduce

import casadi as ca

from fzcli.fuzzy.centroid import Sums, centroid_sums
from fzcli.fuzzy.check import FALLBACK_SAMPLES, check_rulebase, method, ordered_sets, used_terms
from fzcli.fuzzy.grammar import And, Condition, Is, Not, Or, Rule
from fzcli.fuzzy.midpoint import midpoint_sums, singleton_sums
from fzcli.fuzzy.terms import membership
from fzcli.spec.rulebase import Output, Rulebase

# Below this the aggregated set counts as empty: smaller than any honest firing, larger than underflow.
_EMPTY = 1e-250


def build_surface(rulebase: Rulebase, free: bool = False) -> ca.Function:
    """Compile a rule base into a branch-free function of SX operations only.

    Inputs (scalars): the rule base's inputs in order, clipped to their ranges; then
    ``NAME_previous`` for every output whose default is "hold"; then, where ``free``, ``NAME_positions`` for
    every output of singletons, in the order of ``singletons``. Outputs: the rule base's outputs in
    order (scalars), then ``firing_strength`` (n_rules), each rule's degree times its weight.
    Finite inputs give finite outputs: where no rule fires, an output takes its default.

    Mamdani inference: clipping by min, aggregation by max, centroid (``check.method`` says which).

    Raises:
        SpecError: everything that is wrong with the rule base.
    """
    rules = check_rulebase(rulebase)
    inputs = {name: ca.SX.sym(name) for name in rulebase.inputs}
    held = {
        name: ca.SX.sym(f"{name}_previous")
        for name, output in rulebase.outputs.items()
        if output.default == "hold"
    }
    defaults = {
        name: held[name] if output.default == "hold" else ca.SX(output.default)
        for name, output in rulebase.outputs.items()
    }
    strengths = _Inference(rulebase, inputs).strengths(rules)
    counts = {name: len(singletons(rulebase, name)) if free else 0 for name in rulebase.outputs}
    places = {name: ca.SX.sym(f"{name}_positions", count) for name, count in counts.items() if count}
    crisp = [
        _defuzzified(name, output, rules, strengths, defaults[name], places.get(name))
        for name, output in rulebase.outputs.items()
    ]
    results = ca.cse([*crisp, ca.vertcat(*strengths)])
    return ca.Function(
        "surface",
        [*inputs.values(), *held.values(), *places.values()],
        results,
        [*inputs, *(f"{name}_previous" for name in held), *(f"{name}_positions" for name in places)],
        [*rulebase.outputs, "firing_strength"],
    )


def singletons(rulebase: Rulebase, name: str) -> tuple[str, ...]:
    """The terms of an output whose weighted average it is; empty where it is the centroid of sets with an area."""
    output = rulebase.outputs[name]
    used = used_terms(name, output, check_rulebase(rulebase))
    return used if method(output, used) == "singletons" else ()


class _Inference:
    """Degrees of conditions for one set of input symbols; each membership is made once."""

    def __init__(self, rulebase: Rulebase, inputs: dict[str, ca.SX]) -> None:
        self.rulebase = rulebase
        self.values = {
            name: ca.fmin(ca.fmax(inputs[name], variable.range[0]), variable.range[1])
            for name, variable in rulebase.inputs.items()
        }
        self.degrees: dict[Is, ca.SX] = {}

    def strengths(self, rules: tuple[Rule, ...]) -> list[ca.SX]:
        return [rule.weight * self.degree(rule.condition) for rule in rules]

    def degree(self, node: Condition) -> ca.SX:
        match node:
            case Is():
                if node not in self.degrees:
                    variable = self.rulebase.inputs[node.variable]
                    value = self.values[node.variable]
                    self.degrees[node] = membership(variable.terms[node.term], value, variable.range)
                return self.degrees[node]
            case Not(operand):
                return 1.0 - self.degree(operand)
            case And(operands):
                return reduce(self.conjunction, map(self.degree, operands))
            case Or(operands):
                return reduce(self.disjunction, map(self.degree, operands))

    def conjunction(self, x: ca.SX, y: ca.SX) -> ca.SX:
        return ca.fmin(x, y) if self.rulebase.conjunction == "min" else x * y

    def disjunction(self, x: ca.SX, y: ca.SX) -> ca.SX:
        return ca.fmax(x, y) if self.rulebase.disjunction == "max" else x + y - x * y


def _defuzzified(
    name: str,
    output: Output,
    rules: tuple[Rule, ...],
    strengths: list[ca.SX],
    default: ca.SX,
    positions: ca.SX | None,
) -> ca.SX:
    """The crisp value of one output: first moment over area, or the default where the area vanishes.

    ``positions``: symbols of its singletons' positions, in place of the numbers.
    """
    used = used_terms(name, output, rules)
    if not used:
        return default
    firings: dict[str, ca.SX] = {}
    for rule, strength in zip(rules, strengths, strict=True):
        for conclusion in rule.conclusions:
            if conclusion.variable == name and conclusion.term in used:
                term = conclusion.term
                firings[term] = ca.fmax(firings[term], strength) if term in firings else strength
    origin = min(max(0.0, output.range[0]), output.range[1])  # the point of the range nearest to zero
    if positions is None:
        moment, area = _sums(output, used, firings, origin)
    else:
        moment, area = singleton_sums(ca.vertsplit(positions), [firings[term] for term in used], origin)
    value = origin + moment / ca.fmax(area, _EMPTY)  # no 0/0, and `origin` where nothing fires
    return value if output.default == origin else ca.if_else(area > _EMPTY, value, default)


def _sums(output: Output, used: tuple[str, ...], firings: dict[str, ca.SX], origin: float) -> Sums:
    terms = [output.terms[name] for name in used]
    levels = [firings[name] for name in used]
    kind = method(output, used)
    if kind == "singletons":
        return singleton_sums([term.numbers[0] for term in terms], levels, origin)
    sets = ordered_sets(output, used)
    if kind == "exact" and sets is not None:
        ordered = [firings[term] for term, _ in sets]
        return centroid_sums([trapezoid for _, trapezoid in sets], ordered, origin)
    centroid = output.defuzzifier
    samples = centroid.samples if centroid.method == "midpoint" else FALLBACK_SAMPLES
    return midpoint_sums(terms, levels, output.range, samples, origin)
