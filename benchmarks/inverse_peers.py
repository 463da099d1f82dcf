"""Inverse kinematics of the same arm by others: TRAC-IK and the Robotics Toolbox.

Each searches from one posture and then from random ones; each raises ImportError where it is not installed.
"""

from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from fzcli.model import RobotModel
from fzcli.model.tree import Placement

Array = NDArray[np.float64]
CLOSE = 1e-5  # m and rad
SECONDS = 0.005  # that TRAC-IK may take, as in its own comparison


class TracIk:
    """TRAC-IK through its Python bindings: Newton and SQP race each other in two threads until one is there."""

    def __init__(self, model: RobotModel) -> None:
        import pytracik

        self.name = f"pytracik {version('pytracik')}, Speed, at most 5 ms"
        self._solve = pytracik.ik
        self._arm = pytracik.TRAC_IK("base", "tip", urdf_of(model), SECONDS, CLOSE, pytracik.SolveType.Speed)

    def solve(self, position: Array, rotation: Array, near: Array) -> Array | None:
        """A posture (n), or None. The bindings answer in single precision, a code before it."""
        x, y, z, w = _quaternion(rotation)
        code, *found = self._solve(self._arm, near, *position, x, y, z, w)
        return np.array(found) if code >= 0 else None


class Toolbox:
    """The Robotics Toolbox' Levenberg-Marquardt in C++, with its defaults but for the tolerance."""

    def __init__(self, model: RobotModel) -> None:
        import roboticstoolbox as rtb
        from spatialmath import SE3

        self.name = f"roboticstoolbox {version('roboticstoolbox-python')}, ik_LM"
        steps = []
        for body, limits in zip(model.tree.bodies, model.tree.position_limits, strict=True):
            if abs(body.axis[2]) != 1.0:
                raise ValueError("the bench expects joints about z, as a DH table gives them")
            steps += [rtb.ET.SE3(SE3(_matrix(body.place))), rtb.ET.Rz(flip=bool(body.axis[2] < 0), qlim=limits)]
        tip = next(iter(model.tree.tips.values()))
        self._arm = rtb.ETS([*steps, rtb.ET.SE3(SE3(_matrix(tip.place)))])

    def solve(self, position: Array, rotation: Array, near: Array) -> Array | None:
        """A posture (n), or None."""
        goal = np.eye(4)
        goal[:3, :3], goal[:3, 3] = rotation, position
        found = self._arm.ik_LM(goal, q0=near, tol=0.5 * CLOSE**2)
        return np.array(found.q) if found.success else None


def urdf_of(model: RobotModel) -> str:
    """The arm as URDF text: bodies in a row from "base" to "tip"."""
    lines = ['<robot name="arm"><link name="base"/>']
    before = "base"
    for i, body in enumerate(model.tree.bodies):
        low, high = model.tree.position_limits[i].tolist()
        axis = " ".join(repr(float(value)) for value in body.axis)
        lines += [
            f'<link name="link{i}"/><joint name="{body.joint}" type="revolute">{_origin(body.place)}',
            f'<parent link="{before}"/><child link="link{i}"/><axis xyz="{axis}"/>',
            f'<limit lower="{low!r}" upper="{high!r}" effort="1" velocity="1"/></joint>',
        ]
        before = f"link{i}"
    tip = next(iter(model.tree.tips.values()))
    lines += [
        f'<link name="tip"/><joint name="end" type="fixed">{_origin(tip.place)}',
        f'<parent link="{before}"/><child link="tip"/></joint></robot>',
    ]
    return "".join(lines)


def _origin(place: Placement) -> str:
    R = place.rotation
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    rpy = (np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0]))
    xyz, turn = (" ".join(repr(float(value)) for value in values) for values in (place.translation, rpy))
    return f'<origin xyz="{xyz}" rpy="{turn}"/>'


def _matrix(place: Placement) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = place.rotation, place.translation
    return matrix


def _quaternion(R: Array) -> Array:
    """x, y, z, w of a rotation."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_quat())
