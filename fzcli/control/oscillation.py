"""Which joints oscillate: velocities against their moving average (Bulgarelli 2011, section 3.1)."""

from dataclasses import dataclass
from typing import Annotated

import casadi as ca
from pydantic import Field

from fzcli.spec.base import SpecModel

LONG_AGO = -1.0e9  # a step number before any run


class OscillationSpec(SpecModel):
    """A joint oscillates when its velocity crossed its moving average twice within a window.

    The paper gives none of the three numbers; these are our choice.
    """

    average: Annotated[int, Field(ge=2, le=10000, description="samples of the moving average")] = 5
    window: Annotated[int, Field(ge=1, description="steps within which the two crossings fall")] = 8
    ignore_below: Annotated[float, Field(ge=0, description="smallest crossing that counts, rad/s or m/s")] = 1e-3


@dataclass(frozen=True)
class Oscillation:
    """The detector's next memory (3 m: last side, last and second last crossing) and ``count`` (1)."""

    memory: ca.SX
    count: ca.SX


def memory0(size: int) -> ca.SX:
    """Memory of a detector of ``size`` velocities that has seen nothing, (3 size)."""
    return ca.vertcat(ca.SX.zeros(size), ca.SX.ones(2 * size) * LONG_AGO)


def detect(
    spec: OscillationSpec, velocity: ca.SX, history: ca.SX, memory: ca.SX, step: ca.SX
) -> Oscillation:
    """One step of the detector.

    ``velocity`` (m) now; ``history`` (m) the sum of the ``average - 1`` samples before, so that the
    average includes the current one. A crossing is a change of side, from beyond ``ignore_below``
    on the one to beyond it on the other.
    """
    m = velocity.shape[0]
    side, last, second = memory[:m], memory[m : 2 * m], memory[2 * m :]
    deviation = velocity - (history + velocity) * (1.0 / spec.average)
    counts = ca.fabs(deviation) > spec.ignore_below
    new_side = ca.if_else(counts, deviation, side)
    crossed = new_side * side < 0
    new_second = ca.if_else(crossed, last, second)
    new_last = ca.if_else(crossed, step, last)
    oscillates = new_second > step - spec.window
    count = ca.SX(0)
    for i in range(m):
        count = count + ca.if_else(oscillates[i], 1.0, 0.0)
    return Oscillation(ca.vertcat(new_side, new_last, new_second), count)
