"""What torques and outer forces do: accelerations on a free or fixed base, and the jump at a grasp.

A base under attitude control is a free one on which thrusters (``base_wrench``) or wheels act.
"""

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from fzcli.errors import Problem, SpecError
from fzcli.model.algebra import cross, rotate, symmetric_solve
from fzcli.model.balance import (
    Bias,
    Momenta,
    base_acceleration,
    build_bias,
    drift,
    joint_inertia,
    joint_share,
    moved_to_com,
    tip_place,
)
from fzcli.model.dynamics import Symbols, friction_torque, outer_forces, tip_twist
from fzcli.model.newton_euler import Motion, Wrench
from fzcli.model.payload import about_tip
from fzcli.model.tree import TipFrame

if TYPE_CHECKING:
    from fzcli.model.robot_model import RobotModel

_SINGULAR = 1e-12  # smallest over largest eigenvalue of the joints' inertia


def check_inertia(model: "RobotModel") -> None:
    """Refuse a robot with a joint that moves no inertia: torques would accelerate it without bound.

    Raises:
        SpecError: the joints' inertia is singular whatever the posture; names the joint and its link.
    """
    for start in (0.3, 1.1):
        posture = start + 0.7 * np.arange(model.n)
        values, vectors = np.linalg.eigh(np.array(model.generalized_inertia(posture)))
        if values[0] > _SINGULAR * values[-1]:
            return
    joint = model.joint_names[int(np.argmax(np.abs(vectors[:, 0])))]
    link = next(link.name for link in model.robot.links if link.joint.name == joint)
    raise SpecError(
        Problem(
            f"joint {joint!r} moves no inertia, so that no torque has a finite effect on it; "
            f"give link {link!r} a mass and an inertia, or make the joint fixed",
            field="links",
        )
    )


def _base_in_world(its: Symbols, momenta: Momenta, bias: Bias, at_com: Wrench, qdd: ca.SX) -> ca.SX:
    motion = base_acceleration(momenta, bias, at_com, qdd)
    return its.in_world(motion.linear, motion.angular)


def joint_acceleration(
    momenta: Momenta, bias: Bias, qd: ca.SX, torque: ca.SX, at_com: Wrench, share: ca.SX
) -> ca.SX:
    """qdd (n) under motor torques (n), with friction; ``at_com``, ``share`` as of `balance.drift`."""
    driving = torque - friction_torque(momenta.tree.friction, qd)
    beside = drift(momenta, bias, at_com, share)
    return symmetric_solve(joint_inertia(momenta, momenta.tree.floating), driving - beside)


def _forward_dynamics(model: "RobotModel", tip: str) -> ca.Function:
    """qdd (n), base_acceleration (6) under motor torques and wrenches on base and tip."""
    check_inertia(model)
    its = Symbols(model, tip)
    momenta = its.momenta()
    bias = build_bias(momenta, its.parts, its.q, its.qd, its.in_base("base_twist")[1])
    at_com, on_tip = outer_forces(its, momenta)
    share = joint_share(momenta, its.tip, on_tip)
    qdd = joint_acceleration(momenta, bias, its.qd, its.symbols["torque"], at_com, share)
    outputs = {"qdd": qdd, "base_acceleration": _base_in_world(its, momenta, bias, at_com, qdd)}
    inputs = "q base_quat qd base_twist torque base_wrench tip_wrench payload"
    return its.function("forward_dynamics", inputs, outputs)


def _free_inverse_dynamics(model: "RobotModel", tip: str) -> ca.Function:
    """torque (n) for wanted joint accelerations on the free base, and the base_acceleration (6) that follows."""
    check_inertia(model)
    its = Symbols(model, tip)
    momenta, qdd = its.momenta(), its.symbols["qdd"]
    bias = build_bias(momenta, its.parts, its.q, its.qd, its.in_base("base_twist")[1])
    at_com, on_tip = outer_forces(its, momenta)
    torque = ca.mtimes(joint_inertia(momenta, its.tree.floating), qdd)
    torque = torque + drift(momenta, bias, at_com, joint_share(momenta, its.tip, on_tip))
    outputs = {
        "torque": torque + friction_torque(its.tree.friction, its.qd),
        "base_acceleration": _base_in_world(its, momenta, bias, at_com, qdd),
    }
    inputs = "q base_quat qd base_twist qdd base_wrench tip_wrench payload"
    return its.function("free_inverse_dynamics", inputs, outputs)


def _grasp(model: "RobotModel", tip: str) -> ca.Function:
    """qd_next (n), base_twist_next (6) after a payload of its own twist (6, at the tip) is seized by the tip.

    An inelastic impact that no motor resists: M_loaded v_next = M v + J^T p, so that the momentum of robot and
    payload together passes through the grasp, on a fixed base the joints' share of it.
    """
    check_inertia(model)
    its = Symbols(model, tip)
    momenta = its.momenta()
    velocity, rate = its.in_base("base_twist")
    jump, moved = grasp_jump(
        momenta, its.tip, (velocity, rate, its.qd), its.symbols["payload"], its.in_base("payload_twist")
    )
    outputs = {
        "qd_next": its.qd + jump,
        "base_twist_next": its.symbols["base_twist"] + its.in_world(moved.linear, moved.angular),
    }
    return its.function("grasp", "q base_quat qd base_twist payload payload_twist", outputs)


def grasp_jump(
    momenta: Momenta,
    tip: TipFrame,
    before: tuple[ca.SX, ca.SX, ca.SX],
    payload: ca.SX,
    own: tuple[ca.SX, ca.SX],
) -> tuple[ca.SX, Motion]:
    """By how much qd (n) and the base's velocity jump when the tip seizes a payload (10); base axes.

    ``momenta`` has the payload in it; ``before``: velocity and rate (3) of the base frame, qd; ``own``: velocity
    and rate (3) of the payload at the tip.
    """
    point, rotation = tip_place(momenta, tip)
    linear, angular = tip_twist(momenta, tip, before[2], before[0], before[1])
    load = about_tip(payload)
    h = rotate(rotation, load.first_moment)
    faster, turning = own[0] - linear, own[1] - angular
    blow = Wrench(
        load.mass * faster + cross(turning, h),
        rotate(rotation, rotate(load.tensor, rotate(rotation.T, turning))) + cross(h, faster),
    )
    at_com = moved_to_com(momenta, blow, point)
    none = Bias(ca.SX.zeros(before[2].shape[0]), ca.SX.zeros(3), ca.SX.zeros(3))
    beside = drift(momenta, none, at_com, joint_share(momenta, tip, at_com))
    jump = symmetric_solve(joint_inertia(momenta, momenta.tree.floating), -beside)
    return jump, base_acceleration(momenta, none, at_com, jump)


FORWARD = {
    "forward_dynamics": _forward_dynamics,
    "free_inverse_dynamics": _free_inverse_dynamics,
    "grasp": _grasp,
}
