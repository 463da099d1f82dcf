"""What ends a run before its time: each condition has a code, a name and advice."""

import operator
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from fzcli.loop.parts import Parts
from fzcli.model.algebra import dot
from fzcli.model.attitude import rotation_matrix
from fzcli.spec.condition import Condition
from fzcli.spec.quantity import Metric

# Where a run is stopped as diverged: rad or m in one step, all joints and the base together. Far beyond
# any motion that means something, so that the unstable runs of the paper's Table 2 run to their end.
LARGEST_STEP = 1.0e5
FARTHEST = 1.0e9  # rad or m: joint values beyond which sines have no digits left
NEAREST_PITCH = 1e-12  # squared cosine of the pitch at which roll and yaw count as undefined


@dataclass(frozen=True)
class StopReason:
    """Why a run was stopped, in words."""

    name: str
    reason: str
    advice: str
    failed: bool = True


STOP_REASONS = {
    1: StopReason(
        "diverged",
        f"a step moved joints and base by more than {LARGEST_STEP:g} rad, or joints are beyond {FARTHEST:g} rad, "
        "or the motion is not a number",
        "lower controller.gain or step; the data up to here is kept",
    ),
    2: StopReason(
        "angle_singularity",
        "the base's pitch came within 1e-6 rad of 90 deg, where roll and yaw are undefined",
        "use controller.constraint: [rotation_vector], which has no such attitude",
    ),
    4: StopReason(
        "unstable",
        "at torque level joints are faster than 1e4 rad/s, or the motion is not a number: "
        "the step of torque control and integration is too large for these gains",
        "raise replay.substeps or lower the gains of replay.controller; the data up to here is kept",
    ),
    3: StopReason("arrived", "the tip has reached its target", "", failed=False),
}
PAUSED = -1  # the law asks for its search before this step; never the end of a run
LEFT_OUT = -2  # of a run that was not begun, as another of its series has ended without a stop
GIVEN_UP = 5  # of a run that is only tried: whatever comes, it will not meet what is wanted of it
FAILURES = tuple(code for code, why in STOP_REASONS.items() if why.failed)


def stop_code(parts: Parts, plant_state: ca.SX, derivative: ca.SX, arrived: ca.SX, asks: ca.SX) -> ca.SX:
    """0 to go on, `PAUSED`, or a key of ``STOP_REASONS``; a NaN anywhere in the motion fails the comparison."""
    travel = parts.plant.travel(derivative, parts.dt)
    q = parts.plant.observe(plant_state)[0]
    sane = ca.logic_and(travel < LARGEST_STEP**2, dot(q, q) < FARTHEST**2)
    code = ca.if_else(arrived, 3.0, ca.if_else(asks, float(PAUSED), 0.0))
    code = ca.if_else(sane, code, 1.0)
    if parts.law.angles and parts.model.floating:
        R = rotation_matrix(parts.plant.observe(plant_state)[1])
        cosine2 = R[2, 1] * R[2, 1] + R[2, 2] * R[2, 2]
        code = ca.if_else(cosine2 < NEAREST_PITCH, 2.0, code)  # the cause, where both hold
    return code


def given_up(code: ca.SX, wanted: tuple[Condition, ...], metrics: tuple[Metric, ...], totals: ca.SX) -> ca.SX:
    """``code``, but `GIVEN_UP` where a run would go on in vain.

    ``totals`` (k): the running totals of the first k ``metrics``, this sample included. The largest so far never
    falls, and the smallest never rises: one beyond its limit is beyond it at the end, too.
    """
    for metric, total in zip(metrics, ca.vertsplit(totals), strict=False):
        for condition in wanted:
            if condition.metric == metric.name and (metric.reduction, condition.sign) in _BEYOND:
                beyond = _BEYOND[metric.reduction, condition.sign](total, condition.limit)
                code = ca.if_else(ca.logic_and(code == 0, beyond), float(GIVEN_UP), code)
    return code


def all_decided(wanted: tuple[Condition, ...], metrics: tuple[Metric, ...]) -> bool:
    """Whether each of the conditions ends a run that does not meet it, so that one without a stop meets them all."""
    reductions = {metric.name: metric.reduction for metric in metrics if metric.signal}
    return all((reductions.get(one.metric, "last"), one.sign) in _BEYOND for one in wanted)


_BEYOND: dict[tuple[str, str], Callable[[ca.SX, float], ca.SX]] = {
    ("max", "<"): operator.ge,
    ("max", "<="): operator.gt,
    ("min", ">"): operator.le,
    ("min", ">="): operator.lt,
}
