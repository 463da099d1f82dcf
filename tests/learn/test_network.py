"""Networks and their scalings, on arrays and as CasADi Functions."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

from fzcli.learn.levenberg_marquardt import _hidden, normal_equations, train
from fzcli.learn.network import Coding, Network, fit_scaling
from fzcli.learn.trainers import LevenbergMarquardtSpec


@pytest.mark.parametrize("coding", ["numbers", "angles", "sin_cos"])
def test_codes_lie_in_the_unit_box_and_lead_back(coding: Coding) -> None:
    values = np.random.default_rng(1).uniform(2.0, 4.5, (200, 3))
    scaling = fit_scaling(coding, values)
    codes = scaling.code(values)
    assert codes.min() == pytest.approx(-1)
    assert codes.max() == pytest.approx(1)
    assert scaling.size == 3
    turns = (scaling.value(codes) - values) / (2 * np.pi)
    assert np.abs(turns - np.round(turns)).max() < 1e-14
    if coding == "numbers":
        assert np.abs(turns).max() < 1e-14


def test_angles_that_cross_half_a_turn_stay_in_one_piece() -> None:
    values = np.random.default_rng(2).uniform(np.pi - 0.2, np.pi + 0.2, (100, 1))
    wrapped = np.arctan2(np.sin(values), np.cos(values))
    assert np.ptp(wrapped) > 6
    scaling = fit_scaling("angles", wrapped)
    assert scaling.half[0] < 0.21
    assert scaling.code(wrapped) == pytest.approx(scaling.code(values), abs=1e-12)


def test_a_constant_input_does_no_harm() -> None:
    scaling = fit_scaling("numbers", np.ones((5, 2)))
    assert (scaling.code(np.ones((5, 2))) == 0).all()


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("codings", [("angles", "numbers"), ("numbers", "sin_cos"), ("sin_cos", "numbers")])
def test_the_function_is_the_network(activation: str, codings: tuple[Coding, Coding]) -> None:
    rng = np.random.default_rng(3)
    values = rng.uniform(-6, 6, (50, 3))
    outputs = rng.uniform(-3, 3, (50, 2))
    into, out = fit_scaling(codings[0], values), fit_scaling(codings[1], outputs)
    sizes = [len(into.centre), 7, 5, len(out.centre)]
    weights = tuple(rng.normal(size=(a, b)) for a, b in pairwise(sizes))
    biases = tuple(rng.normal(size=b) for b in sizes[1:])
    network = Network("x", weights, biases, activation, into, out)  # type: ignore[arg-type]
    assert network.hidden == (7, 5)
    function = network.function()
    found = np.array(function(values.T)).T
    assert found == pytest.approx(network.predict(values), abs=1e-12)
    assert isinstance(function(ca.SX.sym("x", 3)), ca.SX)


def test_normal_equations_are_those_of_the_jacobian() -> None:
    rng = np.random.default_rng(4)
    x = np.hstack([rng.normal(size=(40, 3)), np.ones((40, 1))])
    targets, first, second = rng.normal(size=(40, 2)), rng.normal(size=(4, 5)), rng.normal(size=(6, 2))

    def errors(p: np.ndarray) -> np.ndarray:
        return (_hidden(x, p[:20].reshape(4, 5)) @ p[20:].reshape(6, 2) - targets).ravel()

    at, h = np.concatenate([first.ravel(), second.ravel()]), 1e-6
    jacobian = np.array([(errors(at + h * e) - errors(at - h * e)) / (2 * h) for e in np.eye(len(at))]).T
    H, gradient = normal_equations(x, targets, first, second)
    assert pytest.approx(jacobian.T @ jacobian / 40, abs=1e-8) == H
    assert gradient == pytest.approx(jacobian.T @ errors(at) / 40, abs=1e-8)


def test_levenberg_marquardt_recovers_a_network_of_its_own_size() -> None:
    rng = np.random.default_rng(5)
    x = rng.uniform(-1, 1, (400, 2))
    targets = np.tanh(x @ rng.normal(size=(2, 3)) + rng.normal(size=3)) @ rng.normal(size=(3, 2))
    spec = LevenbergMarquardtSpec(kind="levenberg_marquardt", iterations=400, starts=5)
    (first, second), (bias, last) = train(x, targets, 3, spec, np.random.default_rng(6))
    found = np.tanh(x @ first + bias) @ second + last
    assert ((found - targets) ** 2).mean() < 1e-10


def test_training_is_repeatable() -> None:
    x = np.random.default_rng(7).uniform(-1, 1, (100, 2))
    spec = LevenbergMarquardtSpec(kind="levenberg_marquardt", iterations=10, starts=2)
    one, other = (train(x, x**2, 4, spec, np.random.default_rng(8)) for _ in range(2))
    assert all((a == b).all() for a, b in zip(one[0], other[0], strict=True))
