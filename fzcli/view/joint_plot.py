"""Joint positions over time, in the units people read."""

from typing import TYPE_CHECKING

import numpy as np

from fzcli.loop.rollout import Rollout
from fzcli.view.style import dress, line_style, new_figure
from fzcli.view.target import drives, headline

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def joints_figure(run: Rollout, title: str = "") -> "Figure":
    """Angles of the hinges in degrees, and below them, where there are any, places of the sliding joints in m.

    Shaded while the arm drives to a posture found by a restart search. The form of Figure 10 of Dong et al. 2022.
    """
    units = run.joint_units or ("rad",) * len(run.joint_names)
    panels = sorted(set(units), reverse=True)  # rad, then m
    figure = new_figure(7.2, 0.8 + 3.2 * len(panels))
    all_axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, unit in zip(all_axes, panels, strict=True):
        for index, name in enumerate(run.joint_names):
            if units[index] == unit:
                values = np.rad2deg(run.q[:, index]) if unit == "rad" else run.q[:, index]
                axes.plot(run.time, values, label=name.replace("_", " "), **line_style(index))
        dress(axes, "", "joint angle [deg]" if unit == "rad" else f"joint position [{unit}]")
        shade_drives(axes, run)
        axes.margins(x=0.01)
    all_axes[-1].set_xlabel("time [s]", fontsize=9)
    handles = {text: line for axes in all_axes for line, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles, loc="outside right center", fontsize=9, frameon=False)
    figure.suptitle(headline(run, title), fontsize=10)
    return figure


def shade_drives(axes: "Axes", run: Rollout) -> None:
    """A grey band over each drive to a posture that a restart search has found, the first one labelled."""
    for number, (start, end) in enumerate(drives(run)):
        label = "" if number else "drive after a restart"
        axes.axvspan(start, end, label=label, color="#e3e3e3", linewidth=0, zorder=0)
