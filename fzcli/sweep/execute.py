"""Run a sweep: find out what is done, compute the shards that are missing, and make one file of them."""

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from fzcli.errors import FzcliError, RecordError, SpecError, UnfinishedError
from fzcli.record.hdf5 import Precision
from fzcli.record.sweep_record import SweepRecord
from fzcli.record.table import check_names
from fzcli.record.table_spec import TableSpec
from fzcli.spec.document import Document
from fzcli.spec.library import find, shipped_root
from fzcli.spec.reader import read
from fzcli.spec.sets import apply_sets
from fzcli.sweep.driver import Driver
from fzcli.sweep.engines.pool import Pool
from fzcli.sweep.folder import Folder, begin_folder
from fzcli.sweep.gather import gathered
from fzcli.sweep.meaning import AnySweep, meaning_of
from fzcli.sweep.output import finished, folder_beside, publish, settle
from fzcli.sweep.resolve import Sweep, resolve
from fzcli.sweep.work import Worker, check_engine, do, worker_of

Tell = Callable[[str, int, int], None]
Say = Callable[[str], None]
Stop = Callable[[], bool]


@dataclass(frozen=True)
class Means:
    """What a sweep is run by: no result depends on it.

    ``jobs``: threads or processes, all cores by default. ``processes``: instead of threads; by default where the
    work holds Python's lock. ``dask``: "local", or the address of a scheduler; or its ``scheduler_file``.
    """

    jobs: int | None = None
    processes: bool | None = None
    dask: str | None = None
    scheduler_file: Path | None = None


@dataclass(frozen=True)
class Listener:
    """Who hears of a sweep: of its progress (what, done, total), in words, and who may stop it."""

    tell: Tell = lambda what, done, total: None
    say: Say = lambda text: None
    stop: Stop = lambda: False


@dataclass(frozen=True)
class Outcome:
    """A finished sweep: its file, and how many runs were computed for it now."""

    path: Path
    computed: int


def load_sweep(run: str | Path, sets: Sequence[str] = ()) -> AnySweep:
    """A sweep by path or name, resolved. Raises SpecError with every problem found."""
    return resolve_any(read(run if isinstance(run, Path) or run == "-" else find("runs", run)), sets)


def resolve_any(document: Document, sets: Sequence[str] = ()) -> AnySweep:
    """A sweep of simulations or of plans, as its file says. Raises SpecError with every problem found."""
    document = apply_sets(document, sets) if sets else document
    plans = isinstance(document.value, dict) and document.value.get("run") == "plan"
    if not plans:
        return resolve(document)
    from fzcli.sweep.plan_sweep import resolve_plans

    return resolve_plans(document)


def table_spec(sweep: AnySweep) -> TableSpec | None:
    """How the sweep asks to be tabulated; published numbers are sought beside its file, then shipped."""
    if sweep.file.table is None:
        return None
    folders = [sweep.document.path.parent] if sweep.document.path else []
    return TableSpec.of(sweep.file.table, (*folders, shipped_root() / "runs"))


def precision_of(sweep: AnySweep) -> Precision:
    """Of the trajectories in the sweep's file."""
    if not isinstance(sweep, Sweep):
        return "f8" if sweep.file.record is None else sweep.file.record.precision
    return sweep.specs[0].record.precision


def run_sweep(
    sweep: AnySweep, jobs: int | None = None, tell: Tell | None = None, argv: Sequence[str] = ()
) -> SweepRecord:
    """Run all configurations on all trajectories; the result does not depend on ``jobs``, and no file is left.

    ``tell(what, done, total)`` reports progress. Raises FilterError when a filtered draw finds nothing.
    """
    listener = Listener(tell) if tell else Listener()
    worker = checked_worker(sweep)
    with tempfile.TemporaryDirectory(prefix="fzcli-") as scratch:
        folder = begin_folder(Path(scratch) / "shards", meaning_of(sweep), "f8")
        means = Means(jobs, processes=False if isinstance(sweep, Sweep) else None)
        _compute(folder, worker, means, listener, list(range(folder.layout.shards)))
        with gathered(folder, worker, listener.tell, argv) as record:
            return replace(
                record, metrics=dict(record.metrics), draws=dict(record.draws), kept=tuple(record.kept)
            )


def sweep_to(
    sweep: AnySweep, path: Path, means: Means, listener: Listener, argv: Sequence[str] = ()
) -> Outcome:
    """Run what is missing of a sweep and write its file; a finished one is left as it is.

    A file of another sweep that stands at ``path`` is kept beside it. Raises UnfinishedError when it was stopped, or
    cannot go on; the shards done so far are kept, and the same call goes on from there. Raises UsageError when another
    process works on the same sweep, SpecError, FilterError.
    """
    meaning = meaning_of(sweep)
    done = finished(path, meaning)
    if done is not None:
        settle(done, path, meaning, table_spec(sweep))
        return Outcome(done, 0)
    worker = checked_worker(sweep)
    folder = begin_folder(folder_beside(path, meaning), meaning, precision_of(sweep))
    with folder.alone():
        done = finished(path, meaning)  # by the one that held it before
        if done is not None:
            folder.drop()
            return Outcome(done, 0)
        folder.clean()
        missing = list(folder.missing(listener.say))
        computed = sum(folder.layout.piece(index).runs for index in missing)
        _compute(folder, worker, means, listener, missing)
        merged(folder, worker, path, table_spec(sweep), listener, argv)
    return Outcome(path, computed)


