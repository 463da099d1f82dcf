"""Sweeps that go on: shards damaged, missing, locked or in the way, and the file they become."""

import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fzcli.errors import RecordError, UnfinishedError, UsageError
from fzcli.record.shard_file import read_shard, write_shard
from fzcli.record.sweep_file import read_sweep, read_table_spec
from fzcli.record.sweep_record import SweepRecord
from fzcli.sweep import output
from fzcli.sweep.builds import Builds
from fzcli.sweep.driver import Driver
from fzcli.sweep.engines.pool import Died, Outcome
from fzcli.sweep.execute import Listener, Means, Say, merge_to, run_sweep, sweep_part, sweep_to
from fzcli.sweep.folder import Folder, begin_folder
from fzcli.sweep.inspect import checked, state_of
from fzcli.sweep.meaning import AnySweep, meaning_of
from fzcli.sweep.output import folder_beside
from fzcli.sweep.simulations import Simulations
from fzcli.sweep.sweep_spec import TableSection
from fzcli.sweep.work import Done, Task
from tests.sweep.killing import small_sweep

ROOT = Path(__file__).parents[2]
COUNT = 40  # by 4 configurations: 3 shards
RUNS = (64, 64, 32)  # of the shards
THREADS = Means(jobs=2, processes=False)
pytestmark = pytest.mark.usefixtures("machine")


def sweep() -> AnySweep:
    return small_sweep(COUNT)


def half_done(path: Path) -> Folder:
    """Shards 0 and 2 of 3."""
    sweep_part(sweep(), path, (1, 2), THREADS, Listener())
    folder = begin_folder(folder_beside(path, meaning_of(sweep())), meaning_of(sweep()), "f4")
    assert [folder.shard(index).exists() for index in range(3)] == [True, False, True]
    return folder


def assert_whole(path: Path) -> None:
    """The file holds what a sweep that nothing happened to gives, and nothing is left beside it."""
    found, calm = read_sweep(path), run_sweep(sweep(), jobs=1)
    assert_same_numbers(found, calm)
    assert [one for one in path.parent.iterdir() if one != path] == []


def assert_same_numbers(found: SweepRecord, calm: SweepRecord) -> None:
    assert list(found.metrics) == list(calm.metrics)
    for name, values in calm.metrics.items():
        assert found.metrics[name].tobytes() == values.tobytes(), name
    assert [(run.config, run.trajectory, run.role) for run in found.kept] == [
        (run.config, run.trajectory, run.role) for run in calm.kept
    ]


def go_on(path: Path, say: Say | None = None) -> int:
    return sweep_to(sweep(), path, THREADS, Listener(say=say or (lambda text: None))).computed


