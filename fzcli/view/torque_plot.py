"""A run at torque level: how closely it follows the velocity-level run, what it costs, and what the base feels."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from fzcli.loop.rollout import Rollout
from fzcli.view.attitude import roll_pitch_yaw
from fzcli.view.style import dress, line_style, new_figure, side_legend

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOTIONLESS = 1e-12  # below, a deviation is not drawn on a logarithmic axis


def at_torque_level(run: Rollout) -> bool:
    """Whether the run has torques."""
    return "torque" in run.signals and "tip_deviation" in run.signals


def following_figure(runs: Mapping[str, Rollout], title: str = "") -> "Figure":
    """Distance of the tip from the motion followed, the base's yaw, and the largest torque, of several runs."""
    figure = new_figure(8.6, 6.6)
    tip, yaw, torque = figure.subplots(3, 1, sharex=True)
    for index, (name, run) in enumerate(runs.items()):
        style = line_style(index)
        yaw.plot(run.time, np.rad2deg(roll_pitch_yaw(run.base_quat)[:, 2]), label=name, **style)
        if at_torque_level(run):
            away = np.asarray(run.signals["tip_deviation"]) * 1e3
            tip.plot(run.time, np.where(away > MOTIONLESS, away, np.nan), label=name, **style)
            torque.plot(run.time, run.signals["torque_peak"], label=name, **style)
    for axes in (tip, torque):
        axes.set_yscale("log")
    dress(tip, "", "tip off the motion\nfollowed [mm]")
    dress(yaw, "", "base yaw [deg]")
    dress(torque, "time [s]", "largest torque\nin the step [N m]")
    side_legend(yaw)
    figure.suptitle(title, fontsize=10)
    return figure


Panel = tuple[str, Callable[["Axes", Rollout], None]]


def torque_figure(run: Rollout, title: str = "") -> "Figure":
    """Torques, power and energy of one run, and what its arm does to its base."""
    panels: list[Panel] = [
        ("torque [N m]", _torques),
        ("power [W]", _power),
        ("energy [J]", _energy),
        ("force on\nthe base [N]", lambda axes, one: _vector(axes, one, "base_reaction", slice(0, 3))),
        ("moment on\nthe base [N m]", lambda axes, one: _vector(axes, one, "base_reaction", slice(3, 6))),
        ("base's angular\nmomentum [N m s]", lambda axes, one: _vector(axes, one, "base_momentum", slice(3, 6))),
    ]
    if "wheel_momentum" in run.signals:
        panels.append(("wheels [N m s]", lambda axes, one: _vector(axes, one, "wheel_momentum", slice(0, 3))))
    figure = new_figure(8.6, 0.6 + 1.6 * len(panels))
    every = figure.subplots(len(panels), 1, sharex=True)
    for axes, (label, draw) in zip(every, panels, strict=True):
        draw(axes, run)
        dress(axes, "", label)
    every[-1].set_xlabel("time [s]", fontsize=9)
    figure.suptitle(title, fontsize=10)
    return figure


def _torques(axes: "Axes", run: Rollout) -> None:
    for index, name in enumerate(run.joint_names):
        axes.plot(run.time, np.asarray(run.signals["torque"])[:, index], label=name, **line_style(index))
    side_legend(axes)


def _power(axes: "Axes", run: Rollout) -> None:
    axes.plot(run.time, run.signals["power_peak"], label="of all motors, by size", **line_style(0))
    side_legend(axes)


def _energy(axes: "Axes", run: Rollout) -> None:
    for index, (name, label) in enumerate((("kinetic_energy", "kinetic"), ("motor_energy", "through motors"))):
        axes.plot(run.time, run.signals[name], label=label, **line_style(index))
    side_legend(axes)


def _vector(axes: "Axes", run: Rollout, name: str, part: slice) -> None:
    values = np.asarray(run.signals[name])[:, part]
    for index, axis in enumerate("xyz"):
        axes.plot(run.time, values[:, index], label=axis, **line_style(index))
    side_legend(axes)
