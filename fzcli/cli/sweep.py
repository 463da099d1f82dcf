"""``fzcli sweep``: many runs to an HDF5 file and a table."""

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fzcli.cli.engine_note import note_engine
from fzcli.cli.guard import FAILED, emit, guarded, say
from fzcli.cli.options import QuietOption, RunArgument, SetOption, TableFormat, colored, table_width

if TYPE_CHECKING:
    from fzcli.record.sweep_record import SweepRecord
    from fzcli.sweep.plan_sweep import PlanSweep
    from fzcli.sweep.resolve import Sweep

    AnySweep = Sweep | PlanSweep


@guarded
def sweep(
    run: RunArgument,
    sets: SetOption = [],  # noqa: B006
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", "-j", min=1, help="Threads, or processes of plans; all cores by default. No result depends on it."
        ),
    ] = None,
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
        TableFormat, typer.Option("--format", help="Of the table on standard output.")
    ] = TableFormat.rich,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check the file and print how many runs it makes.")
    ] = False,
    quiet: QuietOption = False,
) -> None:
    """Run a sweep and print its table.

    Every configuration runs on every trajectory; runs are simulations or, by `run: plan`, plans. The result goes
    to an HDF5 file. Ends with 1 when runs failed that the file does not expect to fail.
    """
    from fzcli.cli.progress import Progress
    from fzcli.cli.sources import run_source
    from fzcli.sweep.execute import load_sweep, run_sweep, save_sweep

    source = run_source(run)
    path = source.output(output)
    resolved = load_sweep(source.path, sets)
    if dry_run:
        emit(_plan(resolved, path))
        return
    if resolved.file.run == "simulate":
        note_engine(quiet)
    begin = time.monotonic()
    with Progress(quiet) as progress:
        record = run_sweep(resolved, jobs, progress, ("fzcli", *sys.argv[1:]))
        save_sweep(resolved, record, path)
    seconds = time.monotonic() - begin
    runs = len(record.metrics["status"])
    say(f"{runs} runs in {seconds:.1f} s; wrote {path} ({path.stat().st_size / 1e6:.2f} MB)", quiet)
    emit(_table(resolved, record, format))
    _judge(resolved, record)


def _plan(resolved: "AnySweep", path: Path) -> str:
    trajectories = resolved.file.trajectories
    configurations = len(resolved.specs)
    facts = {
        "configurations": configurations,
        "trajectories": trajectories.count,
        "runs": configurations * trajectories.count,
        "filter": " and ".join(trajectories.keep_if.that) if trajectories.keep_if else "none",
        "output": path,
    }
    return "".join(f"{name:<15} {value}\n" for name, value in facts.items())


def _table(resolved: "AnySweep", record: "SweepRecord", format: TableFormat) -> str:
    from fzcli.cli.table import default_table
    from fzcli.record.table import build_table
    from fzcli.record.table_text import render
    from fzcli.sweep.execute import table_spec

    spec = table_spec(resolved) or default_table(record.configs)
    return render(build_table(record, spec), format.value, table_width(), colored())


def _judge(resolved: "AnySweep", record: "SweepRecord") -> None:
    """Say how many runs failed; end with 1 when they were not expected to."""
    from fzcli.sweep.execute import unexpected_failures

    for line in _unreached(record):
        say(line)
    failed = int((record.metrics["status"] == 2).sum())
    unexpected = unexpected_failures(resolved, record)
    if unexpected:
        say(f"{failed} runs failed, {unexpected} of them in configurations that were not expected to")
        raise typer.Exit(FAILED)


def _unreached(record: "SweepRecord") -> Iterator[str]:
    """Why runs with a target did not reach it, a line a reason."""
    from fzcli.loop.verdict import OUTCOMES

    found = record.metrics.get("outcome")
    if found is None:
        return
    for code, outcome in enumerate(OUTCOMES[1:], start=1):
        count = int((found == code).sum())
        if count:
            yield f"{count} of {len(found)} runs did not reach their target: {outcome.text}"
