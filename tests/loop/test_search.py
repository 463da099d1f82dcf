"""Searches between two steps: pauses, engines, counts, and what a run is after one."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import fzcli
from fzcli.loop.assemble import closed_loop, parameter_row, step_counts
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.compiler import ISA_LANES, find_compiler, host_isa
from fzcli.loop.engine import Batch, CompiledEngine, Engine, VirtualMachine
from fzcli.loop.events import Searcher, SearchingEngine, make_engine
from fzcli.loop.rollout import Rollout
from fzcli.loop.run_spec import SimulateRun
from fzcli.loop.simulate import simulate
from tests.loop.reaching_cases import HOME_B, STALLING, reaching_run, unit
from tests.oracle.fabrik_points import chain_of
from tests.oracle.fabrik_reference import Settings, State, Task, advance, errors
from tests.oracle.fabrik_runs import virtual_solution

Array = NDArray[np.float64]
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
OTHERS = [(1, "baseline"), *((lanes, host_isa()) for lanes in (1, 2, 4) if lanes < ISA_LANES[host_isa()])]
SHORT = {"seeds": 5, "rounds": 6, "pieces": 4}  # a search that takes little, and now and then finds nothing


def stalling(kind: str = "fabrik", **changes: Any) -> SimulateRun:
    """The UR5 from home B to a pose before which the law alone stalls."""
    usual = {"controller": {"kind": kind, "restart": True}, "reference": {"kind": "target"} | STALLING[kind]}
    return reaching_run(**usual | changes)


@cache
def _stalled(kind: str) -> Rollout:
    return simulate(stalling(kind))


@pytest.mark.parametrize("kind", ["fabrik", "dls"])
def test_a_restart_frees_a_stalled_run(kind: str) -> None:
    without = simulate(stalling(kind, controller={"kind": kind}))
    assert without.status.name == "flagged"
    assert "searches" not in without.metrics
    freed = _stalled(kind)
    assert freed.status.name == "ok"
    assert freed.metrics["searches"] >= 1
    assert freed.metrics["searches_empty"] < freed.metrics["searches"]
    before = int(np.flatnonzero(freed.signals["driving"])[0])
    np.testing.assert_allclose(freed.q[: before + 1], without.q[: before + 1], atol=1e-9)  # the law alone until then


def test_a_paused_run_resumes_at_its_sample() -> None:
    """No sample is missing or doubled: time goes on evenly, joints by their recorded rates, searches one by one."""
    run = _stalled("fabrik")
    np.testing.assert_allclose(np.diff(run.time), 0.01, atol=1e-12)
    np.testing.assert_allclose(np.diff(run.q, axis=0), 0.01 * run.qd[:-1], atol=1e-14)
    assert run.metrics["n_steps"] == len(run.time) - 1
    searches = run.signals["searches"]
    assert set(np.diff(searches)) <= {0.0, 1.0}
    assert searches[0] == 0
    assert searches[-1] == run.metrics["searches"]
    for values in (run.q, run.base_quat, run.tip_position, *run.signals.values()):
        assert np.isfinite(values).all()


def test_the_stall_is_noticed_after_15_steps_without_a_gain_of_5_percent() -> None:
    run = _stalled("fabrik")
    measure = run.signals["target_distance"].ravel() + 0.2 * run.signals["target_angle"].ravel()
    best, count, k = np.inf, 0, -1
    while count < 15:
        k += 1
        best, count = (measure[k], 0) if measure[k] < 0.95 * best else (best, count + 1)
    assert run.signals["searches"][k] == 1
    assert run.signals["searches"][k - 1] == 0


def test_the_drive_is_a_straight_line_of_the_joints() -> None:
    """At the speed limit of the slowest joint, to a posture from which the target is met, as the oracle judges it."""
    run = _stalled("fabrik")
    driving = run.signals["driving"].ravel() > 0
    first = int(np.flatnonzero(driving)[0])
    last = first + int(np.flatnonzero(~driving[first:])[0]) if not driving[first:].all() else len(driving) - 1
    way = np.diff(run.q[first : last + 1], axis=0)
    along = unit(run.q[last] - run.q[first])
    assert np.abs(way - np.outer(way @ along, along)).max() < 1e-12
    assert np.abs(way[:-1]).max(axis=1) == pytest.approx(np.pi * 0.01, rel=1e-9)


def test_a_posture_found_is_one_that_the_oracle_finds() -> None:
    """Search, seed by seed: postures and costs of the oracle's virtual solution from the same seeds."""
    spec = stalling("fabrik", controller={"kind": "fabrik", "restart": SHORT})
    loop = closed_loop(spec, record=False)
    assert loop.search is not None
    search, chain = loop.search, chain_of(fzcli.load_robot("ur5_free_flyer"))
    row = parameter_row(spec, loop.parameters)
    state, constants = (np.array(v) for v in loop.initial(row))
    request = np.array(search.request(state, constants)[0]).ravel()
    offsets = np.random.default_rng(4).uniform(-1, 1, (3, search.offsets))
    given = np.hstack([np.tile(request, (3, 1)), offsets])
    batch = VirtualMachine(search).run(given, np.full(3, search.n_steps))
    start = State(HOME_B, np.array([1.0, 0, 0, 0]), chain.body.com(HOME_B, [1, 0, 0, 0]))
    pose = STALLING["fabrik"]
    task = Task(np.array(pose["position"]), unit(np.array(pose["direction"])))
    settings = Settings(rounds=6, segments=4)
    for offset, result in zip(offsets, batch.metrics, strict=True):
        seed = HOME_B + np.append(np.pi * offset, 0.0)
        there = virtual_solution(chain, start, task, settings, np.clip(seed, chain.lower, chain.upper))
        np.testing.assert_allclose(result[:-1], there.q, atol=1e-9)
        error, angle = errors(chain, there, task)
        good = error < 0.005 and angle < np.deg2rad(1.7)
        seconds = float(np.abs(there.q - HOME_B).max() / np.pi)
        assert result[-1] == (pytest.approx(seconds, abs=1e-9) if good else 1e300)


