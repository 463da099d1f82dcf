"""Workers of a Dask cluster that see the sweep's folder: tasks go out, reports of a few numbers come back."""

import contextlib
import logging
import os
import queue
from pathlib import Path
from typing import Any

from fzcli.errors import UnfinishedError, UsageError
from fzcli.sweep.engines.pool import Died, Outcome
from fzcli.sweep.work import Task, do_at

AHEAD = 2  # tasks a thread of the cluster has: one at work, one waiting
SOON = 2.0  # seconds within which a report that is there arrives


class DaskCluster:
    """The shards of one folder on the workers of a scheduler.

    ``address``: "local" for a cluster of ``jobs`` processes here, or tcp://HOST:PORT; or a ``scheduler_file``.
    Raises UsageError where Dask is not installed, or no scheduler answers.
    """

    def __init__(self, folder: Path, identity: str, address: str, scheduler_file: Path | None, jobs: int) -> None:
        self._folder, self._identity = str(folder.resolve()), identity
        self._done: queue.SimpleQueue[tuple[Task, Any]] = queue.SimpleQueue()
        self._settings = contextlib.ExitStack()
        self._client = _client(address, scheduler_file, jobs, self._settings)
        self._futures: set[Any] = set()
        self.window = AHEAD * max(1, self._threads())

    def submit(self, task: Task) -> None:
        """See `Pool`."""
        future = self._client.submit(do_at, self._folder, self._identity, task, pure=False)
        self._futures.add(future)
        self._await(task, future)

    def wait(self, seconds: float) -> list[tuple[Task, Outcome]]:
        """See `Pool`. Raises UnfinishedError when the scheduler is gone."""
        try:
            task, future = self._done.get(timeout=seconds)
        except queue.Empty:
            if self._client.status != "running":
                raise UnfinishedError("the scheduler is gone") from None
            self.window = AHEAD * max(1, self._threads())  # workers come and go
            return []
        outcome = self._outcome(future)
        if outcome is None:
            self._await(task, future)
            return []
        self._futures.discard(future)
        return [(task, outcome)]

    def progress(self) -> int:
        """See `Pool`."""
        return 0

    def close(self, wait: bool) -> None:
        """See `Pool`: tasks that did not begin are taken back."""
        with contextlib.suppress(Exception):  # a scheduler that is gone cannot be told
            self._client.cancel(list(self._futures))
        cluster = self._client.cluster
        with contextlib.suppress(Exception):
            self._client.close(timeout=2)
        if cluster is not None:
            cluster.close()
        self._settings.close()

    def _await(self, task: Task, future: Any) -> None:
        future.add_done_callback(lambda ended: self._done.put((task, ended)))

    def _threads(self) -> int:
        try:
            return sum(self._client.nthreads().values())
        except (OSError, TimeoutError):
            return 0

    def _outcome(self, future: Any) -> Outcome | None:
        """None where the report went with the worker that held it: the scheduler has the task done again."""
        from distributed import KilledWorker

        if future.status == "cancelled" or self._client.status != "running":
            raise UnfinishedError("the scheduler is gone, or has forgotten the tasks")
        try:
            error = future.exception(timeout=SOON)
            if error is None:
                found: Outcome = future.result(timeout=SOON)
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
            os.environ.setdefault("DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED", "False")  # stops the work to look at it
            settings.enter_context(dask.config.set({"distributed.deploy.lost-worker-timeout": "1000 days"}))
            options = {"threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": logging.CRITICAL}
            kept = {"allowed_failures": 0}  # the driver counts deaths itself
            return connect(begin(n_workers=jobs, scheduler_kwargs=kept, **options), set_as_default=False)
        return connect(address, timeout=10, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        settings.close()
        where = scheduler_file or address
        raise UsageError(f"no Dask scheduler at {where}: {str(error).partition(chr(10))[0]}") from None
