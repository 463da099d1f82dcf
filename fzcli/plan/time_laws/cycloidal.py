"""The cycloid."""

import math

import casadi as ca

from fzcli.plan.time_laws.law import TimeLaw, clipped


def evaluate(phase: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """s = p - sin(2 pi p)/(2 pi); velocity and acceleration vanish at both ends."""
    p = clipped(phase)
    turn = 2.0 * math.pi * p
    sine = ca.sin(turn)
    return p - sine / (2.0 * math.pi), 1.0 - ca.cos(turn), 2.0 * math.pi * sine


LAW = TimeLaw(evaluate, peak_speed=2.0, peak_acceleration=2.0 * math.pi, smooth=2)
