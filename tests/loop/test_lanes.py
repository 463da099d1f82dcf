"""Every operation of the lanes against numpy's, through tiny Functions printed as C."""

import ctypes
from collections.abc import Callable, Sequence
from importlib.resources import files
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.errors import EngineError
from fzcli.loop.compiler import build_library, find_compiler, host_isa
from fzcli.loop.printer import constant, print_function
from tests.loop.single_step import aligned

Array = NDArray[np.float64]
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
CALL = """
__attribute__((visibility("default"))) void call(const V *in, V *out) { tested(in, out); }
"""
TINY = 5e-324
SPECIAL = np.array([0.0, -0.0, 1.0, -1.0, TINY, -TINY, 2.2e-308, 1e300, -1e300, np.inf, -np.inf, np.nan])
rng = np.random.default_rng(11)
WIDE = np.concatenate(
    [
        rng.uniform(-10, 10, 4000),
        rng.uniform(-1e5, 1e5, 4000),
        np.pi / 2 * np.arange(-200, 200),
        np.pi / 4 * np.arange(-200, 200),
        rng.standard_normal(1000) * 10.0 ** rng.uniform(-300, 0, 1000),
    ]
)
UNIT = np.concatenate([rng.uniform(-1, 1, 4000), 1 - 10.0 ** rng.uniform(-16, 0, 500), [-1.0, 0.0, 1.0, 0.5, -0.5]])


def evaluate(function: Callable[..., ca.SX], columns: list[Array], lanes: int) -> Array:
    """The printed scalar function at every entry of the columns, ``lanes`` at a time."""
    return evaluate_all([function], columns, lanes)[0]


def evaluate_all(functions: Sequence[Callable[..., ca.SX]], columns: list[Array], lanes: int) -> Array:
    """(functions, entries): several functions of the same columns, printed and compiled as one."""
    x = ca.SX.sym("x", len(columns))
    f = ca.Function("f", [x], [ca.densify(ca.vertcat(*(function(*ca.vertsplit(x)) for function in functions)))])
    source = (files("fzcli.loop") / "c" / "lanes.h").read_text() + print_function(f, "tested") + CALL
    compiler = find_compiler()
    assert compiler is not None
    library = build_library(source, lanes, compiler, host_isa())
    count = len(columns[0])
    results = np.empty((len(functions), count))
    given, made = aligned(len(columns), lanes), aligned(len(functions), lanes)
    for first in range(0, count, lanes):
        at = np.minimum(np.arange(first, first + lanes), count - 1)
        given[:] = [column[at] for column in columns]
        library.call(ctypes.c_void_p(given.ctypes.data), ctypes.c_void_p(made.ctypes.data))
        width = min(lanes, count - first)
        results[:, first : first + width] = made[:, :width]
    return results


def ulps(result: Array, expected: Array) -> Array:
    """Distance in units of the expected number's last place, 0 for equal or both NaN."""
    same = (result == expected) | (np.isnan(result) & np.isnan(expected))
    with np.errstate(invalid="ignore"):
        distance = np.abs(result - expected) / np.spacing(np.abs(expected))
    return np.where(same, 0.0, np.where(np.isnan(distance), np.inf, distance))


@needs_compiler
@pytest.mark.parametrize("lanes", [1, 8])
@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sine_and_cosine(name: str, lanes: int) -> None:
    """To 2 ulp; next to the zeros, where the reduction's own error shows, to 1e-16 absolute."""
    result, expected = evaluate(getattr(ca, name), [WIDE], lanes), getattr(np, name)(WIDE)
    good = (ulps(result, expected) <= 2) | (np.abs(result - expected) <= 1e-16)
    assert good.all(), WIDE[~good][:5]
    assert np.isnan(evaluate(getattr(ca, name), [np.full(8, np.nan)], lanes)).all()


@needs_compiler
@pytest.mark.parametrize("lanes", [1, 8])
def test_sine_and_cosine_belong_together(lanes: int) -> None:
    """s^2 + c^2 = 1 also where the reduction is coarse, which keeps rotations rotations."""
    big = rng.uniform(-1e9, 1e9, 2000)
    total = evaluate(lambda x: ca.sin(x) ** 2 + ca.cos(x) ** 2, [big], lanes)
    np.testing.assert_allclose(total, 1.0, atol=1e-9)


