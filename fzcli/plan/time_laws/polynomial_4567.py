"""The 4-5-6-7 polynomial."""

import math

import casadi as ca

from fzcli.plan.time_laws.law import TimeLaw, clipped


def evaluate(phase: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """s = -20 p^7 + 70 p^6 - 84 p^5 + 35 p^4 (Angeles 2007); the jerk vanishes at both ends as well."""
    p = clipped(phase)
    p2 = p * p
    rest = 1.0 - p
    middle = p * rest
    s = p2 * p2 * (35.0 + p * (-84.0 + p * (70.0 - 20.0 * p)))
    return s, 140.0 * middle * middle * middle, 420.0 * middle * middle * (1.0 - 2.0 * p)


LAW = TimeLaw(evaluate, peak_speed=2.1875, peak_acceleration=84.0 / (5.0 * math.sqrt(5.0)), smooth=3)
