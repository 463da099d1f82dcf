"""fzcli plan, and fzcli sweep of plans: exit codes, what is written, and what is not."""

from pathlib import Path

import pytest
from cli_cases import ROOT, Invoke
from jsonschema import Draft202012Validator

from fzcli.cli.schema import all_schemas
from fzcli.spec.reader import read

PLAN = ROOT / "runs" / "melfa_obstacle.yaml"
SWEEP = ROOT / "runs" / "scenes200.yaml"
SPHERE = "scene=[{sphere: {center: [%s], radius: %s}}]"
MOVING = "scene=[{sphere: {center: [0, 0, 0], radius: 0.05}, waypoints: {times: [0, 4], positions: [%s, %s]}}]"


def test_a_plan_is_written_and_told(fzcli: Invoke, tmp_path: Path) -> None:
    done = fzcli("plan", PLAN, "-o", tmp_path / "out.h5")
    assert "found by: detour" in done.stderr
    assert "clearance_min [m]" in done.stdout
    assert (tmp_path / "out.h5").exists()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (SPHERE % ("0.17, -0.29, 0.44", 0.05), "start.q: the start is in contact: J6_link and sphere 1 overlap by"),
        (SPHERE % ("0.17, 0.29, 0.32", 0.05), "goal.q: the goal is in contact: J6_link and sphere 1 overlap by"),
        (SPHERE % ("0.3, 0, 0.3", -0.05), "scene.0.sphere.radius: must be > 0, got -0.05"),
        (MOVING % ([0.9, 0.9, 0.9], [0.17, 0.29, 0.32]), "overlap by 76.6 mm at 4 s, when the arm gets there"),
        ("goal={position: [1.2, 0, 0.5]}", "goal.position: out of reach of tip 'flange': 620 mm missing"),
        ("goal.q.0=160 deg", "joint 'J1' is 2.793, outside its limits -2.618 to 2.618"),
        ("duration=0 s", "duration: must be > 0 or 'fastest', got '0 s'"),
    ],
)
def test_what_makes_no_sense_ends_with_2_and_no_file(fzcli: Invoke, tmp_path: Path, change: str, text: str) -> None:
    before = sorted(tmp_path.iterdir())
    result = fzcli("plan", PLAN, "--set", change, "-o", tmp_path / "out.h5", code=2)
    assert text in result.stderr
    assert sorted(tmp_path.iterdir()) == before


def test_the_kind_of_planner_takes_its_own_fields_along(fzcli: Invoke, tmp_path: Path) -> None:
    """The file's weights are of detours alone: they go with their planner; a path in contact is not written."""
    result = fzcli("plan", PLAN, "--set", "planner.kind=paper", "-o", tmp_path / "out.h5", code=1)
    assert "melfa_obstacle is not written: contact: J6_link and sphere 1 overlap by" in result.stderr
    assert not (tmp_path / "out.h5").exists()
    fzcli("plan", PLAN, "--set", "planner.kind=rrt_connect", "-o", tmp_path / "out.h5")
    result = fzcli("plan", PLAN, "--set", "planner.kind=paper", "--set", "planner.wieghts=1", code=2)
    assert "planner.wieghts: unknown key" in result.stderr


def test_a_sweep_of_plans_gives_a_table(fzcli: Invoke, tmp_path: Path) -> None:
    few = ("--set", "trajectories.count=1", "--set", "table={show: [claimed, solved, contact]}", "--format", "csv")
    done = fzcli("sweep", SWEEP, *few, "--jobs", 1, "-o", tmp_path / "out.h5")
    lines = done.stdout.splitlines()
    assert '"detour, fallbacks []",solved,1,share,1.0' in lines
    assert "rrt_connect,contact,1,share,0.0" in lines
    assert "paper,solved,1,share,0.0" in lines
    assert fzcli("table", tmp_path / "out.h5", "--format", "csv").stdout == done.stdout


@pytest.mark.parametrize(
    ("change", "good"),
    [
        ({"planner": {"kind": "paper", "window": [6, 14]}}, True),
        ({"planner": {"kind": "paper", "widow": [6, 14]}}, False),
        ({"hold_base": "perhaps"}, False),
        ({"controller": {"gain": 10}}, False),
        ({"scenes": {"radius": ["40 mm"]}}, False),
        ({"run": "simulate"}, False),
    ],
)
def test_the_schema_of_sweeps_knows_plans(change: dict[str, object], good: bool) -> None:
    validator = Draft202012Validator(all_schemas()["sweep"])
    assert validator.is_valid({**read(SWEEP).value, **change}) is good
