"""A file that takes whatever is written, for a library that cannot bear a write that fails."""

import io
import os
from typing import Any, BinaryIO


class Spool(io.RawIOBase):
    """A file for the HDF5 library whose writes never fail before ``finish``.

    The library can crash the process when a write fails, as on a full disk. Here what a disk does not take is held
    in memory, so that the library can end in order, and the first error is told by ``check`` and ``finish``.
    """

    def __init__(self, stream: BinaryIO) -> None:
        super().__init__()
        self._stream = stream
        self._place = self._end = 0
        self._error: OSError | None = None
        self._untaken: list[tuple[int, bytes]] = []

    def check(self) -> None:
        """Raises OSError when a write has failed so far."""
        if self._error is not None:
            raise self._error

    def finish(self) -> None:
        """Everything to the disk. Raises OSError when a write failed."""
        self.check()
        self._stream.truncate(self._end)
        self._stream.flush()

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._place

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._place = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._end}[whence] + offset
        return self._place

    def truncate(self, size: int | None = None) -> int:
        self._end = self._place if size is None else size
        return self._end

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        count = max(0, min(len(view), self._end - self._place))
        self._stream.seek(self._place)
        found = self._stream.read(count)
        view[:count] = found.ljust(count, b"\0")
        for start, data in self._untaken:
            first, last = max(start, self._place), min(start + len(data), self._place + count)
            if first < last:
                view[first - self._place : last - self._place] = data[first - start : last - start]
        self._place += count
        return count

    def write(self, data: Any) -> int:
        view = memoryview(data).cast("B")
        try:
            self.check()
            self._stream.seek(self._place)
            self._stream.write(view)
            self._stream.flush()
        except OSError as error:
            self._error = self._error or error
            self._untaken.append((self._place, bytes(view)))
        self._place += len(view)
        self._end = max(self._end, self._place)
        return len(view)
