"""How result files are opened and written: atomically, self-described, and with clear errors."""

import contextlib
import json
import os
import secrets
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError
from fzcli.record.names import DIMENSIONS, EXTRAS, FORMAT, Name
from fzcli.record.spool import Spool
from fzcli.spec.result import STATUS_NAMES, Provenance

Precision = Literal["f4", "f8"]
FILTERS = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}
CHUNK_BYTES = 1 << 18
TEMPORARY = ".tmp"  # how names of files end that are being written


@contextlib.contextmanager
def create_file(path: Path, kind: str) -> Iterator[h5py.File]:
    """A new HDF5 file that takes the place of ``path`` only once it is whole and on disk.

    Raises:
        RecordError: the file or its folder cannot be written; what stood at ``path`` is untouched.
    """
    with replacing(Path(path)) as stream:
        spool = Spool(stream)
        with h5py.File(spool, "w", track_order=True) as file:
            file.attrs["fzcli_kind"] = kind
            file.attrs["fzcli_format"] = FORMAT
            yield file
        spool.finish()


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A stream into a temporary file beside ``path``, which takes its place in one step when all is on disk.

    Raises:
        RecordError: file or folder cannot be written; what stood at ``path`` is untouched.
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(6)}{TEMPORARY}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("x+b") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
        _flush_folder(path.parent)
    except OSError as error:
        raise RecordError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _flush_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def open_file(path: Path, kind: str | None = None) -> Iterator[h5py.File]:
    """An fzcli result file, open for reading; ``kind`` is "rollout" or "sweep", or None for either.

    Raises:
        RecordError: missing, a folder, not HDF5, truncated, damaged, not written by fzcli, or another kind.
    """
    path = Path(path)
    if path.is_dir():
        raise RecordError(f"{path}: is a folder, not a result file")
    if not path.exists():
        raise RecordError(f"{path}: no such file")
    try:
        if not h5py.is_hdf5(path):
            raise RecordError(f"{path}: not an HDF5 file")
        with h5py.File(path, "r") as file:
            _check_kind(file, path, kind)
            yield file
    except OSError as error:
        text = str(error)
        if "truncated" in text:
            raise RecordError(
                f"{path}: truncated HDF5 file: its end is missing, copy or make it again"
            ) from error
        raise RecordError(f"{path}: cannot be read: {text}") from error
    except (KeyError, json.JSONDecodeError) as error:
        raise RecordError(f"{path}: an fzcli file with a part missing or damaged: {error}") from error


def _check_kind(file: h5py.File, path: Path, kind: str | None) -> None:
    found = file.attrs.get("fzcli_kind")
    if not isinstance(found, str):
        raise RecordError(f"{path}: an HDF5 file, but not one written by fzcli")
    version = int(file.attrs.get("fzcli_format", 0))
    if version > FORMAT:
        raise RecordError(
            f"{path}: written in format {version} by a newer fzcli; this one reads up to {FORMAT}"
        )
    if kind is not None and found != kind:
        raise RecordError(f"{path}: holds a {found}, not a {kind}")


class GroupWriter:
    """Writes the datasets of one group and ties each to the dimension scales of that group."""

    def __init__(self, group: h5py.Group, precision: Precision = "f8") -> None:
        self.group = group
        self.precision = precision
        self._scales: dict[str, h5py.Dataset] = {}

    def subgroup(self, name: str) -> "GroupWriter":
        """A writer for a new group inside this one, with scales of its own."""
        return GroupWriter(self.group.create_group(name, track_order=True), self.precision)

    def has_scale(self, name: str) -> bool:
        """Whether a dimension of this name exists already."""
        return name in self._scales

    def scale(self, name: str, values: Any, about: Name | None = None) -> None:
        """Creates dimension ``name``, labelled by ``values`` (numbers or strings)."""
        about = about or DIMENSIONS[name]
        dataset = self.array(replace(about, name=name, dims=(name,)), values, attach=False)
        dataset.make_scale(name)
        self._scales[name] = dataset

    def array(self, about: Name, values: Any, *, attach: bool = True, **attributes: Any) -> h5py.Dataset:
        """Writes one dataset with its unit, its meaning, further attributes and its dimensions."""
        return self._about(self._create(about.name, values), about, attach, attributes)

    def room(self, about: Name, shape: tuple[int, ...], **attributes: Any) -> h5py.Dataset:
        """A dataset of trajectories, in the file's precision for them, to be filled rows by rows."""
        kind = np.dtype(self.precision)
        if 0 in shape:
            return self._about(self.group.create_dataset(about.name, shape, kind), about, True, attributes)
        chunks = _chunks(shape, kind.itemsize)
        dataset = self.group.create_dataset(about.name, shape, kind, chunks=chunks, fillvalue=np.nan, **FILTERS)
        return self._about(dataset, about, True, attributes)

    def fill(self, dataset: h5py.Dataset, first: int, values: NDArray[Any]) -> None:
        """Writes rows of a dataset that ``room`` made."""
        with np.errstate(over="ignore"):  # a diverged run may leave the range of f4: stored as inf
            dataset[first : first + len(values)] = values.astype(self.precision, copy=False)

    def _about(self, dataset: h5py.Dataset, about: Name, attach: bool, attributes: dict[str, Any]) -> h5py.Dataset:
        dataset.attrs["units"] = about.unit
        dataset.attrs["long_name"] = about.long_name
        for key, value in attributes.items():
            dataset.attrs[key] = value
        for index, dim in enumerate(about.dims):
            dataset.dims[index].label = dim
            if attach:
                dataset.dims[index].attach_scale(self._scales[dim])
        return dataset

    def trajectory(self, about: Name, values: NDArray[Any], **attributes: Any) -> h5py.Dataset:
        """Writes an array in the file's precision for trajectories."""
        with np.errstate(over="ignore"):  # a diverged run may leave the range of f4: stored as inf
            values = values.astype(self.precision, copy=False)
        return self.array(about, values, **attributes)

    def status(self, codes: Any, dims: tuple[str, ...] = ()) -> None:
        """Writes status codes with their meanings."""
        self.array(
            replace(EXTRAS["status"], dims=dims),
            np.asarray(codes, dtype=np.int8),
            flag_values=np.arange(len(STATUS_NAMES), dtype=np.int8),
            flag_meanings=" ".join(STATUS_NAMES),
        )

    def text(self, name: str, values: str | Sequence[str], dims: tuple[str, ...] = ()) -> None:
        """Writes one string, or one per entry of ``dims``."""
        self.array(replace(EXTRAS[name], dims=dims), values)

    def plot(self, signal: str, *axes: str) -> None:
        """Makes ``signal`` over ``axes`` the plot that NeXus readers show first."""
        self.group.attrs["NX_class"] = "NXdata"
        self.group.attrs["default"] = "."
        self.group.attrs["signal"] = signal
        self.group.attrs["axes"] = list(axes)

    def _create(self, name: str, values: Any) -> h5py.Dataset:
        if isinstance(values, str):
            return self.group.create_dataset(name, data=_clean(values), dtype=h5py.string_dtype())
        array = np.asarray(values)
        if array.dtype.kind in "UO":
            texts = np.array([_clean(str(value)) for value in array.ravel()], dtype=object)
            return self.group.create_dataset(name, data=texts.reshape(array.shape), dtype=h5py.string_dtype())
        if array.ndim == 0 or array.size == 0:
            return self.group.create_dataset(name, data=array)
        return self.group.create_dataset(name, data=array, chunks=_chunks(array.shape, array.itemsize), **FILTERS)