def test_the_base_s_motion_is_predicted() -> None:
    """At the end of a drive the tip stands where the search promised: within 5 mm and 1.7 deg of the target."""
    run = _stalled("fabrik")
    driving = run.signals["driving"].ravel() > 0
    landings = np.flatnonzero(driving[:-1] & ~driving[1:]) + 1
    ends = landings if landings.size else [len(driving) - 1]
    for k in ends:
        assert run.signals["target_distance"].ravel()[k] < 0.0101
    chain = chain_of(fzcli.load_robot("ur5_free_flyer"))
    first = int(np.flatnonzero(driving)[0])
    start = State(run.q[first], run.base_quat[first], chain.body.com(HOME_B, [1, 0, 0, 0]))
    end = advance(chain, start, run.q[ends[0]] - run.q[first], "gauss_magnus", 50)
    assert abs(end.quat @ run.base_quat[ends[0]]) == pytest.approx(1.0, abs=1e-9)


# Engines


def _poses(spec: SimulateRun, count: int, record: bool) -> tuple[ClosedLoop, Array, NDArray[np.int64]]:
    """A loop and parameters of as many reachable poses, some of which stall."""
    loop = closed_loop(spec, record=record)
    rows = np.tile(parameter_row(spec, loop.parameters), (count, 1))
    names = [parameter.path for parameter in loop.parameters for _ in range(parameter.size)]
    column = names.index("reference.displacement")
    rows[:, column : column + 6] = np.random.default_rng(3).uniform(-np.pi, np.pi, (count, 6))
    return loop, rows, step_counts(loop, spec, rows)


def _reachable() -> SimulateRun:
    return reaching_run(
        controller={"kind": "fabrik", "variant": "n1", "restart": SHORT},
        reference={"kind": "reachable", "displacement": [0.0] * 6},
        stop={"position": "10 mm", "direction": "2 deg", "after": "2 s"},
    )


def _engine(loop: ClosedLoop, lanes: int, isa: str) -> Engine:
    assert loop.search is not None
    searcher = Searcher(loop.search, CompiledEngine(loop.search, lanes, isa=isa))
    return SearchingEngine(CompiledEngine(loop, lanes, isa=isa), searcher)


@cache
def _reference() -> tuple[Array, NDArray[np.int64], ClosedLoop, Batch]:
    loop, rows, steps = _poses(_reachable(), 101, record=False)
    return rows, steps, loop, make_engine(loop).run(rows, steps)


def _same(a: Batch, b: Batch, of: slice | None = None) -> None:
    for name in ("metrics", "ends", "stops"):
        values = getattr(b, name) if of is None else getattr(b, name)[of]
        np.testing.assert_array_equal(getattr(a, name), values, err_msg=name)


@needs_compiler
def test_some_of_the_runs_search_and_some_find_nothing() -> None:
    _, _, loop, batch = _reference()
    names = [metric.name for metric in loop.metrics]
    restarts, empty = (batch.metrics[:, names.index(name)] for name in ("searches", "searches_empty"))
    assert (restarts > 0).sum() > 10
    assert (empty > 0).sum() > 0
    assert (empty <= restarts).all()
    assert not (batch.stops == -1).any()


@needs_compiler
@pytest.mark.parametrize(("lanes", "isa"), OTHERS)
def test_lanes_and_instruction_sets_do_not_matter(lanes: int, isa: str) -> None:
    """Beside as many lanes as the machine has, with which the runs were made."""
    rows, steps, loop, expected = _reference()
    _same(_engine(loop, lanes, isa).run(rows, steps), expected)


