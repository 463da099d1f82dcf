"""What a sweep would take: runs, shards, time measured on one of them, room on the disk, and what is kept."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fzcli.sweep.estimate import Estimate
    from fzcli.sweep.execute import Means
    from fzcli.sweep.meaning import AnySweep


def dry_run(sweep: "AnySweep", path: Path, means: "Means") -> str:
    """The facts, a line each."""
    from fzcli.sweep.estimate import estimate

    found = estimate(sweep, path)
    return "".join(f"{name:<15} {value}\n" for name, value in _facts(sweep, path, means, found))


def _facts(sweep: "AnySweep", path: Path, means: "Means", found: "Estimate") -> Iterator[tuple[str, object]]:
    trajectories, jobs = sweep.file.trajectories, means.jobs or os.cpu_count() or 1
    yield "configurations", len(sweep.specs)
    yield "trajectories", trajectories.count
    yield "runs", found.runs
    yield "shards", f"{found.shards} of up to {found.runs_a_shard} runs, {found.done} done"
    yield "filter", " and ".join(trajectories.keep_if.that) if trajectories.keep_if else "none"
    yield "kept", found.kept
    if found.finished is not None:
        yield "time", f"none: finished, in {found.finished}"
    else:
        left = _time(found.seconds_a_run * found.runs_left / jobs)
        yield "time", f"about {left} with {jobs} jobs ({1e3 * found.seconds_a_run:.3g} ms a run, measured on one shard)"
        yield "disk", f"{_size(found.shard_bytes)} in shards on the way, about {_size(found.file_bytes)} in the end"
    yield "output", path


def _time(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.2g} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def _size(count: float) -> str:
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.2g} MB"
