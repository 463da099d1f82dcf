"""Real runs with a target, computed once for the tests of this folder, and changes of them."""

import dataclasses
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

import fzcli
from fzcli.loop.compiler import find_compiler
from fzcli.loop.rollout import Rollout

TEXT = """
kind: simulate
robot: ur5_free_flyer
start: {q: [0, -90 deg, 0, -90 deg, 0, 0]}
reference: {kind: target, position: [0.3, 0.5, 0.8], direction: [1, 1, -1]}
controller: {kind: fabrik, variant: n10}
step: 10 ms
method: gauss_magnus
stop: {position: 10 mm, direction: 2 deg, after: 2 s}
compare:
  least squares: {controller.kind: dls}
  translation only: {plant: translation_only}
"""


@cache
def capture() -> Rollout:
    """The capture of Dong et al. 2022, with two variants; by CasADi's machine, for so few steps the quicker."""
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("FZCLI_CC", "none")
        find_compiler.cache_clear()
        path = Path(folder) / "capture.yaml"
        path.write_text(TEXT, encoding="utf-8")
        rollout = fzcli.simulate(path)
    find_compiler.cache_clear()
    return rollout


def alone(**changes: Any) -> Rollout:
    """The capture without its variants; ``signals`` and ``metrics`` of the changes join its own."""
    run = dataclasses.replace(capture(), variants={})
    for name in ("signals", "metrics"):
        if name in changes:
            changes[name] = {**getattr(run, name), **changes[name]}
    return dataclasses.replace(run, **changes)


def without(run: Rollout, *names: str) -> Rollout:
    """The run without some of its signals."""
    kept = {name: values for name, values in run.signals.items() if name not in names}
    return dataclasses.replace(run, signals=kept)


def cut(run: Rollout, count: int) -> Rollout:
    """The first samples of the run."""
    arrays = ("time", "q", "qd", "base_position", "base_quat", "base_twist", "tip_position", "tip_quat")
    signals = {name: values[:count] for name, values in run.signals.items()}
    return dataclasses.replace(run, signals=signals, **{name: getattr(run, name)[:count] for name in arrays})


def driving(run: Rollout, *intervals: tuple[int, int]) -> Rollout:
    """The run as if it had driven after a restart from sample a to sample b, for each (a, b)."""
    marks = np.zeros(len(run.time))
    for start, end in intervals:
        marks[start:end] = 1.0
    metrics = {**run.metrics, "restarts": float(len(intervals))}
    return dataclasses.replace(run, signals={**run.signals, "driving": marks}, metrics=metrics)
