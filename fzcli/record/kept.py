"""Several runs in one group, kept runs of a sweep or variants of a run: arrays (kept, time, component).

Short runs are padded with NaN.
"""

from collections.abc import Sequence
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fzcli.loop.rollout import Array, Rollout
from fzcli.record.columns import (
    build_rollout,
    column_attributes,
    column_datasets,
    read_key,
    read_numbers,
    trajectory_columns,
    write_axes,
    write_numbers,
)
from fzcli.record.hdf5 import GroupWriter, provenance_from_json, provenance_to_json, read_texts
from fzcli.record.names import DIMENSIONS, EXTRAS, Name
from fzcli.record.sweep_record import KeptRun
from fzcli.spec.result import Provenance


def write_kept(writer: GroupWriter, kept: Sequence[KeptRun], origin: Provenance) -> None:
    """Writes runs into a group of their own; ``origin`` is the provenance of the file they are in.

    Where all runs share their sample times, time is a dimension; otherwise the dimension is ``step``
    and time an array (kept, step).
    """
    rollouts = [run.rollout for run in kept]
    columns = [trajectory_columns(rollout) for rollout in rollouts]
    writer.scale("kept", np.arange(len(kept)))
    clock = _write_time(writer, rollouts)
    names = write_axes(writer, dict.fromkeys(key for one in columns for key in one))
    longest = max(len(rollout.time) for rollout in rollouts)
    for key, (stored, axis) in names.items():
        values = _stack([one.get(key) for one in columns], longest, len(key.labels))
        present = [key in one for one in columns]
        marks: dict[str, Any] = {} if all(present) else {"present": np.array(present, dtype=np.int8)}
        dims = ("kept", clock, axis) if axis else ("kept", clock)
        about = Name(stored, key.quantity.unit, key.quantity.long_name, dims)
        writer.trajectory(about, values, **column_attributes(key), **marks)
    _write_labels(writer, kept, origin)
    info = {name: signal for rollout in reversed(rollouts) for name, signal in rollout.metric_info.items()}
    for group, rows in (
        ("metrics", [rollout.metrics for rollout in rollouts]),
        ("certificate", [rollout.certificate for rollout in rollouts]),
    ):
        inner = writer.subgroup(group)
        inner.scale("kept", np.arange(len(kept)))
        write_numbers(inner, rows, info, ("kept",))
    writer.plot("q", "kept", clock, "joint")


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
    runs = []
    for index, length in enumerate(lengths):
        columns = {
            key: values[index, :length]
            for key, (values, present) in arrays.items()
            if present is None or present[index]
        }
        metrics, metric_info = read_numbers(group["metrics"], index)
        certificate, certificate_info = read_numbers(group["certificate"], index)
        text = labels["provenance_json"][index]
        rollout = build_rollout(
            (time if time.ndim == 1 else time[index])[:length],
            columns,
            (metrics, certificate, {**metric_info, **certificate_info}),
            (int(status[index]), labels["status_reason"][index], labels["status_advice"][index]),
            provenance_from_json(text) if text else origin,
        )
        runs.append(KeptRun(int(config[index]), int(trajectory[index]), labels["role"][index], rollout))
    return tuple(runs)


def _write_time(writer: GroupWriter, rollouts: Sequence[Rollout]) -> str:
    """Writes the time axis; gives the name of the dimension that goes with it."""
    longest = max((np.asarray(rollout.time, dtype=np.float64) for rollout in rollouts), key=len)
    if all(np.array_equal(rollout.time, longest[: len(rollout.time)]) for rollout in rollouts):
        writer.scale("time", longest)
        return "time"
    writer.scale("step", np.arange(len(longest)))
    about = DIMENSIONS["time"]
    values = _stack([rollout.time for rollout in rollouts], len(longest), 0)
    writer.array(Name("time", about.unit, about.long_name, ("kept", "step")), values)
    return "step"


def _stack(arrays: Sequence[Array | None], longest: int, width: int) -> NDArray[np.float64]:
    """Runs one upon the other, NaN after the end of each and for a run without the array."""
    stacked = np.full((len(arrays), longest, width) if width else (len(arrays), longest), np.nan)
    for row, values in zip(stacked, arrays, strict=True):
        if values is not None:
            row[: len(values)] = values
    return stacked


def _write_labels(writer: GroupWriter, kept: Sequence[KeptRun], origin: Provenance) -> None:
    rollouts = [run.rollout for run in kept]
    for name, numbers in (
        ("config", [run.config for run in kept]),
        ("trajectory", [run.trajectory for run in kept]),
        ("n_steps", [len(rollout.time) for rollout in rollouts]),
    ):
        about = EXTRAS[name]
        writer.array(Name(name, about.unit, about.long_name, ("kept",)), np.array(numbers))
    writer.text("role", [run.role for run in kept], ("kept",))
    writer.status([rollout.status.code for rollout in rollouts], ("kept",))
    writer.text("status_reason", [rollout.status.reason for rollout in rollouts], ("kept",))
    writer.text("status_advice", [rollout.status.advice for rollout in rollouts], ("kept",))
    origins = [
        "" if rollout.provenance == origin else provenance_to_json(rollout.provenance) for rollout in rollouts
    ]
    writer.text("provenance_json", origins, ("kept",))
    writer.group.attrs["coordinates"] = "config trajectory role"
