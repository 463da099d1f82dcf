"""Plans followed at torque level: on fixed and free bases, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import fzcli
from fzcli.errors import IntegrationError, SpecError
from fzcli.loop.rollout import Rollout
from fzcli.record.rollout_file import read_rollout
from fzcli.spec.reader import read_text

FIXED = """
kind: plan
robot: melfa_rv1a
start: {q: [-60 deg, 20 deg, 100 deg, 0, 40 deg, 0]}
goal: {q: [-20 deg, 40 deg, 80 deg, 0, 60 deg, 0]}
duration: 2 s
scene:
  - sphere: {center: [0.6, 0, 0.345], radius: 0.05}
replay: {controller: {kind: computed_torque}}
"""
FREE = FIXED.replace("melfa_rv1a", "melfa_free_flyer").replace(
    "{kind: computed_torque}", "{kind: robust, base: [rotation_vector]}"
)


def _run(text: str, folder: Path, *sets: str) -> Rollout:
    (folder / "run.yaml").write_text(text)
    return fzcli.simulate(folder / "run.yaml", sets=sets, output=folder / "run.h5")


@pytest.mark.parametrize("text", [FIXED, FREE], ids=["fixed base", "free base"])
def test_a_plan_is_followed_by_torques(text: str, tmp_path: Path) -> None:
    found = _run(text, tmp_path)
    plan = found.variants["plan"]
    assert found.status.name == "ok"
    assert found.time[-1] == pytest.approx(plan.time[-1])
    assert found.metrics["tip_deviation_max"] < 5e-5
    np.testing.assert_allclose(found.q[-1], plan.q[-1], atol=1e-4)
    turned = 2 * np.linalg.norm(plan.base_quat[-1, 1:])
    assert (turned > 0.02) == ("free" in text)
    assert found.metrics["base_deviation_max"] < 1e-3 * max(turned, 1e-6) + 1e-12
    assert found.certificate["clearance_min"] == pytest.approx(plan.certificate["clearance_min"], abs=1e-3)
    kept = read_rollout(tmp_path / "run.h5")
    assert set(kept.variants) == {"plan"}
    assert kept.signals["torque"].shape == (len(kept.time), 6)


def test_wrong_masses_move_the_tip_of_a_free_base(tmp_path: Path) -> None:
    heavier = "replay.errors={each: 0.2, masses: [-1, 1, 1, 1, 1, 1, 1]}"
    joints = _run(FREE, tmp_path, heavier, "replay.controller={kind: computed_torque}")
    held = _run(FREE, tmp_path, heavier, "replay.controller={kind: robust, base: []}")
    assert joints.metrics["tip_deviation_max"] > 1e-3
    assert held.metrics["tip_deviation_max"] < 3e-4


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ("replay.controller.kind=robst", "replay.controller.kind"),
        ("replay.grasp.at=1", "replay.grasp.mass: is missing"),
        ("replay.attitude={by: wheels}", "replay.attitude: a fixed base needs no attitude control"),
    ],
)
def test_bad_replays_are_named_in_the_plan_s_file(change: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "run.yaml").write_text(FIXED)
    for follow in (fzcli.simulate, fzcli.plan):
        with pytest.raises(SpecError) as caught:
            follow(tmp_path / "run.yaml", sets=[change], output=tmp_path / "run.h5")
        assert text in str(caught.value)
        assert not (tmp_path / "run.h5").exists()


def test_a_grasp_after_the_plan_s_end_is_refused(tmp_path: Path) -> None:
    late = "replay.grasp={at: 5 s, mass: 1, inertia: [1, 1, 1]}"
    with pytest.raises(SpecError, match=r"replay.grasp.at: begins at 5 s, after the end of the run at 2 s"):
        _run(FIXED, tmp_path, late)
    assert not (tmp_path / "run.h5").exists()


def test_a_parallel_robot_has_no_torque_level(tmp_path: Path) -> None:
    text = read_text(Path("runs/rrr_obstacle.yaml").read_text()).text
    with pytest.raises(SpecError, match="replay"):
        _run(text + "\nreplay: {controller: {kind: computed_torque}}\n", tmp_path)


def test_the_adaptive_integrator_refuses_by_name_here_too(tmp_path: Path) -> None:
    harsh = "replay.controller={kind: joint_pd, stiffness: 1000000, damping: 100000}"
    with pytest.raises(IntegrationError, match="dormand_prince: a step of"):
        _run(FIXED, tmp_path, harsh, "replay.substeps=1", "replay.integrator=dormand_prince")


@pytest.mark.parametrize("change", ["replay={controller: {kind: robust}}", "grid={replay.substeps: [1, 2]}"])
def test_a_sweep_of_plans_replays_none(change: str) -> None:
    with pytest.raises(SpecError) as caught:
        fzcli.sweep("runs/scenes200.yaml", sets=[change, "list=[]"])
    assert "a sweep makes plans and follows none; `fzcli simulate` replays a plan" in str(caught.value)
