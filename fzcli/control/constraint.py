"""The constraint task: base angles that are to follow their reference, with diagonal gain Kc."""

import math
from dataclasses import dataclass
from typing import Literal

import casadi as ca

from fzcli.control.law import LawInputs
from fzcli.control.task import Body
from fzcli.model.attitude import angle_rate_rows, multiply, roll_pitch_yaw, rotation_vector
from fzcli.spec.quantity import Metric, Signal

ANGLES = ("roll", "pitch", "yaw")
AXES = ("x", "y", "z")
ConstraintName = Literal["roll", "pitch", "yaw", "rotation_vector"]


@dataclass(frozen=True)
class Constraint:
    """``error`` (k) reference less angle [rad], Jacobian ``rows`` (k, n), ``rate`` (k) wanted less drift.

    ``angle`` (k) the base's own angles; ``names`` of the components.
    """

    names: tuple[str, ...]
    error: ca.SX
    angle: ca.SX
    rows: ca.SX
    rate: ca.SX

    def gradient(self, gain: ca.SX) -> ca.SX:
        """Jc^T (Kc ec + rate), (n): equation 1's secondary motion; rate is 0 for a base that is to stay."""
        return ca.mtimes(self.rows.T, gain * self.error + self.rate)

    def signals(self) -> dict[Signal, ca.SX]:
        """The angles and their errors as named signals, one scalar a component."""
        named: dict[Signal, ca.SX] = {}
        for i, name in enumerate(self.names):
            named[Signal(name, "rad", f"{name} of the base")] = self.angle[i]
            named[Signal(f"{name}_error", "rad", f"reference less {name} of the base")] = self.error[i]
            named[Signal(f"{name}_abs", "rad", f"size of the base's {name}")] = ca.fabs(self.angle[i])
        return named

    def metrics(self) -> tuple[Metric, ...]:
        """Largest and mean size of every constrained angle."""
        found: list[Metric] = []
        for name in self.names:
            found.append(Metric(f"{name}_abs_max", f"{name}_abs", "max", "rad", f"largest |{name}| of the base"))
            found.append(Metric(f"{name}_abs_mean", f"{name}_abs", "mean", "rad", f"mean |{name}| of the base"))
        return tuple(found)


def components(names: tuple[str, ...]) -> tuple[str, ...]:
    """What the constraint's components are called: angles, or the rotation vector's axes."""
    if names == ("rotation_vector",):
        return tuple(f"rotation_{axis}" for axis in AXES)
    return names


def constraint_of(inputs: LawInputs, body: Body, names: tuple[str, ...]) -> Constraint:
    """The constraint on base angles ``names``, any of roll, pitch, yaw; or on the rotation vector.

    Roll, pitch, yaw are outputs of the attitude, never integrated; the rows are those of the
    analytic Jacobian. The rotation vector's error is that of the attitude itself, world axes, and
    has no singular attitude below a half turn.
    """
    if names == ("rotation_vector",):
        wanted = _quaternion_from_angles(inputs.base_angles)
        conjugated = ca.vertcat(inputs.base_quat[0], -inputs.base_quat[1:4])
        error = rotation_vector(multiply(wanted, conjugated))
        rows = ca.mtimes(body.R, body.base_rate)
        rate = _rate_from_angles(inputs) - ca.mtimes(body.R, body.drift)
        return Constraint(components(names), error, rotation_vector(inputs.base_quat), rows, rate)
    picked = [ANGLES.index(name) for name in names]
    angles = roll_pitch_yaw(body.R)
    rows_of_rate = angle_rate_rows(body.R)
    angle = ca.vertcat(*(angles[i] for i in picked))
    wanted_angle = ca.vertcat(*(inputs.base_angles[i] for i in picked))
    wanted_rate = ca.vertcat(*(inputs.base_rates[i] for i in picked))
    E = ca.vertcat(*(rows_of_rate[i, :] for i in picked))
    rate = wanted_rate - ca.mtimes(E, body.drift)
    error = wanted_angle - angle
    error = error - 2 * math.pi * ca.floor(error * (0.5 / math.pi) + 0.5)  # the short way round
    return Constraint(names, error, angle, ca.mtimes(E, body.base_rate), rate)


def virtual_joint_rates(body: Body, qd: ca.SX, rate: ca.SX, names: tuple[str, ...]) -> ca.SX:
    """Velocities of the base's virtual joints (6): linear, then roll, pitch, yaw rates.

    Under a rotation-vector constraint the angular velocity (world axes) stands for the latter.
    """
    angular = body.R if names == ("rotation_vector",) else angle_rate_rows(body.R)
    return ca.vertcat(body.origin_velocity(qd, rate), ca.mtimes(angular, rate))


def _quaternion_from_angles(angles: ca.SX) -> ca.SX:
    half = 0.5 * angles
    turns = []
    for i in (2, 1, 0):
        quat = ca.SX.zeros(4)
        quat[0], quat[i + 1] = ca.cos(half[i]), ca.sin(half[i])
        turns.append(quat)
    return multiply(multiply(turns[0], turns[1]), turns[2])


def _rate_from_angles(inputs: LawInputs) -> ca.SX:
    """World angular velocity of the reference attitude whose angles move with base_rates."""
    cy, sy = ca.cos(inputs.base_angles[2]), ca.sin(inputs.base_angles[2])
    cp, sp = ca.cos(inputs.base_angles[1]), ca.sin(inputs.base_angles[1])
    roll, pitch, yaw = inputs.base_rates[0], inputs.base_rates[1], inputs.base_rates[2]
    return ca.vertcat(cy * cp * roll - sy * pitch, sy * cp * roll + cy * pitch, yaw - sp * roll)
