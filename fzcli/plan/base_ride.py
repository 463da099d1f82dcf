"""How a free base turns while its arm follows a joint path, at zero momentum; and how that hangs on the path.

The turn over a short piece of path is that of `fzcli.model.gauss_magnus`. Pieces are chained by an associative
product, so that whole paths, and many at once, are NumPy operations.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.model import RobotModel
from fzcli.model.collision import many
from fzcli.model.gauss_magnus import COMMUTATOR, NODES
from fzcli.plan.built import part_of
from fzcli.plan.quaternions import exponential, product

Array = NDArray[np.float64]
PIECE = 0.05  # s: longest piece of path over which the base is carried in one go
FEWEST = 32  # pieces of a path


class Path(Protocol):
    """A joint path over time [s]."""

    @property
    def duration(self) -> float: ...
    @property
    def start(self) -> Array: ...
    @property
    def goal(self) -> Array: ...
    @property
    def knots(self) -> list[float]:
        """Times [s] at which it goes from one formula to the next, in any order, begin and end among them."""
        ...

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """q, qd, qdd at times (T,), each (T, n)."""
        ...

    def speed_bound(self, begin: float, end: float) -> Array:
        """No joint is faster than this between two times, (n)."""
        ...


@dataclass(frozen=True)
class BaseRide:
    """The base's attitudes ``quats`` (K, 4) at ``knots`` (K) [s] of a path; others are reached from the knot before."""

    model: RobotModel
    path: Path
    knots: Array
    quats: Array

    def at(self, times: Array) -> Array:
        """Attitudes (T, 4) at times (T) of the path, in any order."""
        before = np.clip(np.searchsorted(self.knots, times, side="right") - 1, 0, len(self.knots) - 1)
        begin = self.knots[before]
        turns = piece_turns(self.model, self.path.at, begin, np.maximum(times - begin, 0.0))
        return product(self.quats[before], exponential(turns))


def build_ride(model: RobotModel, path: Path, base_quat: Array) -> BaseRide:
    """The ride of the base along a whole path from its attitude at the start, (4)."""
    knots = np.linspace(0.0, path.duration, max(FEWEST, int(np.ceil(path.duration / PIECE))) + 1)
    turns = piece_turns(model, path.at, knots[:-1], np.diff(knots))
    return BaseRide(model, path, knots, carried(base_quat, turns))


def piece_turns(model: RobotModel, at: Callable[[Array], tuple[Array, ...]], begin: Array, steps: Array) -> Array:
    """The base's turns (T, 3) [rad], base axes, in pieces of a path that begin and last [s] as told, (T) each."""
    a, b = (many(base_rate(model), *at(begin + node * steps)[:2])[0] * steps[:, None] for node in NODES)
    return np.asarray(0.5 * (a + b) + COMMUTATOR * np.cross(a, b))


def base_rate(model: RobotModel) -> ca.Function:
    """q, qd -> the base's rate (3) [rad/s], base axes."""

    def build() -> ca.Function:
        q, qd = ca.SX.sym("q", model.n), ca.SX.sym("qd", model.n)
        return ca.Function("base_rate", [q, qd], ca.cse([ca.densify(ca.mtimes(model.function("body")(q)[4], qd))]))

    return part_of(model, "base rate", build)


def rate_slopes(model: RobotModel) -> ca.Function:
    """q, qd -> the base's rate (3) [rad/s], base axes; its derivatives by q and by qd, (3 n) column after column."""

    def build() -> ca.Function:
        q, qd = ca.SX.sym("q", model.n), ca.SX.sym("qd", model.n)
        by_qd = model.function("body")(q)[4]
        rate = ca.mtimes(by_qd, qd)
        outputs = [rate, ca.vec(ca.jacobian(rate, q)), ca.vec(by_qd)]
        return ca.Function("base_rate_slopes", [q, qd], ca.cse([ca.densify(one) for one in outputs]))

    return part_of(model, "base rate slopes", build)


def carried(quat: Array, turns: Array) -> Array:
    """Attitudes (T+1, ..., 4) after each of the turns (T, ..., 3) [rad], base axes, from ``quat`` (4)."""
    chain = exponential(turns)
    length = 1
    while length < len(chain):
        chain = np.concatenate([chain[:length], product(chain[:-length], chain[length:])])
        length *= 2
    first = np.broadcast_to(quat, (1, *chain.shape[1:]))
    found = np.concatenate([first, product(np.broadcast_to(quat, chain.shape), chain)])
    return np.asarray(found / np.sqrt((found * found).sum(axis=-1, keepdims=True)))


def turn_slopes(a: Array, b: Array, by_a: Array, by_b: Array) -> tuple[Array, Array]:
    """Turns (T, 3) of pieces with rates a and b (T, 3) at their nodes, times the period, and by how much a change
    of them, (T, 3, k) each, turns what follows, in the axes before the piece: Jl(turn) dturn, (T, 3, k)."""
    turns = 0.5 * (a + b) + COMMUTATOR * np.cross(a, b)
    change = 0.5 * (by_a + by_b)
    change += COMMUTATOR * (np.cross(by_a, b[:, :, None], axis=1) + np.cross(a[:, :, None], by_b, axis=1))
    angle = np.sqrt((turns * turns).sum(axis=1))[:, None, None]
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    once = np.where(small, 0.5, (1 - np.cos(safe)) / safe**2)
    twice = np.where(small, 1 / 6, (safe - np.sin(safe)) / safe**3)
    across = np.cross(turns[:, :, None], change, axis=1)
    return turns, change + once * across + twice * np.cross(turns[:, :, None], across, axis=1)
