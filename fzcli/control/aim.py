"""Where a tip is and where it is to be, as the laws that bring it there see it."""

from dataclasses import dataclass

import casadi as ca

from fzcli.control.law import LawInputs
from fzcli.model import RobotModel
from fzcli.model.algebra import angle_between, cross, dot, rotate
from fzcli.model.attitude import conjugate, exponential, multiply, rotation_matrix


@dataclass(frozen=True)
class Aim:
    """The tip, and where it is to be at the end of the period; base axes, positions relative to the CoM.

    position (3), rotation (3, 3), jacobian (6, n) of the tip; target (3); wanted (3, 3), the tip's axes;
    velocity (3), rate (3) of the target. ``distance`` [m] and ``angle`` [rad] are left between tip and
    target, the angle between the tip's z and the wanted one.
    """

    position: ca.SX
    rotation: ca.SX
    jacobian: ca.SX
    target: ca.SX
    wanted: ca.SX
    velocity: ca.SX
    rate: ca.SX

    @property
    def direction(self) -> ca.SX:
        """The wanted z of the tip, (3)."""
        return self.wanted[:, 2]

    @property
    def distance(self) -> ca.SX:
        """Left between tip and target [m]."""
        away = self.target - self.position
        return ca.sqrt(dot(away, away))

    @property
    def angle(self) -> ca.SX:
        """Left between the tip's z and the wanted one [rad]."""
        return angle_between(self.rotation[:, 2], self.direction)

    @property
    def roll(self) -> ca.SX:
        """The turn about the tip's z that brings its x nearest to the wanted one [rad], (-pi, pi]."""
        x, z, wanted = self.rotation[:, 0], self.rotation[:, 2], self.wanted[:, 0]
        return ca.atan2(dot(z, cross(x, wanted)), dot(x, wanted) - dot(z, x) * dot(z, wanted))


def aim_at(model: RobotModel, inputs: LawInputs, tip: str | None) -> Aim:
    """The tip's situation at the law's state; a moving target is taken where it will be after the period."""
    position, rotation, jacobian = model.function("tip", tip)(inputs.q)
    R = rotation_matrix(inputs.base_quat)
    target = inputs.tip_position + inputs.tip_velocity * inputs.period
    quat = multiply(exponential(inputs.tip_rate * inputs.period), inputs.tip_quat)
    wanted = rotation_matrix(multiply(conjugate(inputs.base_quat), quat))
    return Aim(
        position,
        rotation,
        jacobian,
        rotate(R.T, target),
        wanted,
        rotate(R.T, inputs.tip_velocity),
        rotate(R.T, inputs.tip_rate),
    )
