"""SIGKILL at random moments, in every engine and to every process of it: the sweep ends as if nothing had happened."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fzcli.record.sweep_file import read_sweep
from fzcli.sweep.execute import run_sweep
from tests.sweep.killing import VICTIMS, small_sweep

ROOT = Path(__file__).parents[2]
KILLS = 20

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="finds processes in /proc"),
    pytest.mark.usefixtures("machine"),
]


@pytest.mark.parametrize("engine", ["threads", "processes", "dask"])
def test_kills_leave_no_trace(tmp_path: Path, engine: str) -> None:
    if engine == "dask":
        pytest.importorskip("distributed")
    folder = tmp_path / engine
    folder.mkdir()
    command = [sys.executable, "-m", "tests.sweep.killing", engine, str(folder), str(KILLS), "2011"]
    settings = {**os.environ, "FZCLI_CC": "none", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=ROOT, env=settings, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert all(f"'{victim}'" in done.stdout for victim in VICTIMS[engine]), done.stdout
    assert [path.name for path in folder.iterdir()] == ["s.h5"]
    killed, calm = read_sweep(folder / "s.h5"), run_sweep(small_sweep(), jobs=1)
    assert list(killed.metrics) == list(calm.metrics)
    for name, values in calm.metrics.items():
        assert killed.metrics[name].tobytes() == values.tobytes(), name
    for path, values in calm.draws.items():
        assert killed.draws[path].tobytes() == values.tobytes(), path
    assert [(run.config, run.trajectory, run.role) for run in killed.kept] == [
        (run.config, run.trajectory, run.role) for run in calm.kept
    ]
