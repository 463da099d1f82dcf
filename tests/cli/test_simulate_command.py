"""``fzcli simulate`` and ``fzcli sweep``: what they print, write, and end with."""

import csv
import io
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from cli_cases import ROOT, RUN, Invoke, shell

from fzcli.record.rollout_file import read_rollout
from fzcli.record.sweep_file import read_sweep

COMPARED = "compare: {free: {controller.kind: unconstrained}, strong: {controller.gain: 50}}\n"


def test_a_run_prints_its_summary_and_writes_beside_its_file(fzcli: Invoke, tmp_path: Path) -> None:
    result = fzcli("simulate", "run.yaml")
    assert result.stdout.splitlines()[1].split() == ["status", "ok"]
    for name in ("tip_error_mean [m]", "certificate", "singular_value_min"):
        assert f"\n{name}" in result.stdout
    assert result.stderr.startswith("fzcli: wrote run/run.h5 (")
    rollout = read_rollout(tmp_path / "run/run.h5")
    assert rollout.status.name == "ok"
    assert rollout.time[-1] == 1.0
    assert rollout.provenance.argv[0] == "fzcli"


def test_csv_and_json_summaries_are_data_and_agree(fzcli: Invoke) -> None:
    rows = list(csv.DictReader(io.StringIO(fzcli("simulate", "run.yaml", "--format", "csv").stdout)))
    whole = json.loads(fzcli("simulate", "run.yaml", "--format", "json").stdout)["run"]
    assert whole["status"] == rows[0]["value"] == "ok"
    for row in rows[1:]:
        assert whole[row["group"]][row["name"]] == float(row["value"])
    assert {row["unit"] for row in rows if row["name"] == "tip_error_mean"} == {"m"}


def test_variants_stand_beside_the_run_in_summary_and_file(fzcli: Invoke, tmp_path: Path) -> None:
    (tmp_path / "run.yaml").write_text(RUN + COMPARED)
    result = fzcli("simulate", "run.yaml", "--set", "controller.gain=20")
    assert result.stdout.splitlines()[0].split() == ["run", "free", "strong"]
    line = next(line for line in result.stdout.splitlines() if line.startswith("gain_final"))
    assert line.split()[2:] == ["20", "-", "50"]
    back = read_rollout(tmp_path / "run/run.h5")
    assert list(back.variants) == ["free", "strong"]
    assert "gain" not in back.variants["free"].signals
    assert fzcli("plot", "run/run.h5").stdout == "run/run-comparison.png\n"


def test_output_may_be_a_file_or_a_folder_and_messages_can_be_silenced(fzcli: Invoke, tmp_path: Path) -> None:
    assert fzcli("simulate", "run.yaml", "-o", "deep/er/one.h5", "--quiet").stderr == ""
    assert (tmp_path / "deep/er/one.h5").is_file()
    fzcli("simulate", "run.yaml", "-o", "folder")
    assert (tmp_path / "folder/run.h5").is_file()
    assert "is there already, and is not a file" in fzcli("simulate", "run.yaml", "-o", "/dev/null", code=2).stderr


def test_standard_input_and_shipped_runs_write_into_runs(fzcli: Invoke, tmp_path: Path) -> None:
    fzcli("simulate", "-", text=RUN)
    assert (tmp_path / "runs/stdin/stdin.h5").is_file()
    assert "runs/table2-small/table2-small.h5" in fzcli("sweep", "table2-small", "--dry-run").stdout


def test_a_diverging_run_ends_with_status_data_and_1(fzcli: Invoke, tmp_path: Path) -> None:
    result = fzcli("simulate", "run.yaml", "--set", "controller.gain=1e12", code=1)
    assert "failed: diverged at 0.0" in result.stdout
    assert "advice: lower controller.gain or step; the data up to here is kept" in result.stdout
    assert "run failed: diverged" in result.stderr
    rollout = read_rollout(tmp_path / "run/run.h5")
    assert rollout.status.name == "failed"
    assert 1 <= len(rollout.time) < 50
    assert len(rollout.q) == len(rollout.time)


