"""Exact signed distances of balls, capsules and boxes as CasADi expressions without branches.

Apart: the distance. In contact: minus the penetration depth, the shortest translation that parts the two.
Both are the signed distance of the origin from the Minkowski difference, so no distance changes by more than
the farthest that a point of either shape moves. First derivatives are exact and finite everywhere; second
derivatives are those at fixed witness points (`_settled`).
"""

from dataclasses import dataclass
from itertools import combinations, product

import casadi as ca

from fzcli.model.algebra import cross, dot, rotate

TOUCH = 1e-28  # [m2] below this squared distance two axes count as touching: no direction to differentiate in
PARALLEL = 1e-24  # squared sine below which the cross product of two directions names no axis
NO_AXIS = -1e30
PREFERENCE = 1e-12  # [m] by which an axis across two edges must beat a face: at a tie only the face has a gradient


@dataclass(frozen=True)
class Ball:
    """A ball: ``center`` (3) and ``radius`` [m]."""

    center: ca.SX
    radius: ca.SX | float


@dataclass(frozen=True)
class Capsule:
    """All points within ``radius`` of the segment from ``start`` (3) to ``end`` (3) [m]."""

    start: ca.SX
    end: ca.SX
    radius: ca.SX | float


@dataclass(frozen=True)
class Box:
    """A box: ``rotation`` (3, 3) of its axes, ``center`` (3) and ``half`` (3) its half edges [m]."""

    rotation: ca.SX
    center: ca.SX
    half: ca.SX


Solid = Ball | Capsule | Box


def signed_distance(a: Solid, b: Solid) -> ca.SX:
    """The signed distance [m] of two solids given in one frame: positive apart, negative in contact."""
    if isinstance(a, Box):
        return box_box(a, b) if isinstance(b, Box) else signed_distance(b, a)
    if isinstance(b, Box):
        start, end = (rotate(b.rotation.T, point - b.center) for point in _ends(a))
        core = point_box(start, b.half) if isinstance(a, Ball) else segment_box(start, end, b.half)
        return core - a.radius
    return segment_segment(*_ends(a), *_ends(b)) - (a.radius + b.radius)


def segment_segment(a0: ca.SX, a1: ca.SX, b0: ca.SX, b1: ca.SX) -> ca.SX:
    """The distance [m] of two segments; either may be a point.

    The lines' nearest parameters, clamped in turn (Ericson 2005, Real-Time Collision Detection, 5.1.9).
    """
    u, v, w = a1 - a0, b1 - b0, a0 - b0
    uu, vv, uv, uw, vw = dot(u, u), dot(v, v), dot(u, v), dot(u, w), dot(v, w)
    s = _clamped(_over(uv * vw - uw * vv, uu * vv - uv * uv))
    t = _clamped(_over(uv * s + vw, vv))
    s = _clamped(_over(uv * t - uw, uu))
    return _length(w + _settled(s) * u - _settled(t) * v)


def point_box(point: ca.SX, half: ca.SX) -> ca.SX:
    """The signed distance [m] of a point (3), box axes, from a box about the origin."""
    over = ca.fabs(point) - half
    return _length(ca.fmax(over, 0)) + ca.fmin(ca.fmax(ca.fmax(over[0], over[1]), over[2]), 0)


def segment_box(start: ca.SX, end: ca.SX, half: ca.SX) -> ca.SX:
    """The signed distance [m] of a segment, box axes, from a box about the origin.

    Apart: the squared distance along the segment is convex and piecewise quadratic with its knots on the
    planes of the faces, so that the root of its slope is a linear interpolation between two knots. In
    contact: the six face normals of the Minkowski difference (box axes, and axes across segment) decide.
    """
    return _segment_outside(start, end, half) + ca.fmin(_segment_depth(start, end, half), 0)


def _segment_outside(start: ca.SX, end: ca.SX, half: ca.SX) -> ca.SX:
    """The distance [m] of a segment from a box, 0 in contact."""
    way = end - start
    knots = [ca.SX(0), ca.SX(1)]
    for i, side in product(range(3), (-1, 1)):
        knots.append(_clamped(_over(side * half[i] - start[i], way[i])))

    def slope(t: ca.SX) -> ca.SX:
        point = start + t * way
        return dot(way, ca.fmax(point - half, 0) - ca.fmax(-point - half, 0))

    low, high = ca.SX(0), ca.SX(1)
    for knot in knots:
        value = slope(knot)
        low = ca.fmax(low, ca.if_else(value <= 0, knot, 0))
        high = ca.fmin(high, ca.if_else(value >= 0, knot, 1))
    below, above = slope(low), slope(high)
    share = ca.if_else(above == below, 0.5, _over(-below, above - below))  # in contact: amid the flat part
    t = low + (high - low) * _clamped(share)
    return _length(ca.fmax(ca.fabs(start + _settled(t) * way) - half, 0))


