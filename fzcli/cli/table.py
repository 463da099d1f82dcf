"""``fzcli table``: the table of a sweep's file."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fzcli.cli.guard import emit, guarded
from fzcli.cli.options import TableFormat, colored, table_width

if TYPE_CHECKING:
    from fzcli.record.table_spec import TableSpec


@guarded
def table(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The HDF5 file of a sweep.")],
    format: Annotated[TableFormat, typer.Option("--format", help="Of the table.")] = TableFormat.rich,
) -> None:
    """Print the table of a sweep.

    Mean, median and 95th percentile of every metric, lost and failed runs; beside published numbers
    and with paired differences where the sweep has them.
    """
    from fzcli.record.sweep_file import read_sweep, read_table_spec
    from fzcli.record.table import build_table
    from fzcli.record.table_text import render

    spec = read_table_spec(file)
    record = read_sweep(file)
    spec = spec or default_table(record.configs)
    emit(render(build_table(record, spec), format.value, table_width(), colored()))


def default_table(configs: Sequence[Mapping[str, Any]]) -> "TableSpec":
    """A table for a sweep that asks for none: its fields down the rows and across where two vary, else a row each."""
    from fzcli.record.table_spec import TableSpec

    paths = list(dict.fromkeys(path for config in configs for path in config))
    if not paths or len(paths) > 2:
        return TableSpec()
    return TableSpec(rows=paths[0], columns=paths[1] if len(paths) > 1 else None)
