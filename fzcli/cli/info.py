"""``fzcli info``: what a file holds."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fzcli.cli.guard import emit, guarded

if TYPE_CHECKING:
    from fzcli.spec.document import Document


@guarded
def info(
    source: Annotated[
        str,
        typer.Argument(metavar="FILE", help="An HDF5 file, or a robot, rule base or run by path or name."),
    ],
) -> None:
    """Describe a result file, a robot, a rule base or a run."""
    from fzcli.cli.sources import find_any, is_result

    path = find_any(source)
    if path.suffix.lower() == ".npz":
        from fzcli.cli.describe_learn import describe_networks
        from fzcli.learn.store import load

        emit("\n".join(describe_networks(load(path))) + "\n")
        return
    emit("\n".join(_result(path) if is_result(path) else _text(path)) + "\n")


def _result(path: Path) -> list[str]:
    from fzcli.record.info import describe

    return describe(path).lines()


def _text(path: Path) -> list[str]:
    from fzcli.cli.describe import describe_robot, describe_rulebase
    from fzcli.cli.sources import KINDS
    from fzcli.spec.load import check_kind, load_robot, robot_of, rulebase_of
    from fzcli.spec.reader import read

    if path.suffix.lower() == ".urdf":
        return describe_robot(load_robot(path))
    document = read(path)
    kind = check_kind(document, *KINDS)
    if kind == "robot":
        return describe_robot(robot_of(document))
    if kind == "rulebase":
        return describe_rulebase(rulebase_of(document))
    if kind in ("planar_3rrr", "train"):
        from fzcli.cli.describe_learn import describe_planar, describe_train
        from fzcli.learn.train import train_of
        from fzcli.spec.any_robot import planar_of

        return describe_train(train_of(document)) if kind == "train" else describe_planar(planar_of(document))
    return _run(document, kind)


def _run(document: "Document", kind: str) -> list[str]:
    from fzcli.cli.describe import describe_plan, describe_simulation, describe_sweep
    from fzcli.loop.run_file import run_of, variants_of
    from fzcli.sweep.resolve import resolve

    if kind == "tune":
        from fzcli.cli.describe import describe_tuning
        from fzcli.sweep.tune_spec import resolve_tuning

        return describe_tuning(resolve_tuning(document))
    if kind == "sweep":
        return describe_sweep(resolve(document))
    if kind == "plan":
        from fzcli.plan.load import task_of

        return describe_plan(task_of(document))
    spec = run_of(document)
    return describe_simulation(spec, list(variants_of(document, spec)))
