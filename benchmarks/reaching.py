"""What a control period of the reaching laws costs, and a whole reach: a UR5 on a free base of 100 kg.

A period is the law, the base's motion (two-node Gauss-Magnus), and the reductions of metrics and certificate.
"""

import os
import statistics
from typing import Any

import numpy as np
from numpy.typing import NDArray
from reaching_peers import STEPS as WALK
from reaching_peers import Pink, Toolbox, arrived, check_kinematics
from rounds import Contestant, take_turns

import fzcli
from fzcli.loop.assemble import closed_loop, parameter_row
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.compiler import host_isa
from fzcli.loop.engine import CompiledEngine, VirtualMachine
from fzcli.loop.run_file import run_of
from fzcli.loop.run_spec import SimulateRun
from fzcli.loop.stepper import Stepper
from fzcli.model.tree import build_tree
from fzcli.spec.reader import read_text
from fzcli.sweep.builds import Builds, rows_of
from fzcli.sweep.execute import load_sweep
from fzcli.sweep.trajectories import draw_trajectories

Array = NDArray[np.float64]
LANES = {"avx2": 4, "avx512": 8}
STEPS = 200
HOME = np.radians([0.0, -90.0, -90.0, -90.0, 90.0, 0.0])
LAWS = {  # name: controller, most nanoseconds a period that are wanted with one lane, and over lanes
    "fabrik n10": ("{kind: fabrik, variant: n10}", 10_000, 1_500),
    "fabrik n1": ("{kind: fabrik, variant: n1}", None, None),
    "dls": ("{kind: dls}", 1_000, 150),
}
RUN = """
kind: simulate
robot: ur5_free_flyer
start: {{q: [0, -90 deg, -90 deg, -90 deg, 90 deg, 0]}}
reference: {{kind: reachable, displacement: [0.9, -0.7, 0.8, 0.5, -0.6, 0.4]}}
controller: {controller}
step: 10 ms
method: gauss_magnus
duration: 2 s
"""


def reaching() -> None:
    """Measure and print periods, then whole reaches."""
    tree, fixed = build_tree(fzcli.load_robot("ur5")), fzcli.build_model(fzcli.load_robot("ur5"))
    peers = []
    for kind in (Pink, Toolbox):
        try:
            peers.append(kind(tree))
        except ImportError as error:
            print(f"left out: {kind.__name__.lower()} ({error})")
    for peer in peers:
        check_kinematics(peer, fixed)
    periods(next((peer for peer in peers if isinstance(peer, Pink)), None))
    reaches(next((peer for peer in peers if isinstance(peer, Toolbox)), None))


def periods(pink: Pink | None) -> None:
    """Nanoseconds a control period and core."""
    contestants: dict[str, Contestant] = {}
    wanted: dict[str, int | None] = {}
    for name, (controller, alone, side_by_side) in LAWS.items():
        spec = run_of(read_text(RUN.format(controller=controller)))
        for way, contestant in _ways(spec).items():
            contestants[f"{name}, {way}"] = contestant
            wanted[f"{name}, {way}"] = side_by_side if " lanes " in way else alone if "1 lane " in way else None
    if pink is not None:
        goal = pink.pose(HOME + np.array([0.4, 0.3, -0.3, 0.2, -0.2, 0.3]))
        if not arrived(pink.pose(pink.walk(HOME, goal)), goal):
            raise SystemExit(f"{pink.name}: does not arrive in {WALK} steps")
        contestants[pink.name] = ((lambda: pink.walk(HOME, goal)), WALK)
    found = take_turns(contestants)
    print(f"\nload {os.getloadavg()[0]:.1f}; UR5 on a free base, two-node Gauss-Magnus, {STEPS} periods a run")
    print(f"{'ns a control period':58} {'median':>10} {'best':>10} {'wanted':>14}")
    for name, times in found.items():
        limit = wanted.get(name)
        print(f"{name:58} {statistics.median(times):10,.0f} {min(times):10,.0f} {f'<= {limit:,}' if limit else '':>14}")


