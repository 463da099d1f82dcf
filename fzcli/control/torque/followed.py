"""Tip and base as a torque controller sees them: errors, their rates, and Jacobian rows of the free robot."""

import math
from dataclasses import dataclass

import casadi as ca

from fzcli.control.constraint import ANGLES
from fzcli.control.torque.law import TorqueInputs
from fzcli.model import RobotModel
from fzcli.model.algebra import dot, rotate
from fzcli.model.attitude import (
    angle_rate_rows,
    conjugate,
    multiply,
    quaternion_from_matrix,
    roll_pitch_yaw,
    rotation_matrix,
    rotation_vector,
)


@dataclass(frozen=True)
class Followed:
    """``error`` (k) wanted less measured, ``rate`` (k) of it, and ``rows`` (k, n): what the joints do to it."""

    error: ca.SX
    rate: ca.SX
    rows: ca.SX


def tip_followed(model: RobotModel, inputs: TorqueInputs, tip: str | None, pose: bool) -> Followed:
    """The tip's position (3), with ``pose`` its rotation vector's error too (6); world axes.

    Errors are measured, by geometry alone; the rows are those of the generalized Jacobian, by the masses that the
    controller believes in.
    """
    moved = (inputs.q, inputs.base_quat, inputs.qd, inputs.base_twist)
    position, rotation, twist = model.function("tip_state", tip)(*moved)
    rows = model.function("generalized_jacobian", tip)(inputs.q, inputs.base_quat)
    error = inputs.tip_position_wanted - inputs.base_position - position
    rate = inputs.tip_velocity_wanted - twist[:3]
    if not pose:
        return Followed(error, rate, rows[:3, :])
    turn = rotation_vector(multiply(inputs.tip_quat_wanted, conjugate(quaternion_from_matrix(rotation))))
    rates = ca.vertcat(rate, inputs.tip_rate_wanted - twist[3:])
    return Followed(ca.vertcat(error, turn), rates, rows)


def base_followed(model: RobotModel, inputs: TorqueInputs, names: tuple[str, ...]) -> Followed:
    """The named angles of the base, or with ``rotation_vector`` its whole attitude (world axes).

    Roll and yaw are taken times the cosine of the pitch: their rows stay finite where they are undefined.
    """
    W = model.function("body")(inputs.q)[4]
    R, wanted = rotation_matrix(inputs.base_quat), rotation_matrix(inputs.base_quat_wanted)
    if names == ("rotation_vector",):
        error = rotation_vector(multiply(inputs.base_quat_wanted, conjugate(inputs.base_quat)))
        return Followed(error, inputs.base_rate_wanted - inputs.base_twist[3:], ca.mtimes(R, W))
    picked = [ANGLES.index(name) for name in names]
    E, error = angle_rate_rows(R), roll_pitch_yaw(wanted) - roll_pitch_yaw(R)
    error = error - 2 * math.pi * ca.floor(error * (0.5 / math.pi) + 0.5)
    rate = ca.mtimes(angle_rate_rows(wanted), rotate(wanted.T, inputs.base_rate_wanted))
    rate = rate - ca.mtimes(E, rotate(R.T, inputs.base_twist[3:]))
    rows, cosine = ca.mtimes(E, W), ca.sqrt(R[2, 1] * R[2, 1] + R[2, 2] * R[2, 2])
    share = [1 if ANGLES[i] == "pitch" else cosine for i in picked]
    return Followed(
        ca.vertcat(*(error[i] * by for i, by in zip(picked, share, strict=True))),
        ca.vertcat(*(rate[i] * by for i, by in zip(picked, share, strict=True))),
        ca.vertcat(*(rows[i, :] * by for i, by in zip(picked, share, strict=True))),
    )


def size(vector: ca.SX) -> ca.SX:
    """Euclidean norm."""
    return ca.sqrt(dot(vector, vector))


