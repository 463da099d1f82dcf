"""One run, with the variants it is compared with, as an HDF5 file."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from fzcli.loop.rollout import Rollout
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
from fzcli.record.hdf5 import (
    GroupWriter,
    Precision,
    create_file,
    open_file,
    read_provenance,
    read_text,
    write_provenance,
)
from fzcli.record.kept import read_kept, write_kept
from fzcli.record.names import Name
from fzcli.record.sweep_record import KeptRun


def write_rollout(rollout: Rollout, path: Path | str, precision: Precision = "f4") -> None:
    """Writes the run to ``path``, whole or not at all; time, metrics and certificate are always f8.

    Its variants go to group "variants", named by ``role``.

    Raises:
        RecordError: the file cannot be written, or an array's shape does not fit the run.
    """
    columns = trajectory_columns(rollout)
    with create_file(Path(path), "rollout") as file:
        writer = GroupWriter(file, precision)
        writer.scale("time", np.asarray(rollout.time, dtype=np.float64))
        names = write_axes(writer, columns)
        for key, values in columns.items():
            stored, axis = names[key]
            about = Name(
                stored, key.quantity.unit, key.quantity.long_name, ("time", axis) if axis else ("time",)
            )
            writer.trajectory(about, np.asarray(values), **column_attributes(key))
        writer.status(rollout.status.code)
        writer.text("status_reason", rollout.status.reason)
        writer.text("status_advice", rollout.status.advice)
        for group, numbers in (("metrics", rollout.metrics), ("certificate", rollout.certificate)):
            write_numbers(writer.subgroup(group), [numbers], rollout.metric_info, ())
        write_provenance(writer, rollout.provenance)
        if rollout.variants:
            runs = [KeptRun(i, 0, name, one) for i, (name, one) in enumerate(rollout.variants.items())]
            write_kept(writer.subgroup("variants"), runs, rollout.provenance)
        first = next((names[key][0] for key in columns if key.is_signal and not key.axis), None)
        if first is not None:
            writer.plot(first, "time")
        else:
            writer.plot("q", "time", "joint")


def read_rollout(path: Path | str) -> Rollout:
    """Reads a run written by ``write_rollout``.

    Raises:
        RecordError: the file is missing, damaged, or not a rollout of fzcli.
    """
    with open_file(Path(path), "rollout") as file:
        metrics, metric_info = read_numbers(file["metrics"])
        certificate, certificate_info = read_numbers(file["certificate"])
        rollout = build_rollout(
            file["time"][...],
            {read_key(file, dataset): dataset[...] for dataset in column_datasets(file)},
            (metrics, certificate, {**metric_info, **certificate_info}),
            (int(file["status"][()]), read_text(file["status_reason"]), read_text(file["status_advice"])),
            read_provenance(file),
        )
        if "variants" not in file:
            return rollout
        variants = read_kept(file["variants"], rollout.provenance)
        return replace(rollout, variants={run.role: run.rollout for run in variants})
