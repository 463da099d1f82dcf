"""Bootstrap interval of a mean, by percentiles."""

import numpy as np
from numpy.typing import NDArray

_BLOCK = 2_000_000  # numbers drawn at a time: bounds the memory


def mean_intervals(
    samples: NDArray[np.float64], seed: int = 0, resamples: int = 1000, level: float = 0.95
) -> NDArray[np.float64]:
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
