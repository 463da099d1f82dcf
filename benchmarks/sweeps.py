"""Sweeps beside the bare rollouts that they consist of, and engine beside engine, on the same runs."""

import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from fzcli.sweep.builds import Builds, rows_of
from fzcli.sweep.draws import candidates, sources
from fzcli.sweep.execute import Listener, Means, load_sweep, sweep_to
from fzcli.sweep.resolve import Sweep
from fzcli.sweep.trajectories import draw_trajectories, trial_builds

COUNT = 4000  # trajectories, by ten configurations
JOBS = 2


def sweeps() -> None:
    """Print runs a second, and what part of the bare rate that is."""
    bare = _bare()
    title = f"table2-small with {COUNT} trajectories, {JOBS} jobs"
    print(f"\n{title:58} {'runs/s':>10} {'of bare':>10}")
    print(f"{'bare rollouts, candidates of the filter included':58} {bare:10.0f} {1:10.2f}")
    means = {"threads": Means(JOBS, processes=False), "processes": Means(JOBS, processes=True)}
    if find_spec("distributed"):
        means["dask"] = Means(JOBS, dask="local")
    for name, how in means.items():
        rate = _rate(how)
        print(f"{name:58} {rate:10.0f} {rate / bare:10.2f}")


def _sweep() -> Sweep:
    found = load_sweep("table2-small", [f"trajectories.count={COUNT}"])
    if not isinstance(found, Sweep):
        raise TypeError("table2-small is a sweep of simulations")
    return found


def _bare() -> float:
    """Runs a second when everything is drawn before and nothing is written; best of three."""
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
    best = np.inf
    for _ in range(3):
        begin = time.perf_counter()
        for rows in work:
            rows.build.engine(record=False).run(rows.parameters, rows.steps, jobs=JOBS)
        best = min(best, time.perf_counter() - begin)
    return COUNT * len(sweep.specs) / best


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
