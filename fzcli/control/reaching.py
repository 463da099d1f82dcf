"""What the laws that bring a tip to a target share: spec fields, and how far the joints may turn in a period."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import casadi as ca
from pydantic import BeforeValidator, Field

from fzcli.control.aim import Aim
from fzcli.control.law import InnerLoop, Law, LawInputs, Misfit, make_law
from fzcli.control.restart import RestartSpec, with_restart
from fzcli.errors import Problem, SpecError
from fzcli.model import RobotModel
from fzcli.model.algebra import dot
from fzcli.model.chain import Chain, build_chain
from fzcli.model.tree import Tree, build_tree
from fzcli.spec.base import SpecModel
from fzcli.spec.quantity import Metric, Parameter, Signal
from fzcli.spec.robot import Robot

ReachTask = Literal["position", "approach", "pose"]


def _switch(value: Any) -> Any:
    """true stands for the defaults, false for nothing."""
    return ({} if value else None) if isinstance(value, bool) else value


class ReachingSpec(SpecModel):
    """Fields of every law of this family. A joint without a stated speed turns at most 0.2 rad a period."""

    kind: str
    task: Annotated[
        ReachTask, Field(description="position; position and direction of the tip's z; position and orientation")
    ] = "approach"
    tip: Annotated[str | None, Field(description="the tip that is to arrive; the first by default")] = None
    restart: Annotated[
        RestartSpec | None,
        BeforeValidator(_switch, json_schema_input_type=bool | RestartSpec | None),
        Field(description="on a stall, search a posture from which to arrive and drive there first; true: as usual"),
    ] = None

    @property
    def directed(self) -> bool:
        """Whether the tip's z is to have a direction."""
        return self.task != "position"


def step_bounds(model: RobotModel, q: ca.SX, cap: list[ca.SX] | float) -> tuple[list[ca.SX], list[ca.SX]]:
    """The least and the largest turn [rad] of every joint at q, by a cap and by the joint limits, n each."""
    caps = [ca.SX(cap)] * model.n if isinstance(cap, float) else cap
    low, high = [], []
    for i, (lower, upper) in enumerate(model.tree.position_limits):
        low.append(-caps[i] if lower == -float("inf") else ca.fmax(-caps[i], ca.fmin(float(lower) - q[i], 0)))
        high.append(caps[i] if upper == float("inf") else ca.fmin(caps[i], ca.fmax(float(upper) - q[i], 0)))
    return low, high


def period_caps(model: RobotModel, period: ca.SX, clamp: bool = True) -> list[ca.SX]:
    """How far every joint may turn in a period [rad], by its speed limit, or `UNSTATED` where it has none."""
    if not clamp:
        return [ca.SX(FREE)] * model.n
    return [float(speed) * period if speed < float("inf") else ca.SX(UNSTATED) for speed in model.tree.speed_limits]


FREE = 1.0e3  # rad: no limit
UNSTATED = 0.2  # rad: an arm without a stated speed must not jump to the target at once


def unsuited(tree: Tree, tip: str, spec: ReachingSpec) -> Iterator[Misfit]:
    """Where an arm's chain points, or the lack of them, do not do for the task."""
    try:
        chain = build_chain(tree, tip)
    except SpecError as error:
        yield ("robot",), f"{error.problems[0].message} (for controller {spec.kind!r})"
        return
    if spec.directed and not chain.approach:
        text = f"{spec.task!r} needs a tip whose z points along the last link; turn the tip's frame, or use 'position'"
        yield ("controller", "task"), text
    elif spec.task == "pose" and chain.free < 0:
        yield ("controller", "task"), "'pose' needs a last joint whose axis carries the tip, to roll it; use 'approach'"


def chain_misfits(robot: Robot, spec: ReachingSpec) -> Iterator[Misfit]:
    """Of a law that cannot do without chain points."""
    if spec.tip is None or spec.tip in robot.tips:
        yield from unsuited(build_tree(robot), spec.tip or next(iter(robot.tips)), spec)


def reaching_chain(model: RobotModel, spec: ReachingSpec) -> Chain:
    """The arm's chain points. Raises SpecError where it has none, or none that the task can do with."""
    problems = [
        Problem(text, field=".".join(path)) for path, text in unsuited(model.tree, spec.tip or model.tips[0], spec)
    ]
    if problems:
        raise SpecError(problems)
    return model.chain(spec.tip)


def free_turn(model: RobotModel, chain: Chain, q: ca.SX, aim: Aim) -> ca.SX:
    """What the free last joint has to turn [rad] so that the tip's x points as wanted, inside its limits."""
    turn = aim.roll * chain.free_sense
    low, high = (float(limit) for limit in model.tree.position_limits[chain.free])
    if high < float("inf"):
        turn = ca.if_else(q[chain.free] + turn > high, turn - 2 * ca.pi, turn)
    if low > -float("inf"):
        turn = ca.if_else(q[chain.free] + turn < low, turn + 2 * ca.pi, turn)
    return turn


def reaching_law(
    model: RobotModel,
    spec: ReachingSpec,
    inputs: LawInputs,
    aim: Aim,
    command: ca.SX,
    inner: tuple[InnerLoop, ca.SX] | None = None,
    parameters: dict[Parameter, ca.SX] | None = None,
) -> Law:
    """The Law of a command (n) [rad/s] that is held over the period, with its restart where it has one."""
    signals, metrics = _out_of_reach(model, spec, inputs, aim)
    around = None
    if spec.restart is not None:
        left = aim.angle if spec.directed else ca.SX(0)
        if spec.task == "pose":  # the roll may take longest, and no other posture would shorten it
            left = left + ca.fabs(free_turn(model, reaching_chain(model, spec), inputs.q, aim))
        caps = period_caps(model, inputs.period)
        around = with_restart(spec.restart, model, inputs, aim, left, caps, spec.directed, spec.tip, command)
        signals.update(around.signals)
        metrics += around.metrics
    return make_law(
        inputs,
        command=around.command if around else command,
        signals=signals,
        metrics=metrics,
        parameters=parameters or {},
        memory=around.memory if around else None,
        angles=False,
        held=True,
        inner=inner,
        search=around.search if around else None,
    )


def _out_of_reach(
    model: RobotModel, spec: ReachingSpec, inputs: LawInputs, aim: Aim
) -> tuple[dict[Signal, ca.SX], tuple[Metric, ...]]:
    """By how much the target is out of reach, at least; nothing for an arm whose reach is not known."""
    try:
        chain = model.chain(spec.tip)
    except SpecError:  # least squares need no chain points
        return {}, ()
    near, far = chain.reach
    away = aim.target
    if not model.floating:
        away = away - model.function("chain", spec.tip)(inputs.q)[0][:, 0]
    distance = ca.sqrt(dot(away, away))
    missing = ca.fmax(0, ca.fmax(near - distance, distance - far if far < float("inf") else 0))
    signal = Signal("out_of_reach", "m", "by which the target is out of the arm's reach, at least")
    return {signal: missing}, (Metric("out_of_reach_final", "out_of_reach", "last", "m", signal.long_name),)
