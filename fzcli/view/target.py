"""What a run's record says about its target: signals by name, tolerances, drives after a restart, the outcome."""

from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import FzcliError, RecordError
from fzcli.loop.rollout import Rollout
from fzcli.spec.reader import read_text

Array = NDArray[np.float64]


def has_target(run: Rollout) -> bool:
    """Whether the run was to bring its tip to a target."""
    return "target_distance" in run.signals


def signal(run: Rollout, name: str, figure: str) -> Array:
    """A signal (T,) or (T, k) that a figure cannot do without.

    Raises:
        RecordError: the run has no such signal.
    """
    if name not in run.signals:
        found = ", ".join(run.signals) or "none"
        raise RecordError(f"has no signal {name!r}, which {figure!r} is drawn from; its signals: {found}")
    return np.asarray(run.signals[name], dtype=np.float64)


def specification(run: Rollout) -> dict[str, Any]:
    """The run's own specification; empty where it has none, or cannot be read."""
    try:
        value = read_text(run.provenance.spec_text).value
    except FzcliError:
        return {}
    return value if isinstance(value, dict) else {}


def spec_section(run: Rollout, name: str) -> dict[str, Any]:
    """A section of the run's own specification; empty where it has none."""
    section = specification(run).get(name)
    return dict(section) if isinstance(section, dict) else {}


def tolerance(run: Rollout, *names: str) -> float | None:
    """The first of the run's stop tolerances "position" [m], "direction" or "orientation" [rad] that it has."""
    stop = spec_section(run, "stop")
    found = (stop.get(name) for name in names)
    return next((float(value) for value in found if isinstance(value, int | float) and value > 0), None)


def drives(run: Rollout) -> list[tuple[float, float]]:
    """The intervals (start, end) [s] in which the arm drives to a posture that a restart search has found."""
    if "driving" not in run.signals:
        return []
    marks = np.concatenate([[False], np.asarray(run.signals["driving"]) > 0.5, [False]])
    edges = np.minimum(np.flatnonzero(marks[1:] != marks[:-1]), len(run.time) - 1)
    return [(float(start), float(end)) for start, end in run.time[edges].reshape(-1, 2)]


def outcome(run: Rollout) -> str:
    """How the run ended, in a few words: arrival and restarts where it had a target, otherwise its status."""
    if "arrived" not in run.metrics:
        return run.status.name
    verb = "arrived after" if run.metrics["arrived"] > 0.5 else "not arrived in"
    count = run.metrics.get("restarts", 0.0)
    restarts = f", {count:.0f} restart{'s' if count > 1 else ''}" if count > 0 else ""
    return f"{verb} {run.time[-1]:.4g} s{restarts}"


def headline(run: Rollout, title: str) -> str:
    """A figure's title: what is drawn, and below it how the run ended or, if it is not ok, what is wrong."""
    status = run.status
    if status.name == "ok":
        ending = outcome(run)
    else:
        ending = f"{status.name}: {status.reason}" if status.reason else status.name
    return "\n".join([*([title] if title else []), *wrap(ending, 60)])
