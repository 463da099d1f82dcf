"""The plain loop against what is known of it without running another simulator."""

import numpy as np

from tests.oracle.numpy_reference import NumpyReference
from tests.oracle.plain_loop import Loop, OscillationCounter, PlainRun, run_plain_loop, time_law_345
from tests.oracle.table1_robot import bulgarelli4, draw_start_and_line


def _run(gain: float, dt: float = 0.01, **options: object) -> PlainRun:
    q0, direction, length, _ = draw_start_and_line(np.random.default_rng(2))
    loop = Loop(dt=dt)
    return run_plain_loop(bulgarelli4(), q0, direction, length, 4.0, gain, loop=loop, **options)  # type: ignore[arg-type]


def test_time_law_values() -> None:
    np.testing.assert_allclose(time_law_345(0.4)[0], 0.31744, atol=1e-12)
    np.testing.assert_allclose(time_law_345(0.5), (0.5, 1.875), atol=1e-12)
    assert time_law_345(-1.0) == (0.0, 0.0)
    assert time_law_345(1.5) == (1.0, 0.0)


def test_samples_and_gain() -> None:
    run = _run(10.0)
    assert len(run.time) == 401
    assert run.tip_error[0] == 0.0
    assert set(run.gain) == {10.0}


def test_the_tip_error_is_of_the_first_order_in_the_step() -> None:
    coarse, fine = _run(10.0, dt=0.01), _run(10.0, dt=0.005)
    ratio = coarse.tip_error.max() / fine.tip_error.max()
    assert 1.8 < ratio < 2.2


def test_the_subtask_lowers_the_yaw_and_leaves_the_tip() -> None:
    free, held = _run(0.0), _run(100.0)
    assert np.abs(held.yaw).mean() < 0.7 * np.abs(free.yaw).mean()
    assert held.tip_error.max() < 1e-3


def test_the_motion_has_no_momentum() -> None:
    run, reference = _run(100.0), NumpyReference(bulgarelli4())
    for k in range(0, len(run.time), 50):
        rate = reference.base_rate_map(run.q[k], run.quat[k]) @ run.qd[k]
        twist = np.concatenate([run.base_velocity[k], rate])
        momentum = reference.momentum(run.q[k], run.quat[k], run.qd[k], twist)
        np.testing.assert_allclose(momentum, 0.0, atol=1e-13)


def test_the_tuner_acts_one_sample_later_and_not_below_zero() -> None:
    run = _run(5.0, increment=lambda error, oscillating: 1.0)
    np.testing.assert_array_equal(run.gain, 5.0 + np.arange(len(run.gain)))
    run = _run(5.0, increment=lambda error, oscillating: -3.0)
    np.testing.assert_array_equal(run.gain[:4], [5.0, 2.0, 0.0, 0.0])


def test_a_fast_wave_oscillates_and_a_slow_one_or_a_small_one_does_not() -> None:
    counter = OscillationCounter(3, Loop())
    t = np.arange(400)
    waves = np.stack([np.sin(2 * np.pi * t / 12), np.sin(2 * np.pi * t / 300), 1e-4 * np.sin(t)], axis=1)
    counts = [counter.count(k, wave) for k, wave in enumerate(waves)]
    assert set(counts[40:]) == {1}


def test_the_counter_remembers_the_second_last_crossing() -> None:
    """Speeds +1, -1, +1 cross their average at samples 1 and 2, which counts up to sample 20."""
    counter = OscillationCounter(1, Loop(average=2))
    speeds = [1.0, -1.0, 1.0] + [1.0] * 30
    counts = [counter.count(k, np.array([speed])) for k, speed in enumerate(speeds)]
    assert counts == [0, 0] + [1] * 19 + [0] * 12
