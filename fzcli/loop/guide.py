"""The motion that a torque controller follows, between the samples of the run that makes it.

Joints, tip and base attitude are one vector (m). From sample to sample runs a polynomial of fifth order whose velocity
and acceleration at the samples come from differences of the samples up to its end: C2, through every sample, and
without looking ahead. Source: Hermite interpolation; backward differences of second order.
"""

from dataclasses import dataclass

import casadi as ca

from fzcli.model import RobotModel
from fzcli.model.algebra import cross, dot, rotate
from fzcli.model.attitude import conjugate, multiply, normalised, quaternion_from_matrix, rotation_matrix


@dataclass(frozen=True)
class Guided:
    """Where the parts of a sample stand: ``q`` (n), ``tip`` (3) world, ``tip_quat``, ``base_quat`` (4)."""

    n: int

    @property
    def size(self) -> int:
        """Numbers in a sample."""
        return self.n + 11

    @property
    def q(self) -> slice:
        """Joints."""
        return slice(0, self.n)

    @property
    def tip(self) -> slice:
        """Tip position, world."""
        return slice(self.n, self.n + 3)

    @property
    def tip_quat(self) -> slice:
        """Tip attitude."""
        return slice(self.n + 3, self.n + 7)

    @property
    def base_quat(self) -> slice:
        """Base attitude."""
        return slice(self.n + 7, self.n + 11)


def guide_sample(model: RobotModel, tip: str | None, q: ca.SX, quat: ca.SX, com: ca.SX) -> ca.SX:
    """The vector (m) at joints q, base attitude and CoM (of a fixed base: its origin), world."""
    position, rotation, _ = model.function("tip", tip)(q)
    place = com + rotate(rotation_matrix(quat), position)
    return ca.vertcat(q, place, multiply(quat, quaternion_from_matrix(rotation)), quat)


def starting_rates(guided: Guided, model: RobotModel, sample: ca.SX, com: ca.SX, velocity: ca.SX, rate: ca.SX) -> ca.SX:
    """Rates (m) of a sample with joints at rest; ``velocity`` of the CoM and ``rate`` of the base (3), world."""
    turning = ca.vertcat(0, rate)
    moving = velocity + cross(rate, sample[guided.tip] - com)
    return ca.vertcat(
        ca.SX.zeros(model.n),
        moving,
        0.5 * multiply(turning, sample[guided.tip_quat]),
        0.5 * multiply(turning, sample[guided.base_quat]),
    )


@dataclass(frozen=True)
class Segment:
    """From one sample to the next: ``coefficients`` (6 m) in s = 0..1, and what the next segment begins with.

    ``sample``: the next sample, its quaternions on the same side as the one before; ``slope``: the difference quotient;
    ``rate``, ``bend``: velocity and acceleration at the end.
    """

    coefficients: ca.SX
    sample: ca.SX
    slope: ca.SX
    rate: ca.SX
    bend: ca.SX

    @staticmethod
    def between(
        guided: Guided, before: ca.SX, after: ca.SX, slope: ca.SX, rate: ca.SX, bend: ca.SX, dt: float
    ) -> "Segment":
        """``slope``, ``rate``, ``bend``: those that the segment before ended with."""
        after = ca.SX(after)
        for part in (guided.tip_quat, guided.base_quat):
            after[part] = after[part] * ca.if_else(dot(before[part], after[part]) < 0, -1.0, 1.0)
        quotient = (after - before) * (1 / dt)
        bend_after = (quotient - slope) * (1 / dt)
        rate_after = quotient + 0.5 * (quotient - slope)
        v0, w0, v1, w1 = dt * rate, dt * dt * bend, dt * rate_after, dt * dt * bend_after
        left, faster, more = after - before - v0 - 0.5 * w0, v1 - v0 - w0, w1 - w0
        coefficients = ca.vertcat(
            before,
            v0,
            0.5 * w0,
            10 * left - 4 * faster + 0.5 * more,
            -15 * left + 7 * faster - more,
            6 * left - 3 * faster + 0.5 * more,
        )
        return Segment(coefficients, after, quotient, rate_after, bend_after)


def wanted_at(guided: Guided, coefficients: ca.SX, s: ca.SX, dt: float) -> list[ca.SX]:
    """The wanted fields of `TorqueInputs`, in their order, at share s of the segment."""
    m = guided.size
    c = [coefficients[i * m : (i + 1) * m] for i in range(6)]
    value, slope, bend = c[5], 5 * c[5], 20 * c[5]
    for i in range(4, -1, -1):
        value = c[i] + s * value
        if i >= 1:
            slope = i * c[i] + s * slope
        if i >= 2:
            bend = i * (i - 1) * c[i] + s * bend
    slope, bend = slope * (1 / dt), bend * (1 / (dt * dt))
    turns = [
        (normalised(value[part]), _rate(value[part], slope[part])) for part in (guided.tip_quat, guided.base_quat)
    ]
    joints = [value[guided.q], slope[guided.q], bend[guided.q]]
    return [*joints, value[guided.tip], slope[guided.tip], *turns[0], *turns[1]]


def _rate(quat: ca.SX, slope: ca.SX) -> ca.SX:
    """Angular velocity (3), world, of a quaternion of any length that changes by ``slope``."""
    return 2 * multiply(slope, conjugate(quat))[1:4] / dot(quat, quat)
