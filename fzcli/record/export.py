"""Any dataset of a result file as named columns, and those as csv, jsonl or npy."""

import csv
import io
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError, UsageError
from fzcli.record.columns import column_datasets, labels_of
from fzcli.record.hdf5 import dimension_names, is_scale, is_text, open_file, read_texts, walk
from fzcli.record.sweep_file import config_column, metric_names, read_configs
from fzcli.spec.nearest import hint

Format = Literal["csv", "jsonl", "npy"]
_GROUPS = ("metrics", "signals", "kept", "variants", "certificate", "configs", "draws", "provenance")
_BLOCK = 10_000  # rows turned into text at a time


@dataclass(frozen=True)
class Columns:
    """Named columns of one length; ``units`` is "" for text."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    arrays: tuple[NDArray[Any], ...]

    def __len__(self) -> int:
        return len(self.arrays[0]) if self.arrays else 0

    def rows(self) -> Iterator[tuple[Any, ...]]:
        """Row by row, as plain Python values."""
        for start in range(0, len(self), _BLOCK):
            yield from zip(
                *(_plain_values(array[start : start + _BLOCK]) for array in self.arrays), strict=True
            )


def _plain_values(array: NDArray[Any]) -> list[Any]:
    """Python values; those of f4 as the shortest decimals that read back to the same f4."""
    if array.dtype == np.float32:
        array = array.astype(str).astype(np.float64)
    values: list[Any] = array.tolist()
    return values


class _Collector:
    """Collects columns, each name once."""

    def __init__(self) -> None:
        self._columns: dict[str, tuple[str, NDArray[Any]]] = {}

    def add(self, name: str, unit: str, values: NDArray[Any]) -> None:
        self._columns.setdefault(name, (unit, values))

    def add_table(self, name: str, unit: str, values: NDArray[Any], labels: tuple[str, ...]) -> None:
        """A column, or one per label where the values have a second axis."""
        if values.ndim == 1 or (values.shape[1] == 1 and not labels):
            self.add(name, unit, values.reshape(len(values)))
            return
        for index in range(values.shape[1]):
            label = labels[index] if labels else str(index)
            self.add(f"{name}.{label}", unit, values[:, index])

    def columns(self) -> Columns:
        return Columns(
            tuple(self._columns),
            tuple(unit for unit, _ in self._columns.values()),
            tuple(values for _, values in self._columns.values()),
        )


def get(path: Path | str, name: str) -> Columns:
    """Columns of the dataset ``name``, or of all datasets of a group, with what indexes them first.

    Series over time come with ``time`` (kept runs of a sweep: with kept, config, trajectory and time,
    their padding cut off); a sweep's metrics with run, config, trajectory and the configuration's
    values. "metrics/tip_error_mean" and "tip_error_mean", "signals/gain" and "gain" mean the same.

    Raises:
        RecordError: the file is not a result, or has nothing of this name (the nearest are offered).
    """
    with open_file(Path(path)) as file:
        found = _find(file, name.strip("/"))
        if found is None:
            raise RecordError(f"{path}: has no {name!r}{hint(name, available(file))}")
        return found.columns()


def names(path: Path | str) -> list[str]:
    """Every name that ``get`` knows in a file, the short ones first.

    Raises:
        RecordError: the file is not a result.
    """
    with open_file(Path(path)) as file:
        return available(file)


def available(file: h5py.File) -> list[str]:
    """Names that ``get`` knows in this file, the short ones first."""
    names = [item.name[1:] for item in walk(file)]
    own = [name for name in names if "/" not in name]
    series = [
        name.removeprefix("kept/") for name in names if name.startswith("kept/") and name.count("/") == 1
    ]
    return list(dict.fromkeys([*own, *series, *_aliases(file), *names]))


def _aliases(file: h5py.File) -> list[str]:
    groups = [name for name in _GROUPS if name in file]
    if file.attrs["fzcli_kind"] == "sweep":
        return ["metrics", *groups]
    return ["signals", *groups]


def _find(file: h5py.File, name: str) -> _Collector | None:
    collector = _Collector()
    search = _sweep if file.attrs["fzcli_kind"] == "sweep" else _rollout
    return collector if search(file, name, collector) else None


def _rollout(file: h5py.File, name: str, collector: _Collector) -> bool:
    if name.startswith("variants/") and "variants" in file:
        return _variants(file, name.removeprefix("variants/"), collector)
    series = {dataset.name.lstrip("/"): dataset for dataset in column_datasets(file)}
    signals = {key: dataset for key, dataset in series.items() if dataset.attrs["is_signal"]}
    if name == "signals" and signals:
        chosen = signals
    elif name.startswith("signals/"):
        chosen = {key: item for key, item in signals.items() if key == name.removeprefix("signals/")}
    else:
        chosen = {key: item for key, item in series.items() if key == name}
    if not chosen:
        return _plain(file, name, collector)
    collector.add("time", "s", file["time"][...])
    for key, dataset in chosen.items():
        collector.add_table(key, dataset.attrs["units"], dataset[...], labels_of(file, dataset))
    return True


def _variants(file: h5py.File, name: str, collector: _Collector) -> bool:
    """One array of the variants, or of the metrics and certificate, variant after variant."""
    group = file["variants"]
    if _kept(group, name, collector, ("role",)):
        return True
    return _plain(file, f"variants/{name}", collector)


def _sweep(file: h5py.File, name: str, collector: _Collector) -> bool:
    metrics = metric_names(file)
    short = name.removeprefix("metrics/")
    chosen = metrics if name == "metrics" else [short] if short in metrics else []
    if not chosen:
        short = name.removeprefix("kept/").removeprefix("signals/")
        if "kept" in file and _kept(file["kept"], short, collector):
            return True
        return _plain(file, name, collector)
    collector.add("run", "1", file["run"][...])
    configs = read_configs(file)
    config = file["config"][...]
    for key in ("config", "trajectory"):
        collector.add(key, "1", file[key][...])
    for path in dict.fromkeys(path for one in configs for path in one):
        collector.add(path, "", config_column([one.get(path) for one in configs])[config])
    for key in chosen:
        collector.add(key, file[key].attrs["units"], file[key][...])
    return True


def _kept(
    group: h5py.Group,
    name: str,
    collector: _Collector,
    labels: tuple[str, ...] = ("kept", "config", "trajectory"),
) -> bool:
    """One array of the kept runs, run after run, with ``labels`` that tell the runs apart."""
    dataset = next((item for item in column_datasets(group) if item.name.rsplit("/", 1)[-1] == name), None)
    if dataset is None:
        return False
    lengths = group["n_steps"][...]
    inside = np.arange(dataset.shape[1]) < lengths[:, None]
    for key in labels:
        collector.add(key, group[key].attrs["units"], np.repeat(_values(group[key]), lengths))
    time = group["time"][...]
    collector.add("time", "s", np.broadcast_to(time, inside.shape)[inside])
    collector.add_table(name, dataset.attrs["units"], dataset[...][inside], labels_of(group, dataset))
    return True


def _plain(file: h5py.File, name: str, collector: _Collector) -> bool:
    """A dataset, or the datasets of a group, with the coordinate of their first dimension."""
    if not name:
        return False
    item = file.get(name)
    if item is None:
        item = next((file[f"{group}/{name}"] for group in _GROUPS if f"{group}/{name}" in file), None)
    if item is None:
        return False
    group = item.parent if isinstance(item, h5py.Dataset) else item
    chosen = [item] if isinstance(item, h5py.Dataset) else [one for one in item.values() if _listed(one)]
    for dataset in chosen:
        for dim in dimension_names(dataset)[:1]:
            if dim in group:
                collector.add(dim, group[dim].attrs["units"], _values(group[dim]))
        key = dataset.name.rsplit("/", 1)[-1]
        collector.add_table(key, dataset.attrs["units"], _values(dataset), labels_of(group, dataset))
    return bool(chosen)


def _listed(item: h5py.Dataset | h5py.Group) -> bool:
    """Whether a group's listing has it: labels and numbers, not coordinates, series or JSON."""
    if not isinstance(item, h5py.Dataset) or is_scale(item) or "quantity" in item.attrs:
        return False
    return item.ndim <= 2 and not item.name.endswith("_json")


