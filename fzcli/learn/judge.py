"""How good a network is: raw and refined errors on poses that it was not trained on, both told."""

from dataclasses import dataclass

import numpy as np

from fzcli.learn.kinematic_map import Array, ErrorMap, KinematicMap, Samples
from fzcli.learn.network import Network
from fzcli.learn.neural import gate, refined
from fzcli.learn.train_spec import RefineSpec
from fzcli.spec.quantity import Signal

SHOWN = 200  # test poses kept beside the network, for figures


@dataclass(frozen=True)
class Trained:
    """A network with its metrics, its error map, and the first test samples with what it made of them."""

    network: Network
    metrics: dict[str, float]
    inputs: Array
    truth: Array
    raw: Array
    refined: Array
    error_map: ErrorMap


def metric_info(refine: RefineSpec) -> tuple[Signal, ...]:
    """Name, unit and meaning of every metric, in the order of the table."""
    found = [
        Signal("samples", "1", "samples it was trained on"),
        Signal("share", "1", "of the region's or range's candidates that are on this branch"),
        Signal("mse_train", "1", "mean square error of the scaled outputs, training set"),
        Signal("mse_test", "1", "mean square error of the scaled outputs, test set"),
        Signal("raw_distance_rms", "m", "position error of the network alone, root mean square"),
        Signal("raw_distance_median", "m", "position error of the network alone, median"),
        Signal("raw_distance_max", "m", "position error of the network alone, largest"),
        Signal("raw_angle_rms", "rad", "angle error of the network alone, root mean square"),
        Signal("raw_angle_median", "rad", "angle error of the network alone, median"),
        Signal("raw_angle_max", "rad", "angle error of the network alone, largest"),
    ]
    for steps in refine.steps:
        after = f"after {steps} Newton step{'s' if steps > 1 else ''}"
        found.append(Signal(f"distance_median_{steps}", "m", f"position error {after}, median"))
        found.append(Signal(f"distance_max_{steps}", "m", f"position error {after}, largest"))
        found.append(Signal(f"angle_max_{steps}", "rad", f"angle error {after}, largest"))
        near = f"{refine.distance:g} m and {refine.angle:g} rad"
        found.append(Signal(f"converged_{steps}", "1", f"share within {near} {after}"))
    found += [
        Signal("accepted", "1", "share that passes the gate after the last step"),
        Signal("false_accepts", "1", "samples that pass the gate and are off by more than 1000 gates"),
        Signal("seconds", "s", "time the training took"),
    ]
    return tuple(found)


def judge(map: KinematicMap, network: Network, test: Samples, refine: RefineSpec) -> Trained:
    """The network on a test set; ``metrics`` lack what only the training knows."""
    raw = network.predict(test.inputs)
    codes = network.codes(network.inputs.code(test.inputs)) - network.outputs.code(test.outputs)
    errors = map.miss(raw, test.outputs, test.inputs)
    metrics = {
        "mse_test": float((codes**2).mean()),
        "raw_distance_rms": float(np.sqrt((errors[:, 0] ** 2).mean())),
        "raw_distance_median": float(np.median(errors[:, 0])),
        "raw_distance_max": float(errors[:, 0].max()),
        "raw_angle_rms": float(np.sqrt((errors[:, 1] ** 2).mean())),
        "raw_angle_median": float(np.median(errors[:, 1])),
        "raw_angle_max": float(errors[:, 1].max()),
    }
    value, done = raw, 0
    for steps in refine.steps:
        value, done = refined(map, value, test.inputs, steps - done), steps
        errors = _counted(map.miss(value, test.outputs, test.inputs))
        metrics[f"distance_median_{steps}"] = float(np.median(errors[:, 0]))
        metrics[f"distance_max_{steps}"] = float(errors[:, 0].max())
        metrics[f"angle_max_{steps}"] = float(errors[:, 1].max())
        metrics[f"converged_{steps}"] = float((errors <= [refine.distance, refine.angle]).all(axis=1).mean())
    _, accepted = gate(map, value, test.inputs, network.label, refine.gate)
    metrics["accepted"] = float(accepted.mean())
    metrics["false_accepts"] = float((accepted & (errors > 1000 * refine.gate).any(axis=1)).sum())

    def both(inputs: Array, truth: Array) -> tuple[Array, Array]:
        first = network.predict(inputs)
        last = refined(map, first, inputs, refine.steps[-1])
        return map.miss(first, truth, inputs), _counted(map.miss(last, truth, inputs))

    shown = slice(SHOWN)
    test_map = map.error_map(network.label, test, both)
    return Trained(network, metrics, test.inputs[shown], test.outputs[shown], raw[shown], value[shown], test_map)


def _counted(errors: Array) -> Array:
    """Errors (N, 2) in which a Newton step that left the numbers counts as infinitely wrong."""
    return np.where(np.isfinite(errors), errors, np.inf)
