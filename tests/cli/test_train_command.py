"""``fzcli train``, and what other commands say of its files."""

import json
from pathlib import Path

import pytest
from cli_cases import Invoke

from fzcli.learn.store import load

RUN = """\
kind: train
robot: rrr_planar
map: {kind: planar_forward, radius: 100 mm, turn: 15 deg, modes: ["+++"]}
samples: {train: 200, test: 50}
trainer: {kind: levenberg_marquardt, iterations: 20, starts: 1}
"""


@pytest.fixture
def nets(tmp_path: Path) -> Path:
    (tmp_path / "nets.yaml").write_text(RUN)
    return tmp_path / "nets.yaml"


def test_the_table_goes_out_and_the_networks_to_a_file(fzcli: Invoke, nets: Path, tmp_path: Path) -> None:
    done = fzcli("train", "nets.yaml")
    head, row = done.stdout.splitlines()[:2]
    assert head.startswith("network   mse train  mse test  raw rms mm")
    assert row.startswith("+++ det+  ")
    assert "no network for +++ det-: it does not occur" in done.stderr
    assert "wrote nets/nets.npz" in done.stderr
    assert list(load(tmp_path / "nets" / "nets.npz").trained) == ["+++ det+"]
    described = fzcli("info", "nets/nets.npz").stdout
    assert "1 of the robot rrr_planar (" in described
    assert row in described
    assert fzcli("plot", "nets/nets.npz", "-o", "figures").stdout.splitlines() == [
        "figures/nets-comparison.png",
        "figures/nets-errors.png",
    ]


def test_other_formats(fzcli: Invoke, nets: Path) -> None:
    found = json.loads(fzcli("train", "nets.yaml", "--format", "json", "-q", "-o", "a.npz").stdout)
    assert 0 < found["+++ det+"]["raw_distance_rms"] < 0.01
    lines = fzcli("train", "nets.yaml", "--format", "csv", "-q", "-o", "b.npz").stdout.splitlines()
    assert lines[0] == "network,metric,unit,value"
    assert f"+++ det+,raw_distance_rms,m,{found['+++ det+']['raw_distance_rms']!r}" in lines
    table = fzcli("train", "nets.yaml", "--format", "md", "-q", "-o", "c.npz").stdout.splitlines()
    assert table[0].startswith("| network | mse train |")
    assert table[1].startswith("| ---: |")


def test_bad_runs_end_with_two_and_write_nothing(fzcli: Invoke, nets: Path, tmp_path: Path) -> None:
    text = fzcli("train", "nets.yaml", "--set", "robot=ur5", code=2).stderr
    assert "'planar_forward' does not suit the robot 'ur5'; arm_inverse does" in text
    nets.write_text(RUN.replace("turn:", "trun:"))
    assert "nets.yaml:3:" in fzcli("train", "nets.yaml", code=2).stderr
    assert "train is wanted, got 'simulate'" in fzcli("train", "run.yaml", code=2).stderr
    assert not (tmp_path / "nets").exists()


def test_info_of_planar_robots_and_trainings(fzcli: Invoke, nets: Path) -> None:
    assert "base      corners 0.4 m from its centre, at 210, 330, 90 deg" in fzcli("info", "rrr_planar").stdout
    described = fzcli("info", "nets.yaml").stdout
    assert "theta1 [rad], theta2 [rad], theta3 [rad] -> x [m], y [m], phi [rad]" in described
    assert "2: +++ det+; +++ det-" in described
    assert fzcli("validate", "nets.yaml").stdout == "nets.yaml: ok (train)\n"