def test_a_lost_tip_is_flagged_and_ends_with_0(fzcli: Invoke) -> None:
    result = fzcli("simulate", "run.yaml", "--set", "bounds.tip_error=1e-7", "--format", "json")
    run = json.loads(result.stdout)["run"]
    assert run["status"] == "flagged"
    assert run["reason"].startswith("tip_error_max ")
    assert run["reason"].endswith("breaks the bound 1e-07")


def test_a_sweep_prints_its_table_and_keeps_its_command(fzcli: Invoke, tmp_path: Path) -> None:
    result = fzcli("sweep", "sweep.yaml", "--format", "csv", "--jobs", "1")
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert {row["controller.gain"] for row in rows} == {"10.0", "100.0"}
    assert {row["value"] for row in rows if row["statistic"] == "runs"} == {"4"}
    assert "fzcli: 8 runs in " in result.stderr
    assert "; wrote sweep/sweep.h5 (" in result.stderr
    record = read_sweep(tmp_path / "sweep/sweep.h5")
    means = {row["controller.gain"]: float(row["value"]) for row in rows if row["statistic"] == "mean"}
    column = record.metrics["tip_error_mean"].reshape(2, 4).mean(axis=1)
    np.testing.assert_allclose(list(means.values()), column, rtol=1e-14)
    again = fzcli("table", "sweep/sweep.h5", "--format", "csv")
    assert again.stdout == result.stdout


def test_dry_run_counts_and_writes_nothing(fzcli: Invoke, tmp_path: Path) -> None:
    words = fzcli("sweep", "sweep.yaml", "--dry-run", "--set", "trajectories.count=50").stdout.split()
    assert words[:6] == ["configurations", "2", "trajectories", "50", "runs", "100"]
    assert not (tmp_path / "sweep").exists()


def test_unexpected_failures_end_with_1_and_expected_ones_with_0(fzcli: Invoke) -> None:
    wild = ["--set", "grid={controller.gain: [10, 1e12]}", "--format", "csv"]
    result = fzcli("sweep", "sweep.yaml", *wild, code=1)
    assert "fzcli: 4 runs failed, 4 of them in configurations that were not expected to" in result.stderr
    assert "1000000000000.0,,,failed,4" in result.stdout
    fzcli("sweep", "sweep.yaml", *wild, "--set", "expect_failures={controller.gain: 1e12}")


def test_jobs_do_not_change_a_bit(fzcli: Invoke, tmp_path: Path) -> None:
    for jobs in (1, 2):
        fzcli("sweep", "sweep.yaml", "--jobs", jobs, "-o", f"{jobs}.h5", "--quiet")
    with h5py.File(tmp_path / "1.h5") as one, h5py.File(tmp_path / "2.h5") as two:
        for name in ("tip_error_mean", "yaw_abs_max", "angular_momentum_max"):
            assert one[name][...].tobytes() == two[name][...].tobytes()


def test_without_a_compiler_one_line_says_so(tmp_path: Path) -> None:
    (tmp_path / "run.yaml").write_text(RUN)
    done = shell("simulate", "run.yaml", cwd=tmp_path, FZCLI_CC="none")
    assert done.stderr.count("no C compiler") == 1
    assert read_rollout(tmp_path / "run/run.h5").provenance.engine == "vm"
    wrong = shell("simulate", "run.yaml", cwd=tmp_path, code=1, FZCLI_CC="no-such-compiler")
    assert wrong.stderr == "error: FZCLI_CC=no-such-compiler: this compiler does not run\n"


def test_a_closed_tip_path_turns_the_base(fzcli: Invoke, tmp_path: Path) -> None:
    fzcli("simulate", ROOT / "runs/reorientation.yaml", "-o", "r.h5")
    run = read_rollout(tmp_path / "r.h5")
    assert run.status.name == "ok"
    assert np.linalg.norm(run.tip_position[-1] - run.tip_position[0]) < 2e-5
    turned = 2 * np.degrees(np.arccos(abs(run.base_quat[-1, 0])))
    assert turned == pytest.approx(15.0, abs=1.0)
    assert run.certificate["linear_momentum_max"] < 1e-12
