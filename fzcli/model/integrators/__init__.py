"""One-step methods for (state, input) -> rate with an attitude in the state: one small file each.

A state holds at most one unit quaternion, body to world, from entry ``attitude`` on; the rate has, in place of
its four entries, three of angular velocity in body axes. ``attitude`` None: a plain vector. Every builder
gives a Function (state, input, dt) -> state_next; the input stands still over the step. `dormand_prince`,
which parts its steps as the tolerance asks, gives an object with ``advance`` in its place.
"""

from fzcli.model.integrators.dormand_prince import DormandPrince, dormand_prince
from fzcli.model.integrators.euler import euler
from fzcli.model.integrators.munthe_kaas import munthe_kaas
from fzcli.model.integrators.rk4 import rk4

__all__ = ["DormandPrince", "dormand_prince", "euler", "munthe_kaas", "rk4"]
