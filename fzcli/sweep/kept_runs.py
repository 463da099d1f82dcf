"""Which runs of a sweep are kept with their trajectories.

Those that a run's own row decides (every n-th trajectory, failed runs, all) are kept by their shard. The best, median
and worst are known only when all shards are there: they are run again, which gives the same bits.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.run_spec import RecordSpec
from fzcli.spec.result import STATUS_NAMES, Provenance
from fzcli.sweep.layout import Piece
from fzcli.sweep.meaning import AnySweep
from fzcli.sweep.resolve import Sweep

Array = NDArray[np.float64]
FAILED = STATUS_NAMES.index("failed")
UNSAID = Provenance("", "", "")  # of a run that is kept with its sweep: the sweep's own
ENDS = ("best", "median", "worst")


@dataclass(frozen=True)
class Chosen:
    """A run that is kept: its configuration, the place of its trajectory counted from the first, and why."""

    config: int
    place: int
    role: str


def records_of(sweep: AnySweep) -> list[RecordSpec]:
    """What each configuration keeps; plans are ranked by the length of their path unless they say otherwise."""
    if isinstance(sweep, Sweep):
        return [spec.record for spec in sweep.specs]
    given = sweep.file.record or RecordSpec()
    if given.rank_by == RecordSpec().rank_by:
        given = given.model_copy(update={"rank_by": "path_length"})
    return [given] * len(sweep.specs)


def kept_by_shard(record: RecordSpec) -> bool:
    """Whether a shard alone knows which of its runs are kept."""
    return record.keep in ("failures", "full") or record.every is not None


def marked(
    records: Sequence[RecordSpec], first: int, piece: Piece, status: NDArray[np.int8], crashed: frozenset[int]
) -> dict[int, Chosen]:
    """Rows of a shard that it keeps. ``records``: one for each of its configurations."""
    count = len(piece.places)
    found: dict[int, Chosen] = {}
    for i, record in enumerate(records):
        if not kept_by_shard(record):
            continue
        for j, place in enumerate(piece.places):
            row = i * count + j
            role = _role(record, first + place, int(status[row]))
            if role and row not in crashed:
                found[row] = Chosen(piece.configs[i], place, role)
    return found


def _role(record: RecordSpec, trajectory: int, status: int) -> str:
    """Why a run's own row keeps it; empty when it does not."""
    if record.keep == "full":
        return "full"
    if record.keep == "failures" and status == FAILED:
        return "failed"
    return "every" if record.every and trajectory % record.every == 0 else ""


def ranked(record: RecordSpec, values: Array, able: NDArray[np.bool_]) -> Iterator[tuple[int, str]]:
    """Place and role of a configuration's runs that are kept by their rank, each once.

    ``values`` (trajectories): the metric ranked by, smallest first; runs without a number come last, ties by index.
    ``able`` (trajectories): which can be run again.
    """
    if record.keep == "metrics" or kept_by_shard(record):
        return
    order = np.argsort(np.nan_to_num(values, nan=np.inf), kind="stable")
    order = order[able[order]]
    if record.best:
        yield from ((int(place), "best") for place in order[: record.best])
        return
    chosen: dict[int, str] = {}
    for role, rank in zip(ENDS, (0, (len(order) - 1) // 2, len(order) - 1), strict=True):
        if len(order):
            chosen.setdefault(int(order[rank]), role)
    yield from chosen.items()


def told(record: RecordSpec) -> str:
    """What is kept, in words."""
    if record.best:
        return f"metrics, and the best {record.best} runs of each configuration by {record.rank_by}"
    if record.every:
        return f"metrics, and every {record.every}th trajectory whole"
    return {
        "metrics": "metrics alone",
        "failures": "metrics, and failed runs whole",
        "full": "metrics, and every run whole",
        "ends": f"metrics, and the best, median and worst run of each configuration by {record.rank_by}",
    }[record.keep]
