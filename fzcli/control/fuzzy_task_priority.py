"""Task priority under a Mamdani rule base: what it tunes is the gain, what it lets go is the base, not the tip."""

from typing import Annotated, ClassVar, Literal

import casadi as ca
from pydantic import Field, model_validator

from fzcli.control.law import Law
from fzcli.control.task_priority import BaseDamping, by_priority
from fzcli.control.tuned_gain import TunedGainSpec, tuned_law
from fzcli.fuzzy.check import check_rulebase
from fzcli.fuzzy.grammar import variables
from fzcli.model import RobotModel
from fzcli.spec.quantity import Parameter
from fzcli.spec.units import Length


class FuzzyTaskPrioritySpec(TunedGainSpec):
    """`TaskPrioritySpec`'s law; Kc <- max(0, Kc + increment), and only a share of the base's motion carried out."""

    INPUTS: ClassVar[tuple[str, ...]] = ("error", "oscillating", "tip_error")
    OUTPUTS: ClassVar[tuple[str, ...]] = ("increment", "share")

    kind: Literal["fuzzy_task_priority"] = "fuzzy_task_priority"
    base_damping: BaseDamping = 3e-3
    tip_error_scale: Annotated[
        Length, Field(gt=0, description="tip error (m; rad of an orientation) that the rule base sees as 1")
    ] = 0.01

    @classmethod
    def check_variables(cls, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
        """Any of the inputs and outputs will do."""
        if not set(inputs) <= set(cls.INPUTS) or not set(outputs) <= set(cls.OUTPUTS):
            raise ValueError(
                f"the rule base must map any of {', '.join(cls.INPUTS)} to any of {', '.join(cls.OUTPUTS)}; "
                f"it maps {', '.join(inputs)} to {', '.join(outputs)}"
            )

    @model_validator(mode="after")
    def _share_does_not_wait(self) -> "FuzzyTaskPrioritySpec":
        for i, rule in enumerate(check_rulebase(self.rulebase)):
            shares = any(conclusion.variable == "share" for conclusion in rule.conclusions)
            if shares and "oscillating" in variables(rule.condition):
                raise ValueError(
                    f"rules.{i}: the share is of this step, oscillation shows after it; a rule of the share cannot "
                    "speak of it"
                )
        return self


def build(model: RobotModel, spec: FuzzyTaskPrioritySpec) -> Law:
    """The tuner on top of task priority: see `tuned_law`. Our own combination."""
    damping, scale = ca.SX.sym("base_damping"), ca.SX.sym("tip_error_scale")
    own = {Parameter("controller.base_damping"): damping, Parameter("controller.tip_error_scale"): scale}
    return tuned_law(
        model, spec, lambda at, kp, gain, share: by_priority(at, kp, gain, damping, share), own, scale
    )
