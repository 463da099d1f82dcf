"""Whole rollouts: compiled engine, CasADi's machine and the plain NumPy loop; metrics from the signals."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.control.registry import controllers
from fzcli.fuzzy.surface import build_surface
from fzcli.loop.assemble import closed_loop, step_counts
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.compiler import find_compiler
from fzcli.loop.engine import Batch, CompiledEngine, VirtualMachine
from fzcli.loop.events import make_engine
from fzcli.loop.rollout import Rollout
from fzcli.loop.simulate import simulate
from tests.loop.cases import calm_parameters, random_parameters, run_spec
from tests.oracle.plain_loop import Loop, run_plain_loop
from tests.oracle.table1_robot import bulgarelli4, draw_start_and_line

Array = NDArray[np.float64]
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def column(loop: ClosedLoop, batch: Batch, name: str) -> Array:
    """One recorded scalar signal (runs, samples)."""
    assert batch.record is not None
    at = 0
    for signal in loop.signals:
        if signal.name == name:
            return batch.record[:, :, at]
        at += signal.size
    raise AssertionError(name)


@cache
def _pair(kind: str, gain: float) -> tuple[ClosedLoop, Batch, Batch]:
    loop = closed_loop(run_spec(controller__kind=kind), record=True)
    rows = calm_parameters(loop, gain)
    steps = np.arange(500, 420, -10)
    compiled = CompiledEngine(loop).run(rows, steps, record=True)
    return loop, compiled, VirtualMachine(loop).run(rows, steps, record=True)


def _first_parting(loop: ClosedLoop, a: Batch, b: Batch) -> Array:
    """The first sample of each run at which the discrete signals differ, its number of samples when none."""
    x, y = column(loop, a, "oscillating_joints"), column(loop, b, "oscillating_joints")
    differ = ~((x == y) | (np.isnan(x) & np.isnan(y)))
    return np.where(differ.any(axis=1), differ.argmax(axis=1), x.shape[1])


@needs_compiler
@pytest.mark.parametrize(
    ("kind", "gain", "most_parted"),
    [("unconstrained", 0.0, 0), ("clik", 10.0, 0), ("clik", 5000.0, 3), ("fuzzy_clik", 5000.0, 3)],
)
def test_compiled_and_machine_agree_until_they_part(kind: str, gain: float, most_parted: int) -> None:
    loop, compiled, machine = _pair(kind, gain)
    parting = _first_parting(loop, compiled, machine)
    samples = machine.record.shape[1]  # type: ignore[union-attr]
    assert (parting < samples).sum() <= most_parted
    for run, end in enumerate(parting):
        a, b = compiled.record[run, :end], machine.record[run, :end]  # type: ignore[index]
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9, err_msg=f"run {run}")
    whole = parting == samples
    np.testing.assert_array_equal(compiled.ends[whole], machine.ends[whole])
    np.testing.assert_allclose(compiled.metrics[whole], machine.metrics[whole], rtol=1e-8, atol=1e-9)


@needs_compiler
def test_runs_of_unlike_length_end_where_they_should() -> None:
    loop, compiled, machine = _pair("clik", 10.0)
    for batch in (compiled, machine):
        np.testing.assert_array_equal(batch.ends, np.arange(500, 420, -10))
        recorded = ~np.isnan(column(loop, batch, "tip_error"))
        np.testing.assert_array_equal(recorded.sum(axis=1), batch.ends + 1)


@needs_compiler
def test_violent_runs_stop_alike() -> None:
    """Divergence is chaos: only the outcome is compared."""
    loop = closed_loop(run_spec(), record=True)
    rows = random_parameters(loop, 8, 5, 1e12)
    steps = np.full(8, 60)
    compiled, machine = (engine.run(rows, steps) for engine in (CompiledEngine(loop), VirtualMachine(loop)))
    assert (compiled.stops == 1).all()
    assert (machine.stops == 1).all()
    assert max(compiled.ends.max(), machine.ends.max()) < 60


@pytest.mark.usefixtures("machine")
@pytest.mark.parametrize("kind", sorted(controllers()))
@pytest.mark.parametrize("method", ["euler", "midpoint"])
def test_metrics_are_those_of_the_recorded_signals(kind: str, method: str) -> None:
    """Mean, largest and last over the samples 0..N, both ends included."""
    spec = run_spec(controller__kind=kind, method=method, duration=4.0)
    loop = closed_loop(spec, record=True)
    rollout = simulate(spec)
    for metric in loop.metrics:
        if not metric.signal:
            continue
        values = rollout.signals[metric.signal]
        assert len(values) == 401
        by_hand = {"mean": np.mean, "max": np.max, "min": np.min, "last": lambda v: v[-1]}[metric.reduction]
        np.testing.assert_allclose(rollout.metrics[metric.name], by_hand(values), rtol=1e-13, atol=0)


@pytest.mark.usefixtures("machine")
def test_the_certificate_is_that_of_the_recorded_signals() -> None:
    rollout = simulate(run_spec(robot="planar3", start__q=[0.5, 0.9, -0.4], reference__direction=[1, 0.5, 0],
                                reference__duration=1.5, reference__length=1.2, controller__damping=1e-6))  # fmt: skip
    speeds = np.abs(rollout.qd).max(axis=0) - np.deg2rad(60)
    assert speeds.max() > 0, "the run must break the speed limit"
    assert rollout.certificate["joint_speed_excess_max"] == pytest.approx(speeds.max(), rel=1e-12)
    beyond = np.abs(rollout.q).max() - np.deg2rad(150)
    assert rollout.certificate["joint_limit_excess_max"] == pytest.approx(max(0.0, beyond), rel=1e-12)
    norms = np.abs(np.linalg.norm(rollout.base_quat, axis=1) - 1)
    assert rollout.certificate["quaternion_norm_error_max"] == pytest.approx(norms.max(), abs=1e-16)
    assert rollout.status.name == "flagged"
    assert "joint_speed_excess_max" in rollout.status.reason or "tip_error_max" in rollout.status.reason


def _ours(seed: int, **changes: object) -> tuple[Rollout, dict[str, object]]:
    q0, direction, length, _ = draw_start_and_line(np.random.default_rng(seed))
    line = {"direction": direction.tolist(), "length": 0.3 * length, "duration": 3.0}
    spec = run_spec(
        start__q=q0.tolist(),
        controller__oscillation={"average": 10, "window": 20, "ignore_below": 3e-4},
        **{f"reference__{key}": value for key, value in line.items()},
        **changes,
    )
    return simulate(spec), {"q0": q0, "direction": direction, "length": 0.3 * length, "duration": 3.0}


def _assert_same_motion(rollout: Rollout, plain: object, tolerance: float) -> None:
    for name, values in {
        "q": rollout.q,
        "qd": rollout.qd,
        "quat": rollout.base_quat,
        "base_velocity": rollout.base_twist[:, :3],
        "tip_error": rollout.signals["tip_error"],
        "yaw": rollout.signals["yaw"],
        "oscillating": rollout.signals["oscillating_joints"],
    }.items():
        np.testing.assert_allclose(values, getattr(plain, name), atol=tolerance, rtol=tolerance, err_msg=name)


@pytest.mark.parametrize(("seed", "gain"), [(2, 0.0), (5, 10.0), (4, 1000.0)])
def test_fixed_gain_is_the_plain_loop(seed: int, gain: float) -> None:
    changes = {"controller__kind": "clik", "controller__gain": gain}
    rollout, line = _ours(seed, **changes)
    _assert_same_motion(rollout, run_plain_loop(bulgarelli4(), gain=gain, **line), 1e-9)  # type: ignore[arg-type]


@pytest.mark.parametrize(("seed", "gain"), [(5, 10.0), (2, 40000.0)])
def test_fuzzy_is_the_plain_loop(seed: int, gain: float) -> None:
    """From a low gain, and from one so high that the joints oscillate and the tuner brings it down."""
    rollout, line = _ours(seed, controller__kind="fuzzy_clik", controller__gain=gain)
    surface = build_surface(run_spec(controller__kind="fuzzy_clik").controller.rulebase)

    def increment(error: float, oscillating: float) -> float:
        return float(surface(error, oscillating)[0])

    plain = run_plain_loop(bulgarelli4(), gain=gain, increment=increment, loop=Loop(), **line)  # type: ignore[arg-type]
    if gain > 1000:
        assert plain.oscillating.max() > 0
    _assert_same_motion(rollout, plain, 1e-8)
    np.testing.assert_allclose(rollout.signals["gain"], plain.gain, rtol=1e-9)
    assert rollout.metrics["gain_final"] == rollout.signals["gain"][-1]


@pytest.mark.usefixtures("machine")
def test_the_machine_runs_where_there_is_no_compiler() -> None:
    engine = make_engine(closed_loop(run_spec(duration=0.5), record=True))
    rollout = simulate(run_spec(duration=0.5))
    assert engine.name == rollout.provenance.engine == "vm"
    assert rollout.status.name == "ok"
    assert len(rollout.time) == 51


def test_step_counts_round_up_but_for_rounding() -> None:
    spec = run_spec(reference__duration=1.001)
    loop = closed_loop(spec, record=False)
    rows = random_parameters(loop, 3, 1)
    at = next(i for i, name in enumerate(_flat_names(loop)) if name == "reference.duration")
    rows[:, at] = [1.0, 1.0 + 1e-13, 1.001]
    np.testing.assert_array_equal(step_counts(loop, spec, rows), [100, 100, 101])


def _flat_names(loop: ClosedLoop) -> list[str]:
    return [parameter.path for parameter in loop.parameters for _ in range(parameter.size)]
