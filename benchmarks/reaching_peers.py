"""Inverse kinematics of the same UR5 by others: a step of pink, a whole solve of the Robotics Toolbox.

Both hold the base fixed and meet the whole pose: another problem than ours, a free base and one direction.
pink keeps to the joints' speeds as we do; the Toolbox finds a posture and no way to it. Their constructors
raise ImportError where they are not installed.
"""

import math
import sys
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from fzcli.model import RobotModel
from fzcli.model.tree import Tree

Array = NDArray[np.float64]
PERIOD, STEPS = 0.01, 200
DH = (  # theta's offset is 0: d, a, alpha
    (0.089159, 0.0, math.pi / 2),
    (0.0, -0.425, 0.0),
    (0.0, -0.39225, 0.0),
    (0.10915, 0.0, math.pi / 2),
    (0.09465, 0.0, -math.pi / 2),
    (0.0823, 0.0, 0.0),
)
CLOSE, ALIGNED = 0.01, math.radians(2.0)


class Pink:
    """Differential inverse kinematics: a frame task within joint limits and speeds, a QP solved by DAQP a step."""

    def __init__(self, tree: Tree) -> None:
        import daqp  # noqa: F401  qpsolvers finds it by name
        import pink
        import pinocchio as pin
        from pink.tasks import FrameTask

        self.name = f"pink {version('pin-pink')}, DAQP {version('daqp')}, one step, base fixed"
        self._pin, self._pink = pin, pink
        self.model = pin.Model()
        for i, body in enumerate(tree.bodies):
            place = pin.SE3(body.place.rotation, body.place.translation)
            kind = pin.JointModelRevoluteUnaligned(body.axis)
            limits = (math.inf, tree.speed_limits[i], *tree.position_limits[i])
            self.model.addJoint(body.parent + 1, kind, place, body.joint, *(np.array([value]) for value in limits))
        tip = next(iter(tree.tips.values()))
        place = pin.SE3(tip.place.rotation, tip.place.translation)
        self._tip = self.model.addFrame(pin.Frame("tip", tip.body + 1, place, pin.FrameType.OP_FRAME))
        self._task = FrameTask("tip", position_cost=1.0, orientation_cost=1.0, lm_damping=1.0)

    def pose(self, q: Array) -> Array:
        """Of the tip, (4, 4)."""
        data = self.model.createData()
        self._pin.framesForwardKinematics(self.model, data, q)
        return np.array(data.oMf[self._tip].homogeneous)

    def walk(self, q: Array, goal: Array, steps: int = STEPS) -> Array:
        """Steps towards a pose (4, 4) from q (n); the last q."""
        configuration = self._pink.Configuration(self.model, self.model.createData(), q)
        self._task.set_target(self._pin.SE3(goal))
        for _ in range(steps):
            velocity = self._pink.solve_ik(configuration, [self._task], PERIOD, solver="daqp")
            configuration.integrate_inplace(velocity, PERIOD)
        return np.array(configuration.q)


class Toolbox:
    """Levenberg-Marquardt from the posture, then from random ones until the pose is met: its C++, with its defaults."""

    def __init__(self, tree: Tree) -> None:
        import roboticstoolbox as rtb

        name = f"roboticstoolbox {version('roboticstoolbox-python')}"
        self.name = f"{name}, ik_LM, a posture for a fixed base"
        links = [
            rtb.RevoluteDH(d=d, a=a, alpha=alpha, qlim=list(limits))
            for (d, a, alpha), limits in zip(DH, tree.position_limits, strict=True)
        ]
        self._arm = rtb.DHRobot(links, name="UR5").ets()
        try:
            self._arm.ik_LM(self._arm.fkine(np.zeros(6)))
        except RuntimeError as error:  # a wheel without its C++
            raise ImportError(str(error)) from error

    def pose(self, q: Array) -> Array:
        """Of the tip, (4, 4)."""
        return np.array(self._arm.fkine(q).A)

    def solve(self, q: Array, goals: list[Array]) -> list[Array | None]:
        """A posture (n) for every pose (4, 4), or None."""
        found = (self._arm.ik_LM(goal, q0=q) for goal in goals)
        return [np.array(one.q) if one.success else None for one in found]


def check_kinematics(peer: Pink | Toolbox, model: RobotModel) -> None:
    """The peer's arm must be ours."""
    for q in np.random.default_rng(5).uniform(-math.pi, math.pi, (50, model.n)):
        position, rotation = (np.array(value) for value in model.forward_kinematics(q, [1, 0, 0, 0]))
        pose = peer.pose(q)
        away = max(np.abs(pose[:3, 3] - position.ravel()).max(), np.abs(pose[:3, :3] - rotation).max())
        if away > 1e-12:
            sys.exit(f"{peer.name}: another arm than ours, by {away:.3g}")


def arrived(pose: Array, goal: Array) -> bool:
    """Whether a pose is where our runs stop: position and the tip's z."""
    cosine = min(1.0, float(pose[:3, 2] @ goal[:3, 2]))
    return float(np.linalg.norm(pose[:3, 3] - goal[:3, 3])) < CLOSE and math.acos(cosine) < ALIGNED
