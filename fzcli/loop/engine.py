"""The two engines that run a closed loop: compiled C over SIMD lanes, and CasADi's virtual machine."""

import ctypes
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import EngineError
from fzcli.loop.compiler import ISA_LANES, Compiler, build_library, find_compiler, host_isa
from fzcli.loop.rollable import Rollable
from fzcli.loop.source import c_source
from fzcli.loop.stops import LEFT_OUT

Array = NDArray[np.float64]
FEWEST, MOST = 64, 512  # runs that a thread takes at a time
VM_LANES = 64


@dataclass(frozen=True)
class Batch:
    """Results of several runs: metrics (runs, k), ends (runs) the last sample, stops (runs) codes.

    ``record`` (runs, samples, signals) is present when it was asked for; rows after a run's end are NaN.
    ``states`` (runs, n): where a run was paused, the state before the step at ``ends``.
    """

    metrics: Array
    ends: NDArray[np.int64]
    stops: NDArray[np.int64]
    record: Array | None
    states: Array


@dataclass(frozen=True)
class Resume:
    """Where paused runs go on: ``begins`` (runs) the sample, ``states`` (runs, n) before it."""

    begins: NDArray[np.int64]
    states: Array


class Engine(Protocol):
    """Something that runs closed loops."""

    loop: Any
    name: str

    def run(
        self,
        parameters: Array,
        n_steps: NDArray[np.int64],
        *,
        record: bool = False,
        jobs: int = 1,
        progress: Callable[[int], None] | None = None,
        resume: Resume | None = None,
        series: NDArray[np.int64] | None = None,
    ) -> Batch:
        """Run every row of ``parameters`` (runs, p) for its number of steps; ``progress`` gets run counts.

        ``resume``: the runs were paused, and go on from there. ``series`` (runs): a number of the series that each is
        of; once a run of one has ended without a stop, those behind it may be left out (stop `LEFT_OUT`).
        """
        ...


def longest(n_steps: NDArray[np.int64]) -> int:
    """Steps of the longest run, 0 for none."""
    return int(np.max(n_steps, initial=0))


def empty_batch(loop: Rollable, runs: int, n_steps: NDArray[np.int64], record: bool) -> Batch:
    """Room for the results of ``runs`` runs."""
    samples = longest(n_steps) + 1
    shape = (runs, samples, loop.step.size1_out("signals"))
    return Batch(
        np.full((runs, loop.finish.size1_out("metrics")), np.nan),
        np.zeros(runs, dtype=np.int64),
        np.zeros(runs, dtype=np.int64),
        np.full(shape, np.nan) if record else None,
        np.zeros((runs, loop.step.size1_in("state"))),
    )


class _Runs(ctypes.Structure):
    """``Runs`` of the C driver: addresses of arrays."""

    _fields_ = (
        ("stride", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("order", "parameters", "n_steps", "begins", "series", "passed")),
        *((name, ctypes.c_void_p) for name in ("metrics", "record", "states", "ends", "stops")),
    )


