"""What the laws built on equation 1 of Bulgarelli 2011 share: spec fields, task, measurement.

qd = J+ (Kp e + xd_d) + (E - J+ J) Jc^T Kc ec, with J+ = J^T (J J^T + damping E)^-1 everywhere.
"""

from dataclasses import dataclass
from typing import Annotated

import casadi as ca
from pydantic import Field, field_validator

from fzcli.control.constraint import (
    Constraint,
    ConstraintName,
    components,
    constraint_of,
    virtual_joint_rates,
)
from fzcli.control.law import Law, LawInputs, make_law
from fzcli.control.oscillation import Oscillation, OscillationSpec, detect, memory0
from fzcli.control.task import TASK_ROWS, Body, Task, TaskName, body_at, task_of
from fzcli.model import RobotModel
from fzcli.model.algebra import smallest_singular_value
from fzcli.spec.base import SpecModel
from fzcli.spec.quantity import Metric, Parameter, Signal
from fzcli.spec.units import Frequency

CONDITIONING = Signal("conditioning", "1/m2", "trace of (J J^T + damping E)^-1, the task's Jacobian J")


class Equation1Spec(SpecModel):
    """Fields of every law of this family."""

    task: TaskName = "position"
    tip: Annotated[str | None, Field(description="the tip that the task speaks of; the first by default")] = None
    kp: Annotated[Frequency, Field(gt=0, description="gain of the primary task, 1/s")] = 3.2
    damping: Annotated[float, Field(ge=0, description="lambda squared in J^T (J J^T + damping E)^-1")] = 1e-8
    constraint: Annotated[
        tuple[ConstraintName, ...],
        Field(min_length=1, description="base angles held: any of roll, pitch, yaw; or rotation_vector"),
    ] = ("yaw",)
    oscillation: OscillationSpec = OscillationSpec()

    @field_validator("constraint")
    @classmethod
    def _distinct(cls, names: tuple[ConstraintName, ...]) -> tuple[ConstraintName, ...]:
        if len(set(names)) != len(names):
            raise ValueError("an angle stands twice")
        if "rotation_vector" in names and len(names) > 1:
            raise ValueError("rotation_vector holds all three axes; it stands alone")
        return names

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the constraint's components."""
        return components(self.constraint)


@dataclass(frozen=True)
class Situation:
    """All that a law of the family starts from at one step."""

    model: RobotModel
    spec: Equation1Spec
    inputs: LawInputs
    body: Body
    task: Task
    constraint: Constraint


def situation(model: RobotModel, spec: Equation1Spec) -> Situation:
    """Symbols, task and constraint of a law, ready for its gain."""
    inputs = LawInputs.symbols(model.n)
    body = body_at(model, inputs)
    task = task_of(model, inputs, body, spec.task, spec.damping, spec.tip)
    return Situation(model, spec, inputs, body, task, constraint_of(inputs, body, spec.constraint))


@dataclass(frozen=True)
class Detector:
    """The oscillation detector inside a law: its symbols, next memory and count (1)."""

    memory: ca.SX
    history: ca.SX
    velocity: ca.SX
    result: Oscillation


def detector(at: Situation, qd: ca.SX) -> Detector:
    """Watch all joints, the arm's and the base's virtual ones, for oscillation."""
    rate = at.body.angular_velocity(qd)
    velocity = ca.vertcat(qd, virtual_joint_rates(at.body, qd, rate, at.spec.constraint))
    size = velocity.shape[0]
    memory, history = ca.SX.sym("oscillation", 3 * size), ca.SX.sym("history", size)
    result = detect(at.spec.oscillation, velocity, history, memory, at.inputs.step)
    return Detector(memory, history, velocity, result)


def finish(
    at: Situation,
    qd: ca.SX,
    watch: Detector,
    parameters: dict[Parameter, ca.SX],
    signals: dict[Signal, ca.SX],
    metrics: tuple[Metric, ...] = (),
    memory: tuple[ca.SX, ca.SX, ca.SX] | None = None,
) -> Law:
    """The Law: the family's own signals and metrics, with a law's additions behind them.

    ``memory``: symbol, next and first value of a law's own memory, beside the detector's.
    """
    unit = "rad" if at.spec.task == "orientation" else "m"
    shared = {
        Signal("tip_error", unit, "norm of the tip's error"): at.task.error_norm,
        Signal("oscillating_joints", "1", "joints, arm and virtual, that oscillate"): watch.result.count,
        CONDITIONING: at.task.inverse_trace,
        **at.constraint.signals(),
    }
    common: tuple[Metric, ...] = (
        Metric("tip_error_mean", "tip_error", "mean", unit, "mean norm of the tip's error"),
        Metric("tip_error_max", "tip_error", "max", unit, "largest norm of the tip's error"),
        *at.constraint.metrics(),
        Metric("oscillating_joints_mean", "oscillating_joints", "mean", "1", "oscillating joints a step"),
    )
    if at.task.angle_norm is not None:
        shared[Signal("tip_angle_error", "rad", "angle of the tip's orientation error")] = at.task.angle_norm
        common += (
            Metric("tip_angle_error_mean", "tip_angle_error", "mean", "rad", "mean angle of the tip's error"),
            Metric("tip_angle_error_max", "tip_angle_error", "max", "rad", "largest angle of the tip's error"),
        )
    own = memory or (ca.SX(0, 1), ca.SX(0, 1), ca.SX(0, 1))
    return make_law(
        at.inputs,
        command=qd,
        signals={**shared, **signals},
        metrics=(*common, *metrics),
        parameters=parameters,
        memory=(
            ca.vertcat(watch.memory, own[0]),
            ca.vertcat(watch.result.memory, own[1]),
            ca.vertcat(memory0(watch.velocity.shape[0]), own[2]),
        ),
        history=(watch.history, watch.velocity),
        history_length=at.spec.oscillation.average - 1,
        angles=at.spec.constraint != ("rotation_vector",),
        conditioning=CONDITIONING.name,
        singular_value=_singular_value(at),
    )


def _singular_value(at: Situation) -> ca.Function:
    """q -> smallest singular value of the task's Jacobian, the same in any axes."""
    q = ca.SX.sym("q", at.model.n)
    jacobian = at.model.function("tip", at.spec.tip)(q)[2][TASK_ROWS[at.spec.task], :]
    return ca.Function("singular_value", [q], ca.cse([smallest_singular_value(jacobian)]))
