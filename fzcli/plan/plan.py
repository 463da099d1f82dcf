"""What a plan becomes: a path over time with its clearance, and a certificate that says how far to trust it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.joint_path import Detour
from fzcli.spec.quantity import Signal
from fzcli.spec.result import Provenance, Status

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plan:
    """One plan, sampled every 10 ms or less. Time first in every array; world axes unless a name says otherwise.

    Shapes: time (T,) s; q, qd, qdd (T, n) rad or m, and per second; base_position (T, 3) m, origin of the base
    link's frame; base_quat (T, 4) w x y z, body to world; base_twist (T, 6) m/s, rad/s; tip_position (T, 3) m;
    tip_quat (T, 4); straight_tip (T, 3) m, where the tip would be without detours; clearance (T,) m, smallest
    distance of all pairs, infinite without any; ``arms``: of each tip the arm as a line (T, k) m, and the names of
    its points; ``obstacles``: the middle of each (T, 3) m. ``detours``: what was added to the straight joint path.
    ``method``: which planner made it. ``signals``: what only some robots have (T, k).
    """

    time: Array
    q: Array
    qd: Array
    qdd: Array
    base_position: Array
    base_quat: Array
    base_twist: Array
    tip_position: Array
    tip_quat: Array
    straight_tip: Array
    clearance: Array
    arms: Mapping[str, Array]
    arm_names: Mapping[str, tuple[str, ...]]
    obstacles: Mapping[str, Array]
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    detours: tuple[Detour, ...]
    method: str
    metrics: Mapping[str, float]
    metric_info: Mapping[str, Signal]
    certificate: Mapping[str, float]
    status: Status
    provenance: Provenance
    signals: Mapping[str, Array] = field(default_factory=dict)
    signal_info: Mapping[str, Signal] = field(default_factory=dict)
