"""Mass matrix, bias forces, inverse dynamics, energy and power of a robot, as named CasADi Functions.

Generalized velocity is (base_twist, qd), its rate (base_acceleration, qdd), base_acceleration the time
derivative of base_twist: both at the base frame's origin, linear first, world axes. Wrenches are forces
[N] then moments [N m], world axes, at the base frame's origin or at the tip's. ``payload`` (10) sits on the
tip: see `fzcli.model.payload`. Torques are those of the motors: joint friction is the robot's own.
No gravity acts.
"""

from typing import TYPE_CHECKING

import casadi as ca

from fzcli.model.algebra import cross, dot, rotate
from fzcli.model.attitude import rotation_matrix
from fzcli.model.balance import (
    Momenta,
    build_momenta,
    joint_inertia,
    kinetic_energy,
    momentum_of,
    moved_to_com,
    tip_place,
)
from fzcli.model.composite import Composite
from fzcli.model.newton_euler import Motion, Wrench, newton_euler
from fzcli.model.payload import PAYLOAD, loaded_bodies
from fzcli.model.tree import Array, TipFrame

if TYPE_CHECKING:
    from fzcli.model.robot_model import RobotModel


class Symbols:
    """The symbols that dynamics Functions share, and what belongs to them in base axes."""

    def __init__(self, model: "RobotModel", tip: str) -> None:
        n = model.n
        self.tree = model.tree
        self.tip: TipFrame = model.tree.tips[tip]
        self.symbols = {
            name: ca.SX.sym(name, size)
            for name, size in {
                "q": n,
                "base_quat": 4,
                "qd": n,
                "base_twist": 6,
                "qdd": n,
                "base_acceleration": 6,
                "torque": n,
                "base_wrench": 6,
                "tip_wrench": 6,
                "payload": PAYLOAD,
                "payload_twist": 6,
            }.items()
        }
        self.q, self.qd = self.symbols["q"], self.symbols["qd"]
        self.R = rotation_matrix(self.symbols["base_quat"])
        self.parts: list[Composite] = loaded_bodies(self.tree, self.tip, self.symbols["payload"])

    def in_base(self, name: str) -> tuple[ca.SX, ca.SX]:
        """Both halves (3) of a twist or wrench, in base axes."""
        return rotate(self.R.T, self.symbols[name][:3]), rotate(self.R.T, self.symbols[name][3:])

    def in_world(self, linear: ca.SX, angular: ca.SX) -> ca.SX:
        """The (6) of two halves given in base axes."""
        return ca.vertcat(rotate(self.R, linear), rotate(self.R, angular))

    def wrench(self, name: str) -> Wrench:
        """The named wrench, base axes."""
        return Wrench(*self.in_base(name))

    def momenta(self) -> Momenta:
        """Masses and momenta at q, the payload included."""
        return build_momenta(self.tree, self.q, self.parts)

    def function(self, name: str, inputs: str, outputs: dict[str, ca.SX]) -> ca.Function:
        """A Function of the symbols named in ``inputs``, apart by blanks."""
        names = inputs.split()
        results = ca.cse([ca.densify(value) for value in outputs.values()])
        return ca.Function(name, [self.symbols[key] for key in names], results, names, list(outputs))


def friction_torque(friction: Array, qd: ca.SX) -> ca.SX:
    """What friction (n, 3: viscous, Coulomb, smoothing) takes from each joint's torque at qd, (n)."""
    taken = []
    for i, (viscous, coulomb, smoothing) in enumerate(friction.tolist()):
        speed = qd[i]
        drag = viscous * speed if viscous else ca.SX(0)
        if coulomb:
            drag = drag + coulomb * speed / ca.sqrt(speed * speed + smoothing * smoothing)
        taken.append(drag)
    return ca.vertcat(*taken)


def _mass_matrix(model: "RobotModel", tip: str) -> ca.Function:
    """H_b (6, 6), H_bm (6, n), M_q (n, n): the symmetric mass matrix of (base_twist, qd) in blocks."""
    its = Symbols(model, tip)
    momenta, R = its.momenta(), its.R
    com = momenta.frame.com
    spread = dot(com, com) * ca.SX.eye(3) - ca.mtimes(com, com.T)
    inertia = ca.mtimes(ca.mtimes(R, momenta.frame.inertia + momenta.mass * spread), R.T)
    lever = momenta.mass * ca.skew(rotate(R, com))
    held = ca.vertcat(
        ca.horzcat(momenta.mass * ca.SX.eye(3), -lever),
        ca.horzcat(lever, inertia),
    )
    columns = [
        its.in_world(
            momenta.linear[:, i], momenta.angular[:, i] + cross(com, momenta.linear[:, i])
        )
        for i in range(model.n)
    ]
    blocks = {"H_b": held, "H_bm": ca.horzcat(*columns), "M_q": joint_inertia(momenta, free=False)}
    return its.function("mass_matrix", "q base_quat payload", blocks)


def _bias_forces(model: "RobotModel", tip: str) -> ca.Function:
    """base (6), joints (n): what a motion without acceleration asks for, friction left out."""
    its = Symbols(model, tip)
    none, still = ca.SX.zeros(3), ca.SX.zeros(model.n)
    rate = its.in_base("base_twist")[1]
    found = newton_euler(its.tree, its.parts, its.q, its.qd, still, Motion(rate, none, none))
    outputs = {"base": its.in_world(found.base.force, found.base.moment), "joints": ca.vertcat(*found.joints)}
    return its.function("bias_forces", "q base_quat qd base_twist payload", outputs)


