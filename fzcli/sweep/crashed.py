"""The column of a shard that marks runs which ended their process."""

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.spec.quantity import Signal

CRASHED = Signal("crashed", "1", "the run ended its process; it has no numbers", truth=True)


def note_crashed(
    columns: dict[str, NDArray[Any]], info: dict[str, Signal], runs: int, rows: Collection[int]
) -> None:
    """Mark these of a shard's rows; a shard without any has no such column."""
    if rows:
        info["crashed"], columns["crashed"] = CRASHED, np.zeros(runs)
        columns["crashed"][list(rows)] = 1.0
