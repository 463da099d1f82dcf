"""The folder of a sweep under way: its meaning, one file a shard, and a lock. The truth lies in the shards alone.

A shard is written whole or not at all, and carries the identity of its sweep, its place and the hash of its content.
Nothing else is needed to go on: what is missing or damaged is computed, in any order, by anyone.
"""

import contextlib
import errno
import json
import os
import shutil
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from fzcli.errors import RecordError, UnfinishedError, UsageError
from fzcli.loop.file_lock import HeldError, locked
from fzcli.loop.versions import versions
from fzcli.record.hdf5 import TEMPORARY, Precision, replacing
from fzcli.record.shard_file import read_shard
from fzcli.sweep.layout import Layout, layout_of
from fzcli.sweep.meaning import AnySweep, Meaning, sweep_of

MEANING, LOCK = "sweep.json", "lock"
DECISIVE = ("fzcli", "casadi")  # whose versions the bits of a result may hang on
Say = Callable[[str], None]


@dataclass(frozen=True)
class Folder:
    """A folder of shards at ``path``; ``precision``: of the trajectories in them."""

    path: Path
    meaning: Meaning
    precision: Precision

    @cached_property
    def sweep(self) -> AnySweep:
        """The sweep, from its meaning alone."""
        return sweep_of(self.meaning)

    @cached_property
    def layout(self) -> Layout:
        """How it is parted."""
        return layout_of(self.sweep)

    def shard(self, index: int) -> Path:
        """The file of a shard."""
        return self.path / f"{index:07d}.h5"

    def present(self) -> int:
        """Shards that are there, without a look inside."""
        return sum(self.shard(index).exists() for index in range(self.layout.shards))

    def missing(self, say: Say) -> Iterator[int]:
        """Shards that are to be computed; of those that are there but do not count, ``say`` tells why."""
        for index in range(self.layout.shards):
            wrong = self.fault(index)
            if wrong is None:
                continue
            if wrong:
                say(f"{wrong}; computed again")
            yield index

    def fault(self, index: int) -> str | None:
        """Why a shard does not count: empty where it is not there, None where it counts."""
        if not self.shard(index).exists():
            return ""
        try:
            found = read_shard(self.shard(index), self.meaning.identity, index)
        except RecordError as error:
            return str(error)
        if len(found.status) != self.layout.piece(index).runs:
            return f"{self.shard(index)}: made by an fzcli that parts sweeps otherwise"
        now = versions()
        for name in DECISIVE:
            if found.versions[name] != now[name]:
                return f"{self.shard(index)}: made by {name} {found.versions[name]}, this is {now[name]}"
        return None

    def clean(self) -> None:
        """Remove what a killed process was writing. Only with the lock held."""
        for path in self.path.glob(f".*{TEMPORARY}"):
            path.unlink(missing_ok=True)

    def drop(self) -> None:
        """Remove the folder; a process that was believed dead may still put a file into it, hence the tries."""
        for _ in range(5):
            shutil.rmtree(self.path, ignore_errors=True)
            if not self.path.exists():
                return
            time.sleep(0.05)

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Hold the whole sweep, so that no other driver or part works on it.

        Raises UsageError that says who does.
        """
        with self._locked(self.path / LOCK, shared=False):
            yield

    @contextlib.contextmanager
    def beside(self, part: str) -> Iterator[None]:
        """Hold one part of it, beside others that hold other parts.

        Raises UsageError that says who holds it, or the whole.
        """
        with self._locked(self.path / LOCK, shared=True), self._locked(self.path / f"{part}.{LOCK}", shared=False):
            yield

    def holders(self) -> list[str]:
        """Who works on the sweep now, as they put it."""
        found: list[str] = []
        for path in sorted(self.path.glob(f"*{LOCK}")):
            try:
                with locked(path, wait=False):
                    pass
            except HeldError as error:
                if path.name != LOCK or not found:
                    found.append(error.holder)
        parts = [holder for holder in found if holder]
        return parts or (["another process"] if found else [])

    @contextlib.contextmanager
    def _locked(self, path: Path, shared: bool) -> Iterator[None]:
        with contextlib.ExitStack() as stack:
            try:
                with _full_disk_passes(path):
                    stack.enter_context(locked(path, myself(), shared, wait=False))
            except HeldError as error:
                holder = error.holder if shared or path.name != LOCK else "; ".join(self.holders())
                text = f"{self.path}: {holder or 'another process'} works on this sweep; wait for it, or end it"
                raise UsageError(text) from None
            except OSError as error:
                raise RecordError(f"{path}: cannot be written: {error.strerror or error}") from error
            yield


def myself() -> str:
    """This process, for those who wait for it."""
    return f"process {os.getpid()} on {socket.gethostname()}, at work since {time.strftime('%Y-%m-%d %H:%M:%S')},"


def open_folder(path: Path) -> Folder:
    """The folder of a sweep under way. Raises RecordError where it is none."""
    try:
        text = (path / MEANING).read_text(encoding="utf-8")
        precision: Precision = json.loads(text).get("precision", "f4") if text else "f4"
    except (OSError, ValueError, AttributeError):
        raise RecordError(f"{path}: is not the folder of a sweep under way (no readable {MEANING} in it)") from None
    data = json.loads(text)
    data.pop("precision", None)
    return Folder(path, Meaning.from_json(json.dumps(data), str(path / MEANING)), precision)


def begin_folder(path: Path, meaning: Meaning, precision: Precision) -> Folder:
    """The folder of a sweep, made where there is none.

    Raises RecordError where it cannot be, UnfinishedError on a full disk.
    """
    folder = Folder(path, meaning, precision)
    try:
        with _full_disk_passes(path):
            path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordError(f"{path}: cannot be made: {error.strerror or error}") from error
    text = json.dumps({**json.loads(meaning.to_json()), "precision": precision})
    with contextlib.suppress(OSError):
        if (path / MEANING).read_text(encoding="utf-8") == text:
            return folder
    with _full_disk_passes(path / MEANING), replacing(path / MEANING) as stream:
        stream.write(text.encode())
    return folder


@contextlib.contextmanager
def _full_disk_passes(path: Path) -> Iterator[None]:
    """Where there is no room to begin, the same command goes on later; any other error is raised as it is."""
    try:
        yield
    except (OSError, RecordError) as error:
        cause = error.__cause__ if isinstance(error, RecordError) else error
        if isinstance(cause, OSError) and cause.errno in (errno.ENOSPC, errno.EDQUOT):
            text = f"nothing could be begun: {path}: cannot be written: {cause.strerror}"
            raise UnfinishedError(text) from error
        raise
