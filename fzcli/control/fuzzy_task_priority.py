"""Task priority with its gain tuned by a Mamdani rule base: the tuner of Bulgarelli 2011 on a law that looks ahead."""

from typing import Literal

import casadi as ca

from fzcli.control.law import Law
from fzcli.control.task_priority import BaseDamping, by_priority
from fzcli.control.tuned_gain import TunedGainSpec, tuned_law
from fzcli.model import RobotModel
from fzcli.spec.quantity import Parameter


class FuzzyTaskPrioritySpec(TunedGainSpec):
    """`TaskPrioritySpec`'s law with Kc <- max(0, Kc + increment), once a control step and axis."""

    kind: Literal["fuzzy_task_priority"] = "fuzzy_task_priority"
    base_damping: BaseDamping = 3e-3


def build(model: RobotModel, spec: FuzzyTaskPrioritySpec) -> Law:
    """The tuner on top of task priority: see `tuned_law`. Our own combination."""
    damping = ca.SX.sym("base_damping")
    own = {Parameter("controller.base_damping"): damping}
    return tuned_law(model, spec, lambda at, kp, gain: by_priority(at, kp, gain, damping), own)
