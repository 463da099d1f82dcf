"""All speed figures in one run, printed as ratios: ``make bench``.

Every figure is a median over rounds in which the contestants take turns, so that a machine whose
speed drifts slows all of them alike. Needs a C compiler, Pinocchio and pyfuzzylite; pink, the Robotics
Toolbox, TRAC-IK and OMPL are measured where they are installed.
"""

import itertools
import os
import statistics
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import numpy as np
import scripted_loop
from casadi_c import CasadiC
from inverse import inverse
from online import online
from plain_formulation import first_state, line_parameters, plain_loop
from planning import planning
from reaching import reaching
from rounds import Contestant, take_turns
from sweeps import sweeps
from torque import torque_level

import fzcli
from fzcli.loop.assemble import closed_loop, parameter_row
from fzcli.loop.compiler import find_compiler, host_isa
from fzcli.loop.engine import CompiledEngine, VirtualMachine
from fzcli.loop.run_file import run_of
from fzcli.loop.stepper import Stepper
from fzcli.model.tree import build_tree
from fzcli.spec.reader import read_text

ISAS = ("baseline", "avx2", "avx512")
STEPS = 1200
Q0, DIRECTION, LENGTH, DURATION = np.array([0.928, -1.393, 0.303, 0.549]), np.array([1.0, 0.0, 0.0]), 0.5, 12.0
RUN = """
kind: simulate
robot: bulgarelli4
start: {q: [0.928, -1.393, 0.303, 0.549]}
reference: {kind: line, direction: [1, 0, 0], length: 0.5 m, duration: 12 s}
controller: {kind: fuzzy_clik, gain: 10, rulebase: bulgarelli2011}
"""


def main() -> None:
    """Measure and print everything."""
    compiler = find_compiler()
    if compiler is None:
        sys.exit("the benchmarks need a C compiler")
    print(f"host: {host_isa()}, {os.cpu_count()} cores; {compiler.identity.splitlines()[0]}")
    steps()
    reaching()
    sweeps()
    inverse()
    planning()
    online()
    torque_level()
    whole_processes()


def steps() -> None:
    """Nanoseconds a simulated closed-loop step and core: Table 2's loop with the tuner."""
    spec = run_of(read_text(RUN))
    loop = closed_loop(spec, record=False)
    row = parameter_row(spec, loop.parameters)[None, :]
    tree = build_tree(fzcli.load_robot("bulgarelli4"))
    plain = plain_loop(tree, fzcli.load_rulebase("bulgarelli2011"))
    start = first_state(plain, tree, Q0, 10.0)
    parameters = line_parameters(tree, Q0, DIRECTION, LENGTH, DURATION)
    casadi_c = CasadiC(plain, find_compiler().command[0])
    machine = plain.step.mapaccum(200)
    repeated = np.tile(parameters[:, None], (1, 200))
    stepper = Stepper(spec)
    _agree(casadi_c.drive(start, parameters, 1, STEPS), VirtualMachine(loop), row)
    contestants: dict[str, Contestant] = {
        "scripted loop (pin + NumPy + pyfuzzylite)": (_scripted, 100),
        "CasADi VM, plain formulation": (lambda: machine(start, repeated), 200),
        "CasADi C, plain formulation, -O3 -march=native": (lambda: casadi_c.drive(start, parameters, 10, STEPS), 12000),
        "ours, one step called from Python": (lambda: _walk(stepper), STEPS),
    }
    for isa in ISAS[: ISAS.index(host_isa()) + 1]:
        engine = CompiledEngine(loop, lanes=1 if isa == "baseline" else None, isa=isa)
        contestants[f"ours, {engine.lanes} lanes ({isa}), 1 thread"] = _compiled(engine, row, 1)
    contestants[f"ours, {engine.lanes} lanes ({engine.isa}), 2 threads together"] = _compiled(engine, row, 2)
    print(f"plain formulation: {plain.step.n_instructions()} instructions, ours: {loop.step.n_instructions()}")
    print(f"scripted loop: pin {version('pin')}, pyfuzzylite {version('pyfuzzylite')}, numpy {version('numpy')}")
    _report(take_turns(contestants))


