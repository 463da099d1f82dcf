"""One shard of a sweep as a file: an HDF5 file behind a block that holds the hash of all the rest.

It is written to a temporary name, flushed and renamed: a file of a shard's name is whole. Every byte counts in the
hash, so that any damage is found. Metrics are one table (names, rows), for a shard is read by the sweep, not by people.
"""

import hashlib
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5s, h5t
from numpy.typing import NDArray

from fzcli.errors import RecordError
from fzcli.record.hdf5 import GroupWriter, Precision, replacing
from fzcli.record.kept import read_kept, write_kept
from fzcli.record.sweep_record import KeptRun
from fzcli.spec.quantity import Signal
from fzcli.spec.result import Provenance

Array = NDArray[np.float64]
BLOCK = 512  # bytes before the HDF5 file: its user block
_MARK = "fzcli shard 1 sha256 "


@dataclass(frozen=True)
class Shard:
    """What was computed of a shard. Rows: all its trajectories for the first configuration, then for the next.

    ``columns``: name -> (rows); ``status`` (rows); ``draws``: dotted path -> (trajectories, k); ``candidates``
    (trajectories): how many were tried. ``crashed``: rows that killed their worker. ``kept``: runs with trajectories;
    of a shard that was read there is only their number, ``kept_count``.
    """

    identity: str
    index: int
    columns: Mapping[str, Array]
    status: NDArray[np.int8]
    info: Mapping[str, Signal]
    certificate_names: tuple[str, ...]
    draws: Mapping[str, Array]
    candidates: NDArray[np.int64]
    versions: Mapping[str, str]
    crashed: tuple[int, ...] = ()
    kept: Sequence[KeptRun] = field(default=())
    kept_count: int = 0


def write_shard(shard: Shard, path: Path, precision: Precision, origin: Provenance | None = None) -> str:
    """Writes a shard whole or not at all, into a folder that must be there; gives its hash.

    Raises:
        RecordError: it cannot be written.
    """
    image = _image(shard, precision, origin)
    digest = hashlib.sha256(image).hexdigest()
    if not path.parent.is_dir():
        raise RecordError(f"{path}: cannot be written: its folder is gone")
    with replacing(path) as stream:
        stream.write(_block(digest))
        stream.write(image)
    return digest


def shard_bytes(shard: Shard, precision: Precision, origin: Provenance | None = None) -> int:
    """How large the file of a shard is."""
    return BLOCK + len(_image(shard, precision, origin))


def shard_hash(path: Path) -> str:
    """The hash of a shard's content, which is checked.

    Raises:
        RecordError: missing, cut short, or changed since it was written.
    """
    return _checked(path)[0]


def read_shard(path: Path, identity: str | None = None, index: int | None = None) -> Shard:
    """A shard without its kept runs.

    Raises:
        RecordError: missing, cut short, changed since it was written, or of another sweep or place.
    """
    with h5py.File(io.BytesIO(_checked(path)[1]), "r") as file:
        header = json.loads(file["header"][...].tobytes())
        if identity is not None and (header["identity"], header["index"]) != (identity, index):
            raise RecordError(f"{path}: is a shard of another sweep, or another shard of this one")
        table = file["columns"][...]
        return Shard(
            identity=header["identity"],
            index=header["index"],
            columns=dict(zip(header["columns"], table, strict=True)),
            status=file["status"][...],
            info={name: _signal(name, told) for name, told in header["info"].items()},
            certificate_names=tuple(header["certificate"]),
            draws={name: dataset[...] for name, dataset in file["draws"].items()},
            candidates=file["candidates"][...],
            versions=header["versions"],
            crashed=tuple(header["crashed"]),
            kept_count=header["kept"],
        )


def read_kept_of(path: Path, origin: Provenance, digest: str | None = None) -> tuple[KeptRun, ...]:
    """The runs that a shard keeps; ``digest``: the hash that it must have.

    Raises:
        RecordError: missing, changed since it was written, or not the one with that hash.
    """
    found, data = _checked(path)
    if digest not in (None, found):
        raise RecordError(f"{path}: is not the shard that was written with this sweep")
    with h5py.File(io.BytesIO(data), "r") as file:
        return read_kept(file["kept"], origin) if "kept" in file else ()


def _image(shard: Shard, precision: Precision, origin: Provenance | None) -> bytes:
    header = {
        "identity": shard.identity,
        "index": shard.index,
        "columns": list(shard.columns),
        "info": {name: [one.unit, one.long_name, one.truth] for name, one in shard.info.items()},
        "certificate": list(shard.certificate_names),
        "versions": dict(shard.versions),
        "crashed": list(shard.crashed),
        "kept": len(shard.kept),
    }
    in_memory: dict[str, Any] = {"driver": "core", "backing_store": False, "block_size": 1 << 18}
    name = f"{shard.index}-{id(shard)}"  # no file, but no two of a name may be open at a time
    with h5py.File(name, "w", track_order=True, libver="latest", **in_memory) as file:
        _put(file, "header", np.frombuffer(json.dumps(header).encode(), dtype=np.uint8))
        table = np.array(list(shard.columns.values()), dtype=np.float64)
        _put(file, "columns", table.reshape(len(shard.columns), -1))
        _put(file, "status", np.asarray(shard.status, dtype=np.int8))
        _put(file, "candidates", np.asarray(shard.candidates, dtype=np.int64))
        draws = file.create_group("draws", track_order=True)
        for path, values in shard.draws.items():
            _put(draws, path, values)
        if shard.kept and origin is not None:
            write_kept(GroupWriter(file, precision).subgroup("kept"), shard.kept, origin)
        file.flush()
        return bytes(file.id.get_file_image())


def _put(group: h5py.Group, name: str, values: NDArray[Any]) -> None:
    """A dataset by HDF5's own calls: h5py's take longer than all else that is done to write a shard."""
    space = h5s.create_simple(values.shape)
    dataset = h5d.create(group.id, name.encode(), h5t.py_create(values.dtype), space)
    dataset.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(values))


def _block(digest: str) -> bytes:
    return f"{_MARK}{digest}\n".encode().ljust(BLOCK, b"\0")


def _checked(path: Path) -> tuple[str, bytes]:
    """Hash and bytes of a shard that is what was written."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror or error}") from error
    digest = hashlib.sha256(data[BLOCK:]).hexdigest()
    if data[:BLOCK] != _block(digest):
        raise RecordError(f"{path}: damaged: its content is not what its hash says")
    return digest, data


def _signal(name: str, told: Sequence[Any]) -> Signal:
    unit, long_name, truth = told
    return Signal(name, unit, long_name, truth=bool(truth))
