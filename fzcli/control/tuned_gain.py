"""A gain tuned by a Mamdani rule base, once a control step and axis: what the laws that have one share."""

from collections.abc import Callable
from typing import Annotated

import casadi as ca
from pydantic import Field, field_validator, model_validator

from fzcli.control.clik import Gain, check_gain_count, gain_signals
from fzcli.control.equation1 import Equation1Spec, Situation, detector, finish, situation
from fzcli.control.law import Law
from fzcli.errors import Problem, SpecError
from fzcli.fuzzy.surface import build_surface, singletons
from fzcli.fuzzy.terms import term_problem
from fzcli.model import RobotModel
from fzcli.spec.quantity import Parameter, Signal
from fzcli.spec.references import RulebaseReference
from fzcli.spec.rulebase import Rulebase
from fzcli.spec.units import Angle

INPUTS = ("error", "oscillating")
OUTPUT = "increment"


class TunedGainSpec(Equation1Spec):
    """Kc <- max(0, Kc + increment), once a control step and axis."""

    gain: Annotated[Gain | tuple[Gain, ...], Field(description="Kc at the start, 1/s")]
    rulebase: RulebaseReference
    error_scale: Annotated[
        Angle, Field(gt=0, description="size of the constraint error that the rule base sees as 1")
    ] = 0.1
    gain_limit: Annotated[float | None, Field(gt=0, description="ceiling of Kc, 1/s; none by default")] = None

    @field_validator("rulebase")
    @classmethod
    def _speaks_of_error_and_oscillation(cls, rulebase: Rulebase) -> Rulebase:
        if tuple(rulebase.inputs) != INPUTS or tuple(rulebase.outputs) != (OUTPUT,):
            raise ValueError(
                f"the rule base must map inputs {', '.join(INPUTS)} to output {OUTPUT}; "
                f"it maps {', '.join(rulebase.inputs)} to {', '.join(rulebase.outputs)}"
            )
        output = rulebase.outputs[OUTPUT]
        for name, term in output.terms.items():  # run-time numbers, which no build checks again
            wrong = term_problem(term, output.range) if term.shape == "singleton" else ""
            if wrong:
                raise ValueError(f"outputs.{OUTPUT}.terms.{name}: {wrong}")
        return rulebase

    @model_validator(mode="after")
    def _one_gain_an_axis(self) -> "TunedGainSpec":
        check_gain_count(self.gain, self.axes)
        return self


def tuned_law(
    model: RobotModel,
    spec: TunedGainSpec,
    resolve: Callable[[Situation, ca.SX, ca.SX], ca.SX],
    own: dict[Parameter, ca.SX],
) -> Law:
    """The tuner on top of a law: the gain in force is the one made in the step before.

    ``resolve`` (situation, kp, gain) -> joint rates (n); ``own``: that law's other parameters. The rule base's input
    ``error`` is the axis's |ec| / error_scale, ``oscillating`` the number of oscillating joints; its output is the
    increment of that axis's gain. Where that is an average of singletons, their positions are run-time parameters, so
    that one build serves all that differ in them. Raises SpecError for an increment that would be held.
    """
    surface = build_surface(spec.rulebase, free=True)
    terms = singletons(spec.rulebase, OUTPUT)
    positions = [ca.SX.sym(name) for name in terms]
    free = [ca.vertcat(*positions)] if terms else []
    if spec.rulebase.outputs[OUTPUT].default == "hold":
        raise SpecError(Problem("an increment cannot be held; give a number", field=f"outputs.{OUTPUT}.default"))
    at = situation(model, spec)
    axes = len(spec.axes)
    kp, first, gain = ca.SX.sym("kp"), ca.SX.sym("gain_start", axes), ca.SX.sym("gain", axes)
    limit = ca.SX.sym("gain_limit")
    qd = resolve(at, kp, gain)
    watch = detector(at, qd)
    signals, metrics = gain_signals(at, gain)
    rules = tuple(f"rule {i + 1}" for i in range(len(spec.rulebase.rules)))
    tuned: list[ca.SX] = []
    for i, axis in enumerate(spec.axes):
        error = ca.fabs(at.constraint.error[i]) * (1.0 / spec.error_scale)
        increment, strengths = surface(error, watch.result.count, *free)
        next_gain = ca.fmax(0.0, gain[i] + increment)
        tuned.append(next_gain if spec.gain_limit is None else ca.fmin(limit, next_gain))
        suffix = "" if axes == 1 else f"_{axis}"
        signals[Signal(f"gain_increment{suffix}", "1/s", f"increment of Kc of {axis}")] = increment
        signals[Signal(f"firing_strength{suffix}", "1", f"firing strength of the rules for {axis}", rules)] = (
            strengths
        )
    parameters = {Parameter("controller.kp"): kp, Parameter("controller.gain", axes): first, **own}
    if spec.gain_limit is not None:
        parameters[Parameter("controller.gain_limit")] = limit
    for name, position in zip(terms, positions, strict=True):
        parameters[Parameter(f"controller.rulebase.outputs.{OUTPUT}.terms.{name}.numbers")] = position
    memory = (gain, ca.vertcat(*tuned), first)
    return finish(at, qd, watch, parameters, signals, metrics, memory)
