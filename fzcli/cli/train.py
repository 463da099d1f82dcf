"""``fzcli train``: networks for a robot's kinematics to a file, and a table of their errors."""

from pathlib import Path
from typing import Annotated

import typer

from fzcli.cli.guard import emit, guarded, say
from fzcli.cli.options import QuietOption, RunArgument, SetOption, TableFormat


@guarded
def train(
    run: RunArgument,
    sets: SetOption = [],  # noqa: B006
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="PATH",
            help="The npz file, or a folder for it. Default: NAME/NAME.npz beside the run file.",
        ),
    ] = None,
    format: Annotated[
        TableFormat, typer.Option("--format", help="Of the table on standard output.")
    ] = TableFormat.rich,
    quiet: QuietOption = False,
) -> None:
    """Train networks for a robot's kinematics, one a branch.

    Prints the errors of every network on poses that it was not trained on, alone and after Newton steps; the
    networks go to an npz file.
    """
    import fzcli
    from fzcli.cli.network_table import network_table
    from fzcli.cli.progress import Progress
    from fzcli.cli.sources import run_source

    source = run_source(run)
    path = source.output(output, ".npz")
    with Progress(quiet) as progress:
        networks = fzcli.train(source.path, sets=sets, output=path, progress=progress)
    for label, reason in networks.skipped.items():
        say(f"no network for {label}: it {reason}", quiet)
    say(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB)", quiet)
    emit(network_table(networks, format))
