"""A target that is known to be reachable: the tip pose that a straight joint path from the start leads to."""

import math
from typing import Annotated, Literal

import casadi as ca
from pydantic import Field

from fzcli.model import RobotModel
from fzcli.model.algebra import rotate
from fzcli.model.attitude import multiply, quaternion_from_matrix, rotation_matrix
from fzcli.model.gauss_magnus import path_piece
from fzcli.plan.reference import AimName, Start, TipMotion, TipReference, tip_reference
from fzcli.spec.base import SpecModel
from fzcli.spec.quantity import Parameter
from fzcli.spec.units import JointValue


class ReachableSpec(SpecModel):
    """The tip pose after every joint has moved by ``displacement`` along one straight line, at zero momentum."""

    kind: Literal["reachable"] = "reachable"
    displacement: Annotated[tuple[JointValue, ...], Field(min_length=1, description="of the joints, in their order")]
    aim: Annotated[
        Literal["position", "direction", "pose"], Field(description="what of the pose is to be met")
    ] = "direction"


PIECES = 8  # of the path: at half a turn a joint the attitude's error is below 4e-5 rad


def build(spec: ReachableSpec, model: RobotModel, tip: str | None = None) -> TipReference:
    """The displacement is a run-time parameter."""
    start = Start.symbols(model.n)
    displacement = ca.SX.sym("displacement", model.n)
    piece = path_piece(model)
    way = displacement * (1 / PIECES)
    q, quat = start.q, start.base_quat
    for _ in range(PIECES if model.floating else 0):
        quat, q = piece(quat, q, way)
    position, rotation, _ = model.function("tip", tip)(start.q + displacement)
    constants = ca.vertcat(
        rotate(rotation_matrix(quat), position), multiply(quat, quaternion_from_matrix(rotation))
    )
    symbols, zero = ca.SX.sym("constants", 7), ca.SX.zeros(3)
    aim: AimName = spec.aim
    return tip_reference(
        parameters={Parameter("reference.displacement", model.n): displacement},
        start=start,
        constants=constants,
        symbols=symbols,
        time=ca.SX.sym("time"),
        motion=TipMotion(symbols[:3], zero, symbols[3:], zero),
        duration=ca.SX(math.inf),
        aim=aim,
    )
