"""Short trainings: what they reach, what they refuse, what they keep."""

import sys
from typing import Any

import numpy as np
import pytest
from learn_cases import ARM, PLANAR, run

from fzcli.errors import SpecError, UsageError
from fzcli.learn.judge import metric_info
from fzcli.learn.network_set import NetworkSet
from fzcli.learn.train import kinematic_map, train
from fzcli.model.planar_3rrr import build_planar_model
from fzcli.spec.planar import Planar3RRR


def test_every_branch_that_occurs_gets_a_network(planar: NetworkSet) -> None:
    assert list(planar.trained) == ["+++ det+", "++- det+", "++- det-"]
    assert planar.skipped == {"+++ det-": "does not occur, or too seldom, where samples are drawn"}
    share = {label: one.metrics["share"] for label, one in planar.trained.items()}
    assert share["+++ det+"] == 1
    assert 0 < share["++- det+"] < 0.05
    for one in planar.trained.values():
        assert set(one.metrics) == {each.name for each in metric_info(planar.refine)}


def test_raw_and_refined_errors_are_both_told(planar: NetworkSet) -> None:
    metrics = planar.trained["+++ det+"].metrics
    assert metrics["mse_test"] < 3e-5
    assert 1e-4 < metrics["raw_distance_rms"] < 1e-3
    assert metrics["converged_2"] > 0.99
    assert metrics["distance_max_3"] < 1e-9
    assert metrics["accepted"] > 0.99
    assert all(one.metrics["false_accepts"] == 0 for one in planar.trained.values())


def test_what_is_kept_of_the_test_agrees_with_the_network(planar: NetworkSet) -> None:
    for one in planar.trained.values():
        assert one.network.predict(one.inputs) == pytest.approx(one.raw, abs=1e-12)
        good = np.abs(one.refined - one.truth).max(axis=1) < 1e-6
        assert good.mean() > 0.9


def test_error_maps_cover_the_branch(planar: NetworkSet) -> None:
    whole, part = (planar.trained[label].error_map for label in ("+++ det+", "++- det+"))
    x, y = np.meshgrid(whole.x, whole.y)
    inside = np.hypot(x, y) <= 0.1
    assert (np.isfinite(whole.raw[1]) == inside).all()
    assert np.isfinite(part.raw).sum() < 0.1 * np.isfinite(whole.raw).sum()
    assert np.nanmedian(whole.refined) < 1e-6 * np.nanmedian(whole.raw)
    assert whole.panels == ("phi = -15 deg", "phi = 0 deg", "phi = 15 deg")


def test_without_the_sign_of_det_a_the_map_has_two_values() -> None:
    """The finding that the labels rest on: poses of one mode that share their joint angles."""
    spec = run(PLANAR)
    assert isinstance(spec.robot, Planar3RRR)
    model = build_planar_model(spec.robot)
    learned = kinematic_map(spec.robot, spec.map)
    samples = learned.draw(np.random.default_rng(1), 60, "++- det+")
    assert samples is not None
    twins = 0
    for theta in samples.inputs:
        found = model.forward(theta)
        labels = model.labels(found, np.tile(theta, (len(found), 1)))
        signs = [sign for mode, sign in labels if mode == "++-"]
        assert signs.count(1) >= 1
        twins += -1 in signs
    assert twins > 40


def test_networks_do_not_depend_on_which_others_are_trained(planar: NetworkSet) -> None:
    alone = train(run(PLANAR, map={**PLANAR["map"], "modes": ["+++"]}))
    one, other = alone.trained["+++ det+"].network, planar.trained["+++ det+"].network
    assert (one.weights[0] == other.weights[0]).all()


def test_the_paper_s_recipe_trains() -> None:
    trainer = {"kind": "momentum", "iterations": 400}
    spec = run(PLANAR, map={**PLANAR["map"], "modes": ["+++"], "split": False}, trainer=trainer)
    found = train(spec)
    assert list(found.trained) == ["+++"]
    metrics = found.trained["+++"].metrics
    assert metrics["mse_test"] < 0.1
    assert metrics["converged_3"] > 0.9


def test_a_training_that_diverges_says_so() -> None:
    trainer = {"kind": "momentum", "iterations": 500, "rate": 1e6}
    with pytest.raises(SpecError, match=r"trainer: the training diverged at rate 1e\+06; make it smaller"):
        train(run(PLANAR, trainer=trainer))


