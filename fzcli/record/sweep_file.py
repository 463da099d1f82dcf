"""A sweep as an HDF5 file: metrics at the root; groups configs, draws, kept and provenance.

The root and every group open by themselves in xarray; configurations and draws are tied to the
rows of the root by the columns ``config`` and ``trajectory``.
"""

import io
import json
import math
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError
from fzcli.record.columns import read_signal
from fzcli.record.hdf5 import (
    GroupWriter,
    Precision,
    create_file,
    open_file,
    read_provenance,
    read_text,
    read_texts,
    replacing,
    walk,
    write_provenance,
)
from fzcli.record.kept import read_kept, write_kept
from fzcli.record.kept_in_files import KeptInFile, KeptInShards
from fzcli.record.names import EXTRAS, INDEX_COLUMNS, Name, signal_of
from fzcli.record.scratch import Columns
from fzcli.record.shard_file import shard_hash
from fzcli.record.sweep_record import KeptRun, SweepRecord
from fzcli.record.table_spec import TableSpec
from fzcli.spec.quantity import Signal
from fzcli.spec.result import Provenance


def write_sweep(
    record: SweepRecord,
    path: Path | str,
    precision: Precision = "f4",
    table: TableSpec | None = None,
    most: int | None = None,
) -> bool:
    """Writes the sweep to ``path``, whole or not at all; metrics are f8, kept trajectories ``precision``.

    ``table`` is how the sweep asks to be shown; it is kept inside, so that the file alone makes its table.
    Kept runs that lie in shards of more than ``most`` bytes together stay there, and the file refers to them by name
    and hash. Gives whether it does.

    Raises:
        RecordError: the file cannot be written, or a kept run's array does not fit its time.
    """
    kept = record.kept
    referred = isinstance(kept, KeptInShards) and most is not None and kept.bytes > most
    with create_file(Path(path), "sweep") as file:
        writer = GroupWriter(file, precision)
        _write_metrics(writer, record)
        _write_configs(writer.subgroup("configs"), record)
        _write_draws(writer.subgroup("draws"), record)
        if isinstance(kept, KeptInShards) and referred:
            _write_references(writer.subgroup("shards"), kept, Path(path).parent)
        elif kept:
            write_kept(writer.subgroup("kept"), kept, record.provenance)
        write_provenance(writer, record.provenance)
        if table is not None:
            _write_table(writer, table)
    return referred


def _write_table(writer: GroupWriter, table: TableSpec) -> None:
    inner = writer.subgroup("table")
    inner.text("table_json", table.to_json())
    inner.text("beside_csv", table.beside_text)


def _write_references(writer: GroupWriter, kept: KeptInShards, folder: Path) -> None:
    writer.scale("shard", np.arange(len(kept.files)))
    names = [Path(os.path.relpath(path, folder)).as_posix() for path, _, _ in kept.files]
    writer.text("shard_file", names, ("shard",))
    writer.text("shard_sha256", [digest for _, digest, _ in kept.files], ("shard",))
    about = EXTRAS["shard_kept"]
    counts = np.array([count for _, _, count in kept.files])
    writer.array(Name(about.name, about.unit, about.long_name, ("shard",)), counts)


def _read_references(file: h5py.File, path: Path, origin: Provenance) -> KeptInShards:
    group = file["shards"]
    rows = zip(read_texts(group["shard_file"]), read_texts(group["shard_sha256"]), group["shard_kept"], strict=True)
    return KeptInShards([(path.parent / name, digest, int(count)) for name, digest, count in rows], origin)


def replace_table(path: Path, table: TableSpec | None) -> None:
    """Lets a sweep's file say how it is to be shown, and leaves all else as it is.

    Raises:
        RecordError: the file cannot be read or written.
    """
    with open_file(path, "sweep"):
        copy = io.BytesIO(path.read_bytes())
    with h5py.File(copy, "r+") as file:
        if "table" in file:
            del file["table"]
        if table is not None:
            _write_table(GroupWriter(file), table)
    with replacing(path) as stream:
        stream.write(copy.getvalue())


def read_identity(path: Path) -> str:
    """The hash of the sweep's resolved specification.

    Raises:
        RecordError: the file is missing, damaged, or not a sweep of fzcli.
    """
    with open_file(path, "sweep") as file:
        return str(file.attrs["spec_hash"])


def refers_to_shards(path: Path) -> bool:
    """Whether kept runs lie in shards beside the file.

    Raises:
        RecordError: the file is missing, damaged, or not a sweep of fzcli.
    """
    with open_file(path, "sweep") as file:
        return "shards" in file


def verify_sweep(path: Path) -> int:
    """Reads every dataset, whose chunks carry checksums, and every shard that the file refers to; gives the runs.

    Raises:
        RecordError: something is missing or damaged.
    """
    with open_file(path, "sweep") as file:
        for dataset in walk(file):
            dataset[...]
        runs = len(file["status"])
        wrong = [name for name in metric_names(file) if len(file[name]) != runs]
        if wrong:
            raise RecordError(f"{path}: {wrong[0]} has {len(file[wrong[0]])} rows, not {runs}")
        references = _read_references(file, path, read_provenance(file)) if "shards" in file else None
    for place, digest, _ in references.files if references else ():
        if shard_hash(place) != digest:
            raise RecordError(f"{place}: is not the shard that was written with this sweep")
    return runs


