"""Figures of runs at torque level."""

import dataclasses
from pathlib import Path

import pytest

from fzcli.errors import RecordError
from fzcli.loop.rollout import Rollout
from fzcli.loop.run_file import run_of, variants_of
from fzcli.loop.simulate import simulate_all
from fzcli.record.rollout_file import write_rollout
from fzcli.spec.document import document_of
from fzcli.view.plots import plot
from fzcli.view.torque_plot import following_figure, torque_figure

RUN = {
    "kind": "simulate",
    "robot": "bulgarelli4",
    "start": {"q": [0.928, -1.393, 0.303, 0.549]},
    "reference": {"kind": "line", "direction": [1, 0, 0], "length": 0.2, "duration": 10},
    "controller": {"kind": "clik", "gain": 10},
    "duration": 0.4,
    "replay": {"controller": {"kind": "computed_torque"}, "attitude": {"by": "wheels"}},
    "compare": {"believed": {"replay.attitude": None}},
}


@pytest.fixture
def run(machine: None) -> Rollout:
    document = document_of(RUN)
    spec = run_of(document)
    return simulate_all(spec, variants_of(document, spec))


def test_a_run_at_torque_level_is_drawn_beside_its_motion(run: Rollout, tmp_path: Path) -> None:
    write_rollout(run, tmp_path / "run.h5")
    drawn = plot(tmp_path / "run.h5")
    assert [path.name for path in drawn] == ["run-following.png", "run-torques.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in drawn)
    figure = following_figure({"own": run, **run.variants})
    tip, yaw, _ = figure.axes
    assert [line.get_label() for line in yaw.lines] == ["own", "kinematic", "believed"]
    assert [line.get_label() for line in tip.lines] == ["own", "believed"]
    panels = [axes.get_ylabel() for axes in torque_figure(run).axes]
    assert panels[0] == "torque [N m]"
    assert panels[-1] == "wheels [N m s]"
    assert len(torque_figure(run.variants["believed"]).axes) == len(panels) - 1


def test_a_run_without_torques_has_no_such_figure(run: Rollout, tmp_path: Path) -> None:
    alone = dataclasses.replace(run.variants["kinematic"], variants={})
    write_rollout(alone, tmp_path / "run.h5")
    with pytest.raises(RecordError, match="has no torques, which 'torques' is drawn from; give the run a section"):
        plot(tmp_path / "run.h5", what="torques")
