"""Real plans, computed once for the tests of this folder, as the runs that their files hold."""

import dataclasses
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import fzcli
from fzcli.loop.rollout import Rollout
from fzcli.plan.plan import Plan
from fzcli.record.plan_file import as_rollout

BALLS = """
kind: plan
robot: melfa_rv1a
tool: {xyz: [0, 0, 0.1]}
start: {q: [-60 deg, 20 deg, 100 deg, 0, 40 deg, 0]}
goal: {q: [60 deg, 40 deg, 80 deg, 0, 60 deg, 0]}
duration: 4 s
margin: 10 mm
scene:
  - sphere: {center: [0.338, 0, 0.345], radius: 0.05}
  - name: ball
    sphere: {center: [-0.3, 0.4, 0.6], radius: 0.06}
    velocity: [0, -10 cm/s, 0]
"""

FREE = """
kind: plan
robot: melfa_free_flyer
tool: {xyz: [0, 0, 0.1]}
start: {q: [-60 deg, 20 deg, 100 deg, 0, 40 deg, 0]}
goal: {q: [0 deg, 40 deg, 80 deg, 0, 60 deg, 0]}
scene:
  - name: panel
    box: {center: [0.5, 0.3, 0.3], size: [0.4, 0.02, 0.3]}
"""


@cache
def planned(text: str) -> Plan:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "plan.yaml"
        path.write_text(text, encoding="utf-8")
        return fzcli.plan(path)


def balls(**signals: Any) -> Rollout:
    """A detour about a ball that stands, past one that moves; with changed signals."""
    run = as_rollout(planned(BALLS))
    return dataclasses.replace(run, signals={**run.signals, **signals}) if signals else run


def free() -> Rollout:
    """A straight joint path on a free base, as fast as it can be."""
    return as_rollout(planned(FREE))


def respecified(run: Rollout, old: str, new: str) -> Rollout:
    """The run with its specification's text changed."""
    text = run.provenance.spec_text
    if old not in text:
        raise ValueError(f"{old!r} is not in the specification")
    return dataclasses.replace(run, provenance=dataclasses.replace(run.provenance, spec_text=text.replace(old, new)))