def read_sweep(path: Path | str) -> SweepRecord:
    """Reads a sweep written by ``write_sweep``; columns and kept runs are read when they are asked for.

    Raises:
        RecordError: the file is missing, damaged, or not a sweep of fzcli.
    """
    path = Path(path)
    with open_file(path, "sweep") as file:
        metrics = metric_names(file)
        draws = [name for name, dataset in file["draws"].items() if dataset.ndim == 2]
        origin = read_provenance(file)
        kept: Sequence[KeptRun] = ()
        if "kept" in file:
            kept = KeptInFile(len(file["kept/n_steps"]), partial(_kept, path, origin))
        if "shards" in file:
            kept = _read_references(file, path, origin)
        return SweepRecord(
            configs=read_configs(file),
            metrics=Columns({name: partial(_column, path, name) for name in metrics}),
            metric_info={
                name: read_signal(name, file[name]) for name in metrics if file[name].attrs["described"]
            },
            certificate_names=tuple(name for name in metrics if file[name].attrs["certificate"]),
            draws=Columns({name: partial(_column, path, f"draws/{name}") for name in draws}),
            draw_info={
                key: int(value) for key, value in json.loads(file["draws"].attrs["draw_info"]).items()
            },
            kept=kept,
            provenance=origin,
        )


def _kept(path: Path, origin: Provenance) -> tuple[KeptRun, ...]:
    with open_file(path, "sweep") as file:
        return read_kept(file["kept"], origin)


def _column(path: Path, name: str) -> NDArray[Any]:
    with open_file(path, "sweep") as file:
        found: NDArray[Any] = file[name][...]
        return found


def read_table_spec(path: Path | str) -> TableSpec | None:
    """How the sweep asks to be shown; None when it does not say."""
    with open_file(Path(path), "sweep") as file:
        if "table" not in file:
            return None
        return TableSpec.from_json(read_text(file["table/table_json"]), read_text(file["table/beside_csv"]))


def metric_names(file: h5py.File) -> list[str]:
    """The columns of the sweep's root that hold one value a run, in their order."""
    return [
        name for name, item in file.items() if isinstance(item, h5py.Dataset) and "certificate" in item.attrs
    ]


def read_configs(file: h5py.File) -> list[dict[str, Any]]:
    """The configurations, exactly as they were."""
    if "configs_json" not in file["configs"]:
        return []
    return [json.loads(text) for text in read_texts(file["configs/configs_json"])]


def _write_metrics(writer: GroupWriter, record: SweepRecord) -> None:
    runs = len(next(iter(record.metrics.values()), ()))
    writer.scale("run", np.arange(runs))
    for name, values in record.metrics.items():
        marks: dict[str, Any] = {
            "described": np.int8(name in record.metric_info),
            "certificate": np.int8(name in record.certificate_names),
        }
        if name == "status":
            writer.status(values, ("run",))
            for key, value in marks.items():
                writer.group[name].attrs[key] = value
            continue
        signal = signal_of(name, record.metric_info.get(name))
        values = np.asarray(values) if name in INDEX_COLUMNS else np.asarray(values, dtype=np.float64)
        marks["truth"] = np.int8(signal.truth)
        writer.array(Name(name, signal.unit, signal.long_name, ("run",)), values, **marks)
    indices = [name for name in ("config", "trajectory") if name in record.metrics]
    writer.group.attrs["coordinates"] = " ".join(indices)
    first = next((name for name in record.metrics if name not in INDEX_COLUMNS), None)
    if first is not None:
        writer.plot(first, "run")


def _write_configs(writer: GroupWriter, record: SweepRecord) -> None:
    configs = record.configs
    writer.scale("config", np.arange(len(configs)))
    if not configs:
        return
    for path in dict.fromkeys(path for config in configs for path in config):
        values = config_column([config.get(path) for config in configs])
        writer.array(_entry(record, path, "" if values.dtype == object else "SI", ("config",)), values)
    texts = [json.dumps(config) for config in configs]
    writer.text("configs_json", texts, ("config",))


def config_column(values: Sequence[Any]) -> NDArray[Any]:
    """One configuration entry over several configurations: f8 where all are numbers, strings otherwise."""
    if all(
        value is None or (isinstance(value, int | float) and not isinstance(value, bool)) for value in values
    ):
        return np.array([math.nan if value is None else float(value) for value in values])
    return np.array([config_text(value) for value in values], dtype=object)


def config_text(value: Any) -> str:
    """A configuration value as short text."""
    if value is None:
        return ""
    return value if isinstance(value, str) else json.dumps(value)


def _write_draws(writer: GroupWriter, record: SweepRecord) -> None:
    writer.group.attrs["draw_info"] = json.dumps(dict(record.draw_info))
    count = len(next(iter(record.draws.values()), ()))
    writer.scale("trajectory", np.arange(count))
    for path, values in record.draws.items():
        table = np.asarray(values, dtype=np.float64)
        axis = f"component_{table.shape[1]}"
        if not writer.has_scale(axis):
            writer.scale(axis, np.arange(table.shape[1]), Name(axis, "1", "index of the component"))
        writer.array(_entry(record, path, "SI", ("trajectory", axis)), table)


def _entry(record: SweepRecord, path: str, unit: str, dims: tuple[str, ...]) -> Name:
    """An entry of the specification; its unit is SI where the record does not describe it."""
    info = record.metric_info.get(path) or Signal(path, unit, f"{path} of the specification")
    return Name(path, info.unit, info.long_name, dims)
