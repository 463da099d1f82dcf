"""``fzcli status``: how far a sweep is."""

from fzcli.cli.guard import emit, guarded
from fzcli.cli.options import RunArgument, SetOption, SweepOutputOption


@guarded
def status(
    run: RunArgument,
    sets: SetOption = [],  # noqa: B006
    output: SweepOutputOption = None,
) -> None:
    """Say how far a sweep is: shards done, who works on it, files of other numbers beside it.

    RUN and options are those of the sweep. Nothing is looked into or changed; see fzcli check.
    """
    from fzcli.cli.sources import run_source
    from fzcli.sweep.execute import load_sweep
    from fzcli.sweep.inspect import state_of

    source = run_source(run)
    path = source.output(output)
    found = state_of(load_sweep(source.path, sets), path)
    facts = {
        "sweep": found.identity,
        "state": f"finished, in {found.finished}" if found.finished else found.word,
        "shards": f"{found.done} of {found.shards}",
        "runs": f"{found.runs_done} of {found.runs}",
        "folder": found.folder or "none",
        "at work": "; ".join(found.holders) or "nobody",
        "beside": ", ".join(str(path) for path in found.others) or "nothing",
    }
    emit("".join(f"{name:<9} {value}\n" for name, value in facts.items()))