def test_parts_then_the_rest_then_one_file(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    half_done(path)
    assert go_on(path) == RUNS[1]
    assert_whole(path)


def test_processes_give_the_same_bits(tmp_path: Path) -> None:
    sweep_to(sweep(), tmp_path / "s.h5", Means(jobs=2, processes=True), Listener())
    assert_whole(tmp_path / "s.h5")


def test_merge_wants_every_shard(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    with pytest.raises(UnfinishedError, match="there is no shard of this sweep yet"):
        merge_to(sweep(), path, Listener())
    half_done(path)
    with pytest.raises(UnfinishedError, match=r"shards are missing; 2 of 3 shards are done, in .*\.shards"):
        merge_to(sweep(), path, Listener())
    assert checked(sweep(), path).missing == 1
    sweep_part(sweep(), path, (2, 2), THREADS, Listener())
    merge_to(sweep(), path, Listener())
    assert_whole(path)


@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "other"])
def test_a_damaged_shard_is_found_and_computed_again(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "s.h5"
    folder = half_done(path)
    shard = folder.shard(0)
    data = bytearray(shard.read_bytes())
    data[len(data) // 3] ^= 1
    text = {"cut": bytes(data[:-7]), "flip": bytes(data), "empty": b"", "other": folder.shard(2).read_bytes()}[damage]
    shard.write_bytes(text)
    found = checked(sweep(), path)
    assert (len(found.damaged), found.missing) == (1, 1)
    said: list[str] = []
    assert go_on(path, said.append) == RUNS[0] + RUNS[1]
    words = "is a shard of another sweep, or another shard of this one" if damage == "other" else "damaged"
    assert len(said) == 1
    assert f"{shard}: {words}" in said[0]
    assert said[0].endswith("; computed again")
    assert_whole(path)


def test_every_byte_of_a_shard_counts(tmp_path: Path) -> None:
    shard = half_done(tmp_path / "s.h5").shard(0)
    data = shard.read_bytes()
    chance = random.Random(3)
    for place in [0, 30, 300, *(chance.randrange(len(data)) for _ in range(100))]:
        broken = bytearray(data)
        broken[place] ^= 1 << chance.randrange(8)
        shard.write_bytes(broken)
        with pytest.raises(RecordError):
            read_shard(shard)


def test_a_shard_of_another_version_is_computed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "s.h5"
    half_done(path)
    monkeypatch.setattr(sys.modules[Folder.__module__], "versions", lambda: {"fzcli": "9.9", "casadi": "9.9"})
    said: list[str] = []
    go_on(path, said.append)
    assert len(said) == 2
    assert ": made by fzcli " in said[0]
    assert ", this is 9.9; computed again" in said[0]


def test_a_shard_of_other_runs_is_computed_again(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    shard = half_done(path).shard(0)
    found = read_shard(shard)
    columns = {name: values[:-1] for name, values in found.columns.items()}
    write_shard(replace(found, columns=columns, status=found.status[:-1]), shard, "f4")
    said: list[str] = []
    assert go_on(path, said.append) == RUNS[0] + RUNS[1]
    assert said == [f"{shard}: made by an fzcli that parts sweeps otherwise; computed again"]
    assert_whole(path)


def test_the_clock_does_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    folder = half_done(path)
    for index, when in ((0, 4e9), (2, 1.0)):
        os.utime(folder.shard(index), (when, when))
    assert go_on(path) == RUNS[1]


def test_a_finished_sweep_is_left_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "s.h5"
    go_on(path)
    before = path.stat()
    monkeypatch.setattr(Builds, "of", None)  # no model is built
    assert go_on(path) == 0
    assert merge_to(sweep(), path, Listener()).computed == 0
    assert sweep_part(sweep(), path, (1, 2), THREADS, Listener()) == 0
    after = path.stat()
    assert (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns)
    assert list(tmp_path.iterdir()) == [path]
    assert checked(sweep(), path).text == f"{path}: finished and whole, 160 runs"


def test_other_numbers_are_a_sweep_beside(tmp_path: Path) -> None:
    path, other = tmp_path / "s.h5", small_sweep(COUNT, step="20 ms")
    go_on(path)
    first = path.read_bytes()
    sweep_to(other, path, THREADS, Listener())
    kept = path.with_name(f"s-{meaning_of(sweep()).short}.h5")
    assert kept.read_bytes() == first
    assert sorted(tmp_path.iterdir()) == sorted([path, kept])
    assert sweep_to(sweep(), path, THREADS, Listener()).path == kept
    assert read_sweep(path).provenance.spec_hash == meaning_of(other).identity
    assert state_of(other, path).others == [kept]


def test_a_file_that_is_no_sweep_is_kept_too(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    path.write_text("notes")
    go_on(path)
    (kept,) = [one for one in tmp_path.iterdir() if one != path]
    assert kept.read_text() == "notes"


def test_another_table_runs_nothing(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    go_on(path)
    tabled = sweep()
    tabled = replace(tabled, file=tabled.file.model_copy(update={"table": TableSection(show=("yaw_abs_mean",))}))
    assert sweep_to(tabled, path, THREADS, Listener()).computed == 0
    spec = read_table_spec(path)
    assert spec is not None
    assert spec.show == ("yaw_abs_mean",)
    assert_whole(path)


HOLD = """
import sys, time
from pathlib import Path
from fzcli.sweep.folder import begin_folder
from fzcli.sweep.meaning import meaning_of
from fzcli.sweep.output import folder_beside
from tests.sweep.killing import small_sweep
meaning = meaning_of(small_sweep(40))
with begin_folder(folder_beside(Path(sys.argv[1]), meaning), meaning, "f4").alone():
    print("held", flush=True)
    time.sleep(600)
"""


def test_a_second_driver_is_told_who_is_first(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    settings = {**os.environ, "PYTHONPATH": str(ROOT), "FZCLI_CC": "none"}
    command = [sys.executable, "-c", HOLD, str(path)]
    with subprocess.Popen(command, env=settings, cwd=ROOT, stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout is not None
        assert first.stdout.readline() == "held\n"
        who = rf"process {first.pid} on .*, at work since .*, works on this sweep; wait for it, or end it$"
        with pytest.raises(UsageError, match=who):
            go_on(path)
        with pytest.raises(UsageError, match=who):
            sweep_part(sweep(), path, (1, 2), THREADS, Listener())
        assert f"process {first.pid} " in state_of(sweep(), path).holders[0]
        first.send_signal(signal.SIGKILL)
    assert state_of(sweep(), path).holders == []
    go_on(path)
    assert_whole(path)


def test_parts_work_side_by_side_but_not_twice(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    folder = half_done(path)
    with folder.beside("part-1-of-2"):
        sweep_part(sweep(), path, (2, 2), THREADS, Listener())
        with pytest.raises(UsageError, match=f"process {os.getpid()} on .* works on this sweep"):
            sweep_part(sweep(), path, (1, 2), THREADS, Listener())
        with pytest.raises(UsageError, match=f"process {os.getpid()} on .* works on this sweep"):
            go_on(path)
    assert go_on(path) == 0
    assert_whole(path)


def test_what_a_killed_process_wrote_goes(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    folder = half_done(path)
    left = [folder.path / ".0000001.h5.abc.tmp", tmp_path / ".s.h5.abc.tmp"]
    for one in left:
        one.write_bytes(b"half")
    go_on(path)
    assert_whole(path)


FULL = """
import resource, sys, typer
from pathlib import Path
from fzcli.cli.guard import guarded
from fzcli.sweep.execute import Listener, Means, sweep_to
from tests.sweep.killing import small_sweep
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), -1))
try:
    guarded(lambda: sweep_to(small_sweep(40), Path(sys.argv[1]), Means(jobs=2, processes=False), Listener()))()
except typer.Exit as error:
    sys.exit(error.exit_code)
"""


@pytest.mark.parametrize("most", [20_000, 60_000])
def test_a_full_disk_loses_nothing(tmp_path: Path, most: int) -> None:
    """In the first shard, and in the file in the end."""
    path = tmp_path / "s.h5"
    settings = {**os.environ, "PYTHONPATH": str(ROOT), "FZCLI_CC": "none"}
    command = [sys.executable, "-c", FULL, str(path), str(most)]
    done = subprocess.run(command, env=settings, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert "cannot be written: File too large" in done.stderr
    assert "shards are done, in " in done.stderr
    assert done.returncode == 3
    assert "Traceback" not in done.stderr
    assert not path.exists()
    assert not list(tmp_path.glob("**/*.tmp"))
    go_on(path)
    assert_whole(path)
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[1] == resource.RLIM_INFINITY


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordError, match=r"cannot be made: Not a directory"):
        go_on(tmp_path / "file" / "s.h5")


@pytest.fixture
def read_only() -> Iterator[Callable[[], None]]:
    """Takes away the right to write where nobody else may; root does so by becoming another user."""
    mine = os.geteuid()
    yield lambda: os.seteuid(mine or 65534)
    os.seteuid(mine)


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """One that all users may enter, which pytest's are not."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)
        Path(name).chmod(0o755)


def test_a_folder_that_may_not_be_written(open_folder: Path, read_only: Callable[[], None]) -> None:
    """Nothing is begun there, nothing is lost, and a finished sweep is shown all the same."""
    path = open_folder / "s.h5"
    folder = half_done(path)
    before = sorted(folder.path.iterdir())
    go_on(open_folder / "other" / "s.h5")
    for one in (open_folder, folder.path, open_folder / "other"):
        one.chmod(0o555)
    read_only()
    with pytest.raises(RecordError, match=r"cannot be (made|written): Permission denied"):
        go_on(path)
    with pytest.raises(RecordError, match=r"cannot be made: Permission denied"):
        go_on(open_folder / "new" / "s.h5")
    assert go_on(open_folder / "other" / "s.h5") == 0
    assert sorted(folder.path.iterdir()) == before


class Fragile:
    """An engine whose workers die of some rows, and of others' deeds at chosen times; ``together``: all at a time."""

    window = 2

    def __init__(
        self, folder: Folder, deadly: dict[int, set[int]], accidents: int = 0, together: bool = False
    ) -> None:
        self.folder, self.deadly, self.accidents, self.together = folder, deadly, accidents, together
        self.tasks: list[Task] = []
        self.skipped: dict[int, tuple[int, ...]] = {}
        self.deaths = 0

    def submit(self, task: Task) -> None:
        self.tasks.append(task)

    def wait(self, seconds: float) -> list[tuple[Task, Outcome]]:
        if self.together and any(map(self.kills, self.tasks)):
            self.deaths += 1
            dead, self.tasks = self.tasks, []
            return [(task, Died("signal 9")) for task in dead]
        task = self.tasks.pop()
        self.accidents -= 1
        if self.accidents >= 0 or self.kills(task):
            self.deaths += 1
            return [(task, Died("signal 9"))]
        if task.probe is None:
            self.skipped[task.shard] = task.skip
        return [(task, Done(len(self.rows(task)), 0, 0.0))]

    def rows(self, task: Task) -> set[int]:
        return set(range(*task.probe) if task.probe else range(self.folder.layout.piece(task.shard).runs))

    def kills(self, task: Task) -> bool:
        return bool((self.rows(task) - set(task.skip)) & self.deadly.get(task.shard, set()))

    def progress(self) -> int:
        return 0

    def close(self, wait: bool) -> None:
        return None


def drive(tmp_path: Path, pool: Fragile, said: list[str]) -> None:
    driver = Driver(pool.folder, pool, lambda *what: None, said.append, lambda: False)
    driver.drive(iter(range(pool.folder.layout.shards)), 0)


def test_runs_that_end_their_worker_are_found(tmp_path: Path) -> None:
    folder = begin_folder(tmp_path / "f", meaning_of(sweep()), "f4")
    said: list[str] = []
    pool = Fragile(folder, {1: {5, 40, 41}})
    drive(tmp_path, pool, said)
    assert pool.skipped == {0: (), 1: (5, 40, 41), 2: ()}
    assert pool.deaths < 40
    assert said[0] == "shard 1 ended its worker 3 times (signal 9); looking for the run that does it"
    assert "configuration 0 on trajectory 21 ends its process (signal 9): recorded as crashed" in said
    assert len(said) == 4


def test_runs_beside_a_deadly_one_are_not_blamed(tmp_path: Path) -> None:
    """Tasks that wait at a worker of Dask end with it."""
    folder = begin_folder(tmp_path / "f", meaning_of(sweep()), "f4")
    for row in (0, 31, 32, 63):
        said: list[str] = []
        pool = Fragile(folder, {0: {row}, 1: {row}}, together=True)
        drive(tmp_path, pool, said)
        assert pool.skipped == {0: (row,), 1: (row,), 2: ()}
        assert sum("recorded as crashed" in line for line in said) == 2


def test_accidents_are_no_crashes(tmp_path: Path) -> None:
    folder = begin_folder(tmp_path / "f", meaning_of(sweep()), "f4")
    for accidents in range(1, 7):
        pool = Fragile(folder, {}, accidents)
        drive(tmp_path, pool, [])
        assert pool.skipped == {0: (), 1: (), 2: ()}


def test_a_crashed_run_is_a_failed_row(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    meaning, worker = meaning_of(sweep()), Simulations(sweep(), meaning_of(sweep()).identity)  # type: ignore[arg-type]
    folder = begin_folder(folder_beside(path, meaning), meaning, "f4")
    write_shard(worker.shard(folder.layout.piece(0), frozenset({3})), folder.shard(0), "f4")
    go_on(path)
    found, calm = read_sweep(path), run_sweep(sweep())
    assert found.metrics["crashed"].tolist() == [float(run == 3) for run in range(4 * COUNT)]
    assert found.metrics["status"][3] == 2
    assert np.isnan(found.metrics["tip_error_mean"][3])
    others = np.arange(4 * COUNT) != 3
    for name, values in calm.metrics.items():
        assert found.metrics[name][others].tobytes() == values[others].tobytes(), name
    assert all(run.trajectory != 3 for run in found.kept if run.config == 0)


def test_the_stop_sign_is_heeded(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    asked: list[int] = []

    def stop() -> bool:
        asked.append(1)
        return len(asked) > 2

    with pytest.raises(UnfinishedError, match=r"^stopped; [12] of 3 shards are done, in "):
        sweep_to(sweep(), path, Means(jobs=1, processes=False), Listener(stop=stop))
    go_on(path)
    assert_whole(path)


@pytest.mark.parametrize(
    ("record", "count"),
    [("metrics", 0), ({"every": 10}, 16), ({"best": 3}, 12), ("full", 160), ("failures", 0), ({"keep": "ends"}, 12)],
)
def test_what_is_kept(tmp_path: Path, record: object, count: int) -> None:
    path = tmp_path / "s.h5"
    kept = small_sweep(COUNT, record=record)
    sweep_to(kept, path, THREADS, Listener())
    found, calm = read_sweep(path), run_sweep(sweep())
    assert len(found.kept) == count
    for name, values in calm.metrics.items():
        assert found.metrics[name].tobytes() == values.tobytes(), name
    for run in found.kept[:: max(1, count // 8)]:
        row = run.config * COUNT + run.trajectory
        assert run.rollout.metrics["tip_error_mean"] == calm.metrics["tip_error_mean"][row]
        assert len(run.rollout.time) == calm.metrics["n_steps"][row] + 1
        if "every" in str(record):
            assert run.trajectory % 10 == 0


def test_many_trajectories_stay_in_their_shards(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(output, "MOST_MERGED", 1000)
    path, whole = tmp_path / "s.h5", small_sweep(COUNT, record="full")
    sweep_to(whole, path, THREADS, Listener())
    shards = sorted(tmp_path.glob("*.shards/*.h5"))
    assert len(shards) == 3
    found = read_sweep(path)
    assert len(found.kept) == 160
    assert found.kept[-1].rollout.q.shape == found.kept[0].rollout.q.shape
    assert checked(whole, path).damaged == []
    assert sweep_to(whole, path, THREADS, Listener()).computed == 0
    data = bytearray(shards[2].read_bytes())
    data[-1] ^= 1
    shards[2].write_bytes(data)
    with pytest.raises(RecordError, match="damaged"):
        _ = read_sweep(path).kept[-1]
    shards[2].unlink()
    with pytest.raises(RecordError, match="cannot be read"):
        _ = read_sweep(path).kept[-1]
    assert len(checked(whole, path).damaged) == 1
