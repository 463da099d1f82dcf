"""What a run becomes: arrays over time, a status, and a certificate that says how far to trust them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fzcli.spec.quantity import Signal
from fzcli.spec.result import Provenance, Status

Array = NDArray[np.float64]
@dataclass(frozen=True)
class Rollout:
    """One run. Time first in every array; world frame unless a name says otherwise.

    Shapes: time (T,) s; q, qd (T, n) rad or m, and per second; base_position (T, 3) m, origin of
    the base link's frame; base_quat (T, 4) w x y z, body to world; base_twist (T, 6) m/s, rad/s;
    tip_position (T, 3) m; tip_quat (T, 4); signals[name] (T,) or (T, k).
    ``variants``: the runs that this one is compared with, by name.
    ``certificate`` and ``metrics`` map a name to one number (NaN where it does not apply);
    ``signal_info`` describes the signals, ``metric_info`` both maps of numbers; ``joint_units``
    is "rad" or "m" a joint, empty when every joint is in rad.
    """

    time: Array
    q: Array
    qd: Array
    base_position: Array
    base_quat: Array
    base_twist: Array
    tip_position: Array
    tip_quat: Array
    signals: Mapping[str, Array]
    signal_info: Mapping[str, Signal]
    joint_names: tuple[str, ...]
    metrics: Mapping[str, float]
    metric_info: Mapping[str, Signal]
    certificate: Mapping[str, float]
    status: Status
    provenance: Provenance
    joint_units: tuple[str, ...] = ()
    variants: Mapping[str, "Rollout"] = field(default_factory=dict)
