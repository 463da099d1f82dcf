"""From the shards of a finished sweep to its record, a column at a time: memory does not grow with the runs."""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError, UnfinishedError
from fzcli.loop.versions import versions
from fzcli.record.kept_in_files import KeptInShards
from fzcli.record.scratch import Columns, Scratch
from fzcli.record.shard_file import Shard, read_shard
from fzcli.record.sweep_record import KeptRun, SweepRecord
from fzcli.spec.quantity import Signal
from fzcli.spec.reader import dump
from fzcli.spec.result import Provenance
from fzcli.spec.units import unit_at
from fzcli.sweep.folder import Folder
from fzcli.sweep.kept_runs import UNSAID, Chosen, ranked, records_of
from fzcli.sweep.meaning import AnySweep
from fzcli.sweep.resolve import Sweep
from fzcli.sweep.work import Worker

Array = NDArray[np.float64]
Tell = Callable[[str, int, int], None]
AT_ONCE = 64  # kept runs that are run again together
_AFTER = ("outcome", "crashed")  # columns that stand last


@contextlib.contextmanager
def gathered(folder: Folder, worker: Worker, tell: Tell, argv: Sequence[str] = ()) -> Iterator[SweepRecord]:
    """The record of a sweep whose shards are all there; its columns are read while the context lasts.

    Raises UnfinishedError when a shard is missing or damaged.
    """
    layout, sweep = folder.layout, folder.sweep
    with Scratch(folder.path) as runs, Scratch(folder.path) as draws:
        info: dict[str, Signal] = {}
        certificate: dict[str, None] = {}
        candidates = 0
        kept = []
        for index in range(layout.shards):
            shard = _shard(folder, index)
            _put(folder, shard, runs, draws)
            info.update({name: one for name, one in shard.info.items() if name not in info})
            certificate.update(dict.fromkeys(shard.certificate_names))
            candidates += int(shard.candidates.sum()) if index % layout.across == 0 else 0
            if shard.kept_count:
                kept.append((folder.shard(index), shard.kept_count))
            tell("recording", index + 1, layout.shards)
        origin = provenance_of(folder, argv)
        columns = _columns(folder, runs)
        filtered = sweep.file.trajectories.keep_if is not None
        yield SweepRecord(
            configs=sweep.changes,
            metrics=columns,
            metric_info={**info, **_field_info(sweep, draws.names)},
            certificate_names=tuple(certificate),
            draws=Columns({path: partial(draws.column, path) for path in draws.names}),
            draw_info={"candidates": candidates, "accepted": layout.count} if filtered else {},
            kept=KeptInShards.of(kept, origin) if kept else _again(folder, worker, columns, draws, origin),
            provenance=origin,
        )


def provenance_of(folder: Folder, argv: Sequence[str] = ()) -> Provenance:
    """Where the whole comes from."""
    data = folder.meaning.data
    seed = folder.sweep.file.trajectories.seed
    return Provenance(dump(data), folder.meaning.identity, data["engine"], seed, versions(), tuple(argv))


def _shard(folder: Folder, index: int) -> Shard:
    try:
        return read_shard(folder.shard(index), folder.meaning.identity, index)
    except RecordError as error:
        raise UnfinishedError(f"{error}; repeat the sweep") from None


def _put(folder: Folder, shard: Shard, runs: Scratch, draws: Scratch) -> None:
    """Rows of a shard to their places in the whole."""
    layout, piece = folder.layout, folder.layout.piece(shard.index)
    count = len(piece.places)
    columns: dict[str, NDArray[Any]] = {**shard.columns, "status": shard.status}
    for name, values in columns.items():
        for i, config in enumerate(piece.configs):
            first = config * layout.count + piece.places.start
            runs.put(name, layout.runs, first, values[i * count : (i + 1) * count])
    for path, values in shard.draws.items():
        draws.put(path, layout.count, piece.places.start, values)


def _columns(folder: Folder, runs: Scratch) -> Columns:
    """Metrics in their order, with the columns that number the runs."""
    layout, first = folder.layout, folder.sweep.file.trajectories.first
    makers: dict[str, Any] = {name: partial(runs.column, name) for name in runs.names}
    status = makers.pop("status")
    last = {name: makers.pop(name) for name in _AFTER if name in makers}
    if "crashed" in last:  # only the shards that know of some say so
        last["crashed"] = lambda: np.nan_to_num(runs.column("crashed"))
    makers["config"] = lambda: np.repeat(np.arange(layout.configs), layout.count)
    makers["trajectory"] = lambda: np.tile(np.arange(layout.count) + first, layout.configs)
    makers["status"] = lambda: status().astype(np.int8)
    return Columns({**makers, **last})


def _again(folder: Folder, worker: Worker, columns: Columns, draws: Scratch, origin: Provenance) -> tuple[KeptRun, ...]:
    """The runs that are kept by their rank, run again."""
    chosen = list(_by_rank(folder, columns))
    if not chosen:
        return ()
    tables = {one.path: draws.column(one.path) for one in folder.sweep.draws}
    kept: list[KeptRun] = []
    for start in range(0, len(chosen), AT_ONCE):
        part = chosen[start : start + AT_ONCE]
        kept += worker.recorded(part, drawn_rows(folder.sweep, tables, [one.place for one in part]))
    return tuple(
        replace(run, rollout=replace(run.rollout, provenance=origin)) if run.rollout.provenance == UNSAID else run
        for run in kept
    )


def drawn_rows(sweep: AnySweep, tables: Mapping[str, Array], rows: Sequence[int]) -> Array:
    """What was drawn for these rows of the tables by path, side by side: (rows, k)."""
    parts = [tables[one.path][list(rows)] for one in sweep.draws]
    return np.concatenate(parts, axis=1) if parts else np.zeros((len(rows), 0))


def _by_rank(folder: Folder, columns: Columns) -> Iterator[Chosen]:
    count = folder.layout.count
    crashed = columns.get("crashed")
    claimed = None if isinstance(folder.sweep, Sweep) else columns["claimed"]
    ranks: dict[str, Array] = {}
    for config, record in enumerate(records_of(folder.sweep)):
        if record.keep == "metrics":
            continue
        if record.rank_by not in ranks:
            ranks = {record.rank_by: columns[record.rank_by]} if record.rank_by in columns else {}
        part = slice(config * count, (config + 1) * count)
        values = ranks[record.rank_by][part] if ranks else np.zeros(count)
        able = np.ones(count, dtype=bool) if crashed is None else crashed[part] == 0
        able &= True if claimed is None else claimed[part] == 1
        for place, role in ranked(record, values, able):
            yield Chosen(config, place, role)


def _field_info(sweep: AnySweep, drawn: Sequence[str]) -> dict[str, Signal]:
    """Units of the fields that differ between runs, by dotted path."""
    found = {}
    for path in sorted({path for changes in sweep.changes for path in changes} | set(drawn)):
        spec = next((spec for spec in sweep.specs if spec.has(path)), None)
        if spec is not None:
            found[path] = Signal(path, unit_at(spec, path), f"{path} of the run")
    return found
