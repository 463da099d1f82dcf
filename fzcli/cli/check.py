"""``fzcli check``: whether a sweep's results are whole."""

import typer

from fzcli.cli.guard import FAILED, emit, guarded
from fzcli.cli.options import RunArgument, SetOption, SweepOutputOption

INCOMPLETE = 3


@guarded
def check(
    run: RunArgument,
    sets: SetOption = [],  # noqa: B006
    output: SweepOutputOption = None,
) -> None:
    """Read every byte of a sweep's file or shards and say what is missing or damaged.

    RUN and options are those of the sweep. Ends with 1 when something is damaged, with 3 when only shards are missing.
    """
    from fzcli.cli.sources import run_source
    from fzcli.sweep.execute import load_sweep
    from fzcli.sweep.inspect import checked

    source = run_source(run)
    path = source.output(output)
    found = checked(load_sweep(source.path, sets), path)
    emit("".join(f"{line}\n" for line in (*found.damaged, found.text)))
    if found.damaged:
        raise typer.Exit(FAILED)
    if found.missing:
        raise typer.Exit(INCOMPLETE)