def merge_to(sweep: AnySweep, path: Path, listener: Listener, argv: Sequence[str] = ()) -> Outcome:
    """One file of the shards of a sweep, none of which may be missing; nothing but kept runs is computed.

    Raises UnfinishedError when shards are missing, UsageError when a process works on the sweep.
    """
    meaning = meaning_of(sweep)
    done = finished(path, meaning)
    if done is not None:
        settle(done, path, meaning, table_spec(sweep))
        return Outcome(done, 0)
    place = folder_beside(path, meaning)
    if not place.is_dir():
        raise UnfinishedError(f"{place}: there is no shard of this sweep yet")
    worker = checked_worker(sweep)
    folder = begin_folder(place, meaning, precision_of(sweep))
    with folder.alone():
        missing = list(folder.missing(listener.say))
        if missing:
            raise _unfinished("shards are missing", folder)
        folder.clean()
        merged(folder, worker, path, table_spec(sweep), listener, argv)
    return Outcome(path, 0)


def sweep_part(sweep: AnySweep, path: Path, part: tuple[int, int], means: Means, listener: Listener) -> int:
    """Compute part k of n of a sweep's shards, beside processes that compute others; gives how many runs.

    Nothing is merged. Raises as ``sweep_to``.
    """
    meaning = meaning_of(sweep)
    if finished(path, meaning) is not None:
        return 0
    worker = checked_worker(sweep)
    folder = begin_folder(folder_beside(path, meaning), meaning, precision_of(sweep))
    number, parts = part
    with folder.beside(f"part-{number}-of-{parts}"):
        mine = range(number - 1, folder.layout.shards, parts)
        missing = []
        for index in mine:
            wrong = folder.fault(index)
            if wrong is not None:
                missing.append(index)
            if wrong:
                listener.say(f"{wrong}; computed again")
        _compute(folder, worker, means, listener, missing)
    return sum(folder.layout.piece(index).runs for index in missing)


def merged(
    folder: Folder, worker: Worker, path: Path, table: TableSpec | None, listener: Listener, argv: Sequence[str]
) -> None:
    """Write the one file, and remove the shards unless it refers to them."""
    try:
        with gathered(folder, worker, listener.tell, argv) as record:
            referred = publish(record, path, folder, table)
    except RecordError as error:
        raise _unfinished(str(error), folder) from error
    if not referred:
        folder.drop()


def checked_worker(sweep: AnySweep) -> Worker:
    """What computes the sweep, when all that it asks for is there. Raises SpecError."""
    worker = worker_of(sweep, meaning_of(sweep).identity)
    worker.check()
    table = table_spec(sweep)
    if table is not None:
        try:
            check_names(sweep.changes, worker.metric_info(), table)
        except FzcliError as error:
            text = str(error).removeprefix("table: ")
            raise SpecError(sweep.document.problem(text, ("table",))) from None
    return worker


def _compute(folder: Folder, worker: Worker, means: Means, listener: Listener, missing: list[int]) -> None:
    layout = folder.layout
    done = layout.runs - sum(layout.piece(index).runs for index in missing)
    if not missing:
        return
    pool = _pool(folder, worker, means, listener, len(missing))
    try:
        Driver(folder, pool, listener.tell, listener.say, listener.stop).drive(iter(missing), done)
    except Exception as error:
        pool.close(wait=True)
        if isinstance(error, UnfinishedError):
            raise _unfinished(str(error), folder) from error
        raise
    except BaseException:  # a second signal
        pool.close(wait=False)
        raise
    pool.close(wait=True)


def _unfinished(why: str, folder: Folder) -> UnfinishedError:
    return UnfinishedError(f"{why}; {folder.present()} of {folder.layout.shards} shards are done, in {folder.path}")


def _pool(folder: Folder, worker: Worker, means: Means, listener: Listener, shards: int) -> Pool:
    jobs = means.jobs or os.cpu_count() or 1
    if means.dask is not None or means.scheduler_file is not None:
        from fzcli.sweep.engines.dask_cluster import DaskCluster

        where = means.dask or "", means.scheduler_file
        return DaskCluster(folder.path, folder.meaning.identity, *where, jobs, shards)
    processes = means.processes
    if processes is None:
        processes = folder.meaning.data["engine"] == "vm" and min(jobs, shards) > 1
    if processes:
        from fzcli.sweep.engines.processes import Processes

        return Processes(folder.path, folder.meaning.identity, min(jobs, shards))
    from fzcli.sweep.engines.threads import Threads

    check_engine(folder)
    listener.tell("compiling", 0, 1)
    worker.compile(jobs)
    worker.jobs = max(1, jobs // shards)
    return Threads(partial(do, folder, worker), min(jobs, shards))


def unexpected_failures(sweep: AnySweep, record: SweepRecord) -> int:
    """Failed runs of configurations that were not expected to fail."""
    expected = sweep.file.expect_failures
    if expected is True:
        return 0
    failed = record.metrics["status"] == 2
    configs = record.metrics["config"]
    total = 0
    for c, changes in enumerate(record.configs):
        excused = isinstance(expected, dict) and all(changes.get(path) == value for path, value in expected.items())
        if not excused:
            total += int((failed & (configs == c)).sum())
    return total
