"""Runs that end their process for real, in the machine code of somebody else's controller, through the command line."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from fzcli.record.sweep_file import read_sweep
from fzcli.record.sweep_record import SweepRecord
from tests.sweep.deadly_servo import ENTRY_POINT
from tests.sweep.killing import Killer

ROOT = Path(__file__).parents[2]
COUNT, DEADLY, CONFIG = 20, 17, 2  # of trajectories; the one that kills, on this configuration; it is in shard 1 of 2
ROW = CONFIG * COUNT + DEADLY
SWEEP = f"""\
kind: sweep
robot: bulgarelli4
reference: {{kind: hold}}
controller: {{kind: servo}}
duration: 100 ms
trajectories:
  count: {COUNT}
  seed: 7
  draw: {{start.q: {{uniform: [[0.9, -1.4, 0.3, 0.5], [1.0, -1.3, 0.4, 0.6]]}}}}
grid: {{controller.gain: [1, 2, 3, 4]}}
record: {{rank_by: speed_mean}}
table: {{rows: controller.gain, show: [speed_mean]}}
"""
ORDERED = """\
kind: sweep
robot: bulgarelli4
start: {q: [0.9, -1.4, 0.3, 0.5]}
reference: {kind: hold}
controller: {kind: servo}
duration: 100 ms
trajectories: {count: 4, sampling: latin_hypercube, draw: {controller.order: {choice: [1, 2, 3, 4]}}}
record: {rank_by: speed_mean}
"""
pytestmark = pytest.mark.long
Done = subprocess.CompletedProcess[str]


def environment(folder: Path, **more: str) -> dict[str, str]:
    """Where a package with the controller is installed, in ``folder``."""
    package = folder / "packages" / "servo-1.dist-info"
    package.mkdir(parents=True, exist_ok=True)
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: servo\nVersion: 1\n")
    (package / "entry_points.txt").write_text(ENTRY_POINT)
    return {"PYTHONPATH": os.pathsep.join([str(package.parent), str(ROOT)]), "FZCLI_CC": "none", **more}


def sweep(folder: Path, text: str, *words: object, **more: str) -> Done:
    """``fzcli sweep s.yaml WORDS`` to ``folder``."""
    (folder / "s.yaml").write_text(text)
    options = ["--jobs", "2", "-o", folder / "result", *words]
    command = [sys.executable, "-m", "fzcli", "sweep", folder / "s.yaml", *options]
    settings = {**os.environ, **environment(folder, **more)}
    return subprocess.run([str(word) for word in command], env=settings, capture_output=True, text=True, timeout=300)


def result_of(folder: Path) -> SweepRecord:
    """Its file, beside which nothing is left."""
    assert [one.name for one in (folder / "result").iterdir()] == ["s.h5"]
    return read_sweep(folder / "result" / "s.h5")


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory, cache_of_the_tests: None) -> SweepRecord:
    """The sweep undisturbed."""
    folder = tmp_path_factory.mktemp("calm")
    assert sweep(folder, SWEEP).returncode == 0
    return result_of(folder)


@pytest.fixture
def deadly(calm: SweepRecord) -> dict[str, str]:
    """The environment in which one of the starts kills."""
    return {"DEADLY_START": repr(float(calm.draws["start.q"][DEADLY, 0]))}


@pytest.fixture
def cluster(deadly: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The file of a scheduler with two workers, processes of this machine."""
    pytest.importorskip("distributed")
    at_once = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}  # by default a task may end four workers
    for name, value in environment(tmp_path, **deadly, **at_once).items():
        monkeypatch.setenv(name, value)
    keeper = Killer("dask", tmp_path / "cluster", 0)
    keeper.ready()
    yield keeper.scheduler_file
    for process in keeper.cluster:
        process.kill()
        process.wait()


def assert_found(done: Done, folder: Path, calm: SweepRecord, how: str) -> None:
    """The deadly run is told and marked, and nothing else is touched."""
    assert f"configuration {CONFIG} on trajectory {DEADLY} ends its process ({how}): recorded as crashed" in done.stderr
    assert done.stderr.count("recorded as crashed") == 1
    assert "1 runs failed, 1 of them in configurations that were not expected to" in done.stderr
    assert "Traceback" not in done.stderr
    assert done.returncode == 1, done.stderr
    found = result_of(folder)
    assert np.flatnonzero(found.metrics["crashed"]).tolist() == [ROW]
    assert found.metrics["status"][ROW] == 2
    assert np.isnan(found.metrics["speed_mean"][ROW])
    others = np.arange(4 * COUNT) != ROW
    for name, values in calm.metrics.items():
        assert found.metrics[name][others].tobytes() == values[others].tobytes(), name
    assert found.draws["start.q"].tobytes() == calm.draws["start.q"].tobytes()
    for mine, other in zip(found.kept, calm.kept, strict=True):
        if mine.config != CONFIG:
            assert (mine.config, mine.trajectory, mine.role) == (other.config, other.trajectory, other.role)
            assert mine.rollout.q.tobytes() == other.rollout.q.tobytes()


def test_in_a_process(calm: SweepRecord, deadly: dict[str, str], tmp_path: Path) -> None:
    done = sweep(tmp_path, SWEEP, "--processes", **deadly)
    assert "shard 1 ended its worker 3 times (signal 11); looking for the run that does it" in done.stderr
    assert_found(done, tmp_path, calm, "signal 11")


def test_in_a_worker_of_dask(calm: SweepRecord, deadly: dict[str, str], cluster: Path, tmp_path: Path) -> None:
    done = sweep(tmp_path, SWEEP, "--scheduler-file", cluster, **deadly)
    assert_found(done, tmp_path, calm, "Dask lost a worker")


def test_in_a_dask_cluster_of_our_own(calm: SweepRecord, deadly: dict[str, str], tmp_path: Path) -> None:
    """Which by itself gives up a worker that is not back in time."""
    pytest.importorskip("distributed")
    done = sweep(tmp_path, SWEEP, "--dask", "local", **deadly, DASK_DISTRIBUTED__DEPLOY__LOST_WORKER_TIMEOUT="1 ms")
    assert_found(done, tmp_path, calm, "Dask lost a worker")


def test_in_a_thread_it_ends_the_program_and_processes_go_on(
    calm: SweepRecord, deadly: dict[str, str], tmp_path: Path
) -> None:
    assert sweep(tmp_path, SWEEP, "--threads", **deadly).returncode == -signal.SIGSEGV
    assert not (tmp_path / "result" / "s.h5").exists()
    assert_found(sweep(tmp_path, SWEEP, "--processes", **deadly), tmp_path, calm, "signal 11")


def test_a_controller_that_cannot_be_built(tmp_path: Path) -> None:
    """A drawn field that is built in: the runs beside it are probed without it."""
    for name, more in (("calm", {}), ("deadly", {"DEADLY_ORDER": "3.0"})):
        (tmp_path / name).mkdir()
        done = sweep(tmp_path / name, ORDERED, "--processes", **more)
    assert "ends its process (signal 6): recorded as crashed" in done.stderr
    assert done.returncode == 1
    found, calm = result_of(tmp_path / "deadly"), result_of(tmp_path / "calm")
    at = calm.draws["controller.order"].ravel() == 3.0
    assert at.sum() == 1
    assert found.metrics["crashed"].tolist() == at.astype(float).tolist()
    assert found.metrics["speed_mean"][~at].tobytes() == calm.metrics["speed_mean"][~at].tobytes()
