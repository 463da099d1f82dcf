"""A disk that is full for real: a small file system in memory, where the test may mount one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SWEEP = """\
kind: sweep
robot: bulgarelli4
reference: {kind: line, duration: 1 s}
duration: 200 ms
start: {q: [0.928, -1.393, 0.303, 0.549]}
controller: {kind: clik}
trajectories:
  count: 40
  seed: 7
  draw: {reference.length: {uniform: [0.05, 0.2]}, reference.direction: {sphere: 3}}
grid: {controller.gain: [10, 100, 1000, 5000]}
"""
SIZE = 1 << 20  # of the file system; the whole takes a third of it
MOUNT = f"mkdir -p small && mount -t tmpfs -o size={SIZE} none small"
DISTURBED = f"""
{MOUNT} && cp s.yaml small && cd small || exit 1
head -c "$1" /dev/zero > filler
shift
"$@" 2> ../full.txt
echo $? > ../full.code
find . -type f > ../full.files
rm filler
"$@" 2> ../on.txt || exit 2
ls > ../on.files
cp s.h5 ..
"""


def in_namespace(script: str, folder: Path, *words: object) -> "subprocess.CompletedProcess[str]":
    """A shell script in a mount namespace of its own, which takes its mounts along when it ends."""
    command = ["unshare", "--map-root-user", "--mount", "sh", "-c", script, "sh", *(str(word) for word in words)]
    settings = {**os.environ, "PYTHONPATH": str(ROOT), "FZCLI_CC": "none"}
    return subprocess.run(command, cwd=folder, env=settings, capture_output=True, text=True, timeout=300)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """One in which file systems can be mounted."""
    try:
        tried = in_namespace(MOUNT, tmp_path)
    except FileNotFoundError:
        pytest.skip("there is no unshare")
    if tried.returncode:
        pytest.skip(f"no file system may be mounted: {tried.stderr.strip()}")
    (tmp_path / "s.yaml").write_text(SWEEP)
    return tmp_path


@pytest.mark.parametrize("room", [12_000, 30_000, 200_000])
def test_nothing_is_lost(folder: Path, room: int) -> None:
    """Full at once, at the first shards, and at the file that they become."""
    command = [sys.executable, "-m", "fzcli", "sweep", "s.yaml", "-o", ".", "--jobs", "2", "--format", "csv"]
    done = in_namespace(DISTURBED, folder, SIZE - room, *command)
    assert done.returncode == 0, done.stderr + (folder / "full.txt").read_text()
    said, files = (folder / "full.txt").read_text(), (folder / "full.files").read_text()
    assert "cannot be written: No space left on device" in said
    assert said.endswith("; go on with: fzcli sweep s.yaml -o . --jobs 2 --format csv\n")
    assert "Traceback" not in said
    assert (folder / "full.code").read_text() == "3\n"
    assert ".tmp" not in files
    assert "./s.h5" not in files
    assert (folder / "on.files").read_text() == "s.h5\ns.yaml\n"
    calm = folder / "calm"
    calm.mkdir()
    assert in_namespace(f"cp s.yaml calm; cd calm; exec {' '.join(command)}", folder).returncode == 0
    assert (calm / "s.h5").read_bytes() == (folder / "s.h5").read_bytes()
