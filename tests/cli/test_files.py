"""validate, schema, init, info, plot and help: what the commands say of the shipped files."""

import json
from pathlib import Path
from typing import Any

import pytest
from cli_cases import ROOT, Invoke
from jsonschema import Draft202012Validator

from fzcli import __version__
from fzcli.cli.schema import all_schemas
from fzcli.cli.sources import KINDS
from fzcli.spec.reader import read

SHIPPED = sorted(path for folder in ("robots", "rulebases", "runs") for path in (ROOT / folder).glob("*.yaml"))
OPTIONS = {
    "simulate": {"--set", "--output", "--format", "--quiet"},
    "sweep": {
        *("--set", "--jobs", "--processes", "--dask", "--scheduler-file", "--shard"),
        *("--output", "--format", "--dry-run", "--quiet"),
    },
    "merge": {"--set", "--output", "--format", "--quiet"},
    "status": {"--set", "--output"},
    "check": {"--set", "--output"},
    "plan": {"--set", "--output", "--format", "--quiet"},
    "train": {"--set", "--output", "--format", "--quiet"},
    "table": {"--format"},
    "find": {"--config", "--that", "--by", "--lowest", "--most", "--format"},
    "get": {"--format", "--output"},
    "plot": {"--output", "--what"},
    "info": set(),
    "validate": set(),
    "schema": set(),
    "init": set(),
}


def test_all_shipped_files_are_valid(fzcli: Invoke) -> None:
    lines = fzcli("validate", *SHIPPED).stdout.splitlines()
    assert [line.rsplit(" (", 1)[0] for line in lines] == [f"{path}: ok" for path in SHIPPED]


def test_validate_goes_on_after_a_bad_file(fzcli: Invoke, tmp_path: Path) -> None:
    text = (ROOT / "rulebases/bulgarelli2011.yaml").read_text()
    (tmp_path / "bad.yaml").write_text(text.replace("is ON then increment is NL", "is ONN then increment is NL"))
    result = fzcli("validate", "bulgarelli4", "bad.yaml", "no.yaml", "run.yaml", code=2)
    assert result.stdout == "bulgarelli4: ok (robot)\nrun.yaml: ok (simulate)\n"
    assert "bad.yaml:39:23: " in result.stderr
    assert "ONN" in result.stderr
    assert "^" in result.stderr
    assert "no such file 'no.yaml'" in result.stderr


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_schemas_take_the_shipped_files_and_refuse_a_mistake(path: Path) -> None:
    value = read(path).value
    validator = Draft202012Validator(all_schemas()[value["kind"]])
    assert [error.message for error in validator.iter_errors(value)] == []
    assert not validator.is_valid({**value, "mistake": 1})
    first = path.read_text().splitlines()[0]
    assert first == f"# yaml-language-server: $schema=../schemas/{value['kind']}.json"


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("simulate", {"controller": {"kind": "clik"}}),
        ("simulate", {"controller": {"gain": 10}}),
        ("simulate", {"reference": {"kind": "nonsense"}}),
        ("simulate", {"step": [1]}),
        ("sweep", {"controller": {"gian": 10}}),
        ("sweep", {"trajectories": {"count": 1, "draw": {"start.q": {"gauss": [0, 1]}}}}),
        ("sweep", {"trajectories": {"count": 1, "draw": {"start.q": {"uniform": [0]}}}}),
        ("sweep", {"kind": "simulate"}),
    ],
)
def test_schemas_refuse(kind: str, change: dict[str, Any]) -> None:
    good = {"simulate": "fig3.yaml", "sweep": "table2.yaml"}[kind]
    value = read(ROOT / "runs" / good).value
    validator = Draft202012Validator(all_schemas()[kind])
    assert validator.is_valid(value)
    assert not validator.is_valid({**value, **change})


@pytest.mark.parametrize("kind", ["simulate", "sweep", "plan", "train", "planar_3rrr"])
def test_schemas_name_only_what_they_define(kind: str) -> None:
    schema = all_schemas()[kind]
    Draft202012Validator.check_schema(schema)
    text = json.dumps(schema)
    for name in {part.split('"')[0] for part in text.split("#/$defs/")[1:]}:
        assert name in schema["$defs"]


@pytest.mark.parametrize("kind", ["simulate", "sweep", "plan", "train", "planar_3rrr"])
def test_schema_files_in_the_tree_are_current(kind: str) -> None:
    def outline(schema: Any) -> Any:
        """Without what another version of pydantic may word differently."""
        if isinstance(schema, dict):
            wordy = ("description", "title", "default")
            return {key: outline(item) for key, item in schema.items() if key not in wordy}
        return [outline(item) for item in schema] if isinstance(schema, list) else schema

    written = json.loads((ROOT / "schemas" / f"{kind}.json").read_text())
    made = json.loads(json.dumps(all_schemas()[kind]))
    assert outline(written) == outline(made), f"run: fzcli schema {kind} > schemas/{kind}.json"


