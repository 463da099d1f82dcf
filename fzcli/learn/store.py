"""Network sets on disk: NumPy's npz with plain arrays, and a JSON header that says whose they are."""

import contextlib
import json
import os
import secrets
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError, SpecError
from fzcli.learn.judge import Trained
from fzcli.learn.kinematic_map import ErrorMap
from fzcli.learn.network import Network, Scaling
from fzcli.learn.network_set import NetworkSet
from fzcli.spec.any_robot import AnyRobot

FORMAT = 1
_TEST = ("inputs", "truth", "raw", "refined")
_MAP = ("x", "y", "raw", "refined")


def save(networks: NetworkSet, path: Path | str) -> None:
    """Write a set; the file takes the place of an older one only once it is whole.

    Raises:
        RecordError: the file or its folder cannot be written.
    """
    path = Path(path)
    arrays: dict[str, NDArray[Any]] = {}
    entries = []
    for number, one in enumerate(networks.trained.values()):
        entries.append(_entry(one))
        arrays |= {f"{number}.{name}": array for name, array in _arrays(one).items()}
    header = {
        "format": FORMAT,
        "robot": networks.robot,
        "robot_hash": networks.robot_hash,
        "kinematics": networks.kinematics,
        "spec": networks.spec,
        "versions": networks.versions,
        "skipped": dict(networks.skipped),
        "networks": entries,
    }
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(6)}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("xb") as stream:
            np.savez_compressed(stream, header=np.array(json.dumps(header)), **arrays)  # type: ignore[arg-type]
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
    except OSError as error:
        raise RecordError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _entry(one: Trained) -> dict[str, Any]:
    network, shown = one.network, one.error_map
    return {
        "label": network.label,
        "layers": len(network.weights),
        "activation": network.activation,
        "input_coding": network.inputs.coding,
        "output_coding": network.outputs.coding,
        "metrics": {name: value if np.isfinite(value) else str(value) for name, value in one.metrics.items()},
        "map_axes": shown.axes,
        "map_panels": shown.panels,
    }


def _arrays(one: Trained) -> dict[str, NDArray[Any]]:
    network = one.network
    found: dict[str, NDArray[Any]] = {}
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        found |= {f"weight.{layer}": weight, f"bias.{layer}": bias}
    for name, scaling in (("input", network.inputs), ("output", network.outputs)):
        found |= {f"{name}.centre": scaling.centre, f"{name}.half": scaling.half}
    found |= {f"test.{name}": getattr(one, name) for name in _TEST}
    return found | {f"map.{name}": getattr(one.error_map, name) for name in _MAP}


def load(path: Path | str, robot: AnyRobot | None = None) -> NetworkSet:
    """Read a set; with a robot, one that was trained for another is refused.

    Raises:
        RecordError: missing, damaged, or not written by fzcli.
        SpecError: trained for another robot: which, and the first thing in which they differ.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            if "header" not in file:
                raise RecordError(f"{path}: holds no networks of fzcli")
            header = json.loads(str(file["header"][()]))
            if header.get("format") != FORMAT:
                raise RecordError(f"{path}: format {header.get('format')!r} is not known; train again")
            networks = _networks(header, {name: file[name] for name in file.files if name != "header"})
    except FileNotFoundError:
        raise RecordError(f"{path}: no such file; fzcli train writes one") from None
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile, EOFError) as error:
        if isinstance(error, SpecError):
            raise
        raise RecordError(f"{path}: is no file of networks, or damaged ({error})") from None
    if robot is not None:
        networks.check_robot(robot, f"the networks in {path}")
    return networks


def _networks(header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> NetworkSet:
    trained = {}
    for number, entry in enumerate(header["networks"]):
        start = f"{number}."
        own = {name[len(start) :]: array for name, array in arrays.items() if name.startswith(start)}
        trained[str(entry["label"])] = _trained(entry, own)
    return NetworkSet(
        robot=str(header["robot"]),
        kinematics=header["kinematics"],
        spec=header["spec"],
        versions=header["versions"],
        trained=trained,
        skipped=header["skipped"],
    )


def _trained(entry: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Trained:
    layers = range(int(entry["layers"]))
    network = Network(
        label=str(entry["label"]),
        weights=tuple(arrays[f"weight.{layer}"] for layer in layers),
        biases=tuple(arrays[f"bias.{layer}"] for layer in layers),
        activation=entry["activation"],
        inputs=Scaling(entry["input_coding"], arrays["input.centre"], arrays["input.half"]),
        outputs=Scaling(entry["output_coding"], arrays["output.centre"], arrays["output.half"]),
    )
    numbers = {name: float(value) for name, value in entry["metrics"].items()}
    axes, panels = entry["map_axes"], tuple(entry["map_panels"])
    shown = ErrorMap((axes[0], axes[1]), panels, *(arrays[f"map.{name}"] for name in _MAP))
    inputs, truth, raw, refined = (arrays[f"test.{name}"] for name in _TEST)
    return Trained(network, numbers, inputs, truth, raw, refined, shown)
