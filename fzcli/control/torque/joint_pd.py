"""Proportional and derivative feedback at every joint, without any model."""

from typing import Annotated, Literal

import casadi as ca
from pydantic import Field

from fzcli.control.torque.law import TorqueInputs, TorqueLaw, make_torque_law, parameter
from fzcli.model import RobotModel
from fzcli.spec.base import SpecModel

Gain = Annotated[float, Field(gt=0)]


class JointPdSpec(SpecModel):
    """torque = stiffness (q_d - q) + damping (qd_d - qd)."""

    kind: Literal["joint_pd"] = "joint_pd"
    stiffness: Annotated[
        Gain | tuple[Gain, ...], Field(description="one number, or one a joint; N m/rad or N/m")
    ]
    damping: Annotated[Gain | tuple[Gain, ...], Field(description="one number, or one a joint; N m s/rad or N s/m")]


def build(model: RobotModel, spec: JointPdSpec) -> TorqueLaw:
    """Plain joint feedback; the reference's velocity is followed, its acceleration is not fed forward."""
    inputs = TorqueInputs.symbols(model.n)
    stiffness, damping = ca.SX.sym("stiffness", model.n), ca.SX.sym("damping", model.n)
    torque = stiffness * (inputs.q_wanted - inputs.q) + damping * (inputs.qd_wanted - inputs.qd)
    parameters = {parameter("stiffness", model.n): stiffness, parameter("damping", model.n): damping}
    return make_torque_law(inputs, torque, parameters)