def test_schema_prints_one_kind_or_all(fzcli: Invoke) -> None:
    assert set(json.loads(fzcli("schema").stdout)) == set(KINDS)
    assert json.loads(fzcli("schema", "sweep").stdout)["title"] == "fzcli sweep"
    assert "gadget" in fzcli("schema", "gadget", code=2).stderr


def test_init_writes_a_copy_that_validates_and_runs(fzcli: Invoke, tmp_path: Path) -> None:
    written = [Path(line) for line in fzcli("init", "copy").stdout.splitlines()]
    assert {path.name for path in written} >= {"bulgarelli4.yaml", "table2.yaml", "sweep.json", "robot.json"}
    yamls = [path for path in written if path.suffix == ".yaml"]
    assert len(fzcli("validate", *yamls).stdout.splitlines()) == len(yamls)
    assert "exist already; nothing was written" in fzcli("init", "copy", code=2).stderr
    robot = tmp_path / "copy/robots/bulgarelli4.yaml"
    robot.write_text(robot.read_text().replace("mass: 16", "mass: 17"))
    assert "33 kg in all" in fzcli("info", robot).stdout


def test_info_describes_every_kind(fzcli: Invoke, made: Path) -> None:
    robot = fzcli("info", "ur5_free_flyer").stdout
    assert "joints    6 active: shoulder_pan, " in robot
    assert "116.994 kg in all" in robot
    assert "-360 to 360 deg, 180 deg/s" in robot
    assert "tip flange on wrist_3_link at (0, 0, 0.0823) m" in robot
    rules = fzcli("info", "bulgarelli2011").stdout
    assert "audit: nothing to report" in rules
    assert "4. if oscillating is ON then increment is NL" in rules
    assert "10 configurations x 1000 trajectories = 10000" in fzcli("info", "table2").stdout
    assert "variants    unconstrained, fixed gain" in fzcli("info", "fig3").stdout
    assert "2 configurations: 8 ok" in fzcli("info", made / "sweep.h5").stdout


def test_plots_of_every_kind(fzcli: Invoke, made: Path, tmp_path: Path) -> None:
    assert fzcli("plot", "bulgarelli2011").stdout == "bulgarelli2011-rulebase.png\n"
    assert fzcli("plot", made / "run.h5", "-o", "run.svg").stdout == "run.svg\n"
    assert fzcli("plot", made / "sweep.h5", "-o", "figures").stdout == "figures/sweep-table.png\n"
    for name in ("bulgarelli2011-rulebase.png", "run.svg", "figures/sweep-table.png"):
        assert (tmp_path / name).stat().st_size > 5000
    assert "cannot draw '.txt' files" in fzcli("plot", made / "run.h5", "-o", "run.txt", code=2).stderr


def test_a_sweep_without_a_table_section_is_tabulated_by_its_grid(fzcli: Invoke, tmp_path: Path) -> None:
    text = (tmp_path / "sweep.yaml").read_text()
    (tmp_path / "sweep.yaml").write_text(text[: text.index("table:")])
    shown = fzcli("sweep", "sweep.yaml").stdout
    assert "controller." in shown
    assert fzcli("table", "sweep/sweep.h5").stdout == shown
    shown = fzcli("sweep", "sweep.yaml", "--set", "grid={}", "--set", "controller.gain=10", "-o", "one.h5").stdout
    assert "configuration" in shown
    assert fzcli("table", "one.h5").stdout == shown


def test_version_and_help(fzcli: Invoke) -> None:
    assert fzcli("--version").stdout == f"fzcli {__version__}\n"
    listed = fzcli("--help").stdout
    for command, options in OPTIONS.items():
        assert f"\n  {command} " in listed
        text = fzcli(command, "--help").stdout
        for option in options | {"--help"}:
            assert option in text
    assert "Usage:" in fzcli(code=2).output


def test_info_tells_effort_and_friction_where_a_robot_states_them(fzcli: Invoke, tmp_path: Path) -> None:
    text = (ROOT / "robots/arm3r.yaml").read_text()
    old = "type: revolute"
    assert old in text
    new = f"{old}, effort: 12 N m, friction: {{viscous: 0.4, coulomb: 1.5}}"
    (tmp_path / "stiff.yaml").write_text(text.replace(old, new, 1))
    told = fzcli("info", "stiff.yaml").stdout
    assert "12 N m, friction 0.4 N m s/rad and 1.5 N m" in told
    assert told.count("friction") == 1


def test_info_tells_branch_and_singularities_of_a_planar_plan(fzcli: Invoke) -> None:
    told = fzcli("info", "rrr_obstacle").stdout
    for part in ("branch         --- det-", "watched        9 pairs of solids, 10 mm apart", "kept off by 0.1"):
        assert part in told
