"""Computed torque: the model's inverse dynamics behind linear feedback at every joint."""

from typing import Annotated, Literal

import casadi as ca
from pydantic import Field

from fzcli.control.torque.law import TorqueInputs, TorqueLaw, make_torque_law, parameter
from fzcli.model import RobotModel
from fzcli.model.payload import PAYLOAD
from fzcli.spec.base import SpecModel
from fzcli.spec.units import Frequency


class ComputedTorqueSpec(SpecModel):
    """qdd = qdd_d + 2 damping frequency (qd_d - qd) + frequency^2 (q_d - q), through the inverse dynamics."""

    kind: Literal["computed_torque"] = "computed_torque"
    frequency: Annotated[Frequency, Field(gt=0, description="natural, of the error, rad/s")] = 20.0
    damping: Annotated[float, Field(gt=0, description="ratio of critical damping")] = 1.0


def build(model: RobotModel, spec: ComputedTorqueSpec) -> TorqueLaw:
    """Feedback linearisation on the free base, joint friction included."""
    inputs = TorqueInputs.symbols(model.n)
    frequency, damping = ca.SX.sym("frequency"), ca.SX.sym("damping")
    faster, beside = inputs.qd_wanted - inputs.qd, inputs.q_wanted - inputs.q
    qdd = inputs.qdd_wanted + frequency * (2 * damping * faster + frequency * beside)
    parameters = {parameter("frequency"): frequency, parameter("damping"): damping}
    return make_torque_law(inputs, inverse_dynamics(model, inputs, qdd), parameters)


def inverse_dynamics(model: RobotModel, inputs: TorqueInputs, qdd: ca.SX) -> ca.SX:
    """Torques (n) behind joint accelerations (n) of the robot as the controller knows it, where nothing else acts."""
    none = ca.SX.zeros(6)
    moved = (inputs.q, inputs.base_quat, inputs.qd, inputs.base_twist)
    return model.function("free_inverse_dynamics")(*moved, qdd, none, none, ca.SX.zeros(PAYLOAD))[0]
