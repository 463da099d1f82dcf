"""Runs with some of their numbers changed, by dotted path: fields, entries of lists, or whole sections by a factor."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from fzcli.errors import SpecError
from fzcli.loop.run_spec import SimulateRun, simulate_model

if TYPE_CHECKING:
    from fzcli.sweep.tune_spec import Vary

DIGITS = 4  # of a varied number: more are not found out by a few hundred runs


def numbers_at(data: Any, path: str) -> int:
    """How many numbers stand at a path of plain data; 0 where there is nothing."""
    try:
        return _count(_walk(data, path.split(".")))
    except (KeyError, IndexError, ValueError, TypeError):
        return 0


def changed(spec: SimulateRun, vary: "Mapping[str, Vary]", values: Sequence[float]) -> SimulateRun | None:
    """The run with these values at the varied fields; None where that makes no sense as a run."""
    data = spec.model_dump(mode="json")
    if data["start"].get("base_rpy") is not None:
        data["start"].pop("base_quat", None)
    for (path, how), value in zip(vary.items(), values, strict=True):
        steps = path.split(".")
        section = _walk(data, steps[:-1])
        key = int(steps[-1]) if isinstance(section, list) else steps[-1]
        section[key] = _scaled(section[key], value) if how.scale else _like(section[key], value)
    try:
        return simulate_model().model_validate(data)
    except (ValidationError, SpecError):
        return None


def rounded(value: float) -> float:
    """To ``DIGITS`` digits."""
    return float(f"{value:.{DIGITS}g}")


def _walk(data: Any, steps: Sequence[str]) -> Any:
    for step in steps:
        data = data[int(step)] if isinstance(data, list) else data[step]
    return data


def _count(value: Any) -> int:
    if isinstance(value, dict):
        return sum(map(_count, value.values()))
    if isinstance(value, list):
        return sum(map(_count, value))
    return int(isinstance(value, int | float) and not isinstance(value, bool))


def _scaled(value: Any, factor: float) -> Any:
    """Numbers with a point times the factor; counts, words and switches as they are."""
    if isinstance(value, dict):
        return {key: _scaled(item, factor) for key, item in value.items()}
    if isinstance(value, list):
        return [_scaled(item, factor) for item in value]
    return rounded(value * factor) if isinstance(value, float) else value


def _like(old: Any, value: float) -> Any:
    return round(value) if isinstance(old, int) and not isinstance(old, bool) else value