def _values(dataset: h5py.Dataset) -> NDArray[Any]:
    if is_text(dataset):
        if dataset.ndim == 0:
            return np.array([str(dataset.asstr()[()])], dtype=object)
        return np.array(read_texts(dataset), dtype=object)
    return np.atleast_1d(np.asarray(dataset[()]))


def write_csv(columns: Columns, stream: BinaryIO) -> None:
    """Comma-separated, names in the first line; numbers read back exactly."""
    _write_text(columns, stream, csv_head(columns.names), _csv_block)


def csv_head(names: tuple[str, ...]) -> str:
    """The first line of a csv file."""
    return _csv_block(names, [names])


def _csv_block(names: tuple[str, ...], rows: list[tuple[Any, ...]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def write_jsonl(columns: Columns, stream: BinaryIO) -> None:
    """One JSON object a line; null where a number is not finite."""
    _write_text(columns, stream, "", _json_block)


def _json_block(names: tuple[str, ...], rows: list[tuple[Any, ...]]) -> str:
    return "".join(
        json.dumps(dict(zip(names, map(_json_value, row), strict=True)), ensure_ascii=False) + "\n"
        for row in rows
    )


def _json_value(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _write_text(
    columns: Columns,
    stream: BinaryIO,
    head: str,
    block: Callable[[tuple[str, ...], list[tuple[Any, ...]]], str],
) -> None:
    stream.write(head.encode())
    rows: list[tuple[Any, ...]] = []
    for row in columns.rows():
        rows.append(row)
        if len(rows) == _BLOCK:
            stream.write(block(columns.names, rows).encode())
            rows.clear()
    stream.write(block(columns.names, rows).encode())


def write_npy(columns: Columns, stream: BinaryIO) -> None:
    """NumPy's own format: a structured array with a field a column."""
    arrays = [array.astype(str) if array.dtype.kind == "O" else array for array in columns.arrays]
    fields = [(name, array.dtype) for name, array in zip(columns.names, arrays, strict=True)]
    table = np.empty(len(columns), dtype=fields)
    for name, array in zip(columns.names, arrays, strict=True):
        table[name] = array
    np.lib.format.write_array(stream, table, allow_pickle=False)


WRITERS: dict[str, Callable[[Columns, BinaryIO], None]] = {
    "csv": write_csv,
    "jsonl": write_jsonl,
    "npy": write_npy,
}


def write_columns(columns: Columns, stream: BinaryIO, format: str = "csv") -> None:
    """Writes the columns as csv, jsonl or npy.

    Raises:
        UsageError: the format is unknown.
    """
    if format not in WRITERS:
        raise UsageError(f"format {format!r}: expected one of {', '.join(WRITERS)}")
    WRITERS[format](columns, stream)
