"""Progress of a sweep on standard error: a live bar on a terminal, a line every ten seconds elsewhere."""

import sys
import time
from types import TracebackType
from typing import Any, Self

from fzcli.cli.guard import say

EVERY = 10.0  # seconds between lines


class Progress:
    """Takes ``(what, done, total)`` as often as the sweep likes; a context manager."""

    def __init__(self, quiet: bool) -> None:
        self._bar = _bar() if not quiet and sys.stderr.isatty() else None
        self._quiet = quiet
        self._task: Any = None
        self._what = ""
        self._told = self._begun = time.monotonic()

    def __call__(self, what: str, done: int, total: int) -> None:
        if what != self._what:
            self._what, self._begun = what, time.monotonic()
            if self._bar is not None:
                if self._task is not None:
                    self._bar.remove_task(self._task)
                self._task = self._bar.add_task(what, total=total if total > 1 else None)
        if self._bar is not None:
            self._bar.update(self._task, completed=done)
        elif not self._quiet:
            self._line(what, done, total)

    def _line(self, what: str, done: int, total: int) -> None:
        now = time.monotonic()
        if now - self._told < EVERY:
            return
        self._told = now
        seconds = now - self._begun
        if done and total > 1 and seconds > 0:
            left = (total - done) * seconds / done
            say(f"{what}: {done} of {total}, {done / seconds:.0f}/s, {left:.0f} s left")
        else:
            say(f"{what} ...")

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()


def _bar() -> Any:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        ProgressColumn,
        Task,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as RichProgress
    from rich.text import Text

    class Rate(ProgressColumn):
        """Runs a second."""

        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text(f"{speed:,.0f}/s" if speed else "")

    return RichProgress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
