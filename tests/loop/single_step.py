"""One closed-loop step by three hands: CasADi's machine, CasADi's own C, and the printed C."""

import ctypes
import subprocess
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.engine import CompiledEngine

Array = NDArray[np.float64]
OUTPUTS = ("state_next", "samples", "stop", "signals")


def wandering_states(loop: ClosedLoop, parameters: Array, steps: int, every: int, seed: int) -> list[Array]:
    """State, constants and history (each (k, count)) met by runs on their way, then knocked about.

    All rows of ``parameters`` run side by side; every ``every``-th sample gives one state a run, with its
    time stamps, crossing sides, totals and sums as they stand. Joints and base are then displaced.
    """
    rng = np.random.default_rng(seed)
    width, n = len(parameters), next(s.size for s in loop.signals if s.name == "q")
    step = loop.step.map(width)
    state, constants = (np.array(v) for v in loop.initial.map(width)(parameters.T))
    sums = np.zeros((loop.step.size1_in("history"), width))
    recent = [np.zeros_like(sums) for _ in range(loop.history_length)]
    found: list[list[Array]] = [[], [], []]
    for k in range(steps):
        if k % every == 0:
            moved = state.copy()
            moved[:n] += 0.02 * rng.standard_normal((n, width))
            moved[n : n + 4] += 0.02 * rng.standard_normal((4, width))
            moved[n : n + 4] /= np.linalg.norm(moved[n : n + 4], axis=0)
            for kept, values in zip(found, (moved, constants, sums), strict=True):
                kept.append(values.copy())
        state, samples, _, _ = (np.array(v) for v in step(state, constants, sums))
        sums = sums + samples - recent[0]
        recent = [*recent[1:], samples]
    inputs = [np.concatenate(kept, axis=1) for kept in found]
    sane = np.abs(inputs[0][:n]).max(axis=0) < 1e3
    return [values[:, sane] for values in inputs]


def by_machine(function: ca.Function, inputs: list[Array]) -> list[Array]:
    """Outputs (k, count) of a Function by its own evaluation, at every column of the inputs."""
    results = function.map(inputs[0].shape[1])(*inputs)
    return [np.array(v) for v in (results if isinstance(results, tuple | list) else [results])]


def casadi_c(function: ca.Function, folder: Path, compiler: str = "gcc") -> ca.Function:
    """The Function as CasADi's code generator writes it, compiled without contraction and loaded."""
    name = function.name()
    generator = ca.CodeGenerator(f"{name}.c")
    generator.add(function)
    generator.generate(f"{folder}/")
    flags = ["-O1", "-fPIC", "-shared", "-ffp-contract=off"]
    library = folder / f"{name}.so"
    subprocess.run([compiler, *flags, f"{folder}/{name}.c", "-o", str(library), "-lm"], check=True)
    return ca.external(name, str(library))


def aligned(rows: int, lanes: int) -> Array:
    """Zeros (rows, lanes) that start on 64 bytes, as the printed functions want them."""
    size = max(1, rows) * lanes
    raw = np.zeros(size + 8)
    start = (-raw.ctypes.data // 8) % 8
    return raw[start : start + size].reshape(max(1, rows), lanes)


def by_printed_c(engine: CompiledEngine, inputs: list[Array]) -> list[Array]:
    """Outputs of the printed step, LANES states a call."""
    step, lanes, count = engine.loop.step, engine.lanes, inputs[0].shape[1]
    given = [aligned(len(values), lanes) for values in inputs]
    made = [aligned(step.size1_out(name), lanes) for name in OUTPUTS]
    results = [np.empty((step.size1_out(name), count)) for name in OUTPUTS]
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in (*given, *made)]
    for first in range(0, count, lanes):
        columns = np.minimum(np.arange(first, first + lanes), count - 1)
        for array, values in zip(given, inputs, strict=True):
            array[: len(values)] = values[:, columns]
        engine.library.fzcli_call_step(*pointers)
        width = min(lanes, count - first)
        for result, array in zip(results, made, strict=True):
            result[:, first : first + width] = array[: len(result), :width]
    return results


def worst_relative(result: list[Array], expected: list[Array]) -> Array:
    """(count,): each state's largest error, relative to the value or to its component's usual size."""
    worst = np.zeros(expected[0].shape[1])
    for a, b in zip(result, expected, strict=True):
        if not len(b):
            continue
        usual = np.nan_to_num(np.median(np.abs(b), axis=1, keepdims=True))
        usual[usual > 1e8] = 0.0  # time stamps of crossings that never were
        scale = np.maximum(np.nan_to_num(np.abs(b)), np.maximum(usual, 1e-3))
        with np.errstate(invalid="ignore"):
            error = np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, np.abs(a - b) / scale)
        worst = np.maximum(worst, np.nan_to_num(error, nan=np.inf).max(axis=0))
    return worst
