"""Inverse dynamics of the tree by Newton and Euler's recursion, every body in its own joint's frame.

In its own frame a body's inertia is constant and its joint axis too, so that axes along x, y or z and
quarter turns between frames cost next to nothing.
"""

from dataclasses import dataclass

import casadi as ca

from fzcli.model.algebra import cross, dot, rotate
from fzcli.model.composite import Composite, joint_offset, joint_rotation
from fzcli.model.tree import Body, TipFrame, Tree


@dataclass(frozen=True)
class Motion:
    """Motion of a body's frame in its own axes: angular velocity, angular and linear acceleration, (3) each."""

    rate: ca.SX
    angular: ca.SX
    linear: ca.SX


@dataclass(frozen=True)
class Wrench:
    """A force (3) [N] and a moment (3) [N m] about a frame's origin, in its axes."""

    force: ca.SX
    moment: ca.SX

    def plus(self, other: "Wrench") -> "Wrench":
        """Both together."""
        return Wrench(self.force + other.force, self.moment + other.moment)

    def minus(self, other: "Wrench") -> "Wrench":
        """This one less the other."""
        return Wrench(self.force - other.force, self.moment - other.moment)


@dataclass(frozen=True)
class TreeForces:
    """What a motion asks for: ``joints`` (n) [N m or N], ``base``: what must act on the base frame's origin,
    ``branches``: the part of it that the joints on the base pass on to what they carry; base axes."""

    joints: list[ca.SX]
    base: Wrench
    branches: Wrench


def newton_euler(
    tree: Tree,
    parts: list[Composite],
    q: ca.SX,
    qd: ca.SX,
    qdd: ca.SX,
    base: Motion,
    load: tuple[TipFrame, Wrench] | None = None,
) -> TreeForces:
    """The forces behind a motion: q, qd, qdd (n), the base's motion in base axes, bodies with the base last.

    ``load``: a tip, and a wrench that acts on it from outside at its origin, in base axes.
    Source: Luh, Walker and Paul 1980, the base's acceleration that of its frame's origin.
    """
    bodies = tree.bodies
    turns = [joint_rotation(body, q[i]) for i, body in enumerate(bodies)]
    offsets = [joint_offset(body, q[i]) for i, body in enumerate(bodies)]
    motions, fields = [base], [acceleration_matrix(base)]  # of body i at i + 1: a parent of -1 is the base
    for i, body in enumerate(bodies):
        carrier, at_joint = motions[body.parent + 1], rotate(fields[body.parent + 1], offsets[i])
        motions.append(_carried(body, carrier, carrier.linear + at_joint, turns[i], qd[i], qdd[i]))
        fields.append(acceleration_matrix(motions[-1]))
    bodies_first = zip(parts, [*motions[1:], base], [*fields[1:], fields[0]], strict=True)
    forces = [inertial_wrench(part, motion.linear, field) for part, motion, field in bodies_first]
    if load is not None:
        forces[load[0].body] = forces[load[0].body].minus(_on_body(tree, turns, *load))
    own_base = forces[-1]
    joints: list[ca.SX] = [ca.SX(0)] * len(bodies)
    for i in reversed(range(len(bodies))):
        body, wrench = bodies[i], forces[i]
        axis = ca.SX(ca.DM(body.axis))
        joints[i] = dot(axis, wrench.force if body.prismatic else wrench.moment)
        fixed = ca.SX(ca.DM(body.place.rotation))
        force = rotate(fixed, rotate(turns[i], wrench.force))
        moment = rotate(fixed, rotate(turns[i], wrench.moment)) + cross(offsets[i], force)
        forces[body.parent] = forces[body.parent].plus(Wrench(force, moment))
    return TreeForces(joints, forces[-1], forces[-1].minus(own_base))


def acceleration_matrix(motion: Motion) -> ca.SX:
    """A (3, 3) with ``linear + A p`` the acceleration of the body's point p: [angular]x + [rate]x [rate]x."""
    w, angular = motion.rate, motion.angular
    xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    return ca.vertcat(
        ca.horzcat(-(yy + zz), xy - angular[2], xz + angular[1]),
        ca.horzcat(xy + angular[2], -(xx + zz), yz - angular[0]),
        ca.horzcat(xz - angular[1], yz + angular[0], -(xx + yy)),
    )


def _carried(body: Body, carrier: Motion, at_joint: ca.SX, turn: ca.SX, qd: ca.SX, qdd: ca.SX) -> Motion:
    """The motion of a body from its carrier's, ``at_joint`` (3) the carrier's acceleration where the joint is."""
    back, fixed = turn.T, ca.SX(ca.DM(body.place.rotation.T))

    def into(vector: ca.SX) -> ca.SX:
        return rotate(back, rotate(fixed, vector))

    axis = ca.SX(ca.DM(body.axis))
    rate, angular, linear = into(carrier.rate), into(carrier.angular), into(at_joint)
    relative = axis * qd
    if body.prismatic:
        return Motion(rate, angular, linear + 2 * cross(rate, relative) + axis * qdd)
    return Motion(rate + relative, angular + cross(rate, relative) + axis * qdd, linear)


def inertial_wrench(part: Composite, linear: ca.SX, field: ca.SX) -> Wrench:
    """The wrench about the frame's origin that gives a body its motion: the sums of dm a and dm p x a.

    The second is the skew part of A J with the second moments of mass J = tr(I)/2 E - I, which are sparse
    where the CoM lies on a frame axis.
    """
    tensor = part.tensor
    half = 0.5 * (tensor[0, 0] + tensor[1, 1] + tensor[2, 2])
    J = half * ca.SX.eye(3) - tensor
    rows = [rotate(J, field[i, :].T) for i in range(3)]  # A J, J being symmetric
    moment = ca.vertcat(rows[2][1] - rows[1][2], rows[0][2] - rows[2][0], rows[1][0] - rows[0][1])
    force = part.mass * linear + rotate(field, part.first_moment)
    return Wrench(force, moment + cross(part.first_moment, linear))


def _on_body(tree: Tree, turns: list[ca.SX], tip: TipFrame, wrench: Wrench) -> Wrench:
    """A wrench at a tip, given in base axes, about the origin of the body that carries it, in its axes."""
    force, moment = wrench.force, wrench.moment
    for i in tree.ancestors(tip.body):
        fixed = ca.SX(ca.DM(tree.bodies[i].place.rotation.T))
        force, moment = (rotate(turns[i].T, rotate(fixed, vector)) for vector in (force, moment))
    return Wrench(force, moment + cross(ca.SX(ca.DM(tip.place.translation)), force))
