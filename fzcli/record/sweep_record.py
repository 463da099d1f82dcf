"""What a sweep becomes: one row of metrics a run, and the few runs kept whole."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.rollout import Rollout
from fzcli.spec.quantity import Signal
from fzcli.spec.result import Provenance


@dataclass(frozen=True)
class KeptRun:
    """A run of the sweep kept with its trajectories; ``role`` is best, median or worst."""

    config: int
    trajectory: int
    role: str
    rollout: Rollout


@dataclass(frozen=True)
class SweepRecord:
    """Results of a sweep.

    ``configs``: one dict a configuration, dotted spec path -> value. ``metrics``: name -> (runs,)
    float64, and the integer columns "config", "trajectory", "status" (0 ok, 1 flagged, 2 failed).
    The columns of the certificate (worst residuals) are metrics like the others; their names are
    in ``certificate_names``. ``draws``: dotted path -> (trajectories, k), what was drawn.
    Mappings and ``kept`` may read what is asked for from a file.
    ``draw_info``: "candidates" and "accepted" counts of a filtered draw (empty without a filter).
    """

    configs: list[dict[str, Any]]
    metrics: Mapping[str, NDArray[Any]]
    metric_info: Mapping[str, Signal]
    certificate_names: tuple[str, ...]
    draws: Mapping[str, NDArray[np.float64]]
    draw_info: Mapping[str, int]
    kept: Sequence[KeptRun]
    provenance: Provenance
