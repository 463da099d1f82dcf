"""Exact inverse kinematics of arms built as Universal Robots': three parallel axes, then two that meet.

The point where axes 5 and 6 meet keeps its height along the parallel axes, which gives the shoulder; the last
axis' slope against them gives the bend of joint 5; what is left is a planar arm of three hinges.
"""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.model.algebra import dot, rotate
from fzcli.model.inverse.arm import Arm
from fzcli.model.inverse.branches import (
    ALMOST,
    SINGULAR,
    ClosedForm,
    Signs,
    chosen,
    closed_form,
    elbow_angles,
    flat,
    wrist_angles,
)
from fzcli.model.inverse.hinges import about, constant, height_angles, rotation_about, turn_to

Array = NDArray[np.float64]


def meeting_point(arm: Arm) -> Array:
    """The point (3) [m] at rest midway between axes 5 and 6 where they are closest, base frame."""
    u, w = arm.axes[4], arm.axes[5]
    between = arm.origins[5] - arm.origins[4]
    s, t = np.linalg.lstsq(np.column_stack([u, -w]), between, rcond=None)[0]
    return np.asarray(0.5 * (arm.origins[4] + s * u + arm.origins[5] + t * w))


def unfit(arm: Arm) -> str:
    """Why this closed form does not serve an arm; empty where it does."""
    if len(arm.joints) != 6 or not arm.hinged:
        return "it has not six hinges"
    names = [body.joint for body in arm.bodies]
    z = arm.axes
    for j in (2, 3):
        if np.linalg.norm(np.cross(z[1], z[j])) > ALMOST:
            return f"the axes of {names[1]} and {names[j]} are not parallel"
    for i, j in ((0, 1), (3, 4), (4, 5)):
        if np.linalg.norm(np.cross(z[i], z[j])) < ALMOST:
            return f"the axes of {names[i]} and {names[j]} are parallel"
    gap = float(np.linalg.norm(np.cross(z[5], meeting_point(arm) - arm.origins[5])))
    if gap > ALMOST:
        return f"the axes of {names[4]} and {names[5]} do not meet"
    for i in (1, 2):
        if np.linalg.norm(flat(arm.origins[i + 1] - arm.origins[i], z[1])) < ALMOST:
            return f"the axes of {names[i]} and {names[i + 1]} are one"
    return ""


def build(arm: Arm) -> ClosedForm:
    """The eight branches: shoulder left or right, elbow up or down (towards axis 1), wrist flip or noflip.

    "left" has joint 1 ahead, in its own sense, of the direction to where axes 5 and 6 meet; "noflip" has joint 5
    ahead of where axis 6 lies along the parallel axes.
    """
    z, o, meet = arm.axes, arm.origins, meeting_point(arm)
    senses = [float(np.sign(z[1] @ z[k])) for k in (2, 3)]
    upper, lower = flat(o[2] - o[1], z[1]), flat(o[3] - o[2], z[1])
    side = np.cross(z[1], np.eye(3)[int(np.argmin(np.abs(z[1])))])

    def branch(position: ca.SX, rotation: ca.SX, near: ca.SX, choice: Signs) -> ca.SX:
        left = ca.mtimes(rotation, constant(arm.rotation.T))
        centre = position + rotate(left, constant(meet - arm.position))
        q1 = chosen(height_angles(z[0], z[1], centre - constant(o[0]), ca.SX(float(z[1] @ (meet - o[0])))), choice[0])
        centre = about(z[0], -q1, centre - constant(o[0])) + constant(o[0] - o[1])
        hand = ca.mtimes(rotation_about(z[0], -q1), left)
        q5 = chosen(wrist_angles(z[1], z[4], rotate(hand, constant(z[5])), z[5]), choice[2])
        level = about(z[4], -q5, constant(z[1]))
        off = level - constant(z[5]) * dot(constant(z[5]), level)
        q6 = turn_to(z[5], rotate(hand.T, constant(z[1])), level)
        q6 = ca.if_else(dot(off, off) < SINGULAR**2, near[5], q6)
        fore = ca.mtimes(rotation_about(z[4], q5), rotation_about(z[5], q6))
        sum234 = turn_to(z[1], constant(side), ca.mtimes(hand, rotate(fore.T, constant(side))))
        reach = centre - about(z[1], sum234, constant(meet - o[3]))
        reach = reach - constant(z[1]) * dot(constant(z[1]), reach)
        bend = chosen(elbow_angles(upper, lower, z[1], dot(reach, reach)), choice[1])
        q2 = turn_to(z[1], constant(upper) + about(z[1], bend, constant(lower)), reach)
        return ca.vertcat(q1, q2, senses[0] * bend, senses[1] * (sum234 - q2 - bend), q5, q6)

    def signs(q: ca.SX) -> ca.SX:
        bend = senses[0] * q[2]
        low = about(z[1], bend, constant(lower))
        centre = about(z[1], q[1], constant(upper) + low)
        centre = centre + about(z[1], q[1] + bend + senses[1] * q[3], constant(meet - o[3])) + constant(o[1] - o[0])
        shoulder = -dot(constant(np.cross(z[0], z[1])), centre)
        elbow = -dot(constant(z[1]), ca.cross(low, constant(upper)))
        bent = about(z[4], q[4], constant(z[5]))
        return ca.vertcat(shoulder, elbow, -dot(constant(z[1]), ca.cross(constant(z[4]), bent)))

    return closed_form("ur", arm, branch, signs, _words)


def _words(choice: Signs) -> str:
    elbow = "up" if choice[0] == choice[1] else "down"
    return f"shoulder {'left' if choice[0] > 0 else 'right'}, elbow {elbow}, {'noflip' if choice[2] > 0 else 'flip'}"
