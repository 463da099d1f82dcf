"""JSON Schemas of the files, for editors that complete and check while one types."""

from typing import Any, Literal

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema

from fzcli.spec.planar import Planar3RRR
from fzcli.spec.robot_file import DhRobotFile, RobotFile, UrdfRobotFile
from fzcli.spec.rulebase_file import RulebaseFile

_DIALECT = GenerateJsonSchema.schema_dialect


def schema_of(model: Any, title: str) -> dict[str, Any]:
    """The JSON Schema (2020-12) of what a model, or a union of models, takes."""
    schema = TypeAdapter(model).json_schema(by_alias=True, mode="validation")
    schema.pop("title", None)
    return {"$schema": _DIALECT, "title": title, **schema}


def json_schema(kind: Literal["robot", "planar_3rrr", "rulebase"]) -> dict[str, Any]:
    """The JSON Schema of files of robots (of either kind) or rule bases."""
    if kind == "robot":
        return schema_of(RobotFile | DhRobotFile | UrdfRobotFile, "fzcli robot")
    if kind == "planar_3rrr":
        return schema_of(Planar3RRR, "fzcli planar 3-RRR")
    return schema_of(RulebaseFile, "fzcli rule base")
