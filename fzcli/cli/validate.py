"""``fzcli validate``: check files of every kind without running anything."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fzcli.cli.guard import emit, guarded, say_error
from fzcli.errors import FzcliError, SpecError

if TYPE_CHECKING:
    from fzcli.spec.document import Document


@guarded
def validate(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE",
            help="Robots (also URDF), rule bases and runs, by path or name; - is standard input.",
        ),
    ],
) -> None:
    """Check files without running them.

    Tells every problem of every file, with its place, and ends with 2 when there is one.
    """
    from fzcli.cli.sources import find_any

    bad = 0
    for file in files:
        try:
            path = find_any(file)
            emit(f"{file}: ok ({check(path)})\n")
        except FzcliError as error:
            say_error(str(error))
            bad += 1
    if bad:
        raise typer.Exit(SpecError.exit_code)


def check(path: Path) -> str:
    """The kind of a file that is right.

    Raises:
        FzcliError: everything that is wrong with it.
    """
    from fzcli.cli.sources import KINDS
    from fzcli.fuzzy.check import check_rulebase
    from fzcli.model import build_model
    from fzcli.spec.load import check_kind, load_robot, robot_of, rulebase_of
    from fzcli.spec.reader import read

    if path.suffix.lower() == ".urdf":
        build_model(load_robot(path))
        return "robot"
    document = read(path)
    kind = check_kind(document, *KINDS)
    if kind == "robot":
        build_model(robot_of(document))
    elif kind == "planar_3rrr":
        from fzcli.spec.any_robot import planar_of

        planar_of(document)
    elif kind == "tune":
        from fzcli.sweep.tune_spec import resolve_tuning

        resolve_tuning(document)
    elif kind == "train":
        from fzcli.learn.train import train_of

        train_of(document)
    elif kind == "rulebase":
        check_rulebase(rulebase_of(document))
    elif kind == "simulate":
        _check_simulation(document)
    elif kind == "plan":
        from fzcli.loop.plan_replay import replay_of
        from fzcli.plan.load import task_of

        replay_of(document, task_of(document))
    else:
        _check_sweep(document)
    return kind


def _check_simulation(document: "Document") -> None:
    from fzcli.loop.assemble import closed_loop, parameter_row, step_counts
    from fzcli.loop.run_file import runs_of

    spec, variants = runs_of(document)
    for one in (spec, *variants.values()):
        loop = closed_loop(one, record=False)
        step_counts(loop, one, parameter_row(one, loop.parameters)[None, :])


def _check_sweep(document: "Document") -> None:
    from fzcli.sweep.execute import checked_worker, resolve_any

    checked_worker(resolve_any(document))
