"""Sampled centroids: midpoint sums over a range, and the weighted mean of singletons."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from fzcli.fuzzy.centroid import Sums
from fzcli.fuzzy.terms import Range, membership
from fzcli.spec.rulebase import Term


def midpoint_sums(
    terms: Sequence[Term], firings: Sequence[ca.SX], limits: Range, samples: int, origin: float = 0.0
) -> Sums:
    """Sums of (x - origin) y and of y, y = max_k min(firing_k, set_k), at the midpoints of equal cells.

    Memberships at the samples are numbers, so only the sets that are non-zero at a sample cost
    instructions there: about three a sample and one more for each further set.
    """
    width = (limits[1] - limits[0]) / samples
    x = limits[0] + (np.arange(samples) + 0.5) * width
    heights = [_heights(term, x, limits) for term in terms]
    positions: list[float] = []
    values: list[ca.SX] = []
    for index in range(samples):
        clipped = [
            firing if height[index] >= 1.0 else ca.fmin(firing, height[index])
            for firing, height in zip(firings, heights, strict=True)
            if height[index] > 0.0
        ]
        if clipped:
            value = clipped[0]
            for other in clipped[1:]:
                value = ca.fmax(value, other)
            positions.append(x[index] - origin)
            values.append(value)
    if not values:
        return ca.SX(0.0), ca.SX(0.0)
    column = ca.vertcat(*values)
    return ca.dot(column, ca.DM(positions)), ca.sum1(column)


def singleton_sums(positions: Sequence[float | ca.SX], firings: Sequence[ca.SX], origin: float = 0.0) -> Sums:
    """Sums of firing times position (from ``origin``) and of firings: the weighted average's two halves."""
    moment, weight = ca.SX(0.0), ca.SX(0.0)
    for position, firing in zip(positions, firings, strict=True):
        moment, weight = moment + (position - origin) * firing, weight + firing
    return moment, weight


def _heights(term: Term, x: np.ndarray, limits: Range) -> np.ndarray:
    point = ca.SX.sym("x")
    function = ca.Function("membership", [point], [membership(term, point, limits)])
    return np.asarray(function(x.reshape(1, -1)).full()).ravel()
