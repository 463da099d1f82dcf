"""Transposed generalized Jacobian: a spring and a damper pull the tip along, no inverse of anything is taken."""

from typing import Annotated, Literal

import casadi as ca
from pydantic import Field

from fzcli.control.torque.followed import tip_followed
from fzcli.control.torque.law import TorqueInputs, TorqueLaw, make_torque_law, parameter
from fzcli.model import RobotModel
from fzcli.spec.base import SpecModel


class TransposedJacobianSpec(SpecModel):
    """torque = J_g^T (stiffness e + damping de/dt) - joint_damping qd."""

    kind: Literal["transposed_jacobian"] = "transposed_jacobian"
    task: Literal["position", "pose"] = "position"
    tip: Annotated[str | None, Field(description="the tip that is pulled; the first by default")] = None
    stiffness: Annotated[float, Field(gt=0, description="of the tip, N/m")] = 400.0
    damping: Annotated[float, Field(ge=0, description="of the tip, N s/m")] = 120.0
    turn_stiffness: Annotated[float, Field(gt=0, description="of the tip's turn, for task pose, N m/rad")] = 40.0
    turn_damping: Annotated[float, Field(ge=0, description="of the tip's turn, for task pose, N m s/rad")] = 12.0
    joint_damping: Annotated[
        float, Field(ge=0, description="of every joint, so that null-space motion dies out, N m s/rad or N s/m")
    ] = 1.0


def build(model: RobotModel, spec: TransposedJacobianSpec) -> TorqueLaw:
    """Masutani, Miyazaki and Arimoto 1989, for a target that moves; the joints' reference is not looked at."""
    inputs = TorqueInputs.symbols(model.n)
    names = ("stiffness", "damping", "turn_stiffness", "turn_damping", "joint_damping")
    gain = {name: ca.SX.sym(name) for name in names}
    tip = tip_followed(model, inputs, spec.tip, spec.task == "pose")
    pull = gain["stiffness"] * tip.error[:3] + gain["damping"] * tip.rate[:3]
    if spec.task == "pose":
        turn = gain["turn_stiffness"] * tip.error[3:] + gain["turn_damping"] * tip.rate[3:]
        pull = ca.vertcat(pull, turn)
    torque = ca.mtimes(tip.rows.T, pull) - gain["joint_damping"] * inputs.qd
    return make_torque_law(inputs, torque, {parameter(name): symbol for name, symbol in gain.items()})
