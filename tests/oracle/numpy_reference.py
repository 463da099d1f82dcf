"""The free-floating robot in plain NumPy: poses link by link, momentum summed body by body.

Written from the definitions, for reading rather than speed, and sharing no code with fzcli.model.
Conventions: quaternions w x y z, body to world; linear rows first; world axes; momentum about the
system's centre of mass; ``base_twist`` at the origin of the base link's frame.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fzcli.spec.robot import Base, Link, Robot

Array = NDArray[np.float64]


def skew(v: ArrayLike) -> Array:
    """The (3, 3) matrix of the cross product with v (3,)."""
    x, y, z = np.asarray(v, float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_about(axis: ArrayLike, angle: float) -> Array:
    """Rodrigues: the rotation (3, 3) about an axis (3,) of any length by an angle [rad]."""
    k = skew(np.asarray(axis, float) / np.linalg.norm(axis))
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)


def rotation_from_rpy(rpy: ArrayLike) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll) of angles (3,) [rad]."""
    roll, pitch, yaw = np.asarray(rpy, float)
    x, y, z = np.eye(3)
    return rotation_about(z, yaw) @ rotation_about(y, pitch) @ rotation_about(x, roll)


def rotation_from_quat(quat: ArrayLike) -> Array:
    """The rotation (3, 3) of a unit quaternion w x y z."""
    w, *v = np.asarray(quat, float)
    k = skew(v)
    return np.eye(3) + 2.0 * w * k + 2.0 * (k @ k)


def rotation_vector(rotation: Array) -> Array:
    """The rotation vector (3,) [rad] of a rotation by less than pi, accurate for small ones."""
    axis_sin = 0.5 * np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    sine = float(np.linalg.norm(axis_sin))
    if sine == 0.0:
        return axis_sin
    return axis_sin / sine * np.arctan2(sine, 0.5 * (np.trace(rotation) - 1.0))


