"""The file that a sweep becomes: where it is, whether it is there already, and what happens to one in its place.

NAME.h5 is the sweep that was finished last. The file of another one, with other numbers, is kept beside it as
NAME-1a2b3c4d.h5, after its identity; shards of a sweep under way lie in NAME-1a2b3c4d.shards.
"""

import contextlib
import hashlib
import os
from pathlib import Path

from fzcli.errors import RecordError
from fzcli.loop.file_lock import locked_folder
from fzcli.record.hdf5 import TEMPORARY
from fzcli.record.sweep_file import read_identity, read_table_spec, refers_to_shards, replace_table, write_sweep
from fzcli.record.sweep_record import SweepRecord
from fzcli.record.table_spec import TableSpec
from fzcli.sweep.folder import Folder, begin_folder
from fzcli.sweep.meaning import SHORT, Meaning

MOST_MERGED = 2_000_000_000  # bytes of trajectories that go into the one file


def folder_beside(path: Path, meaning: Meaning) -> Path:
    """Where the shards of a sweep lie whose file will be ``path``."""
    return path.with_name(f"{path.stem}-{meaning.short}.shards")


def aside(path: Path, identity: str) -> Path:
    """Where the file of a sweep is kept when another one takes its place."""
    return path.with_name(f"{path.stem}-{identity[:SHORT]}{path.suffix}")


def finished(path: Path, meaning: Meaning) -> Path | None:
    """The file of this very sweep, if it is finished: ``path``, or where it was set aside."""
    for place in (path, aside(path, meaning.identity)):
        if _identity(place) == meaning.identity:
            return place
    return None


def settle(done: Path, path: Path, meaning: Meaning, table: TableSpec | None) -> None:
    """Let a finished sweep's file say how it is to be shown now, and remove what a killed process left behind."""
    if table != read_table_spec(done):
        replace_table(done, table)
    left = folder_beside(path, meaning)
    if left.is_dir() and not refers_to_shards(done):
        folder = begin_folder(left, meaning, "f4")
        with folder.alone():
            folder.drop()
    _sweep_up(path)


def publish(record: SweepRecord, path: Path, folder: Folder, table: TableSpec | None) -> bool:
    """Write the sweep to ``path``, whole or not at all; gives whether it refers to its shards."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with locked_folder(path.parent):
        _sweep_up(path)
        _set_aside(path, folder.meaning.identity)
        return write_sweep(record, path, folder.precision, table, MOST_MERGED)


def _set_aside(path: Path, identity: str) -> None:
    """A second name for the file of another sweep, before it loses its first."""
    if not path.exists():
        return
    other = _identity(path) or hashlib.sha256(path.read_bytes()).hexdigest()
    if other == identity:
        return
    kept = aside(path, other)
    try:
        with contextlib.suppress(FileExistsError):
            os.link(path, kept)
    except OSError:  # a file system without hard links: a moment without the first name
        os.replace(path, kept)


def _sweep_up(path: Path) -> None:
    """Remove what a killed process was writing in place of this file."""
    for left in path.parent.glob(f".{path.name}.*{TEMPORARY}"):
        left.unlink(missing_ok=True)


def _identity(path: Path) -> str:
    """Of the sweep in a file; empty where there is none."""
    try:
        return read_identity(path)
    except RecordError:
        return ""
