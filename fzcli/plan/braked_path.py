"""A path followed up to a moment, from there ever more slowly to rest, and back a little where that is safer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.joint_path import law_values
from fzcli.plan.time_laws.registry import TIME_LAWS
from fzcli.plan.world import Path

Array = NDArray[np.float64]
LAW = TIME_LAWS["3-4-5"]


@dataclass(frozen=True)
class BrakedPath:
    """q(s(t)) of ``path``: ds/dt is 1 until ``begin`` [s] and falls to 0 by the 3-4-5 law in ``length`` [s].

    Then s goes ``back`` [s] by the same law, from rest to rest, no faster than it came; the arm rests until ``end``
    [s]. s has two continuous derivatives and more: the joints are as smooth as on the path, and never faster.
    """

    path: Path
    begin: float
    length: float
    end: float
    back: float = 0.0

    @property
    def duration(self) -> float:
        """With the rest after the stop [s]."""
        return self.end

    @property
    def start(self) -> Array:
        """The path's, (n)."""
        return self.path.start

    @property
    def goal(self) -> Array:
        """Where the arm rests at last, (n)."""
        return np.asarray(self.path.at(np.array([self.turn - self.back]))[0][0])

    @property
    def turn(self) -> float:
        """The s [s] at which the path is no longer followed: braking goes on for half of its time."""
        return self.begin + 0.5 * self.length

    @property
    def stopped(self) -> float:
        """When the arm first comes to rest [s]."""
        return self.begin + self.length

    @property
    def rest(self) -> float:
        """When it comes to rest for good [s]."""
        return self.stopped + LAW.peak_speed * self.back

    @property
    def knots(self) -> list[float]:
        """The path's as they are met [s], and those of the stop and the way back."""
        return [0.0, self.duration, self.begin, self.stopped, self.rest, *(self.when(knot) for knot in self.path.knots)]

    def progress(self, time: Array) -> tuple[Array, Array, Array]:
        """s [s], ds/dt and its rate [1/s] at times (T,)."""
        u = np.clip((time - self.begin) / self.length, 0.0, 1.0)
        s = np.minimum(time, self.begin) + self.length * (u - u**4 * (2.5 + u * (u - 3.0)))
        rate = 1.0 - u**3 * (10.0 + u * (6.0 * u - 15.0))
        slowing = -30.0 * (u * (1.0 - u)) ** 2 / self.length
        if self.back > 0:
            seconds = LAW.peak_speed * self.back
            gone, pace, force = law_values("3-4-5", (time - self.stopped) / seconds)
            s, rate = s - self.back * gone, rate - self.back / seconds * pace
            slowing = slowing - self.back / seconds**2 * force
        return s, rate, slowing

    def when(self, place: float) -> float:
        """The first time [s] at which s is there; where it stops short of it, when it stops."""
        if place <= self.begin or place >= self.turn:
            return place if place <= self.begin else self.stopped
        from scipy.optimize import brentq

        def ahead(time: float) -> float:
            return float(self.progress(np.array([time]))[0][0]) - place

        return float(brentq(ahead, self.begin, self.stopped, xtol=1e-15))

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """q, qd, qdd at times (T,), each (T, n)."""
        s, rate, slowing = self.progress(np.atleast_1d(np.asarray(time, dtype=np.float64)))
        q, qd, qdd = self.path.at(s)
        return q, qd * rate[:, None], qdd * (rate**2)[:, None] + qd * slowing[:, None]

    def speed_bound(self, begin: float, end: float) -> Array:
        """No joint is faster than this between two times, (n)."""
        inner = [t for t in (self.stopped,) if begin < t < end]
        s, rate, _ = self.progress(np.array([begin, *inner, end]))
        fastest = 1.0 if self.back > 0 and begin < self.rest and end > self.stopped else float(rate.max())
        return self.path.speed_bound(float(s.min()), float(s.max())) * fastest
