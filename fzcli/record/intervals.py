"""Confidence bounds of what tables show: means, medians, shares, and paired differences of shares."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_BLOCK = 2_000_000  # numbers drawn at a time: bounds the memory
_HALVINGS = 60  # of [-1, 1]: below the spacing of doubles


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
    from scipy.special import bdtr

    count = len(sample)
    outside = int((bdtr(np.arange(count // 2), count, 0.5) <= (1 - level) / 2).sum())
    if outside == 0:
        return math.nan, math.nan
    ordered = np.sort(sample)
    return float(ordered[outside - 1]), float(ordered[count - outside])


def share_bound(true: int, count: int, level: float = 0.95) -> float:
    """One-sided lower bound of a share of which ``true`` of ``count`` were seen (Clopper and Pearson 1934)."""
    from scipy.special import betaincinv

    return float(betaincinv(true, count - true + 1, 1 - level)) if true else 0.0


def paired_share_interval(gained: int, lost: int, pairs: int, level: float = 0.95) -> tuple[float, float]:
    """Interval of the difference of two shares over the same ``pairs``, by the score test (Tango 1998).

    ``gained`` pairs are true in the second alone, ``lost`` in the first alone; the difference is that of
    the second less the first. Without such pairs it is +- z^2 / (pairs + z^2), not a point. Its coverage
    is near the level, not above it everywhere: 93 % is the least that enumeration has met.
    """
    from scipy.special import ndtri

    z = float(ndtri((1 + level) / 2))
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
