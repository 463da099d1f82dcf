"""``ik: {kind: neural, ...}``: an arm's trained networks in the place of its inverse kinematics."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field, ValidationInfo

from fzcli.errors import Problem, SpecError
from fzcli.learn.arm_inverse import ArmInverse, pose_numbers
from fzcli.learn.neural import Estimate, NeuralKinematics
from fzcli.learn.store import load
from fzcli.model.inverse.solve import Solution
from fzcli.model.inverse.windings import all_windings, excess, nearest_windings
from fzcli.spec.base import SpecModel
from fzcli.spec.references import BESIDE
from fzcli.spec.robot import Robot


def _beside(networks: str, info: ValidationInfo) -> str:
    """The file beside the one that names it, where it is there."""
    beside = (info.context or {}).get(BESIDE)
    if beside is None:
        return networks
    path = Path(networks).expanduser()
    found = [place for place in (beside.parent / path, path) if place.exists()]
    if not found:
        raise ValueError(f"no such file '{networks}'; fzcli train writes one")
    return str(found[0])


class NeuralIkSpec(SpecModel):
    """Networks that ``fzcli train`` made for this robot with this tool, refined and gated."""

    kind: Literal["neural"]
    networks: Annotated[
        str, AfterValidator(_beside), Field(description="the npz file, from this file's folder or the current one")
    ]
    steps: Annotated[int, Field(ge=1, le=100, description="Newton steps after the network")] = 8


@dataclass(frozen=True)
class NeuralSolution(Solution):
    """A posture from a network after its Newton steps; ``raw_distance`` [m], ``raw_angle`` [rad]: missed before."""

    raw_distance: float
    raw_angle: float


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
    ) -> list[NeuralSolution]:
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
        found = []
        for one in self.estimates(position, rotation):
            if not one.accepted:
                continue
            wound = all_windings(arm, one.value, own) if windings else nearest_windings(arm, one.value[None], own)
            for values, past in zip(wound, excess(arm, wound), strict=True):
                q = start.copy()
                q[joints] = values
                misses = (*one.residual.tolist(), float(past), *one.raw_residual.tolist())
                found.append(NeuralSolution(q, one.label, *misses))
        return sorted(found, key=lambda one: float(((one.q - start) ** 2).sum()))

    def estimates(self, position: ArrayLike, rotation: ArrayLike) -> list[Estimate]:
        """What every network says of a pose, accepted or not; those that pass the gate first."""
        pose = pose_numbers(np.asarray(position, dtype=float), np.asarray(rotation, dtype=float))
        return self.kinematics.solve(pose, steps=self.steps)


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
