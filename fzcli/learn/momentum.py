"""Gradient descent with momentum on the whole training set: the recipe of Parsa 2008."""

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import Problem, SpecError
from fzcli.learn.levenberg_marquardt import Layers
from fzcli.learn.network import Activation
from fzcli.learn.trainers import MomentumSpec

Array = NDArray[np.float64]
SPREAD = 0.7  # Nguyen and Widrow's


def train(
    inputs: Array,
    targets: Array,
    hidden: tuple[int, ...],
    activation: Activation,
    spec: MomentumSpec,
    rng: np.random.Generator,
) -> Layers:
    """Weights and biases that map coded inputs (N, i) to coded targets (N, o); the error is half the mean square.

    Raises:
        SpecError: the training diverged; a smaller rate is advised.
    """
    weights, biases = _start(inputs.shape[1], hidden, targets.shape[1], rng)
    pace = [np.zeros_like(one) for one in (*weights, *biases)]
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(spec.iterations):
            slopes = _slopes(inputs, targets, weights, biases, activation)
            for value, speed, slope in zip((*weights, *biases), pace, slopes, strict=True):
                speed *= spec.momentum
                speed -= spec.rate * slope
                value += speed
    if not all(np.isfinite(one).all() for one in (*weights, *biases)):
        raise SpecError(Problem(f"the training diverged at rate {spec.rate:g}; make it smaller", field="trainer"))
    return tuple(weights), tuple(biases)


def _start(
    inputs: int, hidden: tuple[int, ...], outputs: int, rng: np.random.Generator
) -> tuple[list[Array], list[Array]]:
    """Units spread evenly over inputs within -1 and 1 (Nguyen and Widrow 1990), small random weights to the outputs.

    The text does not say how it starts; so started, the recipe ends lower than from plain random weights.
    """
    sizes = (inputs, *hidden)
    weights, biases = [], []
    for before, units in zip(sizes[:-1], hidden, strict=True):
        size = SPREAD * units ** (1 / before)
        way = rng.uniform(-1, 1, (before, units))
        weights.append(size * way / np.linalg.norm(way, axis=0))
        biases.append(size * np.linspace(-1, 1, units) * np.sign(way[0]))
    weights.append(rng.uniform(-0.5, 0.5, (sizes[-1], outputs)))
    biases.append(rng.uniform(-0.5, 0.5, outputs))
    return weights, biases


def _slopes(
    inputs: Array, targets: Array, weights: list[Array], biases: list[Array], activation: Activation
) -> list[Array]:
    """The error's derivatives by all weights, then by all biases: back propagation."""
    layers = [inputs]
    for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
        sums = layers[-1] @ weight + bias
        layers.append(np.tanh(sums) if activation == "tanh" else np.maximum(sums, 0))
    back = (layers[-1] @ weights[-1] + biases[-1] - targets) / len(inputs)
    by_weights, by_biases = [], []
    for number in reversed(range(len(weights))):
        by_weights.append(layers[number].T @ back)
        by_biases.append(back.sum(axis=0))
        if number:
            out = layers[number]
            back = (back @ weights[number].T) * (1 - out * out if activation == "tanh" else out > 0)
    return [*by_weights[::-1], *by_biases[::-1]]
