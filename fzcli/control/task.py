"""The primary task of equation 1: error and Jacobian rows of the tip, and its resolved rates.

All in the axes of the base link's frame: the pseudo-inverse does not depend on the axes, and turning
the wanted motion into them is cheaper than turning the Jacobian out.
"""

from dataclasses import dataclass
from typing import Literal

import casadi as ca

from fzcli.control.law import LawInputs
from fzcli.model import RobotModel
from fzcli.model.algebra import cross, dot, gram, rotate, symmetric_inverse
from fzcli.model.attitude import conjugate, multiply, quaternion_from_matrix, rotation_matrix, rotation_vector

TaskName = Literal["position", "orientation", "pose"]
TASK_ROWS = {"position": slice(0, 3), "orientation": slice(3, 6), "pose": slice(0, 6)}


@dataclass(frozen=True)
class Body:
    """The robot at the law's state, base axes: see `RobotModel.function("body")`; R is body to world.

    ``drift`` (3): the base's angular velocity that the angular momentum alone gives.
    """

    com: ca.SX
    com_jacobian: ca.SX
    base_rate: ca.SX
    R: ca.SX
    drift: ca.SX

    def angular_velocity(self, qd: ca.SX) -> ca.SX:
        """Of the base, (3) [rad/s], base axes."""
        return ca.mtimes(self.base_rate, qd) + self.drift

    def origin_velocity(self, qd: ca.SX, rate: ca.SX) -> ca.SX:
        """Of the base frame's origin relative to the CoM's velocity, (3) [m/s], world axes."""
        return -rotate(self.R, ca.mtimes(self.com_jacobian, qd) + cross(rate, self.com))


def body_at(model: RobotModel, inputs: LawInputs) -> Body:
    """The model's base-frame quantities as a law needs them."""
    com, inertia, com_jacobian, _, base_rate = model.function("body")(inputs.q)
    R = rotation_matrix(inputs.base_quat)
    if not model.floating:
        zero = ca.SX.zeros(3)
        return Body(zero, ca.SX.zeros(3, model.n), base_rate, R, zero)
    drift = rotate(symmetric_inverse(inertia), rotate(R.T, inputs.angular_momentum))
    return Body(com, com_jacobian, base_rate, R, drift)


@dataclass(frozen=True)
class Task:
    """Error (m), wanted rate (m) with the drift taken off, Jacobian J (m, n) and (J J^T + damping E)^-1.

    ``error_norm`` is that of the position where the task has one, else of the orientation;
    ``angle_norm`` that of a pose's orientation.
    """

    error: ca.SX
    rate: ca.SX
    jacobian: ca.SX
    inverse: ca.SX
    error_norm: ca.SX
    angle_norm: ca.SX | None

    @property
    def inverse_trace(self) -> ca.SX:
        """Trace of (J J^T + damping E)^-1: large where the task is nearly singular."""
        return ca.trace(self.inverse)

    def resolve(self, kp: ca.SX, secondary: ca.SX) -> ca.SX:
        """Joint rates (n): J+ (Kp e + rate) + (E - J+ J) secondary, with one solve."""
        wanted = kp * self.error + self.rate - ca.mtimes(self.jacobian, secondary)
        return secondary + ca.mtimes(self.jacobian.T, ca.mtimes(self.inverse, wanted))


def task_of(
    model: RobotModel, inputs: LawInputs, body: Body, name: TaskName, damping: float, tip: str | None
) -> Task:
    """The task ``name`` at the law's state; ``damping`` is lambda squared in J^T (J J^T + damping E)^-1."""
    position, rotation, jacobian = model.function("tip", tip)(inputs.q)
    errors: list[ca.SX] = []
    rates: list[ca.SX] = []
    norms: list[ca.SX] = []
    if name in ("position", "pose"):
        error = rotate(body.R.T, inputs.tip_position) - position
        errors.append(error)
        rates.append(rotate(body.R.T, inputs.tip_velocity) - cross(body.drift, position))
        norms.append(ca.sqrt(dot(error, error)))
    if name in ("orientation", "pose"):
        tip_in_base = quaternion_from_matrix(rotation)
        wanted = multiply(conjugate(inputs.base_quat), inputs.tip_quat)
        error = rotation_vector(multiply(wanted, conjugate(tip_in_base)))
        errors.append(error)
        rates.append(rotate(body.R.T, inputs.tip_rate) - body.drift)
        norms.append(ca.sqrt(dot(error, error)))
    J = jacobian[TASK_ROWS[name], :]
    inverse = symmetric_inverse(gram(J) + damping * ca.SX.eye(J.shape[0]))
    angle = norms[1] if name == "pose" else None
    return Task(ca.vertcat(*errors), ca.vertcat(*rates), J, inverse, norms[0], angle)
