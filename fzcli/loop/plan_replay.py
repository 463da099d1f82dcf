"""A followed plan at torque level: its path is the motion that a torque controller follows, from 10 ms to 10 ms."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from pydantic import create_model

from fzcli.errors import SpecError
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.engine import Batch, VirtualMachine
from fzcli.loop.execution import Execution, Mission
from fzcli.loop.replay_spec import ReplaySpec, late_events, replay_misfits, replay_model
from fzcli.loop.rollout import Rollout
from fzcli.loop.run_spec import BoundsSpec
from fzcli.loop.simulate import rollouts
from fzcli.loop.torque_loop import with_replay
from fzcli.model import RobotModel
from fzcli.plan.load import origin_of
from fzcli.plan.planning import AnyTask, Task
from fzcli.plan.reference import TipReference
from fzcli.spec.base import SpecModel
from fzcli.spec.document import Document
from fzcli.spec.overlay import without
from fzcli.spec.parse import parse
from fzcli.spec.quantity import Parameter, Signal
from fzcli.spec.references import BESIDE

Array = NDArray[np.float64]
STEP = 0.01  # s, at the most: between two samples of the path
VARIANT = "plan"  # name of the plan beside its replay


@dataclass(frozen=True)
class PathMotion:
    """What `with_replay` is told of a plan: one step lasts ``dt`` [s], the base starts at rest."""

    model: RobotModel
    dt: float
    tip: str | None = None
    drifting: bool = False
    reference: TipReference | None = None


def replay_of(document: Document, task: AnyTask) -> ReplaySpec | None:
    """The section ``replay:`` of a plan to be made, None without one. Raises SpecError with every problem found."""
    if not isinstance(document.value, dict) or document.value.get("replay") is None:
        return None
    others = set(document.value) - {"replay"}
    section = create_model("Section", __base__=SpecModel, replay=(replay_model(), ...))
    spec: ReplaySpec = parse(without(document, others), section, context={BESIDE: document.path}).value_at("replay")
    if not isinstance(task, Task):
        raise SpecError(document.problem("a parallel robot has no dynamics here", ("replay",), at_key=True))
    misfits = replay_misfits(task.model.robot, spec)
    problems = [document.problem(text, ("replay", *path)) for path, text in misfits]
    if problems:
        raise SpecError(problems)
    return spec


def check_times(document: Document, spec: ReplaySpec, end: float) -> None:
    """Raises SpecError where something is to begin after the plan's ``end`` [s], which is known when it is made."""
    problems = [document.problem(text, ("replay", *path)) for path, text in late_events(spec, end)]
    if problems:
        raise SpecError(problems)


def replayed(
    mission: Mission, execution: Execution, spec: ReplaySpec, plan: Rollout, argv: Sequence[str] = ()
) -> Rollout:
    """The torque-level run that follows an executed plan, ``plan`` (as a rollout) beside it.

    ``clearance`` is that of the arm as it truly moves, at the samples. Raises IntegrationError by name where the
    adaptive integrator gives up.
    """
    task, path = mission.known, execution.path
    if not isinstance(task, Task):
        raise TypeError("a plan of another kind of robot")
    steps = max(1, math.ceil(path.duration / STEP - 1e-9))
    times = np.linspace(0.0, path.duration, steps + 1)
    position, quats = task.world.base(path, times)
    samples = np.hstack([path.at(times)[0], quats])
    motion = PathMotion(task.model, path.duration / steps)
    loop = with_replay(_path_loop(motion), motion, spec, record=True)
    start = {"start.q": samples[0, : task.model.n], "start.base_quat": quats[0], "start.base_position": position[0]}
    row = _parameters(loop, spec, start)
    engine = VirtualMachine(loop)
    batch = _driven(loop, row, samples)
    origin = replace(origin_of(mission.spec, argv), engine=engine.name)
    run = rollouts(engine, batch, [BoundsSpec()], [origin])[0]
    return replace(_with_clearance(run, task), variants={VARIANT: plan})


def _path_loop(motion: PathMotion) -> ClosedLoop:
    """A loop whose next sample is put into its state before every step, behind the present one."""
    n, size = motion.model.n, motion.model.n + 4
    state, none = ca.SX.sym("state", 2 * size), ca.SX.sym("none", 0)
    given = ca.SX.sym("parameters", n + 7)
    first = given[:size]
    known = {"state": state, "constants": none}
    return ClosedLoop(
        initial=ca.Function("initial", [given], [ca.vertcat(first, first), ca.SX(0, 1)]),
        step=ca.Function(
            "path_step",
            [*known.values(), ca.SX.sym("history", 0)],
            [ca.vertcat(state[size:], state[size:]), ca.SX(0, 1), ca.SX.zeros(1), ca.SX(0, 1)],
            [*known, "history"],
            ["state_next", "samples", "stop", "signals"],
        ),
        finish=ca.Function("finish", list(known.values()), [ca.SX(0, 1)], list(known), ["metrics"]),
        duration=ca.Function("duration", [given], [ca.SX(math.inf)]),
        parameters=(Parameter("start.q", n), Parameter("start.base_quat", 4), Parameter("start.base_position", 3)),
        signals=(),
        metrics=(),
        certificate_names=(),
        history_length=0,
        dt=motion.dt,
        joint_units=tuple("m" if body.prismatic else "rad" for body in motion.model.tree.bodies),
    )


def _parameters(loop: ClosedLoop, spec: ReplaySpec, start: dict[str, Array]) -> Array:
    """One row of the loop's parameters."""
    row = []
    for parameter in loop.parameters:
        value = start.get(parameter.path)
        if value is None:
            value = np.asarray(spec.value_at(parameter.path.removeprefix("replay.")), dtype=float).ravel()
        row.append(np.broadcast_to(value, parameter.size))
    return np.concatenate(row)


def _driven(loop: ClosedLoop, row: Array, samples: Array) -> Batch:
    """The loop stepped along the samples (T, n + 4) of the path."""
    state, constants = (np.array(value) for value in loop.initial(row))
    size, last, none = samples.shape[1], len(samples) - 1, np.zeros((0, 1))
    record = np.full((1, last + 1, loop.step.size1_out("signals")), np.nan)
    end, stop = last, 0
    for k in range(last + 1):
        state[size : 2 * size, 0] = samples[min(k + 1, last)]
        found, _, code, signals = loop.step(state, constants, none)
        state, record[0, k] = np.array(found), np.array(signals)[:, 0]
        stop = int(code)
        if stop:
            end = k
            break
    if loop.adaptive is not None and loop.adaptive.refusal is not None:
        raise loop.adaptive.refusal
    metrics = np.array(loop.finish(state, constants)).T
    return Batch(metrics, np.array([end]), np.array([stop]), record, state.T)


def _with_clearance(run: Rollout, task: Task) -> Rollout:
    """With the distances of the arm as it truly moved among the obstacles."""
    world = task.world
    distances = world.clearance.at(run.q, world.scene.numbers(run.time), run.base_position, run.base_quat)
    clearance = distances.min(axis=1, initial=np.inf)
    about = Signal("clearance", "m", "smallest distance of all pairs of solids")
    least = Signal("clearance_min", "m", "smallest distance met, at the samples")
    return replace(
        run,
        signals={**run.signals, about.name: clearance},
        signal_info={**run.signal_info, about.name: about},
        metrics={**run.metrics, least.name: float(clearance.min())},
        metric_info={**run.metric_info, least.name: least},
        certificate={**run.certificate, least.name: float(clearance.min())},
    )
