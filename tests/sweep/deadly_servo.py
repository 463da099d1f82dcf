"""A controller of another package, whose servo driver is called at every step: what kills it kills the process.

The driver reads from address 0 at a start whose first angle is $DEADLY_START, on the third configuration. The builder
aborts at the order $DEADLY_ORDER.
"""

import ctypes
import os
from typing import Any, Literal

import casadi as ca

from fzcli.control.law import Controller, InnerLoop, Law, LawInputs, make_law
from fzcli.model import RobotModel
from fzcli.spec.base import SpecModel
from fzcli.spec.quantity import Metric, Signal

DEADLY_GAIN = 3.0
ENTRY_POINT = "[fzcli.controllers]\nservo = tests.sweep.deadly_servo:CONTROLLER\n"
_servos: list[ca.Callback] = []  # CasADi does not keep them


class ServoSpec(SpecModel):
    """qd = -gain q / 10."""

    kind: Literal["servo"] = "servo"
    gain: float = 1.0
    order: float = 1.0


class _Servo(ca.Callback):  # type: ignore[misc]
    """(nothing, q) -> joint rates."""

    def __init__(self, n: int, gain: float) -> None:
        super().__init__()
        self.n, self.gain = n, gain
        self.construct("servo", {})

    def get_n_in(self) -> int:
        return 2

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.n, 1)

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.n, 1)

    def eval(self, given: list[ca.DM]) -> list[ca.DM]:
        if self.gain == DEADLY_GAIN and repr(float(given[1][0])) == os.environ.get("DEADLY_START"):
            ctypes.string_at(0)
        return [-0.1 * self.gain * given[1]]


def _build(model: RobotModel, spec: ServoSpec) -> Law:
    if repr(spec.order) == os.environ.get("DEADLY_ORDER"):
        os.abort()
    inputs, rates = LawInputs.symbols(model.n), ca.SX.sym("rates", model.n)
    _servos.append(_Servo(model.n, spec.gain))
    given: list[Any] = [ca.SX.zeros(model.n), inputs.q]
    before = ca.Function("before", list(inputs.as_dict().values()), given)
    return make_law(
        inputs,
        command=rates,
        signals={Signal("speed", "rad/s", "norm of the joint rates"): ca.norm_2(rates)},
        metrics=(Metric("speed_mean", "speed", "mean", "rad/s", "mean norm of the joint rates"),),
        parameters={},
        angles=False,
        inner=(InnerLoop(before, _servos[-1], 1), rates),
    )


CONTROLLER = Controller(ServoSpec, _build)