def _inverse_dynamics(model: "RobotModel", tip: str) -> ca.Function:
    """torque (n), base_wrench (6), reaction (6) behind a motion of joints and base.

    ``base_wrench`` must act on the base from outside; ``reaction`` is what the arm does to the base. Of a base
    that is held still the one is the other's opposite.
    """
    its = Symbols(model, tip)
    linear, angular = its.in_base("base_acceleration")
    motion = Motion(its.in_base("base_twist")[1], angular, linear)
    load = (its.tip, its.wrench("tip_wrench"))
    found = newton_euler(its.tree, its.parts, its.q, its.qd, its.symbols["qdd"], motion, load)
    outputs = {
        "torque": ca.vertcat(*found.joints) + friction_torque(its.tree.friction, its.qd),
        "base_wrench": its.in_world(found.base.force, found.base.moment),
        "reaction": -its.in_world(found.branches.force, found.branches.moment),
    }
    inputs = "q base_quat qd base_twist qdd base_acceleration tip_wrench payload"
    return its.function("inverse_dynamics", inputs, outputs)


def _system_momentum(model: "RobotModel", tip: str) -> ca.Function:
    """momentum (6), linear then angular about the CoM; com (3) from the base frame's origin; payload included."""
    its = Symbols(model, tip)
    momenta = its.momenta()
    linear, angular = momentum_of(momenta, *its.in_base("base_twist"), its.qd)
    outputs = {"momentum": its.in_world(linear, angular), "com": rotate(its.R, momenta.frame.com)}
    return its.function("system_momentum", "q base_quat qd base_twist payload", outputs)


def _kinetic_energy(model: "RobotModel", tip: str) -> ca.Function:
    """energy [J] of the whole system, payload included."""
    its = Symbols(model, tip)
    energy = kinetic_energy(its.momenta(), *its.in_base("base_twist"), its.qd)
    return its.function("kinetic_energy", "q base_quat qd base_twist payload", {"energy": energy})


def _tip_state(model: "RobotModel", tip: str) -> ca.Function:
    """position (3) of the tip from the base frame's origin, rotation (3, 3), twist (6): geometry alone, no mass."""
    its = Symbols(model, tip)
    momenta = its.momenta()
    velocity, rate = its.in_base("base_twist")
    point, rotation = tip_place(momenta, its.tip)
    outputs = {
        "position": rotate(its.R, point),
        "rotation": ca.mtimes(its.R, rotation),
        "twist": its.in_world(*tip_twist(momenta, its.tip, its.qd, velocity, rate)),
    }
    return its.function("tip_state", "q base_quat qd base_twist", outputs)


def _power(model: "RobotModel", tip: str) -> ca.Function:
    """motors (n), friction (n, never above 0), base and tip: power [W] that each puts into the motion.

    The kinetic energy's rate is the sum of all four. A wheel's torque counts as a moment on the base.
    """
    its = Symbols(model, tip)
    momenta = its.momenta()
    velocity, rate = its.in_base("base_twist")
    at_tip = tip_twist(momenta, its.tip, its.qd, velocity, rate)
    on_base, on_tip = its.wrench("base_wrench"), its.wrench("tip_wrench")
    outputs = {
        "motors": its.symbols["torque"] * its.qd,
        "friction": -friction_torque(its.tree.friction, its.qd) * its.qd,
        "base": dot(on_base.force, velocity) + dot(on_base.moment, rate),
        "tip": dot(on_tip.force, at_tip[0]) + dot(on_tip.moment, at_tip[1]),
    }
    return its.function("power", "q base_quat qd base_twist torque base_wrench tip_wrench", outputs)


def tip_twist(
    momenta: Momenta, tip: TipFrame, qd: ca.SX, velocity: ca.SX, rate: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """A tip's velocity and angular velocity (3) from those of the base frame's origin; base axes."""
    point = tip_place(momenta, tip)[0]
    moving, turning = velocity + cross(rate, point), rate
    for i in momenta.tree.ancestors(tip.body):
        column = momenta.frame.columns[i]
        if momenta.tree.bodies[i].prismatic:
            moving = moving + column.axis * qd[i]
        else:
            moving = moving + cross(column.axis, point - column.origin) * qd[i]
            turning = turning + column.axis * qd[i]
    return moving, turning


def outer_forces(its: Symbols, momenta: Momenta) -> tuple[Wrench, Wrench]:
    """All that acts from outside, about the CoM, and its part on the tip; base axes."""
    on_tip = moved_to_com(momenta, its.wrench("tip_wrench"), tip_place(momenta, its.tip)[0])
    on_base = moved_to_com(momenta, its.wrench("base_wrench"), ca.SX.zeros(3))
    return on_base.plus(on_tip), on_tip


def _friction(model: "RobotModel", tip: str) -> ca.Function:
    """qd -> torque (n) that friction takes."""
    qd = ca.SX.sym("qd", model.n)
    return ca.Function("friction", [qd], [ca.densify(friction_torque(model.tree.friction, qd))], ["qd"], ["torque"])


def _limited_torque(model: "RobotModel", tip: str) -> ca.Function:
    """A commanded torque (n) -> what the motors give of it (n), within the spec's limits."""
    asked = ca.SX.sym("torque", model.n)
    given = [
        ca.fmin(ca.fmax(asked[i], -limit), limit) if limit < float("inf") else asked[i]
        for i, limit in enumerate(model.tree.effort_limits.tolist())
    ]
    return ca.Function("limited_torque", [asked], [ca.vertcat(*given)], ["torque"], ["torque_limited"])


DYNAMICS = {
    "mass_matrix": _mass_matrix,
    "bias_forces": _bias_forces,
    "inverse_dynamics": _inverse_dynamics,
    "system_momentum": _system_momentum,
    "kinetic_energy": _kinetic_energy,
    "tip_state": _tip_state,
    "power": _power,
    "friction": _friction,
    "limited_torque": _limited_torque,
}
