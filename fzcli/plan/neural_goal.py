"""Final postures from an arm's networks, and what is to be told of them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import FzcliError, Problem, SpecError
from fzcli.learn.neural import Estimate
from fzcli.learn.neural_inverse import NeuralIkSpec, NeuralInverse, NeuralSolution, neural_inverse
from fzcli.model import RobotModel
from fzcli.plan.built import part_of
from fzcli.plan.plan_spec import PlanRun

Array = NDArray[np.float64]
SAME = 1e-9  # rad or m
METRICS = {
    "ik_neural": ("1", "whether the final posture comes from networks (0: from the exact inverse, none passed)"),
    "ik_raw_distance": ("m", "by which the networks' own answer misses the goal's position"),
    "ik_raw_angle": ("rad", "by which it misses the goal's orientation"),
    "ik_refined_distance": ("m", "the same after the Newton steps"),
    "ik_refined_angle": ("rad", "the same after the Newton steps"),
}


@dataclass(frozen=True)
class NeuralGoal:
    """What networks make of a goal: ``solutions`` that pass gate and limits, nearest first, and all ``estimates``."""

    solutions: tuple[NeuralSolution, ...]
    estimates: tuple[Estimate, ...]

    def told(self, q: Array) -> dict[str, float]:
        """Numbers of `METRICS` for a plan that ends at q (n)."""
        for one in self.solutions:
            if np.abs(one.q - q).max() < SAME:
                return _numbers(True, one.raw_distance, one.raw_angle, one.distance, one.angle)
        best = self.estimates[0]
        return _numbers(False, *best.raw_residual.tolist(), *best.residual.tolist())


def _numbers(used: bool, *values: float) -> dict[str, float]:
    return dict(zip(METRICS, (float(used), *map(float, values)), strict=True))


def neural_goal(spec: PlanRun, model: RobotModel, position: Array, rotation: Array, near: Array) -> NeuralGoal | None:
    """What the plan's networks make of a pose in the base frame; None where the plan asks for no networks.

    Raises SpecError: they are missing, damaged, or of another robot.
    """
    ik = spec.ik
    if not isinstance(ik, NeuralIkSpec):
        return None
    try:
        inverse: NeuralInverse = part_of(model, ("neural", ik), lambda: neural_inverse(ik, model.robot))
    except FzcliError as error:
        raise SpecError(Problem(str(error), field="ik.networks")) from None
    found = inverse.solve(position, rotation, near=near, windings=True)
    inside = tuple(one for one in found if one.excess <= 0)
    return NeuralGoal(inside, tuple(inverse.estimates(position, rotation)))


def neural_misfits(spec: PlanRun) -> Iterator[tuple[tuple[str, ...], str]]:
    """Where networks do not serve a plan: the field's path, and what is wrong with it."""
    if not isinstance(spec.ik, NeuralIkSpec):
        return
    if spec.goal.position is None:
        yield ("ik",), "serves goals that are given as position and rpy of the first tip"
    elif spec.goal.rpy is None:
        yield ("goal",), "rpy is needed: networks are asked for whole poses"
    if spec.robot.base.floating and not spec.hold_base:
        yield ("ik",), "networks give postures on a base that stands still; say hold_base: true, or kind: exact"
