"""Run specs of ``kind: train`` to networks: drawn, trained, judged."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fzcli.errors import Problem, SpecError
from fzcli.learn import gradient, levenberg_marquardt, momentum
from fzcli.learn.arm_inverse import arm_inverse
from fzcli.learn.judge import Trained, judge
from fzcli.learn.kinematic_map import KinematicMap, Samples
from fzcli.learn.network import Network, fit_scaling
from fzcli.learn.network_set import NetworkSet
from fzcli.learn.planar_forward import planar_forward
from fzcli.learn.train_spec import ArmInverseSpec, PlanarForwardSpec, TrainRun, misfits
from fzcli.spec.any_robot import AnyRobot
from fzcli.spec.document import Document
from fzcli.spec.library import find
from fzcli.spec.load import check_kind
from fzcli.spec.parse import parse
from fzcli.spec.planar import Planar3RRR
from fzcli.spec.reader import read
from fzcli.spec.references import BESIDE
from fzcli.spec.sets import apply_sets

Report = Callable[[str, int, int], None]


def load_train(run: str | Path, sets: Sequence[str] = ()) -> TrainRun:
    """A training run by path or name. Raises SpecError with every problem found."""
    return train_of(read(run if isinstance(run, Path) or run == "-" else find("runs", run)), sets)


def train_of(document: Document, sets: Sequence[str] = ()) -> TrainRun:
    """Validate a document as a training run, against its robot too. Raises SpecError with every problem found."""
    document = apply_sets(document, sets) if sets else document
    check_kind(document, "train")
    spec = parse(document, TrainRun, context={BESIDE: document.path})
    problems = [document.problem(text, path) for path, text in misfits(spec)]
    if problems:
        raise SpecError(problems)
    try:
        kinematic_map(spec.whole_robot, spec.map)
    except SpecError as error:
        placed = [document.problem(one.message, tuple(filter(None, one.field.split(".")))) for one in error.problems]
        raise SpecError(placed) from None
    return spec


def kinematic_map(robot: AnyRobot, spec: PlanarForwardSpec | ArmInverseSpec) -> KinematicMap:
    """What a run learns. Raises SpecError where the robot or its branches do not suit it."""
    if isinstance(spec, PlanarForwardSpec) and isinstance(robot, Planar3RRR):
        return planar_forward(robot, spec)
    if isinstance(spec, ArmInverseSpec) and not isinstance(robot, Planar3RRR):
        return arm_inverse(robot, spec)
    raise SpecError(Problem(f"{spec.kind!r} does not suit the robot {robot.name!r}", field="map.kind"))


def train(spec: TrainRun, report: Report | None = None) -> NetworkSet:
    """Train and judge a network for every branch that occurs; those that do not are named in ``skipped``.

    The random numbers of a branch depend on the seed and its place in the list alone.

    Raises:
        SpecError: no branch occurs within the region or ranges, or a training diverged.
        UsageError: scikit-learn is needed and not installed.
    """
    found: dict[str, Trained] = {}
    skipped: dict[str, str] = {}
    map = kinematic_map(spec.whole_robot, spec.map)
    for index, label in enumerate(map.labels):
        if report is not None:
            report("networks", index, len(map.labels))
        sequence = np.random.SeedSequence((spec.seed, index))
        one = _train_one(spec, map, label, sequence)
        if one is None:
            skipped[label] = "does not occur, or too seldom, where samples are drawn"
        else:
            found[label] = one
    if not found:
        raise SpecError(Problem("no branch has a pose where samples are drawn", field="map"))
    if report is not None:
        report("networks", len(map.labels), len(map.labels))
    return NetworkSet.of(spec, found, skipped)


def _train_one(spec: TrainRun, map: KinematicMap, label: str, sequence: np.random.SeedSequence) -> Trained | None:
    rng = np.random.default_rng(sequence)
    count = spec.samples.train
    drawn = map.draw(rng, count + spec.samples.test, label)
    if drawn is None:
        return None
    begun = time.perf_counter()
    network = fit(spec, map, label, Samples(drawn.inputs[:count], drawn.outputs[:count], drawn.share), rng)
    seconds = time.perf_counter() - begun
    codes = network.codes(network.inputs.code(drawn.inputs[:count])) - network.outputs.code(drawn.outputs[:count])
    judged = judge(map, network, Samples(drawn.inputs[count:], drawn.outputs[count:], drawn.share), spec.refine)
    known = {
        "samples": float(count),
        "share": drawn.share,
        "mse_train": float((codes**2).mean()),
        "seconds": seconds,
    }
    return replace(judged, metrics=known | judged.metrics)


def fit(spec: TrainRun, map: KinematicMap, label: str, samples: Samples, rng: np.random.Generator) -> Network:
    """Train one network. Raises as ``train``."""
    inputs = fit_scaling(map.input_coding, samples.inputs)
    outputs = fit_scaling(map.output_coding, samples.outputs)
    x, y = inputs.code(samples.inputs), outputs.code(samples.outputs)
    hidden, activation = spec.network.hidden, spec.network.activation
    if spec.trainer.kind == "levenberg_marquardt":
        weights, biases = levenberg_marquardt.train(x, y, hidden[0], spec.trainer, rng)
    elif spec.trainer.kind == "momentum":
        weights, biases = momentum.train(x, y, hidden, activation, spec.trainer, rng)
    else:
        seed = int(rng.integers(2**31))
        weights, biases = gradient.train(x, y, hidden, activation, spec.trainer, seed)
    return Network(label, weights, biases, activation, inputs, outputs)
