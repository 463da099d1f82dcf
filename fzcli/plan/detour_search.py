"""Detours that keep clear: the least weighted detour whose clearance, limits and speeds hold (by optimisation)."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.half_cycloid import PEAK, bump, bump_rate, window_phase
from fzcli.plan.joint_path import Detour, JointPath
from fzcli.plan.world import World

Array = NDArray[np.float64]
Window = tuple[float, float]  # begin, end [s]
BLOCKS, SAMPLES = 6, 10  # of a window: one constraint a block, from that many samples
SOFT, SHARP = 1000.0, 8000.0  # 1/m: of the first and the last optimisation
AMPLITUDES = (0.25, 0.6, 1.2)  # rad: of the sign patterns
BEST = 6  # starts that are optimised


@dataclass(frozen=True)
class DetourProblem:
    """A nominal path to be led round what it meets. ``weights`` (n) of the squared peaks; ``margin`` [m].

    ``speeds`` (n): joint speed limits to keep, infinite where the path will be stretched.
    """

    world: World
    nominal: JointPath
    weights: Array
    margin: float
    speeds: Array

    def path(self, windows: tuple[Window, ...], peaks: Array) -> JointPath:
        """The nominal path with a detour of ``peaks`` (windows, n) in each window."""
        rows = peaks.reshape(len(windows), -1)
        detours = tuple(Detour(row, *window) for row, window in zip(rows, windows, strict=True) if row.any())
        return replace(self.nominal, detours=self.nominal.detours + detours)


@dataclass(frozen=True)
class Found:
    """Detours, their cost, and by how much the worst constraint is missed [m] (0: none)."""

    path: JointPath
    cost: float
    violation: float


class WindowProblem:
    """The optimisation over the peaks of detours in given windows."""

    def __init__(self, problem: DetourProblem, windows: tuple[Window, ...]) -> None:
        self.problem, self.windows = problem, windows
        self.n = len(problem.nominal.start)
        begin, end = min(w[0] for w in windows), max(w[1] for w in windows)
        middles = (np.arange(BLOCKS * SAMPLES) + 0.5) / (BLOCKS * SAMPLES)
        self.times = begin + (end - begin) * middles
        self.q0 = problem.nominal.at(self.times)[0]
        self.shares = np.column_stack([bump(window_phase(self.times, *w)[0]) / PEAK for w in windows])  # (T, windows)
        self.weights = np.tile(problem.weights, len(windows))
        self.rows = _limit_rows(problem, windows)

    def postures(self, x: Array) -> Array:
        """q (T, n) at the samples."""
        return self.q0 + self.shares @ x.reshape(len(self.windows), self.n)

    def clearances(self, x: Array, sharpness: float) -> tuple[Array, Array]:
        """Soft minimum of every block (B) and its derivative by x (B, size)."""
        world = self.problem.world
        if world.model.floating:
            return self._by_differences(x, sharpness)
        values, slopes = world.nearest(self.postures(x), self.times, sharpness)
        by_x = (self.shares[:, :, None] * slopes[:, None, :]).reshape(len(values), -1)
        return _softened(values, by_x, sharpness)

    def _by_differences(self, x: Array, sharpness: float) -> tuple[Array, Array]:
        """On a free base the whole path moves each posture: derivatives by differences."""
        step = 1e-6
        centre = self._blocks(x, sharpness)
        columns = [(self._blocks(x + step * e, sharpness) - centre) / step for e in np.eye(len(x))]
        return centre, np.column_stack(columns)

    def _blocks(self, x: Array, sharpness: float) -> Array:
        distances = self.problem.world.distances(self.problem.path(self.windows, x), self.times)
        least = distances.min(axis=1)
        soft = least - np.log(np.exp(-sharpness * (distances - least[:, None])).sum(axis=1)) / sharpness
        return _softened(soft, np.zeros((len(soft), 0)), sharpness)[0]

    def violation(self, x: Array) -> float:
        """By how much clearance and limits are missed, in all."""
        values = self.clearances(x, SOFT)[0] if not self.problem.world.model.floating else self._blocks(x, SOFT)
        slack = self.rows.slack(x)
        return float(np.maximum(self.problem.margin - values, 0).sum() + np.maximum(-slack, 0).sum())

    def optimise(self, x: Array, margin: float) -> tuple[Array, bool]:
        """The nearest least-cost peaks from a start, and whether all constraints hold there."""
        for sharpness in (SOFT, SHARP):
            x, good = self._descend(x, margin, sharpness)
        return x, good

    def _descend(self, x: Array, margin: float, sharpness: float) -> tuple[Array, bool]:
        from scipy.optimize import minimize

        memory: dict[bytes, tuple[Array, Array]] = {}

        def at(y: Array) -> tuple[Array, Array]:
            key = y.tobytes()
            if key not in memory:
                memory[key] = self.clearances(y, sharpness)
            return memory[key]

        constraints = [{"type": "ineq", "fun": lambda y: 10 * (at(y)[0] - margin), "jac": lambda y: 10 * at(y)[1]}]
        if len(self.windows) > 1:
            rows = self.rows
            constraints.append({"type": "ineq", "fun": rows.slack, "jac": lambda y: rows.matrix})
        low, high = self.rows.bounds
        result = minimize(
            lambda y: float((self.weights * y * y).sum()),
            np.clip(x, low, high),
            jac=lambda y: 2 * self.weights * y,
            bounds=np.column_stack([low, high]),
            constraints=constraints,
            method="SLSQP",
            options={"maxiter": 40, "ftol": 1e-7},
        )
        y = np.clip(result.x, low, high)
        good = bool((at(y)[0] >= margin - 2e-4).all() and (self.rows.slack(y) >= -1e-9).all())
        return y, good


def _softened(values: Array, slopes: Array, sharpness: float) -> tuple[Array, Array]:
    """Soft minimum of every block of samples, with its derivatives."""
    rows = values.reshape(BLOCKS, SAMPLES)
    least = rows.min(axis=1, keepdims=True)
    shares = np.exp(-sharpness * (rows - least))
    total = shares.sum(axis=1, keepdims=True)
    soft = (least - np.log(total) / sharpness)[:, 0]
    weights = shares / total
    return soft, np.einsum("bs,bsx->bx", weights, slopes.reshape(BLOCKS, SAMPLES, slopes.shape[1]))


@dataclass(frozen=True)
class LimitRows:
    """Joint limits and speeds as linear rows ``matrix`` x <= ``most``; ``bounds`` of each x by its own rows alone."""

    matrix: Array
    most: Array
    bounds: tuple[Array, Array]

    def slack(self, x: Array) -> Array:
        """What is left of every row, negative where it is broken."""
        return self.most - self.matrix @ x


def _limit_rows(problem: DetourProblem, windows: tuple[Window, ...]) -> LimitRows:
    nominal, n = problem.nominal, len(problem.nominal.start)
    begin, end = min(w[0] for w in windows), max(w[1] for w in windows)
    times = np.linspace(begin, end, 8 * BLOCKS + 1)[1:-1]
    q, qd, _ = nominal.at(times)
    low, high = problem.world.model.tree.position_limits.T
    phases = [window_phase(times, *w) for w in windows]
    places = np.column_stack([bump(u) / PEAK for u, _ in phases])
    paces = np.column_stack([np.where((u > 0) & (u < 4), bump_rate(u), 0.0) * pace / PEAK for u, pace in phases])
    blocks, most = [], []
    for j in range(n):
        select = np.zeros((1, n))
        select[0, j] = 1.0
        for shares, now, least, largest in (
            (places, q[:, j], low[j], high[j]),
            (paces, qd[:, j], -problem.speeds[j], problem.speeds[j]),
        ):
            row = np.einsum("tw,n->twn", shares, select[0]).reshape(len(times), -1)
            if np.isfinite(largest):
                blocks.append(row)
                most.append(largest - now)
            if np.isfinite(least):
                blocks.append(-row)
                most.append(now - least)
    matrix = np.vstack(blocks) if blocks else np.zeros((0, n * len(windows)))
    limits = np.concatenate(most) if most else np.zeros(0)
    return LimitRows(matrix, limits, _own_bounds(matrix, limits))


def _own_bounds(matrix: Array, most: Array) -> tuple[Array, Array]:
    """The interval of every x that its rows leave it while the other windows rest."""
    size = matrix.shape[1]
    low, high = np.full(size, -4.0 * np.pi), np.full(size, 4.0 * np.pi)
    for i in range(size):
        column = matrix[:, i]
        up, down = column > 1e-9, column < -1e-9
        high[i] = min(high[i], float((most[up] / column[up]).min(initial=np.inf)))
        low[i] = max(low[i], float((most[down] / column[down]).max(initial=-np.inf)))
    return np.minimum(low, 0.0), np.maximum(high, 0.0)


def patterns(n: int, leading: int = 3) -> Iterator[Array]:
    """Sign patterns of the first joints at each amplitude, the rest at zero, (n) each."""
    for signs in itertools.product((-1.0, 0.0, 1.0), repeat=min(leading, n)):
        if any(signs):
            for amplitude in AMPLITUDES:
                x = np.zeros(n)
                x[: len(signs)] = amplitude * np.array(signs)
                yield x
