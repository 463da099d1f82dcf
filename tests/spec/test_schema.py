"""JSON Schemas: current, and of one mind with the reader about the shipped files."""

import json
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from fzcli.spec.library import schema_text, shipped_root
from fzcli.spec.reader import read
from fzcli.spec.schema import json_schema

KINDS = ("robot", "planar_3rrr", "rulebase")


def outline(schema: Any) -> Any:
    """What a schema allows, without what another version of pydantic may word differently."""
    if isinstance(schema, dict):
        kept = {
            key: outline(item)
            for key, item in schema.items()
            if key not in ("description", "title", "default")
        }
        return {key: sorted(item) if key == "required" else item for key, item in kept.items()}
    return [outline(item) for item in schema] if isinstance(schema, list) else schema


@pytest.mark.parametrize("kind", KINDS)
def test_schema_files_are_current(kind: str) -> None:
    file = shipped_root() / "schemas" / f"{kind}.json"
    written, made = json.loads(file.read_text()), json_schema(kind)  # type: ignore[arg-type]
    assert outline(written) == outline(made), f"write the text of json_schema({kind!r}) to {file}"
    assert json.loads(schema_text(made)) == made


@pytest.mark.parametrize("kind", KINDS)
def test_schemas_take_the_shipped_files_and_refuse_unknown_keys(kind: str) -> None:
    schema = json_schema(kind)  # type: ignore[arg-type]
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(schema)
    folder = "rulebases" if kind == "rulebase" else "robots"
    documents = [read(file) for file in sorted((shipped_root() / folder).glob("*.yaml"))]
    documents = [document for document in documents if document.value["kind"] == kind]
    assert documents
    for document in documents:
        assert document.text.startswith(f"# yaml-language-server: $schema=../schemas/{kind}.json\n")
        assert list(validator.iter_errors(document.value)) == []
        assert not validator.is_valid({**document.value, "mistake": 1})


def test_units_land_in_the_schema() -> None:
    row = json_schema("robot")["$defs"]["RowFile"]["properties"]
    assert row["theta"]["description"] == "[rad] a number, or text with a unit such as '30 deg'"
    assert {item["type"] for item in row["d"]["anyOf"]} == {"number", "string"}