@needs_compiler
def test_jobs_records_and_company_do_not_matter() -> None:
    rows, steps, loop, expected = _reference()
    engine = make_engine(loop)
    told: list[int] = []
    twice = {name: np.concatenate([getattr(expected, name)] * 2) for name in ("metrics", "ends", "stops")}
    doubled = engine.run(np.tile(rows, (2, 1)), np.tile(steps, 2), jobs=2, progress=told.append)
    _same(doubled, replace(expected, **twice))
    assert sum(told) == 202
    recorded = closed_loop(_reachable(), record=True)
    batch = make_engine(recorded).run(rows, steps, record=True)
    _same(batch, expected)
    assert batch.record is not None
    for i, end in enumerate(batch.ends):
        assert np.isfinite(batch.record[i, : end + 1]).all()
        assert np.isnan(batch.record[i, end + 1 :]).all()
    searching = int(np.argmax(expected.metrics[:, [m.name for m in loop.metrics].index("searches")]))
    for i in (0, searching):
        _same(engine.run(rows[i : i + 1], steps[i : i + 1]), expected, slice(i, i + 1))


@needs_compiler
def test_runs_of_unlike_length_pause_and_resume_in_one_batch() -> None:
    """Alone or together, in any order: the same."""
    rows, _, loop, _ = _reference()
    steps = np.random.default_rng(9).integers(0, 160, len(rows))
    engine = make_engine(loop)
    together = engine.run(rows, steps)
    order = np.random.default_rng(10).permutation(len(rows))
    shuffled = engine.run(rows[order], steps[order])
    _same(shuffled, replace(together, **{n: getattr(together, n)[order] for n in ("metrics", "ends", "stops")}))
    assert (together.ends <= steps).all()
    assert (together.ends[together.stops == 0] == steps[together.stops == 0]).all()


@needs_compiler
def test_the_machine_agrees_until_a_search_parts_them() -> None:
    """Records to 1e-9 up to the first sample at which searches or driving differ; hardly ever."""
    spec = _reachable()
    loop, rows, steps = _poses(spec, 24, record=True)
    assert loop.search is not None
    compiled = make_engine(loop).run(rows, steps, record=True)
    engine = SearchingEngine(VirtualMachine(loop), Searcher(loop.search, VirtualMachine(loop.search)))
    machine = engine.run(rows, steps, record=True)
    assert compiled.record is not None
    assert machine.record is not None
    names = [signal.name for signal in loop.signals for _ in range(signal.size)]
    discrete = [names.index("searches"), names.index("driving")]
    parted = 0
    for i in range(len(rows)):
        a, b = compiled.record[i], machine.record[i]
        differ = np.flatnonzero((np.nan_to_num(a[:, discrete], nan=-1) != np.nan_to_num(b[:, discrete], nan=-1)).any(1))
        until = differ[0] if differ.size else min(compiled.ends[i], machine.ends[i]) + 1
        parted += differ.size > 0
        np.testing.assert_allclose(a[:until], b[:until], rtol=0, atol=1e-9)
    searched = compiled.metrics[:, [m.name for m in loop.metrics].index("searches")] > 0
    assert searched.sum() >= 3
    assert parted <= 1


# At the start, and without a result


def test_a_search_at_the_start_comes_at_sample_0_exactly_once() -> None:
    run = simulate(reaching_run(controller={"kind": "fabrik", "restart": {"at_start": True}}))
    assert run.status.name == "ok"
    assert run.signals["searches"][0] == 1
    assert run.signals["driving"][0] == 1
    assert run.metrics["searches"] == 1
    np.testing.assert_array_equal(run.q[0], HOME_B)


def test_a_search_without_result_leaves_the_law_running() -> None:
    """At an unreachable distance every search is empty; the run is that of the law alone, but for rounding."""
    hopeless: dict[str, Any] = {"distance": "1e-12 mm", "seeds": 2, "rounds": 1, "sweeps": 1, "at_start": True}
    stop = {"position": "10 mm", "direction": "2 deg", "after": "3 s"}
    alone = simulate(stalling(controller={"kind": "fabrik"}, stop=stop))
    run = simulate(stalling(controller={"kind": "fabrik", "restart": hopeless}, stop=stop))
    np.testing.assert_allclose(run.q, alone.q, atol=1e-9)
    assert run.metrics["searches"] == run.metrics["searches_empty"] >= 3
    assert not run.signals["driving"].any()
    assert "no search found a posture" in run.status.reason
    np.testing.assert_array_equal(np.diff(run.signals["searches"].ravel())[:14], 0)


def test_searches_differ_and_their_seed_counts() -> None:
    """The same seed gives the same run; another one another."""
    runs = [simulate(stalling(controller={"kind": "fabrik", "restart": {"seed": seed}})) for seed in (0, 1)]
    np.testing.assert_array_equal(runs[0].q, _stalled("fabrik").q)
    assert runs[1].q.shape != runs[0].q.shape or not np.array_equal(runs[1].q, runs[0].q)
