"""``ik: {kind: neural, ...}``: an arm's trained networks in the place of its inverse kinematics."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from fzcli.errors import Problem, SpecError
from fzcli.learn.arm_inverse import ArmInverse, pose_numbers
from fzcli.learn.neural import NeuralKinematics
from fzcli.learn.store import load
from fzcli.model.inverse.solve import Solution
from fzcli.model.inverse.windings import all_windings, excess, nearest_windings
from fzcli.spec.base import SpecModel
from fzcli.spec.robot import Robot


class NeuralIkSpec(SpecModel):
    """Networks that ``fzcli train`` made for this robot with this tool, refined and gated."""

    kind: Literal["neural"]
    networks: Annotated[str, Field(description="the npz file, from this file's folder")]
    steps: Annotated[int, Field(ge=1, le=100, description="Newton steps after the network")] = 8


@dataclass(frozen=True)
class NeuralInverse:
    """Postures for a tip's pose from an arm's networks; those that the gate refuses are not given."""

    kinematics: NeuralKinematics
    arm_map: ArmInverse
    steps: int

    def solve(
        self,
        position: ArrayLike,
        rotation: ArrayLike,
        *,
        near: ArrayLike | None = None,
        windings: bool = False,
    ) -> list[Solution]:
        """Postures that meet a pose, nearest to ``near`` (n) first, as ``InverseKinematics.solve`` has them.

        ``position`` (3) [m] and ``rotation`` (3, 3) of the tip in the base frame; at most one posture a network
        (and winding). Empty where no network has an answer that passes: ask the exact inverse then.
        """
        arm = self.arm_map.inverse.arm
        joints = list(arm.joints)
        start = np.zeros(self.arm_map.inverse.model.n)
        start[joints] = arm.middle
        if near is not None:
            start = np.array(near, dtype=float)
        own = start[joints]
        pose = pose_numbers(np.asarray(position, dtype=float), np.asarray(rotation, dtype=float))
        found = []
        for one in self.kinematics.solve(pose, steps=self.steps):
            if not one.accepted:
                continue
            wound = all_windings(arm, one.value, own) if windings else nearest_windings(arm, one.value[None], own)
            for values, past in zip(wound, excess(arm, wound), strict=True):
                q = start.copy()
                q[joints] = values
                found.append(Solution(q, one.label, float(one.residual[0]), float(one.residual[1]), float(past)))
        return sorted(found, key=lambda one: float(((one.q - start) ** 2).sum()))


def neural_inverse(spec: NeuralIkSpec, robot: Robot, beside: Path | None = None) -> NeuralInverse:
    """The networks that a spec names, for a robot with its tool; ``beside`` is the file that holds the spec.

    Raises:
        RecordError: the file is missing or damaged.
        SpecError: it was trained for another robot, or holds no inverse of an arm.
    """
    path = Path(spec.networks).expanduser()
    if beside is not None and (beside.parent / path).exists():
        path = beside.parent / path
    kinematics = load(path, robot).kinematics_for(robot)
    if not isinstance(kinematics.map, ArmInverse):
        raise SpecError(Problem(f"{path} holds no inverse kinematics of an arm", field="ik.networks"))
    return NeuralInverse(kinematics, kinematics.map, spec.steps)
