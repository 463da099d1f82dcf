"""Threads of this process: the compiled loops let go of Python's lock, so that one process fills all cores."""

import queue
import threading
from collections.abc import Callable

from fzcli.sweep.engines.pool import Outcome
from fzcli.sweep.work import Done, Task


class Threads:
    """``do`` in threads, of which ``jobs`` compute while one more waits for the disk.

    They end with the process, whatever they are doing.
    """

    def __init__(self, do: Callable[..., Done], jobs: int) -> None:
        self.window = jobs + 1
        self._do = do
        self._room = threading.BoundedSemaphore(jobs)
        self._tasks: queue.SimpleQueue[Task | None] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[tuple[Task, Outcome]] = queue.SimpleQueue()
        self._under_way: dict[int, int] = {}  # shard -> runs done
        self._threads = [threading.Thread(target=self._work, daemon=True) for _ in range(self.window)]
        for thread in self._threads:
            thread.start()

    def submit(self, task: Task) -> None:
        """See `Pool`."""
        self._tasks.put(task)

    def wait(self, seconds: float) -> list[tuple[Task, Outcome]]:
        """See `Pool`."""
        try:
            return [self._done.get(timeout=seconds)]
        except queue.Empty:
            return []

    def progress(self) -> int:
        """See `Pool`."""
        return sum(list(self._under_way.values()))

    def close(self, wait: bool) -> None:
        """See `Pool`: threads cannot be ended; each stops after its task, or with the process."""
        while not self._tasks.empty():
            self._tasks.get()
        for _ in self._threads:
            self._tasks.put(None)
        for thread in self._threads if wait else ():
            thread.join()

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            outcome: Outcome
            try:
                outcome = self._do(task, self._counter(task.shard), self._room)
            except Exception as error:
                outcome = error
            self._under_way.pop(task.shard, None)
            self._done.put((task, outcome))

    def _counter(self, shard: int) -> Callable[[int], None]:
        def count(runs: int) -> None:
            self._under_way[shard] = self._under_way.get(shard, 0) + runs

        return count
