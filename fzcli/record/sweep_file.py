"""A sweep as an HDF5 file: metrics at the root; groups configs, draws, kept and provenance.

The root and every group open by themselves in xarray; configurations and draws are tied to the
rows of the root by the columns ``config`` and ``trajectory``.
"""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fzcli.record.columns import read_signal
from fzcli.record.hdf5 import (
    GroupWriter,
    Precision,
    create_file,
    open_file,
    read_provenance,
    read_text,
    read_texts,
    write_provenance,
)
from fzcli.record.kept import read_kept, write_kept
from fzcli.record.names import INDEX_COLUMNS, Name, signal_of
from fzcli.record.sweep_record import SweepRecord
from fzcli.record.table_spec import TableSpec
from fzcli.spec.quantity import Signal


def write_sweep(
    record: SweepRecord, path: Path | str, precision: Precision = "f4", table: TableSpec | None = None
) -> None:
    """Writes the sweep to ``path``, whole or not at all; metrics are f8, kept trajectories ``precision``.

    ``table`` is how the sweep asks to be shown; it is kept inside, so that the file alone makes its table.

    Raises:
        RecordError: the file cannot be written, or a kept run's array does not fit its time.
    """
    with create_file(Path(path), "sweep") as file:
        writer = GroupWriter(file, precision)
        _write_metrics(writer, record)
        _write_configs(writer.subgroup("configs"), record)
        _write_draws(writer.subgroup("draws"), record)
        if record.kept:
            write_kept(writer.subgroup("kept"), record.kept, record.provenance)
        write_provenance(writer, record.provenance)
        if table is not None:
            inner = writer.subgroup("table")
            inner.text("table_json", table.to_json())
            inner.text("beside_csv", table.beside_text)


def read_sweep(path: Path | str) -> SweepRecord:
    """Reads a sweep written by ``write_sweep``.

    Raises:
        RecordError: the file is missing, damaged, or not a sweep of fzcli.
    """
    with open_file(Path(path), "sweep") as file:
        metrics = {name: file[name][...] for name in metric_names(file)}
        return SweepRecord(
            configs=read_configs(file),
            metrics=metrics,
            metric_info={
                name: read_signal(name, file[name]) for name in metrics if file[name].attrs["described"]
            },
            certificate_names=tuple(name for name in metrics if file[name].attrs["certificate"]),
            draws={name: dataset[...] for name, dataset in file["draws"].items() if dataset.ndim == 2},
            draw_info={
                key: int(value) for key, value in json.loads(file["draws"].attrs["draw_info"]).items()
            },
            kept=read_kept(file["kept"], read_provenance(file)) if "kept" in file else (),
            provenance=read_provenance(file),
        )


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
