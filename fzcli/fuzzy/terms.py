"""Fuzzy sets: their membership as branch-free SX, and the trapezoids that they are."""

import math

import casadi as ca

from fzcli.spec.rulebase import Term

Range = tuple[float, float]
Trapezoid = tuple[float, float, float, float]

_COUNTS = {"triangle": 3, "trapezoid": 4, "ramp": 2, "rectangle": 2, "singleton": 1, "gaussian": 2}


def term_problem(term: Term, limits: Range) -> str:
    """What is wrong with a term of a variable whose range is ``limits``; empty when nothing is."""
    numbers, shape = term.numbers, term.shape
    if len(numbers) != _COUNTS[shape]:
        return f"{shape} takes {_COUNTS[shape]} numbers, not {len(numbers)}"
    if shape == "gaussian" and numbers[1] <= 0.0:
        return f"the sigma of a gaussian is positive, not {numbers[1]:g}"
    if shape == "ramp" and numbers[0] == numbers[1]:
        return f"a ramp from {numbers[0]:g} to itself has no slope; use rectangle"
    if shape in ("triangle", "trapezoid", "rectangle"):
        if list(numbers) != sorted(numbers):
            return f"the numbers of a {shape} do not decrease: {', '.join(f'{x:g}' for x in numbers)}"
        if numbers[0] == numbers[-1]:
            return f"a {shape} without width; use singleton"
    low, high = _support(term)
    if high < limits[0] or low > limits[1]:
        return f"lies outside the range {limits[0]:g} to {limits[1]:g}"
    return ""


def _support(term: Term) -> Range:
    """The interval outside which the membership is zero (or, for a gaussian, where its mean is)."""
    numbers = term.numbers
    if term.shape == "gaussian":
        return numbers[0], numbers[0]
    if term.shape == "ramp":
        return (numbers[0], math.inf) if numbers[0] < numbers[1] else (-math.inf, numbers[0])
    return numbers[0], numbers[-1]


def corners(term: Term, limits: Range) -> Trapezoid | None:
    """The trapezoid (a, b, c, d) that a term is, a <= b <= c <= d: 0 at a, 1 from b to c, 0 at d.

    A ramp's open side is closed at the end of ``limits``. None for a singleton and a gaussian.
    """
    numbers = term.numbers
    if term.shape == "triangle":
        return numbers[0], numbers[1], numbers[1], numbers[2]
    if term.shape == "trapezoid":
        return numbers[0], numbers[1], numbers[2], numbers[3]
    if term.shape == "rectangle":
        return numbers[0], numbers[0], numbers[1], numbers[1]
    if term.shape == "ramp":
        foot, top = numbers
        if foot < top:
            end = max(top, limits[1])
            return foot, top, end, end
        start = min(top, limits[0])
        return start, start, top, foot
    return None


def cut(trapezoid: Trapezoid, limits: Range) -> Trapezoid | None:
    """The part of a trapezoid inside ``limits``, or None when a limit cuts through a slope."""
    a, b, c, d = trapezoid
    lower, upper = limits
    if a < lower < b or c < lower < d or a < upper < b or c < upper < d:
        return None
    clipped = tuple(min(max(x, lower), upper) for x in trapezoid)
    return clipped[0], clipped[1], clipped[2], clipped[3]


def membership(term: Term, x: ca.SX, limits: Range) -> ca.SX:
    """Degree to which x, known to lie in ``limits``, belongs to a term: an SX in 0..1 without branches.

    Vertical sides belong to the set: a rectangle's and a singleton's ends count as inside.
    """
    if term.shape == "gaussian":
        mean, sigma = term.numbers
        return ca.exp(-0.5 * ((x - mean) * (1.0 / sigma)) ** 2)
    if term.shape == "singleton":
        return ca.if_else(x == term.numbers[0], 1.0, 0.0)
    trapezoid = corners(term, limits)
    if trapezoid is None:
        raise ValueError(f"no membership for the shape {term.shape}")
    return _trapezoid_membership(trapezoid, x, limits)


def _trapezoid_membership(trapezoid: Trapezoid, x: ca.SX, limits: Range) -> ca.SX:
    """Lower envelope of the sides, leaving out what the range of x makes idle."""
    a, b, c, d = trapezoid
    lower, upper = limits
    slopes, gates = [], []
    if b > lower:
        if a < b:
            slopes.append((x - a) * (1.0 / (b - a)))
        else:
            gates.append(x >= a)
    if c < upper:
        if c < d:
            slopes.append((d - x) * (1.0 / (d - c)))
        else:
            gates.append(x <= d)
    value = slopes[0] if slopes else ca.SX(1.0)
    if len(slopes) == 2:
        value = ca.fmin(value, slopes[1])
    if slopes and max(b, lower) < min(c, upper):
        value = ca.fmin(value, 1.0)
    if slopes and (lower < a or upper > d):
        value = ca.fmax(value, 0.0)
    for gate in gates:
        value = ca.if_else(gate, value, 0.0)
    return value
