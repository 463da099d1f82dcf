"""Runs and ways to call the command line that the tests of this folder share."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from typer.testing import Result

ROOT = Path(__file__).parents[2]
RUN = """\
kind: simulate
robot: bulgarelli4
start: {q: [0.928, -1.393, 0.303, 0.549]}
reference: {kind: line, direction: [1, 1, 0], length: 0.1, duration: 1 s}
controller: {kind: clik, gain: 10}
"""
SWEEP = """\
kind: sweep
robot: bulgarelli4
reference: {kind: line, length: 0.1, duration: 1 s}
controller: {kind: clik}
trajectories:
  count: 4
  seed: 1
  draw:
    start.q: {uniform: [[0.9, -1.4, 0.3, 0.5], [1.0, -1.3, 0.4, 0.6]]}
    reference.direction: {sphere: 3}
grid: {controller.gain: [10, 100]}
table: {rows: controller.gain, show: [tip_error_mean]}
"""
Invoke = Callable[..., Result]


def shell(*words: object, cwd: Path, code: int = 0, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs the command line as a process of its own."""
    command = [sys.executable, "-m", "fzcli", *(str(word) for word in words)]
    settings = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, env=settings, timeout=300)
    assert done.returncode == code, done.stderr
    return done
