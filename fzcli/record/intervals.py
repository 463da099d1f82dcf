"""Confidence bounds of what tables show: means, medians, shares, and paired differences of shares."""

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_BLOCK = 2_000_000  # numbers drawn at a time: bounds the memory
_HALVINGS = 60  # of [-1, 1]: below the spacing of doubles
_TINY = 1e-300  # keeps a continued fraction from dividing by zero
_TERMS = 10_000  # of it, at most


def mean_intervals(samples: Array, seed: int = 0, resamples: int = 1000, level: float = 0.95) -> Array:
    """Interval of the mean of every row of ``samples`` (k, n) by the percentile bootstrap (Efron 1979).

    All rows share the resampled indices, which come from ``seed`` alone. Returns (k, 2): low, high.
    """
    rows, count = samples.shape
    rng = np.random.default_rng(seed)
    means = np.empty((rows, resamples))
    block = max(1, _BLOCK // max(1, count))
    for start in range(0, resamples, block):
        stop = min(resamples, start + block)
        chosen = rng.integers(0, count, size=(stop - start, count))
        for row in range(rows):
            means[row, start:stop] = samples[row][chosen].mean(axis=1)
    tail = (1 - level) / 2
    return np.quantile(means, [tail, 1 - tail], axis=1).T


def median_interval(sample: Array, level: float = 0.95) -> tuple[float, float]:
    """Interval of the median between two order statistics of the sample (n), as in the sign test.

    It holds the level for any distribution; too small a sample has none: nan, nan.
    """
    count = len(sample)
    below = np.arange(1, count // 2)
    chances = np.exp(np.cumsum(np.log([1.0, *((count - below + 1) / below)])) - count * math.log(2))[: count // 2]
    outside = int((np.cumsum(chances) <= (1 - level) / 2).sum())
    if outside == 0:
        return math.nan, math.nan
    ordered = np.sort(sample)
    return float(ordered[outside - 1]), float(ordered[count - outside])


def share_bound(true: int, count: int, level: float = 0.95) -> float:
    """One-sided lower bound of a share of which ``true`` of ``count`` were seen (Clopper and Pearson 1934)."""
    if not true:
        return 0.0
    low, high = 0.0, true / count  # where at least that many are seen more often than not
    while low < (middle := (low + high) / 2) < high:
        if _at_least(true, count, middle) < 1 - level:
            low = middle
        else:
            high = middle
    return high


def _at_least(true: int, count: int, share: float) -> float:
    """Chance of ``true`` or more of ``count``, of a ``share`` below true / count.

    The incomplete beta function, by Lentz's evaluation of its continued fraction (DLMF 8.17.22); SciPy's takes
    longer to import than a table to print.
    """
    a, b = true, count - true + 1
    whole = math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b)
    front = math.exp(whole + a * math.log(share) + b * math.log1p(-share)) / a
    ratio, upper, lower = 1.0, 1.0, 0.0
    for term in range(_TERMS):
        m = term // 2
        if term == 0:
            part = 1.0
        elif term % 2:
            part = -(a + m) * (a + b + m) * share / ((a + 2 * m) * (a + 2 * m + 1))
        else:
            part = m * (b - m) * share / ((a + 2 * m - 1) * (a + 2 * m))
        lower = 1 / (1 + part * lower or _TINY)
        upper = 1 + part / upper or _TINY
        ratio *= upper * lower
        if term and abs(upper * lower - 1) < 1e-15:
            break
    return front * (ratio - 1)


def paired_share_interval(gained: int, lost: int, pairs: int, level: float = 0.95) -> tuple[float, float]:
    """Interval of the difference of two shares over the same ``pairs``, by the score test (Tango 1998).

    ``gained`` pairs are true in the second alone, ``lost`` in the first alone; the difference is that of
    the second less the first. Without such pairs it is +- z^2 / (pairs + z^2), not a point. Its coverage
    is near the level, not above it everywhere: 93 % is the least that enumeration has met.
    """
    z = NormalDist().inv_cdf((1 + level) / 2)
    middle = (gained - lost) / pairs
    ends = []
    for outside in (-1.0, 1.0):
        inside = middle
        for _ in range(_HALVINGS):
            tried = (inside + outside) / 2
            if abs(_paired_score(tried, gained, lost, pairs)) <= z:
                inside = tried
            else:
                outside = tried
        ends.append((inside + outside) / 2)
    return ends[0], ends[1]


def _paired_score(difference: float, gained: int, lost: int, pairs: int) -> float:
    """Distance of what was seen from a supposed difference, in standard deviations under it.

    The likeliest share of lost pairs under it solves 2 n q^2 + B q + C = 0 (Tango 1998, section 3).
    """
    linear = (2 * pairs - gained + lost) * difference - gained - lost
    constant = -lost * difference * (1 - difference)
    share = (math.sqrt(max(linear**2 - 8 * pairs * constant, 0.0)) - linear) / (4 * pairs)
    variance = pairs * (2 * share + difference * (1 - difference))
    distance = gained - lost - pairs * difference
    return math.copysign(math.inf, distance) if variance <= 0 else distance / math.sqrt(variance)
