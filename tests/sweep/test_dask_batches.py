"""Shards in batches on a Dask cluster: each once, fewer at a time towards the end, alone where a worker ended."""

import pickle
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from fzcli.sweep.engines import dask_cluster
from fzcli.sweep.engines.dask_cluster import AHEAD, MOST, DaskCluster
from fzcli.sweep.engines.pool import Died, Outcome
from fzcli.sweep.work import Done, Task

distributed = pytest.importorskip("distributed")
THREADS = 2


class Future:
    """Of a batch that is done at once; ``deadly`` shards end their workers."""

    status = "finished"

    def __init__(self, tasks: Sequence[Task], seconds: float, deadly: int | None) -> None:
        self.done = [Done(1000, 0, seconds) for _ in tasks]
        self.deadly = any(task.shard == deadly for task in tasks)

    def add_done_callback(self, call: Callable[["Future"], None]) -> None:
        call(self)

    def exception(self, timeout: float) -> Exception | None:
        return distributed.KilledWorker("task", None, 3) if self.deadly else None

    def result(self, timeout: float) -> list[Done]:
        return self.done


class Client:
    """Of a cluster without workers."""

    status, cluster = "running", None

    def __init__(self, seconds: float, deadly: int | None) -> None:
        self.seconds, self.deadly = seconds, deadly
        self.batches: list[list[Task]] = []

    def nthreads(self) -> dict[str, int]:
        return {f"worker {i}": 1 for i in range(THREADS)}

    def submit(self, function: Any, folder: str, identity: str, tasks: list[Task], pure: bool) -> Future:
        self.batches.append(tasks)
        return Future(tasks, self.seconds, self.deadly)


def driven(
    monkeypatch: pytest.MonkeyPatch, tasks: list[Task], seconds: float, deadly: int | None = None
) -> tuple[list[tuple[Task, Outcome]], list[list[Task]]]:
    """What comes back of the tasks, and the batches that they went out in."""
    client = Client(seconds, deadly)
    monkeypatch.setattr(dask_cluster, "_client", lambda *how: client)
    pool = DaskCluster(Path(), "identity", "local", None, THREADS, len(tasks))
    found: list[tuple[Task, Outcome]] = []
    flying, waiting = 0, list(tasks)
    while flying or waiting:
        while waiting and flying < pool.window:
            pool.submit(waiting.pop(0))
            flying += 1
        back = pool.wait(0.0)
        flying -= len(back)
        found += back
    return found, client.batches


def test_short_shards_go_together_and_each_comes_back_once(monkeypatch: pytest.MonkeyPatch) -> None:
    tasks = [Task(index) for index in range(200)]
    found, batches = driven(monkeypatch, tasks, 0.05)
    assert sorted(task.shard for task, _ in found) == list(range(200))
    assert {type(outcome) for _, outcome in found} == {Done}
    sizes = [len(batch) for batch in batches]
    assert sizes[: AHEAD * THREADS] == [1] * (AHEAD * THREADS), "nothing is known of them yet"
    assert max(sizes) == 8
    assert sizes[-2:] == [1, 1]


@pytest.mark.parametrize(("seconds", "most"), [(5.0, 1), (0.15, 2), (1e-6, MOST)])
def test_a_batch_takes_less_than_half_a_second(monkeypatch: pytest.MonkeyPatch, seconds: float, most: int) -> None:
    _, batches = driven(monkeypatch, [Task(index) for index in range(300)], seconds)
    assert max(len(batch) for batch in batches) == most


def test_a_batch_that_ended_its_worker_is_tried_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    tasks = [Task(index) for index in range(100)]
    found, batches = driven(monkeypatch, tasks, 0.05, deadly=30)
    died = [task.shard for task, outcome in found if isinstance(outcome, Died)]
    assert died == [30]
    assert len(found) == 100
    company = next(batch for batch in batches if Task(30) in batch)
    assert len(company) > 1
    assert all([task] in batches for task in company)


def test_a_probe_goes_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    probe = Task(7, probe=(3, 9))
    tasks = [Task(index) for index in range(100)]
    _, batches = driven(monkeypatch, [*tasks[:50], probe, *tasks[50:]], 0.05)
    assert [probe] in batches


def test_a_report_is_short() -> None:
    reports = [Done(2048 + i, 17 * i, 0.123456789 * i) for i in range(MOST)]
    assert len(pickle.dumps(reports)) < 1000
