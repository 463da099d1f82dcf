"""A gain tuned by a Mamdani rule base, once a control step and axis: what the laws that have one share."""

from collections.abc import Callable
from typing import Annotated, ClassVar

import casadi as ca
from pydantic import Field, field_validator, model_validator

from fzcli.control.clik import Gain, check_gain_count, gain_signals
from fzcli.control.equation1 import Equation1Spec, Situation, detector, finish, situation
from fzcli.control.law import Law
from fzcli.fuzzy.surface import build_surface, singletons
from fzcli.fuzzy.terms import term_problem
from fzcli.model import RobotModel
from fzcli.spec.quantity import Parameter, Signal
from fzcli.spec.references import RulebaseReference
from fzcli.spec.rulebase import Rulebase
from fzcli.spec.units import Angle

Resolve = Callable[[Situation, ca.SX, ca.SX, ca.SX], ca.SX]


class TunedGainSpec(Equation1Spec):
    """Kc <- max(0, Kc + increment), once a control step and axis."""

    INPUTS: ClassVar[tuple[str, ...]] = ("error", "oscillating")
    OUTPUTS: ClassVar[tuple[str, ...]] = ("increment",)

    gain: Annotated[Gain | tuple[Gain, ...], Field(description="Kc at the start, 1/s")]
    rulebase: RulebaseReference
    error_scale: Annotated[
        Angle, Field(gt=0, description="size of the constraint error that the rule base sees as 1")
    ] = 0.1
    gain_limit: Annotated[float | None, Field(gt=0, description="ceiling of Kc, 1/s; none by default")] = None

    @field_validator("rulebase")
    @classmethod
    def _fits(cls, rulebase: Rulebase) -> Rulebase:
        cls.check_variables(tuple(rulebase.inputs), tuple(rulebase.outputs))
        for name, output in rulebase.outputs.items():
            if output.default == "hold":
                raise ValueError(f"outputs.{name}.default: cannot be held; give a number")
            for term_name, term in output.terms.items():  # run-time numbers, which no build checks again
                wrong = term_problem(term, output.range) if term.shape == "singleton" else ""
                if wrong:
                    raise ValueError(f"outputs.{name}.terms.{term_name}: {wrong}")
        return rulebase

    @classmethod
    def check_variables(cls, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
        """Raises ValueError where a rule base speaks of other things than the law has."""
        if inputs != cls.INPUTS or outputs != cls.OUTPUTS:
            raise ValueError(
                f"the rule base must map inputs {', '.join(cls.INPUTS)} to output {', '.join(cls.OUTPUTS)}; "
                f"it maps {', '.join(inputs)} to {', '.join(outputs)}"
            )

    @model_validator(mode="after")
    def _one_gain_an_axis(self) -> "TunedGainSpec":
        check_gain_count(self.gain, self.axes)
        return self


class Tuner:
    """A rule base inside a law: its crisp outputs, and its singletons' positions as run-time parameters."""

    def __init__(self, rulebase: Rulebase) -> None:
        self.rulebase = rulebase
        self._surface = build_surface(rulebase, free=True)
        self.parameters: dict[Parameter, ca.SX] = {}
        self._positions: list[ca.SX] = []
        for output in rulebase.outputs:
            symbols = {term: ca.SX.sym(term) for term in singletons(rulebase, output)}
            for term, symbol in symbols.items():
                self.parameters[Parameter(f"controller.rulebase.outputs.{output}.terms.{term}.numbers")] = symbol
            if symbols:
                self._positions.append(ca.vertcat(*symbols.values()))

    def __call__(self, **inputs: ca.SX) -> dict[str, ca.SX]:
        """Outputs by name, and ``firing_strength`` (rules); of the inputs those that the rule base has are taken."""
        given = [inputs[name] for name in self.rulebase.inputs]
        results = self._surface(*given, *self._positions)
        return dict(zip((*self.rulebase.outputs, "firing_strength"), results, strict=True))


def tuned_law(
    model: RobotModel,
    spec: TunedGainSpec,
    resolve: Resolve,
    own: dict[Parameter, ca.SX],
    tip_error_scale: ca.SX | None = None,
) -> Law:
    """The tuner on top of a law: the gain in force is the one made in the step before.

    ``resolve`` (situation, kp, gain (k), share (k)) -> joint rates (n); ``own``: that law's other parameters. Inputs of
    the rule base: ``error``, the axis's |ec| / error_scale, ``tip_error``, the task's over its scale, ``oscillating``,
    the number of oscillating joints. Outputs: ``increment`` of the axis's gain; ``share``, which part of the axis's
    motion this very step carries out, all where it is not there. Where an output is an average of singletons, their
    positions are run-time parameters, so that one build serves all that differ in them.
    """
    tuner, at, axes = Tuner(spec.rulebase), situation(model, spec), len(spec.axes)
    kp, first, gain = ca.SX.sym("kp"), ca.SX.sym("gain_start", axes), ca.SX.sym("gain", axes)
    limit = ca.SX.sym("gain_limit")
    errors = [{"error": ca.fabs(at.constraint.error[i]) * (1.0 / spec.error_scale)} for i in range(axes)]
    if tip_error_scale is not None:
        errors = [{**one, "tip_error": at.task.error_norm / tip_error_scale} for one in errors]
    now = [tuner(**one, oscillating=ca.SX(0)) for one in errors]  # no rule of a share speaks of oscillation
    share = ca.vertcat(*(ca.fmin(1.0, ca.fmax(0.0, one.get("share", ca.SX(1)))) for one in now))
    qd = resolve(at, kp, gain, share)
    watch = detector(at, qd)
    signals, metrics = gain_signals(at, gain)
    rules = tuple(f"rule {i + 1}" for i in range(len(spec.rulebase.rules)))
    tuned: list[ca.SX] = []
    for i, axis in enumerate(spec.axes):
        found = tuner(**errors[i], oscillating=watch.result.count)
        suffix = "" if axes == 1 else f"_{axis}"
        if "increment" in found:
            signals[Signal(f"gain_increment{suffix}", "1/s", f"increment of Kc of {axis}")] = found["increment"]
        if "share" in found:
            signals[Signal(f"share{suffix}", "1", f"part of the motion for {axis} that is carried out")] = share[i]
        next_gain = ca.fmax(0.0, gain[i] + found.get("increment", ca.SX(0)))
        tuned.append(next_gain if spec.gain_limit is None else ca.fmin(limit, next_gain))
        strengths = Signal(f"firing_strength{suffix}", "1", f"firing strength of the rules for {axis}", rules)
        signals[strengths] = found["firing_strength"]
    parameters = {Parameter("controller.kp"): kp, Parameter("controller.gain", axes): first, **own}
    if spec.gain_limit is not None:
        parameters[Parameter("controller.gain_limit")] = limit
    memory = (gain, ca.vertcat(*tuned), first)
    return finish(at, qd, watch, {**parameters, **tuner.parameters}, signals, metrics, memory)
