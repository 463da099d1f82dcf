"""Task priority: the tip as if there were no base to hold, the base by what is left; and the tuner on top of it."""

import numpy as np
import pytest

from fzcli.control.registry import controllers
from fzcli.errors import SpecError
from fzcli.loop.rollout import Rollout
from fzcli.loop.simulate import simulate
from fzcli.model import build_model
from fzcli.spec.load import load_robot
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


def test_damping_gives_way_to_the_unconstrained_motion() -> None:
    heavy, free = _run("task_priority", controller__base_damping=1e9), _run("unconstrained")
    np.testing.assert_allclose(heavy.q, free.q, atol=1e-7)


def test_the_gain_has_a_number_for_every_axis() -> None:
    with pytest.raises(SpecError, match="gain has 2 numbers for 1 constrained axes"):
        run_spec(controller__kind="task_priority", controller__gain=[1.0, 2.0])