def quat_multiply(a: ArrayLike, b: ArrayLike) -> Array:
    """The Hamilton product (4,) of two quaternions w x y z."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    scalar = a[0] * b[0] - a[1:] @ b[1:]
    return np.concatenate(([scalar], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])))


def quat_exp(v: ArrayLike) -> Array:
    """The unit quaternion (4,) of a rotation vector (3,) [rad]."""
    v = np.asarray(v, float)
    half = 0.5 * float(np.linalg.norm(v))
    return np.concatenate(([np.cos(half)], 0.5 * np.sinc(half / np.pi) * v))


def depth_first(robot: Robot) -> list[Link]:
    """The links depth first from the base, children in file order."""
    order: list[Link] = []

    def visit(parent: str) -> None:
        for link in robot.links:
            if link.parent == parent:
                order.append(link)
                visit(link.name)

    visit("base")
    return order


def active_joint_names(robot: Robot) -> tuple[str, ...]:
    """The joints that move, in the order of q."""
    return tuple(link.joint.name for link in depth_first(robot) if link.joint.type != "fixed")


@dataclass(frozen=True)
class Body:
    """One body: pose, mass properties, and its motion by the joints with the base held.

    rotation (3, 3) and origin (3,) of its frame, com (3,), inertia (3, 3) about the com; jv (3, n)
    of the com and jw (3, n). World axes, positions from the origin of the base's frame.
    """

    rotation: Array
    origin: Array
    mass: float
    com: Array
    inertia: Array
    jv: Array
    jw: Array


class NumpyReference:
    """Kinematics and momentum of a robot at given states; every method starts from the definitions."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.joint_names = active_joint_names(robot)
        self.n = len(self.joint_names)
        self.floating = robot.base.floating
        self._last: tuple[bytes, dict[str, Body]] = (b"", {})

    def bodies(self, q: ArrayLike, base_quat: ArrayLike) -> dict[str, Body]:
        """All bodies by link name, "base" first; those of the last state are kept."""
        q, base_quat = np.asarray(q, float), np.asarray(base_quat, float)
        key = q.tobytes() + base_quat.tobytes()
        if self._last[0] != key:
            self._last = (key, self._bodies(q, base_quat))
        return self._last[1]

    def _bodies(self, q: Array, base_quat: Array) -> dict[str, Body]:
        base = self.robot.base
        turn = rotation_from_quat(base_quat)
        none = np.zeros((3, self.n))
        bodies = {"base": _body(turn, np.zeros(3), base, none, none)}
        axes: dict[str, list[tuple[int, bool, Array, Array]]] = {"base": []}  # joints up to a link
        for link in depth_first(self.robot):
            parent, joint = bodies[link.parent], link.joint
            rotation = parent.rotation @ rotation_from_rpy(link.at.rpy)
            origin = parent.origin + parent.rotation @ np.array(link.at.xyz)
            chain = list(axes[link.parent])
            if joint.type != "fixed":
                index = self.joint_names.index(joint.name)
                axis = rotation @ (np.array(joint.axis) / np.linalg.norm(joint.axis))
                slides = joint.type == "prismatic"
                chain.append((index, slides, axis, origin))
                if slides:
                    origin = origin + axis * q[index]
                else:
                    rotation = rotation @ rotation_about(joint.axis, q[index])
            axes[link.name] = chain
            jv, jw = self._point_jacobian(chain, origin + rotation @ np.array(link.com))
            bodies[link.name] = _body(rotation, origin, link, jv, jw)
        return bodies

    def _point_jacobian(
        self, chain: list[tuple[int, bool, Array, Array]], point: Array
    ) -> tuple[Array, Array]:
        jv, jw = np.zeros((3, self.n)), np.zeros((3, self.n))
        for index, slides, axis, origin in chain:
            jv[:, index] = axis if slides else skew(axis) @ (point - origin)
            jw[:, index] = 0.0 if slides else axis
        return jv, jw

    def mass(self) -> float:
        """Mass of the whole system [kg]."""
        return self.robot.base.mass + sum(link.mass for link in self.robot.links)

    def com(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """The system's centre of mass (3,) [m] from the origin of the base's frame, world axes."""
        bodies = self.bodies(q, base_quat).values()
        return np.sum([b.mass * b.com for b in bodies], axis=0) / self.mass()

    def com_jacobian(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """The velocity map (3, n) of the centre of mass with the base held."""
        bodies = self.bodies(q, base_quat).values()
        return np.sum([b.mass * b.jv for b in bodies], axis=0) / self.mass()

    def system_inertia(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """The system's inertia (3, 3) [kg m2] about its centre of mass, world axes."""
        com, total = self.com(q, base_quat), np.zeros((3, 3))
        for body in self.bodies(q, base_quat).values():
            arm = skew(body.com - com)
            total += body.inertia + body.mass * arm @ arm.T
        return total

    def joint_angular_momentum(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """H_q (3, n): angular momentum about the centre of mass by the joints, the base held."""
        com, total = self.com(q, base_quat), np.zeros((3, self.n))
        for body in self.bodies(q, base_quat).values():
            total += body.inertia @ body.jw + body.mass * skew(body.com - com) @ body.jv
        return total

    def momentum_map(self, q: ArrayLike, base_quat: ArrayLike) -> tuple[Array, Array]:
        """H_b (6, 6) and H_bm (6, n): momentum by the base twist and by the joint rates."""
        com, mass = self.com(q, base_quat), self.mass()
        inertia = self.system_inertia(q, base_quat)
        h_b = np.block([[mass * np.eye(3), -mass * skew(com)], [np.zeros((3, 3)), inertia]])
        h_bm = np.vstack([mass * self.com_jacobian(q, base_quat), self.joint_angular_momentum(q, base_quat)])
        return h_b, h_bm

    def momentum(self, q: ArrayLike, base_quat: ArrayLike, qd: ArrayLike, base_twist: ArrayLike) -> Array:
        """Momentum (6,): linear, then angular about the centre of mass, summed over moving bodies."""
        qd, twist = np.asarray(qd, float), np.asarray(base_twist, float)
        com, total = self.com(q, base_quat), np.zeros(6)
        for body in self.bodies(q, base_quat).values():
            rate = twist[3:] + body.jw @ qd
            linear = body.mass * (twist[:3] + np.cross(twist[3:], body.com) + body.jv @ qd)
            total += np.concatenate([linear, body.inertia @ rate + np.cross(body.com - com, linear)])
        return total

    def base_rate_map(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """W (3, n): the base's angular velocity per joint rate at zero momentum; 0 on a fixed base."""
        if not self.floating:
            return np.zeros((3, self.n))
        return -np.linalg.solve(self.system_inertia(q, base_quat), self.joint_angular_momentum(q, base_quat))

    def base_twist_map(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """The base twist (6, n) per joint rate at zero momentum; 0 on a fixed base."""
        if not self.floating:
            return np.zeros((6, self.n))
        w = self.base_rate_map(q, base_quat)
        # The centre of mass stands still: v_base + w x com + J_com qd = 0.
        linear = -self.com_jacobian(q, base_quat) + skew(self.com(q, base_quat)) @ w
        return np.vstack([linear, w])

    def reference_point(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """What tips are measured from (3,): the centre of mass, on a fixed base the base's origin."""
        return self.com(q, base_quat) if self.floating else np.zeros(3)

    def forward_kinematics(
        self, q: ArrayLike, base_quat: ArrayLike, tip: str | None = None
    ) -> tuple[Array, Array]:
        """Tip position (3,) from the reference point and attitude (3, 3), world axes."""
        frame = self.robot.tips[tip or next(iter(self.robot.tips))]
        body = self.bodies(q, base_quat)[frame.link]
        position = body.origin + body.rotation @ np.array(frame.xyz)
        return position - self.reference_point(q, base_quat), body.rotation @ rotation_from_rpy(frame.rpy)

    def generalized_jacobian(self, q: ArrayLike, base_quat: ArrayLike, tip: str | None = None) -> Array:
        """J_g (6, n): tip twist at zero momentum, the centre of mass at rest (Umetani, Yoshida 1989)."""
        frame = self.robot.tips[tip or next(iter(self.robot.tips))]
        body = self.bodies(q, base_quat)[frame.link]
        point = body.origin + body.rotation @ np.array(frame.xyz)
        base = self.base_twist_map(q, base_quat)
        jw = base[3:] + body.jw
        # From the body's com to the tip, as one rigid body.
        com_velocity = base[:3] - skew(body.com) @ base[3:] + body.jv
        return np.vstack([com_velocity - skew(point - body.com) @ jw, jw])

    def generalized_inertia(self, q: ArrayLike) -> Array:
        """The (n, n) matrix of twice the kinetic energy at zero momentum, summed over bodies."""
        quat = np.array([1.0, 0.0, 0.0, 0.0])
        base, total = self.base_twist_map(q, quat), np.zeros((self.n, self.n))
        for body in self.bodies(q, quat).values():
            jv = base[:3] - skew(body.com) @ base[3:] + body.jv
            jw = base[3:] + body.jw
            total += body.mass * jv.T @ jv + jw.T @ body.inertia @ jw
        return total

    def kinetic_energy(
        self, q: ArrayLike, base_quat: ArrayLike, qd: ArrayLike, base_twist: ArrayLike
    ) -> float:
        """Kinetic energy [J] at joint rates (n,) and a base twist (6,)."""
        qd, twist, total = np.asarray(qd, float), np.asarray(base_twist, float), 0.0
        for body in self.bodies(q, base_quat).values():
            velocity = twist[:3] + np.cross(twist[3:], body.com) + body.jv @ qd
            rate = twist[3:] + body.jw @ qd
            total += 0.5 * float(body.mass * velocity @ velocity + rate @ body.inertia @ rate)
        return total


def _body(rotation: Array, origin: Array, spec: Base | Link, jv: Array, jw: Array) -> Body:
    xx, yy, zz, xy, xz, yz = spec.inertia
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    com = origin + rotation @ np.array(spec.com)
    mass = spec.mass
    return Body(rotation, origin, mass, com, rotation @ own @ rotation.T, jv, jw)
