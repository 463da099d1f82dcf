"""Random rule bases against pyfuzzylite's Centroid(N), an independent engine.

fuzzylite sums at the midpoints of N equal cells too, so the two agree to rounding. Its tolerances
are set to zero first (its default calls values equal that differ by 1e-3), and the numpy error
state, which version 8 changes when imported, is put back.
"""

import numpy as np
import pytest
from fuzzy_cases import bulgarelli2011, term, texts

from fzcli.fuzzy.surface import build_surface
from fzcli.spec.rulebase import Centroid, Input, Output, Rulebase

SHAPES = {
    "triangle": "Triangle",
    "trapezoid": "Trapezoid",
    "ramp": "Ramp",
    "rectangle": "Rectangle",
    "gaussian": "Gaussian",
}


@pytest.fixture(scope="module")
def fl():
    state = np.geterr()
    fuzzylite = pytest.importorskip("fuzzylite")
    np.seterr(**state)
    settings = getattr(fuzzylite, "settings", None) or fuzzylite.lib
    names = [name for name in ("abs_tolerance", "atol", "rtol") if hasattr(settings, name)]
    before = {name: getattr(settings, name) for name in names}
    for name in names:
        setattr(settings, name, 0.0)
    yield fuzzylite
    for name, value in before.items():
        setattr(settings, name, value)


def engine(fl, rulebase):
    """The same rule base as a fuzzylite engine."""

    def terms(variable):
        return [getattr(fl, SHAPES[t.shape])(name, *t.numbers) for name, t in variable.terms.items()]

    def limits(variable):
        return {"minimum": variable.range[0], "maximum": variable.range[1]}

    built = fl.Engine(
        input_variables=[
            fl.InputVariable(name=name, lock_range=True, terms=terms(variable), **limits(variable))
            for name, variable in rulebase.inputs.items()
        ],
        output_variables=[
            fl.OutputVariable(
                name=name,
                terms=terms(output),
                aggregation=fl.Maximum(),
                defuzzifier=fl.Centroid(output.defuzzifier.samples),
                default_value=output.default,
                **limits(output),
            )
            for name, output in rulebase.outputs.items()
        ],
    )
    prod, probor = rulebase.conjunction == "prod", rulebase.disjunction == "probor"
    block = fl.RuleBlock(
        conjunction=fl.AlgebraicProduct() if prod else fl.Minimum(),
        disjunction=fl.AlgebraicSum() if probor else fl.Maximum(),
        implication=fl.Minimum(),
        activation=fl.General(),
        rules=[fl.Rule.create(rule.text, built) for rule in rulebase.rules],
    )
    built.rule_blocks.append(block)
    return built


def random_term(rng, limits):
    lower, upper = limits
    shape = rng.choice(list(SHAPES))
    count = {"triangle": 3, "trapezoid": 4}.get(shape, 2)
    numbers = np.sort(rng.uniform(lower - 0.2 * (upper - lower), upper + 0.2 * (upper - lower), count))
    if shape == "gaussian":
        numbers = np.array([rng.uniform(lower, upper), rng.uniform(0.05, 0.5) * (upper - lower)])
    if shape == "ramp" and rng.random() < 0.5:
        numbers = numbers[::-1]
    if shape in ("triangle", "trapezoid") and rng.random() < 0.4:
        numbers[1] = numbers[0]
    inside = shape in ("gaussian", "ramp") or (numbers[0] < upper and numbers[-1] > lower)
    reaches = shape != "ramp" or lower < numbers[0] < upper
    return term(shape, *numbers) if inside and reaches else random_term(rng, limits)


def random_condition(rng, inputs, depth):
    if depth == 0 or rng.random() < 0.3:
        name = rng.choice(list(inputs))
        return f"{name} is {'not ' * (rng.random() < 0.3)}{rng.choice(list(inputs[name].terms))}"
    left, right = random_condition(rng, inputs, depth - 1), random_condition(rng, inputs, depth - 1)
    joint = rng.choice(["and", "or"])
    return f"( {left} {joint} {right} )" if rng.random() < 0.3 else f"{left} {joint} {right}"


def random_rulebase(rng):
    def variable(kind, **options):
        lower = rng.uniform(-10, 10)
        limits = (lower, lower + rng.uniform(0.1, 10))
        terms = {f"T{k}": random_term(rng, limits) for k in range(rng.integers(2, 6))}
        return kind(range=limits, terms=terms, **options)

    inputs = {f"in{k}": variable(Input) for k in range(rng.integers(1, 4))}
    samples = int(rng.integers(5, 120))
    sampled = Centroid(method="midpoint", samples=samples)
    outputs = {f"out{k}": variable(Output, defuzzifier=sampled) for k in range(rng.integers(1, 3))}
    rules = []
    for _ in range(rng.integers(2, 7)):
        name = rng.choice(list(outputs))
        conclusion = f"{name} is {rng.choice(list(outputs[name].terms))}"
        weight = f" with {rng.uniform(0.1, 1):.3f}" if rng.random() < 0.3 else ""
        rules.append(f"if {random_condition(rng, inputs, 2)} then {conclusion}{weight}")
    return Rulebase(
        inputs=inputs,
        outputs=outputs,
        rules=texts(*rules),
        conjunction=rng.choice(["min", "prod"]),
        disjunction=rng.choice(["max", "probor"]),
    )


def compare(fl, rulebase, rng, points):
    """Differences of all outputs at random inputs, relative to each output's range."""
    surface, oracle = build_surface(rulebase), engine(fl, rulebase)
    differences = []
    for _ in range(points):
        x = [rng.uniform(v.range[0] - 0.1, v.range[1] + 0.1) for v in rulebase.inputs.values()]
        for variable, value in zip(oracle.input_variables, x, strict=True):
            variable.value = value
        try:
            with np.errstate(all="ignore"):
                oracle.process()
        except ZeroDivisionError:  # a rule fired, but no sample lies in its set
            continue
        for name, crisp in zip(rulebase.outputs, surface(*x), strict=False):
            expected = float(np.ravel(oracle.output_variable(name).value)[0])
            if np.isfinite(expected):
                lower, upper = rulebase.outputs[name].range
                differences.append(abs(float(crisp) - expected) / (upper - lower))
    return differences


def test_random_rulebases(fl):
    rng = np.random.default_rng(8)
    differences = [d for _ in range(60) for d in compare(fl, random_rulebase(rng), rng, 6)]
    assert len(differences) > 300
    assert max(differences) < 1e-12


def test_paper_rulebase(fl):
    rulebase = bulgarelli2011(Centroid(method="midpoint", samples=1001))
    assert max(compare(fl, rulebase, np.random.default_rng(9), 20)) < 1e-12