def _segment_depth(start: ca.SX, end: ca.SX, half: ca.SX) -> ca.SX:
    """The largest gap [m] along a face normal of box minus segment: minus the depth where they meet."""
    way, middle = end - start, 0.5 * (start + end)
    gaps = ca.fabs(middle) - half - 0.5 * ca.fabs(way)
    gap = ca.fmax(ca.fmax(gaps[0], gaps[1]), gaps[2])
    size = dot(way, way)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across = ca.fabs(middle[k] * way[j] - middle[j] * way[k])
        width = half[j] * ca.fabs(way[k]) + half[k] * ca.fabs(way[j])
        gap = ca.fmax(gap, _across(across - width, way[j] * way[j] + way[k] * way[k], size))
    return gap


def box_box(a: Box, b: Box) -> ca.SX:
    """The signed distance [m] of two boxes: edges and corners against boxes apart, fifteen axes in contact.

    Apart, the nearest points lie on an edge of the one, or the nearer is a corner of the other. The axes tell which it
    is (separating axis theorem).
    """
    turn = ca.mtimes(a.rotation.T, b.rotation)
    shift = rotate(a.rotation.T, b.center - a.center)
    apart = ca.fmin(_edges_to_box(turn, shift, b.half, a.half), _corners_to_box(turn.T, shift, a.half, b.half))
    axes = ca.SX.eye(3)
    candidates = [axes[:, i] for i in range(3)] + [turn[:, j] for j in range(3)]
    candidates += [cross(axes[:, i], turn[:, j]) for i in range(3) for j in range(3)]
    gap = ca.SX(NO_AXIS)
    for index, axis in enumerate(candidates):
        width = dot(a.half, ca.fabs(axis)) + dot(b.half, ca.fabs(rotate(turn.T, axis)))
        over = ca.fabs(dot(axis, shift)) - width
        gap = ca.fmax(gap, over if index < 6 else _across(over, dot(axis, axis), ca.SX(1)))
    return ca.if_else(gap < 0, gap, apart)


def _edges_to_box(turn: ca.SX, shift: ca.SX, edges: ca.SX, half: ca.SX) -> ca.SX:
    """The least distance [m] of a box's twelve edges from another, in whose axes the first one stands."""
    corners = {signs: shift + rotate(turn, ca.vertcat(*signs) * edges) for signs in product((-1, 1), repeat=3)}
    nearest = ca.SX(-NO_AXIS)
    for one, other in combinations(corners, 2):
        if sum(x != y for x, y in zip(one, other, strict=True)) == 1:
            nearest = ca.fmin(nearest, _segment_outside(corners[one], corners[other], half))
    return nearest


def _corners_to_box(turn: ca.SX, shift: ca.SX, corners: ca.SX, half: ca.SX) -> ca.SX:
    """The least distance [m] of the corners of a box about the origin from another at ``shift``, in axes ``turn``."""
    nearest = ca.SX(-NO_AXIS)
    for signs in product((-1, 1), repeat=3):
        over = ca.fabs(rotate(turn, ca.vertcat(*signs) * corners - shift)) - half
        nearest = ca.fmin(nearest, _length(ca.fmax(over, 0)))
    return nearest


def _across(gap: ca.SX, squared: ca.SX, size: ca.SX) -> ca.SX:
    """A gap along a cross product of squared length ``squared`` in metres, or none where that vanishes."""
    metres = gap / ca.sqrt(ca.fmax(squared, 1e-300)) - PREFERENCE
    return ca.if_else(squared > PARALLEL * size, metres, NO_AXIS)


def _ends(solid: Ball | Capsule) -> tuple[ca.SX, ca.SX]:
    return (solid.center, solid.center) if isinstance(solid, Ball) else (solid.start, solid.end)


def _clamped(value: ca.SX) -> ca.SX:
    return ca.fmin(1.0, ca.fmax(0.0, value))


def _over(numerator: ca.SX, denominator: ca.SX) -> ca.SX:
    """A quotient, with 1 for a denominator of 0: any parameter serves where there is no way to go."""
    return numerator / ca.if_else(denominator == 0, 1.0, denominator)


def _settled(parameter: ca.SX) -> ca.SX:
    """A parameter in [0, 1] to its last bit, but with derivative 0.

    At the nearest points the distance does not change with their parameters (envelope theorem), whose own
    derivatives grow without bound as segments become parallel.
    """
    return ca.floor(parameter * 2.0**52) * 2.0**-52


def _length(vector: ca.SX) -> ca.SX:
    """|vector|, with gradient 0 instead of none at 0."""
    return ca.sqrt(ca.fmax(dot(vector, vector), TOUCH))
