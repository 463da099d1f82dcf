"""Closed-loop inverse kinematics with a fixed null-space gain: equation 1 of Bulgarelli 2011."""

from typing import Annotated, Literal

import casadi as ca
from pydantic import Field, model_validator

from fzcli.control.equation1 import Equation1Spec, Situation, detector, finish, situation
from fzcli.control.law import Law
from fzcli.model import RobotModel
from fzcli.spec.quantity import Metric, Parameter, Signal
from fzcli.spec.units import Frequency

Gain = Annotated[Frequency, Field(ge=0)]


class ClikSpec(Equation1Spec):
    """qd = J+ (Kp e + xd_d) + (E - J+ J) Jc^T Kc ec, Kc diagonal."""

    kind: Literal["clik"] = "clik"
    gain: Annotated[
        Gain | tuple[Gain, ...],
        Field(description="Kc: one number for every constrained axis, or one each, 1/s"),
    ]

    @model_validator(mode="after")
    def _one_gain_an_axis(self) -> "ClikSpec":
        check_gain_count(self.gain, self.axes)
        return self


def check_gain_count(gain: float | tuple[float, ...], axes: tuple[str, ...]) -> None:
    """Raise ValueError unless ``gain`` is one number, or one for every axis."""
    if isinstance(gain, tuple) and len(gain) != len(axes):
        raise ValueError(f"gain has {len(gain)} numbers for {len(axes)} constrained axes ({', '.join(axes)})")


def gain_signals(at: Situation, gain: ca.SX) -> tuple[dict[Signal, ca.SX], tuple[Metric, ...]]:
    """The gain in force, one scalar signal an axis, and its last value as a metric."""
    axes = at.constraint.names
    names = ["gain"] if len(axes) == 1 else [f"gain_{axis}" for axis in axes]
    signals = {
        Signal(name, "1/s", f"Kc of {axis} in force"): gain[i]
        for i, (name, axis) in enumerate(zip(names, axes, strict=True))
    }
    metrics = tuple(
        Metric(f"{name}_final", name, "last", "1/s", f"Kc of {axis} at the end")
        for name, axis in zip(names, axes, strict=True)
    )
    return signals, metrics


def build(model: RobotModel, spec: ClikSpec) -> Law:
    """Equation 1 with a fixed Kc (Bulgarelli 2011)."""
    at = situation(model, spec)
    kp, gain = ca.SX.sym("kp"), ca.SX.sym("gain", len(spec.axes))
    qd = at.task.resolve(kp, at.constraint.gradient(gain))
    signals, metrics = gain_signals(at, gain)
    parameters = {Parameter("controller.kp"): kp, Parameter("controller.gain", len(spec.axes)): gain}
    return finish(at, qd, detector(at, qd), parameters, signals, metrics)
