"""What comes of spheres first seen at step 8 of 20, and how long the answers take beside the step that there is.

Run by itself: python benchmarks/online.py [scenes a kind].
"""

import sys

import numpy as np
from online_scenes import Scenes

from fzcli.loop.execution import Execution, build_mission, execute

AHEAD = 10.0  # steps: contact from here on lies two or more steps ahead


def online(count: int = 100) -> None:
    """Follow plans among spheres that stand and that drift; print what came of it."""
    scenes = Scenes()
    print(f"\nRV-1A, one unknown sphere seen at step 8 of 20; {count} scenes that stand, {count} that drift")
    print(f"{'':10} {'solved':>10} {'of those met >= 2 steps ahead':>30} {'stopped':>8} {'contact':>8}")
    every = []
    for name, moving in (("standing", False), ("drifting", True)):
        drawn = [scenes.draw(i, moving) for i in range(count)]
        runs = [execute(build_mission(one.spec)) for one in drawn]
        solved = np.array([run.plan.status.name == "ok" for run in runs])
        ahead = np.array([one.contact >= AHEAD for one in drawn])
        stopped = sum(run.plan.status.name == "flagged" for run in runs)
        touched = sum(run.plan.status.name == "failed" for run in runs)
        share = f"{(solved & ahead).sum()} of {ahead.sum()} ({(solved & ahead).sum() / ahead.sum():.1%})"
        print(f"{name:10} {solved.sum():10} {share:>30} {stopped:8} {touched:8}")
        every += runs
    _report(every)


def _report(runs: list[Execution]) -> None:
    shares = np.array([event.seconds / run.step for run in runs for event in run.events])
    taken = np.array([event.seconds for run in runs for event in run.events])
    print(f"\n{'an answer':10} {'median':>10} {'95 %':>10} {'99 %':>10} {'longest':>10}")
    for name, values, unit in (("ms", 1e3 * taken, ""), ("of a step", 100 * shares, " %")):
        cells = [f"{value:.0f}{unit}" for value in (*np.quantile(values, [0.5, 0.95, 0.99]), values.max())]
        print(f"{name:10} " + " ".join(f"{cell:>10}" for cell in cells))
    print(f"within one step (T/20): {(shares <= 1).mean():.1%} of {len(shares)} answers (wanted: >= 99 %)")


if __name__ == "__main__":
    online(*(int(word) for word in sys.argv[1:]))
