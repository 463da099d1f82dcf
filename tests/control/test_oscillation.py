"""The oscillation detector against a plain counter, on signals that do and do not oscillate."""

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.control.oscillation import OscillationSpec, detect, memory0
from tests.oracle.plain_loop import Loop, OscillationCounter

Array = NDArray[np.float64]
rng = np.random.default_rng(17)
T = np.arange(300)


def _counts(spec: OscillationSpec, signals: Array) -> list[int]:
    """The detector's count at every sample; signals (samples, m)."""
    m = signals.shape[1]
    velocity, history = ca.SX.sym("velocity", m), ca.SX.sym("history", m)
    memory, step = ca.SX.sym("memory", 3 * m), ca.SX.sym("step")
    result = detect(spec, velocity, history, memory, step)
    function = ca.Function("detect", [velocity, history, memory, step], [result.memory, result.count])
    state, counts = memory0(m), []
    padded = np.vstack([np.zeros((spec.average - 1, m)), signals])
    for k, now in enumerate(signals):
        before = padded[k : k + spec.average - 1].sum(axis=0)
        state, count = function(now, before, state, k)
        counts.append(int(count))
    return counts


def _expected(spec: OscillationSpec, signals: Array) -> list[int]:
    loop = Loop(average=spec.average, window=spec.window, ignore_below=spec.ignore_below)
    counter = OscillationCounter(signals.shape[1], loop)
    return [counter.count(k, now) for k, now in enumerate(signals)]


SIGNALS = {
    "sines": np.stack([0.1 * np.sin(2 * np.pi * T / period) for period in (2, 3.7, 6, 11, 19, 40, 150)], axis=1),
    "noise": 1e-3 * rng.standard_normal((300, 4)),
    "walk": np.cumsum(1e-3 * rng.standard_normal((300, 4)), axis=0),
    "bursts": np.sin(2 * np.pi * T / 5)[:, None] * (T[:, None] // 50 % 2 == [0, 1]),
    "constant": np.full((300, 2), 0.7),
}


@pytest.mark.parametrize("name", list(SIGNALS))
@pytest.mark.parametrize(("average", "window", "ignore"), [(10, 20, 3e-4), (10, 10, 3e-4), (2, 5, 0.0), (25, 60, 1e-3)])
def test_the_count_is_the_plain_counter_s(name: str, average: int, window: int, ignore: float) -> None:
    spec = OscillationSpec(average=average, window=window, ignore_below=ignore)
    assert _counts(spec, SIGNALS[name]) == _expected(spec, SIGNALS[name])


def test_fast_sines_oscillate_and_slow_ones_and_rest_do_not() -> None:
    spec = OscillationSpec(average=10, window=20)
    for period, oscillates in ((4, True), (8, True), (15, True), (80, False), (200, False)):
        counts = _counts(spec, 0.1 * np.sin(2 * np.pi * T / period)[:, None])
        assert (min(counts[60:]) == 1) if oscillates else (max(counts) == 0), period
    assert max(_counts(spec, SIGNALS["constant"])) == 0
    assert max(_counts(spec, 1e-4 * SIGNALS["sines"])) == 0, "too small to count"


def test_it_is_over_a_window_after_the_second_last_crossing() -> None:
    spec = OscillationSpec(average=2, window=20)
    signal = np.array([1.0, -1.0, 1.0] + [1.0] * 30)[:, None]
    assert _counts(spec, signal) == [0, 0] + [1] * 19 + [0] * 12
