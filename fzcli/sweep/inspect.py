"""How far a sweep is, and whether what there is of it is whole; nothing is changed."""

from dataclasses import dataclass
from pathlib import Path

from fzcli.errors import RecordError
from fzcli.record.sweep_file import verify_sweep
from fzcli.sweep.execute import precision_of
from fzcli.sweep.folder import Folder
from fzcli.sweep.meaning import AnySweep, meaning_of
from fzcli.sweep.output import finished, folder_beside


@dataclass(frozen=True)
class State:
    """Of a sweep: ``finished`` its file, ``folder`` of its shards, ``holders`` who work on it, ``others`` beside it."""

    identity: str
    word: str
    finished: Path | None
    folder: Path | None
    shards: int
    done: int
    runs: int
    runs_done: int
    holders: list[str]
    others: list[Path]


@dataclass(frozen=True)
class Check:
    """What is wrong with a sweep's files: damages in words, how many shards are missing, and all in a line."""

    damaged: list[str]
    missing: int
    text: str


def state_of(sweep: AnySweep, path: Path) -> State:
    """How far a sweep is whose file is, or will be, ``path``."""
    folder = _folder(sweep, path)
    layout, there = folder.layout, finished(path, folder.meaning)
    under_way = folder.path.is_dir()
    done = [i for i in range(layout.shards) if folder.shard(i).exists()] if under_way and there is None else []
    whole = there is not None
    patterns = (f"{path.stem}-????????{path.suffix}", f"{path.stem}-????????.shards", path.name)
    found = [one for pattern in patterns for one in sorted(path.parent.glob(pattern))]
    return State(
        identity=folder.meaning.identity,
        word="under way" if under_way else "not begun",
        finished=there,
        folder=folder.path if under_way else None,
        shards=layout.shards,
        done=layout.shards if whole else len(done),
        runs=layout.runs,
        runs_done=layout.runs if whole else sum(layout.piece(i).runs for i in done),
        holders=folder.holders() if under_way else [],
        others=[one for one in found if one not in (there, folder.path)],
    )


def checked(sweep: AnySweep, path: Path) -> Check:
    """Read all there is of a sweep whose file is, or will be, ``path``."""
    folder = _folder(sweep, path)
    there = finished(path, folder.meaning)
    if there is not None:
        try:
            count = verify_sweep(there)
        except RecordError as error:
            return Check([str(error)], 0, f"{there}: damaged: remove it and repeat the sweep")
        return Check([], 0, f"{there}: finished and whole, {count} runs")
    if not folder.path.is_dir():
        return Check([], folder.layout.shards, f"{path}: not begun")
    faults = [folder.fault(index) for index in range(folder.layout.shards)]
    damaged = [fault for fault in faults if fault]
    missing = sum(fault == "" for fault in faults)
    whole = len(faults) - missing - len(damaged)
    return Check(damaged, missing, f"{folder.path}: {whole} of {len(faults)} shards are there and whole")


def _folder(sweep: AnySweep, path: Path) -> Folder:
    meaning = meaning_of(sweep)
    return Folder(folder_beside(path, meaning), meaning, precision_of(sweep))
