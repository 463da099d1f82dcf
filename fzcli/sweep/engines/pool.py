"""The contract of an engine: tasks go in, reports come out in any order, and a worker that dies is a report too."""

from dataclasses import dataclass
from typing import Protocol

from fzcli.sweep.work import Done, Task


@dataclass(frozen=True)
class Died:
    """The worker ended before its task did; ``how`` says what is known of it."""

    how: str


Outcome = Done | Died | Exception


class Pool(Protocol):
    """An engine at work."""

    @property
    def window(self) -> int:
        """Tasks that it takes at a time, so that no worker waits."""
        ...

    def submit(self, task: Task) -> None:
        """Take a task."""
        ...

    def wait(self, seconds: float) -> list[tuple[Task, Outcome]]:
        """What came back, after at most so many seconds."""
        ...

    def progress(self) -> int:
        """Runs done in shards that are not yet reported, as far as known."""
        ...

    def close(self, wait: bool) -> None:
        """End the workers; what they were doing is lost, but of threads, with ``wait``, finished first."""
        ...
