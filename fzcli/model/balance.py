"""Joint-space equations of motion on a free or held base, in base axes about the system's CoM.

With linear motion of the CoM and the base's turning eliminated (Umetani and Yoshida 1989):
``inertia qdd + bias = torque + (what acts from outside, seen by the joints)``.
"""

from dataclasses import dataclass

import casadi as ca

from fzcli.model.algebra import cross, dot, rotate, symmetric_inverse
from fzcli.model.composite import BaseFrame, Composite, build_base_frame, centroidal_columns
from fzcli.model.newton_euler import Motion, Wrench, newton_euler
from fzcli.model.tree import TipFrame, Tree


@dataclass(frozen=True)
class Momenta:
    """Masses and momenta of a system at q; base axes.

    ``linear``, ``angular`` (3, n): momentum for unit joint rates with the base at rest, about the CoM;
    ``axes``, ``arms`` (3, n): angular velocity, and velocity of the point that stands at the CoM, of what a
    joint carries; ``inverse`` (3, 3) of the system's inertia about the CoM and ``base_rate`` (3, n) W.
    """

    tree: Tree
    frame: BaseFrame
    mass: ca.SX
    linear: ca.SX
    angular: ca.SX
    axes: ca.SX
    arms: ca.SX
    inverse: ca.SX
    base_rate: ca.SX


def build_momenta(tree: Tree, q: ca.SX, parts: list[Composite]) -> Momenta:
    """At symbolic joint values q (n); ``parts``: the bodies, the base last."""
    frame = build_base_frame(tree, q, parts)
    angular = centroidal_columns(frame)
    inverse = symmetric_inverse(frame.inertia) if tree.floating else ca.SX.zeros(3, 3)
    axes, arms = [], []
    for body, column in zip(tree.bodies, frame.columns, strict=True):
        axes.append(ca.SX.zeros(3) if body.prismatic else column.axis)
        arms.append(column.axis if body.prismatic else cross(column.origin - frame.com, column.axis))
    return Momenta(
        tree=tree,
        frame=frame,
        mass=ca.SX(sum(part.mass for part in parts)),
        linear=ca.horzcat(*(column.linear for column in frame.columns)),
        angular=angular,
        axes=ca.horzcat(*axes),
        arms=ca.horzcat(*arms),
        inverse=inverse,
        base_rate=ca.horzcat(*(-rotate(inverse, angular[:, i]) for i in range(angular.shape[1]))),
    )


def joint_inertia(momenta: Momenta, free: bool) -> ca.SX:
    """The joints' inertia (n, n): with the base held, or ``free`` to move (the generalized inertia)."""
    n = len(momenta.tree.bodies)
    M = ca.SX(n, n)
    per_mass = momenta.linear / momenta.mass if free else None
    for j in range(n):
        linear, angular = momenta.linear[:, j], momenta.angular[:, j]
        carried = set(momenta.tree.ancestors(j))
        for i in range(j + 1):
            turning, moving = ca.SX.zeros(3), ca.SX.zeros(3)
            if i in carried:
                turning, moving = momenta.axes[:, i], momenta.arms[:, i]
            if per_mass is not None:
                turning, moving = turning + momenta.base_rate[:, i], moving - per_mass[:, i]
            M[i, j] = M[j, i] = dot(turning, angular) + dot(moving, linear)
    return M


