"""The main program of a worker process: tasks from standard input, answers to standard output."""

import base64
import json
import os
import pickle
import queue
import signal
import sys
import threading
from dataclasses import asdict
from typing import Any

from fzcli.sweep.work import Task, do_at


def serve(folder: str, identity: str) -> None:
    """Answer until the input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever else prints is no answer
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(lines,), daemon=True).start()
    while True:
        fields = json.loads(lines.get())
        task = Task(fields["shard"], tuple(fields["skip"]), tuple(fields["probe"]) if fields["probe"] else None)
        answers.write(json.dumps(_answer(folder, identity, task)) + "\n")
        answers.flush()


def _listen(lines: "queue.SimpleQueue[str]") -> None:
    """Ends the process with its driver, even in the middle of a task."""
    for line in sys.stdin:
        lines.put(line)
    os._exit(0)


def _answer(folder: str, identity: str, task: Task) -> dict[str, Any]:
    try:
        return {"done": asdict(do_at(folder, identity, task))}
    except Exception as error:
        try:
            packed = base64.b64encode(pickle.dumps(error)).decode()
            pickle.loads(base64.b64decode(packed))
        except Exception:  # an exception that cannot travel goes as its text
            packed = ""
        return {"error": packed, "text": f"{type(error).__name__}: {error}"}


if __name__ == "__main__":
    serve(*sys.argv[1:3])
