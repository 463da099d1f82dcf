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
    ) -> Batch:
        """Run every row of ``parameters`` (runs, p) for its number of steps; ``progress`` gets run counts.

        ``resume``: the runs were paused, and go on from there.
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
        self.library.fzcli_rollouts.restype = ctypes.c_int

    def run(
        self,
        parameters: Array,
        n_steps: NDArray[np.int64],
        *,
        record: bool = False,
        jobs: int = 1,
        progress: Callable[[int], None] | None = None,
        resume: Resume | None = None,
    ) -> Batch:
        """See `Engine.run`; the longest runs begin first, so that few lanes idle at the end."""
        n_steps = np.asarray(n_steps, dtype=np.int64)
        order = np.argsort(-n_steps if resume is None else resume.begins - n_steps, kind="stable")
        rows = np.ascontiguousarray(np.asarray(parameters, dtype=np.float64)[order])
        steps = n_steps[order]
        ordered = empty_batch(self.loop, len(steps), steps, record)
        begins = None
        if resume is not None:
            begins = np.ascontiguousarray(resume.begins[order])
            ordered.states[:] = resume.states[order]
        size = min(max(FEWEST, -(-len(steps) // (4 * jobs))), MOST)
        starts = iter(range(0, len(steps), size))

        def work() -> Iterator[int]:
            for start in starts:  # shared by all threads: whoever is free takes the next chunk
                count = min(size, len(steps) - start)
                self._run_chunk(rows, steps, ordered, start, count, begins)
                yield count

        self._spread(work, min(jobs, -(-len(steps) // size)), progress or _silent)
        back = np.argsort(order, kind="stable")
        return Batch(
            ordered.metrics[back],
            ordered.ends[back],
            ordered.stops[back],
            None if ordered.record is None else ordered.record[back],
            ordered.states[back],
        )

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

    def _run_chunk(
        self,
        rows: Array,
        steps: NDArray[np.int64],
        batch: Batch,
        start: int,
        count: int,
        begins: NDArray[np.int64] | None,
    ) -> None:
        """Rows ``start`` to ``start + count`` of arrays that lie one run after the other."""
        record = batch.record
        failed = self.library.fzcli_rollouts(
            ctypes.c_int64(count),
            _row(rows, start),
            _row(steps, start),
            _row(batch.metrics, start),
            _row(batch.ends, start),
            _row(batch.stops, start),
            None if record is None else _row(record, start),
            ctypes.c_int64(0 if record is None else record.shape[1]),
            None if begins is None else _row(begins, start),
            _row(batch.states, start),
        )
        if failed:
            raise MemoryError("no memory for the workspace of a rollout")


def _silent(count: int) -> None:
    """Nobody listens."""


def _row(array: NDArray[np.generic], start: int) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data + start * array.strides[0])


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
    ) -> Batch:
        """See `Engine.run`; ``jobs`` is ignored, the machine holds Python's lock."""
        n_steps = np.asarray(n_steps, dtype=np.int64)
        batch = empty_batch(self.loop, len(n_steps), n_steps, record)
        order = np.argsort(n_steps, kind="stable")
        for i in range(0, len(order), VM_LANES):
            piece = order[i : i + VM_LANES]
            rows = np.asarray(parameters, dtype=np.float64)[piece]
            again = resume and Resume(resume.begins[piece], resume.states[piece])
            self._run_piece(rows, n_steps[piece], batch, piece, again)
            if progress:
                progress(len(piece))
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
