"""``fzcli merge``: the shards that a job array computed, as one file and a table."""

import sys
from typing import Annotated

import typer

from fzcli.cli.guard import guarded, say
from fzcli.cli.options import QuietOption, RunArgument, SetOption, SweepOutputOption, TableFormat


@guarded
def merge(
    run: RunArgument,
    sets: SetOption = [],  # noqa: B006
    output: SweepOutputOption = None,
    format: Annotated[
        TableFormat, typer.Option("--format", help="Of the table on standard output.")
    ] = TableFormat.rich,
    quiet: QuietOption = False,
) -> None:
    """Make one file of a sweep's shards and print its table.

    RUN and options are those that the shards were computed with. Ends with 3 when shards are missing.
    """
    from fzcli.cli.progress import Progress
    from fzcli.cli.sources import run_source
    from fzcli.cli.sweep import print_result
    from fzcli.errors import UnfinishedError
    from fzcli.sweep.execute import Listener, load_sweep, merge_to

    source = run_source(run)
    path = source.output(output)
    resolved = load_sweep(source.path, sets)
    with Progress(quiet) as progress:
        listener = Listener(progress, lambda text: say(text, quiet))
        try:
            done = merge_to(resolved, path, listener, ("fzcli", *sys.argv[1:]))
        except UnfinishedError as error:
            say(f"{error}; fzcli sweep computes what is missing")
            raise typer.Exit(error.exit_code) from None
    say(f"{done.path} ({done.path.stat().st_size / 1e6:.2f} MB)", quiet)
    print_result(resolved, path, format)
