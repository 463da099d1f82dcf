"""Kept runs that are read when they are asked for: all of a file at once, or those of one shard at a time."""

from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import overload

from fzcli.errors import RecordError
from fzcli.record.shard_file import read_kept_of, shard_hash
from fzcli.record.sweep_record import KeptRun
from fzcli.spec.result import Provenance


class KeptInFile(Sequence[KeptRun]):
    """``count`` runs of a sweep's file, all read by ``read`` when one is asked for."""

    def __init__(self, count: int, read: Callable[[], tuple[KeptRun, ...]]) -> None:
        self._count, self._read = count, read

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> KeptRun: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[KeptRun]: ...
    def __getitem__(self, index: int | slice) -> KeptRun | Sequence[KeptRun]:
        return self._runs[index]

    @cached_property
    def _runs(self) -> tuple[KeptRun, ...]:
        return self._read()


class KeptInShards(Sequence[KeptRun]):
    """Runs in ``files``, with the hash that each file must have and how many runs it keeps.

    Reading one raises RecordError where its file is missing or is not the one that was written.
    """

    def __init__(self, files: Sequence[tuple[Path, str, int]], origin: Provenance) -> None:
        self.files = tuple(files)
        self._origin = origin
        self._held: tuple[int, tuple[KeptRun, ...]] = (-1, ())

    @staticmethod
    def of(files: Sequence[tuple[Path, int]], origin: Provenance) -> "KeptInShards":
        """Files as they are now, and how many runs each keeps."""
        return KeptInShards([(path, shard_hash(path), count) for path, count in files], origin)

    @property
    def bytes(self) -> int:
        """Of the files."""
        return sum(path.stat().st_size for path, _, _ in self.files)

    def __len__(self) -> int:
        return sum(count for _, _, count in self.files)

    @overload
    def __getitem__(self, index: int) -> KeptRun: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[KeptRun]: ...
    def __getitem__(self, index: int | slice) -> KeptRun | Sequence[KeptRun]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        left = index + len(self) if index < 0 else index
        for number, (_, _, count) in enumerate(self.files):
            if 0 <= left < count:
                return self._runs(number)[left]
            left -= count
        raise IndexError(index)

    def _runs(self, number: int) -> tuple[KeptRun, ...]:
        if self._held[0] != number:
            path, digest, count = self.files[number]
            runs = read_kept_of(path, self._origin, digest)
            if len(runs) != count:
                raise RecordError(f"{path}: keeps {len(runs)} runs, not {count}")
            self._held = (number, runs)
        return self._held[1]
