"""The dynamics by MuJoCo: composite bodies in its own C, its own forward dynamics and its own RK4."""

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fzcli.spec.robot import Base, Link, Robot
from tests.oracle.numpy_reference import rotation_from_quat, rotation_from_rpy

Array = NDArray[np.float64]


def _numbers(values: ArrayLike) -> str:
    return " ".join(repr(float(value)) for value in np.ravel(values))


def _inertial(body: Base | Link) -> str:
    mass, com, inertia = repr(body.mass), _numbers(body.com), _numbers(body.inertia)
    return f'<inertial mass="{mass}" pos="{com}" fullinertia="{inertia}"/>'


def _body(robot: Robot, link: Link) -> str:
    joint = link.joint
    turn = rotation_from_rpy(link.at.rpy)
    kind = "slide" if joint.type == "prismatic" else "hinge"
    moving = f'<joint name="{joint.name}" type="{kind}" axis="{_numbers(joint.axis)}"/>'
    inner = "".join(_body(robot, child) for child in robot.links if child.parent == link.name)
    place = f'pos="{_numbers(link.at.xyz)}" xyaxes="{_numbers([turn[:, 0], turn[:, 1]])}"'
    return f"<body {place}>{'' if joint.type == 'fixed' else moving}{_inertial(link)}{inner}</body>"


def mujoco_model(robot: Robot, step: float = 0.01) -> mujoco.MjModel:
    """The robot without gravity, contacts and damping, under MuJoCo's RK4."""
    inner = "".join(_body(robot, link) for link in robot.links if link.parent == "base")
    root = "<freejoint/>" if robot.base.floating else ""
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option gravity="0 0 0" integrator="RK4" timestep="{step!r}"/>'
        f"<worldbody><body>{root}{_inertial(robot.base)}{inner}</body></worldbody></mujoco>"
    )


class MujocoOracle:
    """Reference values of a robot; base twists linear first, world axes, at the base frame's origin.

    MuJoCo's own generalized velocity has the base's angular part in base axes.
    """

    def __init__(self, robot: Robot, step: float = 0.01) -> None:
        self.model = mujoco_model(robot, step)
        self.data = mujoco.MjData(self.model)
        self.floating = robot.base.floating
        self.n = self.model.nv - (6 if self.floating else 0)

    def place(self, q: ArrayLike, base_quat: ArrayLike, qd: ArrayLike, base_twist: ArrayLike) -> None:
        """Set the state, the base's origin at zero."""
        self.data.qpos[:] = np.concatenate([np.zeros(3), base_quat, q]) if self.floating else np.asarray(q)
        twist = np.asarray(base_twist, float)
        turned = rotation_from_quat(base_quat).T @ twist[3:]
        self.data.qvel[:] = np.concatenate([twist[:3], turned, qd]) if self.floating else np.asarray(qd)

    def _turn(self, base_quat: ArrayLike) -> Array:
        """From world axes to MuJoCo's, (nv, nv)."""
        turn = np.eye(self.model.nv)
        if self.floating:
            turn[3:6, 3:6] = rotation_from_quat(base_quat).T
        return turn

    def mass_matrix(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """The mass matrix (6 + n, 6 + n), on a fixed base (n, n)."""
        self.place(q, base_quat, np.zeros(self.n), np.zeros(6))
        mujoco.mj_forward(self.model, self.data)
        full = np.zeros((self.model.nv, self.model.nv))
        for row, unit in zip(full, np.eye(self.model.nv), strict=True):
            mujoco.mj_mulM(self.model, self.data, row, unit)
        turn = self._turn(base_quat)
        return turn.T @ full @ turn

    def bias(self, q: ArrayLike, base_quat: ArrayLike, qd: ArrayLike, base_twist: ArrayLike) -> Array:
        """Bias forces (6 + n), on a fixed base (n): the base's angular acceleration is the same in both axes."""
        self.place(q, base_quat, qd, base_twist)
        mujoco.mj_forward(self.model, self.data)
        return self._turn(base_quat).T @ self.data.qfrc_bias

    def acceleration(
        self, q: ArrayLike, base_quat: ArrayLike, qd: ArrayLike, base_twist: ArrayLike, forces: ArrayLike
    ) -> Array:
        """(base_acceleration, qdd) under generalized forces (6 + n), on a fixed base both without the base."""
        self.place(q, base_quat, qd, base_twist)
        turn = self._turn(base_quat)
        self.data.qfrc_applied[:] = turn @ np.asarray(forces, float)
        mujoco.mj_forward(self.model, self.data)
        found = turn.T @ self.data.qacc
        self.data.qfrc_applied[:] = 0.0
        return found

    def forces(
        self, q: ArrayLike, base_quat: ArrayLike, qd: ArrayLike, base_twist: ArrayLike, rates: ArrayLike
    ) -> Array:
        """Generalized forces (6 + n) behind (base_acceleration, qdd), on a fixed base both without the base."""
        self.place(q, base_quat, qd, base_twist)
        turn = self._turn(base_quat)
        self.data.qacc[:] = turn @ np.asarray(rates, float)
        mujoco.mj_inverse(self.model, self.data)
        return turn.T @ self.data.qfrc_inverse

    def run(self, steps: int) -> Array:
        """Free motion from the state in place: qpos and qvel after every step, (steps, nq + nv)."""
        rows = np.zeros((steps, self.model.nq + self.model.nv))
        for row in rows:
            mujoco.mj_step(self.model, self.data)
            row[:] = np.concatenate([self.data.qpos, self.data.qvel])
        return rows
