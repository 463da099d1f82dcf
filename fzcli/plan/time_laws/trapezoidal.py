"""The trapezoid of velocity: a third speeding up, a third at constant speed, a third slowing down."""

import casadi as ca

from fzcli.plan.time_laws.law import TimeLaw, clipped

RAMP = 1.0 / 3.0
CRUISE = 1.0 / (1.0 - RAMP)


def evaluate(phase: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Constant acceleration, constant speed, constant deceleration; the acceleration jumps."""
    p = clipped(phase)
    begin, end = ca.fmin(p, RAMP), ca.fmax(p - (1.0 - RAMP), 0.0)
    cruise = p - begin - end
    ds = CRUISE / RAMP * (begin - end)
    s = CRUISE / RAMP * 0.5 * begin * begin + CRUISE * cruise + end * (CRUISE - CRUISE / RAMP * 0.5 * end)
    pace = ca.if_else(p < RAMP, CRUISE / RAMP, ca.if_else(p > 1.0 - RAMP, -CRUISE / RAMP, 0.0))
    return s, ds, ca.if_else(ca.logic_or(phase < 0.0, phase > 1.0), 0.0, pace)


LAW = TimeLaw(evaluate, peak_speed=CRUISE, peak_acceleration=CRUISE / RAMP, smooth=1, corners=(RAMP, 1.0 - RAMP))
