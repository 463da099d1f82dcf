"""Figures of single runs: one run whole, and several side by side."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from fzcli.loop.rollout import Rollout
from fzcli.view.attitude import roll_pitch_yaw
from fzcli.view.style import COLORS, dress, line_style, new_figure, side_legend, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Panel = Callable[["Axes", Rollout], None]


def rollout_figure(rollout: Rollout, title: str = "") -> "Figure":
    """One run over time, what it has of: joints, tip errors, base attitude, gains, oscillating joints."""
    panels: list[Panel] = [_joints]
    if "tip_error" in rollout.signals:
        panels.append(partial(_error, name="tip_error"))
    if "target_distance" in rollout.signals:
        panels.append(partial(_error, name="target_distance"))
    panels.append(_attitude)
    if gain_names(rollout):
        panels.append(_gains)
    if "oscillating_joints" in rollout.signals:
        panels.append(_oscillating)
    figure = new_figure(8.0, 0.6 + 1.75 * len(panels))
    all_axes = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    for axes, panel in zip(all_axes, panels, strict=True):
        panel(axes, rollout)
    for axes in all_axes[:-1]:
        axes.tick_params(labelbottom=False)
        axes.set_xlabel("")
    status = rollout.status
    ending = status.name if not status.reason else f"{status.name}: {status.reason}"
    figure.suptitle("\n".join(part for part in (title, ending) if part), fontsize=10)
    return figure


def gain_names(rollout: Rollout) -> list[str]:
    """Names of the signals that are gains in force."""
    return [name for name in rollout.signals if name == "gain" or _gain_axis(name)]


def _gain_axis(name: str) -> bool:
    return name.startswith("gain_") and not name.startswith("gain_increment")


def _joints(axes: "Axes", run: Rollout) -> None:
    units = list(dict.fromkeys(run.joint_units)) or ["rad"]
    for index, name in enumerate(run.joint_names):
        axes.plot(run.time, run.q[:, index], label=name, **line_style(index))
    dress(axes, "time [s]", with_unit("joint position", " or ".join(units)))
    side_legend(axes)


def _error(axes: "Axes", run: Rollout, name: str) -> None:
    values = np.asarray(run.signals[name])
    shown = np.where(values > 0, values, np.nan)
    axes.plot(run.time, shown, label="tip", **line_style(0))
    if np.isfinite(shown).any():
        axes.set_yscale("log")
    unit = run.signal_info[name].unit if name in run.signal_info else "m"
    dress(axes, "time [s]", with_unit(name, unit))


def _attitude(axes: "Axes", run: Rollout) -> None:
    for index, (name, values) in enumerate(
        zip(("roll", "pitch", "yaw"), roll_pitch_yaw(run.base_quat).T, strict=True)
    ):
        axes.plot(run.time, values, label=name, **line_style(index))
    dress(axes, "time [s]", "base attitude [rad]")
    side_legend(axes)


def _gains(axes: "Axes", run: Rollout) -> None:
    for index, (label, values) in enumerate(_gain_histories(run)):
        axes.plot(run.time, values, label=label, **line_style(index))
    dress(axes, "time [s]", with_unit("gain", _gain_unit(run)))
    if len(_gain_histories(run)) > 1:
        side_legend(axes)


def _gain_histories(run: Rollout) -> list[tuple[str, np.ndarray]]:
    """Label and values of every gain, one entry a component."""
    found = []
    for name in gain_names(run):
        values = np.asarray(run.signals[name])
        if values.ndim == 1:
            found.append((name.removeprefix("gain_"), values))
            continue
        info = run.signal_info.get(name)
        labels = info.components if info is not None else ()
        for index in range(values.shape[1]):
            found.append((labels[index] if labels else str(index), values[:, index]))
    return found


def _gain_unit(run: Rollout) -> str:
    info = run.signal_info.get(gain_names(run)[0])
    return info.unit if info is not None else ""


def _oscillating(axes: "Axes", run: Rollout) -> None:
    from matplotlib.ticker import MaxNLocator

    values = np.asarray(run.signals["oscillating_joints"]).reshape(len(run.time), -1).sum(axis=1)
    axes.fill_between(run.time, values, step="post", color=COLORS[0], alpha=0.35, linewidth=0)
    axes.step(run.time, values, where="post", **line_style(0))
    axes.set_ylim(0, max(1.0, float(np.nanmax(values, initial=0.0))) * 1.08)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    dress(axes, "time [s]", "oscillating joints")


def plot_comparison(runs: Sequence[tuple[str, Rollout]], title: str = "") -> "Figure":
    """Base yaw of several runs of one trajectory on the left, their gains on the right.

    The form of Figures 3 to 5 of Bulgarelli et al. 2011. Runs without a gain are on the left alone.
    """
    figure = new_figure(9.5, 3.8)
    left, right = figure.subplots(1, 2)
    gained = False
    yaws = [roll_pitch_yaw(run.base_quat)[:, 2] for _, run in runs]
    for index, (label, run) in enumerate(runs):
        style = line_style(index)
        below = 2 - float(np.nanmax(np.abs(yaws[index]))) / 4  # the calm runs on top of the violent ones
        left.plot(run.time, yaws[index], label=label, zorder=below, **style)
        for _, values in _gain_histories(run):
            right.plot(run.time, values, **style)
            gained = True
    dress(left, "time [s]", "base yaw [rad]")
    _clip_spikes(left, yaws)
    unit = next((_gain_unit(run) for _, run in runs if gain_names(run)), "")
    dress(right, "time [s]", with_unit("null-space gain", unit))
    if not gained:
        right.text(
            0.5, 0.5, "no run has a gain", ha="center", va="center", transform=right.transAxes, fontsize=9
        )
    figure.legend(loc="outside lower center", ncols=min(4, len(runs)), fontsize=9, frameon=False)
    figure.suptitle(title, fontsize=10)
    return figure


def _clip_spikes(axes: "Axes", yaws: Sequence[np.ndarray]) -> None:
    """Where few samples lie far outside, the axis shows the rest, and says how far they go."""
    every = np.concatenate(yaws)
    low, high = np.nanpercentile(every, (1, 99))
    far = float(np.nanmax(np.abs(every)))
    reach = max(abs(low), abs(high))
    if far > 5 * reach > 0:
        axes.set_ylim(-1.6 * reach, 1.6 * reach)
        axes.set_title(f"spikes reach {far:.2g} rad", fontsize=8, loc="right")
