"""Drawn trajectories: each has its own random numbers, or its own point of a layout, and is found by its index."""

import decimal
import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fzcli.sweep.resolve import Drawn
from fzcli.sweep.sweep_spec import Trajectories

Array = NDArray[np.float64]


class Source(Protocol):
    """Where random numbers come from: NumPy's generators, or a point of a layout."""

    def random(self, *, out: Array) -> object:
        """Numbers in [0, 1), as many as ``out`` takes."""
        ...

    def standard_normal(self, *, out: Array) -> object:
        """Normal numbers, as many as ``out`` takes."""
        ...

    def integers(self, low: int) -> Any:
        """A whole number below this one: so NumPy names the only end that is given."""
        ...


class Point:
    """A point of a layout in the unit cube, taken a coordinate at a time; it has no normal numbers."""

    def __init__(self, shares: Array) -> None:
        self._shares = shares
        self._taken = 0

    def random(self, *, out: Array) -> object:
        """The next coordinates."""
        self._taken += out.size
        out[:] = self._shares[self._taken - out.size : self._taken]
        return out

    def standard_normal(self, *, out: Array) -> object:
        """Raises ValueError: a layout has none."""
        raise ValueError(f"a layout has no {out.size} normal numbers")

    def integers(self, low: int) -> int:
        """The next coordinate as one of so many equal parts."""
        self._taken += 1
        return min(int(self._shares[self._taken - 1] * low), low - 1)


NO_LENGTH = 1e-8  # of a vector without a direction
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


@functools.lru_cache(maxsize=1)
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
    raw = np.empty((len(random), sum(one.size for one in draws)))
    parts = [(fill, stream, list(raw[:, columns])) for columns, stream, fill in _parts(draws)]
    for i, streams in enumerate(random):
        for fill, stream, rows in parts:
            fill(streams[stream], rows[i])
    first = 0
    for one in draws:
        block = raw[:, first : first + one.size]
        block[:] = _spread(one, block)
        first += one.size
    return raw


_Fill = Callable[[Source, Array], object]


def _parts(draws: Sequence[Drawn]) -> list[tuple[slice, int, _Fill]]:
    """Columns, which stream they are from, and how they are filled; neighbours of the same kind are filled together."""
    parts: list[tuple[slice, int, _Fill]] = []
    place = 0
    for one in draws:
        columns, stream, fill = slice(place, place + one.size), int(one.path.startswith(APART)), _filler(one)
        if fill is _random and parts and parts[-1][1:] == (stream, _random):
            parts[-1] = slice(parts[-1][0].start, columns.stop), stream, _random
        else:
            parts.append((columns, stream, fill))
        place += one.size
    return parts


def _filler(one: Drawn) -> _Fill:
    if one.distribution == "choice" and one.choices is not None:
        choices = np.asarray(one.choices, dtype=np.float64)

        def choose(source: Source, row: Array) -> None:
            row[:] = choices[int(source.integers(len(choices)))]

        return choose
    fillers: dict[str, _Fill] = {"sphere": _direction, "normal": _normal}
    return fillers.get(one.distribution, _random)


def _random(source: Source, row: Array) -> None:
    source.random(out=row)


def _normal(source: Source, row: Array) -> None:
    source.standard_normal(out=row)


def _direction(source: Source, row: Array) -> None:
    """Normal numbers that have a direction."""
    source.standard_normal(out=row)
    while abs(row.item(0)) < NO_LENGTH and _lengths(row[None, :])[0] < NO_LENGTH:
        source.standard_normal(out=row)


def _lengths(rows: Array) -> Array:
    """Of vectors (n, k): by the power and the order of sums that sweeps have been drawn with, to the last bit."""
    squares = np.array([number**2 for number in rows.ravel().tolist()]).reshape(rows.shape)
    return np.asarray(np.sqrt(functools.reduce(np.add, squares.T)))


def _spread(one: Drawn, raw: Array) -> Array:
    """Numbers (n, k) of a distribution from those that fill them."""
    if one.distribution == "choice":
        return raw
    if one.distribution == "sphere":
        return np.asarray(raw / _lengths(raw)[:, None])
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
