"""Table 2's runs at torque level: the trajectories are those of table2, and who keeps to them."""

from pathlib import Path

import numpy as np
import pytest

import fzcli
from fzcli.loop.compiler import find_compiler
from fzcli.sweep.execute import load_sweep
from fzcli.sweep.resolve import Sweep

pytestmark = [pytest.mark.long, pytest.mark.skipif(find_compiler() is None, reason="no C compiler")]
RUNS = Path(__file__).parents[2] / "runs"
COUNT = 50
BELIEVED, HEAVIER, LIGHTER, EACH = range(1, 5)  # configurations of the robust controller; four on, those of joint_pd


@pytest.fixture(scope="module")
def record() -> object:
    return fzcli.sweep(RUNS / "table2_replay_sweep.yaml", sets=[f"trajectories.count={COUNT}"], jobs=2)


def test_the_trajectories_are_those_of_table_2(record: object) -> None:
    """Errors of masses come from a stream of their own, so that they do not shift the lines."""
    sets = [f"trajectories.count={COUNT}", "grid={controller.kind: [fuzzy_clik], controller.gain: [1000]}"]
    table2 = fzcli.sweep(RUNS / "table2.yaml", sets=[*sets, "expect_failures=false", "table=null"])
    for path, values in table2.draws.items():
        np.testing.assert_array_equal(record.draws[path], values)  # type: ignore[attr-defined]
    for name in ("tip_error_mean", "yaw_abs_max"):
        found = record.metrics[name][:COUNT]  # type: ignore[attr-defined]
        np.testing.assert_array_equal(found, table2.metrics[name])
        np.testing.assert_array_equal(record.metrics[f"kinematic_{name}"][COUNT : 2 * COUNT], found)  # type: ignore[attr-defined]


def test_the_robust_controller_keeps_to_the_runs_and_joint_feedback_does_not(record: object) -> None:
    """Within 2 mm and .01 rad of the velocity-level run, of those that are not lost; 1000 in benchmarks/torque.py."""
    metrics = record.metrics  # type: ignore[attr-defined]
    good = metrics["tip_error_max"][:COUNT] <= 1e-2
    assert good.sum() >= 45
    kept = (metrics["tip_deviation_max"] <= 2e-3) & (metrics["yaw_deviation_max"] <= 0.01) & (metrics["status"] < 2)
    share = kept.reshape(-1, COUNT)[:, good].mean(axis=1)
    assert share[[BELIEVED, HEAVIER, LIGHTER]].min() >= 0.97
    assert share[EACH] > 0.8
    assert share[[4 + BELIEVED, 4 + HEAVIER, 4 + LIGHTER]].max() < 0.95
    assert share[4 + EACH] < 0.1
    balance = metrics["energy_balance_max"].reshape(-1, COUNT)[1:, good]
    assert np.median(balance) < 1e-9


def test_configurations_share_builds_and_the_filter_has_no_replay() -> None:
    """Errors and gains are numbers of the run: one build a kind of controller."""
    sweep = load_sweep(RUNS / "table2_replay_sweep.yaml")
    assert isinstance(sweep, Sweep)
    assert sweep.specs[0].replay is None
    assert sweep.filter is not None
    assert sweep.filter.replay is None
    from fzcli.sweep.builds import Builds

    builds = Builds()
    assert len({id(builds.of(spec)) for spec in sweep.specs}) == 3
