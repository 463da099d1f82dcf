"""From a run's numbers to its status: ok, flagged by a bound of the certificate, or failed."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.run_spec import BoundsSpec
from fzcli.loop.stops import FAILURES, STOP_REASONS
from fzcli.spec.quantity import Signal
from fzcli.spec.result import Status

Array = NDArray[np.float64]
# metric of the certificate -> its bound's field; a run is flagged beyond the bound (below it, for the last)
JUDGED = ("arrived", "missed")
BOUNDED = {
    "tip_error_max": "tip_error",
    "linear_momentum_max": "linear_momentum",
    "angular_momentum_max": "angular_momentum",
    "quaternion_norm_error_max": "quaternion_norm_error",
    "joint_speed_excess_max": "joint_excess",
    "joint_limit_excess_max": "joint_excess",
    "singular_value_min": "singular_value",
    "energy_balance_max": "energy_balance",
    "tip_deviation_max": "tip_deviation",
    "yaw_deviation_max": "yaw_deviation",
}
ADVICE = {
    "tip_error_max": "the tip lost its reference: lower the gain, or move the task away from singular postures",
    "joint_speed_excess_max": "slow the reference down",
    "joint_limit_excess_max": "choose another start posture",
    "energy_balance_max": "raise replay.substeps: the integration is too coarse for these torques",
    "tip_deviation_max": "raise the gains of replay.controller and replay.substeps, or lower the run's own gain",
    "yaw_deviation_max": "hold the base by replay.controller.base, or lower the run's own gain",
    "singular_value_min": "raise controller.damping or choose another start posture",
}


def exceeded(name: str, values: Array, bounds: BoundsSpec) -> NDArray[np.bool_] | None:
    """Where a metric breaks its bound; None where it has none."""
    bound = getattr(bounds, BOUNDED[name])
    if bound is None:
        return None
    return np.asarray(values < bound if name == "singular_value_min" else ~(values <= bound), dtype=bool)


@dataclass(frozen=True)
class Outcome:
    """How a run with a target ended, in words."""

    text: str
    advice: str = ""


OUTCOMES = (
    Outcome("arrived"),
    Outcome("the target is out of the arm's reach", "bring target and base nearer to each other"),
    Outcome("no search found a posture that meets the target", "raise controller.restart.seeds, or loosen stop"),
    Outcome("the arm came to rest short of it", "try another start"),
    Outcome("the arm still moved at the end", "give it more time (stop.after)"),
)
OUTCOME = Signal("outcome", "1", "; ".join(f"{code}: {how.text}" for code, how in enumerate(OUTCOMES)))
AT_REST = 1e-3  # rad/s or m/s


def outcomes(metrics: Mapping[str, Array]) -> Array:
    """Of every run with a target, a place in ``OUTCOMES``; NaN of one without."""
    arrived = metrics["arrived"]
    none = np.zeros(arrived.shape)
    searches, empty = metrics.get("searches", none), metrics.get("searches_empty", none)
    codes = np.where(metrics["joint_speed_final"] < AT_REST, 3.0, 4.0)
    codes[(searches > 0) & (empty >= searches)] = 2
    codes[metrics.get("out_of_reach_final", none) > 0] = 1
    codes[arrived > 0] = 0
    codes[np.isnan(arrived)] = np.nan
    return codes


def _left(metrics: Mapping[str, float]) -> str:
    """What is missing to the target."""
    parts = [_length(metrics["target_distance_final"])]
    if "target_angle_final" in metrics:
        parts.append(f"{np.rad2deg(metrics['target_angle_final']):.3g} deg")
    if metrics.get("out_of_reach_final", 0.0) > 0:
        return f"{' and '.join(parts)} short, at least {_length(metrics['out_of_reach_final'])} out of reach"
    return " and ".join(parts) + " short"


def _length(metres: float) -> str:
    return f"{metres:.3g} m" if metres >= 1.0 else f"{1e3 * metres:.3g} mm"


def status_codes(metrics: Mapping[str, Array], stops: NDArray[np.int64], bounds: BoundsSpec) -> NDArray[np.int8]:
    """0 ok, 1 flagged, 2 failed, for every run."""
    codes = np.zeros(len(stops), dtype=np.int8)
    for name in BOUNDED:
        if name in metrics:
            broken = exceeded(name, metrics[name], bounds)
            if broken is not None:
                codes[broken] = 1
    if "arrived" in metrics:
        codes[metrics["arrived"] == 0] = 1
    if "missed" in metrics:
        codes[metrics["missed"] > 0] = 1
    codes[np.isin(stops, FAILURES)] = 2
    return codes


def status_of(metrics: Mapping[str, float], stop: int, bounds: BoundsSpec, end: float) -> Status:
    """The status of one run, with reason and advice; ``end`` is its last time [s]."""
    if stop in FAILURES:
        why = STOP_REASONS[stop]
        return Status("failed", f"{why.name} at {end:g} s: {why.reason}", why.advice)
    if metrics.get("arrived", 1.0) == 0.0:
        outcome = OUTCOMES[int(metrics["outcome"])]
        advice = outcome.advice if "searches" in metrics else outcome.advice or "give controller.restart: true"
        if "searches" not in metrics and metrics["outcome"] > 2:
            advice = "give controller.restart: true"
        return Status("flagged", f"target not reached in {end:g} s, {_left(metrics)}: {outcome.text}", advice)
    if metrics.get("missed", 0.0) > 0.0:
        turn = f" and {np.rad2deg(metrics['miss_angle_final']):.3g} deg" if "miss_angle_final" in metrics else ""
        text = f"the base would turn in truth: the tip misses by {_length(metrics['miss_distance_final'])}{turn}"
        return Status("flagged", text, "use plant: kinematic, whose base follows the angular momentum as well")
    for name, field in BOUNDED.items():
        if name in metrics:
            broken = exceeded(name, np.array([metrics[name]]), bounds)
            if broken is not None and broken[0]:
                reason = f"{name} {metrics[name]:.3g} breaks the bound {getattr(bounds, field):g}"
                return Status("flagged", reason, ADVICE.get(name, "see the certificate"))
    return Status("ok")
