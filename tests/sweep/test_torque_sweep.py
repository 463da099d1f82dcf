"""Table 2's runs at torque level: the trajectories are those of table2, and who keeps to them."""

from pathlib import Path

import numpy as np
import pytest

import fzcli
from fzcli.control.torque.law import TorqueController
from fzcli.control.torque.registry import TORQUE_CONTROLLERS
from fzcli.loop.compiler import find_compiler
from fzcli.loop.simulate import simulate
from fzcli.model import build_model
from fzcli.spec.load import load_robot
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
    assert not np.any(metrics["status"].reshape(-1, COUNT)[:, good] == 2), "lost runs alone fail"
    balance = metrics["energy_balance_max"].reshape(-1, COUNT)[1:, good]
    assert np.median(balance) < 1e-9


def test_knowing_the_masses_would_not_help_where_tip_and_yaw_exclude_each_other(
    record: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Trajectory 3 leaves the 2 mm, whether the controller knows the robot that it moves or believes in another."""
    draws = {path: values[3] for path, values in record.draws.items()}  # type: ignore[attr-defined]
    believed = load_robot("bulgarelli4")
    parts = [
        part.model_copy(
            update={"mass": part.mass * (1 + 0.2 * m), "inertia": tuple(x * (1 + 0.2 * i) for x in part.inertia)}
        )
        for part, m, i in zip(
            (believed.base, *believed.links),
            draws["replay.errors.masses"],
            draws["replay.errors.inertias"],
            strict=True,
        )
    ]
    moved = believed.model_copy(update={"base": parts[0], "links": tuple(parts[1:])})
    spec = load_sweep(RUNS / "table2_replay_sweep.yaml").specs[EACH]
    line: dict[str, object] = {name: draws[f"reference.{name}"].item() for name in ("length", "duration")}
    line["direction"] = tuple(draws["reference.direction"].tolist())
    spec = spec.model_copy(
        update={
            "start": spec.start.model_copy(update={"q": tuple(draws["start.q"].tolist())}),
            "reference": spec.reference.model_copy(update=line),
            "replay": spec.replay.model_copy(update={"errors": None, "robot": moved}),
        }
    )
    believing = simulate(spec).metrics
    own = TORQUE_CONTROLLERS["robust"]
    knowing = TorqueController(own.spec, lambda _, law: own.build(build_model(moved), law))
    monkeypatch.setitem(TORQUE_CONTROLLERS, "robust", knowing)
    known = simulate(spec).metrics
    swept = record.metrics["tip_deviation_max"][EACH * COUNT + 3]  # type: ignore[attr-defined]
    assert swept == pytest.approx(believing["tip_deviation_max"], rel=1e-3)
    assert believing["tip_deviation_max"] > 2e-3
    assert known["tip_deviation_max"] == pytest.approx(believing["tip_deviation_max"], rel=0.1)


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
