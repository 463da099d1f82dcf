"""What a worker does, wherever it is: from the folder of a sweep and a task to a shard on disk and a short report."""

import socket
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from fzcli.errors import EngineError, RecordError
from fzcli.loop.compiler import find_compiler
from fzcli.record.shard_file import write_shard
from fzcli.spec.result import STATUS_NAMES
from fzcli.sweep.folder import Folder, open_folder
from fzcli.sweep.kept_runs import UNSAID
from fzcli.sweep.meaning import AnySweep
from fzcli.sweep.resolve import Sweep

if TYPE_CHECKING:
    from fzcli.sweep.plan_runs import Plans
    from fzcli.sweep.simulations import Simulations

Worker: TypeAlias = "Simulations | Plans"  # loaded when asked for: a finished sweep needs neither
_ROOM: AbstractContextManager[object] = nullcontext()
FAILED = STATUS_NAMES.index("failed")


@dataclass(frozen=True)
class Task:
    """Compute a shard without the rows in ``skip``; or, with ``probe``, run only those rows and write nothing."""

    shard: int
    skip: tuple[int, ...] = ()
    probe: tuple[int, int] | None = None


@dataclass(frozen=True)
class Done:
    """What a task reports: under 1 kB, whatever the shard."""

    runs: int
    failed: int
    seconds: float


def worker_of(sweep: AnySweep, identity: str, jobs: int = 1) -> Worker:
    """What computes the shards of a sweep; ``jobs``: threads in one shard."""
    if isinstance(sweep, Sweep):
        from fzcli.sweep.simulations import Simulations

        return Simulations(sweep, identity, jobs)
    from fzcli.sweep.plan_runs import Plans

    return Plans(sweep, identity)


def do(
    folder: Folder,
    worker: Worker,
    task: Task,
    progress: Callable[[int], None] | None = None,
    room: AbstractContextManager[object] = _ROOM,
) -> Done:
    """Do a task; ``room`` is held while it computes, not while it waits for the disk.

    Raises RecordError where its shard cannot be written.
    """
    begin = time.perf_counter()
    piece = folder.layout.piece(task.shard)
    if task.probe is not None:
        worker.probe(piece, range(*task.probe))
        return Done(0, 0, time.perf_counter() - begin)
    with room:
        shard = worker.shard(piece, frozenset(task.skip), progress)
    write_shard(shard, folder.shard(task.shard), folder.precision, UNSAID)
    return Done(piece.runs, int((shard.status == FAILED).sum()), time.perf_counter() - begin)


def do_at(path: str, identity: str, task: Task) -> Done:
    """Do a task of the sweep whose folder is ``path``, in a process that may know nothing of it yet.

    Raises RecordError where the folder is not to be seen from here, or is of another sweep.
    """
    folder, worker = _at(path, identity)
    return do(folder, worker, task)


def do_several_at(path: str, identity: str, tasks: Sequence[Task]) -> list[Done]:
    """Several tasks in turn, as `do_at`."""
    return [do_at(path, identity, task) for task in tasks]


@lru_cache(maxsize=2)
def _at(path: str, identity: str) -> tuple[Folder, Worker]:
    folder = open_folder(Path(path))
    if folder.meaning.identity != identity:
        raise RecordError(f"{path}: is the folder of another sweep")
    check_engine(folder)
    return folder, worker_of(folder.sweep, identity)


def check_engine(folder: Folder) -> None:
    """Raises EngineError where this machine would run the sweep by another engine than it was begun with."""
    if folder.meaning.data["run"] == "plan":
        return
    wanted, here = folder.meaning.data["engine"], "vm" if find_compiler() is None else "compiled"
    if wanted != here:
        cure = "install a C compiler" if wanted == "compiled" else "set FZCLI_CC=none"
        raise EngineError(f"the sweep was begun with engine {wanted}, on {socket.gethostname()} it is {here}: {cure}")
