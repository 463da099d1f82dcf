"""One closed-loop step: CasADi's machine, CasADi's own C and the printed C over lanes give the same numbers.

Machine and CasADi's C share one libm and agree to the bit. The printed C has its own sine and arc tangent
and multiplies by reciprocals, so that it differs by rounding: by 1e-12 relative, or by what one rounding
of the state does where a state is so close to a singular posture that this is more. A state within
rounding of a comparison's threshold may part; those are counted.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.loop.assemble import closed_loop, parameter_row
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.compiler import find_compiler
from fzcli.loop.engine import CompiledEngine
from tests.loop.cases import random_parameters, run_spec
from tests.loop.single_step import by_machine, by_printed_c, casadi_c, wandering_states, worst_relative
from tests.oracle.random_trees import random_robot

Array = NDArray[np.float64]
pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
ROUNDING = 2.0**-52
POSE = {"controller__task": "pose", "robot": "ur5_free_flyer", "start__q": [0, -1.5, 0.5, -1.5, 0.3, 0]}


@dataclass(frozen=True)
class Agreement:
    """Shares of the states: within 1e-12, within what rounding allows; of the well-posed, within 1e-12."""

    tight: float
    allowed: float
    well_posed: float
    share_well_posed: float


def _agreement(loop: ClosedLoop, inputs: list[Array], expected: list[Array]) -> Agreement:
    error = worst_relative(by_printed_c(CompiledEngine(loop), inputs), expected)
    rng, sensitivity = np.random.default_rng(7), np.zeros(len(error))
    for _ in range(3):
        shaken = inputs[0] * (1 + ROUNDING * rng.choice([-1, 0, 1], size=inputs[0].shape))
        moved = by_machine(loop.step, [shaken, *inputs[1:]])
        sensitivity = np.maximum(sensitivity, worst_relative(moved, expected))
    tight, calm = error <= 1e-12, sensitivity <= 2e-13
    return Agreement(tight.mean(), (tight | (error <= 16 * sensitivity)).mean(), tight[calm].mean(), calm.mean())


def _inputs(loop: ClosedLoop, parameters: Array, count: int) -> list[Array]:
    every = 5
    steps = every * -(-count // len(parameters))
    return [values[:, :count] for values in wandering_states(loop, parameters, steps, every, seed=5)]


def _table2_inputs(loop: ClosedLoop, count: int) -> list[Array]:
    """States of calm, lively and violent runs: no oscillation, some, and much."""
    gains = ((10.0, 60), (1000.0, 30), (5000.0, 20))
    parts = [random_parameters(loop, width, seed, gain) for seed, (gain, width) in enumerate(gains)]
    return _inputs(loop, np.concatenate(parts), count)


@pytest.mark.parametrize("kind", ["unconstrained", "clik", "fuzzy_clik"])
def test_the_three_agree_on_ten_thousand_states(kind: str, tmp_path: Path) -> None:
    watch = {"average": 10, "window": 20, "ignore_below": 3e-4}  # so that many states oscillate
    loop = closed_loop(run_spec(controller__kind=kind, controller__oscillation=watch), record=True)
    inputs = _table2_inputs(loop, 10_000)
    assert inputs[0].shape[1] == 10_000
    expected = by_machine(loop.step, inputs)
    names = [signal.name for signal in loop.signals for _ in range(signal.size)]
    oscillating = expected[3][names.index("oscillating_joints")]
    assert (oscillating > 0).mean() > 0.05, "the states must know oscillation"
    by_casadi = by_machine(casadi_c(loop.step, tmp_path), inputs)
    assert worst_relative(by_casadi, expected).max() <= 1e-14
    found = _agreement(loop, inputs, expected)
    assert found.well_posed == 1.0, found
    assert found.share_well_posed > 0.25, found
    assert found.allowed > 0.999, found
    assert found.tight > 0.95, found


@pytest.mark.parametrize(
    "changes",
    [
        {"controller__task": "orientation", "controller__constraint": ["roll", "pitch", "yaw"]},
        {"controller__constraint": ["rotation_vector"]},
        {"controller__constraint": ["pitch", "yaw"], "controller__gain": [10.0, 40.0], "method": "midpoint"},
        {"start__momentum__angular": [0.02, -0.01, 0.03], "start__momentum__linear": [0.1, 0.0, -0.1]},
    ],
    ids=["orientation", "rotation_vector", "two_axes_midpoint", "momentum"],
)
def test_other_tasks_and_constraints(changes: dict[str, object]) -> None:
    loop = closed_loop(run_spec(controller__kind="fuzzy_clik", **changes), record=True)
    inputs = _table2_inputs(loop, 2000)
    found = _agreement(loop, inputs, by_machine(loop.step, inputs))
    assert found.well_posed == 1.0, found
    assert found.allowed > 0.998, found


def test_pose_of_a_six_joint_arm(tmp_path: Path) -> None:
    spec = run_spec(controller__kind="fuzzy_clik", controller__damping=1e-6, **POSE)
    loop = closed_loop(spec, record=True)
    parameters = np.tile(parameter_row(spec, loop.parameters), (100, 1))
    parameters[:, :6] += 0.3 * np.random.default_rng(1).standard_normal((100, 6))
    inputs = _inputs(loop, parameters, 2000)
    expected = by_machine(loop.step, inputs)
    assert worst_relative(by_machine(casadi_c(loop.step, tmp_path), inputs), expected).max() <= 1e-14
    found = _agreement(loop, inputs, expected)
    assert found.well_posed == 1.0, found
    assert found.allowed > 0.998, found


@pytest.mark.parametrize("seed", [3, 11, 13, 16])
def test_random_trees(seed: int) -> None:
    """Branches, prismatic and fixed joints, any attitude; seed 13 stands on a fixed base."""
    robot = random_robot(seed)
    spec = run_spec(controller__kind="fuzzy_clik", controller__damping=1e-2)
    n = sum(link.joint.type != "fixed" for link in robot.links)
    start = spec.start.model_copy(update={"q": (0.1,) * n, "base_rpy": (0.2, -0.3, 0.4)})
    loop = closed_loop(spec.model_copy(update={"robot": robot, "start": start}), record=True)
    row = parameter_row(spec.model_copy(update={"start": start}), loop.parameters)
    parameters = np.tile(row, (50, 1))
    parameters[:, :n] += np.random.default_rng(seed).standard_normal((50, n))
    inputs = _inputs(loop, parameters, 500)
    found = _agreement(loop, inputs, by_machine(loop.step, inputs))
    assert found.well_posed == 1.0, found
    assert found.allowed > 0.995, found
