"""Levenberg-Marquardt for a network of one hidden tanh layer.

No well-kept package trains small networks to high precision with it, and first-order methods stop at a
mean square error tens to hundreds of times larger (Hagan and Menhaj 1994). The whole training set enters
each step only through one Gram matrix, since the Jacobian's columns of all outputs share their factors.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fzcli.learn.trainers import LevenbergMarquardtSpec

Array = NDArray[np.float64]
Layers = tuple[tuple[Array, ...], tuple[Array, ...]]  # weights, biases

_SHRINK, _GROW, _STUCK = 0.3, 4.0, 1e12
_SPREAD = 0.7  # of Nguyen and Widrow's starting weights
_STILL, _PATIENCE = 1e-7, 30  # relative gain below which a step counts as idle; so many end the training


@dataclass
class _State:
    """Weights of both layers, inputs with a bias row each, mean square error and damping."""

    first: Array
    second: Array
    cost: float
    damping: float = 1e-2
    idle: int = 0
    done: bool = False


def train(inputs: Array, targets: Array, units: int, spec: LevenbergMarquardtSpec, rng: np.random.Generator) -> Layers:
    """Weights and biases that map coded inputs (N, i) to coded targets (N, o) in the least mean square."""
    x = np.hstack([inputs, np.ones((len(inputs), 1))])
    states = [_start(x, targets, units, rng) for _ in range(spec.starts)]
    trial = spec.iterations // 5 if spec.starts > 1 else 0
    for state in states:
        _descend(state, x, targets, trial)
    best = min(states, key=lambda state: state.cost)
    _descend(best, x, targets, spec.iterations - trial)
    return (best.first[:-1], best.second[:-1]), (best.first[-1], best.second[-1])


def _start(x: Array, targets: Array, units: int, rng: np.random.Generator) -> _State:
    """Nguyen and Widrow's first layer, and the second one that suits it best."""
    n = x.shape[1] - 1
    first = rng.normal(size=(n + 1, units))
    size = _SPREAD * units ** (1 / n)
    first[:-1] *= size / np.linalg.norm(first[:-1], axis=0)
    first[-1] = size * rng.uniform(-1, 1, units)
    hidden = _hidden(x, first)
    second = np.linalg.lstsq(hidden, targets, rcond=1e-8)[0].astype(float)
    return _State(first, second, float(((hidden @ second - targets) ** 2).mean()))


def _hidden(x: Array, first: Array) -> Array:
    return np.hstack([np.tanh(x @ first), np.ones((len(x), 1))])


def _descend(state: _State, x: Array, targets: Array, iterations: int) -> None:
    """So many steps, or until nothing is gained any more."""
    for _ in range(iterations):
        if state.done:
            return
        before = state.cost
        _step(state, x, targets)
        state.idle = state.idle + 1 if before - state.cost <= _STILL * before else 0
        state.done = state.done or state.idle >= _PATIENCE


def _step(state: _State, x: Array, targets: Array) -> None:
    """One step downhill; the damping grows until there is one."""
    H, gradient = normal_equations(x, targets, state.first, state.second)
    scale = np.maximum(np.diag(H), 1e-12 * float(np.diag(H).max()))
    while state.damping < _STUCK:
        try:
            move = np.linalg.solve(H + np.diag(state.damping * scale), gradient)
        except np.linalg.LinAlgError:
            state.damping *= _GROW
            continue
        count = state.first.size
        first = state.first - move[:count].reshape(state.first.shape)
        second = state.second - move[count:].reshape(state.second.shape)
        cost = float(((_hidden(x, first) @ second - targets) ** 2).mean())
        if cost < state.cost:
            state.first, state.second, state.cost = first, second, cost
            state.damping = max(state.damping * _SHRINK, 1e-15)
            return
        state.damping *= _GROW
    state.done = True


def normal_equations(x: Array, targets: Array, first: Array, second: Array) -> tuple[Array, Array]:
    """J^T J and J^T e over the number of samples, e the errors of all outputs, J their Jacobian.

    ``x`` (N, i + 1) has a column of ones, ``first`` (i + 1, h), ``second`` (h + 1, o); parameters are first's
    entries, row by row, then second's.
    """
    count, outputs = len(x), second.shape[1]
    hidden = _hidden(x, first)
    error = hidden @ second - targets
    slope = 1 - hidden[:, :-1] ** 2
    factors = (x[:, :, None] * slope[:, None, :]).reshape(count, -1)  # of the first layer's columns
    columns = np.hstack([factors, hidden])
    G = columns.T @ columns / count
    p, out = first.size, second[:-1]
    H = np.zeros((p + second.size, p + second.size))
    H[:p, :p] = G[:p, :p] * np.tile(out @ out.T, (x.shape[1], x.shape[1]))
    cross = G[:p, p:, None] * np.tile(out, (x.shape[1], 1))[:, None, :]
    H[:p, p:] = cross.reshape(p, -1)
    H[p:, :p] = H[:p, p:].T
    H[p:, p:] = np.kron(G[p:, p:], np.eye(outputs))
    back = (error @ out.T) * slope
    gradient = np.concatenate([(x.T @ back).ravel(), (hidden.T @ error).ravel()]) / count
    return H, gradient
