"""``fzcli find``: trajectories of a sweep by criteria across its configurations."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from fzcli.cli.guard import emit, guarded, say
from fzcli.errors import UsageError


class FoundFormat(StrEnum):
    """How found trajectories are printed."""

    csv = "csv"
    run = "run"


@guarded
def find(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The HDF5 file of a sweep.")],
    config: Annotated[
        list[str],
        typer.Option(
            "--config",
            metavar="NAME=KEY=VALUE,...",
            help="Names a configuration, such as fixed=controller.kind=clik,controller.gain=1000; may be repeated.",
        ),
    ],
    that: Annotated[
        list[str],
        typer.Option(
            "--that",
            metavar="CRITERION",
            help="Such as 'fixed.yaw_abs_max > 2 * fuzzy.yaw_abs_max'; may be repeated, all must hold.",
        ),
    ],
    by: Annotated[
        str, typer.Option("--by", metavar="SIDE", help="What they are ranked by, such as fixed.yaw_abs_max.")
    ],
    lowest: Annotated[bool, typer.Option("--lowest", help="Rank the lowest first.")] = False,
    most: Annotated[int, typer.Option("--most", min=1, help="Trajectories printed at the most.")] = 10,
    format: Annotated[
        FoundFormat,
        typer.Option("--format", help="csv: a row each; run: the first one as fields of a run file."),
    ] = FoundFormat.csv,
) -> None:
    """Find trajectories of a sweep that meet criteria, the best first."""
    from fzcli.record.find import configuration, drawn, nested
    from fzcli.record.find import find as search
    from fzcli.record.sweep_file import read_sweep
    from fzcli.spec.reader import dump

    record = read_sweep(file)
    names = {name: configuration(record, changes) for name, changes in map(_named, config)}
    found = search(record, names, that, by, lowest)
    if not len(found.trajectories):
        raise UsageError("no trajectory meets all criteria")
    say(f"{len(found.trajectories)} trajectories meet all criteria")
    if format is FoundFormat.run:
        emit(dump(nested(drawn(record, int(found.trajectories[0])))))
        return
    rows = zip(found.trajectories[:most], found.ranks[:most], strict=True)
    emit("trajectory,rank\n" + "".join(f"{int(index)},{float(rank)!r}\n" for index, rank in rows))


def _named(text: str) -> tuple[str, dict[str, Any]]:
    from fzcli.spec.reader import read_text

    name, equals, rest = text.partition("=")
    entries = [entry.partition("=") for entry in rest.split(",")]
    if not name or not equals or not all(key and sign and value for key, sign, value in entries):
        raise UsageError(f"--config {text}: write NAME=KEY=VALUE,KEY=VALUE")
    return name, {key.strip(): read_text(value, "--config").value for key, _, value in entries}
