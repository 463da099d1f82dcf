"""The compiled engine gives the same bits whatever its lanes, instruction set, compiler, threads and batches."""

import importlib.util
import itertools
import shutil
import sys
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.loop.assemble import closed_loop, step_counts
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.compiler import Compiler, find_compiler, host_isa, identify
from fzcli.loop.engine import Batch, CompiledEngine
from fzcli.loop.run_spec import SimulateRun
from tests.loop.cases import random_parameters, run_spec

Array = NDArray[np.float64]
pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
RUNS = 37  # no multiple of any lane count
LEVELS = ["baseline", "avx2", "avx512"]
ISAS = LEVELS[: LEVELS.index(host_isa()) + 1]


def compilers() -> dict[str, Compiler]:
    """gcc, clang and zig, those that this machine has."""
    commands = {name: (name,) for name in ("gcc", "clang") if shutil.which(name)}
    if importlib.util.find_spec("ziglang"):
        commands["zig"] = (sys.executable, "-m", "ziglang", "cc")
    found = {name: identify(command) for name, command in commands.items()}
    return {name: compiler for name, compiler in found.items() if compiler is not None}


@cache
def _case(kind: str) -> tuple[SimulateRun, ClosedLoop, Array, NDArray[np.int64]]:
    """Calm, lively and violent runs of unlike length in one batch; some of them fail."""
    spec = run_spec(controller__kind=kind)
    loop = closed_loop(spec, record=False)
    gains = itertools.cycle([10.0, 1000.0, 5000.0, 1e6, 1e12])
    rows = np.concatenate([random_parameters(loop, 1, seed, next(gains)) for seed in range(RUNS)])
    steps = step_counts(loop, spec, rows)
    steps[::5] = 137  # far shorter than their neighbours
    steps[3] = 0
    return spec, loop, rows, steps


@cache
def _expected(kind: str) -> Batch:
    _, loop, rows, steps = _case(kind)
    return CompiledEngine(loop, lanes=1, isa="baseline").run(rows, steps)


def _assert_same(batch: Batch, expected: Batch) -> None:
    assert batch.ends.tobytes() == expected.ends.tobytes()
    assert batch.stops.tobytes() == expected.stops.tobytes()
    assert batch.metrics.tobytes() == expected.metrics.tobytes()


def test_the_batch_holds_what_it_should() -> None:
    """Failures, oscillation and runs that end early, else equality would show little."""
    _, loop, _, steps = _case("clik")
    batch = _expected("clik")
    names = [metric.name for metric in loop.metrics]
    oscillating = batch.metrics[:, names.index("oscillating_joints_mean")]
    assert (batch.stops != 0).any()
    assert (batch.stops == 0).sum() > RUNS / 2
    assert (oscillating > 0.5).sum() > 3
    assert (batch.ends == steps).any()
    assert batch.ends[3] == 0


@pytest.mark.parametrize(("kind", "lanes"), [("clik", 8), ("fuzzy_clik", 2), ("fuzzy_clik", 4), ("fuzzy_clik", 8)])
def test_lanes(kind: str, lanes: int) -> None:
    _, loop, rows, steps = _case(kind)
    _assert_same(CompiledEngine(loop, lanes=lanes).run(rows, steps), _expected(kind))


@pytest.mark.parametrize(
    ("isa", "lanes"),
    [("baseline", 4), ("avx2", 1), ("avx2", 8), ("avx512", 4), ("avx512", 8)],
)
def test_instruction_sets(isa: str, lanes: int) -> None:
    if isa not in ISAS:
        pytest.skip(f"this host does not run {isa}")
    _, loop, rows, steps = _case("fuzzy_clik")
    _assert_same(CompiledEngine(loop, lanes=lanes, isa=isa).run(rows, steps), _expected("fuzzy_clik"))


@pytest.mark.parametrize("name", ["gcc", "clang", "zig"])
@pytest.mark.parametrize("lanes", [1, 8])
def test_compilers(name: str, lanes: int) -> None:
    if name not in compilers():
        pytest.skip(f"{name} is not installed here")
    _, loop, rows, steps = _case("fuzzy_clik")
    engine = CompiledEngine(loop, lanes=lanes, compiler=compilers()[name])
    _assert_same(engine.run(rows, steps), _expected("fuzzy_clik"))


def test_threads_and_batches() -> None:
    """More runs than one thread takes at a time, in any order, alone or together."""
    _, loop, rows, steps = _case("fuzzy_clik")
    engine, expected = CompiledEngine(loop), _expected("fuzzy_clik")
    many = np.tile(np.arange(RUNS), 9)
    np.random.default_rng(3).shuffle(many)
    for jobs in (1, 2):
        batch = engine.run(rows[many], steps[many], jobs=jobs)
        assert batch.metrics.tobytes() == expected.metrics[many].tobytes()
        assert batch.ends.tobytes() == expected.ends[many].tobytes()
    for run in (0, 3, 19, RUNS - 1):
        alone = engine.run(rows[run : run + 1], steps[run : run + 1])
        assert alone.metrics.tobytes() == expected.metrics[run : run + 1].tobytes()


def test_a_lane_keeps_nothing_of_the_runs_before() -> None:
    """Each run as if it had been the only one, its signals and its history included."""
    spec, _, rows, steps = _case("fuzzy_clik")
    loop = closed_loop(spec, record=True)
    short = np.minimum(steps, np.arange(RUNS) * 7 % 90)
    engine = CompiledEngine(loop)
    together = engine.run(rows, short, record=True)
    assert together.record is not None
    for run in range(RUNS):
        alone = engine.run(rows[run : run + 1], short[run : run + 1], record=True)
        assert alone.record is not None
        samples = alone.record.shape[1]
        assert together.record[run, :samples].tobytes() == alone.record[0].tobytes()
        assert np.isnan(together.record[run, samples:]).all()
        assert together.metrics[run].tobytes() == alone.metrics[0].tobytes()


def test_recording_changes_nothing() -> None:
    """The step that gives every signal, and the signals of 1 and 8 lanes."""
    spec, _, rows, steps = _case("fuzzy_clik")
    loop = closed_loop(spec, record=True)
    short = np.minimum(steps, 300)
    alone = CompiledEngine(loop, lanes=1).run(rows, short, record=True)
    beside = CompiledEngine(loop, lanes=8).run(rows, short, record=True)
    plain = CompiledEngine(_case("fuzzy_clik")[1], lanes=8).run(rows, short)
    assert alone.record is not None
    assert beside.record is not None
    assert alone.record.tobytes() == beside.record.tobytes()
    assert alone.metrics.tobytes() == beside.metrics.tobytes() == plain.metrics.tobytes()


def test_progress_counts_every_run_once() -> None:
    _, loop, rows, steps = _case("clik")
    many = np.tile(np.arange(RUNS), 9)
    told: list[int] = []
    CompiledEngine(loop).run(rows[many], np.minimum(steps[many], 5), jobs=2, progress=told.append)
    assert sum(told) == len(many)


def test_no_runs_give_no_rows() -> None:
    _, loop, rows, steps = _case("clik")
    batch = CompiledEngine(loop).run(rows[:0], steps[:0])
    assert batch.metrics.shape == (0, len(loop.metrics))
