"""``fzcli init``: an editable copy of everything shipped."""

from pathlib import Path
from typing import Annotated

import typer

from fzcli.cli.guard import emit, guarded


@guarded
def init(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="Where to; made if it is not there.")],
) -> None:
    """Copy everything shipped into a folder.

    Robots, rule bases, runs and JSON Schemas, to be edited there; prints the paths of the files.
    """
    from fzcli.cli.schema import all_schemas
    from fzcli.spec.library import init as copy

    emit("".join(f"{path}\n" for path in copy(directory, all_schemas())))
