"""How a free base is carried along by a path with detours, and how its pose hangs on their peaks."""

import numpy as np
from numpy.typing import NDArray

from fzcli.model.collision import many
from fzcli.model.gauss_magnus import COMMUTATOR, NODES
from fzcli.plan.base_ride import base_rate, build_ride, carried, rate_slopes, turn_slopes
from fzcli.plan.half_cycloid import PEAK, bump, bump_rate, window_phase
from fzcli.plan.joint_path import JointPath
from fzcli.plan.quaternions import rotations
from fzcli.plan.world import World

Array = NDArray[np.float64]
Window = tuple[float, float]  # begin, end [s]


class WindowRide:
    """The ride of a free base through windows of detours, from where the nominal path brings it to, sample to sample.

    Functions of the detours' peaks, a row (windows, n) each, and how they change with them.
    """

    def __init__(self, world: World, nominal: JointPath, windows: tuple[Window, ...], times: Array) -> None:
        self.world, self.model, self.n = world, world.model, len(nominal.start)
        begin = min(w[0] for w in windows)
        self.first = build_ride(self.model, nominal, world.base_quat).at(np.array([begin]))[0]
        self.numbers = world.scene.numbers(times)
        self.com = world.com(nominal.at(np.zeros(1))[0][0])
        knots = np.concatenate([[begin], times])
        self.steps = np.diff(knots)
        nodes = np.concatenate([knots[:-1] + node * self.steps for node in NODES])
        self.q0, self.qd0, _ = nominal.at(nodes)
        phases = [window_phase(nodes, *w) for w in windows]
        self.shares = np.column_stack([bump(u) for u, _ in phases]) / PEAK  # (2 T, windows)
        self.paces = np.column_stack([bump_rate(u) * pace for u, pace in phases]) / PEAK

    def poses(self, starts: Array, q: Array) -> tuple[Array, Array]:
        """Positions (S T, 3) [m] and attitudes (S T, 4) of the base at postures q (S T, n), by peaks (S, size)."""
        peaks = starts.reshape(len(starts), -1, self.n)
        nodes = self.q0 + np.einsum("tw,swn->stn", self.shares, peaks)
        ways = self.qd0 + np.einsum("tw,swn->stn", self.paces, peaks)
        rates = many(base_rate(self.model), nodes.reshape(-1, self.n), ways.reshape(-1, self.n))[0]
        a, b = np.split(rates.reshape(len(starts), -1, 3) * np.tile(self.steps, 2)[:, None], 2, axis=1)
        turns = np.swapaxes(0.5 * (a + b) + COMMUTATOR * np.cross(a, b), 0, 1)
        quats = np.swapaxes(carried(self.first, turns)[1:], 0, 1).reshape(-1, 4)
        return self.com - many(self.model.function("com"), q, quats)[0], quats

    def nearest(self, x: Array, q: Array, shares: Array, sharpness: float) -> tuple[Array, Array]:
        """Soft minimum (T,) at postures q (T, n) and its derivative by the peaks (T, size)."""
        peaks, steps = x.reshape(-1, self.n), np.tile(self.steps, 2)[:, None]
        nodes, ways = self.q0 + self.shares @ peaks, self.qd0 + self.paces @ peaks
        rates, by_q, by_qd = many(rate_slopes(self.model), nodes, ways)
        slopes = np.einsum("tw,tnr->trwn", self.shares * steps, by_q.reshape(-1, self.n, 3))
        slopes += np.einsum("tw,tnr->trwn", self.paces * steps, by_qd.reshape(-1, self.n, 3))
        a, b = np.split(rates * steps, 2)
        by_a, by_b = np.split(slopes.reshape(len(nodes), 3, -1), 2)
        turns, changes = turn_slopes(a, b, by_a, by_b)
        quats = carried(self.first, turns)
        turned = np.cumsum(rotations(quats[:-1]) @ changes, axis=0)  # world axes, (T, 3, size)
        values, by_posture, by_turn = self.world.nearest_afloat(q, self.numbers, self.com, quats[1:], sharpness)
        return values, by_peaks(shares, by_posture) + np.einsum("tr,trx->tx", by_turn, turned)


def by_peaks(shares: Array, slopes: Array) -> Array:
    """Derivatives by postures (T, n) as those by the peaks (T, windows n)."""
    return np.asarray((shares[:, :, None] * slopes[:, None, :]).reshape(len(slopes), -1))
