"""Detours that keep clear: the least weighted detour whose clearance, limits and speeds hold (by optimisation)."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.half_cycloid import PEAK, PEAK_SPEED, bump, bump_rate, window_phase
from fzcli.plan.joint_path import Detour, JointPath
from fzcli.plan.window_ride import Window as Window
from fzcli.plan.window_ride import WindowRide, by_peaks
from fzcli.plan.world import AnyWorld, World

Array = NDArray[np.float64]
BLOCKS, SAMPLES = 6, 10  # of a window: one constraint a block, from that many samples
SOFT, SHARP = 1000.0, 8000.0  # 1/m: of the first and the last optimisation
HOPELESS, MISSED = 0.01, 2e-4  # m: missed by more, the first is the last; and what the last may miss
ROUGH, EXACT = 1e-4, 1e-7  # of the cost, where they end
AMPLITUDES = (0.25, 0.6, 1.2)  # rad: of the sign patterns
FINE = 401  # samples at which limits and speeds are checked
SPARE = 1e-4  # rad or m: kept from what limits allow a peak to be, for what lies between the samples
THIRD = slice(1, None, 3)  # of the samples: to compare starts
BEST = 6  # starts that are optimised


class SpentError(Exception):
    """A search has used up its evaluations."""


@dataclass
class Budget:
    """Evaluations of the clearance along a window that a search has left."""

    left: float = np.inf
    used: int = 0

    def spend(self) -> None:
        """One more. Raises SpentError where none is left."""
        if self.left < 1:
            raise SpentError
        self.left -= 1
        self.used += 1


@dataclass(frozen=True)
class DetourProblem:
    """A nominal path to be led round what it meets. ``weights`` (n) of the squared peaks; ``margin`` [m].

    ``speeds`` (n): joint speed limits to keep, infinite where the path will be stretched. ``begin`` [s]: what lies
    before it is not looked at. ``budget``: of all searches together; they raise SpentError when it ends.
    """

    world: AnyWorld
    nominal: JointPath
    weights: Array
    margin: float
    speeds: Array
    begin: float = 0.0
    budget: Budget = field(default_factory=Budget)

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
        self.q0, self.numbers = problem.nominal.at(self.times)[0], problem.world.scene.numbers(self.times)
        self.shares = np.column_stack([bump(window_phase(self.times, *w)[0]) / PEAK for w in windows])  # (T, windows)
        self.weights = np.tile(problem.weights, len(windows))
        self.spare = SPARE
        self.rows = _limit_rows(problem, windows, self.spare)
        self.afloat: WindowRide | None = None
        if isinstance(problem.world, World) and problem.world.model.floating:
            self.afloat = WindowRide(problem.world, problem.nominal, windows, self.times)

    def postures(self, x: Array) -> Array:
        """q (T, n) at the samples."""
        return self.q0 + self.shares @ x.reshape(len(self.windows), self.n)

    def clearances(self, x: Array, sharpness: float) -> tuple[Array, Array]:
        """Soft minimum of every block (B) and its derivative by x (B, size)."""
        self.problem.budget.spend()
        q = self.postures(x)
        if self.afloat is not None:
            return _softened(*self.afloat.nearest(x, q, self.shares, sharpness), sharpness)
        values, slopes = self.problem.world.nearest(q, self.numbers, sharpness)
        return _softened(values, by_peaks(self.shares, slopes), sharpness)

    def violations(self, starts: Array) -> Array:
        """By how much clearance and limits are missed in all, (S), by peaks (S, size); seen at every third sample."""
        self.problem.budget.spend()
        world, times, peaks = self.problem.world, self.times[THIRD], starts.reshape(len(starts), -1, self.n)
        q = (self.q0[THIRD] + np.einsum("tw,swn->stn", self.shares[THIRD], peaks)).reshape(-1, self.n)
        position, quat = world.base_position, world.base_quat
        if isinstance(world, World) and world.model.floating:
            position, quat = WindowRide(world, self.problem.nominal, self.windows, times).poses(starts, q)
        numbers = np.tile(self.numbers[THIRD], (len(starts), 1))
        least = world.least(q, numbers, position, quat).reshape(len(starts), len(times))
        missed = np.maximum(self.problem.margin - least, 0.0).sum(axis=1)
        return np.asarray(missed + np.maximum(starts @ self.rows.matrix.T - self.rows.most, 0.0).sum(axis=1))

    def violation(self, x: Array) -> float:
        """The same for one."""
        return float(self.violations(x[None])[0])

    def past_limits(self, path: JointPath) -> float:
        """By how much smaller the peaks must be [rad or m], about, for a path to keep the joints' limits and speeds."""
        begin, end = min(w[0] for w in self.windows), max(w[1] for w in self.windows)
        low, high = self.problem.world.model.tree.position_limits.T
        q, qd, _ = path.at(np.linspace(begin, end, FINE))
        pace = 2.0 * PEAK_SPEED / min(w[1] - w[0] for w in self.windows)  # fastest of a detour of 1
        over = max(float((low - q).max()), float((q - high).max()))
        return max(over, float((np.abs(qd) - self.problem.speeds).max()) / pace, 0.0)

    def spare_more(self, peaks: float) -> None:
        """Keep all peaks by so much more from what limits and speeds allow at the samples."""
        self.spare += peaks
        self.rows = _limit_rows(self.problem, self.windows, self.spare)

    def optimise(self, x: Array, margin: float) -> tuple[Array, bool]:
        """The nearest least-cost peaks from a start, and whether all constraints hold there."""
        x, missed = self._descend(x, margin, SOFT, ROUGH)
        if missed > HOPELESS:
            return x, False
        x, missed = self._descend(x, margin, SHARP, EXACT)
        return x, missed <= MISSED and bool((self.rows.slack(x) >= -1e-9).all())

    def _descend(self, x: Array, margin: float, sharpness: float, precision: float) -> tuple[Array, float]:
        """Peaks of less cost, and by how much their worst block misses the margin [m]."""
        from scipy.optimize import minimize

        memory: dict[bytes, tuple[Array, Array]] = {}

        def at(y: Array) -> tuple[Array, Array]:
            key = y.tobytes()
            if key not in memory:
                memory[key] = self.clearances(y, sharpness)
            return memory[key]

        constraints = [{"type": "ineq", "fun": lambda y: 10 * (at(y)[0] - margin), "jac": lambda y: 10 * at(y)[1]}]
        if len(self.windows) > 1:
            matrix, most = self.rows.shared
            constraints.append({"type": "ineq", "fun": lambda y: most - matrix @ y, "jac": lambda y: -matrix})
        low, high = self.rows.bounds
        result = minimize(
            lambda y: float((self.weights * y * y).sum()),
            np.clip(x, low, high),
            jac=lambda y: 2 * self.weights * y,
            bounds=np.column_stack([low, high]),
            constraints=constraints,
            method="SLSQP",
            options={"maxiter": 40, "ftol": precision},
        )
        y = np.clip(result.x, low, high)
        return y, float((margin - at(y)[0]).max())


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

    @cached_property
    def shared(self) -> tuple[Array, Array]:
        """The rows in which several windows meet; the others are bounds."""
        several = (np.abs(self.matrix) > 1e-9).sum(axis=1) > 1
        return self.matrix[several], self.most[several]

    def slack(self, x: Array) -> Array:
        """What is left of every row, negative where it is broken."""
        return self.most - self.matrix @ x


def _limit_rows(problem: DetourProblem, windows: tuple[Window, ...], spare: float) -> LimitRows:
    nominal, n = problem.nominal, len(problem.nominal.start)
    begin, end = min(w[0] for w in windows), max(w[1] for w in windows)
    count = FINE if len(windows) == 1 else 8 * BLOCKS + 1  # of one window, they only bound each peak
    times = np.linspace(begin, end, count)[1:-1]
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
    limits = np.concatenate(most) - spare * np.abs(matrix).sum(axis=1) if most else np.zeros(0)
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