def momentum_of(momenta: Momenta, velocity: ca.SX, rate: ca.SX, qd: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Linear momentum (3), and angular about the CoM (3); ``velocity``, ``rate`` (3) of the base frame; base axes."""
    linear = momenta.mass * (velocity + cross(rate, momenta.frame.com)) + ca.mtimes(momenta.linear, qd)
    return linear, rotate(momenta.frame.inertia, rate) + ca.mtimes(momenta.angular, qd)


def kinetic_energy(momenta: Momenta, velocity: ca.SX, rate: ca.SX, qd: ca.SX) -> ca.SX:
    """Of all bodies [J]; ``velocity``, ``rate`` (3) of the base frame, base axes."""
    velocity = velocity + cross(rate, momenta.frame.com)
    linear, angular = ca.mtimes(momenta.linear, qd), ca.mtimes(momenta.angular, qd)
    energy = 0.5 * dot(qd, ca.mtimes(joint_inertia(momenta, free=False), qd))
    energy = energy + dot(velocity, 0.5 * momenta.mass * velocity + linear)
    return energy + dot(rate, 0.5 * rotate(momenta.frame.inertia, rate) + angular)


@dataclass(frozen=True)
class Bias:
    """Forces of a motion without acceleration: ``joints`` (n), ``force`` (3), ``moment`` (3) about the CoM."""

    joints: ca.SX
    force: ca.SX
    moment: ca.SX


def build_bias(momenta: Momenta, parts: list[Composite], q: ca.SX, qd: ca.SX, rate: ca.SX) -> Bias:
    """Coriolis and centrifugal forces at qd (n) and the base's angular velocity (3) in base axes."""
    none = ca.SX.zeros(3)
    found = newton_euler(
        momenta.tree, parts, q, qd, ca.SX.zeros(len(momenta.tree.bodies)), Motion(rate, none, none)
    )
    moment = found.base.moment - cross(momenta.frame.com, found.base.force)
    return Bias(ca.vertcat(*found.joints), found.base.force, moment)


def tip_place(momenta: Momenta, tip: TipFrame) -> tuple[ca.SX, ca.SX]:
    """A tip's origin (3), from the base frame's, and its rotation (3, 3), base axes."""
    rotation, origin = ca.SX.eye(3), ca.SX.zeros(3)
    if tip.body >= 0:
        rotation, origin = momenta.frame.rotations[tip.body], momenta.frame.origins[tip.body]
    point = origin + rotate(rotation, ca.SX(ca.DM(tip.place.translation)))
    return point, ca.mtimes(rotation, ca.SX(ca.DM(tip.place.rotation)))


def moved_to_com(momenta: Momenta, wrench: Wrench, point: ca.SX) -> Wrench:
    """A wrench at ``point`` (3, from the base frame's origin) as one at the CoM; base axes."""
    return Wrench(wrench.force, wrench.moment + cross(point - momenta.frame.com, wrench.force))


def joint_share(momenta: Momenta, tip: TipFrame, at_com: Wrench) -> ca.SX:
    """J^T wrench (n): what a wrench on a tip's body does at the joints with the base held."""
    carriers = set(momenta.tree.ancestors(tip.body))
    shares = [
        dot(momenta.arms[:, i], at_com.force) + dot(momenta.axes[:, i], at_com.moment)
        if i in carriers
        else ca.SX(0)
        for i in range(len(momenta.tree.bodies))
    ]
    return ca.vertcat(*shares)


def drift(momenta: Momenta, bias: Bias, at_com: Wrench, share: ca.SX) -> ca.SX:
    """What stands beside ``inertia qdd`` and the torques (n): bias less the work of outer forces.

    ``at_com``: everything that acts from outside; ``share`` (n): its part by way of a tip.
    """
    total = bias.joints - share
    if momenta.tree.floating:
        spare = (bias.force - at_com.force) / momenta.mass
        turning = at_com.moment - bias.moment
        total = total - ca.mtimes(momenta.linear.T, spare) - ca.mtimes(momenta.base_rate.T, turning)
    return total


def base_acceleration(momenta: Momenta, bias: Bias, at_com: Wrench, qdd: ca.SX) -> Motion:
    """The free base's acceleration: angular, and linear of its frame's origin; base axes; 0 if fixed."""
    if not momenta.tree.floating:
        return Motion(ca.SX.zeros(3), ca.SX.zeros(3), ca.SX.zeros(3))
    angular = rotate(momenta.inverse, at_com.moment - bias.moment) + ca.mtimes(momenta.base_rate, qdd)
    of_com = (at_com.force - bias.force - ca.mtimes(momenta.linear, qdd)) / momenta.mass
    return Motion(ca.SX.zeros(3), angular, of_com - cross(angular, momenta.frame.com))
