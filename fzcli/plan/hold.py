"""Keep the tip where it starts."""

import math
from typing import Literal

import casadi as ca

from fzcli.model import RobotModel
from fzcli.plan.reference import Start, TipMotion, TipReference, tip_reference
from fzcli.spec.base import SpecModel


class HoldSpec(SpecModel):
    """The tip's pose at the start, for as long as the run lasts (the run gives its duration)."""

    kind: Literal["hold"] = "hold"


def build(spec: HoldSpec, model: RobotModel, tip: str | None = None) -> TipReference:
    """A reference without parameters and without an end."""
    start = Start.symbols(model.n)
    symbols = ca.SX.sym("constants", 7)
    zero = ca.SX.zeros(3)
    return tip_reference(
        parameters={},
        start=start,
        constants=ca.vertcat(start.tip_position, start.tip_quat),
        symbols=symbols,
        time=ca.SX.sym("time"),
        motion=TipMotion(symbols[:3], zero, symbols[3:], zero),
        duration=ca.SX(math.inf),
    )