def _agree(plain_error: float, machine: VirtualMachine, row: np.ndarray) -> None:
    """The baselines must compute the same thing as ours before they are timed."""
    ours = float(machine.run(row, np.array([STEPS - 1])).metrics[0, 0])
    if abs(plain_error - ours) > 1e-6 * ours:
        sys.exit(f"the plain formulation disagrees: mean tip error {plain_error!r}, ours {ours!r}")


def _scripted() -> None:
    scripted_loop.run(Q0, DIRECTION, LENGTH, DURATION, 10.0, steps=100)


def _walk(stepper: Stepper) -> None:
    stepper.reset()
    step = stepper.step
    for _ in range(STEPS):
        step()


def _compiled(engine: CompiledEngine, row: np.ndarray, jobs: int) -> Contestant:
    runs = 512 * engine.lanes
    rows, counts = np.tile(row, (runs, 1)), np.full(runs, STEPS - 1)
    return (lambda: engine.run(rows, counts, jobs=jobs)), runs * STEPS


def _report(found: dict[str, list[float]]) -> None:
    fastest = next(name for name in reversed(found) if "1 thread" in name)
    print(f"\n{'ns a simulated step':58} {'median':>10} {'best':>10} {'times widest':>14}")
    for name, times in found.items():
        ratio = statistics.median(a / b for a, b in zip(times, found[fastest], strict=True))
        print(f"{name:58} {statistics.median(times):10,.1f} {min(times):10,.1f} {ratio:14,.2f}")


def whole_processes() -> None:
    """Whole commands: seconds of wall time and peak memory."""
    print(f"\n{'whole process':58} {'seconds':>10} {'peak MB':>10}")
    with tempfile.TemporaryDirectory() as folder:
        cold = {"FZCLI_CACHE_DIR": str(Path(folder) / "cache")}
        outputs = (["-o", str(Path(folder) / f"{i}.h5")] for i in itertools.count())  # each sweep anew
        _print("fzcli --help", [_command(["--help"]) for _ in range(5)])
        cold_start = _command(["sweep", "table2", *next(outputs)], cold)
        _print("fzcli sweep table2 (10,000 runs), with compilation", [cold_start])
        warm = [_command(["sweep", "table2", *next(outputs)], cold) for _ in range(5)]
        _print("fzcli sweep table2 (10,000 runs), warm", warm)
        done = ["sweep", "table2", "-o", str(Path(folder) / "1.h5")]
        _print("the same again: finished before", [_command(done, cold) for _ in range(5)])
        for count in (10_000, 100_000):
            large = ["sweep", "table2", "--set", f"trajectories.count={count}", "--set", "expect_failures=true"]
            _print(f"fzcli sweep table2, {10 * count:,} runs, warm", [_command([*large, *next(outputs)], cold)])


def _command(words: list[str], environment: dict[str, str] | None = None) -> tuple[float, float]:
    """Wall seconds and peak memory [MB] of one fzcli process."""
    code = (
        "import resource, subprocess, sys, time\n"
        "before = time.perf_counter()\n"
        "done = subprocess.run([sys.executable, '-m', 'fzcli', *sys.argv[1:]],"
        " stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)\n"
        "print(time.perf_counter() - before, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1000)\n"
        "sys.exit(done.returncode)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        capture_output=True,
        text=True,
        env={**os.environ, **(environment or {})},
    )
    if done.returncode:
        sys.exit(f"fzcli {' '.join(words)} ended with {done.returncode}")
    seconds, memory = done.stdout.split()
    return float(seconds), float(memory)


def _print(name: str, rows: list[tuple[float, float]]) -> None:
    seconds = statistics.median(row[0] for row in rows)
    print(f"{name:58} {seconds:10.2f} {max(row[1] for row in rows):10.0f}")


if __name__ == "__main__":
    main()
