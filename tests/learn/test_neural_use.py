"""Stored networks: loading, refusing, estimating, refining, gating."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from fzcli.errors import RecordError, SpecError
from fzcli.learn.network_set import NetworkSet
from fzcli.learn.neural_inverse import NeuralIkSpec, neural_inverse
from fzcli.learn.store import load, save
from fzcli.model import build_model
from fzcli.spec.any_robot import load_any_robot
from fzcli.spec.planar import Planar3RRR
from fzcli.spec.robot import Robot


@pytest.fixture(scope="module")
def rrr() -> Planar3RRR:
    found = load_any_robot("rrr_planar")
    assert isinstance(found, Planar3RRR)
    return found


@pytest.fixture(scope="module")
def melfa() -> Robot:
    found = load_any_robot("melfa_rv1a")
    assert isinstance(found, Robot)
    return found


def test_a_set_comes_back_from_disk_to_the_last_bit(planar: NetworkSet, tmp_path: Path) -> None:
    save(planar, tmp_path / "deep" / "nets.npz")
    back = load(tmp_path / "deep" / "nets.npz")
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["nets.npz"]
    assert (back.robot, back.spec, back.skipped, back.versions) == (
        planar.robot,
        planar.spec,
        planar.skipped,
        planar.versions,
    )
    for label, one in planar.trained.items():
        other = back.trained[label]
        assert other.metrics == one.metrics
        assert (other.network.predict(one.inputs) == one.network.predict(one.inputs)).all()
        np.testing.assert_array_equal(other.error_map.raw, one.error_map.raw)


def test_another_robot_is_refused_by_name_and_difference(planar: NetworkSet, rrr: Planar3RRR, tmp_path: Path) -> None:
    save(planar, tmp_path / "nets.npz")
    longer = rrr.model_copy(update={"name": "longer", "legs": rrr.legs.model_copy(update={"distal": 0.3})})
    text = r"were trained for the robot 'rrr_planar', not for 'longer': legs.distal was 0.25 there and is 0.3 here"
    with pytest.raises(SpecError, match=text):
        load(tmp_path / "nets.npz", longer)
    with pytest.raises(SpecError, match="were trained for the robot 'rrr_planar', not for 'ur5'"):
        load(tmp_path / "nets.npz", load_any_robot("ur5"))
    renamed = rrr.model_copy(update={"name": "mine", "drives": rrr.drives.model_copy(update={"speed": 1.0})})
    load(tmp_path / "nets.npz", renamed)  # neither names nor speeds matter to kinematics


def test_damaged_and_foreign_files(planar: NetworkSet, tmp_path: Path) -> None:
    save(planar, tmp_path / "nets.npz")
    whole = (tmp_path / "nets.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.npz").write_text("no archive")
    np.savez(tmp_path / "foreign.npz", a=np.ones(3))
    for name, message in (
        ("cut.npz", "is no file of networks, or damaged"),
        ("text.npz", "is no file of networks, or damaged"),
        ("foreign.npz", "holds no networks of fzcli"),
        ("none.npz", "no such file; fzcli train writes one"),
    ):
        with pytest.raises(RecordError, match=message):
            load(tmp_path / name)
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordError, match="cannot be written"):
        save(planar, tmp_path / "file" / "nets.npz")


def test_estimates_tell_raw_and_refined(planar: NetworkSet, rrr: Planar3RRR) -> None:
    ready = planar.kinematics_for(rrr)
    one = planar.trained["+++ det+"]
    for theta, truth in zip(one.inputs[:20], one.truth[:20], strict=True):
        best = ready.solve(theta)[0]
        assert best.accepted
        assert best.label == "+++ det+"
        assert np.abs(best.value - truth).max() < 1e-9
        assert best.residual[0] < 1e-9 < best.raw_residual[0]
        assert 1e-9 < np.abs(best.raw - truth).max() < 0.01


def test_the_gate_takes_no_pose_of_another_branch(planar: NetworkSet, rrr: Planar3RRR) -> None:
    """All networks are asked about joint angles of one branch: what passes is exact and on its own branch."""
    ready = planar.kinematics_for(rrr)
    passed = 0
    for label in ready.labels:
        for theta in planar.trained[label].inputs[:30]:
            for each in ready.solve(theta, steps=10):
                if each.accepted:
                    passed += 1
                    assert each.residual.max() < 1e-9
                    sign = {1: "+", -1: "-"}
                    ((mode, determinant),) = ready.map.model.labels(each.value[None], theta[None])  # type: ignore[attr-defined]
                    assert f"{mode} det{sign[determinant]}" == each.label
    assert passed > 80


def test_joint_angles_far_away_are_not_accepted(planar: NetworkSet, rrr: Planar3RRR) -> None:
    outward = np.radians([210.0, 330.0, 90.0])  # cannot be assembled at all
    assert not any(each.accepted for each in planar.kinematics_for(rrr).solve(outward))


def test_the_whole_chain_as_a_function(planar: NetworkSet, rrr: Planar3RRR) -> None:
    ready = planar.kinematics_for(rrr)
    one = planar.trained["+++ det+"]
    raw, _ = ready.function("+++ det+")(one.inputs[0])
    assert np.array(raw).ravel() == pytest.approx(one.raw[0], abs=1e-14)
    pose, residual = ready.function("+++ det+", steps=3)(one.inputs[0])
    assert np.array(pose).ravel() == pytest.approx(one.truth[0], abs=1e-10)
    assert float(residual[0]) < 1e-10
    symbol = ca.SX.sym("theta", 3)
    assert isinstance(ready.function("+++ det+", steps=1)(symbol)[0], ca.SX)


def test_wrong_questions_are_refused(planar: NetworkSet, rrr: Planar3RRR) -> None:
    ready = planar.kinematics_for(rrr)
    with pytest.raises(SpecError, match=r"no network '\+\+\+ det'; did you mean '\+\+\+ det\+'"):
        ready.solve([0, 0, 0], "+++ det")
    with pytest.raises(SpecError, match=r"must be 3 finite numbers: theta1 \[rad\], "):
        ready.solve([0, 0, np.nan])
    with pytest.raises(SpecError, match="must be 3 finite numbers"):
        ready.solve([0, 0])


def test_an_arm_s_networks_stand_in_for_its_inverse(arm: NetworkSet, melfa: Robot, tmp_path: Path) -> None:
    save(arm, tmp_path / "arm.npz")
    spec = NeuralIkSpec(kind="neural", networks="arm.npz")
    inverse = neural_inverse(spec, melfa, tmp_path / "plan.yaml")
    model = build_model(melfa)
    rng = np.random.default_rng(4)
    low, high = np.radians([[-25, 5, 85, -35, 25, -55], [25, 35, 115, 35, 65, 55]])
    for q in rng.uniform(low, high, (20, 6)):
        position, rotation = model.forward_kinematics(q, [1, 0, 0, 0])
        found = inverse.solve(np.array(position).ravel(), np.array(rotation))
        assert len(found) == 1
        assert found[0].q == pytest.approx(q, abs=1e-8)
        assert found[0].branch == "front, elbow up, noflip"
        assert found[0].error < 1e-9
        assert found[0].excess < 0
        every = inverse.solve(np.array(position).ravel(), np.array(rotation), near=q, windings=True)
        assert every[0].q == pytest.approx(q, abs=1e-8)
        assert all(one.excess <= 0 for one in every)
    assert inverse.solve([2.0, 0.0, 0.0], np.eye(3)) == []


def test_an_arm_with_another_tool_is_refused(arm: NetworkSet, melfa: Robot, tmp_path: Path) -> None:
    from fzcli.spec.tool import Tool, with_tool

    save(arm, tmp_path / "arm.npz")
    spec = NeuralIkSpec(kind="neural", networks=str(tmp_path / "arm.npz"))
    with pytest.raises(SpecError, match=r"tips\.flange\.xyz was .* there and is .* here"):
        neural_inverse(spec, with_tool(melfa, Tool(xyz=(0, 0, 0.1))))


def test_networks_of_a_planar_robot_are_no_inverse_of_an_arm(planar: NetworkSet, melfa: Robot, tmp_path: Path) -> None:
    save(planar, tmp_path / "planar.npz")
    with pytest.raises(SpecError, match="were trained for the robot 'rrr_planar', not for 'melfa_rv1a'"):
        neural_inverse(NeuralIkSpec(kind="neural", networks=str(tmp_path / "planar.npz")), melfa)
