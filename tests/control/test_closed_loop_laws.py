"""What the laws do in a loop: tuner, base reference, drift compensation, several axes."""

import numpy as np
import pytest

from fzcli.fuzzy.surface import build_surface
from fzcli.loop.rollout import Rollout
from fzcli.loop.simulate import simulate
from tests.loop.cases import run_spec

pytestmark = pytest.mark.usefixtures("machine")


def _check_tuner(rollout: Rollout, axes: dict[str, str], limit: float = np.inf) -> None:
    """gain(k+1) = clip(gain(k) + increment(|ec(k)| / 0.1, oscillating(k))), axis by axis."""
    surface = build_surface(run_spec(controller__kind="fuzzy_clik").controller.rulebase)
    oscillating = rollout.signals["oscillating_joints"]
    for axis, suffix in axes.items():
        gain, error = rollout.signals[f"gain{suffix}"], rollout.signals[f"{axis}_error"]
        scaled = np.abs(error) / 0.1
        increment = np.array(surface.map(len(gain))(scaled[None], oscillating[None])[0]).ravel()
        np.testing.assert_allclose(rollout.signals[f"gain_increment{suffix}"], increment, rtol=1e-9, atol=1e-9)
        following = np.clip(gain[:-1] + increment[:-1], 0.0, limit)
        np.testing.assert_allclose(gain[1:], following, rtol=1e-12, atol=1e-9)
        assert gain.min() >= 0.0
        assert gain.max() <= limit


@pytest.mark.parametrize("kind", ["fuzzy_clik", "fuzzy_task_priority"])
def test_the_tuner_uses_the_gain_of_the_step_before(kind: str) -> None:
    rollout = simulate(run_spec(controller__kind=kind, controller__gain=10.0, duration=6.0))
    assert rollout.signals["gain"][0] == 10.0
    _check_tuner(rollout, {"yaw": ""})


def test_a_gain_far_too_high_falls_and_never_below_zero() -> None:
    rollout = simulate(run_spec(controller__kind="fuzzy_clik", controller__gain=40000.0, duration=10.0))
    assert rollout.signals["oscillating_joints"].max() > 0
    assert (rollout.signals["gain"] == 0.0).any()
    _check_tuner(rollout, {"yaw": ""})


def test_a_ceiling_holds() -> None:
    rollout = simulate(
        run_spec(controller__kind="fuzzy_clik", controller__gain=10.0, controller__gain_limit=40.0, duration=3.0)
    )
    _check_tuner(rollout, {"yaw": ""}, limit=40.0)
    assert rollout.metrics["gain_final"] == 40.0


def test_every_axis_is_tuned_by_its_own_error() -> None:
    rollout = simulate(
        run_spec(
            controller__kind="fuzzy_clik",
            controller__constraint=["pitch", "yaw"],
            controller__gain=[10.0, 200.0],
            duration=5.0,
        )
    )
    assert (rollout.signals["gain_pitch"][0], rollout.signals["gain_yaw"][0]) == (10.0, 200.0)
    _check_tuner(rollout, {"pitch": "_pitch", "yaw": "_yaw"})
    assert np.ptp(rollout.signals["gain_increment_pitch"] - rollout.signals["gain_increment_yaw"]) > 0.1


def test_firing_strengths_are_those_of_the_surface() -> None:
    rollout = simulate(run_spec(controller__kind="fuzzy_clik", duration=2.0))
    surface = build_surface(run_spec(controller__kind="fuzzy_clik").controller.rulebase)
    strengths = rollout.signals["firing_strength"]
    assert strengths.shape == (201, 4)
    for k in (0, 50, 200):
        error = abs(rollout.signals["yaw_error"][k]) / 0.1
        expected = np.array(surface(error, rollout.signals["oscillating_joints"][k])[1]).ravel()
        np.testing.assert_allclose(strengths[k], expected, atol=1e-12)


def test_the_gain_lowers_the_yaw_and_leaves_the_tip() -> None:
    free, held = (
        simulate(run_spec(controller__kind=kind, controller__gain=100.0)) for kind in ("unconstrained", "clik")
    )
    assert held.metrics["yaw_abs_mean"] < 0.8 * free.metrics["yaw_abs_mean"]
    assert held.metrics["tip_error_max"] < 1e-4


UR5 = {"robot": "ur5_free_flyer", "start__q": [0.3, -1.2, 1.4, -0.8, 0.9, 0.2], "reference": {"kind": "hold"}}
TURN = {"kind": "turn", "angles": [0.0, 0.0, 0.02], "duration": 8.0}


def _turned(constraint: str, gain: float) -> Rollout:
    return simulate(
        run_spec(
            **UR5,
            duration=12.0,
            controller__constraint=[constraint],
            controller__gain=gain,
            base_reference=TURN,
        )
    )


def test_a_turn_of_the_base_is_followed_while_the_tip_stays() -> None:
    rollout = _turned("yaw", 50_000.0)
    law = np.clip(rollout.time / 8.0, 0, 1)
    wanted = 0.02 * (10 * law**3 - 15 * law**4 + 6 * law**5)
    np.testing.assert_allclose(rollout.signals["yaw"] + rollout.signals["yaw_error"], wanted, atol=1e-12)
    assert np.abs(rollout.signals["yaw_error"]).max() < 2e-3
    assert abs(rollout.signals["yaw_error"][-1]) < 1e-5
    assert rollout.metrics["tip_error_max"] < 1e-4
    softer = _turned("yaw", 2000.0)
    assert np.abs(softer.signals["yaw_error"]).max() > 2 * np.abs(rollout.signals["yaw_error"]).max()


def test_a_turn_of_the_whole_attitude_is_approached() -> None:
    """Three axes by three joints to spare: towards the reference, the tip in its place."""
    rollout = _turned("rotation_vector", 5000.0)
    errors = np.stack([rollout.signals[f"rotation_{axis}_error"] for axis in "xyz"], axis=1)
    assert np.linalg.norm(errors[-1]) < 0.8 * 0.02
    assert rollout.signals["rotation_z"][-1] > 0.004
    assert rollout.metrics["tip_error_max"] < 1e-4


def test_nothing_moves_without_a_reason() -> None:
    held = simulate(run_spec(**UR5, duration=1.0))
    assert np.abs(held.qd).max() < 1e-12
    assert held.status.name == "ok"


def test_drift_is_taken_off_before_the_inversion() -> None:
    """With momentum the tip keeps its line in the world; the error falls with the step."""
    momentum = {"start__momentum": {"linear": [0.5, 0.2, -0.3], "angular": [0.1, 0.05, -0.1]}}
    coarse, fine = (simulate(run_spec(step=step, controller__damping=1e-12, **momentum)) for step in (0.01, 0.0025))
    assert coarse.metrics["tip_error_max"] < 2e-4
    assert fine.metrics["tip_error_max"] < 0.3 * coarse.metrics["tip_error_max"]
    moved = fine.tip_position[-1] - fine.tip_position[0]
    direction = np.array([1.0, 0.2, -0.5])
    np.testing.assert_allclose(moved, 0.4 * direction / np.linalg.norm(direction), atol=1e-5)


@pytest.mark.parametrize("task", ["position", "orientation", "pose"])
def test_every_task_follows_its_reference(task: str) -> None:
    spec = run_spec(
        robot=UR5["robot"],
        start__q=UR5["start__q"],
        reference__length=0.1,
        reference__turn=[0.2, -0.1, 0.3],
        controller__task=task,
        controller__gain=1.0,
    )
    rollout = simulate(spec)
    assert rollout.metrics["tip_error_max"] < 1e-3
    assert rollout.status.name == "ok"
