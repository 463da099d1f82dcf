"""A plan that was followed, as a result file: that of a plan, with what happened on the way."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.execution import Event, Execution
from fzcli.loop.rollout import Rollout
from fzcli.plan.braked_path import BrakedPath
from fzcli.record.plan_file import as_rollout as plan_as_rollout
from fzcli.spec.quantity import Signal

Array = NDArray[np.float64]
SIGNALS = (
    Signal("path_rate", "1", "speed along the path: 1 as planned, 0 at rest, below 0 on the way back"),
    Signal("replans", "1", "detours put in so far"),
    Signal("replan_time", "s", "time that the answer at this step took, measured: differs from run to run"),
)
METRICS = (
    Signal("step_time", "s", "of the path, and the time there is for an answer"),
    Signal("sights", "1", "times that something new was seen and answered"),
    Signal("replans", "1", "detours put in on the way"),
    Signal("stopped", "1", "whether the arm stopped on the path", truth=True),
    Signal("replan_evaluations_max", "1", "most evaluations of the clearance that one answer took"),
    Signal("replan_time_max", "s", "longest time that an answer took, measured: differs from run to run"),
)


def as_rollout(execution: Execution) -> Rollout:
    """The run that it was."""
    run, events, path = plan_as_rollout(execution.plan), execution.events, execution.path
    detours = [event.time for event in events if event.answer.kind == "detour"]
    signals = {
        "path_rate": path.progress(run.time)[1] if isinstance(path, BrakedPath) else np.ones(len(run.time)),
        "replans": np.searchsorted(detours, run.time, side="right").astype(float),
        "replan_time": _measured(run.time, events),
    }
    metrics = {
        "step_time": execution.step,
        "sights": float(len(events)),
        "replans": float(len(detours)),
        "stopped": float(isinstance(path, BrakedPath)),
        "replan_evaluations_max": float(max((event.answer.evaluations for event in events), default=0)),
        "replan_time_max": max((event.seconds for event in events), default=0.0),
    }
    return replace(
        run,
        signals={**run.signals, **signals},
        signal_info={**run.signal_info, **{signal.name: signal for signal in SIGNALS}},
        metrics={**run.metrics, **metrics},
        metric_info={**run.metric_info, **{signal.name: signal for signal in METRICS}},
    )


def _measured(time: Array, events: Sequence[Event]) -> Array:
    """Seconds at the first sample of every event, 0 at all others."""
    seconds = np.zeros(len(time))
    for event in events:
        seconds[min(int(np.searchsorted(time, event.time - 1e-9)), len(time) - 1)] = event.seconds
    return seconds
