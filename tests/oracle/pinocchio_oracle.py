"""The same quantities by Pinocchio: a free-flyer root, centroidal map, CRBA, frame Jacobians.

Differs from numpy_reference in method as well as in code: W and the generalized Jacobian come from the
full 6 x 6 centroidal map, the generalized inertia from the Schur complement of the mass matrix.
"""

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fzcli.spec.robot import Base, Frame, Link, Robot, Tip
from tests.oracle.numpy_reference import depth_first

Array = NDArray[np.float64]


def pin_model(robot: Robot) -> tuple[pin.Model, dict[str, int]]:
    """The robot as a pin.Model on a free flyer, with the id of each tip's frame.

    Links behind fixed joints are welded to the body that carries them. Joints are added depth first:
    Pinocchio's algorithms take a subtree's columns as one block.
    """
    model = pin.Model()
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(root, _inertia(robot.base), pin.SE3.Identity())
    carriers = {"base": (root, pin.SE3.Identity())}  # link: joint and placement on it
    for link in depth_first(robot):
        joint, placement = carriers[link.parent]
        placement = placement * _placement(link.at)
        if link.joint.type != "fixed":
            axis = np.array(link.joint.axis)
            kind = (
                pin.JointModelPrismaticUnaligned
                if link.joint.type == "prismatic"
                else pin.JointModelRevoluteUnaligned
            )
            joint = model.addJoint(joint, kind(axis), placement, link.joint.name)
            placement = pin.SE3.Identity()
        model.appendBodyToJoint(joint, _inertia(link), placement)
        carriers[link.name] = (joint, placement)
    frames = {}
    for name, tip in robot.tips.items():
        joint, placement = carriers[tip.link]
        frame = pin.Frame(f"tip:{name}", joint, placement * _placement(tip), pin.FrameType.OP_FRAME)
        frames[name] = model.addFrame(frame)
    return model, frames


def _placement(frame: Frame | Tip) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(*frame.rpy), np.array(frame.xyz))


def _inertia(body: Base | Link) -> pin.Inertia:
    xx, yy, zz, xy, xz, yz = body.inertia
    return pin.Inertia(body.mass, np.array(body.com), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


class PinocchioOracle:
    """Reference values of a robot; quaternions w x y z, twists linear first, world axes."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.model, self._frames = pin_model(robot)
        self._data = self.model.createData()
        self.joint_names = tuple(self.model.names[2:])  # after "universe" and "root"
        self.n = len(self.joint_names)
        self.floating = robot.base.floating

    def _q(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        w, x, y, z = np.asarray(base_quat, float)
        return np.concatenate([np.zeros(3), [x, y, z, w], np.asarray(q, float).ravel()])

    def _columns_in_world(self, matrix: Array, base_quat: ArrayLike) -> Array:
        """Columns for a base twist in world axes from columns for one in the base's axes."""
        w, x, y, z = np.asarray(base_quat, float)
        turn = pin.Quaternion(w, x, y, z).toRotationMatrix()
        matrix = matrix.copy()
        matrix[:, :3] = matrix[:, :3] @ turn.T
        matrix[:, 3:6] = matrix[:, 3:6] @ turn.T
        return matrix

    def _centroidal(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        pin.ccrba(self.model, self._data, self._q(q, base_quat), np.zeros(self.model.nv))
        return self._columns_in_world(np.array(self._data.Ag), base_quat)

    def com(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """Centre of mass (3,) [m] from the origin of the base's frame, world axes."""
        return np.array(pin.centerOfMass(self.model, self._data, self._q(q, base_quat)))

    def system_inertia(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """The system's inertia (3, 3) [kg m2] about its centre of mass, world axes."""
        self._centroidal(q, base_quat)
        return np.array(self._data.Ig.inertia)

    def momentum_map(self, q: ArrayLike, base_quat: ArrayLike) -> tuple[Array, Array]:
        """H_b (6, 6) and H_bm (6, n) about the centre of mass."""
        matrix = self._centroidal(q, base_quat)
        return matrix[:, :6], matrix[:, 6:]

    def momentum(self, q: ArrayLike, base_quat: ArrayLike, qd: ArrayLike, base_twist: ArrayLike) -> Array:
        """Momentum (6,): linear, then angular about the centre of mass."""
        w, x, y, z = np.asarray(base_quat, float)
        turn = pin.Quaternion(w, x, y, z).toRotationMatrix()
        twist = np.asarray(base_twist, float)
        velocity = np.concatenate([turn.T @ twist[:3], turn.T @ twist[3:], np.asarray(qd, float).ravel()])
        pin.computeCentroidalMomentum(self.model, self._data, self._q(q, base_quat), velocity)
        return np.array(self._data.hg.vector)

    def base_twist_map(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """The base twist (6, n) per joint rate at zero momentum; 0 on a fixed base."""
        if not self.floating:
            return np.zeros((6, self.n))
        h_b, h_bm = self.momentum_map(q, base_quat)
        return -np.linalg.solve(h_b, h_bm)

    def base_rate_map(self, q: ArrayLike, base_quat: ArrayLike) -> Array:
        """W (3, n); 0 on a fixed base."""
        return self.base_twist_map(q, base_quat)[3:]

    def tip_in_world(self, q: ArrayLike, base_quat: ArrayLike, tip: str | None = None) -> tuple[Array, Array]:
        """Tip position (3,) and attitude (3, 3) in world, the base's origin standing at zero."""
        pin.framesForwardKinematics(self.model, self._data, self._q(q, base_quat))
        pose = self._data.oMf[self._frame(tip)]
        return np.array(pose.translation), np.array(pose.rotation)

    def forward_kinematics(
        self, q: ArrayLike, base_quat: ArrayLike, tip: str | None = None
    ) -> tuple[Array, Array]:
        """Tip position (3,) from the centre of mass (fixed base: the base's origin), attitude (3, 3)."""
        position, rotation = self.tip_in_world(q, base_quat, tip)
        return position - self.com(q, base_quat) if self.floating else position, rotation

    def generalized_jacobian(self, q: ArrayLike, base_quat: ArrayLike, tip: str | None = None) -> Array:
        """J_g (6, n): tip twist relative to the centre of mass at zero momentum."""
        full = self._q(q, base_quat)
        frame = self._frame(tip)
        jacobian = pin.computeFrameJacobian(
            self.model, self._data, full, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        jacobian = self._columns_in_world(np.array(jacobian), base_quat)
        if not self.floating:
            return jacobian[:, 6:]
        com = self._columns_in_world(
            np.array(pin.jacobianCenterOfMass(self.model, self._data, full)), base_quat
        )
        jacobian[:3] -= com
        return jacobian @ np.vstack([self.base_twist_map(q, base_quat), np.eye(self.n)])

    def generalized_inertia(self, q: ArrayLike) -> Array:
        """M_q - H_bm^T H_b^-1 H_bm (n, n); on a fixed base M_q."""
        matrix = pin.crba(self.model, self._data, self._q(q, (1.0, 0.0, 0.0, 0.0)))
        matrix = np.triu(matrix) + np.triu(matrix, 1).T  # only the upper triangle is promised
        joints = matrix[6:, 6:]
        if not self.floating:
            return joints
        return joints - matrix[6:, :6] @ np.linalg.solve(matrix[:6, :6], matrix[:6, 6:])

    def _frame(self, tip: str | None) -> int:
        return self._frames[tip or next(iter(self.robot.tips))]
