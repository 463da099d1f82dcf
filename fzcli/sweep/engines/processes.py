"""Processes of this machine, each its own interpreter: for work that holds Python's lock, and for runs that crash.

A process reads tasks, a line of JSON each, and answers in lines. When its driver ends, however it ends, its input
closes and it ends too.
"""

import base64
import contextlib
import json
import os
import pickle
import queue
import subprocess
import sys
import threading
from dataclasses import asdict
from pathlib import Path

from fzcli.errors import EngineError
from fzcli.sweep.engines.pool import Died, Outcome
from fzcli.sweep.work import Done, Task

_Answer = tuple["_Process", str | None]


class _Process:
    """One worker, and the task it is at."""

    def __init__(self, folder: Path, identity: str, answers: "queue.SimpleQueue[_Answer]") -> None:
        command = [sys.executable, "-m", "fzcli.sweep.engines.serve", str(folder.resolve()), identity]
        paths = os.pathsep.join(path for path in sys.path if path)
        self.task: Task | None = None
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": paths},
            start_new_session=True,  # Ctrl-C in the terminal is for the driver
        )
        self._listener = threading.Thread(target=self._listen, args=(answers,), daemon=True)
        self._listener.start()

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    def give(self, task: Task) -> None:
        """Hand over a task; a process that is gone will be heard of."""
        self.task = task
        try:
            if self._process.stdin:
                self._process.stdin.write(json.dumps(asdict(task)) + "\n")
                self._process.stdin.flush()
        except OSError:  # a broken pipe
            self._process.kill()

    def end(self) -> str:
        """At once; gives how it ended, in words, where it had ended by itself."""
        self._process.kill()
        code = self._process.wait()
        self._listener.join()
        for stream in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                if stream:
                    stream.close()
        return f"signal {-code}" if code < 0 else f"exit code {code}"

    def _listen(self, answers: "queue.SimpleQueue[_Answer]") -> None:
        if self._process.stdout:
            for line in self._process.stdout:
                answers.put((self, line))
        answers.put((self, None))


class Processes:
    """``jobs`` processes on the shards of one folder; one that dies is replaced."""

    def __init__(self, folder: Path, identity: str, jobs: int) -> None:
        self.window = jobs
        self._folder, self._identity = folder, identity
        self._answers: queue.SimpleQueue[_Answer] = queue.SimpleQueue()
        self._workers: list[_Process] = []

    @property
    def pids(self) -> list[int]:
        """Of the workers."""
        return [worker.pid for worker in self._workers]

    def submit(self, task: Task) -> None:
        """See `Pool`."""
        idle = next((worker for worker in self._workers if worker.task is None), None)
        if idle is None:
            idle = _Process(self._folder, self._identity, self._answers)
            self._workers.append(idle)
        idle.give(task)

    def wait(self, seconds: float) -> list[tuple[Task, Outcome]]:
        """See `Pool`."""
        try:
            worker, line = self._answers.get(timeout=seconds)
        except queue.Empty:
            return []
        task, worker.task = worker.task, None
        if line is not None:
            return [] if task is None else [(task, _outcome(line))]
        if worker in self._workers:
            self._workers.remove(worker)
        ending = worker.end()
        return [] if task is None else [(task, Died(ending))]

    def progress(self) -> int:
        """See `Pool`."""
        return 0

    def close(self, wait: bool) -> None:
        """See `Pool`."""
        for worker in self._workers:
            worker.end()
        self._workers.clear()


def _outcome(line: str) -> Outcome:
    answer = json.loads(line)
    if "done" in answer:
        return Done(**answer["done"])
    error = pickle.loads(base64.b64decode(answer["error"])) if answer["error"] else None  # of our own process
    return error if isinstance(error, Exception) else EngineError(answer["text"])
