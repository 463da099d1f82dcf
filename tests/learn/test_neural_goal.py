"""``ik: {kind: neural, ...}`` in a plan: networks give the final posture, refined and gated, and what they missed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fzcli
from fzcli.errors import SpecError
from fzcli.learn.network_set import NetworkSet
from fzcli.learn.store import save
from fzcli.model import build_model
from fzcli.spec.load import load_robot

GOAL = np.radians([20, 20, 100, 10, 45, -20])
PLAN = """kind: plan
robot: melfa_rv1a
start: {{q: [-20 deg, 10 deg, 90 deg, 0, 40 deg, 0]}}
goal: {{position: {position}, rpy: {rpy}}}
ik: {{kind: neural, networks: arm.npz}}
"""


def pose(q: Any) -> tuple[Any, Any]:
    position, rotation = build_model(load_robot("melfa_rv1a")).forward_kinematics(q, [1, 0, 0, 0])
    return np.array(position).ravel(), np.array(rotation)


def written(folder: Path, q: Any = GOAL, networks: NetworkSet | None = None) -> Path:
    """The plan to the pose that the tip has at joints q, with its networks beside it."""
    position, rotation = pose(q)
    file = folder / "plan.yaml"
    rpy = Rotation.from_matrix(rotation).as_euler("xyz").tolist()
    file.write_text(PLAN.format(position=position.tolist(), rpy=rpy))
    if networks is not None:
        save(networks, folder / "arm.npz")
    return file


def test_networks_lead_to_the_posture_that_the_exact_inverse_finds(arm: NetworkSet, tmp_path: Path) -> None:
    file = written(tmp_path, networks=arm)
    plan = fzcli.plan(file, output=tmp_path / "plan.h5")
    exact = fzcli.plan(file, sets=["ik={kind: exact}"])
    assert plan.status.name == "ok"
    np.testing.assert_allclose(plan.q[-1], GOAL, atol=1e-8)
    np.testing.assert_allclose(plan.q[-1], exact.q[-1], atol=1e-8)
    assert plan.metrics["ik_neural"] == 1
    assert 1e-4 < plan.metrics["ik_raw_distance"] < 0.03
    assert 1e-3 < plan.metrics["ik_raw_angle"] < 0.5
    assert plan.metrics["ik_refined_distance"] < 1e-9
    assert plan.metrics["ik_refined_angle"] < 1e-9
    assert "ik_neural" not in exact.metrics
    from fzcli.record.rollout_file import read_rollout

    assert read_rollout(tmp_path / "plan.h5").metrics["ik_neural"] == 1


def test_where_they_have_no_answer_the_exact_inverse_has(arm: NetworkSet, tmp_path: Path) -> None:
    """A posture on a branch that the networks do not know: theirs cannot be reached from it within the limits."""
    q = np.radians([100, 10, 90, -60, -45, 30])
    plan = fzcli.plan(written(tmp_path, q, arm), sets=["ik.steps=1"])
    assert plan.status.name == "ok"
    position, rotation = pose(plan.q[-1])
    np.testing.assert_allclose(position, pose(q)[0], atol=1e-8)
    np.testing.assert_allclose(rotation, pose(q)[1], atol=1e-8)
    assert plan.metrics["ik_neural"] == 0
    assert plan.metrics["ik_refined_distance"] > 1e-9
    assert plan.metrics["ik_raw_distance"] > 1e-3


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ("robot=ur5", "were trained for the robot 'melfa_rv1a', not for 'ur5'"),
        ("tool={xyz: [0, 0, 0.1]}", "not for 'melfa_rv1a': tips.flange.xyz was [0.0, 0.0, 0.072] there"),
        ("ik.networks=planar.npz", "planar.npz were trained for the robot 'rrr_planar', not for 'melfa_rv1a'"),
        ("ik.networks=none.npz", "ik.networks: no such file 'none.npz'; fzcli train writes one"),
        ("ik.networks=plan.yaml", "is no file of networks, or damaged"),
        ("goal={q: [0, 0, 80 deg, 0, 20 deg, 0]}", "plan.yaml:5:5: ik: serves goals that are given as position and"),
        ("goal={position: [0.3, 0, 0.5]}", "goal: rpy is needed: networks are asked for whole poses"),
        ("robot=melfa_free_flyer", "ik: networks give postures on a base that stands still; say hold_base: true"),
        ("ik.kind=neurl", "ik.kind: unknown kind 'neurl'; did you mean 'neural'?"),
    ],
)
def test_networks_that_do_not_serve_are_refused_by_name(
    arm: NetworkSet, planar: NetworkSet, tmp_path: Path, change: str, text: str
) -> None:
    file = written(tmp_path, networks=arm)
    save(planar, tmp_path / "planar.npz")
    before = sorted(path.name for path in tmp_path.iterdir())
    with pytest.raises(SpecError) as caught:
        fzcli.plan(file, sets=[change], output=tmp_path / "plan.h5")
    assert text in str(caught.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == before
