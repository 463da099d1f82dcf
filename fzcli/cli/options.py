"""Options and arguments that several commands share."""

import os
import shutil
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

RunArgument = Annotated[
    str,
    typer.Argument(
        metavar="RUN", help="A run file, the name of a local or shipped one, or - for standard input."
    ),
]
SetOption = Annotated[
    list[str],
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change a field, such as controller.gain=100; may be repeated."
    ),
]
QuietOption = Annotated[
    bool, typer.Option("--quiet", "-q", help="No messages or progress; errors are still told.")
]


SweepOutputOption = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        metavar="PATH",
        help="The HDF5 file, or a folder for it. Default: NAME/NAME.h5 beside the run file.",
    ),
]


class TableFormat(StrEnum):
    """How tables are printed."""

    rich = "rich"
    csv = "csv"
    json = "json"
    md = "md"


class SummaryFormat(StrEnum):
    """How the summary of a run is printed."""

    rich = "rich"
    csv = "csv"
    json = "json"


class DataFormat(StrEnum):
    """How datasets are printed."""

    csv = "csv"
    jsonl = "jsonl"
    npy = "npy"


class Kind(StrEnum):
    """The kinds of YAML files."""

    robot = "robot"
    planar_3rrr = "planar_3rrr"
    rulebase = "rulebase"
    simulate = "simulate"
    sweep = "sweep"
    plan = "plan"
    train = "train"
    tune = "tune"


def table_width() -> int:
    """Columns that a table may take: the terminal's, or 110 in a pipe or file."""
    return shutil.get_terminal_size((110, 40)).columns if sys.stdout.isatty() else 110


def colored() -> bool:
    """Whether standard output is a terminal that wants colors."""
    return sys.stdout.isatty() and "NO_COLOR" not in os.environ
