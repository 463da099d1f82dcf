"""The scripted loop of the benchmarks is sane enough to be measured against and compared with."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from fzcli.fuzzy.surface import build_surface
from fzcli.spec.load import load_rulebase
from fzcli.spec.rulebase import Centroid
from tests.oracle.plain_loop import Loop, run_plain_loop
from tests.oracle.table1_robot import bulgarelli4

ROOT = Path(__file__).parents[2]
Q0 = np.array([0.928, -1.393, 0.303, 0.549])


@pytest.fixture(scope="module")
def scripted():
    pytest.importorskip("pinocchio")
    pytest.importorskip("fuzzylite")
    path = ROOT / "benchmarks" / "scripted_loop.py"
    spec = importlib.util.spec_from_file_location("scripted_loop", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules["scripted_loop"] = module
    spec.loader.exec_module(module)
    return module


def test_line_is_followed_and_the_error_fades_after_it(scripted):
    rng = np.random.default_rng(4)
    tested = 0
    while tested < 5:
        q0, direction = Q0 + rng.uniform(-0.49, 0.49, 4), rng.normal(size=3)
        free = scripted.run(q0, direction, 0.5, 12.0, 0.0, fuzzy=False)
        if free["tip_error"].max() > 1e-2 or np.abs(free["yaw"]).max() > 0.4:
            continue  # the paper's trajectories are those that the arm can follow
        tested += 1
        run = scripted.run(q0, direction, 0.5, 12.0, 10.0, fuzzy=False, steps=1500)
        assert 1.5e-5 < run["tip_error"][:1200].mean() < 4e-5
        assert run["tip_error"][-1] < 0.01 * run["tip_error"].max()
        assert np.linalg.norm(run["base_quat"]) == pytest.approx(1.0, abs=1e-12)


def test_tip_moves_by_the_line(scripted):
    """Forward kinematics of the recorded joint angles, base from rest, ends where the line ends."""
    pin = pytest.importorskip("pinocchio")
    model = scripted.build_robot()
    data, hand = model.createData(), model.getFrameId("hand")

    def tip_from_com(q, quat):
        full = np.concatenate([np.zeros(3), quat[[1, 2, 3, 0]], q])
        pin.framesForwardKinematics(model, data, full)
        return data.oMf[hand].translation - pin.centerOfMass(model, data, full)

    direction = np.array([1.0, 0.2, -0.5]) / np.linalg.norm([1.0, 0.2, -0.5])
    run = scripted.run(Q0, direction, 0.4, 10.0, 100.0, fuzzy=False, steps=1300)
    moved = tip_from_com(run["qs"][-1], run["base_quat"]) - tip_from_com(Q0, np.array([1.0, 0, 0, 0]))
    np.testing.assert_allclose(moved, 0.4 * direction, atol=1e-6)


def test_tuner_raises_the_gain_while_nothing_oscillates(scripted):
    run = scripted.run(Q0, (1.0, 0.2, -0.5), 0.4, 10.0, 10.0, steps=40)
    assert not run["oscillating"].any()
    assert run["gain"][0] == 10.0
    assert np.all((np.diff(run["gain"]) > 0.5) & (np.diff(run["gain"]) < 2.5))


@pytest.mark.parametrize("fuzzy", [False, True])
def test_scripted_and_plain_loop_are_the_same_motion(scripted, fuzzy, monkeypatch):
    """Two implementations without common code, through steps where joints oscillate."""
    for name, value in (("AVERAGE", Loop.average), ("WINDOW", Loop.window), ("DEAD_BAND", Loop.ignore_below)):
        monkeypatch.setattr(scripted, name, value)
    rulebase = load_rulebase(ROOT / "rulebases" / "bulgarelli2011.yaml")
    sampled = rulebase.outputs["increment"].model_copy(
        update={"defuzzifier": Centroid(method="midpoint", samples=1001)}
    )
    surface = build_surface(rulebase.model_copy(update={"outputs": {"increment": sampled}}))
    direction = np.array([1.0, 0.2, -0.5]) / np.linalg.norm([1.0, 0.2, -0.5])
    line = (direction, 0.1, 1.0, 6e4)

    def increment(error, oscillating):
        return float(surface(error, oscillating)[0])

    run = scripted.run(Q0, *line, fuzzy=fuzzy)
    plain = run_plain_loop(bulgarelli4(), Q0, *line, increment if fuzzy else None)
    assert run["oscillating"].any()
    np.testing.assert_array_equal(run["oscillating"], plain.oscillating[:-1])
    np.testing.assert_allclose(run["gain"], plain.gain[:-1], rtol=1e-11)
    np.testing.assert_allclose(run["yaw"], plain.yaw[:-1], atol=1e-11)
    np.testing.assert_allclose(run["tip_error"], plain.tip_error[:-1], atol=1e-11)
    np.testing.assert_allclose(run["qs"], plain.q, atol=1e-11)


def test_oscillation_detector_step_by_step(scripted):
    rng = np.random.default_rng(5)
    velocities = np.cumsum(rng.normal(size=(300, 3)), axis=0) * 1e-3 + 1e-3 * rng.normal(size=(300, 3))
    detector = scripted.Oscillation(3)
    padded = np.vstack([np.zeros((scripted.AVERAGE - 1, 3)), velocities])
    side, first, second = [0.0] * 3, [-np.inf] * 3, [-np.inf] * 3
    counts = []
    for k in range(300):
        for i in range(3):
            d = velocities[k, i] - padded[k : k + scripted.AVERAGE, i].mean()
            if abs(d) > scripted.DEAD_BAND and np.sign(d) != side[i]:
                if side[i] != 0.0:
                    first[i], second[i] = k, first[i]
                side[i] = np.sign(d)
        counts.append(sum(k - t < scripted.WINDOW for t in second))
        assert detector.update(k, velocities[k]) == counts[-1]
    assert {0, 1, 2, 3} == set(counts)


def test_tuner_engine_at_hand_worked_points(scripted):
    tuner = scripted.build_tuner(2000)

    def increment(error, oscillating):
        tuner.input_variables[0].value, tuner.input_variables[1].value = error, oscillating
        with np.errstate(all="ignore"):
            tuner.process()
        return float(np.ravel(tuner.output_variables[0].value)[0])

    assert increment(0.0, 0.0) == pytest.approx(1.26, abs=0.5)
    assert increment(0.55, 0.0) == pytest.approx(4.2, abs=0.5)
    assert increment(1.0, 0.0) == pytest.approx(7.28, abs=0.5)
    assert increment(0.3, 2.0) == pytest.approx(-1660 + 830 / 3, abs=1.0)
