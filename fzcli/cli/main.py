"""The command ``fzcli``: its commands in one list."""

from typing import Annotated

import typer

from fzcli import __version__
from fzcli.cli.check import check
from fzcli.cli.find import find
from fzcli.cli.get import get
from fzcli.cli.guard import end_on_signals
from fzcli.cli.info import info
from fzcli.cli.init import init
from fzcli.cli.merge import merge
from fzcli.cli.plan import plan
from fzcli.cli.plot import plot
from fzcli.cli.schema import schema
from fzcli.cli.simulate import simulate
from fzcli.cli.status import status
from fzcli.cli.sweep import sweep
from fzcli.cli.table import table
from fzcli.cli.train import train
from fzcli.cli.tune import tune
from fzcli.cli.validate import validate

app = typer.Typer(
    name="fzcli",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,  # plain help: rich takes longer to load than all of fzcli's own modules
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
_SWEEPS = (sweep, merge, status, check, tune)
for command in (simulate, *_SWEEPS, plan, train, table, find, get, plot, info, validate, schema, init):
    app.command()(command)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"fzcli {__version__}")
        raise typer.Exit


@app.callback()
def _all(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Simulate manipulators on free-floating bases: YAML in, certified HDF5 and tables out.

    Standard output is data only; messages and progress go to standard error. Exit codes: 0 done (flagged
    runs included), 1 a run or the computation failed, 2 bad usage or input, 3 unfinished, to be gone on with by the
    same command, 130 and 143 on signals.
    """


def main() -> None:
    """Run the command line and exit with its code."""
    end_on_signals()
    app()


if __name__ == "__main__":
    main()
