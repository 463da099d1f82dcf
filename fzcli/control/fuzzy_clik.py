"""Equation 1 with its null-space gain tuned by a Mamdani rule base (Bulgarelli 2011, section 3)."""

from typing import Literal

from fzcli.control.law import Law
from fzcli.control.tuned_gain import TunedGainSpec, tuned_law
from fzcli.model import RobotModel


class FuzzyClikSpec(TunedGainSpec):
    """Equation 1 with Kc <- max(0, Kc + increment), once a control step and axis."""

    kind: Literal["fuzzy_clik"] = "fuzzy_clik"


def build(model: RobotModel, spec: FuzzyClikSpec) -> Law:
    """The tuner on top of equation 1: see `tuned_law`."""
    return tuned_law(model, spec, lambda at, kp, gain, _: at.task.resolve(kp, at.constraint.gradient(gain)), {})
