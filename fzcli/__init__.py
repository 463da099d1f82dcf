"""fzcli: declarative, compiled and certified simulation of manipulators on free-floating bases.

The functions of this module are the whole Python interface; the command line uses exactly these.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

# The rooms `sweep` and `plan` share their names with functions of this module. Loading a submodule binds
# its name here, so both are loaded first (they are empty) and the functions below take the names for good.
import fzcli.plan
import fzcli.sweep  # noqa: F401

if TYPE_CHECKING:  # the heavy rooms load when a function needs them
    import casadi as ca

    from fzcli.learn.network_set import NetworkSet
    from fzcli.loop.rollout import Rollout
    from fzcli.model import RobotModel
    from fzcli.plan.plan import Plan
    from fzcli.record.sweep_record import SweepRecord
    from fzcli.spec.robot import Robot
    from fzcli.spec.rulebase import Rulebase

__version__ = "0.1.0"
__all__ = ["build_model", "build_surface", "load_robot", "load_rulebase", "plan", "simulate", "sweep", "train"]

Source = str | Path


def load_robot(source: Source) -> "Robot":
    """A robot by name or path (YAML or URDF). Raises SpecError with every problem of the file."""
    from fzcli.spec.load import load_robot as load

    return load(source)


def build_model(robot: "Robot") -> "RobotModel":
    """The frozen symbolic model of a robot: kinematics, momentum, generalized Jacobian."""
    from fzcli.model import build_model as build

    return build(robot)


def load_rulebase(source: Source) -> "Rulebase":
    """A rule base by name or path. Raises SpecError with every problem of the file."""
    from fzcli.spec.load import load_rulebase as load

    return load(source)


def build_surface(rulebase: "Rulebase") -> "ca.Function":
    """A rule base as one branch-free ca.Function with named inputs and outputs."""
    from fzcli.fuzzy.surface import build_surface as build

    return build(rulebase)


def simulate(
    run: Source, *, sets: Sequence[str] = (), output: Source | None = None, argv: Sequence[str] = ()
) -> "Rollout":
    """Run one simulation, and the variants that it is compared with (``rollout.variants``); or follow a plan.

    A plan (``kind: plan``) is made with what is known of its scene, and followed among the obstacles as they truly
    move: what is seen on the way is answered by a detour, or a stop. A section ``replay:`` has the motion followed at
    torque level; the motion itself is then a variant, "kinematic" or "plan".
    ``run`` is a path, a name, or "-" for standard input; ``sets`` are changes such as
    "controller.gain=100"; ``output`` is the HDF5 file to write, none by default.
    Raises SpecError for bad input; a run that fails is returned with its status and data.
    """
    from fzcli.loop.run_file import load_run, read_run
    from fzcli.loop.simulate import simulate_all
    from fzcli.record.rollout_file import write_rollout

    document = read_run(run)
    if isinstance(document.value, dict) and document.value.get("kind") == "plan":
        from fzcli.loop.execution import execute, mission_of
        from fzcli.loop.plan_replay import check_times, replay_of, replayed
        from fzcli.plan.load import with_sets
        from fzcli.record.execution_file import as_rollout

        mission = mission_of(document, sets)
        replay = replay_of(with_sets(document, sets), mission.known)
        execution = execute(mission, argv)
        if replay is not None:
            check_times(with_sets(document, sets), replay, execution.path.duration)
        rollout = as_rollout(execution)
        if replay is not None:
            rollout = replayed(mission, execution, replay, rollout, argv)
        if output is not None:
            write_rollout(rollout, output, "f8")
        return rollout
    spec, variants = load_run(document, sets)
    rollout = simulate_all(spec, variants, argv)
    if output is not None:
        write_rollout(rollout, output, spec.record.precision)
    return rollout


def sweep(
    run: Source,
    *,
    jobs: int | None = None,
    sets: Sequence[str] = (),
    output: Source | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    argv: Sequence[str] = (),
) -> "SweepRecord":
    """Run all configurations of a sweep on all its trajectories.

    ``jobs`` threads (all cores by default; results do not depend on it); ``progress(what, done,
    total)`` is called on the way; ``output`` is the HDF5 file to write, none by default: with it the sweep goes on
    where an earlier call was stopped, and the record's columns are read from the file when they are asked for.
    Raises SpecError for bad input; failed runs are rows with status 2.
    """
    from fzcli.sweep.execute import Listener, Means, load_sweep, run_sweep, sweep_to

    resolved = load_sweep(run, sets)
    if output is None:
        return run_sweep(resolved, jobs, progress, argv)
    from fzcli.record.sweep_file import read_sweep

    listener = Listener(progress) if progress else Listener()
    return read_sweep(sweep_to(resolved, Path(output), Means(jobs), listener, argv).path)


def plan(
    run: Source, *, sets: Sequence[str] = (), output: Source | None = None, argv: Sequence[str] = ()
) -> "Plan":
    """Plan a path from start to goal that keeps clear of a scene.

    ``run`` is a path, a name, or "-" for standard input; ``output`` is the HDF5 file to write, none by default.
    A plan that touches something (only the paper's procedure makes such) is returned as failed and not written.
    Raises SpecError for bad input, NoPlanError where no path is found.
    """
    from fzcli.loop.plan_replay import replay_of
    from fzcli.loop.run_file import read_run
    from fzcli.plan.load import make_plan, task_of, with_sets
    from fzcli.record.plan_file import write_plan

    document = with_sets(read_run(run), sets)
    task = task_of(document)
    replay_of(document, task)  # `simulate` alone uses it; what is wrong with it is told here, too
    found = make_plan(task, argv)
    if output is not None and found.status.name != "failed":
        write_plan(found, output)
    return found


def train(
    run: Source,
    *,
    sets: Sequence[str] = (),
    output: Source | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> "NetworkSet":
    """Train networks for a robot's kinematics, one a branch, and judge them on other poses.

    ``run`` is a path, a name, or "-" for standard input; ``progress(what, done, total)`` is called on the
    way; ``output`` is the npz file to write, none by default. ``found.kinematics_for(robot)`` has them ready for use.
    Raises SpecError for bad input, UsageError where scikit-learn is needed and not installed.
    """
    from fzcli.learn.store import save
    from fzcli.learn.train import load_train
    from fzcli.learn.train import train as run_training

    found = run_training(load_train(run, sets), progress)
    if output is not None:
        save(found, output)
    return found
