"""``fzcli simulate``: one run to an HDF5 file and a summary."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fzcli.cli.engine_note import note_engine
from fzcli.cli.guard import FAILED, emit, guarded, say
from fzcli.cli.options import QuietOption, RunArgument, SetOption, SummaryFormat

if TYPE_CHECKING:
    from fzcli.loop.rollout import Rollout


@guarded
def simulate(
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
    """Run one simulation, with its variants; or follow a plan among its obstacles as they truly move.

    With a section replay: the motion is followed at torque level, and stands beside it as a variant.

    Prints metrics, certificate and status; the result goes to an HDF5 file. Ends with 1 when a run
    failed; its data is kept up to there.
    """
    import fzcli
    from fzcli.cli.sources import run_source
    from fzcli.cli.summary import summary

    source = run_source(run)
    path = source.output(output)
    note_engine(quiet)
    rollout = fzcli.simulate(source.path, sets=sets, output=path, argv=("fzcli", *sys.argv[1:]))
    say(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB)", quiet)
    emit(summary({source.name: rollout, **rollout.variants}, format))
    if _failed(source.name, rollout):
        raise typer.Exit(FAILED)


def _failed(name: str, rollout: "Rollout") -> bool:
    """Whether the run or one of its variants failed; says which, why, and what to try."""
    failed = {n: one for n, one in {name: rollout, **rollout.variants}.items() if one.status.name == "failed"}
    for each, one in failed.items():
        say(f"{each} failed: {one.status.reason}. Advice: {one.status.advice}")
    return bool(failed)
