"""Shards through an engine: a bounded number at a time, dead workers replaced, the run that kills them found.

A shard whose worker dies is tried again, for workers are killed from outside too. One that kills its workers time and
again is bisected, by running halves of its rows without writing anything, to the rows that do it; these are recorded as
crashed, and the shard is computed without them. The try that decides has the engine for itself: a worker of Dask that
ends takes along what waits for its turn there.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from fzcli.errors import EngineError, RecordError, UnfinishedError
from fzcli.sweep.engines.pool import Died, Outcome, Pool
from fzcli.sweep.folder import Folder
from fzcli.sweep.work import Done, Task

TRIES = 3  # deaths after which a shard is bisected
CONFIRMED = 2  # deaths of a single row alone after which it counts as crashed
PATIENCE = 0.2  # seconds between looks at the stop sign
Tell = Callable[[str, int, int], None]
Say = Callable[[str], None]


@dataclass
class _Search:
    """The bisection of one shard."""

    open: int = 0
    crashed: set[int] = field(default_factory=set)


class Driver:
    """Drives the shards of a folder. ``stop()``: whether no new ones are to be begun."""

    def __init__(self, folder: Folder, pool: Pool, tell: Tell, say: Say, stop: Callable[[], bool]) -> None:
        self.folder, self.pool = folder, pool
        self.tell, self.say, self.stop = tell, say, stop
        self._urgent: deque[Task] = deque()
        self._deciding: deque[Task] = deque()  # each alone in the engine
        self._alone = False  # whether such a one is in flight
        self._deaths: Counter[Task] = Counter()
        self._searches: dict[int, _Search] = {}
        self._in_flight = 0
        self._runs = 0

    def drive(self, shards: Iterator[int], done: int) -> None:
        """Compute these shards; ``done``: runs of those that are there already.

        Raises UnfinishedError when it was stopped or cannot go on, and whatever error a shard gives.
        """
        self._runs = done
        self.tell("running", done, self.folder.layout.runs)
        while True:
            while self._in_flight < self.pool.window and not self.stop() and (task := self._next(shards)):
                self.pool.submit(task)
                self._in_flight += 1
            if not self._in_flight:
                break
            for done_task, outcome in self.pool.wait(PATIENCE):
                self._in_flight -= 1
                self._alone = False
                self._take(done_task, outcome)
            self.tell("running", self._runs + self.pool.progress(), self.folder.layout.runs)
        if self.stop() and self._next(shards):
            raise UnfinishedError("stopped")

    def _next(self, shards: Iterator[int]) -> Task | None:
        """What to begin now, if anything."""
        if self._alone or (self._deciding and self._in_flight):
            return None
        if self._deciding:
            self._alone = True
            return self._deciding.popleft()
        if self._urgent:
            return self._urgent.popleft()
        index = next(shards, None)
        return None if index is None else Task(index)

    def _take(self, task: Task, outcome: Outcome) -> None:
        if isinstance(outcome, Died):
            self._died(task, outcome)
        elif isinstance(outcome, Done):
            self._runs += outcome.runs
            if task.probe is not None:
                self._probed(task.shard)
        elif isinstance(outcome, RecordError):
            raise UnfinishedError(str(outcome)) from outcome
        else:
            raise outcome

    def _died(self, task: Task, how: Died) -> None:
        self._deaths[task] += 1
        if task.probe is None:
            self._shard_died(task, how)
            return
        first, last = task.probe
        search = self._searches[task.shard]
        if last - first > 1:
            middle = (first + last) // 2
            self._urgent += [Task(task.shard, probe=(first, middle)), Task(task.shard, probe=(middle, last))]
            search.open += 1  # two for one
        elif self._deaths[task] < CONFIRMED:
            self._deciding.append(task)
        else:
            search.crashed.add(first)
            self._tell_crash(task.shard, first, how)
            self._probed(task.shard)

    def _shard_died(self, task: Task, how: Died) -> None:
        search = self._searches.get(task.shard)
        if search is not None and self._deaths[task] >= CONFIRMED:
            text = f"shard {task.shard} ends its worker ({how.how}), but no run of it does so alone"
            raise EngineError(f"{text}: is there enough memory?")
        if search is not None:
            self._deciding.append(task)
            return
        if self._deaths[task] < TRIES:
            self._urgent.append(task)
            return
        self.say(f"shard {task.shard} ended its worker {TRIES} times ({how.how}); looking for the run that does it")
        self._searches[task.shard] = _Search(open=1)
        self._urgent.append(Task(task.shard, probe=(0, self.folder.layout.piece(task.shard).runs)))

    def _probed(self, shard: int) -> None:
        search = self._searches[shard]
        search.open -= 1
        if not search.open:
            rest = Task(shard, skip=tuple(sorted(search.crashed)))
            self._deaths[rest] = 0
            self._urgent.append(rest)

    def _tell_crash(self, shard: int, row: int, how: Died) -> None:
        piece = self.folder.layout.piece(shard)
        i, j = divmod(row, len(piece.places))
        index = self.folder.sweep.file.trajectories.first + piece.places[j]
        text = f"configuration {piece.configs[i]} on trajectory {index} ends its process ({how.how})"
        self.say(f"{text}: recorded as crashed")