class CompiledEngine:
    """A closed loop printed as C over ``lanes`` simulations at once and loaded.

    Results do not depend on ``lanes``, ``isa``, compiler or ``jobs``, to the last bit.
    """

    def __init__(
        self,
        loop: Rollable,
        lanes: int | None = None,
        compiler: Compiler | None = None,
        isa: str | None = None,
        folder: Path | None = None,
    ) -> None:
        compiler = compiler or find_compiler()
        if compiler is None:
            raise EngineError("no C compiler found (set FZCLI_CC to name one)")
        isa = isa or host_isa()
        self.loop = loop
        self.isa = isa
        self.lanes = lanes or ISA_LANES[isa]
        self.name = "compiled"
        self.library = build_library(c_source(loop), self.lanes, compiler, isa, folder)
        self._rollouts = self.library.fzcli_rollouts
        self._rollouts.restype, self._rollouts.argtypes = ctypes.c_int, [ctypes.c_void_p, *[ctypes.c_int64] * 2]

    def run(
        self,
        parameters: Array,
        n_steps: NDArray[np.int64],
        *,
        record: bool = False,
        jobs: int = 1,
        progress: Callable[[int], None] | None = None,
        resume: Resume | None = None,
        series: NDArray[np.int64] | None = None,
    ) -> Batch:
        """See `Engine.run`; the longest runs begin first, so that few lanes idle at the end."""
        steps = np.ascontiguousarray(n_steps, dtype=np.int64)
        batch = empty_batch(self.loop, len(steps), steps, record)
        order = np.arange(len(steps)) if series is not None else np.argsort(-steps, kind="stable")
        if resume is not None:
            order = np.argsort(resume.begins - steps, kind="stable")
            batch.states[:] = resume.states
        arrays = {
            "order": order,
            "parameters": np.ascontiguousarray(parameters, dtype=np.float64),
            "n_steps": steps,
            "begins": resume and np.ascontiguousarray(resume.begins, dtype=np.int64),
            "series": None if series is None else np.ascontiguousarray(series, dtype=np.int64),
            "passed": None if series is None else np.full(longest(series) + 1, len(steps)),
            **{name: getattr(batch, name) for name in ("metrics", "record", "states", "ends", "stops")},
        }
        places = {name: array.ctypes.data for name, array in arrays.items() if array is not None}
        runs = _Runs(0 if batch.record is None else batch.record.shape[1], **places)
        parts = 4 * jobs if jobs > 1 else 1  # so that all threads end at about the same time
        size = min(max(FEWEST, -(-len(steps) // parts)), MOST)
        starts = iter(range(0, len(steps), size))

        def work() -> Iterator[int]:
            for first in starts:  # shared by all threads: whoever is free takes the next chunk
                last = min(first + size, len(steps))
                if self._rollouts(ctypes.byref(runs), first, last):
                    raise MemoryError("no memory for the lanes of a rollout")
                yield last - first

        self._spread(work, min(jobs, -(-len(steps) // size)), progress or _silent)
        return batch

    def _spread(self, work: Callable[[], Iterator[int]], jobs: int, progress: Callable[[int], None]) -> None:
        """Do the work on ``jobs`` threads. The calling one is among them and alone reports: a helper that
        starts while it is busy gets a processor of its own, two that start while it waits may share one.
        """
        if jobs <= 1:
            for count in work():
                progress(count)
            return
        finished: list[int] = []  # by the helpers, a chunk each
        told = 0

        def help_along() -> None:
            for count in work():
                finished.append(count)

        with ThreadPoolExecutor(jobs - 1) as pool:
            helpers = [pool.submit(help_along) for _ in range(jobs - 1)]
            for count in work():
                so_far = len(finished)
                progress(count + sum(finished[told:so_far]))
                told = so_far
            for helper in helpers:
                helper.result()
        progress(sum(finished[told:]))


def _silent(count: int) -> None:
    """Nobody listens."""


class VirtualMachine:
    """The same loop in CasADi's virtual machine: no compiler needed, a hundred times slower."""

    def __init__(self, loop: Rollable) -> None:
        self.loop = loop
        self.name = "vm"

    def run(
        self,
        parameters: Array,
        n_steps: NDArray[np.int64],
        *,
        record: bool = False,
        jobs: int = 1,
        progress: Callable[[int], None] | None = None,
        resume: Resume | None = None,
        series: NDArray[np.int64] | None = None,
    ) -> Batch:
        """See `Engine.run`; ``jobs`` is ignored, the machine holds Python's lock."""
        n_steps = np.asarray(n_steps, dtype=np.int64)
        batch = empty_batch(self.loop, len(n_steps), n_steps, record)
        rows = np.asarray(parameters, dtype=np.float64)
        left = np.argsort(n_steps, kind="stable") if series is None else np.arange(len(n_steps))
        of = left if series is None else series
        passed = np.zeros(longest(of) + 1, dtype=bool)
        while len(left):
            firsts = np.unique(of[left[:VM_LANES]], return_index=True)[1]  # one of a series at a time
            piece = left[np.sort(firsts)]
            again = resume and Resume(resume.begins[piece], resume.states[piece])
            self._run_piece(rows[piece], n_steps[piece], batch, piece, again)
            passed[of[piece[batch.stops[piece] == 0]]] = True
            left = left[~np.isin(left, piece)]
            left_out = passed[of[left]]
            batch.stops[left[left_out]] = LEFT_OUT
            left = left[~left_out]
            if progress:
                progress(len(piece) + int(left_out.sum()))
        return batch

    def _run_piece(
        self,
        parameters: Array,
        n_steps: NDArray[np.int64],
        batch: Batch,
        piece: NDArray[np.int64],
        resume: Resume | None,
    ) -> None:
        """The C driver's loop in NumPy, one column a run."""
        loop, width = self.loop, len(piece)
        step = loop.step.map(width)
        state, constants = (np.array(v) for v in loop.initial.map(width)(parameters.T))
        begins = np.zeros(width, dtype=np.int64)
        if resume is not None:
            begins, state = resume.begins, resume.states.T
        sums = np.zeros((loop.step.size1_in("history"), width))
        ring = np.zeros((max(1, loop.history_length), *sums.shape))
        active = np.ones(width, dtype=bool)
        for k in range(longest(n_steps - begins) + 1):
            before = state
            state, samples, stop, signals = (np.array(v) for v in step(state, constants, sums))
            at = begins + k
            if batch.record is not None:
                batch.record[piece[active], at[active]] = signals.T[active]
            ending = active & ((stop[0] != 0) | (at == n_steps))
            if ending.any():
                metrics = np.array(loop.finish.map(width)(state, constants))
                batch.metrics[piece[ending]] = metrics.T[ending]
                batch.ends[piece[ending]] = at[ending]
                batch.stops[piece[ending]] = stop[0][ending].astype(np.int64)
                paused = ending & (stop[0] < 0)
                batch.states[piece[paused]] = before.T[paused]
                active &= ~ending
                if not active.any():
                    return
            if loop.history_length:
                slot = k % loop.history_length
                sums = sums + (samples - ring[slot])
                ring[slot] = samples
