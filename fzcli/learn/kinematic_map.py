"""What can be learned: a map between exact quantities of a robot, with its branches, errors and Newton step."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.learn.network import Coding

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_BLOCK = 20_000  # candidates drawn at a time
_MOST = 400  # candidates for one sample, at the most


@dataclass(frozen=True)
class Samples:
    """Inputs (N, i) and outputs (N, o) of one branch; ``share`` of the candidates were on it."""

    inputs: Array
    outputs: Array
    share: float


@dataclass(frozen=True)
class ErrorMap:
    """Errors over a plane: ``raw`` and ``refined`` (panels, y, x) [m], NaN where there is nothing.

    ``x`` and ``y`` are cell centres [m]; ``axes`` name them, ``panels`` say what each panel holds.
    """

    axes: tuple[str, str]
    panels: tuple[str, ...]
    x: Array
    y: Array
    raw: Array
    refined: Array


class KinematicMap(Protocol):
    """A map that networks learn, one network a branch.

    ``improve``: Function (output, input) -> output after one Newton step on the exact kinematics.
    ``residual``: Function (output, input) -> (2) [m, rad], how far the exact kinematics are from being met.
    """

    @property
    def labels(self) -> tuple[str, ...]:
        """The branches to train."""
    @property
    def input_names(self) -> tuple[str, ...]:
        """What goes in, with units."""
    @property
    def output_names(self) -> tuple[str, ...]:
        """What comes out, with units."""
    @property
    def input_coding(self) -> Coding:
        """How a network sees the input."""
    @property
    def output_coding(self) -> Coding:
        """How a network gives the output."""
    @property
    def improve(self) -> ca.Function:
        """See the class."""
    @property
    def residual(self) -> ca.Function:
        """See the class."""

    def draw(self, rng: np.random.Generator, count: int, label: str) -> Samples | None:
        """Samples of a branch, or None where it does not occur (often enough)."""

    def miss(self, outputs: Array, truth: Array, inputs: Array) -> Array:
        """(N, 2) [m, rad]: how far the platform's or tip's pose is off."""

    def belongs(self, outputs: Array, inputs: Array, label: str) -> Mask:
        """(N,) whether outputs lie on a branch, and where its network was trained."""

    def error_map(self, label: str, samples: Samples, errors: "Errors") -> ErrorMap:
        """Raw and refined errors over a plane. ``samples`` are those of the test."""


Errors = Callable[[Array, Array], tuple[Array, Array]]  # inputs, truth -> raw and refined errors (N, 2) [m, rad]


def on_columns(function: ca.Function, *rows: Array) -> Array:
    """A Function of column vectors on N rows each: its first output, (N, k)."""
    found = function(*(ca.DM(np.ascontiguousarray(one.T)) for one in rows))
    return np.asarray(found[0] if isinstance(found, tuple) else found, dtype=float).T


def collect(draw: Callable[[int], tuple[Array, Array]], count: int) -> Samples | None:
    """The first ``count`` samples that pass; ``draw(n)`` tries n candidates and gives those that do."""
    inputs, outputs = [], []
    found = tried = 0
    while found < count:
        if tried >= min(_MOST * count, (found * 2 + 1) * 20 * _BLOCK):
            return None
        more, made = draw(_BLOCK)
        tried += _BLOCK
        found += len(more)
        inputs.append(more)
        outputs.append(made)
    return Samples(np.vstack(inputs)[:count], np.vstack(outputs)[:count], found / tried)
