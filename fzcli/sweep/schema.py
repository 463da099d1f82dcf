"""JSON Schemas of run files: ``kind: simulate``, and ``kind: sweep`` whose run fields may be partial."""

from typing import Any

from fzcli.loop.run_spec import simulate_model
from fzcli.spec.schema import schema_of
from fzcli.sweep.sweep_spec import DISTRIBUTIONS, SweepFile
from fzcli.sweep.tune_spec import TuneFile

_Schema = dict[str, Any]
_OPEN = ("controller", "reference", "base_reference")  # sections that come in kinds


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
    """The JSON Schema of a sweep: its own fields and a run's, of which a grid or a draw may supply any."""
    own, run = schema_of(SweepFile, "fzcli sweep"), schema_of(simulate_model(), "")
    definitions = {**run["$defs"], **own["$defs"], "Draw": _draw(own["$defs"]["Draw"])}
    fields = {
        key: value for key, value in run["properties"].items() if key not in ("kind", "about", "compare")
    }
    for section in _OPEN:
        names = _alternatives(fields[section])
        fields[section] = _merged([definitions.pop(name) for name in names])
    fields["start"] = {**definitions.pop("StartSpec"), "required": []}
    properties = {**own["properties"], **fields}
    return {**own, "$defs": definitions, "properties": properties, "required": ["kind"]}


def tune_schema() -> _Schema:
    """The JSON Schema of a tuning: a sweep's fields without its table, and what is varied."""
    sweep, own = sweep_schema(), schema_of(TuneFile, "")
    ends = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
    scale = {"type": "object", "properties": {"scale": ends}, "required": ["scale"], "additionalProperties": False}
    definitions = {**sweep["$defs"], **own["$defs"], "Vary": {"anyOf": [ends, scale]}}
    properties = {name: value for name, value in sweep["properties"].items() if name not in ("kind", "table")}
    kind = {"const": "tune", "type": "string"}
    return {
        **sweep,
        "title": "fzcli tuning",
        "$defs": definitions,
        "properties": {"kind": kind, **properties, **own["properties"]},
        "required": ["kind", "tune"],
    }


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


def _draw(model: _Schema) -> _Schema:
    """A draw as it is written: one distribution and its numbers."""
    numbers: dict[str, _Schema] = {
        name: {"type": "array", "minItems": count or 1, **({"maxItems": count} if count else {})}
        for name, count in DISTRIBUTIONS.items()
    }
    numbers["sphere"] = {"enum": [2, 3], "description": "dimensions of a direction drawn uniformly"}
    return {
        "type": "object",
        "description": model["description"],
        "properties": numbers,
        "additionalProperties": False,
        "minProperties": 1,
        "maxProperties": 1,
    }
