"""Angles of one hinge in closed form: turn one direction into another, or bring a direction to a given cosine.

They are the canonical subproblems of Paden and Kahan (Murray, Li and Sastry 1994, section 3.3), written with
arc tangents so that they keep their digits, and give the nearest angle where there is none.
"""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.model.algebra import cross, dot

Array = NDArray[np.float64]


def constant(values: Array) -> ca.SX:
    """Numbers as a symbolic matrix, zeros left out."""
    return ca.SX(ca.DM(values))


def about(axis: Array, angle: ca.SX, v: ca.SX) -> ca.SX:
    """v (3) turned about a unit axis (3) by an angle [rad] (Rodrigues)."""
    z = constant(axis)
    along = z * dot(z, v)
    return along + ca.cos(angle) * (v - along) + ca.sin(angle) * cross(z, v)


def rotation_about(axis: Array, angle: ca.SX) -> ca.SX:
    """The rotation (3, 3) about a unit axis (3) by an angle [rad]."""
    return ca.horzcat(*(about(axis, angle, constant(e)) for e in np.eye(3)))


def turn_to(axis: Array, start: ca.SX, goal: ca.SX) -> ca.SX:
    """The angle [rad] about a unit axis that turns ``start`` (3) nearest to ``goal`` (3)."""
    z = constant(axis)
    across = dot(z, cross(start, goal))
    return ca.atan2(across, dot(start, goal) - dot(z, start) * dot(z, goal))


def cosine_angles(a: ca.SX, b: ca.SX, c: ca.SX, sine: ca.SX | None = None) -> tuple[ca.SX, ca.SX]:
    """Both angles [rad] with a cos + b sin = c, the greater first; where there is none, twice the nearest.

    They are atan2(b, a) +- atan2(sine, c). ``sine`` = sqrt(a^2 + b^2 - c^2), given by the caller where it
    knows a form that does not cancel.
    """
    if sine is None:
        sine = ca.sqrt(ca.fmax(a * a + b * b - c * c, 0.0))
    middle, half = ca.atan2(b, a), ca.atan2(sine, c)
    return middle + half, middle - half


def height_angles(axis: Array, onto: Array, v: ca.SX, height: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Both angles [rad] by which v (3) was turned about ``axis`` from where its part along ``onto`` is ``height``.

    onto . R(axis, -angle) v = height, the two as `cosine_angles` has them.
    """
    z, n = constant(axis), constant(onto)
    along = dot(z, v)
    return cosine_angles(dot(n, v) - dot(n, z) * along, -dot(n, cross(z, v)), height - dot(n, z) * along)
