"""A trained network with the scaling of its numbers: evaluated on arrays, and as a CasADi Function."""

from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Coding = Literal["numbers", "angles", "sin_cos"]
Activation = Literal["tanh", "relu"]


@dataclass(frozen=True)
class Scaling:
    """Physical values (N, v) <-> coded ones (N, c) of about -1 to 1: code = (value - centre) / half.

    ``coding`` "numbers": as they are; "angles": the difference from the centre is taken within half a turn,
    so that a training set that crosses +-180 deg stays in one piece; "sin_cos": the sines of all angles,
    then the cosines, are what is scaled (c = 2 v), for outputs that must not jump.
    """

    coding: Coding
    centre: Array
    half: Array

    @property
    def size(self) -> int:
        """Number of physical values."""
        return len(self.centre) // 2 if self.coding == "sin_cos" else len(self.centre)

    def code(self, values: Array) -> Array:
        """(N, c) of values (N, v)."""
        return np.asarray((_unscaled(self.coding, values, self.centre) - self.centre) / self.half)

    def value(self, codes: Array) -> Array:
        """(N, v) of codes (N, c); angles near the centre, or of "sin_cos" within +-pi."""
        found = codes * self.half + self.centre
        if self.coding == "sin_cos":
            found = np.arctan2(found[:, : self.size], found[:, self.size :])
        return np.asarray(found)


def fit_scaling(coding: Coding, values: Array) -> Scaling:
    """The scaling that brings values (N, v) to -1 to 1."""
    start = np.zeros(values.shape[1])
    if coding == "angles":
        start = np.arctan2(np.sin(values).mean(axis=0), np.cos(values).mean(axis=0))
    found = _unscaled(coding, values, start)
    low, high = found.min(axis=0), found.max(axis=0)
    half = (high - low) / 2
    return Scaling(coding, (low + high) / 2, np.where(half > 0, half, 1.0))


def _unscaled(coding: Coding, values: Array, centre: Array) -> Array:
    if coding == "sin_cos":
        return np.hstack([np.sin(values), np.cos(values)])
    if coding == "angles":
        return np.asarray(centre + np.remainder(values - centre + np.pi, 2 * np.pi) - np.pi)
    return values


@dataclass(frozen=True)
class Network:
    """A multilayer perceptron: hidden layers of one activation, linear output, its label and scalings.

    ``weights`` (inputs, outputs) and ``biases`` (outputs) a layer; ``label`` names the branch it was trained on.
    """

    label: str
    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    activation: Activation
    inputs: Scaling
    outputs: Scaling

    @property
    def hidden(self) -> tuple[int, ...]:
        """Units of each hidden layer."""
        return tuple(len(bias) for bias in self.biases[:-1])

    def codes(self, codes: Array) -> Array:
        """Coded outputs of coded inputs (N, c)."""
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            codes = codes @ weight + bias
            codes = np.tanh(codes) if self.activation == "tanh" else np.maximum(codes, 0)
        return np.asarray(codes @ self.weights[-1] + self.biases[-1])

    def predict(self, values: Array) -> Array:
        """Physical outputs (N, o) of physical inputs (N, i)."""
        return self.outputs.value(self.codes(self.inputs.code(np.asarray(values, dtype=float))))

    def function(self) -> ca.Function:
        """The network as a Function input (i) -> output (o); it can be called on SX and MX too."""
        x = ca.MX.sym("input", self.inputs.size)
        layer = (_symbolic_code(self.inputs, x) - ca.DM(self.inputs.centre)) / ca.DM(self.inputs.half)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            layer = ca.mtimes(ca.DM(weight.T), layer) + ca.DM(bias)
            layer = ca.tanh(layer) if self.activation == "tanh" else ca.fmax(layer, 0)
        layer = ca.mtimes(ca.DM(self.weights[-1].T), layer) + ca.DM(self.biases[-1])
        found = layer * ca.DM(self.outputs.half) + ca.DM(self.outputs.centre)
        if self.outputs.coding == "sin_cos":
            found = ca.atan2(found[: self.outputs.size], found[self.outputs.size :])
        return ca.Function("network", [x], [found], ["input"], ["output"])


def _symbolic_code(scaling: Scaling, x: ca.MX) -> ca.MX:
    if scaling.coding == "sin_cos":
        return ca.vertcat(ca.sin(x), ca.cos(x))
    if scaling.coding == "angles":
        turns = (x - ca.DM(scaling.centre)) / (2 * np.pi)
        return x - 2 * np.pi * ca.floor(turns + 0.5)
    return x
