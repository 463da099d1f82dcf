"""How long a sweep takes and how large it becomes, measured on its first runs."""

import time
from dataclasses import dataclass, replace
from pathlib import Path

from fzcli.record.shard_file import shard_bytes
from fzcli.sweep.execute import checked_worker, precision_of
from fzcli.sweep.folder import Folder
from fzcli.sweep.gather import drawn_rows
from fzcli.sweep.kept_runs import UNSAID, Chosen, kept_by_shard, records_of, told
from fzcli.sweep.layout import Layout, Piece, layout_of
from fzcli.sweep.meaning import AnySweep, meaning_of
from fzcli.sweep.output import finished, folder_beside
from fzcli.sweep.resolve import Sweep
from fzcli.sweep.work import Worker


@dataclass(frozen=True)
class Estimate:
    """Counts; seconds of one core; bytes of all shards, and of the file in the end at most."""

    runs: int
    shards: int
    runs_a_shard: int
    done: int
    runs_left: int
    seconds_a_run: float
    shard_bytes: float
    file_bytes: float
    kept: str
    finished: Path | None


def estimate(sweep: AnySweep, path: Path) -> Estimate:
    """Run the first shard of a sweep (of plans, its first trajectory) and keep nothing. Raises as the sweep would."""
    meaning, layout = meaning_of(sweep), layout_of(sweep)
    kept = "; ".join(dict.fromkeys(told(record) for record in records_of(sweep)))
    size = layout.piece(0).runs
    there = finished(path, meaning)
    if there is not None:
        return Estimate(layout.runs, layout.shards, size, layout.shards, 0, 0.0, 0.0, 0.0, kept, there)
    place = folder_beside(path, meaning)
    folder = Folder(place, meaning, precision_of(sweep))
    done = folder.present() if place.is_dir() else 0
    seconds, bytes_a_run, kept_bytes = _measured(sweep, checked_worker(sweep), layout)
    left = layout.runs - min(done * size, layout.runs)
    whole = bytes_a_run * layout.runs
    return Estimate(
        layout.runs, layout.shards, size, done, left, seconds, whole, whole + kept_bytes, kept, None
    )


def _measured(sweep: AnySweep, worker: Worker, layout: Layout) -> tuple[float, float, float]:
    """Seconds and bytes of a run, and bytes of the runs that are kept in the end."""
    piece = layout.piece(0)
    if not isinstance(sweep, Sweep):
        piece = replace(piece, places=range(1))
    worker.compile(1)
    begin = time.perf_counter()
    shard = worker.shard(piece)
    seconds = (time.perf_counter() - begin) / piece.runs
    size = shard_bytes(shard, precision_of(sweep), UNSAID) / piece.runs
    return seconds, size, _kept_bytes(sweep, worker, layout, piece)


def _kept_bytes(sweep: AnySweep, worker: Worker, layout: Layout, piece: Piece) -> float:
    records = records_of(sweep)
    ranked = [record for record in records if record.keep != "metrics" and not kept_by_shard(record)]
    if not ranked or not isinstance(sweep, Sweep):
        return 0.0
    shard = worker.shard(replace(piece, places=range(1), configs=piece.configs[:1]))
    drawn = drawn_rows(sweep, shard.draws, [0])
    with_it = replace(shard, kept=worker.recorded([Chosen(0, 0, "best")], drawn))
    one = shard_bytes(with_it, precision_of(sweep), UNSAID) - shard_bytes(shard, precision_of(sweep))
    return float(one * sum(min(record.best or 3, layout.count) for record in ranked))
