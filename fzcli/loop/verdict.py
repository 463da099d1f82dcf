"""From a run's numbers to its status: ok, flagged by a bound of the certificate, or failed."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.rollout import Status
from fzcli.loop.run_spec import BoundsSpec
from fzcli.loop.stops import STOP_REASONS

Array = NDArray[np.float64]
# metric of the certificate -> its bound's field; a run is flagged beyond the bound (below it, for the last)
BOUNDED = {
    "tip_error_max": "tip_error",
    "linear_momentum_max": "linear_momentum",
    "angular_momentum_max": "angular_momentum",
    "quaternion_norm_error_max": "quaternion_norm_error",
    "joint_speed_excess_max": "joint_excess",
    "joint_limit_excess_max": "joint_excess",
    "singular_value_min": "singular_value",
}
ADVICE = {
    "tip_error_max": "the tip lost its reference: lower the gain, or move the task away from singular postures",
    "joint_speed_excess_max": "slow the reference down",
    "joint_limit_excess_max": "choose another start posture",
    "singular_value_min": "raise controller.damping or choose another start posture",
}


def exceeded(name: str, values: Array, bounds: BoundsSpec) -> NDArray[np.bool_] | None:
    """Where a metric breaks its bound; None where it has none."""
    bound = getattr(bounds, BOUNDED[name])
    if bound is None:
        return None
    return np.asarray(values < bound if name == "singular_value_min" else ~(values <= bound), dtype=bool)


def status_codes(metrics: Mapping[str, Array], stops: NDArray[np.int64], bounds: BoundsSpec) -> NDArray[np.int8]:
    """0 ok, 1 flagged, 2 failed, for every run."""
    codes = np.zeros(len(stops), dtype=np.int8)
    for name in BOUNDED:
        if name in metrics:
            broken = exceeded(name, metrics[name], bounds)
            if broken is not None:
                codes[broken] = 1
    codes[stops != 0] = 2
    return codes


def status_of(metrics: Mapping[str, float], stop: int, bounds: BoundsSpec, end: float) -> Status:
    """The status of one run, with reason and advice; ``end`` is its last time [s]."""
    if stop:
        why = STOP_REASONS[stop]
        return Status("failed", f"{why.name} at {end:g} s: {why.reason}", why.advice)
    for name, field in BOUNDED.items():
        if name in metrics:
            broken = exceeded(name, np.array([metrics[name]]), bounds)
            if broken is not None and broken[0]:
                reason = f"{name} {metrics[name]:.3g} breaks the bound {getattr(bounds, field):g}"
                return Status("flagged", reason, ADVICE.get(name, "see the certificate"))
    return Status("ok")
