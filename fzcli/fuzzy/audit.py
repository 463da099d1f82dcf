"""What a rule base says less than its author meant: gaps, idle terms, rules that never fire."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from fzcli.fuzzy.check import check_rulebase, method, used_terms
from fzcli.fuzzy.grammar import And, Condition, Is, Not, Or, Rule
from fzcli.fuzzy.surface import build_surface
from fzcli.spec.rulebase import Rulebase

_GRID_POINTS = 20_000


def audit(rulebase: Rulebase) -> list[str]:
    """Findings about a rule base, one line each; an empty list means nothing to report.

    Coverage and reach are judged at the midpoints of a grid of about 20,000 cells over the inputs'
    ranges, so a gap narrower than a cell can stay unseen.

    Raises:
        SpecError: the rule base itself is wrong.
    """
    rules = check_rulebase(rulebase)
    grid = _grid(rulebase)
    strengths = _strengths(rulebase, grid)
    findings = _unused_terms(rulebase, rules)
    findings += [
        f"rule {index + 1} never fires: {rulebase.rules[index].text}"
        for index in np.flatnonzero(strengths.max(axis=1) <= 0.0)
    ]
    for name, output in rulebase.outputs.items():
        used = used_terms(name, output, rules)
        concluding = [any(c.variable == name and c.term in used for c in rule.conclusions) for rule in rules]
        findings += _coverage_gaps(name, list(rulebase.inputs), grid, strengths[concluding])
        if output.defuzzifier.method == "exact" and method(output, used) == "midpoint":
            findings.append(f"{name}: its terms have no exact centroid; midpoint sums are used")
    return findings


def _grid(rulebase: Rulebase) -> NDArray[np.float64]:
    """Midpoints of equal cells, one row an input."""
    ranges = [variable.range for variable in rulebase.inputs.values()]
    cells = max(2, int(_GRID_POINTS ** (1.0 / len(ranges))))
    centres = (np.arange(cells) + 0.5) / cells
    axes = [lower + (upper - lower) * centres for lower, upper in ranges]
    return np.array(list(product(*axes))).T


def _strengths(rulebase: Rulebase, grid: NDArray[np.float64]) -> NDArray[np.float64]:
    surface = build_surface(rulebase)
    held = np.zeros((surface.n_in() - len(grid), grid.shape[1]))
    rows = [row.reshape(1, -1) for row in (*grid, *held)]
    return np.asarray(surface.call(rows)[-1].full())


def _unused_terms(rulebase: Rulebase, rules: tuple[Rule, ...]) -> list[str]:
    read = {(p.variable, p.term) for rule in rules for p in _propositions(rule.condition)}
    findings = [
        f"no rule reads {name} is {term}"
        for name, variable in rulebase.inputs.items()
        for term in variable.terms
        if (name, term) not in read
    ]
    for name, output in rulebase.outputs.items():
        used = used_terms(name, output, rules)
        findings += [f"no rule concludes {name} is {term}" for term in output.terms if term not in used]
    return findings


def _propositions(node: Condition) -> list[Is]:
    match node:
        case Is():
            return [node]
        case Not(operand):
            return _propositions(operand)
        case And(operands) | Or(operands):
            return [proposition for operand in operands for proposition in _propositions(operand)]


def _coverage_gaps(
    output: str, inputs: list[str], grid: NDArray[np.float64], strengths: NDArray[np.float64]
) -> list[str]:
    """The share of the inputs that leaves an output to its default, with an example."""
    if not len(strengths):
        return [f"{output}: no rule concludes it, so it always takes its default"]
    silent = grid[:, strengths.max(axis=0) <= 0.0]
    if not silent.size:
        return []
    share = 100.0 * silent.shape[1] / grid.shape[1]
    middle = silent[:, silent.shape[1] // 2]
    place = ", ".join(f"{name} = {value:.3g}" for name, value in zip(inputs, middle, strict=True))
    return [f"{output}: no rule fires on {share:.2g} % of the inputs' ranges, e.g. at {place}"]
