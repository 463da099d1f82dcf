"""Runs that are only tried end as soon as their metrics cannot meet what is wanted, and are refused exactly then."""

from collections.abc import Callable
from functools import cache

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.loop.assemble import closed_loop
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.engine import Batch, CompiledEngine, Engine, VirtualMachine
from fzcli.loop.stops import GIVEN_UP, LEFT_OUT, all_decided, given_up
from fzcli.spec.condition import Condition
from fzcli.spec.quantity import Metric, Reduction
from tests.loop.cases import random_parameters, run_spec
from tests.loop.test_engines import column, needs_compiler

Array = NDArray[np.float64]
RUNS, STEPS = 24, 300
ENGINES = [pytest.param(CompiledEngine, marks=needs_compiler), VirtualMachine]
SPEC = run_spec(controller__kind="unconstrained")


@cache
def _whole(engine: Callable[[ClosedLoop], Engine]) -> tuple[ClosedLoop, Array, NDArray[np.int64], Batch]:
    """Runs to their end, the first of which has its largest error at its last sample."""
    loop = closed_loop(SPEC, record=True)
    rows, steps = random_parameters(loop, RUNS, 8), np.full(RUNS, STEPS)
    batch = engine(loop).run(rows, steps, record=True)
    steps[0] = np.argmax(column(loop, batch, "tip_error")[0])
    return loop, rows, steps, engine(loop).run(rows, steps, record=True)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("sign", ["<", "<="])
@pytest.mark.parametrize("run", [0, 5, 9])
def test_a_run_is_given_up_exactly_where_its_metric_refuses_it(
    engine: Callable[[ClosedLoop], Engine], sign: str, run: int
) -> None:
    """The limit is the very number that one of the runs ends with."""
    loop, rows, steps, whole = _whole(engine)
    worst = whole.metrics[:, [metric.name for metric in loop.metrics].index("tip_error_max")]
    wanted = (Condition("tip_error_max", sign, float(worst[run])), Condition("tip_error_mean", "<", 1e-9))
    good = wanted[0].met_by(worst) & (whole.stops == 0)
    assert good.any()
    assert good[run] == (sign == "<=")
    batch = engine(closed_loop(SPEC, record=False, wanted=wanted)).run(rows, steps)
    np.testing.assert_array_equal(batch.stops, np.where(good, 0, GIVEN_UP))
    assert batch.metrics[good].tobytes() == whole.metrics[good].tobytes()
    errors = column(loop, whole, "tip_error")
    beyond = errors >= worst[run] if sign == "<" else errors > worst[run]
    np.testing.assert_array_equal(batch.ends, np.where(good, whole.ends, beyond.argmax(axis=1)))


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("jobs", [1, 2])
def test_of_a_series_the_first_that_passes_is_found_and_later_ones_are_left_out(
    engine: Callable[[ClosedLoop], Engine], jobs: int
) -> None:
    loop, rows, steps, whole = _whole(engine)
    worst = whole.metrics[:, [metric.name for metric in loop.metrics].index("tip_error_max")]
    tried = engine(closed_loop(SPEC, record=False, wanted=(Condition("tip_error_max", "<", float(np.median(worst))),)))
    order, series = np.random.default_rng(4).integers(0, RUNS, 300), np.arange(300) % 20
    every = tried.run(rows[order], steps[order])
    some = tried.run(rows[order], steps[order], series=series, jobs=jobs)
    begun = some.stops != LEFT_OUT
    for name in ("metrics", "ends", "stops"):
        assert getattr(some, name)[begun].tobytes() == getattr(every, name)[begun].tobytes(), name
    for one in range(20):
        passed = every.stops[series == one] == 0
        first = passed.argmax()
        assert passed[first]
        assert begun[series == one][: first + 1].all()
        assert not begun[series == one][-1], "long after the first that passed"


@pytest.mark.parametrize(
    ("reduction", "sign", "total", "code"),
    [
        ("max", "<", 1.0, GIVEN_UP),
        ("max", "<", np.nextafter(1.0, 0.0), 0),
        ("max", "<=", 1.0, 0),
        ("max", "<=", np.nextafter(1.0, 2.0), GIVEN_UP),
        ("min", ">", 1.0, GIVEN_UP),
        ("min", ">=", 1.0, 0),
        ("min", ">=", np.nextafter(1.0, 0.0), GIVEN_UP),
        ("max", "<", np.inf, GIVEN_UP),
        ("max", "<", np.nan, 0),
        ("max", ">", 2.0, 0),
        ("min", "<", 0.5, 0),
        ("mean", "<", 2.0, 0),
        ("last", "<", 2.0, 0),
    ],
)
def test_only_what_cannot_change_any_more_decides(reduction: Reduction, sign: str, total: float, code: int) -> None:
    assert _decided(reduction, sign, total, 0.0) == code


@pytest.mark.parametrize("other", [-1.0, 1.0, 2.0, 3.0])
def test_another_stop_comes_first(other: float) -> None:
    assert _decided("max", "<", 2.0, other) == other


def _decided(reduction: Reduction, sign: str, total: float, code: float) -> float:
    metric, totals, given = Metric("m", "s", reduction, "1", "tested"), ca.SX.sym("totals"), ca.SX.sym("code")
    decided = given_up(given, (Condition("m", sign, 1.0), Condition("other", "<", 0.0)), (metric,), totals)
    return float(ca.Function("f", [given, totals], [decided])(code, total))


def test_all_are_decided_only_by_running_extremes() -> None:
    rows: list[tuple[str, str, Reduction]] = [("most", "s", "max"), ("mean", "s", "mean"), ("worst", "", "max")]
    metrics = tuple(Metric(*row, "1", "tested") for row in rows)
    for texts, decided in (
        (["most < 1"], True),
        (["most < 1", "most <= 2"], True),
        (["most < 1", "most > 0"], False),
        (["most < 1", "mean < 1"], False),
        (["worst < 1"], False),
        (["gone < 1"], False),
    ):
        assert all_decided(tuple(Condition.of(text) for text in texts), metrics) == decided, texts
