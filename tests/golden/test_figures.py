"""The runs fig3 to fig5 are trajectories of Table 2, found by the criteria that their files state."""

import re
from pathlib import Path

import numpy as np
import pytest

import fzcli
from fzcli.record.find import configuration, drawn, find
from fzcli.record.sweep_record import SweepRecord

RUNS = Path(__file__).resolve().parents[2] / "runs"


@pytest.fixture(scope="module")
def table2() -> SweepRecord:
    grid = "grid={controller.kind: [clik, fuzzy_clik], controller.gain: [1000]}"
    return fzcli.sweep(RUNS / "table2.yaml", sets=[grid, "expect_failures=false"])


@pytest.mark.long
@pytest.mark.parametrize("number", [3, 4, 5])
def test_figure_is_the_best_match_of_its_criteria(number: int, table2: SweepRecord) -> None:
    text = (RUNS / f"fig{number}.yaml").read_text()
    criteria = re.findall(r"--that '([^']*)'", text)
    by = re.findall(r"--by '([^']*)'", text)[0]
    names = {
        "fixed": configuration(table2, {"controller.kind": "clik", "controller.gain": 1000}),
        "fuzzy": configuration(table2, {"controller.kind": "fuzzy_clik", "controller.gain": 1000}),
    }
    best = int(find(table2, names, criteria, by, "--lowest" in text).trajectories[0])
    assert f"# Trajectory {best} of table2" in text
    rollout = fzcli.simulate(RUNS / f"fig{number}.yaml")
    assert np.array_equal(rollout.q[0], drawn(table2, best)["start.q"])
    row = names["fuzzy"] * 1000 + best
    for name in ("tip_error_mean", "yaw_abs_max", "yaw_abs_mean", "gain_final"):
        assert rollout.metrics[name] == table2.metrics[name][row], name
    fixed = rollout.variants["fixed gain"].metrics
    assert fixed["yaw_abs_max"] == table2.metrics["yaw_abs_max"][names["fixed"] * 1000 + best]
