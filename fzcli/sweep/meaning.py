"""What a sweep means, as plain data: its identity, and all that another process needs to run any part of it.

The meaning is resolved: numbers in SI, robots and rule bases in full, draws with their own numbers. White space,
comments, units, names and tables leave it as it is; so does the order of keys. The engine belongs to it, for the
compiled engine and CasADi's machine agree to 1e-12 a step, not to the last bit.
"""

import json
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from fzcli.errors import RecordError
from fzcli.loop.compiler import find_compiler
from fzcli.loop.run_spec import simulate_model
from fzcli.spec.base import SpecModel
from fzcli.spec.document import document_of
from fzcli.spec.hashing import spec_hash
from fzcli.sweep.resolve import Drawn, Sweep
from fzcli.sweep.sweep_spec import SweepFile

if TYPE_CHECKING:
    from fzcli.sweep.plan_sweep import PlanSweep

AnySweep: TypeAlias = "Sweep | PlanSweep"  # planners load for sweeps of plans alone
SHORT = 8  # digits of an identity in the names of files and folders


@dataclass(frozen=True)
class Meaning:
    """``data``: plain values that JSON holds exactly."""

    data: dict[str, Any]

    @cached_property
    def identity(self) -> str:
        """SHA-256 (hex) of all that results depend on; how configurations are written does not belong to it."""
        runs = [entry["run"] for entry in self.data["configurations"]]
        return spec_hash({**self.data, "configurations": runs})

    @property
    def short(self) -> str:
        """The identity in names of files."""
        return self.identity[:SHORT]

    def to_json(self) -> str:
        """Text that ``from_json`` turns back."""
        return json.dumps({"identity": self.identity, **self.data}, separators=(",", ":"), allow_nan=False)

    @staticmethod
    def from_json(text: str, name: str) -> "Meaning":
        """The meaning in a text read from ``name``. Raises RecordError where it does not fit its own identity."""
        try:
            data = json.loads(text)
            identity = data.pop("identity")
            found = Meaning(data)
            if found.identity == identity:
                return found
        except (ValueError, KeyError, TypeError, AttributeError):
            pass
        raise RecordError(f"{name}: damaged, or not written by fzcli: remove its folder and repeat the sweep")


def meaning_of(sweep: AnySweep) -> Meaning:
    """The meaning of a sweep on this machine, whose engine is compiled where there is a compiler."""
    file = sweep.file
    engine = "vm" if file.run == "plan" or find_compiler() is None else "compiled"
    trajectories = file.trajectories.model_dump(mode="json", by_alias=True, exclude={"draw"})
    keep_if = trajectories.pop("keep_if")
    data = {
        "kind": "sweep",
        "run": file.run,
        "engine": engine,
        "trajectories": trajectories,
        "draws": [_drawn_to_data(one) for one in sweep.draws],
        "scenes": None if file.scenes is None else file.scenes.model_dump(mode="json"),
        "record": None if file.record is None else file.record.model_dump(mode="json"),
        "filter": None,
        "configurations": [
            {"changes": changes, "run": _run_to_data(spec)}
            for changes, spec in zip(sweep.changes, sweep.specs, strict=True)
        ],
    }
    if isinstance(sweep, Sweep) and sweep.filter is not None:
        data["filter"] = {"run": _run_to_data(sweep.filter), "that": keep_if["that"], "most": keep_if["most"]}
    return Meaning(json.loads(json.dumps(data, allow_nan=False)))


def sweep_of(meaning: Meaning) -> AnySweep:
    """The sweep that has this meaning; its document has no places."""
    data = meaning.data
    trajectories = dict(data["trajectories"])
    if data["filter"] is not None:
        trajectories["keep_if"] = {"with": {}, "that": data["filter"]["that"], "most": data["filter"]["most"]}
    own = {"run": data["run"], "trajectories": trajectories, "scenes": data["scenes"], "record": data["record"]}
    file = SweepFile.model_validate(own)
    changes = [entry["changes"] for entry in data["configurations"]]
    runs = [entry["run"] for entry in data["configurations"]]
    draws = tuple(_drawn_from_data(one) for one in data["draws"])
    document = document_of({"kind": "sweep"})
    if data["run"] == "plan":
        from fzcli.plan.plan_spec import PlanRun
        from fzcli.sweep.plan_sweep import PlanSweep

        return PlanSweep(file, document, changes, [PlanRun.model_validate(run) for run in runs], draws)
    model = simulate_model()
    tried = None if data["filter"] is None else model.model_validate(data["filter"]["run"])
    return Sweep(file, document, changes, [model.model_validate(run) for run in runs], draws, tried)


def _run_to_data(spec: SpecModel) -> dict[str, Any]:
    """A run without what is only said of it; an attitude in one form, as a run file gives it."""
    data = spec.model_dump(mode="json", exclude={"about", "compare"})
    if data["start"].get("base_rpy") is not None:
        data["start"].pop("base_quat", None)
    return data


def _drawn_to_data(one: Drawn) -> dict[str, Any]:
    return {
        "path": one.path,
        "distribution": one.distribution,
        "low": one.low.tolist(),
        "high": one.high.tolist(),
        "choices": None if one.choices is None else one.choices.tolist(),
    }


def _drawn_from_data(data: dict[str, Any]) -> Drawn:
    low, high = np.array(data["low"], dtype=float), np.array(data["high"], dtype=float)
    choices = None if data["choices"] is None else np.array(data["choices"], dtype=float)
    return Drawn(data["path"], data["distribution"], low, high, choices)
