"""``fzcli tune``: numbers of a run, found by trying."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fzcli.cli.guard import emit, guarded, say
from fzcli.cli.options import QuietOption, RunArgument, SetOption

if TYPE_CHECKING:
    from fzcli.sweep.tune_scores import Score
    from fzcli.sweep.tuning import Tuned


@guarded
def tune(
    run: RunArgument,
    sets: SetOption = [],  # noqa: B006
    jobs: Annotated[
        int | None, typer.Option("--jobs", "-j", min=1, help="Threads; all cores by default. No result depends on it.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="PATH", help="The JSON file. Default: NAME/NAME.json beside the run file."
        ),
    ] = None,
    quiet: QuietOption = False,
) -> None:
    """Tune numbers of a run by differential evolution, and judge them on trajectories that were held out.

    Prints the numbers found, and how they and the file's own do. Where numbers of a rule base were tuned, the whole
    rule base is written beside the result. The same command goes on with a tuning that was stopped or killed.
    """
    from fzcli.cli.progress import Progress
    from fzcli.cli.sources import run_source
    from fzcli.cli.stopping import gentle_stop
    from fzcli.spec.reader import read
    from fzcli.sweep.tune_spec import resolve_tuning
    from fzcli.sweep.tuned_rulebase import write_rulebase
    from fzcli.sweep.tuning import tune_to

    source = run_source(run)
    path = source.output(output, ".json")
    tuning = resolve_tuning(read(source.path), tuple(sets))
    with Progress(quiet) as progress, gentle_stop() as stop:
        found = tune_to(tuning, path, jobs, progress, stop)
    say(f"wrote {path}", quiet)
    rulebase = write_rulebase(tuning, found, path, ("fzcli", *sys.argv[1:]))
    if rulebase is not None:
        say(f"wrote {rulebase}", quiet)
    emit(_text(found, tuning.section.minimise))


def _text(found: "Tuned", metric: str) -> str:
    rows = [(path, f"{value:g}") for path, value in found.values.items()]
    for name, before, after in (
        ("seen", found.before, found.after),
        ("held out", found.held_out_before, found.held_out_after),
    ):
        if before is not None and after is not None:
            rows += _comparison(name, metric, before, after)
    if found.held_out_change is not None and found.held_out_before is not None:
        change, whole = found.held_out_change, found.held_out_before.mean
        share = f" ({100 * change.mean / whole:+.1f} +- {100 * change.error / whole:.1f} %)" if whole else ""
        rows.append(("held out: change, standard error in pairs", f"{change.mean:.3g} +- {change.error:.2g}{share}"))
    rows.append(("candidates", str(found.evaluations)))
    width = max(len(name) for name, _ in rows)
    return "".join(f"{name:<{width}}  {value}\n" for name, value in rows)


def _comparison(name: str, metric: str, before: "Score", after: "Score") -> list[tuple[str, str]]:
    change = 100.0 * (after.mean / before.mean - 1.0) if before.mean else 0.0
    return [
        (f"{name}: {metric}", f"{before.mean:.6g} -> {after.mean:.6g} ({change:+.1f} %)"),
        (f"{name}: lost", f"{before.lost} -> {after.lost} of {after.runs}"),
    ]
