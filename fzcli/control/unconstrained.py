"""Closed-loop inverse kinematics of the primary task alone; the constrained angles are only watched."""

from typing import Literal

import casadi as ca

from fzcli.control.equation1 import Equation1Spec, detector, finish, situation
from fzcli.control.law import Law
from fzcli.model import RobotModel
from fzcli.spec.quantity import Parameter


class UnconstrainedSpec(Equation1Spec):
    """qd = J+ (Kp e + xd_d)."""

    kind: Literal["unconstrained"] = "unconstrained"


def build(model: RobotModel, spec: UnconstrainedSpec) -> Law:
    """Equation 1 with Kc = 0 (Bulgarelli 2011)."""
    at = situation(model, spec)
    kp = ca.SX.sym("kp")
    qd = at.task.resolve(kp, ca.SX.zeros(model.n))
    return finish(at, qd, detector(at, qd), {Parameter("controller.kp"): kp}, {})
