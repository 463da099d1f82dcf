"""What a result file holds, for people: kind, origin, status, certificate, datasets."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from fzcli.record.hdf5 import dimension_names, is_scale, is_text, open_file, read_provenance, read_text, walk
from fzcli.record.sweep_file import metric_names, read_configs
from fzcli.spec.result import STATUS_NAMES, Provenance


@dataclass(frozen=True)
class DatasetInfo:
    """One dataset: path in the file, dimensions with their lengths, type, unit and meaning."""

    name: str
    dims: tuple[tuple[str, int], ...]
    dtype: str
    unit: str
    long_name: str


@dataclass(frozen=True)
class Worst:
    """An entry of the certificate: its worst value over the runs, and in how many runs it is a number."""

    value: float
    unit: str
    long_name: str
    runs: int


@dataclass(frozen=True)
class FileInfo:
    """A result file in short."""

    path: Path
    kind: str
    bytes: int
    provenance: Provenance
    runs: int
    configs: int
    status: Mapping[str, int]
    reason: str
    advice: str
    certificate: Mapping[str, Worst]
    datasets: tuple[DatasetInfo, ...]

    def lines(self) -> list[str]:
        """The whole as lines of text."""
        origin = self.provenance
        counts = ", ".join(f"{count} {name}" for name, count in self.status.items() if count)
        configs = f" in {self.configs} configurations" if self.configs else ""
        runs = f"{self.runs} run{'' if self.runs == 1 else 's'}{configs}: {counts}"
        facts = [
            ("file", f"{self.path} ({self.bytes / 1e6:.2f} MB)"),
            ("kind", self.kind),
            ("runs", runs),
            ("reason", self.reason),
            ("advice", self.advice),
            ("spec", origin.spec_hash),
            ("engine", origin.engine),
            ("seed", "" if origin.seed is None else str(origin.seed)),
            ("versions", ", ".join(f"{name} {version}" for name, version in origin.versions.items())),
            ("command", " ".join(origin.argv)),
        ]
        lines = [f"{name:<9} {value}" for name, value in facts if value]
        lines += ["", "certificate, worst of all runs"]
        lines += _aligned(
            [
                (name, f"{one.value:.4g} {_unit(one.unit)}", one.long_name)
                for name, one in self.certificate.items()
            ]
        )
        lines += ["", "datasets"]
        lines += _aligned(
            [(one.name, _shape(one), one.dtype, _unit(one.unit), one.long_name) for one in self.datasets]
        )
        return lines


def _unit(unit: str) -> str:
    return "" if unit in ("", "1") else f"[{unit}]"


def _shape(one: DatasetInfo) -> str:
    return "(" + ", ".join(f"{name} {length}" for name, length in one.dims) + ")"


def _aligned(rows: list[tuple[str, ...]]) -> list[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))] if rows else []
    return [
        "  " + "  ".join(f"{text:<{width}}" for text, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def describe(path: Path | str) -> FileInfo:
    """What the file holds, read from its headers and its columns of status and certificate.

    Raises:
        RecordError: the file is missing, damaged, or not one of fzcli.
    """
    path = Path(path)
    with open_file(path) as file:
        sweep = file.attrs["fzcli_kind"] == "sweep"
        status = np.atleast_1d(file["status"][()])
        return FileInfo(
            path=path,
            kind=file.attrs["fzcli_kind"],
            bytes=path.stat().st_size,
            provenance=read_provenance(file),
            runs=len(status),
            configs=len(read_configs(file)) if sweep else 0,
            status={name: int((status == code).sum()) for code, name in enumerate(STATUS_NAMES)},
            reason="" if sweep else read_text(file["status_reason"]),
            advice="" if sweep else read_text(file["status_advice"]),
            certificate=_certificate(file, sweep),
            datasets=tuple(_datasets(file)),
        )


def _certificate(file: h5py.File, sweep: bool) -> dict[str, Worst]:
    if sweep:
        entries = {name: file[name] for name in metric_names(file) if file[name].attrs["certificate"]}
    else:
        entries = dict(file["certificate"].items())
    return {name: _worst(name, dataset) for name, dataset in entries.items()}


def _worst(name: str, dataset: h5py.Dataset) -> Worst:
    """The smallest of what is a smallest value by name (singular value, clearance), else the largest."""
    values = np.atleast_1d(dataset[()])
    values = values[~np.isnan(values)]
    smallest = name.endswith("_min") or "smallest" in name
    value = float("nan") if not values.size else float(values.min() if smallest else values.max())
    return Worst(value, dataset.attrs["units"], dataset.attrs["long_name"], int(values.size))


def _datasets(file: h5py.File) -> list[DatasetInfo]:
    found = []
    for item in walk(file):
        if not is_scale(item):
            dims = tuple(zip(dimension_names(item), item.shape, strict=True))
            kind = "text" if is_text(item) else item.dtype.name
            found.append(DatasetInfo(item.name[1:], dims, kind, item.attrs["units"], item.attrs["long_name"]))
    return found
