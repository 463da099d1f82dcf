"""Several runs in one group, kept runs of a sweep or variants of a run: arrays (kept, time, component).

Short runs are padded with NaN.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fzcli.loop.rollout import Array
from fzcli.record.columns import (
    Key,
    build_rollout,
    column_attributes,
    column_datasets,
    read_key,
    read_numbers_of,
    trajectory_columns,
    write_axes,
    write_numbers,
)
from fzcli.record.hdf5 import GroupWriter, provenance_from_json, provenance_to_json, read_texts
from fzcli.record.names import DIMENSIONS, EXTRAS, Name
from fzcli.record.sweep_record import KeptRun
from fzcli.spec.quantity import Signal
from fzcli.spec.result import Provenance, Status

BLOCK = 64  # runs that are written together


def write_kept(writer: GroupWriter, kept: Sequence[KeptRun], origin: Provenance) -> None:
    """Writes runs into a group of their own; ``origin`` is the provenance of the file they are in.

    Where all runs share their sample times, time is a dimension; otherwise the dimension is ``step``
    and time an array (kept, step). Runs are looked at one after the other, twice, so that a sequence that
    reads them from files needs no more room than a block of them.
    """
    heads = [_Head.of(run) for run in kept]
    writer.scale("kept", np.arange(len(kept)))
    clock = _write_time(writer, [head.time for head in heads])
    names = write_axes(writer, dict.fromkeys(key for head in heads for key in head.order))
    longest = max(len(head.time) for head in heads)
    room = {}
    for key, (stored, axis) in names.items():
        present = [key in head.keys for head in heads]
        marks: dict[str, Any] = {} if all(present) else {"present": np.array(present, dtype=np.int8)}
        dims = ("kept", clock, axis) if axis else ("kept", clock)
        about = Name(stored, key.quantity.unit, key.quantity.long_name, dims)
        shape = (len(kept), longest, len(key.labels)) if key.labels else (len(kept), longest)
        room[key] = writer.room(about, shape, **column_attributes(key), **marks)
    for start in range(0, len(kept), BLOCK):
        block = [trajectory_columns(run.rollout) for run in kept[start : start + BLOCK]]
        for key, dataset in room.items():
            writer.fill(dataset, start, _stacked([columns.get(key) for columns in block], dataset.shape[1:]))
    _write_labels(writer, heads, origin)
    info = {name: signal for head in reversed(heads) for name, signal in head.metric_info.items()}
    for group, rows in (
        ("metrics", [head.metrics for head in heads]),
        ("certificate", [head.certificate for head in heads]),
    ):
        inner = writer.subgroup(group)
        inner.scale("kept", np.arange(len(kept)))
        write_numbers(inner, rows, info, ("kept",))
    writer.plot("q", "kept", clock, "joint")


@dataclass(frozen=True)
class _Head:
    """All of a kept run but its arrays."""

    config: int
    trajectory: int
    role: str
    time: Array
    keys: frozenset[Key]
    order: tuple[Key, ...]
    metrics: Mapping[str, float]
    metric_info: Mapping[str, Signal]
    certificate: Mapping[str, float]
    status: Status
    provenance: Provenance

    @staticmethod
    def of(run: KeptRun) -> "_Head":
        rollout = run.rollout
        order = tuple(trajectory_columns(rollout))
        time = np.asarray(rollout.time, dtype=np.float64)
        return _Head(
            *(run.config, run.trajectory, run.role, time, frozenset(order), order),
            *(rollout.metrics, rollout.metric_info, rollout.certificate, rollout.status, rollout.provenance),
        )


def read_kept(group: h5py.Group, origin: Provenance) -> tuple[KeptRun, ...]:
    """The runs that ``write_kept`` wrote; ``origin`` is the file's own provenance."""
    arrays = {
        read_key(group, dataset): (dataset[...], dataset.attrs.get("present"))
        for dataset in column_datasets(group)
    }
    labels = {
        name: read_texts(group[name])
        for name in ("role", "status_reason", "status_advice", "provenance_json")
    }
    config, trajectory, lengths = (group[name][...] for name in ("config", "trajectory", "n_steps"))
    time, status = group["time"][...], group["status"][...]
    metrics, metric_info = read_numbers_of(group["metrics"], len(lengths))
    certificate, certificate_info = read_numbers_of(group["certificate"], len(lengths))
    runs = []
    for index, length in enumerate(lengths):
        columns = {
            key: values[index, :length]
            for key, (values, present) in arrays.items()
            if present is None or present[index]
        }
        text = labels["provenance_json"][index]
        rollout = build_rollout(
            (time if time.ndim == 1 else time[index])[:length],
            columns,
            (metrics[index], certificate[index], {**metric_info, **certificate_info}),
            (int(status[index]), labels["status_reason"][index], labels["status_advice"][index]),
            provenance_from_json(text) if text else origin,
        )
        runs.append(KeptRun(int(config[index]), int(trajectory[index]), labels["role"][index], rollout))
    return tuple(runs)


def _write_time(writer: GroupWriter, times: Sequence[Array]) -> str:
    """Writes the time axis; gives the name of the dimension that goes with it."""
    longest = max(times, key=len)
    if all(np.array_equal(time, longest[: len(time)]) for time in times):
        writer.scale("time", longest)
        return "time"
    writer.scale("step", np.arange(len(longest)))
    about = DIMENSIONS["time"]
    values = np.array([_padded(time, len(longest)) for time in times])
    writer.array(Name("time", about.unit, about.long_name, ("kept", "step")), values)
    return "step"


def _stacked(arrays: Sequence[Array | None], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Runs one upon the other, NaN after the end of each and for a run without the array."""
    stacked = np.full((len(arrays), *shape), np.nan)
    for row, values in zip(stacked, arrays, strict=True):
        if values is not None:
            row[: len(values)] = values
    return stacked


def _padded(values: Array, longest: int) -> NDArray[np.float64]:
    """A run's times with NaN after its end."""
    row: NDArray[np.float64] = _stacked([values], (longest,))[0]
    return row


def _write_labels(writer: GroupWriter, heads: Sequence[_Head], origin: Provenance) -> None:
    for name, numbers in (
        ("config", [head.config for head in heads]),
        ("trajectory", [head.trajectory for head in heads]),
        ("n_steps", [len(head.time) for head in heads]),
    ):
        about = EXTRAS[name]
        writer.array(Name(name, about.unit, about.long_name, ("kept",)), np.array(numbers))
    writer.text("role", [head.role for head in heads], ("kept",))
    writer.status([head.status.code for head in heads], ("kept",))
    writer.text("status_reason", [head.status.reason for head in heads], ("kept",))
    writer.text("status_advice", [head.status.advice for head in heads], ("kept",))
    origins = ["" if head.provenance == origin else provenance_to_json(head.provenance) for head in heads]
    writer.text("provenance_json", origins, ("kept",))
    writer.group.attrs["coordinates"] = "config trajectory role"
