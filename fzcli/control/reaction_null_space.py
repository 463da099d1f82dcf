"""Reaction null space: the arm moves only in ways that leave the base's attitude alone; the tip gets what is left."""

from collections.abc import Iterator
from typing import Annotated, Literal

import casadi as ca
from pydantic import Field

from fzcli.control.constraint import ConstraintName
from fzcli.control.equation1 import Equation1Spec, detector, finish, situation
from fzcli.control.law import Law, Misfit
from fzcli.model import RobotModel
from fzcli.model.algebra import gram, symmetric_inverse
from fzcli.spec.quantity import Parameter
from fzcli.spec.robot import Robot
from fzcli.spec.units import Frequency

REGULAR = 1e-12  # beside the base's rows, which are regular wherever the arm can turn the base about all their axes


class ReactionNullSpaceSpec(Equation1Spec):
    """qd = Jc+ (base_gain ec + rate) + N (J N)+ (Kp e + xd_d - J Jc+ ...), N = E - Jc+ Jc: no reaction on the base."""

    kind: Literal["reaction_null_space"] = "reaction_null_space"
    constraint: Annotated[
        tuple[ConstraintName, ...],
        Field(min_length=1, description="base angles left alone: rotation_vector, or any of roll, pitch, yaw"),
    ] = ("rotation_vector",)
    base_gain: Annotated[
        Frequency, Field(ge=0, description="at which errors of those angles die out; 0: none is corrected")
    ] = 0.0
    damping: Annotated[
        float, Field(ge=0, description="lambda squared of the tip's pseudo-inverse in what the base leaves free")
    ] = 1e-6


def build(model: RobotModel, spec: ReactionNullSpaceSpec) -> Law:
    """Nenchev and Yoshida 1999: the base's rows come first, the tip's second."""
    at = situation(model, spec)
    kp, base_gain = ca.SX.sym("kp"), ca.SX.sym("base_gain")
    rows, J = at.constraint.rows, at.task.jacobian
    inverse = ca.mtimes(rows.T, symmetric_inverse(gram(rows) + REGULAR * ca.SX.eye(rows.shape[0])))
    first = ca.mtimes(inverse, base_gain * at.constraint.error + at.constraint.rate)
    free = ca.SX.eye(model.n) - ca.mtimes(inverse, rows)
    own = ca.mtimes(J, free)
    wanted = kp * at.task.error + at.task.rate - ca.mtimes(J, first)
    solved = ca.mtimes(symmetric_inverse(gram(own) + spec.damping * ca.SX.eye(J.shape[0])), wanted)
    qd = first + ca.mtimes(free, ca.mtimes(own.T, solved))  # free once more: what rounding and REGULAR leak, squared
    parameters = {Parameter("controller.kp"): kp, Parameter("controller.base_gain"): base_gain}
    return finish(at, qd, detector(at, qd), parameters, {})


def misfits(robot: Robot, spec: ReactionNullSpaceSpec) -> Iterator[Misfit]:
    """Where the law does not suit the robot: it needs a free base, and joints beyond those that hold it."""
    joints = sum(link.joint.type != "fixed" for link in robot.links)
    axes = len(spec.axes)
    if not robot.base.floating:
        yield ("controller", "kind"), "a fixed base feels no reaction; take another kind"
    elif joints <= axes:
        text = f"holds {axes} base angles with {joints} joints, which leaves none for the tip; name fewer"
        yield ("controller", "constraint"), text
