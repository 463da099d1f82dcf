"""``fzcli plan``: a path from start to goal to an HDF5 file and a summary."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from fzcli.cli.guard import FAILED, emit, guarded, say
from fzcli.cli.options import QuietOption, RunArgument, SetOption, SummaryFormat


@guarded
def plan(
    run: RunArgument,
    sets: SetOption = [],  # noqa: B006
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="PATH",
            help="The HDF5 file, or a folder for it. Default: NAME/NAME.h5 beside the run file.",
        ),
    ] = None,
    format: Annotated[
        SummaryFormat, typer.Option("--format", help="Of the summary on standard output.")
    ] = SummaryFormat.rich,
    quiet: QuietOption = False,
) -> None:
    """Plan a path that keeps clear of a scene, whole arm, at all times.

    Prints metrics, certificate and status; the path goes to an HDF5 file. Ends with 1 and writes nothing
    when no path is found, or when what is found touches something.
    """
    import fzcli
    from fzcli.cli.sources import run_source
    from fzcli.cli.summary import summary
    from fzcli.record.plan_file import as_rollout

    source = run_source(run)
    path = source.output(output)
    found = fzcli.plan(source.path, sets=sets, output=path, argv=("fzcli", *sys.argv[1:]))
    if found.status.name == "failed":
        emit(summary({source.name: as_rollout(found)}, format))
        say(f"{source.name} is not written: {found.status.reason}. Advice: {found.status.advice}")
        raise typer.Exit(FAILED)
    say(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB), found by: {found.method}", quiet)
    emit(summary({source.name: as_rollout(found)}, format))
