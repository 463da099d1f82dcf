"""A Rollout as a list of columns (names, units, labelled axes) and back: what its files have in common."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError
from fzcli.loop.rollout import Array, Rollout
from fzcli.record.hdf5 import GroupWriter, dimension_names, is_text, read_texts
from fzcli.record.names import AXIS, DIMENSIONS, KNOWN_LABELS, QUATERNION, RESERVED, TRAJECTORIES, TWIST, Name
from fzcli.spec.quantity import Signal
from fzcli.spec.result import STATUS_NAMES, Provenance, Status

_LABELS = {"axis": AXIS, "quaternion": QUATERNION, "twist": TWIST}


@dataclass(frozen=True)
class Key:
    """What makes two columns the same: name in files, the quantity, and the labels of its second axis."""

    stored: str
    quantity: Signal
    axis: str = ""
    is_signal: bool = False
    units: tuple[str, ...] = ()  # of the components, where they differ or the run names them

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the axis after time; empty for a scalar over time."""
        return self.quantity.components


def trajectory_columns(rollout: Rollout) -> dict[Key, Array]:
    """Every array of the run that goes over time, (T,) or (T, k), except time itself.

    Raises:
        RecordError: an array's shape does not fit the run's time or its component names.
    """
    columns = {_state_key(item, rollout): getattr(rollout, item.name) for item in TRAJECTORIES}
    for name, values in rollout.signals.items():
        columns[_signal_key(name, values, rollout)] = values
    for key, values in columns.items():
        shape = (len(rollout.time), len(key.labels)) if key.labels else (len(rollout.time),)
        if np.shape(values) != shape:
            raise RecordError(f"{key.quantity.name}: shape {np.shape(values)}, expected {shape}")
    return columns


def _state_key(item: Name, rollout: Rollout) -> Key:
    axis = item.dims[1]
    if axis != "joint":
        return Key(item.name, Signal(item.name, item.unit, item.long_name, _LABELS[axis]), axis)
    units = tuple(item.unit.replace("rad", unit) for unit in rollout.joint_units)
    unit = " or ".join(dict.fromkeys(units)) or item.unit
    return Key(item.name, Signal(item.name, unit, item.long_name, rollout.joint_names), axis, units=units)


def _signal_key(name: str, values: Array, rollout: Rollout) -> Key:
    info = rollout.signal_info.get(name) or Signal(name, "1", name.replace("_", " "))
    components = info.components
    if not components and np.ndim(values) == 2:
        components = tuple(str(index) for index in range(np.shape(values)[1]))
    stored = f"signal_{name}" if name in RESERVED else name
    if not components:
        axis = ""
    elif components == rollout.joint_names:
        axis = "joint"
    else:
        axis = KNOWN_LABELS.get(components, f"{name}_component")
    quantity = Signal(name, info.unit, info.long_name, components, info.truth)
    return Key(stored, quantity, axis, is_signal=True)


def write_axes(writer: GroupWriter, keys: Iterable[Key]) -> dict[Key, tuple[str, str]]:
    """Creates the dimensions of the columns; gives each key its (dataset, axis) names, free of clashes.

    Two keys of one name (the same signal with other components, arms with other joints) get _2, _3 ...
    """
    labels: dict[str, tuple[str, ...]] = {}
    names: dict[Key, tuple[str, str]] = {}
    taken: set[str] = set()
    for key in keys:
        axis = key.axis
        if axis:
            count = 2
            while labels.setdefault(axis, key.labels) != key.labels:
                axis, count = f"{key.axis}_{count}", count + 1
            if not writer.has_scale(axis):
                about = DIMENSIONS.get(key.axis) or Name(axis, "", f"component of {key.quantity.name}")
                writer.scale(axis, np.array(key.labels, dtype=object), about)
        stored, count = key.stored, 2
        while stored in taken:
            stored, count = f"{key.stored}_{count}", count + 1
        taken.add(stored)
        names[key] = (stored, axis)
    return names


def column_attributes(key: Key) -> dict[str, Any]:
    """Attributes that let ``read_key`` find the quantity again."""
    units = {"component_units": list(key.units)} if key.units else {}
    truth = {"truth": np.int8(True)} if key.quantity.truth else {}
    return {"quantity": key.quantity.name, "is_signal": np.int8(key.is_signal), **units, **truth}