def _clean(text: str) -> str:
    """The text without what HDF5 strings cannot hold."""
    return text.replace("\0", "\ufffd").encode("utf-8", "replace").decode("utf-8")


def _chunks(shape: tuple[int, ...], size: int) -> tuple[int, ...]:
    """One chunk a kept run, cut along time (or along the runs) where it would pass CHUNK_BYTES."""
    if len(shape) >= 3:
        return (1, *shape[1:])
    row = max(1, size * int(np.prod(shape[1:])))
    return (min(shape[0], max(1, CHUNK_BYTES // row)), *shape[1:])


def write_provenance(writer: GroupWriter, provenance: Provenance) -> None:
    """Writes where the result comes from: whole in group "provenance", in short as root attributes."""
    root = writer.group.attrs
    root["spec_hash"] = _clean(provenance.spec_hash)
    root["engine"] = _clean(provenance.engine)
    inner = writer.subgroup("provenance")
    for name in ("spec_text", "spec_hash", "engine"):
        inner.text(name, getattr(provenance, name))
    inner.text("versions", json.dumps(dict(provenance.versions)))
    inner.text("argv", json.dumps(list(provenance.argv)))
    if provenance.seed is not None:
        root["seed"] = str(provenance.seed)  # a root seed may be wider than 64 bits
        inner.text("seed", str(provenance.seed))


def read_provenance(file: h5py.File) -> Provenance:
    """Where the result comes from."""
    group = file["provenance"]
    return Provenance(
        spec_text=read_text(group["spec_text"]),
        spec_hash=read_text(group["spec_hash"]),
        engine=read_text(group["engine"]),
        seed=int(read_text(group["seed"])) if "seed" in group else None,
        versions=json.loads(read_text(group["versions"])),
        argv=tuple(json.loads(read_text(group["argv"]))),
    )


def provenance_to_json(provenance: Provenance) -> str:
    """One line of JSON that ``provenance_from_json`` turns back."""
    fields = {**vars(provenance), "versions": dict(provenance.versions), "argv": list(provenance.argv)}
    return json.dumps(fields)


def provenance_from_json(text: str) -> Provenance:
    """The provenance that ``provenance_to_json`` wrote."""
    fields = json.loads(text)
    return Provenance(**{**fields, "argv": tuple(fields["argv"])})


def is_text(dataset: h5py.Dataset) -> bool:
    """Whether the dataset holds strings."""
    return h5py.check_string_dtype(dataset.dtype) is not None


def read_text(dataset: h5py.Dataset) -> str:
    """The text of a single string."""
    return str(dataset.asstr()[()])


def read_texts(dataset: h5py.Dataset) -> tuple[str, ...]:
    """The strings of a one-dimensional dataset."""
    return tuple(str(value) for value in dataset.asstr()[...])


def dimension_names(dataset: h5py.Dataset) -> tuple[str, ...]:
    """Names of the dataset's dimensions."""
    return tuple(str(dim.label) for dim in dataset.dims)


def walk(group: h5py.Group) -> Iterator[h5py.Dataset]:
    """Every dataset of the group and of those below it, in the order they were written."""
    for item in group.values():
        if isinstance(item, h5py.Dataset):
            yield item
        else:
            yield from walk(item)


def is_scale(dataset: h5py.Dataset) -> bool:
    """Whether the dataset is the coordinate of a dimension."""
    return bool(dataset.is_scale)
