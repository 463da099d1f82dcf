"""Damped least squares on the generalized Jacobian: the baseline that modified FABRIK is measured against."""

from collections.abc import Iterator
from typing import Annotated, Literal

import casadi as ca
from pydantic import Field

from fzcli.control.aim import Aim, aim_at
from fzcli.control.law import Law, LawInputs, Misfit
from fzcli.control.reaching import ReachingSpec, chain_misfits, period_caps, reaching_law, step_bounds
from fzcli.model import RobotModel
from fzcli.model.algebra import cross, dot, gram, symmetric_inverse
from fzcli.model.attitude import quaternion_from_matrix, rotation_vector
from fzcli.spec.quantity import Parameter
from fzcli.spec.robot import Robot
from fzcli.spec.units import Frequency


class DlsSpec(ReachingSpec):
    """qd = J^T (J J^T + damping^2 E)^-1 gain e, brought within the joints' speeds, then their limits."""

    kind: Literal["dls"] = "dls"
    gain: Annotated[Frequency, Field(gt=0, description="of the error, 1/s")] = 20.0
    damping: Annotated[float, Field(gt=0, description="lambda in J J^T + lambda^2 E")] = 0.05
    saturate: Annotated[
        Literal["alike", "each"], Field(description="speeds: all joints scaled alike, so that the way is kept, or each")
    ] = "alike"


def build(model: RobotModel, spec: DlsSpec) -> Law:
    """Wampler 1986 with the generalized Jacobian of Umetani and Yoshida 1989; for ``approach`` the roll is free."""
    inputs = LawInputs.symbols(model.n)
    aim = aim_at(model, inputs, spec.tip)
    gain, damping = ca.SX.sym("gain"), ca.SX.sym("damping")
    error, J = _task(spec, aim)
    inverse = symmetric_inverse(gram(J) + damping * damping * ca.SX.eye(J.shape[0]))
    way = ca.mtimes(J.T, ca.mtimes(inverse, gain * error)) * inputs.period
    caps = period_caps(model, inputs.period)
    if spec.saturate == "alike":
        ratio = ca.SX(1)
        for j in range(model.n):
            ratio = ca.fmax(ratio, ca.fabs(way[j]) / caps[j])
        way = way / ratio
    low, high = step_bounds(model, inputs.q, caps)
    way = ca.vertcat(*(ca.fmin(high[j], ca.fmax(low[j], way[j])) for j in range(model.n)))
    parameters = {Parameter("controller.gain"): gain, Parameter("controller.damping"): damping}
    return reaching_law(model, spec, inputs, aim, way / inputs.period, parameters=parameters)


def misfits(robot: Robot, spec: DlsSpec) -> Iterator[Misfit]:
    """Where the law does not suit the robot: only its restart needs chain points."""
    if spec.restart is not None:
        yield from chain_misfits(robot, spec)


def _task(spec: DlsSpec, aim: Aim) -> tuple[ca.SX, ca.SX]:
    """Error and Jacobian rows; where a direction is wanted the turn is the one that lays z on it, without roll."""
    linear, angular = aim.jacobian[:3, :], aim.jacobian[3:, :]
    away = aim.target - aim.position
    if spec.task == "position":
        return away, linear
    if spec.task == "pose":
        turn = rotation_vector(quaternion_from_matrix(ca.mtimes(aim.wanted, aim.rotation.T)))
        return ca.vertcat(away, turn), aim.jacobian
    z = aim.rotation[:, 2]
    across = cross(z, aim.direction)
    turn = across * (aim.angle / ca.sqrt(ca.fmax(dot(across, across), 1e-300)))
    return ca.vertcat(away, turn), ca.vertcat(linear, angular - ca.mtimes(z, ca.mtimes(z.T, angular)))
