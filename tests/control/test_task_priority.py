"""Task priority: the tip as if there were no base to hold, the base by what is left; and the tuner on top of it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fzcli.control.registry import controllers
from fzcli.errors import SpecError
from fzcli.loop.rollout import Rollout
from fzcli.loop.simulate import simulate
from fzcli.model import build_model
from fzcli.spec.base import SpecModel
from fzcli.spec.load import load_robot, load_rulebase
from fzcli.spec.rulebase import Rulebase
from tests.loop.cases import run_spec
from tests.oracle.numpy_reference import NumpyReference, rotation_from_quat
from tests.oracle.plain_loop import angle_rates

pytestmark = pytest.mark.usefixtures("machine")
GAIN = 4.0
START = [0.3, -1.2, 1.0, -0.6, 0.8, 0.2]


def _run(kind: str, **changes: object) -> Rollout:
    return simulate(run_spec(controller__kind=kind, **{"controller__gain": GAIN, **changes}))


def test_both_tasks_are_met_where_the_joints_suffice() -> None:
    """Six joints, three rows of the tip and one of the base, hardly any damping: J qd = v and Jc qd = Kc ec."""
    robot = load_robot("ur5_free_flyer")
    model, oracle = build_model(robot), NumpyReference(robot)
    entry = controllers()["task_priority"]
    fields = {"gain": GAIN, "damping": 1e-14, "base_damping": 1e-14}
    law = entry.build(model, entry.spec.model_validate(fields))
    rng = np.random.default_rng(7)
    for _ in range(10):
        q, quat = rng.uniform(-2.0, 2.0, 6), np.array([1.0, *rng.uniform(-0.2, 0.2, 3)])
        quat /= np.linalg.norm(quat)
        position, _ = oracle.forward_kinematics(q, quat)
        given = dict.fromkeys(law.function.name_in(), 0.0) | {
            "q": q,
            "base_quat": quat,
            "tip_position": position,
            "tip_velocity": rng.normal(size=3),
            "tip_quat": [1, 0, 0, 0],
            "parameters": np.array([3.2, GAIN, 1e-14]),
            "memory": law.memory0([3.2, GAIN, 1e-14]),
        }
        found = law.function(**given)
        qd = np.array(found["command"]).ravel()
        np.testing.assert_allclose(oracle.generalized_jacobian(q, quat)[:3] @ qd, given["tip_velocity"], atol=1e-8)
        yaw_row = angle_rates(rotation_from_quat(quat))[2] @ oracle.base_rate_map(q, quat)
        assert yaw_row @ qd == pytest.approx(GAIN * float(found["yaw_error"]), abs=1e-8)


def test_tip_and_base_follow_to_the_integrator_s_order() -> None:
    """Midpoint steps: half the step, a quarter of the tip's error; the base's is what the damping leaves."""
    turn = {"kind": "turn", "angles": [0, 0, 0.002], "duration": 2.0}
    line = {"kind": "line", "direction": [1, 0.2, -0.5], "length": 0.03, "duration": 2.0}
    given = {"robot": "ur5_free_flyer", "start": {"q": START}, "reference": line, "method": "midpoint"}
    damping = {"controller__base_damping": 1e-8}
    coarse, fine = (_run("task_priority", base_reference=turn, step=step, **damping, **given) for step in (0.02, 0.01))
    assert np.abs(fine.signals["yaw_error"]).max() < 2e-7
    assert fine.signals["yaw"][-1] == pytest.approx(0.002, abs=1e-7)
    assert coarse.metrics["tip_error_max"] / fine.metrics["tip_error_max"] == pytest.approx(4.0, rel=0.05)
    assert fine.metrics["tip_error_max"] < 1e-6


def test_what_the_tip_does_to_the_base_is_counted_in() -> None:
    """At the same gain, equation 1 corrects a turn after it has come; priority does not let it come."""
    late, early = _run("clik"), _run("task_priority", controller__base_damping=1e-6)
    assert early.metrics["yaw_abs_max"] < 0.05 * late.metrics["yaw_abs_max"]
    assert early.metrics["tip_error_max"] < 1e-3


@pytest.mark.parametrize(("error", "share"), [(0.0, 1.0), (0.5e-3, 1.0), (1e-3, 0.7), (1.5e-3, 0.35), (0.5, 0.0)])
def test_a_rule_base_lets_the_base_go_as_the_tip_leaves_its_path(error: float, share: float) -> None:
    """The command moves from that of task priority to that of the tip alone, in the same step."""
    robot = load_robot("bulgarelli4")
    rulebase = load_rulebase("priority").model_dump()
    rulebase["outputs"]["share"]["terms"]["PART"]["numbers"] = [0.7]
    q, quat = np.array([0.928, -1.393, 0.303, 0.549]), np.array([1.0, 0.0, 0.0, 0.01]) / np.hypot(1, 0.01)
    position, _ = NumpyReference(robot).forward_kinematics(q, quat)
    specs: dict[str, dict[str, Any]] = {
        "unconstrained": {},
        "task_priority": {"gain": GAIN},
        "fuzzy_task_priority": {"gain": GAIN, "rulebase": Rulebase.model_validate(rulebase), "tip_error_scale": 1e-3},
    }
    commands = []
    for kind, fields in specs.items():
        entry = controllers()[kind]
        spec = entry.spec.model_validate(fields)
        law = entry.build(build_model(robot), spec)
        values = [float(np.ravel(spec_value(spec, parameter.path))[0]) for parameter in law.parameters]
        given = dict.fromkeys(law.function.name_in(), 0.0) | {
            "q": q,
            "base_quat": quat,
            "tip_position": position + np.array([0.6, 0.0, 0.8]) * error,
            "tip_velocity": [0.1, 0.05, -0.1],
            "tip_quat": [1, 0, 0, 0],
            "parameters": values,
            "memory": law.memory0(values),
        }
        found = law.function(**given)
        commands.append(np.array(found["command"]).ravel())
    free, held, ruled = commands
    np.testing.assert_allclose(ruled, share * held + (1 - share) * free, atol=1e-9)
    assert float(found["share"]) == pytest.approx(share, abs=1e-9)
    assert np.abs(held - free).max() > 1e-3


def spec_value(spec: SpecModel, path: str) -> Any:
    return spec.value_at(path.removeprefix("controller."))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (("tip_error", "tip_eror"), "must map any of error, oscillating, tip_error to any of increment, share"),
        (("tip_error", "oscillating"), "rules.0: the share is of this step, oscillation shows after it"),
        (("default: 1", "default: hold"), "outputs.share.default: cannot be held; give a number"),
        (("[singleton, 0.9]", "[singleton, 1.2]"), "outputs.share.terms.PART"),
    ],
)
def test_rule_bases_that_do_not_fit_are_refused(change: tuple[str, str], text: str, tmp_path: Path) -> None:
    shipped = (Path(__file__).parents[2] / "rulebases/priority.yaml").read_text()
    (tmp_path / "rules.yaml").write_text(shipped.replace(*change))
    given = {"controller__gain": 1.0, "controller__rulebase": str(tmp_path / "rules.yaml")}
    with pytest.raises(SpecError) as caught:
        run_spec(controller__kind="fuzzy_task_priority", **given)
    assert text in str(caught.value)


def test_damping_gives_way_to_the_unconstrained_motion() -> None:
    heavy, free = _run("task_priority", controller__base_damping=1e9), _run("unconstrained")
    np.testing.assert_allclose(heavy.q, free.q, atol=1e-7)


def test_the_gain_has_a_number_for_every_axis() -> None:
    with pytest.raises(SpecError, match="gain has 2 numbers for 1 constrained axes"):
        run_spec(controller__kind="task_priority", controller__gain=[1.0, 2.0])
