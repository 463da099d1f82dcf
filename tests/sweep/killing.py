"""Kills a sweep's processes at random moments until its time is up, then lets it finish: a program of its own.

    python -m tests.sweep.killing ENGINE FOLDER KILLS SEED

It prints how often each victim was killed. The driver is forked from this process, so that it need not load anything.
"""

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

from fzcli.errors import UnfinishedError, UsageError
from fzcli.record.shard_file import shard_hash
from fzcli.spec.document import document_of
from fzcli.sweep.execute import Listener, Means, Outcome, sweep_to
from fzcli.sweep.meaning import AnySweep
from fzcli.sweep.resolve import resolve
from tests.loop.cases import raw_run

VICTIMS = {
    "threads": ["driver"],
    "processes": ["driver", "worker", "worker"],
    "dask": ["driver", "worker", "scheduler"],
}
MOMENTS = {"threads": 0.5, "processes": 2.0, "dask": 2.0}  # seconds within which the next kill comes
DRAW = {"reference.length": {"uniform": [0.05, 0.2]}, "reference.direction": {"sphere": 3}}


def small_sweep(count: int = 400, step: str = "10 ms", **changes: Any) -> AnySweep:
    """Some thousand short runs."""
    data = {**raw_run(), "kind": "sweep", "step": step, "duration": 0.2}
    data["reference"] = {"kind": "line", "duration": "1 s"}
    data["trajectories"] = {"count": count, "seed": 7, "draw": DRAW}
    data["grid"] = {"controller.gain": [10, 100, 1000, 5000]}
    return resolve(document_of({**data, **changes}))


def finish(path: Path, means: Means) -> Outcome:
    """The sweep to its end."""
    return sweep_to(small_sweep(), path, means, Listener())


class Killer:
    """One engine's sweep, time and again."""

    def __init__(self, engine: str, folder: Path, seed: int) -> None:
        self.engine, self.path = engine, folder / "s.h5"
        self.random = random.Random(seed)
        self.killed: Counter[str] = Counter()
        self.cluster: list[subprocess.Popen[bytes]] = []
        self.scheduler_file = folder.parent / f"{folder.name}-scheduler.json"

    def run(self, kills: int) -> None:
        """Kill so often, then finish."""
        driver = self.drive()
        while self.killed.total() < kills:
            time.sleep(self.random.uniform(0.02, MOMENTS[self.engine]))
            if os.waitpid(driver, os.WNOHANG)[0]:
                if self.path.exists():
                    self.path.unlink()  # it was quicker; from the beginning
                driver = self.drive()
                continue
            victim = self.random.choice(VICTIMS[self.engine])
            pid = driver if victim == "driver" else self.find(victim, driver)
            if not pid:
                continue
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
                self.killed[victim] += 1
            self.look()
            if victim == "driver":
                os.waitpid(driver, 0)
                driver = self.drive()
        os.waitpid(driver, 0)
        self.ready()
        print(dict(self.killed), finish(self.path, self.means()).computed)
        for process in self.cluster:
            process.kill()
            process.wait()

    def look(self) -> None:
        """No file of a shard's name is ever anything but whole."""
        for shard in self.path.parent.glob("*.shards/*.h5"):
            with contextlib.suppress(FileNotFoundError):  # finished meanwhile
                if shard.exists():
                    shard_hash(shard)

    def drive(self) -> int:
        """A driver in a process of its own."""
        self.ready()
        pid = os.fork()
        if pid:
            return pid
        code = 1
        with contextlib.suppress(UnfinishedError, UsageError):  # a scheduler may go before it answers
            finish(self.path, self.means())
            code = 0
        os._exit(code)

    def means(self) -> Means:
        """Of this engine."""
        file = self.scheduler_file if self.engine == "dask" else None
        return Means(jobs=2, processes=self.engine == "processes", scheduler_file=file)

    def find(self, victim: str, driver: int) -> int:
        """The process to kill: the scheduler, a worker of Dask, or one of the driver's own."""
        if victim == "scheduler":
            return self.cluster[0].pid
        parents = [process.pid for process in self.cluster[1:]] if self.engine == "dask" else [driver]
        for _ in range(100):  # they take a while to start
            children = [pid for parent in parents for pid in _children(parent)]
            if children:
                return self.random.choice(children)
            time.sleep(0.1)
        return 0

    def ready(self) -> None:
        """The cluster is there, if it takes one."""
        if self.engine != "dask" or (self.cluster and self.cluster[0].poll() is None):
            return
        for process in self.cluster:
            process.kill()
            process.wait()
        self.scheduler_file.unlink(missing_ok=True)
        where = ["--scheduler-file", str(self.scheduler_file), "--no-dashboard"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        program = [sys.executable, "-m"]
        scheduler = [*program, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", *where]
        worker = [*program, "distributed.cli.dask_worker", "--nthreads", "1", "--death-timeout", "5", *where]
        self.cluster = [subprocess.Popen(scheduler, **quiet)]  # type: ignore[call-overload]
        while not self.scheduler_file.exists():
            time.sleep(0.05)
        self.cluster += [subprocess.Popen(worker, **quiet) for _ in range(2)]  # type: ignore[call-overload]


def _children(parent: int) -> list[int]:
    """Processes whose parent is this one."""
    found = []
    for path in Path(f"/proc/{parent}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            found += [int(word) for word in path.read_text().split()]
    return found


if __name__ == "__main__":
    Killer(sys.argv[1], Path(sys.argv[2]), int(sys.argv[4])).run(int(sys.argv[3]))
