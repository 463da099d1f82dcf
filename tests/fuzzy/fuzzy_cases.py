"""Rule bases that several tests share, built directly, without YAML."""

from fzcli.spec.rulebase import Centroid, Input, Output, Rulebase, RuleText, Term


def term(shape, *numbers):
    return Term(shape=shape, numbers=numbers)


def texts(*rules):
    return tuple(RuleText(text=rule) for rule in rules)


def bulgarelli2011(defuzzifier=None, default=0.0, rules=None):
    error = {
        "Z": term("triangle", 0, 0, 0.1),
        "PS": term("triangle", 0, 0.1, 0.4),
        "P": term("triangle", 0.1, 0.4, 0.7),
        "PM": term("triangle", 0.4, 0.7, 1),
        "PL": term("ramp", 0.7, 1),
    }
    increment = {
        "NL": term("triangle", -1660, -1660, -830),
        "PS": term("triangle", 0, 1.26, 2.52),
        "P": term("triangle", 1.68, 4.2, 6.72),
        "PL": term("triangle", 5.04, 8.4, 8.4),
    }
    return Rulebase(
        inputs={
            "error": Input(range=(0, 1), terms=error),
            "oscillating": Input(range=(0, 10), terms={"OFF": term("ramp", 1, 0), "ON": term("ramp", 0, 1)}),
        },
        outputs={
            "increment": Output(
                range=(-1660, 8.4), terms=increment, defuzzifier=defuzzifier or Centroid(), default=default
            )
        },
        rules=rules
        or texts(
            "if (error is Z or error is PS) and oscillating is OFF then increment is PS",
            "if (error is P or error is PM) and oscillating is OFF then increment is P",
            "if error is PL and oscillating is OFF then increment is PL",
            "if oscillating is ON then increment is NL",
        ),
    )


def small(output, rules, **options):
    """One input x in 0..1 with LOW and HIGH ramps, the output y given."""
    ramps = {"LOW": term("ramp", 1, 0), "HIGH": term("ramp", 0, 1)}
    return Rulebase(
        inputs={"x": Input(range=(0, 1), terms=ramps)}, outputs={"y": output}, rules=texts(*rules), **options
    )
