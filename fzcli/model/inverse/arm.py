"""The serial arm that carries a tip: its hinges at rest, and its pose and Jacobian from the base frame."""

import math
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.errors import Problem, SpecError
from fzcli.model.algebra import cross, rotate
from fzcli.model.composite import joint_rotation
from fzcli.model.robot_model import RobotModel
from fzcli.model.tree import Body, Placement, place_of, times
from fzcli.spec.robot import Frame

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Arm:
    """The m joints that carry a tip, all others away; base axes, from the base frame's origin.

    ``joints`` (m): their numbers among the robot's. With all joints at 0: ``axes`` (m, 3), ``origins`` (m, 3)
    [m] of the joints, and the ``rotation`` (3, 3) and ``position`` (3) [m] of the tip with its tool. ``limits``
    (m, 2) [rad or m], infinite where none are stated. ``ends``: the tip with its tool in the last body's frame.
    """

    joints: tuple[int, ...]
    bodies: tuple[Body, ...]
    axes: Array
    origins: Array
    rotation: Array
    position: Array
    limits: Array
    ends: Placement

    @property
    def hinged(self) -> bool:
        """Whether no joint slides."""
        return not any(body.prismatic for body in self.bodies)

    @cached_property
    def full_turns(self) -> tuple[bool, ...]:
        """(m) whether a joint is a hinge whose limits leave room for every angle."""
        return tuple(
            not body.prismatic and float(high - low) >= 2 * math.pi - 1e-9
            for body, (low, high) in zip(self.bodies, self.limits, strict=True)
        )

    @cached_property
    def periods(self) -> Array:
        """(m) after how much [rad] a joint is back where it was: a turn of a hinge, 0 of one that slides."""
        return np.array([0.0 if body.prismatic else 2 * math.pi for body in self.bodies])

    @cached_property
    def middle(self) -> Array:
        """(m) middle of the joint limits; 0 where a limit is infinite."""
        finite = np.isfinite(self.limits[:, 0]) & np.isfinite(self.limits[:, 1])
        return np.asarray(0.5 * np.where(finite[:, None], self.limits, 0.0).sum(axis=1))


def build_arm(model: RobotModel, tip: str | None = None, tool: Frame | None = None) -> Arm:
    """The arm of a tip (default: the first), lengthened by ``tool``, a frame in the tip's frame.

    Raises SpecError for an unknown tip and for one that no joint moves.
    """
    name = model.tips[0] if tip is None else tip
    if name not in model.tips:
        raise SpecError(Problem(f"no tip {name!r}; the robot has {', '.join(model.tips)}", field="tip"))
    tree = model.tree
    joints = tuple(model.carriers(name))
    if not joints:
        raise SpecError(Problem(f"no joint moves tip {name!r}", field="tip"))
    ends = tree.tips[name].place
    if tool is not None:
        ends = ends.then(place_of(tool))
    place, axes, origins = Placement(np.eye(3), np.zeros(3)), [], []
    for j in joints:
        place = place.then(tree.bodies[j].place)
        axes.append(times(place.rotation, tree.bodies[j].axis[:, None])[:, 0])
        origins.append(place.translation)
    end = place.then(ends)
    return Arm(
        joints=joints,
        bodies=tuple(tree.bodies[j] for j in joints),
        axes=np.array(axes),
        origins=np.array(origins),
        rotation=end.rotation,
        position=end.translation,
        limits=tree.position_limits[list(joints)],
        ends=ends,
    )


def arm_pose(arm: Arm, q: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Tip position (3) [m], rotation (3, 3) and Jacobian (6, m), linear first, at symbolic joint values q (m).

    All relative to the base frame, as if the base stood still.
    """
    R, p = ca.SX.eye(3), ca.SX.zeros(3)
    axes, origins = [], []
    for i, body in enumerate(arm.bodies):
        p = p + rotate(R, ca.SX(ca.DM(body.place.translation)))
        R = ca.mtimes(R, ca.SX(ca.DM(body.place.rotation)))
        axis = rotate(R, ca.SX(ca.DM(body.axis)))
        if body.prismatic:
            p = p + axis * q[i]
        R = ca.mtimes(R, joint_rotation(body, q[i]))
        axes.append(axis)
        origins.append(p)
    position = p + rotate(R, ca.SX(ca.DM(arm.ends.translation)))
    columns = [
        ca.vertcat(axis, ca.SX.zeros(3)) if body.prismatic else ca.vertcat(cross(axis, position - origin), axis)
        for body, axis, origin in zip(arm.bodies, axes, origins, strict=True)
    ]
    return position, ca.mtimes(R, ca.SX(ca.DM(arm.ends.rotation))), ca.densify(ca.horzcat(*columns))
