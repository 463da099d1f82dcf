"""``fzcli schema``: JSON Schemas of the files."""

from typing import Annotated, Any

import typer

from fzcli.cli.guard import emit, guarded
from fzcli.cli.options import Kind


@guarded
def schema(
    kind: Annotated[
        Kind | None,
        typer.Argument(
            metavar="KIND",
            help="robot, planar_3rrr, rulebase, simulate, sweep, plan, train or tune; all in one object by default.",
        ),
    ] = None,
) -> None:
    """Print the JSON Schema of a kind of file.

    Editors complete and check with it.
    """
    from fzcli.spec.library import schema_text

    schemas = all_schemas()
    emit(schema_text(schemas if kind is None else schemas[kind.value]))


def all_schemas() -> dict[str, dict[str, Any]]:
    """Kind -> JSON Schema."""
    from fzcli.learn.train_spec import TrainRun
    from fzcli.plan.planar_spec import AnyRun
    from fzcli.spec.schema import json_schema, schema_of
    from fzcli.sweep.schema import simulate_schema, sweep_schema, tune_schema

    return {
        "robot": json_schema("robot"),
        "planar_3rrr": json_schema("planar_3rrr"),
        "rulebase": json_schema("rulebase"),
        "simulate": simulate_schema(),
        "sweep": sweep_schema(),
        "plan": schema_of(AnyRun, "fzcli plan"),
        "train": schema_of(TrainRun, "fzcli training"),
        "tune": tune_schema(),
    }
