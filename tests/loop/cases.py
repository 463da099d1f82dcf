"""Runs that the tests of the loop share, written as plain data."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.run_file import run_of
from fzcli.loop.run_spec import SimulateRun
from fzcli.spec.document import document_of
from tests.oracle.table1_robot import draw_start_and_line

Array = NDArray[np.float64]
# A line that the arm follows with ease, by any gain up to a few hundred.
CALM = {"q": [0.928, -1.393, 0.303, 0.549], "direction": [1.0, 0.2, -0.5], "length": 0.4, "duration": 10.0}
CALM_SEEDS = (2, 3, 4, 5, 18, 27, 98, 138)  # draws whose line the arm follows far from singular postures


def raw_run(**changes: Any) -> dict[str, Any]:
    """A run of the 4R test bed as plain data; dotted keys of ``changes`` (``__`` for a dot) replace fields."""
    data: dict[str, Any] = {
        "kind": "simulate",
        "robot": "bulgarelli4",
        "start": {"q": CALM["q"]},
        "reference": {key: CALM[key] for key in ("direction", "length", "duration")} | {"kind": "line"},
        "controller": {"kind": "clik", "gain": 10.0},
    }
    for key, value in changes.items():
        place, *rest = key.replace("__", ".").split(".")
        if not rest:
            data[place] = value
            continue
        section = data.setdefault(place, {})
        for step in rest[:-1]:
            section = section.setdefault(step, {})
        if value is None:
            section.pop(rest[-1], None)
        else:
            section[rest[-1]] = value
    kind = data["controller"].get("kind")
    if kind in ("unconstrained", "reaction_null_space"):
        data["controller"].pop("gain", None)
    if kind == "fabrik":
        data["controller"].pop("gain", None)
    if kind in ("fabrik", "dls"):
        data["controller"].setdefault("task", "position")
    if kind in ("fuzzy_clik", "fuzzy_task_priority"):
        data["controller"].setdefault("rulebase", "bulgarelli2011")
    return data


def run_spec(**changes: Any) -> SimulateRun:
    """The validated run of `raw_run`."""
    return run_of(document_of(raw_run(**changes)))


def calm_parameters(loop: ClosedLoop, gain: float) -> Array:
    """A row of parameters for each of `CALM_SEEDS`."""
    return np.concatenate([random_parameters(loop, 1, seed, gain) for seed in CALM_SEEDS])


def random_parameters(loop: ClosedLoop, count: int, seed: int, gain: float = 10.0) -> Array:
    """Rows of parameters of a line-following loop of the test bed, drawn as Table 2 draws them, unfiltered."""
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(count):
        q, direction, length, duration = draw_start_and_line(rng)
        known = {
            "start.q": q,
            "start.base_quat": [1, 0, 0, 0],
            "reference.direction": direction,
            "reference.length": length,
            "reference.duration": duration,
            "controller.kp": 3.2,
            "controller.gain": gain,
        }
        rows.append(np.concatenate([np.broadcast_to(known.get(p.path, 0.0), p.size) for p in loop.parameters]))
    return np.array(rows)
