"""Drawn trajectories: each has its own random numbers, or its own point of a layout, and is found by its index."""

import decimal
import math
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fzcli.sweep.resolve import Drawn
from fzcli.sweep.sweep_spec import Trajectories

Array = NDArray[np.float64]


class Source(Protocol):
    """Where random numbers come from: NumPy's generators, or a point of a layout."""

    def random(self, size: int) -> Array:
        """Numbers in [0, 1)."""
        ...

    def standard_normal(self, size: int) -> Array:
        """Normal numbers."""
        ...

    def integers(self, low: int) -> Any:
        """A whole number below this one: so NumPy names the only end that is given."""
        ...


class Point:
    """A point of a layout in the unit cube, taken a coordinate at a time; it has no normal numbers."""

    def __init__(self, shares: Array) -> None:
        self._shares = shares
        self._taken = 0

    def random(self, size: int) -> Array:
        """The next coordinates."""
        self._taken += size
        return self._shares[self._taken - size : self._taken]

    def standard_normal(self, size: int) -> Array:
        """Raises ValueError: a layout has none."""
        raise ValueError(f"a layout has no {size} normal numbers")

    def integers(self, low: int) -> int:
        """The next coordinate as one of so many equal parts."""
        return min(int(self.random(1)[0] * low), low - 1)


APART = "replay."  # fields with a stream of their own: the trajectories are those of a sweep without them
Streams = tuple[Source, Source]  # of most fields, and of those apart


def generator(seed: int, index: int, *stream: int) -> np.random.Generator:
    """The random numbers of trajectory ``index``: SeedSequence((seed, index)), or those of another ``stream``."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, index, *stream))))


def sources(plan: Trajectories, draws: Sequence[Drawn], places: range) -> Iterator[Streams]:
    """Those of each trajectory of these places, counted from the plan's first."""
    if plan.sampling == "random":
        apart = any(one.path.startswith(APART) for one in draws)
        for index in range(plan.first + places.start, plan.first + places.stop):
            own = generator(plan.seed, index)
            yield own, generator(plan.seed, index, 1) if apart else own
        return
    width = sum(1 if one.distribution == "choice" else one.size for one in draws)
    points = _latin(width, plan.count, plan.seed) if plan.sampling == "latin_hypercube" else None
    for shares in _sobol(width, plan, places) if points is None else points[places.start : places.stop]:
        point = Point(shares)
        yield point, point


def _sobol(width: int, plan: Trajectories, places: range) -> Array:
    """Points of Sobol's sequence, scrambled by the seed."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(width, scramble=True, rng=generator(plan.seed, 0))
    skipped = plan.first + places.start
    if skipped:
        sequence.fast_forward(skipped)
    return np.concatenate([sequence.random(1) for _ in places])  # a block that is no power of two makes SciPy warn


@lru_cache(maxsize=1)
def _latin(width: int, count: int, seed: int) -> Array:
    """All points of a Latin hypercube: each of ``count`` equal parts of every axis holds one of them."""
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(width, rng=generator(seed, 0)).random(count))


def candidate(draws: Sequence[Drawn], random: Source, apart: Source | None = None) -> Array:
    """One drawn vector: the fields in the order of their paths, one after the other; ``apart``: the stream of some."""
    found: Array = candidates(draws, [(random, apart or random)])[0]
    return found


def candidates(draws: Sequence[Drawn], random: Sequence[Streams]) -> Array:
    """Drawn vectors (n, k), one from each source in turn; a source may stand there several times."""
    parts = _parts(draws)
    rows = [[value for size, stream, take in parts for value in take(streams[stream], size)] for streams in random]
    raw = np.array(rows, dtype=np.float64).reshape(len(random), sum(one.size for one in draws))
    first = 0
    for one in draws:
        block = raw[:, first : first + one.size]
        if one.distribution in ("uniform", "log_uniform", "normal"):
            block[:] = _spread(one, block)
        first += one.size
    return raw


_Take = Callable[[Source, int], list[float]]


def _parts(draws: Sequence[Drawn]) -> list[tuple[int, int, _Take]]:
    """How many numbers, from which stream and how they are taken; neighbours of the same kind are taken together."""
    parts: list[tuple[int, int, _Take]] = []
    for one in draws:
        size, stream, take = one.size, int(one.path.startswith(APART)), _taker(one)
        if take is _random and parts and parts[-1][1:] == (stream, _random):
            parts[-1] = parts[-1][0] + size, stream, _random
        else:
            parts.append((size, stream, take))
    return parts


def _taker(one: Drawn) -> _Take:
    if one.distribution == "choice" and one.choices is not None:
        choices: list[list[float]] = np.asarray(one.choices, dtype=np.float64).tolist()

        def choose(source: Source, size: int) -> list[float]:
            return choices[int(source.integers(len(choices)))]

        return choose
    takers: dict[str, _Take] = {"sphere": _direction, "normal": _normal}
    return takers.get(one.distribution, _random)


def _random(source: Source, size: int) -> list[float]:
    return list(source.random(size).tolist())


def _normal(source: Source, size: int) -> list[float]:
    return list(source.standard_normal(size).tolist())


def _direction(source: Source, size: int) -> list[float]:
    """Uniform on the unit sphere."""
    while True:
        parts = _normal(source, size)
        length = math.sqrt(sum([part**2 for part in parts]))
        if length > 1e-8:
            return [part / length for part in parts]


def _spread(one: Drawn, raw: Array) -> Array:
    """Numbers (n, k) of a distribution from plain ones."""
    if one.distribution == "normal":
        return np.asarray(one.low + one.high * raw)
    if one.distribution == "log_uniform":
        return np.array([[_between(*ends) for ends in zip(one.low, one.high, row, strict=True)] for row in raw])
    return np.asarray(one.low + (one.high - one.low) * raw)


def _between(low: float, high: float, share: float) -> float:
    """low (high / low)^share in decimals: a power by NumPy or libm differs from processor to processor."""
    with decimal.localcontext(decimal.Context(prec=30)):
        first, last = decimal.Decimal(float(low)), decimal.Decimal(float(high))
        return float(first * (last / first) ** decimal.Decimal(float(share)))