def test_an_arm_s_branch(arm: NetworkSet) -> None:
    metrics = arm.trained["front, elbow up, noflip"].metrics
    assert metrics["raw_distance_rms"] < 0.015
    assert metrics["converged_5"] == 1
    assert metrics["accepted"] == 1
    shown = arm.trained["front, elbow up, noflip"].error_map
    assert shown.axes == ("tip from z axis [m]", "tip height [m]")
    assert np.nanmax(shown.refined) < 1e-6


def test_adam_on_an_arm() -> None:
    pytest.importorskip("sklearn")
    trainer = {"kind": "adam", "epochs": 5, "rates": [3e-3, 1e-3], "batch": 50}
    found = train(run(ARM, trainer=trainer, network={"hidden": [32, 32], "activation": "relu"}))
    metrics = found.trained["front, elbow up, noflip"].metrics
    assert metrics["raw_distance_rms"] < 0.05
    assert metrics["converged_5"] > 0.95


def test_scikit_learn_missing_is_said_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn.neural_network", None)
    with pytest.raises(UsageError, match=r"needs scikit-learn: pip install 'fzcli\[learn\]'"):
        train(run(PLANAR, trainer={"kind": "adam", "epochs": 1}))


BAD: list[tuple[dict[str, Any], dict[str, Any], str]] = [
    (PLANAR, {"robot": "ur5"}, "map.kind: 'planar_forward' does not suit the robot 'ur5'; arm_inverse does"),
    (ARM, {"robot": "rrr_planar"}, "map.kind: 'arm_inverse' does not suit the robot 'rrr_planar'"),
    (PLANAR, {"tool": {"xyz": [0, 0, 0.1]}}, "tool: a planar_3rrr carries no tool"),
    (PLANAR, {"network": {"hidden": [8, 8]}}, "levenberg_marquardt trains one hidden layer of tanh units"),
    (PLANAR, {"network": {"hidden": [300]}}, "trains up to 100 units, got 300"),
    (PLANAR, {"refine": {"steps": [3, 1]}}, "steps must rise"),
    (PLANAR, {"map": {**PLANAR["map"], "radius": -0.1}}, "map.radius: must be > 0"),
    (ARM, {"map": {**ARM["map"], "branches": ["front, elbow up, nofilp"]}}, "did you mean 'front, elbow up, noflip'?"),
    (ARM, {"map": {**ARM["map"], "joints": {"J7": [0, 1]}}}, "no joint 'J7'"),
    (ARM, {"map": {**ARM["map"], "joints": {"J5": ["8 deg", "100 deg"]}}}, "must rise within the joint's limits"),
    (ARM, {"robot": "arm3r"}, "has no closed-form inverse whose branches could be told apart"),
]


@pytest.mark.parametrize(("base", "changes", "message"), BAD)
def test_bad_runs_are_refused_by_name(base: dict[str, Any], changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError) as caught:
        run(base, **changes)
    assert message in str(caught.value)


def test_a_region_that_no_branch_reaches() -> None:
    away = {**PLANAR["map"], "radius": 1e-3, "turn": "0.1 deg", "modes": ["+++"], "off_singular": 50.0}
    with pytest.raises(SpecError, match="no branch has a pose where samples are drawn"):
        train(run(PLANAR, map=away, samples={"train": 50, "test": 10}))




@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_back_propagation_against_differences(activation: Any) -> None:
    from fzcli.learn.momentum import _slopes, _start

    rng = np.random.default_rng(5)
    x, y = rng.uniform(-1, 1, (40, 3)), rng.uniform(-1, 1, (40, 2))
    weights, biases = _start(3, (5, 4), 2, rng)

    def error() -> float:
        layer = x
        for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
            layer = np.tanh(layer @ weight + bias) if activation == "tanh" else np.maximum(layer @ weight + bias, 0)
        return 0.5 * float(((layer @ weights[-1] + biases[-1] - y) ** 2).sum()) / len(x)

    slopes, h = _slopes(x, y, weights, biases, activation), 1e-6
    for value, slope in zip((*weights, *biases), slopes, strict=True):
        for place in np.ndindex(value.shape):
            before = value[place]
            value[place] = before + h
            late = error()
            value[place] = before - h
            assert (late - error()) / (2 * h) == pytest.approx(slope[place], abs=1e-8)
            value[place] = before
