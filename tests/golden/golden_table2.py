"""Frozen numbers of five lines by two laws, made by the plain NumPy loop, which shares no code with fzcli.

To make them again after a deliberate change of the equations (a quarter of a minute), from the root:

    python -m tests.golden.golden_table2
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from fzcli.fuzzy.surface import build_surface
from fzcli.spec.load import load_rulebase
from tests.oracle.plain_loop import Loop, PlainRun, run_plain_loop
from tests.oracle.table1_robot import bulgarelli4, draw_start_and_line

FILE = Path(__file__).with_name("table2_five.json")
SEEDS = (2, 3, 4, 5, 18)
GAINS = {"clik": 100.0, "fuzzy_clik": 10.0}
OSCILLATION = {"average": 10, "window": 10, "ignore_below": 3e-4}


def line(seed: int) -> dict[str, Any]:
    """One of the five: start posture and straight line, as plain numbers."""
    q0, direction, length, duration = draw_start_and_line(np.random.default_rng(seed))
    return {"q": q0.tolist(), "direction": direction.tolist(), "length": length, "duration": duration}


def metrics(run: PlainRun) -> dict[str, float]:
    """Table 2's measures of a run."""
    return {
        "tip_error_mean": float(run.tip_error.mean()),
        "tip_error_max": float(run.tip_error.max()),
        "yaw_abs_max": float(np.abs(run.yaw).max()),
        "yaw_abs_mean": float(np.abs(run.yaw).mean()),
        "oscillating_joints_mean": float(run.oscillating.mean()),
        "gain_final": float(run.gain[-1]),
        "n_steps": float(len(run.time) - 1),
    }


def make() -> list[dict[str, Any]]:
    """All rows: line, law and measures."""
    surface = build_surface(load_rulebase("bulgarelli2011"))

    def increment(error: float, oscillating: float) -> float:
        return float(surface(error, oscillating)[0])

    rows = []
    for kind, gain in GAINS.items():
        for seed in SEEDS:
            given = line(seed)
            run = run_plain_loop(
                bulgarelli4(),
                given["q"],
                given["direction"],
                given["length"],
                given["duration"],
                gain,
                increment if kind == "fuzzy_clik" else None,
                loop=Loop(**OSCILLATION),  # type: ignore[arg-type]
            )
            rows.append({"line": given, "kind": kind, "gain": gain, "metrics": metrics(run)})
    return rows


if __name__ == "__main__":
    FILE.write_text(json.dumps(make(), indent=1) + "\n", encoding="ascii")
