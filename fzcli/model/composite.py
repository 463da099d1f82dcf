"""Base-frame kinematics and momentum by composite bodies: the cheap formulation of all model quantities.

Everything is expressed in the axes of the base link's frame, so that it depends on the joints alone;
each subtree is gathered once, in its own joint's frame, where its joint axis is constant.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fzcli.model.algebra import cross, dot, rotate, symmetric_inverse
from fzcli.model.tree import Body, Tree


@dataclass(frozen=True)
class Composite:
    """A subtree in some frame: mass [kg], first moment (3) and inertia (3, 3) about the frame's origin."""

    mass: float | ca.SX
    first_moment: ca.SX
    tensor: ca.SX


@dataclass(frozen=True)
class JointColumn:
    """What one unit of a joint's rate does with the base at rest, in base axes.

    ``axis`` (3), ``origin`` (3) of the joint, momentum of the subtree it moves: ``linear`` (3), and
    ``angular`` (3) about ``origin``.
    """

    axis: ca.SX
    origin: ca.SX
    linear: ca.SX
    angular: ca.SX


@dataclass(frozen=True)
class BaseFrame:
    """The robot seen from its base at joint values q (all base axes, about the base frame's origin).

    ``com`` (3) system CoM; ``inertia`` (3, 3) of the whole system about its CoM; ``columns`` one a
    joint; ``rotations`` and ``origins`` of the bodies.
    """

    com: ca.SX
    inertia: ca.SX
    columns: tuple[JointColumn, ...]
    rotations: tuple[ca.SX, ...]
    origins: tuple[ca.SX, ...]


def joint_rotation(body: Body, q: ca.SX) -> ca.SX:
    """R (3, 3) of a turn by q about the body's axis; sparse for axes along x, y or z (Rodrigues)."""
    if body.prismatic:
        return ca.SX.eye(3)
    s, c = ca.sin(q), ca.cos(q)
    x, y, z = (float(value) for value in body.axis)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    outer = np.outer(body.axis, body.axis)
    R = ca.SX(3, 3)
    for i in range(3):
        for j in range(3):
            R[i, j] = float(outer[i, j]) + c * float((i == j) - outer[i, j]) + s * float(skew[i, j])
    return R


def turn_tensor(body: Body, R: ca.SX, tensor: ca.SX) -> ca.SX:
    """R I R^T (3, 3); for a joint along a frame axis with half the operations of the general form."""
    if body.prismatic:
        return tensor
    aligned = np.flatnonzero(np.abs(body.axis) == 1.0)
    if len(aligned) == 0:
        return ca.mtimes(ca.mtimes(R, tensor), R.T)
    k = int(aligned[0])
    i, j = (k + 1) % 3, (k + 2) % 3
    c, s = R[i, i], R[j, i]
    a, d, b = tensor[i, i], tensor[j, j], tensor[i, j]
    ss, cs, twice = s * s, s * c, b + b
    turned = ca.SX(3, 3)
    turned[i, i] = a + ss * (d - a) - cs * twice
    turned[j, j] = a + d - turned[i, i]
    turned[i, j] = turned[j, i] = b - ss * twice - cs * (d - a)
    turned[k, k] = tensor[k, k]
    turned[i, k] = turned[k, i] = c * tensor[i, k] - s * tensor[j, k]
    turned[j, k] = turned[k, j] = s * tensor[i, k] + c * tensor[j, k]
    return turned


def shifted(tensor: ca.SX, first_moment: ca.SX, mass: float | ca.SX, p: ca.SX) -> ca.SX:
    """The inertia (3, 3) about a point at -p from the old origin; first moment about the old origin."""
    h = first_moment
    half = h + 0.5 * mass * p
    result = ca.SX(3, 3)
    ph = [p[i] * half[i] for i in range(3)]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        result[i, i] = tensor[i, i] + 2 * (ph[j] + ph[k])
        result[i, j] = result[j, i] = tensor[i, j] - (p[i] * h[j] + p[j] * (h[i] + mass * p[i]))
    return result


def inertia_about_com(tensor: ca.SX, com: ca.SX, mass: float | ca.SX) -> ca.SX:
    """From the origin to the CoM, (3, 3)."""
    h = mass * com
    result = ca.SX(3, 3)
    squares = [h[i] * com[i] for i in range(3)]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        result[i, i] = tensor[i, i] - (squares[j] + squares[k])
        result[i, j] = result[j, i] = tensor[i, j] + h[i] * com[j]
    return result


def own_bodies(tree: Tree) -> list[Composite]:
    """Each body on its own, in its frame, the base last."""
    return [
        Composite(part.mass, ca.SX(ca.DM(part.first_moment)), ca.SX(ca.DM(part.tensor)))
        for part in (*(body.inertia for body in tree.bodies), tree.base)
    ]


