"""How far a pose is from another."""

import casadi as ca

from fzcli.model.algebra import cross, dot
from fzcli.model.attitude import quaternion_from_matrix, rotation_vector

TINY = 1e-150  # too small to count, yet the length of a vector that is zero but for it has a derivative


def pose_error(position: ca.SX, rotation: ca.SX, goal: ca.SX, goal_rotation: ca.SX) -> ca.SX:
    """(6): goal - position [m], then the rotation vector [rad] from the rotation (3, 3) to the goal's, same axes."""
    quat = quaternion_from_matrix(ca.mtimes(goal_rotation, rotation.T))
    return ca.vertcat(goal - position, rotation_vector(quat + ca.vertcat(0, TINY, 0, 0)))


def turn_between(rotation: ca.SX, goal: ca.SX) -> tuple[ca.SX, ca.SX]:
    """The rotation vector (3) [rad] from a rotation (3, 3) to a goal's, same axes, and its angle [rad].

    Cheaper than by quaternions; at half a turn exactly the axis is lost: the vector is zero, the angle pi.
    """
    pairs = [(rotation[:, k], goal[:, k]) for k in range(3)]
    axis = 0.5 * sum((cross(a, b) for a, b in pairs), ca.SX.zeros(3))
    sine = ca.sqrt(dot(axis, axis) + TINY**2)
    angle = ca.atan2(sine, 0.5 * (sum((dot(a, b) for a, b in pairs), ca.SX(0)) - 1.0))
    return axis * (angle / sine), angle
