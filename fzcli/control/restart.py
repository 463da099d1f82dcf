"""Restart on a stall: find a posture from which the target is met, drive there, go on with the law.

The stall is noticed inside the step; the search is a host event between two steps. Our own, beside Dong 2022.
"""

from dataclasses import dataclass
from typing import Annotated

import casadi as ca
from pydantic import Field

from fzcli.control.aim import Aim
from fzcli.control.law import LawInputs, Search
from fzcli.control.posture_search import PostureSearchSpec, posture_search
from fzcli.model import RobotModel
from fzcli.spec.quantity import Metric, Signal
from fzcli.spec.units import Duration, Length

FAR = 1.0e300
AT_POSTURE = 1e-9  # rad: the drive has arrived


class RestartSpec(PostureSearchSpec):
    """When to search for another posture."""

    at_start: Annotated[bool, Field(description="search before the first step as well")] = False
    stall: Annotated[Duration, Field(gt=0, description="time without progress that makes a stall")] = 0.15
    progress: Annotated[
        float, Field(gt=0, lt=1, description="share by which distance + angle_weight x angle must fall to count")
    ] = 0.05
    angle_weight: Annotated[Length, Field(ge=0, description="m a radian")] = 0.2


@dataclass(frozen=True)
class Restart:
    """A law's command with the restart round it: command (n), memory (symbol, next, first), signals."""

    command: ca.SX
    memory: tuple[ca.SX, ca.SX, ca.SX]
    signals: dict[Signal, ca.SX]
    metrics: tuple[Metric, ...]
    search: tuple[Search, ca.SX]


@dataclass(frozen=True)
class _Memory:
    """best measure, steps since, driving (0 or 1), searches, searches without a result, posture (n)."""

    best: ca.SX
    count: ca.SX
    driving: ca.SX
    searches: ca.SX
    empty: ca.SX
    posture: ca.SX

    @staticmethod
    def of(vector: ca.SX) -> "_Memory":
        best, count, driving, searches, empty = (vector[i] for i in range(5))
        return _Memory(best, count, driving, searches, empty, vector[5:])

    @property
    def vector(self) -> ca.SX:
        return ca.vertcat(self.best, self.count, self.driving, self.searches, self.empty, self.posture)


def with_restart(
    spec: RestartSpec,
    model: RobotModel,
    inputs: LawInputs,
    aim: Aim,
    left: ca.SX,
    caps: list[ca.SX],
    directed: bool,
    tip: str | None,
    command: ca.SX,
) -> Restart:
    """Watch the law's progress, and put the drive to a found posture in its place.

    ``command`` (n) [rad/s] is the law's own, ``left`` [rad] what its tip has still to turn, ``caps`` (n) how far
    joints may go in a period. The drive is a straight line of the joints, all scaled
    alike to their speeds: the attitude that the base ends with hangs on the path.
    """
    n = model.n
    symbol = ca.SX.sym("memory", 5 + n)
    old = _Memory.of(symbol)
    rest = old.posture - inputs.q
    largest = _largest([ca.fabs(rest[i]) for i in range(n)])
    landed = ca.logic_and(old.driving, largest <= AT_POSTURE)
    driving = ca.logic_and(old.driving, ca.logic_not(landed))
    measure = aim.distance + spec.angle_weight * left
    best, count = ca.if_else(landed, FAR, old.best), ca.if_else(landed, 0, old.count)
    better = measure < (1 - spec.progress) * best
    best, count = ca.if_else(better, measure, best), ca.if_else(better, 0, count + 1)
    stalled = count * inputs.period >= spec.stall - 1e-9
    if spec.at_start:
        stalled = ca.logic_or(stalled, old.searches == 0)
    asks = ca.logic_and(ca.logic_and(ca.logic_not(driving), stalled), measure < FAR)
    periods = _largest([ca.SX(1), *(ca.fabs(rest[i]) / caps[i] for i in range(n))])
    drive = rest * (1 / (periods * inputs.period))
    new = _Memory(
        ca.if_else(driving, old.best, best),
        ca.if_else(driving, old.count, count),
        ca.if_else(driving, 1, 0),
        old.searches,
        old.empty,
        old.posture,
    )
    first = ca.SX.zeros(5 + n)
    first[0] = FAR
    signals = {
        Signal("driving", "1", "1 while the arm drives to a posture that a search found"): new.driving,
        Signal("searches", "1", "searches so far"): old.searches,
        Signal("searches_empty", "1", "of them without a result"): old.empty,
        Signal("restarts", "1", "drives to another posture so far"): old.searches - old.empty,
    }
    metrics = (
        Metric("restarts", "restarts", "last", "1", "drives to another posture"),
        Metric("searches", "searches", "last", "1", "searches for another posture"),
        Metric("searches_empty", "searches_empty", "last", "1", "of them without a result"),
    )
    search = posture_search(spec, model, inputs, aim, directed, tip, symbol, old.searches, _accept(n))
    return Restart(ca.if_else(driving, drive, command), (symbol, new.vector, first), signals, metrics, (search, asks))


def _largest(values: list[ca.SX]) -> ca.SX:
    found = values[0]
    for value in values[1:]:
        found = ca.fmax(found, value)
    return found


def _accept(n: int) -> ca.Function:
    """(memory, posture, found) -> memory: the search is counted, its posture driven to, progress begins afresh."""
    symbol, posture, found = ca.SX.sym("memory", 5 + n), ca.SX.sym("posture", n), ca.SX.sym("found")
    old = _Memory.of(symbol)
    new = _Memory(ca.SX(FAR), ca.SX(0), found, old.searches + 1, old.empty + 1 - found, posture)
    given = {"memory": symbol, "posture": posture, "found": found}
    return ca.Function("accept", list(given.values()), [new.vector], list(given), ["memory_next"])