@needs_compiler
@pytest.mark.parametrize("lanes", [1, 8])
def test_arc_tangent_of_two(lanes: int) -> None:
    angle, radius = rng.uniform(-np.pi, np.pi, 4000), 10.0 ** rng.uniform(-150, 150, 4000)
    y = np.concatenate([radius * np.sin(angle), rng.normal(size=500)])
    x = np.concatenate([radius * np.cos(angle), rng.normal(size=500)])
    result = evaluate(ca.atan2, [y, x], lanes)
    assert ulps(result, np.arctan2(y, x)).max() <= 3
    y, x = np.array([0.0, -0.0, 0.0, -0.0, 1.0, -1.0, 0.0]), np.array([1.0, 1.0, -1.0, -1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(evaluate(ca.atan2, [y, x], lanes), np.arctan2(y, x))
    nan = evaluate(ca.atan2, [np.array([np.nan, 1.0]), np.array([1.0, np.nan])], lanes)
    assert np.isnan(nan).all()


@needs_compiler
@pytest.mark.parametrize("lanes", [1, 8])
def test_inverse_functions(lanes: int) -> None:
    assert ulps(evaluate(ca.atan, [WIDE], lanes), np.arctan(WIDE)).max() <= 3
    sine, cosine = evaluate_all([ca.asin, ca.acos], [np.append(UNIT, [1.5, -1.5])], lanes)
    assert ulps(sine[:-2], np.arcsin(UNIT)).max() <= 8
    assert ulps(cosine[:-2], np.arccos(UNIT)).max() <= 8
    assert np.isnan([sine[-2:], cosine[-2:]]).all()


@needs_compiler
@pytest.mark.parametrize("lanes", [1, 8])
def test_exponential(lanes: int) -> None:
    x = np.concatenate([rng.uniform(-700, 700, 3000), rng.uniform(-1, 1, 1000), [0.0, -0.0, 1e-300]])
    assert ulps(evaluate(ca.exp, [x], lanes), np.exp(x)).max() <= 2
    ends = np.array([-1e4, -np.inf, 800.0, np.inf, np.nan])
    np.testing.assert_array_equal(evaluate(ca.exp, [ends], lanes), [0.0, 0.0, np.inf, np.inf, np.nan])


@needs_compiler
@pytest.mark.parametrize("lanes", [1, 2, 4, 8])
def test_exact_functions(lanes: int) -> None:
    halves = np.concatenate(
        [np.arange(-20, 20) / 2, rng.normal(size=500) * 10.0 ** rng.uniform(-3, 14, 500), 2.0**52 + np.arange(20)]
    )
    points = np.concatenate([halves, SPECIAL])
    names = ("floor", "ceil", "fabs", "sqrt")
    for name, result in zip(names, evaluate_all([getattr(ca, name) for name in names], [points], lanes), strict=True):
        with np.errstate(invalid="ignore"):
            expected = getattr(np, name)(points)
        np.testing.assert_array_equal(result, expected, err_msg=name)
    numbers = points[~np.isnan(points)]
    np.testing.assert_array_equal(evaluate(ca.sign, [numbers], lanes), np.sign(numbers))


@needs_compiler
@pytest.mark.parametrize("lanes", [1, 8])
def test_arithmetic_and_choices(lanes: int) -> None:
    a, b = (v.ravel() for v in np.meshgrid(SPECIAL, SPECIAL))
    cases: dict[str, tuple[Callable[..., ca.SX], Callable[..., Any]]] = {
        "add": (lambda x, y: x + y, np.add),
        "subtract": (lambda x, y: x - y, np.subtract),
        "multiply": (lambda x, y: x * y, np.multiply),
        "divide": (lambda x, y: x / y, np.divide),
        "copysign": (ca.copysign, np.copysign),
        "less": (lambda x, y: ca.if_else(x < y, 2.0, 3.0), lambda x, y: np.where(x < y, 2.0, 3.0)),
        "or": (
            lambda x, y: ca.if_else(ca.logic_or(x > 0, ca.logic_not(y <= 0)), x, y),
            lambda x, y: np.where((x > 0) | ~(y <= 0), x, y),
        ),
        "count": (lambda x, y: (x < y) + (x == y) + (x != y), lambda x, y: 1.0 * (x < y) + (x == y) + (x != y)),
    }
    results = evaluate_all([symbolic for symbolic, _ in cases.values()], [a, b], lanes)
    for (name, (_, numeric)), result in zip(cases.items(), results, strict=True):
        with np.errstate(all="ignore"):
            expected = numeric(a, b)
        np.testing.assert_array_equal(result, expected, err_msg=name)


@needs_compiler
@pytest.mark.parametrize("lanes", [1, 8])
def test_least_and_most_of_numbers(lanes: int) -> None:
    numbers = SPECIAL[~np.isnan(SPECIAL)]
    a, b = (v.ravel() for v in np.meshgrid(numbers, numbers))
    least, most = evaluate_all([ca.fmin, ca.fmax], [a, b], lanes)
    np.testing.assert_array_equal(least, np.fmin(a, b))
    np.testing.assert_array_equal(most, np.fmax(a, b))


@needs_compiler
@pytest.mark.parametrize("lanes", [1, 8])
def test_a_nan_in_the_second_operand_is_passed_over_as_by_libm(lanes: int) -> None:
    """A running maximum keeps its value where the newest one is not a number, in both engines."""
    a, b = np.array([2.0, 1.0]), np.array([np.nan, np.nan])
    for result in evaluate_all([ca.fmin, ca.fmax], [a, b], lanes):
        np.testing.assert_array_equal(result, a)


@needs_compiler
@pytest.mark.parametrize("lanes", [1, 8])
def test_constants_are_printed_to_the_bit(lanes: int) -> None:
    values = [0.0, 1.0, -2.5, 0.1, TINY, 1.7976931348623157e308, 1e-8, -1e300, np.inf, -np.inf, np.nan]
    given = evaluate_all([lambda x, v=v: ca.if_else(x > 0, v, 7.0) for v in values], [np.ones(1)], lanes)
    np.testing.assert_array_equal(given[:, 0], values)
    assert all(np.float64(v).hex() in constant(v) for v in (0.1, -2.5, TINY))


def test_an_operation_without_lanes_is_refused_by_name() -> None:
    x = ca.SX.sym("x")
    with pytest.raises(EngineError, match=r"^the compiled engine does not know CasADi's operation \d+$"):
        print_function(ca.Function("f", [x], [ca.erf(x)]), "tested")
