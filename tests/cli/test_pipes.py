"""Pipes, signals and the time to help: real processes."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from cli_cases import ROOT, SWEEP, Invoke, shell

FZCLI = f"{sys.executable} -m fzcli"


def in_bash(script: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = ["bash", "-c", f"set -o pipefail; {script}"]
    settings = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, env=settings, timeout=300)


@pytest.mark.parametrize(
    "words", ["get run.h5 signals", "get run.h5 q --format jsonl", "get sweep.h5", "info run.h5", "schema sweep"]
)
def test_a_reader_that_leaves_early_is_no_error(made: Path, words: str) -> None:
    done = in_bash(f"{FZCLI} {words} | head -1", made)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert done.stdout.count("\n") == 1
    gone = in_bash(f"{FZCLI} {words} | true", made)
    assert (gone.returncode, gone.stderr) == (0, "")


def test_a_run_whose_reader_left_is_still_written(made: Path, tmp_path: Path) -> None:
    done = in_bash(f"{FZCLI} simulate {made / 'run.yaml'} -o {tmp_path / 'r.h5'} | true", made)
    assert done.returncode == 0
    assert (tmp_path / "r.h5").is_file()


def test_standard_output_is_data_only(made: Path) -> None:
    text = shell("get", made / "run.h5", "q", cwd=made).stdout
    rows = list(csv.DictReader(io.StringIO(text)))
    assert list(rows[0]) == ["time", "q.q1", "q.q2", "q.q3", "q.q4"]
    assert [float(row["time"]) for row in rows] == pytest.approx(np.arange(101) * 0.01)
    lines = shell("get", made / "run.h5", "tip_error", "--format", "jsonl", cwd=made).stdout.splitlines()
    assert [json.loads(line)["time"] for line in lines] == [float(row["time"]) for row in rows]
    sweep = shell("sweep", made / "sweep.yaml", "--format", "json", "-o", made / "again.h5", cwd=made)
    assert {entry["statistic"] for entry in json.loads(sweep.stdout)} >= {"mean", "median", "lost"}
    assert "runs in" in sweep.stderr


def test_npy_reads_back(fzcli: Invoke, made: Path, tmp_path: Path) -> None:
    data = np.load(io.BytesIO(fzcli("get", made / "run.h5", "q", "--format", "npy").stdout_bytes))
    assert data.dtype.names == ("time", "q.q1", "q.q2", "q.q3", "q.q4")
    result = fzcli("get", made / "run.h5", "q", "--format", "npy", "-o", "deep/q.npy")
    assert result.stdout == ""
    assert result.stderr == "fzcli: wrote deep/q.npy\n"
    np.testing.assert_array_equal(np.load(tmp_path / "deep/q.npy"), data)


def test_get_without_a_name_lists_names_that_get_knows(fzcli: Invoke, made: Path) -> None:
    for file in ("run.h5", "sweep.h5"):
        names = fzcli("get", made / file).stdout.split()
        assert {"metrics", "q", "provenance/spec_text"} <= set(names)
        for name in names[:: max(1, len(names) // 8)]:
            assert fzcli("get", made / file, name).stdout


def _sweeping(folder: Path) -> subprocess.Popen[bytes]:
    """A long sweep, past the start of its first shards."""
    (folder / "sweep.yaml").write_text(SWEEP.replace("count: 4", "count: 100000"))
    settings = {**os.environ, "PYTHONPATH": str(ROOT), "FZCLI_CC": "none"}
    command = [sys.executable, "-m", "fzcli", "sweep", "sweep.yaml", "--threads"]
    process = subprocess.Popen(command, cwd=folder, env=settings, stderr=subprocess.PIPE)
    end = time.monotonic() + 60
    while not list(folder.glob("sweep/*.shards/*.h5")):
        assert time.monotonic() < end
        time.sleep(0.05)
    return process


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_lets_the_shards_in_flight_finish(tmp_path: Path, number: signal.Signals) -> None:
    process = _sweeping(tmp_path)
    process.send_signal(number)
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == 3, stderr
    lines = stderr.decode().splitlines()
    assert "fzcli: finishing the shards in flight; once more to stop at once" in lines
    assert lines[-1].startswith("fzcli: stopped; ")
    assert lines[-1].endswith("; go on with: fzcli sweep sweep.yaml --threads")
    assert not list(tmp_path.glob("**/*.tmp"))
    assert not (tmp_path / "sweep/sweep.h5").exists()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_second_signal_ends_a_sweep_at_once(tmp_path: Path, number: signal.Signals, code: int) -> None:
    process = _sweeping(tmp_path)
    process.send_signal(number)
    time.sleep(0.1)
    process.send_signal(number)
    _, stderr = process.communicate(timeout=60)
    assert process.returncode in (code, 3), stderr  # 3: the shards in flight were the quicker ones
    assert b"Traceback" not in stderr
    assert not (tmp_path / "sweep/sweep.h5").exists()


def test_help_loads_none_of_the_heavy_packages(tmp_path: Path) -> None:
    script = (
        "import sys; sys.argv = ['fzcli', '--help']\n"
        "from fzcli.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'casadi', 'numpy', 'scipy', 'h5py', 'matplotlib', 'pydantic', 'yaml', 'rich'}\n"
        "print('loaded', sorted(heavy & set(sys.modules)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=True,
    )
    assert done.stdout.endswith("loaded []\n")
    times = []  # of the processor, so that a busy machine does not count
    for _ in range(5):
        before = os.times()
        shell("--help", cwd=tmp_path)
        after = os.times()
        times.append(after.children_user + after.children_system - before.children_user - before.children_system)
    assert min(times) <= 0.35


def test_a_finished_sweep_loads_neither_simulators_nor_planners(tmp_path: Path) -> None:
    """Its table comes within a second, most of which is Python and NumPy."""
    script = (
        "import sys; sys.argv = ['fzcli', 'sweep', 'table2-small', '--set', 'trajectories.count=2']\n"
        "from fzcli.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code\n"
        "heavy = {'scipy', 'matplotlib', 'distributed', 'fzcli.sweep.simulations', 'fzcli.plan.load', 'fzcli.learn'}\n"
        "print('loaded', sorted(heavy & set(sys.modules)))\n"
    )
    settings = {**os.environ, "PYTHONPATH": str(ROOT), "FZCLI_CC": "none"}
    command = [sys.executable, "-c", script]
    runs = [
        subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=settings, check=True)
        for _ in range(2)
    ]
    assert "fzcli.sweep.simulations" in runs[0].stdout.splitlines()[-1]
    assert "finished before" in runs[1].stderr
    assert runs[1].stdout.endswith("loaded []\n")
