"""A joint path: from rest to rest by a time law, with detours added for a while; position and two derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.plan.half_cycloid import PEAK, bump, bump_acceleration, bump_rate, window_phase
from fzcli.plan.time_laws.registry import TIME_LAWS, TimeLawName

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Detour:
    """What is added to the joints for a while: ``peak`` (n) signed [rad or m], from ``begin`` to ``end`` [s].

    ``dwell`` [s] of that at the peak. Smooth in position, velocity and acceleration.
    """

    peak: Array
    begin: float
    end: float
    dwell: float = 0.0

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Addition to position, velocity and acceleration at times (T,), each (T, n)."""
        u, pace = window_phase(time, self.begin, self.end, self.dwell)
        moving = (time > self.begin) & (time < self.end)
        if self.dwell > 0:
            middle = 0.5 * (self.begin + self.end)
            moving &= np.abs(time - middle) > 0.5 * self.dwell
        share = self.peak / PEAK
        rate = np.where(moving, bump_rate(u), 0.0) * pace
        force = np.where(moving, bump_acceleration(u), 0.0) * pace**2
        return np.outer(bump(u), share), np.outer(rate, share), np.outer(force, share)


@dataclass(frozen=True)
class JointPath:
    """theta_j(t) = start_j + travel_j S(t/T) + sum of detours (Parsa 2008, equations 5 and 11).

    As printed, equation 11 scales a detour by the joint's travel, so that a joint that does not travel could not
    move; here a detour has a peak of its own. ``start``, ``travel`` (n) [rad or m], ``duration`` [s].
    """

    start: Array
    travel: Array
    duration: float
    law: TimeLawName = "3-4-5"
    detours: tuple[Detour, ...] = ()

    @property
    def goal(self) -> Array:
        """Where it ends, (n)."""
        return self.start + self.travel

    @property
    def knots(self) -> list[float]:
        """Times [s] at which one formula follows another: of the law, and of every detour."""
        found = [phase * self.duration for phase in (0.0, *TIME_LAWS[self.law].corners, 1.0)]
        for detour in self.detours:
            middle, half = 0.5 * (detour.begin + detour.end), 0.5 * detour.dwell
            found += [detour.begin, middle - half, middle + half, detour.end]
        return found

    def at(self, time: Array | Sequence[float] | float) -> tuple[Array, Array, Array]:
        """q, qd, qdd at times (T,), each (T, n)."""
        t = np.atleast_1d(np.asarray(time, dtype=np.float64))
        s, ds, dds = (values / self.duration**k for k, values in enumerate(law_values(self.law, t / self.duration)))
        q = self.start + np.outer(s, self.travel)
        qd, qdd = np.outer(ds, self.travel), np.outer(dds, self.travel)
        for detour in self.detours:
            more = detour.at(t)
            q, qd, qdd = q + more[0], qd + more[1], qdd + more[2]
        return q, qd, qdd

    def speed_bound(self, begin: float, end: float) -> Array:
        """No joint is faster than this between two times, (n) [rad/s or m/s]: found by interval arithmetic."""
        bound = np.abs(self.travel) * law_speed_bound(self.law, begin / self.duration, end / self.duration)
        bound = bound / self.duration
        for detour in self.detours:
            bound = bound + np.abs(detour.peak) * _bump_speed_bound(detour, begin, end)
        return bound


def law_values(law: TimeLawName, phase: Array) -> list[Array]:
    """s, ds, dds of a time law at phases (T,), each (T,)."""
    return [np.array(values).ravel() for values in _compiled(law).map(len(phase))(phase[None, :])]


_FUNCTIONS: dict[str, ca.Function] = {}


def _compiled(law: TimeLawName) -> ca.Function:
    if law not in _FUNCTIONS:
        phase = ca.SX.sym("phase")
        _FUNCTIONS[law] = ca.Function("law", [phase], [ca.densify(v) for v in TIME_LAWS[law].evaluate(phase)])
    return _FUNCTIONS[law]


def law_speed_bound(law: TimeLawName, begin: float, end: float) -> float:
    """The largest ds/dphase between two phases: every law speeds up to the middle and slows down after it."""
    if begin <= 0.5 <= end:
        return TIME_LAWS[law].peak_speed
    return float(law_values(law, np.array([begin, end]))[1].max())


def _bump_speed_bound(detour: Detour, begin: float, end: float) -> float:
    """The largest |B'| / 2 [1/s] between two times: it rises to u = 1, falls to u = 2, and so again."""
    if end <= detour.begin or begin >= detour.end:
        return 0.0
    u, pace = window_phase(np.array([begin, end]), detour.begin, detour.end, detour.dwell)
    if u[0] <= 1.0 <= u[1] or u[0] <= 3.0 <= u[1]:
        return pace * 2.0 / PEAK
    return pace * float(np.abs(bump_rate(u)).max()) / PEAK


def fastest(start: Array, goal: Array, speeds: Array, accelerations: Array, law: TimeLawName = "3-4-5") -> float:
    """The shortest duration [s] from rest to rest within joint speeds and accelerations (n), infinite for none."""
    way = np.abs(np.asarray(goal) - np.asarray(start))
    found = TIME_LAWS[law]
    with np.errstate(invalid="ignore", divide="ignore"):
        by_speed = np.where(way > 0, way * found.peak_speed / speeds, 0.0)
        by_acceleration = np.where(way > 0, np.sqrt(way * found.peak_acceleration / accelerations), 0.0)
    return float(max(by_speed.max(initial=0.0), by_acceleration.max(initial=0.0)))


def paper_detour(start: Array, goal: Array, scale: Array, begin: float, end: float) -> Detour:
    """Equation 11 as printed: the detour of joint j is scale_j = L_j times the joint's travel; peak 2 L_j travel_j."""
    return Detour(PEAK * scale * (np.asarray(goal) - np.asarray(start)), begin, end)
