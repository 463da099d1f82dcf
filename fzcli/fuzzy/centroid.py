"""The exact centroid of clipped trapezoids joined by max, in closed form.

The integral runs over the level t instead of over x. At level t a trapezoid (a, b, c, d) clipped at
its firing is the interval from a + (b-a) t to d - (d-c) t, if it reaches that high. When the
corners a, b, c, d of the sets are each in non-decreasing order, these intervals are ordered too,
so the length of their union is the sum of the lengths less the overlaps of consecutive ones; two
sets i < j are consecutive above the firings of all sets between them. Every piece is a polynomial
of the level.
"""

from collections.abc import Sequence
from itertools import pairwise

import casadi as ca

from fzcli.fuzzy.terms import Trapezoid

Sums = tuple[ca.SX, ca.SX]  # first moment and area, or what stands for them in another defuzzifier


def order(sets: Sequence[Trapezoid]) -> list[int] | None:
    """Indices that put all four corners in non-decreasing order, or None when no order does."""
    indices = sorted(range(len(sets)), key=lambda index: sets[index])
    ordered = all(x <= y for i, j in pairwise(indices) for x, y in zip(sets[i], sets[j], strict=True))
    return indices if ordered else None


def centroid_sums(sets: Sequence[Trapezoid], firings: Sequence[ca.SX], origin: float = 0.0) -> Sums:
    """First moment about ``origin`` and area of max_k min(firing_k, set_k), exactly.

    Args:
        sets: trapezoids (a, b, c, d) in the order that ``order`` gives.
        firings: the level in 0..1 at which each set is clipped.
        origin: where x counts from; near the sets it saves digits.

    Their quotient is the centre of gravity (CoG) of IEC 61131-7; the derivation stands above.
    """
    shifted = [(a - origin, b - origin, c - origin, d - origin) for a, b, c, d in sets]
    moment, area = ca.SX(0.0), ca.SX(0.0)
    for trapezoid, firing in zip(shifted, firings, strict=True):
        first, zeroth = _clipped(trapezoid, firing)
        moment, area = moment + first, area + zeroth
    for j, right in enumerate(shifted):
        for i, left in enumerate(shifted[:j]):
            if left[3] > right[0]:
                first, zeroth = _overlap(left, right, firings[i], firings[j], firings[i + 1 : j])
                moment, area = moment - first, area - zeroth
    return moment, area


def _clipped(trapezoid: Trapezoid, level: ca.SX) -> Sums:
    """First moment and area of the part of (a, b, c, d) below a level; b may exceed c above that level."""
    a, b, c, d = trapezoid
    u, v = b - a, d - c
    linear, square, cubic = (d * d - a * a) / 2, (d * v + a * u) / 2, (v * v - u * u) / 6
    moment = level * (linear - level * (square - level * cubic))
    area = level * ((d - a) - level * ((u + v) / 2))
    return moment, area


def _overlap(left: Trapezoid, right: Trapezoid, low: ca.SX, high: ca.SX, between: Sequence[ca.SX]) -> Sums:
    """What two sets share above the firings of the sets between them."""
    shared = (right[0], right[1], left[2], left[3])
    slopes = (right[1] - right[0]) + (left[3] - left[2])
    level = ca.fmin(low, high)
    if left[3] - right[0] < slopes:
        level = ca.fmin(level, (left[3] - right[0]) / slopes)
    moment, area = _clipped(shared, level)
    if between:
        covered = between[0]
        for firing in between[1:]:
            covered = ca.fmax(covered, firing)
        below_moment, below_area = _clipped(shared, ca.fmin(level, covered))
        moment, area = moment - below_moment, area - below_area
    return moment, area