def read_key(group: h5py.Group, dataset: h5py.Dataset) -> Key:
    """The key of a stored column."""
    axis = dimension_names(dataset)[-1] if dataset.ndim and dimension_names(dataset)[-1] not in _TIMES else ""
    labels = read_texts(group[axis]) if axis else ()
    stored = dataset.name.rsplit("/", 1)[-1]
    info = replace(read_signal(dataset.attrs["quantity"], dataset), components=labels)
    units = tuple(str(unit) for unit in dataset.attrs.get("component_units", ()))
    return Key(stored, info, axis, bool(dataset.attrs["is_signal"]), units)


_TIMES = ("time", "step")


def column_datasets(group: h5py.Group) -> list[h5py.Dataset]:
    """The datasets of the group that hold trajectories, in the order they were written."""
    return [item for item in group.values() if isinstance(item, h5py.Dataset) and "quantity" in item.attrs]


def write_numbers(
    writer: GroupWriter,
    rows: Sequence[Mapping[str, float]],
    info: Mapping[str, Signal],
    dims: tuple[str, ...],
) -> None:
    """Writes maps of numbers, a dataset a name: scalars (one row, no dims) or one value a row.

    Names missing in some rows are NaN there, and attribute ``present`` says which rows have them.
    """
    for name in dict.fromkeys(name for row in rows for name in row):
        values = np.array([float(row.get(name, np.nan)) for row in rows])
        signal = info.get(name) or Signal(name, "1", name.replace("_", " "))
        present = [name in row for row in rows]
        marks: dict[str, Any] = {} if all(present) else {"present": np.array(present, dtype=np.int8)}
        about = Name(name, signal.unit, signal.long_name, dims)
        marks |= {"described": np.int8(name in info), "truth": np.int8(signal.truth)}
        writer.array(about, values if dims else values[0], **marks)


def read_numbers(group: h5py.Group) -> tuple[dict[str, float], dict[str, Signal]]:
    """What ``write_numbers`` wrote of a single run (scalars), and the description of the names."""
    numbers = {name: float(dataset[()]) for name, dataset in _numbered(group)}
    return numbers, _described(group)


def read_numbers_of(group: h5py.Group, rows: int) -> tuple[list[dict[str, float]], dict[str, Signal]]:
    """What ``write_numbers`` wrote of several runs, and the description of the names."""
    found: list[dict[str, float]] = [{} for _ in range(rows)]
    for name, dataset in _numbered(group):
        present = dataset.attrs.get("present", np.ones(rows))
        for numbers, value, there in zip(found, dataset[...].tolist(), present, strict=True):
            if there:
                numbers[name] = value
    return found, _described(group)


def _numbered(group: h5py.Group) -> Iterator[tuple[str, h5py.Dataset]]:
    return ((name, dataset) for name, dataset in group.items() if "described" in dataset.attrs)


def _described(group: h5py.Group) -> dict[str, Signal]:
    return {name: read_signal(name, dataset) for name, dataset in _numbered(group) if dataset.attrs["described"]}


def read_signal(name: str, dataset: h5py.Dataset) -> Signal:
    """What a dataset says of its values, without the names of their components.

    ``truth`` is False where the file does not say.
    """
    attributes = dataset.attrs
    truth = bool(attributes.get("truth", False))
    return Signal(name, attributes["units"], attributes["long_name"], truth=truth)


def build_rollout(
    time: Array,
    columns: Mapping[Key, NDArray[Any]],
    numbers: tuple[dict[str, float], dict[str, float], dict[str, Signal]],
    status: tuple[int, str, str],
    provenance: Provenance,
) -> Rollout:
    """A Rollout from its stored parts; ``numbers`` are metrics, certificate and their description."""
    states: dict[str, Any] = {
        key.quantity.name: np.asarray(values, dtype=np.float64)
        for key, values in columns.items()
        if not key.is_signal
    }
    q = next(key for key in columns if key.quantity.name == "q" and not key.is_signal)
    metrics, certificate, metric_info = numbers
    code, reason, advice = status
    return Rollout(
        time=np.asarray(time, dtype=np.float64),
        **states,
        signals={
            key.quantity.name: np.asarray(v, dtype=np.float64) for key, v in columns.items() if key.is_signal
        },
        signal_info={key.quantity.name: key.quantity for key in columns if key.is_signal},
        joint_names=q.labels,
        joint_units=q.units,
        metrics=metrics,
        metric_info=metric_info,
        certificate=certificate,
        status=Status(STATUS_NAMES[code], reason, advice),
        provenance=provenance,
    )


def labels_of(group: h5py.Group, dataset: h5py.Dataset) -> tuple[str, ...]:
    """Component names of a stored array's last axis; empty when its axis carries no text."""
    axis = dimension_names(dataset)[-1] if dataset.ndim else ""
    return read_texts(group[axis]) if axis in group and is_text(group[axis]) else ()
