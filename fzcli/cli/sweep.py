"""``fzcli sweep``: many runs to an HDF5 file and a table."""

import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fzcli.cli.engine_note import note_engine
from fzcli.cli.guard import FAILED, emit, guarded, say
from fzcli.cli.options import QuietOption, RunArgument, SetOption, SweepOutputOption, TableFormat, colored, table_width

if TYPE_CHECKING:
    from fzcli.record.sweep_record import SweepRecord
    from fzcli.sweep.execute import Listener, Means
    from fzcli.sweep.meaning import AnySweep

ProcessesOption = Annotated[
    bool | None,
    typer.Option(
        "--processes/--threads", help="What the jobs are; threads, but processes for plans and without a compiler."
    ),
]
DaskOption = Annotated[
    str | None,
    typer.Option("--dask", metavar="ADDRESS", help="Run on a Dask cluster: tcp://HOST:PORT, or local: one here."),
]
SchedulerOption = Annotated[
    Path | None, typer.Option("--scheduler-file", metavar="FILE", help="Run on the Dask cluster of this file.")
]


@guarded
def sweep(
    run: RunArgument,
    sets: SetOption = [],  # noqa: B006
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", "-j", min=1, help="Threads or processes; all cores by default. No result depends on it."
        ),
    ] = None,
    processes: ProcessesOption = None,
    dask: DaskOption = None,
    scheduler_file: SchedulerOption = None,
    shard: Annotated[
        str | None,
        typer.Option("--shard", metavar="K/N", help="Compute part K of N alone, as in a job array; see fzcli merge."),
    ] = None,
    output: SweepOutputOption = None,
    format: Annotated[
        TableFormat, typer.Option("--format", help="Of the table on standard output.")
    ] = TableFormat.rich,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say how many runs and shards, how long and how large; keep nothing.")
    ] = False,
    quiet: QuietOption = False,
) -> None:
    """Run a sweep and print its table.

    Every configuration runs on every trajectory; runs are simulations or, by `run: plan`, plans. The result goes to an
    HDF5 file. The same command goes on with a sweep that was stopped or killed, and prints the table of a finished
    one. The first Ctrl-C lets the shards in flight finish. Ends with 1 when runs failed that the file does not expect
    to fail, with 3 when it is not finished.
    """
    from fzcli.cli.progress import Progress
    from fzcli.cli.sources import run_source
    from fzcli.cli.stopping import gentle_stop
    from fzcli.sweep.execute import Listener, Means, load_sweep

    source = run_source(run)
    path = source.output(output)
    part = _part(shard)
    resolved = load_sweep(source.path, sets)
    means = Means(jobs, processes, dask, scheduler_file)
    if dry_run:
        from fzcli.cli.dry_run import dry_run as told

        emit(told(resolved, path, means))
        return
    with Progress(quiet) as progress, gentle_stop() as stop:
        listener = Listener(progress, lambda text: say(text, quiet), stop)
        if part is not None:
            _compute_part(resolved, path, part, means, listener, quiet)
            return
        _compute(resolved, path, means, listener, quiet)
    print_result(resolved, path, format)


def _compute(resolved: "AnySweep", path: Path, means: "Means", listener: "Listener", quiet: bool) -> None:
    from fzcli.sweep.execute import sweep_to

    if resolved.file.run == "simulate":
        note_engine(quiet)
    begin = time.monotonic()
    done = sweep_to(resolved, path, means, listener, ("fzcli", *sys.argv[1:]))
    seconds = time.monotonic() - begin
    size = f"{done.path.stat().st_size / 1e6:.2f} MB"
    if done.computed:
        say(f"{done.computed} runs in {seconds:.1f} s; wrote {done.path} ({size})", quiet)
    else:
        say(f"finished before: {done.path} ({size})", quiet)


def _compute_part(
    resolved: "AnySweep", path: Path, part: tuple[int, int], means: "Means", listener: "Listener", quiet: bool
) -> None:
    from fzcli.sweep.execute import sweep_part

    begin = time.monotonic()
    runs = sweep_part(resolved, path, part, means, listener)
    say(f"part {part[0]} of {part[1]}: {runs} runs in {time.monotonic() - begin:.1f} s", quiet)


def _part(text: str | None) -> tuple[int, int] | None:
    """K and N of ``K/N``."""
    if text is None:
        return None
    match = re.fullmatch(r"(\d+)/(\d+)", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise typer.BadParameter(f"must be K/N with K from 1 to N, such as 3/100, not {text!r}", param_hint="--shard")
    return int(match[1]), int(match[2])


def print_result(resolved: "AnySweep", path: Path, format: TableFormat) -> None:
    """The table of a finished sweep; ends with 1 when runs failed that were not expected to."""
    from fzcli.record.sweep_file import read_sweep
    from fzcli.sweep.meaning import meaning_of
    from fzcli.sweep.output import finished

    record = read_sweep(finished(path, meaning_of(resolved)) or path)
    emit(_table(resolved, record, format))
    _judge(resolved, record)


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
