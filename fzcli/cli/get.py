"""``fzcli get``: one dataset of a result file, for pipes."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from fzcli.cli.guard import emit, guarded, say
from fzcli.cli.options import DataFormat
from fzcli.errors import UsageError


@guarded
def get(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="An HDF5 file of fzcli.")],
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME", help="A dataset, signal, metric or group; without one the names are listed."
        ),
    ] = None,
    format: Annotated[DataFormat, typer.Option("--format", help="Of the data.")] = DataFormat.csv,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="PATH", help="A file instead of standard output.")
    ] = None,
) -> None:
    """Print a dataset, for pipes.

    What indexes it (time, run, configuration) makes the first columns.
    """
    from fzcli.record.export import get as columns_of
    from fzcli.record.export import names, write_columns

    if name is None:
        emit("".join(f"{one}\n" for one in names(file)))
        return
    columns = columns_of(file, name)
    if output is not None:
        try:
            output.parent.mkdir(parents=True, exist_ok=True)
            with output.open("wb") as stream:
                write_columns(columns, stream, format.value)
        except OSError as error:
            raise UsageError(f"{output}: cannot be written: {error.strerror or error}") from None
        say(f"wrote {output}")
        return
    if format is DataFormat.npy and sys.stdout.isatty():
        raise UsageError("npy is binary: redirect it, or name a file with -o")
    write_columns(columns, sys.stdout.buffer, format.value)
    sys.stdout.buffer.flush()
