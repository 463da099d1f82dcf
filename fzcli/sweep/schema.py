"""JSON Schemas of run files: ``kind: simulate``, and ``kind: sweep`` whose run fields may be partial."""

import json
from typing import Any

from fzcli.loop.run_spec import simulate_model
from fzcli.plan.plan_spec import PlanRun
from fzcli.spec.base import SpecModel
from fzcli.spec.schema import schema_of
from fzcli.sweep.sweep_spec import DISTRIBUTIONS, Draw, SweepFile
from fzcli.sweep.tune_spec import TuneFile

_Schema = dict[str, Any]
_OPEN = ("controller", "reference", "base_reference")  # sections of a simulation that come in kinds


def simulate_schema() -> _Schema:
    """The JSON Schema of a simulation; a section that comes in kinds must say which it is."""
    schema = schema_of(simulate_model(), "fzcli simulation")
    for section in _OPEN:
        for name in _alternatives(schema["properties"][section]):
            model = schema["$defs"][name]
            model["required"] = ["kind", *(key for key in model.get("required", []) if key != "kind")]
    schema["required"] = ["kind", *schema["required"]]
    return schema


def sweep_schema() -> _Schema:
    """The JSON Schema of a sweep: its own fields and those of its runs, simulations or, by ``run: plan``, plans.

    A grid, a draw or random scenes may supply any field of a run.
    """
    own = schema_of(SweepFile, "fzcli sweep")
    definitions = {**own.pop("$defs"), "Draw": _draw()}
    sweeps = {
        "SimulationSweep": _sweep_of(simulate_model(), own, "simulate", definitions),
        "PlanSweep": _sweep_of(PlanRun, own, "plan", definitions),
    }
    return {
        "$schema": own["$schema"],
        "title": own["title"],
        "description": own["description"],
        "$defs": {**definitions, **sweeps},
        "if": {"properties": {"run": {"const": "plan"}}, "required": ["run"]},
        "then": {"$ref": "#/$defs/PlanSweep"},
        "else": {"$ref": "#/$defs/SimulationSweep"},
    }


def _sweep_of(run: type[SpecModel], own: _Schema, word: str, definitions: _Schema) -> _Schema:
    """The fields of a sweep of such runs; what they refer to is added to ``definitions``.

    Sections that come in kinds may lack any field or have those of another kind; the start may lack what is drawn.
    """
    schema = schema_of(run, "")
    found = schema.pop("$defs")
    for part in (schema, *found.values()):
        for name, field in part.get("properties", {}).items():
            if "discriminator" in field:
                part["properties"][name] = _merged([found[one] for one in _alternatives(field)])
    fields = {key: value for key, value in schema["properties"].items() if key not in ("kind", "about", "compare")}
    fields["start"] = {**found[_alternatives(fields["start"])[0]], "required": []}
    found = _needed(fields, found)
    twice = {name for name in found if name in definitions and definitions[name] != found[name]}
    if twice:
        raise ValueError(f"two models of one name: {', '.join(sorted(twice))}")
    definitions.update(found)
    properties = {**own["properties"], "run": {**own["properties"]["run"], "enum": [word]}, **fields}
    if word != "plan":
        del properties["scenes"]
    return {"type": "object", "properties": properties, "required": ["kind"], "additionalProperties": False}


def tune_schema() -> _Schema:
    """The JSON Schema of a tuning: a sweep's fields without its table, and what is varied."""
    sweep, own = sweep_schema(), schema_of(TuneFile, "")
    simulations = sweep["$defs"]["SimulationSweep"]
    ends = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
    scale = {"type": "object", "properties": {"scale": ends}, "required": ["scale"], "additionalProperties": False}
    definitions = {**sweep["$defs"], **own["$defs"], "Vary": {"anyOf": [ends, scale]}}
    fields = {name: value for name, value in simulations["properties"].items() if name not in ("kind", "table")}
    del definitions["PlanSweep"], definitions["SimulationSweep"]
    return {
        "$schema": sweep["$schema"],
        "title": "fzcli tuning",
        "$defs": definitions,
        **simulations,
        "properties": {"kind": {"const": "tune", "type": "string"}, **fields, **own["properties"]},
        "required": ["kind", "tune"],
    }


def _needed(fields: _Schema, definitions: _Schema) -> _Schema:
    """The definitions that fields refer to, themselves or through others."""
    found: _Schema = {}
    texts = [json.dumps(fields)]
    while texts:
        text = texts.pop()
        for name in set(definitions) - set(found):
            if f'"#/$defs/{name}"' in text:
                found[name] = definitions[name]
                texts.append(json.dumps(definitions[name]))
    return dict(sorted(found.items()))


def _alternatives(section: _Schema) -> list[str]:
    """Names of the definitions that a section may be."""
    return [one["$ref"].rsplit("/", 1)[-1] for one in section.get("oneOf", [section])]


def _merged(models: list[_Schema]) -> _Schema:
    """One object with the fields of all models, none of them required."""
    fields: dict[str, list[_Schema]] = {}
    for model in models:
        for name, field in model["properties"].items():
            known = fields.setdefault(name, [])
            if field not in known:
                known.append(field)
    kinds = [field["const"] for field in fields.pop("kind")]
    merged = {name: alike[0] if len(alike) == 1 else {"anyOf": alike} for name, alike in fields.items()}
    return {
        "type": "object",
        "properties": {"kind": {"enum": kinds, "type": "string"}, **merged},
        "additionalProperties": False,
    }


def _draw() -> _Schema:
    """A draw as it is written: one distribution and its numbers."""
    numbers: dict[str, _Schema] = {
        name: {"type": "array", "minItems": count or 1, **({"maxItems": count} if count else {})}
        for name, count in DISTRIBUTIONS.items()
    }
    numbers["sphere"] = {"enum": [2, 3], "description": "dimensions of a direction drawn uniformly"}
    return {
        "type": "object",
        "description": Draw.__doc__,
        "properties": numbers,
        "additionalProperties": False,
        "minProperties": 1,
        "maxProperties": 1,
    }