def _ways(spec: SimulateRun) -> dict[str, Contestant]:
    """One law run in every way."""
    loop = closed_loop(spec, record=False)
    row = parameter_row(spec, loop.parameters)
    _check(loop, row)
    state, constants = loop.initial(row)
    walk = loop.step.mapaccum(STEPS)
    history = np.zeros((loop.step.size1_in("history"), STEPS))
    repeated = np.tile(np.array(constants), (1, STEPS))
    stepper = Stepper(spec)
    ways: dict[str, Contestant] = {
        "CasADi VM": ((lambda: walk(state, repeated, history)), STEPS),
        "one step called from Python": ((lambda: _step_through(stepper)), STEPS),
    }
    host = host_isa()
    for isa in dict.fromkeys(("baseline", host)):
        ways[f"1 lane ({isa}), 1 thread"] = _compiled(CompiledEngine(loop, lanes=1, isa=isa), loop, row, 1)
    if host not in LANES:
        return ways
    for isa in list(LANES)[: list(LANES).index(host) + 1]:
        engine = CompiledEngine(loop, isa=isa)
        ways[f"{engine.lanes} lanes ({isa}), 1 thread"] = _compiled(engine, loop, row, 1)
    ways[f"{engine.lanes} lanes ({isa}), 2 threads together"] = _compiled(engine, loop, row, 2)
    return ways


def _check(loop: ClosedLoop, row: Array) -> None:
    """The law must arrive, and compiled code and virtual machine must agree before they are timed."""
    counts = np.array([STEPS])
    engines = (CompiledEngine(loop), VirtualMachine(loop))
    fast, slow = (engine.run(row[None, :], counts).metrics[0] for engine in engines)
    names = [metric.name for metric in loop.metrics]
    if not np.allclose(fast, slow, rtol=1e-6, atol=1e-9):
        worst = names[int(np.argmax(np.abs(fast - slow)))]
        raise SystemExit(f"compiled code and virtual machine disagree: {worst}")
    left = fast[names.index("target_distance_final")]
    if not left < 0.01:
        raise SystemExit(f"the run ends {left:.3g} m from its target")


def _step_through(stepper: Stepper) -> None:
    stepper.reset()
    step = stepper.step
    for _ in range(STEPS):
        step()


def _compiled(engine: CompiledEngine, loop: ClosedLoop, row: Array, jobs: int) -> Contestant:
    """Runs to targets all about."""
    runs, place = 128 * engine.lanes, 0
    rows, counts = np.tile(row, (runs, 1)), np.full(runs, STEPS - 1)
    for parameter in loop.parameters:
        if parameter.path == "reference.displacement":
            drawn = np.random.default_rng(2022).uniform(-np.pi, np.pi, (runs, parameter.size))
            rows[:, place : place + parameter.size] = drawn
        place += parameter.size
    return (lambda: engine.run(rows, counts, jobs=jobs)), runs * STEPS


def reaches(toolbox: Toolbox | None) -> None:
    """Microseconds a pose: whole runs of the sweep fabrik_random, beside a solve for the posture alone."""
    sweep, builds = load_sweep("fabrik_random"), Builds()
    spec = next(spec for spec in sweep.specs if _swept(spec.controller))
    drawn = draw_trajectories(sweep, builds, range(sweep.file.trajectories.count)).values
    rows = rows_of(builds, spec, sweep.draws, drawn, np.arange(len(drawn)))[0]
    engine = rows.build.engine(record=False)
    names = [metric.name for metric in rows.build.loop.metrics]
    metrics = engine.run(rows.parameters, rows.steps).metrics
    there = metrics[:, names.index("arrived")] == 1
    seconds = np.median(metrics[there, names.index("arrival_time")])
    contestants: dict[str, Contestant] = {}
    reached: dict[str, int] = {}
    for jobs in (1, 2):
        name = f"fabrik n10 with restart, whole run, {jobs} thread{'s together' if jobs > 1 else ''}"
        contestants[name] = ((lambda jobs=jobs: engine.run(rows.parameters, rows.steps, jobs=jobs)), len(drawn))
        reached[name] = int(there.sum())
    if toolbox is not None:
        goals = [toolbox.pose(HOME + displacement) for displacement in drawn]
        postures = toolbox.solve(HOME, goals)
        contestants[toolbox.name] = ((lambda: toolbox.solve(HOME, goals)), len(goals))
        reached[toolbox.name] = sum(
            q is not None and arrived(toolbox.pose(q), goal) for q, goal in zip(postures, goals, strict=True)
        )
    found = take_turns(contestants)
    print(f"\n{len(drawn)} poses of fabrik_random; ours is the whole motion, in the median {seconds:.2f} s long")
    print(f"{'us a pose':58} {'median':>10} {'best':>10} {'reached':>14}")
    for name, times in found.items():
        print(f"{name:58} {statistics.median(times) / 1e3:10,.1f} {min(times) / 1e3:10,.1f} {reached[name]:14}")


def _swept(controller: Any) -> bool:
    """n10 with a restart on a stall alone."""
    kind = (controller.kind, getattr(controller, "variant", ""))
    return kind == ("fabrik", "n10") and controller.restart is not None and not controller.restart.at_start


if __name__ == "__main__":
    reaching()
