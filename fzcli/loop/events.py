"""Host events: runs that pause for their law's search, and go on with what it found."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fzcli.control.law import NOT_FOUND
from fzcli.loop.adaptive import AdaptiveMachine
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.compiler import find_compiler
from fzcli.loop.engine import Batch, CompiledEngine, Engine, Resume, VirtualMachine
from fzcli.loop.rollable import Rollable
from fzcli.loop.search_loop import SearchLoop
from fzcli.loop.stops import PAUSED

Array = NDArray[np.float64]
BLOCK = 4096  # runs that are under way at a time


class Searcher:
    """Runs the searches of paused runs, all seeds of all of them side by side."""

    def __init__(self, search: SearchLoop, engine: Engine) -> None:
        self.search = search
        self.engine = engine

    def states(self, loop: ClosedLoop, parameters: Array, states: Array, jobs: int = 1) -> Array:
        """The states (runs, n) with which the paused runs of these parameters and states go on."""
        search, runs = self.search, len(states)
        constants = np.array(loop.initial.map(runs)(parameters.T)[1])
        rows, numbers = (np.array(v) for v in search.request.map(runs)(states.T, constants))
        drawn = np.concatenate([self._offsets(int(number)) for number in numbers[0]])
        given = np.hstack([np.repeat(rows.T, search.seeds, axis=0), drawn])
        batch = self.engine.run(given, np.full(len(given), search.n_steps), jobs=jobs)
        results = batch.metrics.reshape(runs, search.seeds, -1)
        costs = np.nan_to_num(results[:, :, -1], nan=NOT_FOUND)
        best = np.argmin(costs, axis=1)
        chosen = results[np.arange(runs), best]
        found = (costs[np.arange(runs), best] < NOT_FOUND).astype(float)
        postures = np.nan_to_num(chosen[:, :-1])
        return np.array(search.accept.map(runs)(states.T, postures.T, found[None, :])).T

    def _offsets(self, number: int) -> Array:
        """Of one search, (seeds, offsets) in (-1, 1): the same whatever run it is that searches."""
        random = np.random.Generator(np.random.PCG64(np.random.SeedSequence((self.search.seed, number))))
        return random.uniform(-1.0, 1.0, (self.search.seeds, self.search.offsets))


class SearchingEngine:
    """An engine whose runs may pause: it searches for those that do, and runs them on."""

    def __init__(self, engine: Engine, searcher: Searcher) -> None:
        self.engine = engine
        self.searcher = searcher
        self.loop: ClosedLoop = engine.loop
        self.name = engine.name

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
        """See `Engine.run`."""
        parameters = np.asarray(parameters, dtype=np.float64)
        n_steps = np.asarray(n_steps, dtype=np.int64)
        pieces = []
        for first in range(0, max(1, len(n_steps)), BLOCK):
            part = slice(first, first + BLOCK)
            again = resume and Resume(resume.begins[part], resume.states[part])
            tries = None if series is None else series[part]
            pieces.append(self._run_block(parameters[part], n_steps[part], record, jobs, progress, again, tries))
        return pieces[0] if len(pieces) == 1 else _joined(pieces, n_steps)

    def _run_block(
        self,
        parameters: Array,
        n_steps: NDArray[np.int64],
        record: bool,
        jobs: int,
        progress: Callable[[int], None] | None,
        resume: Resume | None,
        series: NDArray[np.int64] | None,
    ) -> Batch:
        batch = self.engine.run(parameters, n_steps, record=record, jobs=jobs, resume=resume, series=series)
        waiting = np.flatnonzero(batch.stops == PAUSED)
        told = len(n_steps) - len(waiting)
        if progress:
            progress(told)
        while waiting.size:
            states = self.searcher.states(self.loop, parameters[waiting], batch.states[waiting], jobs)
            begins = batch.ends[waiting]
            part = self.engine.run(
                parameters[waiting], n_steps[waiting], record=record, jobs=jobs, resume=Resume(begins, states)
            )
            for name in ("metrics", "ends", "stops", "states"):
                getattr(batch, name)[waiting] = getattr(part, name)
            if batch.record is not None and part.record is not None:
                for i, (run, begin) in enumerate(zip(waiting, begins, strict=True)):
                    batch.record[run, begin : part.record.shape[1]] = part.record[i, begin:]
            still = waiting[batch.stops[waiting] == PAUSED]
            if progress:
                progress(len(waiting) - len(still))
            waiting = still
        return batch


def _joined(pieces: list[Batch], n_steps: NDArray[np.int64]) -> Batch:
    """Blocks of runs one after the other; records padded to the longest."""
    record = None
    if pieces[0].record is not None:
        records = [piece.record for piece in pieces if piece.record is not None]
        longest = max(part.shape[1] for part in records)
        short = [((0, 0), (0, longest - part.shape[1]), (0, 0)) for part in records]
        padded = [np.pad(part, missing, constant_values=np.nan) for part, missing in zip(records, short, strict=True)]
        record = np.concatenate(padded)
    named = {
        name: np.concatenate([getattr(piece, name) for piece in pieces])
        for name in ("metrics", "ends", "stops", "states")
    }
    return replace(pieces[0], record=record, **named)


def make_engine(loop: ClosedLoop, lanes: int | None = None, folder: Path | None = None) -> Engine:
    """The compiled engine where there is a C compiler, else the virtual machine; with its law's search.

    A loop with the adaptive integrator runs in the virtual machine. ``folder``: where what is compiled is put, in
    place of the cache.
    """
    engine: Engine = AdaptiveMachine(loop, loop.adaptive) if loop.adaptive else _plain_engine(loop, lanes, folder)
    searcher = searcher_of(loop)
    return engine if searcher is None else SearchingEngine(engine, searcher)


def searcher_of(loop: ClosedLoop) -> Searcher | None:
    """What runs the searches of a loop whose law has one."""
    return None if loop.search is None else Searcher(loop.search, _plain_engine(loop.search, None))


def _plain_engine(loop: Rollable, lanes: int | None, folder: Path | None = None) -> Engine:
    if find_compiler() is None:
        return VirtualMachine(loop)
    return CompiledEngine(loop, lanes, folder=folder)
