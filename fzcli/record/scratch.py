"""Columns too many to hold: filled a piece at a time in a nameless file, read one at a time."""

import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError

Array = NDArray[np.float64]
BLOCK = 1 << 17  # numbers written at a time


class Scratch:
    """Columns of ``rows`` numbers (or rows of k numbers), NaN where nothing was put. A context manager.

    The file has no name, so that nothing is left of it however the process ends.
    Raises RecordError where the disk takes no more.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file: Any = None
        self._begins: dict[str, tuple[int, tuple[int, ...]]] = {}
        self._end = 0

    def __enter__(self) -> Self:
        self._file = tempfile.TemporaryFile(dir=self._folder, buffering=0)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    @property
    def names(self) -> list[str]:
        """Of the columns so far, in the order of their first numbers."""
        return list(self._begins)

    def put(self, name: str, rows: int, first: int, values: Array) -> None:
        """Put ``values`` from row ``first`` on; a column is made with its first numbers."""
        values = np.ascontiguousarray(values, dtype=np.float64)
        if name not in self._begins:
            shape = (rows, *values.shape[1:])
            self._begins[name] = (self._end, shape)
            self._fill(int(np.prod(shape)))
        begin, shape = self._begins[name]
        self._write(begin + 8 * first * int(np.prod(shape[1:])), values)

    def column(self, name: str) -> Array:
        """A whole column, (rows) or (rows, k)."""
        begin, shape = self._begins[name]
        self._file.seek(begin)
        return np.fromfile(self._file, dtype=np.float64, count=int(np.prod(shape))).reshape(shape)

    def _fill(self, count: int) -> None:
        for start in range(0, count, BLOCK):
            self._write(self._end, np.full(min(BLOCK, count - start), np.nan))
            self._end += 8 * min(BLOCK, count - start)

    def _write(self, place: int, values: Array) -> None:
        try:
            self._file.seek(place)
            left = memoryview(values.view(np.uint8).data).cast("B")
            while left.nbytes:
                left = left[self._file.write(left) :]
        except OSError as error:
            raise RecordError(f"{self._folder}: cannot be written: {error.strerror or error}") from error


class Columns(Mapping[str, NDArray[Any]]):
    """Columns by name, each made when it is asked for and held by nobody."""

    def __init__(self, makers: Mapping[str, Any]) -> None:
        self._makers = dict(makers)

    def __getitem__(self, name: str) -> NDArray[Any]:
        found: NDArray[Any] = self._makers[name]()
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)
