"""``fzcli plot``: figures of results and rule bases."""

from pathlib import Path
from typing import Annotated

import typer

from fzcli.cli.guard import emit, guarded
from fzcli.errors import UsageError


@guarded
def plot(
    source: Annotated[
        str, typer.Argument(metavar="FILE", help="An HDF5 or npz file of fzcli, or a rule base by path or name.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="PATH",
            help="The figure (png, svg or pdf), or a folder. Default: beside the file.",
        ),
    ] = None,
    what: Annotated[
        str | None,
        typer.Option(
            "--what",
            help="Of a run: run, comparison, or with a target configurations, tip_path, joints or reach; "
            "of a plan: joints_over_time, path or clearance; of a sweep: table, comparison or runs; "
            "of networks: comparison or errors. Default: what fits.",
        ),
    ] = None,
) -> None:
    """Draw a result or a rule base.

    Prints the paths of the figures. Of a rule base: its terms and its surface.
    """
    from fzcli.cli.sources import find_any, is_result

    path = find_any(source)
    if path.suffix.lower() == ".npz":
        from fzcli.view.network_plot import plot_networks

        figures = plot_networks(path, output, what)
    elif is_result(path):
        from fzcli.view.plots import plot as draw

        figures = draw(path, output, what)
    else:
        if what is not None:
            raise UsageError(f"--what {what}: a rule base has one figure")
        figures = [_rulebase(path, source, output)]
    emit("".join(f"{figure}\n" for figure in figures))


def _rulebase(path: Path, source: str, output: Path | None) -> Path:
    """A rule base's figure; that of a shipped one goes to the working directory."""
    import fzcli
    from fzcli.view.rulebase_plot import plot_rulebase
    from fzcli.view.style import output_path

    rulebase = fzcli.load_rulebase(path)
    beside = path if Path(source).exists() else Path(path.name)
    return plot_rulebase(rulebase, fzcli.build_surface(rulebase), output_path(beside, output, "rulebase"))
