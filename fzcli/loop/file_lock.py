"""Locks of the operating system on files and folders: they end with the process that holds them, however it ends."""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fzcli.errors import FzcliError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


class HeldError(FzcliError):
    """Another process holds the lock; ``holder`` is what it wrote of itself, or empty."""

    def __init__(self, holder: str) -> None:
        super().__init__(f"locked by {holder or 'another process'}")
        self.holder = holder


@contextlib.contextmanager
def locked(path: Path, holder: str = "", shared: bool = False, wait: bool = True) -> Iterator[None]:
    """Hold the lock of the file ``path``, made where there is none; ``holder`` is written into it for others to read.

    A shared lock is compatible with other shared ones. Where the file system knows no locks there is none.
    Raises HeldError without ``wait`` when another process holds it, OSError where the file cannot be made.
    """
    with _opened(path, wait, shared) as descriptor:
        if holder and not shared:
            os.ftruncate(descriptor, 0)
            os.lseek(descriptor, 0, os.SEEK_SET)
            os.write(descriptor, holder.encode())
        yield


@contextlib.contextmanager
def locked_briefly(path: Path) -> Iterator[None]:
    """The same, waiting, by a file that goes with the lock; those who wait for it make it anew.

    On Windows, which removes no open files, it stays.
    """
    with locked(path):
        try:
            yield
        finally:
            if sys.platform != "win32":
                path.unlink(missing_ok=True)


@contextlib.contextmanager
def locked_folder(path: Path) -> Iterator[None]:
    """Hold the lock of a folder, waiting for it; on Windows, which locks no folders, there is none."""
    if fcntl is None:
        yield
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        _take(descriptor, shared=False, wait=True)
        yield
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def _opened(path: Path, wait: bool, shared: bool) -> Iterator[int]:
    """The locked file; a file that another process removed meanwhile is made anew."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            _take(descriptor, shared, wait)
        except HeldError:
            text = Path(path).read_text(encoding="utf-8", errors="replace").strip()
            os.close(descriptor)
            raise HeldError(text) from None
        except BaseException:
            os.close(descriptor)
            raise
        if _is_there(path, descriptor):
            break
        os.close(descriptor)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _is_there(path: Path, descriptor: int) -> bool:
    try:
        found: Any = os.stat(path)
    except FileNotFoundError:
        return False
    return sys.platform == "win32" or os.path.samestat(found, os.fstat(descriptor))


def _take(descriptor: int, shared: bool, wait: bool) -> None:
    if fcntl is None:
        _take_on_windows(descriptor, shared, wait)
        return
    try:
        fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        raise HeldError("") from None
    except OSError:
        return  # a file system without locks: every file is written whole or not at all, so that nothing is lost


def _take_on_windows(descriptor: int, shared: bool, wait: bool) -> None:
    """The byte far behind the text; Windows knows no shared locks here, so that those are not taken."""
    if shared:
        return
    import msvcrt

    os.lseek(descriptor, 1 << 30, os.SEEK_SET)
    mode = msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK  # type: ignore[attr-defined]
    while True:
        try:
            msvcrt.locking(descriptor, mode, 1)  # type: ignore[attr-defined]
        except OSError:
            if wait:
                continue  # it gives up after ten seconds
            raise HeldError("") from None
        break
    os.lseek(descriptor, 0, os.SEEK_SET)
