"""Exact inverse kinematics of six-hinge arms whose last three axes meet in one point.

The wrist point does not depend on the last three hinges, so that the first three follow from its position
(shoulder from its height along the elbow's axis, elbow from its distance) and the last three from the rotation
that is left (Pieper 1968). Axes 2 and 3 must be parallel, and axis 1 not parallel to them.
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


def wrist_point(arm: Arm) -> Array:
    """The point (3) [m] at rest that is nearest to the last three axes, base frame."""
    planes = [np.eye(3) - np.outer(z, z) for z in arm.axes[3:]]
    return np.asarray(
        np.linalg.lstsq(
            np.vstack(planes), np.concatenate([P @ o for P, o in zip(planes, arm.origins[3:], strict=True)]), rcond=None
        )[0]
    )


def unfit(arm: Arm) -> str:
    """Why this closed form does not serve an arm; empty where it does."""
    if len(arm.joints) != 6 or not arm.hinged:
        return "it has not six hinges"
    names = [body.joint for body in arm.bodies]
    z, wrist = arm.axes, wrist_point(arm)
    aside = max(float(np.linalg.norm(np.cross(z[k], wrist - arm.origins[k]))) for k in (3, 4, 5))
    if aside > ALMOST:
        return f"the axes of {names[3]}, {names[4]} and {names[5]} miss one point by {aside:.3g} m"
    if np.linalg.norm(np.cross(z[1], z[2])) > ALMOST:
        return f"the axes of {names[1]} and {names[2]} are not parallel"
    for i, j in ((0, 1), (3, 4), (4, 5)):
        if np.linalg.norm(np.cross(z[i], z[j])) < ALMOST:
            return f"the axes of {names[i]} and {names[j]} are parallel"
    if np.linalg.norm(flat(arm.origins[2] - arm.origins[1], z[1])) < ALMOST:
        return f"the axes of {names[1]} and {names[2]} are one"
    if np.linalg.norm(flat(wrist - arm.origins[2], z[1])) < ALMOST:
        return f"the wrist's point lies on the axis of {names[2]}"
    return ""


def build(arm: Arm) -> ClosedForm:
    """The eight branches: front or back (of axis 1), elbow up or down (towards axis 1), flip or noflip.

    "front" has the wrist on the side of axis 1 where it is with the joints at the middle of their limits;
    "noflip" has the wrist bent by 0 to pi from where axis 6 lies along axis 4, in joint 5's own sense.
    """
    z, o, wrist = arm.axes, arm.origins, wrist_point(arm)
    sense = float(np.sign(z[1] @ z[2]))
    upper, lower = flat(o[2] - o[1], z[1]), flat(wrist - o[2], z[1])
    side = np.cross(z[5], np.eye(3)[int(np.argmin(np.abs(z[5])))])

    def branch(position: ca.SX, rotation: ca.SX, near: ca.SX, choice: Signs) -> ca.SX:
        left = ca.mtimes(rotation, constant(arm.rotation.T))
        centre = position + rotate(left, constant(wrist - arm.position))
        q1 = chosen(height_angles(z[0], z[1], centre - constant(o[0]), ca.SX(float(z[1] @ (wrist - o[0])))), choice[0])
        reach = about(z[0], -q1, centre - constant(o[0])) + constant(o[0] - o[1])
        reach = reach - constant(z[1]) * dot(constant(z[1]), reach)
        bend = chosen(elbow_angles(upper, lower, z[1], dot(reach, reach)), choice[1])
        q2 = turn_to(z[1], constant(upper) + about(z[1], bend, constant(lower)), reach)
        carried = ca.mtimes(rotation_about(z[0], q1), rotation_about(z[1], q2 + bend))
        hand = ca.mtimes(carried.T, left)
        last = rotate(hand, constant(z[5]))
        q5 = chosen(wrist_angles(z[3], z[4], last, z[5]), choice[2])
        bent = about(z[4], q5, constant(z[5]))
        off = bent - constant(z[3]) * dot(constant(z[3]), bent)
        q4 = ca.if_else(dot(off, off) < SINGULAR**2, near[3], turn_to(z[3], bent, last))
        fore = ca.mtimes(rotation_about(z[3], q4), rotation_about(z[4], q5))
        q6 = turn_to(z[5], constant(side), ca.mtimes(fore.T, rotate(hand, constant(side))))
        return ca.vertcat(q1, q2, sense * bend, q4, q5, q6)

    def signs(q: ca.SX) -> ca.SX:
        low = about(z[1], sense * q[2], constant(lower))
        centre = about(z[1], q[1], constant(upper) + low) + constant(o[1] - o[0])
        shoulder = -dot(constant(np.cross(z[0], z[1])), centre)
        elbow = -dot(constant(z[1]), ca.cross(low, constant(upper)))
        bent = about(z[4], q[4], constant(z[5]))
        return ca.vertcat(shoulder, elbow, -dot(constant(z[3]), ca.cross(constant(z[4]), bent)))

    at_rest = float(ca.Function("signs", [q := ca.SX.sym("q", 6)], [signs(q)])(arm.middle)[0])
    front = 1 if at_rest >= 0 else -1

    def words(choice: Signs) -> str:
        shoulder = "front" if choice[0] == front else "back"
        elbow = "up" if choice[0] == choice[1] else "down"
        return f"{shoulder}, elbow {elbow}, {'noflip' if choice[2] > 0 else 'flip'}"

    return closed_form("spherical_wrist", arm, branch, signs, words)
