"""Signals during a sweep: the first lets the shards in flight finish, the second ends at once."""

import contextlib
import signal
from collections.abc import Iterator
from types import FrameType

from fzcli.cli.guard import received, say


class Stop:
    """Called, whether to begin nothing new."""

    def __init__(self) -> None:
        self.asked = False

    def __call__(self) -> bool:
        return self.asked


@contextlib.contextmanager
def gentle_stop() -> Iterator[Stop]:
    """A stop sign that SIGINT and SIGTERM set while the context lasts; a second signal unwinds the stack as ever."""
    stop = Stop()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def heard(number: int, frame: FrameType | None) -> None:
        if stop.asked:
            received.append(number)
            if number == signal.SIGINT:
                raise KeyboardInterrupt
            raise SystemExit(128 + number)
        stop.asked = True
        say("finishing the shards in flight; once more to stop at once")

    for number in before:
        signal.signal(number, heard)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
