"""Bounds of means, medians and shares: published numbers, exact coverage, symmetry, edges."""

import math

import numpy as np
import pytest
from scipy import stats

from fzcli.record.intervals import mean_intervals, median_interval, paired_share_interval, share_bound


def test_bootstrap_is_seeded_and_covers() -> None:
    rng = np.random.default_rng(5)
    samples = rng.normal(1.0, 2.0, size=(200, 80))
    intervals = mean_intervals(samples, seed=2)
    np.testing.assert_array_equal(intervals, mean_intervals(samples, seed=2))
    inside = np.mean((intervals[:, 0] < 1.0) & (intervals[:, 1] > 1.0))
    assert 0.88 < inside < 0.99


@pytest.mark.parametrize("count", [5, 6, 17, 100])
def test_the_medians_interval_is_the_narrowest_of_order_statistics(count: int) -> None:
    """x_(r) to x_(n+1-r) misses with probability 2 P(X < r), X binomial: at most 5 %, and r + 1 would exceed it."""
    sample = np.random.default_rng(count).permutation(np.arange(1.0, count + 1))
    low, high = median_interval(sample)
    if count < 6:
        assert math.isnan(low) and math.isnan(high)  # noqa: PT018
        return
    assert low + high == count + 1
    assert 2 * stats.binom.cdf(low - 1, count, 0.5) <= 0.05 < 2 * stats.binom.cdf(low, count, 0.5)


@pytest.mark.parametrize(("true", "count"), [(0, 20), (1, 20), (491, 500), (499, 500), (500, 500), (1, 1)])
def test_the_bound_of_a_share_is_the_exact_one(true: int, count: int) -> None:
    bound = share_bound(true, count)
    exact = stats.binomtest(true, count, alternative="greater").proportion_ci(0.95, "exact")
    assert bound == pytest.approx(exact.low, rel=1e-12)
    if true:
        assert stats.binom.sf(true - 1, count, bound) == pytest.approx(0.05, rel=1e-9)


def test_a_share_of_all_runs_is_bounded_by_the_rule_of_three() -> None:
    assert share_bound(500, 500) == pytest.approx(0.05 ** (1 / 500), rel=1e-12)


@pytest.mark.parametrize(
    ("gained", "lost", "pairs", "level", "low", "high"),
    [
        (6, 16, 161, 0.95, -0.1240, -0.0054),  # therapy before and after: Fagerland, Lydersen and Laake 2014
        (1, 7, 21, 0.95, -0.517, -0.026),  # airway reactivity: the same
        (28, 25, 618, 0.90, -0.0148, 0.0247),  # by R's PropCIs
    ],
)
def test_published_intervals_of_paired_shares(
    gained: int, lost: int, pairs: int, level: float, low: float, high: float
) -> None:
    digits = 4 if pairs > 100 else 3
    assert tuple(round(end, digits) for end in paired_share_interval(gained, lost, pairs, level)) == (low, high)


def test_without_discordant_pairs_the_interval_is_not_a_point() -> None:
    z2 = stats.norm.ppf(0.975) ** 2
    for pairs in (1, 20, 500):
        low, high = paired_share_interval(0, 0, pairs)
        assert high == pytest.approx(z2 / (pairs + z2), rel=1e-12)
        assert low == pytest.approx(-high, rel=1e-12)


def test_intervals_of_paired_shares_are_symmetric_and_ordered() -> None:
    rng = np.random.default_rng(7)
    for _ in range(300):
        pairs = int(rng.integers(1, 700))
        gained = int(rng.integers(0, pairs + 1))
        lost = int(rng.integers(0, pairs - gained + 1))
        low, high = paired_share_interval(gained, lost, pairs)
        assert -1 <= low <= (gained - lost) / pairs <= high <= 1
        assert low < high
        assert paired_share_interval(lost, gained, pairs) == pytest.approx((-high, -low), abs=1e-12)
        wider = paired_share_interval(gained, lost, pairs, 0.99)
        assert wider[0] <= low < high <= wider[1]
    assert paired_share_interval(9, 0, 9)[1] == pytest.approx(1)
    assert paired_share_interval(0, 9, 9)[0] == pytest.approx(-1)


def test_the_interval_excludes_zero_when_mcnemars_test_rejects() -> None:
    limit = stats.norm.ppf(0.975)
    for gained in range(30):
        for lost in range(30):
            low, high = paired_share_interval(gained, lost, 200)
            rejected = abs(gained - lost) > limit * math.sqrt(gained + lost)
            assert (low > 0 or high < 0) == rejected


@pytest.mark.parametrize(
    ("gain", "loss"), [(0.02, 0.02), (0.05, 0.01), (0.1, 0.1), (0.3, 0.05), (0.0, 0.03), (0.0, 0.0), (0.4, 0.4)]
)
def test_coverage_of_paired_shares_over_all_outcomes(gain: float, loss: float) -> None:
    """The sum of the probabilities of all outcomes whose interval holds the truth."""
    pairs, covered, total = 60, 0.0, 0.0
    law = stats.multinomial(pairs, [gain, loss, 1 - gain - loss])
    for gained in range(pairs + 1):
        for lost in range(pairs + 1 - gained):
            weight = law.pmf([gained, lost, pairs - gained - lost])
            total += weight
            if weight > 1e-9:
                low, high = paired_share_interval(gained, lost, pairs)
                covered += weight * (low <= gain - loss <= high)
    assert total == pytest.approx(1)
    assert covered >= 0.93
