"""Random trajectories: one generator a trajectory, so that any run can be found by its index alone."""

import decimal
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fzcli.sweep.resolve import Drawn

Array = NDArray[np.float64]


APART = "replay."  # fields with a stream of their own: the trajectories are those of a sweep without them


def generator(seed: int, index: int, *stream: int) -> np.random.Generator:
    """The random numbers of trajectory ``index``: SeedSequence((seed, index)), or those of another ``stream``."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, index, *stream))))


def candidate(
    draws: Sequence[Drawn], random: np.random.Generator, apart: np.random.Generator | None = None
) -> Array:
    """One drawn vector: the fields in the order of their paths, one after the other; ``apart``: the stream of some."""
    streams = [apart if apart is not None and one.path.startswith(APART) else random for one in draws]
    drawn = [_draw(one, stream) for one, stream in zip(draws, streams, strict=True)]
    return np.concatenate(drawn) if drawn else np.zeros(0)


def _between(low: float, high: float, share: float) -> float:
    """low (high / low)^share in decimals: a power by NumPy or libm differs from processor to processor."""
    with decimal.localcontext(decimal.Context(prec=30)):
        first, last = decimal.Decimal(float(low)), decimal.Decimal(float(high))
        return float(first * (last / first) ** decimal.Decimal(float(share)))


def _draw(one: Drawn, random: np.random.Generator) -> Array:
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