def build_base_frame(tree: Tree, q: ca.SX, parts: list[Composite] | None = None) -> BaseFrame:
    """All base-frame quantities at symbolic joint values q (n).

    ``parts``: bodies in place of the tree's own, the base last (one of them may carry a payload).
    """
    bodies = tree.bodies
    turns = [joint_rotation(body, q[i]) for i, body in enumerate(bodies)]
    offsets = [joint_offset(body, q[i]) for i, body in enumerate(bodies)]
    composites = _gather(tree, turns, offsets, own_bodies(tree) if parts is None else list(parts))
    whole = composites[-1]
    mass = tree.mass if parts is None else whole.mass
    com = whole.first_moment * (1 / mass)
    rotations: list[ca.SX] = []
    origins: list[ca.SX] = []
    columns: list[JointColumn] = []
    for i, body in enumerate(bodies):
        parent_rotation = rotations[body.parent] if body.parent >= 0 else ca.SX.eye(3)
        parent_origin = origins[body.parent] if body.parent >= 0 else ca.SX.zeros(3)
        rotation = ca.mtimes(ca.mtimes(parent_rotation, ca.SX(ca.DM(body.place.rotation))), turns[i])
        origin = parent_origin + rotate(parent_rotation, offsets[i])
        rotations.append(rotation)
        origins.append(origin)
        columns.append(_column(body, composites[i], rotation, origin))
    return BaseFrame(
        com,
        inertia_about_com(whole.tensor, com, mass),
        tuple(columns),
        tuple(rotations),
        tuple(origins),
    )


def joint_offset(body: Body, q: ca.SX) -> ca.SX:
    """The joint frame's origin (3) at q, in its carrier's frame."""
    place = ca.SX(ca.DM(body.place.translation))
    return place + ca.DM(body.place.rotation @ body.axis) * q if body.prismatic else place


def _gather(
    tree: Tree, turns: list[ca.SX], offsets: list[ca.SX], gathered: list[Composite]
) -> list[Composite]:
    """Subtrees in their own joint's frame, from the leaves inwards; the whole system last."""
    for i in reversed(range(len(tree.bodies))):
        body, own = tree.bodies[i], gathered[i]
        fixed = ca.SX(ca.DM(body.place.rotation))
        h = rotate(fixed, rotate(turns[i], own.first_moment))
        tensor = turn_tensor(body, turns[i], own.tensor)
        if not np.array_equal(body.place.rotation, np.eye(3)):
            tensor = ca.mtimes(ca.mtimes(fixed, tensor), fixed.T)
        carrier = gathered[body.parent]  # index -1 is the base, which stands last
        gathered[body.parent] = Composite(
            carrier.mass + own.mass,
            carrier.first_moment + h + own.mass * offsets[i],
            carrier.tensor + shifted(tensor, h, own.mass, offsets[i]),
        )
    return gathered


def _column(body: Body, subtree: Composite, rotation: ca.SX, origin: ca.SX) -> JointColumn:
    axis = ca.SX(ca.DM(body.axis))
    if body.prismatic:
        linear, angular = subtree.mass * axis, cross(subtree.first_moment, axis)
    else:
        linear, angular = cross(axis, subtree.first_moment), rotate(subtree.tensor, axis)
    return JointColumn(rotate(rotation, axis), origin, rotate(rotation, linear), rotate(rotation, angular))


def centroidal_columns(frame: BaseFrame) -> ca.SX:
    """H_q (3, n): angular momentum about the system CoM for unit joint rates, base at rest."""
    return ca.horzcat(
        *(column.angular + cross(column.origin - frame.com, column.linear) for column in frame.columns)
    )


def base_rate_columns(frame: BaseFrame) -> ca.SX:
    """W (3, n): base angular velocity for unit joint rates at zero momentum, W = -I_s^-1 H_q."""
    inverse = -symmetric_inverse(frame.inertia)
    H = centroidal_columns(frame)
    return ca.horzcat(*(rotate(inverse, H[:, i]) for i in range(H.shape[1])))


def joint_mass_matrix(tree: Tree, frame: BaseFrame) -> ca.SX:
    """M_q (n, n): joint inertia with the base held, by composite bodies."""
    n = len(tree.bodies)
    M = ca.SX(n, n)
    for j in range(n):
        moved = frame.columns[j]
        for i in tree.ancestors(j):
            driven = frame.columns[i]
            if tree.bodies[i].prismatic:
                M[i, j] = dot(driven.axis, moved.linear)
            else:
                arm = moved.origin - driven.origin
                M[i, j] = dot(driven.axis, moved.angular + cross(arm, moved.linear))
            M[j, i] = M[i, j]
    return M
