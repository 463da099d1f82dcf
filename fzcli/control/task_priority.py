"""Task priority: the tip first, the base by what it leaves free, counting in what the tip's motion does to the base.

Where equation 1 pulls the base back after it has turned, this keeps it from turning.
"""

from typing import Annotated, Literal

import casadi as ca
from pydantic import Field, model_validator

from fzcli.control.clik import Gain, check_gain_count
from fzcli.control.equation1 import Equation1Spec, Situation, detector, finish, situation
from fzcli.control.law import Law
from fzcli.model import RobotModel
from fzcli.model.algebra import gram, symmetric_inverse
from fzcli.spec.quantity import Parameter

BaseDamping = Annotated[
    float, Field(gt=0, description="lambda squared of the base's rows in what the task leaves free")
]


class TaskPrioritySpec(Equation1Spec):
    """qd = J+ v + M^T (M M^T + base_damping E)^-1 (Kc ec + rate - Jc J+ v), M = Jc (E - J+ J), v = Kp e + xd_d."""

    kind: Literal["task_priority"] = "task_priority"
    gain: Annotated[
        Gain | tuple[Gain, ...],
        Field(description="Kc, at which the base's errors die out: one number, or one an axis, 1/s"),
    ]
    base_damping: BaseDamping = 3e-3

    @model_validator(mode="after")
    def _one_gain_an_axis(self) -> "TaskPrioritySpec":
        check_gain_count(self.gain, self.axes)
        return self


def build(model: RobotModel, spec: TaskPrioritySpec) -> Law:
    """Nakamura, Hanafusa, Yoshikawa 1987; the inverse of the second task damped as in Nakamura, Hanafusa 1986."""
    at = situation(model, spec)
    axes = len(spec.axes)
    kp, gain, damping = ca.SX.sym("kp"), ca.SX.sym("gain", axes), ca.SX.sym("base_damping")
    qd = by_priority(at, kp, gain, damping)
    parameters = {
        Parameter("controller.kp"): kp,
        Parameter("controller.gain", axes): gain,
        Parameter("controller.base_damping"): damping,
    }
    return finish(at, qd, detector(at, qd), parameters, {})


def by_priority(at: Situation, kp: ca.SX, gain: ca.SX, damping: ca.SX, share: ca.SX | None = None) -> ca.SX:
    """Joint rates (n) of the law; ``gain`` (k), ``damping`` scalar, ``share`` (k): part of the base's motion wanted."""
    first = at.task.resolve(kp, ca.SX.zeros(at.model.n))
    rows, J = at.constraint.rows, at.task.jacobian
    free = rows - ca.mtimes(ca.mtimes(ca.mtimes(rows, J.T), at.task.inverse), J)
    left = gain * at.constraint.error + at.constraint.rate - ca.mtimes(rows, first)
    wanted = left if share is None else share * left
    solved = ca.mtimes(symmetric_inverse(gram(free) + damping * ca.SX.eye(rows.shape[0])), wanted)
    return first + ca.mtimes(free.T, solved)
