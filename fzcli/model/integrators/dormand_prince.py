"""Dormand and Prince's method of orders 5 and 4 with error control, the attitude in the exponential chart.

For references and for stiff moments, on the host: a step is parted into as many inner ones as the tolerance asks.
Source: Dormand and Prince 1980, A family of embedded Runge-Kutta formulae, RK5(4)7M.
"""

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fzcli.errors import IntegrationError
from fzcli.model.integrators.group import in_chart, moved

Array = NDArray[np.float64]

_STAGES = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
_FOURTH = (5179 / 57600, 0.0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100, 1 / 40)
_SAFETY, _LEAST, _MOST = 0.9, 0.2, 5.0  # of the next inner step over this one


@dataclass(frozen=True)
class Advanced:
    """A finished step: the state, the inner steps taken and refused, and the inner step [s] to go on with."""

    state: Array
    taken: int
    refused: int
    inner: float


@dataclass(frozen=True)
class DormandPrince:
    """The method over one (state, input) -> rate; made by `dormand_prince`.

    ``trial``: (state, input, dt) -> (state_next, its error as a tangent). The error of every entry stays
    below ``absolute`` + ``relative`` |entry| an inner step, of the attitude below their sum [rad].
    """

    trial: ca.Function
    attitude: int | None
    relative: float
    absolute: float
    inner_steps: int
    names: tuple[str, ...]

    def advance(self, state: ArrayLike, given: ArrayLike, dt: float, inner: float | None = None) -> Advanced:
        """One step of ``dt`` [s] under a constant input; ``inner``: the first inner step to try.

        Raises:
            IntegrationError: the step is too large for ``inner_steps`` inner ones, or the rate is not finite.
        """
        place: Array = np.array(state, dtype=float).ravel()
        held: Array = np.array(given, dtype=float).ravel()
        done, taken, refused = 0.0, 0, 0
        inner = dt if inner is None else min(inner, dt)
        worst = 0
        while done < dt:
            last = done + inner >= dt * (1 - 1e-12)
            length = dt - done if last else inner
            following, error = (np.array(part).ravel() for part in self.trial(place, held, length))
            share = self._share(place, following, error)
            worst, size = int(np.argmax(share)), float(np.max(share))
            if taken + refused >= self.inner_steps or (not math.isfinite(size) and length < 1e-14 * dt):
                raise self._too_large(dt, done, length, worst, taken + refused)
            if not math.isfinite(size):
                refused, inner = refused + 1, _LEAST * length
                continue
            if size <= 1:
                place, taken, done = following, taken + 1, dt if last else done + length
            else:
                refused += 1
            factor = min(_MOST, max(_LEAST, _SAFETY * size**-0.2)) if size > 0 else _MOST
            inner = max(inner, factor * length) if last and size <= 1 else factor * length
        return Advanced(place, taken, refused, inner)

    def _share(self, before: Array, after: Array, error: Array) -> Array:
        """Each entry's error over what is allowed, (tangent); not a number where the step blew up."""
        size = np.maximum(np.abs(before), np.abs(after))
        if self.attitude is not None:
            a = self.attitude
            size = np.concatenate([size[:a], np.ones(3), size[a + 4 :]])
        found: Array = np.abs(error) / (self.absolute + self.relative * size)
        return np.where(np.isnan(found), np.inf, found)

    def _too_large(self, dt: float, done: float, length: float, worst: int, tried: int) -> IntegrationError:
        name = self.names[worst] if self.names else f"entry {worst} of the rate"
        return IntegrationError(
            f"dormand_prince: a step of {dt:g} s is too large: {tried} inner steps, the last of {length:.3g} s, "
            f"came {done:.3g} s far; the error is worst in {name}. Shorten the step, allow more inner steps or "
            f"loosen the tolerance (relative {self.relative:g}, absolute {self.absolute:g})"
        )


def dormand_prince(
    rate: ca.Function,
    attitude: int | None,
    relative: float = 1e-9,
    absolute: float = 1e-9,
    inner_steps: int = 1000,
    names: tuple[str, ...] = (),
) -> DormandPrince:
    """The method over a rate; ``names`` of the rate's entries serve the message of a refusal."""
    state, given = ca.SX.sym("state", rate.size1_in(0)), ca.SX.sym("input", rate.size1_in(1))
    dt = ca.SX.sym("dt")
    slopes = [rate(state, given)]
    for weights in _STAGES:
        tangent = dt * _mean(weights, slopes)
        slopes.append(in_chart(state, tangent, lambda place: rate(place, given), attitude))
    following = moved(state, tangent, attitude)  # the last stage stands at the fifth-order end
    error = dt * _mean(tuple(b - c for b, c in zip((*_STAGES[-1], 0.0), _FOURTH, strict=True)), slopes)
    outputs = ca.cse([ca.densify(following), ca.densify(error)])
    trial = ca.Function("trial", [state, given, dt], outputs, ["state", "input", "dt"], ["state_next", "error"])
    return DormandPrince(trial, attitude, relative, absolute, inner_steps, names)


def _mean(weights: tuple[float, ...], slopes: list[ca.SX]) -> ca.SX:
    return sum((weight * slope for weight, slope in zip(weights, slopes, strict=True) if weight), ca.SX(0))
