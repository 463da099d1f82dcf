"""Drawn trajectories: each has its own random numbers, or its own point of a layout, and is found by its index."""

import decimal
import math
from collections.abc import Iterator, Sequence
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


def generator(seed: int, index: int) -> np.random.Generator:
    """The random numbers of trajectory ``index``: SeedSequence((seed, index))."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, index))))


def sources(plan: Trajectories, draws: Sequence[Drawn], places: range) -> Iterator[Source]:
    """One for each trajectory of these places, counted from the plan's first."""
    if plan.sampling == "random":
        return (generator(plan.seed, plan.first + place) for place in places)
    width = sum(1 if one.distribution == "choice" else one.size for one in draws)
    points = _latin(width, plan.count, plan.seed) if plan.sampling == "latin_hypercube" else None
    return map(Point, _sobol(width, plan, places) if points is None else points[places.start : places.stop])


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


def candidate(draws: Sequence[Drawn], random: Source) -> Array:
    """One drawn vector: the fields in the order of their paths, one after the other."""
    return np.concatenate([_draw(one, random) for one in draws]) if draws else np.zeros(0)


def _between(low: float, high: float, share: float) -> float:
    """low (high / low)^share in decimals: a power by NumPy or libm differs from processor to processor."""
    with decimal.localcontext(decimal.Context(prec=30)):
        first, last = decimal.Decimal(float(low)), decimal.Decimal(float(high))
        return float(first * (last / first) ** decimal.Decimal(float(share)))


def _draw(one: Drawn, random: Source) -> Array:
    if one.distribution == "choice" and one.choices is not None:
        return np.asarray(one.choices[random.integers(len(one.choices))])
    if one.distribution == "sphere":
        while True:
            direction = random.standard_normal(one.size)
            length = math.sqrt(sum(float(part) ** 2 for part in direction))  # no BLAS: the same bits anywhere
            if length > 1e-8:
                return np.asarray(direction / length)
    if one.distribution == "normal":
        return np.asarray(one.low + one.high * random.standard_normal(one.size))
    share = random.random(one.size)
    if one.distribution == "log_uniform":
        return np.array([_between(*ends) for ends in zip(one.low, one.high, share, strict=True)])
    return np.asarray(one.low + (one.high - one.low) * share)
