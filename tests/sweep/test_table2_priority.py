"""The tuned rule base on lines that it was not tuned on, beside the paper's tuner and fixed gains."""

import numpy as np
import pytest

from fzcli.loop.compiler import find_compiler
from fzcli.sweep.execute import load_sweep, run_sweep

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(find_compiler() is None, reason="thousands of runs need a C compiler"),
]
COUNT = 4000


def test_the_tuned_rule_base_keeps_its_lead_on_fresh_lines() -> None:
    sweep = load_sweep("table2_priority", [f"trajectories.count={COUNT}", "trajectories.seed=99"])
    record = run_sweep(sweep)
    yaw = record.metrics["yaw_abs_mean"].reshape(-1, COUNT)
    lost = ~(record.metrics["tip_error_max"].reshape(-1, COUNT) <= 1e-2)
    kinds = [config["controller.kind"] for config in record.configs]
    (tuned,) = (i for i, config in enumerate(record.configs) if config.get("controller.rulebase") == "priority_tuned")
    starts = {record.configs[i]["controller.gain"]: i for i, kind in enumerate(kinds) if kind == "fuzzy_clik"}
    assert set(starts) == {10, 1000}
    for paper in starts.values():
        assert yaw[tuned].mean() < 0.8 * yaw[paper].mean()
        assert np.median(yaw[tuned]) < 0.6 * np.median(yaw[paper])
        assert lost[tuned].sum() <= lost[paper].sum()
    for unruled in (i for i, kind in enumerate(kinds) if kind == "task_priority"):
        assert lost[tuned].sum() < 0.25 * lost[unruled].sum()
