"""Sweeps beside the bare rollouts that they consist of, and engine beside engine, on the same runs."""

import statistics
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from fzcli.sweep.builds import Builds, Rows, rows_of
from fzcli.sweep.draws import candidates, sources
from fzcli.sweep.execute import Listener, Means, load_sweep, sweep_to
from fzcli.sweep.resolve import Sweep
from fzcli.sweep.trajectories import draw_trajectories, trial_builds

COUNT = 8000  # trajectories, by ten configurations
JOBS = 2
ROUNDS = 3


def sweeps() -> None:
    """Print runs a second, and what part of the bare rate that is: medians of rounds in which all take turns."""
    means = {"threads": Means(JOBS, processes=False), "processes": Means(JOBS, processes=True)}
    if find_spec("distributed"):
        means["dask"] = Means(JOBS, dask="local")
    work, found = _work(), {name: [] for name in ("bare", *means)}
    for _ in range(ROUNDS):
        found["bare"].append(_bare(work))
        for name, how in means.items():
            found[name].append(_rate(how))
    title = f"table2-small with {COUNT} trajectories, {JOBS} jobs"
    print(f"\n{title:58} {'runs/s':>10} {'of bare':>10}")
    for name, rates in found.items():
        part = statistics.median(rate / bare for rate, bare in zip(rates, found["bare"], strict=True))
        label = "bare rollouts, candidates of the filter included" if name == "bare" else name
        print(f"{label:58} {statistics.median(rates):10.0f} {part:10.2f}")


def _sweep() -> Sweep:
    found = load_sweep("table2-small", [f"trajectories.count={COUNT}"])
    if not isinstance(found, Sweep):
        raise TypeError("table2-small is a sweep of simulations")
    return found


def _work() -> list[Rows]:
    """All rollouts, drawn and compiled, and as many candidates of the filter as are tried for them."""
    sweep, builds = _sweep(), Builds()
    trials = trial_builds(sweep)
    drawing = draw_trajectories(sweep, trials, range(COUNT), JOBS)
    tried = int(drawing.candidates.sum())
    random = list(sources(sweep.file.trajectories, sweep.draws, range(tried)))
    every = np.arange(COUNT)
    work = [rows for spec in sweep.specs for rows in rows_of(builds, spec, sweep.draws, drawing.values, every)]
    if sweep.filter is not None:
        work += rows_of(trials, sweep.filter, sweep.draws, candidates(sweep.draws, random), np.arange(tried))
    builds.compile(record=False, jobs=JOBS)
    return work


def _bare(work: list[Rows]) -> float:
    """Runs a second when everything is drawn before and nothing is written."""
    begin = time.perf_counter()
    for rows in work:
        rows.build.engine(record=False).run(rows.parameters, rows.steps, jobs=JOBS)
    seconds = time.perf_counter() - begin
    return COUNT * len(_sweep().specs) / seconds


def _rate(means: Means) -> float:
    """Runs a second over the last three quarters of the shards, so that the start of all workers does not count."""
    seen: list[tuple[float, int]] = []

    def tell(what: str, done: int, total: int) -> None:
        if what == "running" and 4 * done >= total and (not seen or done > seen[-1][1]):
            seen.append((time.perf_counter(), done))

    with tempfile.TemporaryDirectory() as folder:
        sweep_to(_sweep(), Path(folder) / "s.h5", means, Listener(tell))
    (begin, first), (end, last) = seen[0], seen[-1]
    return (last - first) / (end - begin)


if __name__ == "__main__":
    sweeps()
