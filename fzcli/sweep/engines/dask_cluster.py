"""Workers of a Dask cluster that see the sweep's folder: tasks go out, reports of a few numbers come back."""

import contextlib
import logging
import os
import queue
import time
from pathlib import Path
from typing import Any

from fzcli.errors import UnfinishedError, UsageError
from fzcli.sweep.engines.pool import Died, Outcome
from fzcli.sweep.work import Done, Task, do_several_at

AHEAD = 2  # batches that a thread of the cluster has: one at work, one waiting
SECONDS = 0.4  # of work in a batch: Dask takes some milliseconds of all processors for each
MOST = 12  # tasks in a batch, so that it reports in less than 1 kB
COUNTED = 2.0  # seconds after which the cluster's threads are counted again: workers come and go
QUIET = {  # of a cluster of our own: workers that look at themselves now and then, not fifty times a second
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.worker.profile.enabled": False,
    "distributed.deploy.lost-worker-timeout": "1000 days",  # a worker that is begun again is not given up
}
SOON = 2.0  # seconds within which a report that is there arrives


class DaskCluster:
    """The shards of one folder on the workers of a scheduler, several at a time where they are short.

    ``address``: "local" for a cluster of ``jobs`` processes here, or tcp://HOST:PORT; or a ``scheduler_file``.
    ``shards``: how many there are to do. Raises UsageError where Dask is not installed, or no scheduler answers.
    """

    def __init__(
        self, folder: Path, identity: str, address: str, scheduler_file: Path | None, jobs: int, shards: int
    ) -> None:
        self._folder, self._identity, self._left = str(folder.resolve()), identity, shards
        self._done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._settings = contextlib.ExitStack()
        self._client = _client(address, scheduler_file, jobs, self._settings)
        self._threads, self._counted = self._count(), time.monotonic()
        self._batches: dict[Any, list[Task]] = {}  # future -> what it does
        self._next: list[Task] = []  # the batch that is being filled
        self._seconds = SECONDS  # that a task takes

    @property
    def window(self) -> int:
        """See `Pool`."""
        missing = max(0, AHEAD * self._threads - len(self._batches))
        return sum(len(tasks) for tasks in self._batches.values()) + missing * self._together

    @property
    def _together(self) -> int:
        """Tasks in a batch: fewer towards the end, so that all workers end at about the same time."""
        return max(1, min(MOST, int(SECONDS / self._seconds), self._left // (2 * self._threads)))

    def submit(self, task: Task) -> None:
        """See `Pool`."""
        if task.probe is not None:  # it may well end its worker: alone
            self._send()
        self._next.append(task)
        self._left -= 1
        if task.probe is not None or len(self._next) >= self._together:
            self._send()

    def wait(self, seconds: float) -> list[tuple[Task, Outcome]]:
        """See `Pool`. Raises UnfinishedError when the scheduler is gone."""
        self._send()
        if time.monotonic() - self._counted > COUNTED:
            self._threads, self._counted = self._count(), time.monotonic()
        try:
            future = self._done.get(timeout=seconds)
        except queue.Empty:
            if self._client.status != "running":
                raise UnfinishedError("the scheduler is gone") from None
            return []
        found = self._outcome(future)
        if found is None:
            future.add_done_callback(self._done.put)
            return []
        tasks = self._batches.pop(future)
        if isinstance(found, list):
            self._seconds = max(1e-3, sum(done.seconds for done in found) / len(found))
            return list(zip(tasks, found, strict=True))
        if isinstance(found, Died) and len(tasks) > 1:  # whose fault it was is seen when each goes alone
            for task in tasks:
                self._next.append(task)
                self._send()
            return []
        return [(tasks[0], found)]

    def _send(self) -> None:
        if self._next:
            tasks, self._next = self._next, []
            future = self._client.submit(do_several_at, self._folder, self._identity, tasks, pure=False)
            self._batches[future] = tasks
            future.add_done_callback(self._done.put)

    def progress(self) -> int:
        """See `Pool`."""
        return 0

    def close(self, wait: bool) -> None:
        """See `Pool`: tasks that did not begin are taken back."""
        with contextlib.suppress(Exception):  # a scheduler that is gone cannot be told
            self._client.cancel(list(self._batches))
        cluster = self._client.cluster
        with contextlib.suppress(Exception):
            self._client.close(timeout=2)
        if cluster is not None:
            cluster.close()
        self._settings.close()

    def _count(self) -> int:
        """Threads of the cluster, one at least."""
        try:
            threads: int = sum(self._client.nthreads().values())
        except (OSError, TimeoutError):
            return 1
        return max(1, threads)

    def _outcome(self, future: Any) -> list[Done] | Died | Exception | None:
        """None where the report went with the worker that held it: the scheduler has the tasks done again."""
        from distributed import KilledWorker

        if future.status == "cancelled" or self._client.status != "running":
            raise UnfinishedError("the scheduler is gone, or has forgotten the tasks")
        try:
            error = future.exception(timeout=SOON)
            if error is None:
                found: list[Done] = future.result(timeout=SOON)
                return found
        except TimeoutError:
            return None
        except Exception as raised:  # by the task, done again
            error = raised
        if isinstance(error, KilledWorker):
            lost = error.allowed_failures + 1
            return Died("Dask lost a worker" if lost == 1 else f"Dask lost {lost} workers")
        return error if isinstance(error, Exception) else RuntimeError(str(error))


def _client(address: str, scheduler_file: Path | None, jobs: int, settings: contextlib.ExitStack) -> Any:
    """``settings``: takes those that a cluster of our own has, until it is closed."""
    try:
        import dask
        import distributed
    except ImportError:
        raise UsageError("Dask is not installed: pip install 'fzcli[cluster]'") from None
    connect: Any = distributed.Client
    begin: Any = distributed.LocalCluster
    try:
        if scheduler_file is not None:
            return connect(scheduler_file=str(scheduler_file), timeout=10, set_as_default=False)
        if address == "local":
            os.environ.setdefault("DASK_DISTRIBUTED__LOGGING__DISTRIBUTED", "critical")  # its farewells are no errors
            settings.enter_context(dask.config.set(QUIET))
            options = {"threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": logging.CRITICAL}
            kept = {"allowed_failures": 0}  # the driver counts deaths itself
            return connect(begin(n_workers=jobs, scheduler_kwargs=kept, **options), set_as_default=False)
        return connect(address, timeout=10, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        settings.close()
        where = scheduler_file or address
        raise UsageError(f"no Dask scheduler at {where}: {str(error).partition(chr(10))[0]}") from None
