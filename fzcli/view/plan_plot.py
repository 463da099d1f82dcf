"""Figures of a plan: its joints with two derivatives, its path among the obstacles, its clearance."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError
from fzcli.loop.rollout import Rollout
from fzcli.view.planned import (
    Straight,
    length_text,
    margin,
    nearest,
    plan_headline,
    speed_limits,
    steps,
    straight_path,
)
from fzcli.view.style import COLORS, dress, line_style, new_figure
from fzcli.view.target import signal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
SHADE: dict[str, Any] = {"color": "#ececec", "linewidth": 0, "zorder": 0}
THIN: dict[str, Any] = {"linewidth": 0.8, "linestyle": (0, (5, 3)), "alpha": 0.75}
SHOWN_LIMIT = 0.6  # a joint's speed limit is drawn where the joint comes to this share of it
ROOM = 0.1  # share of the axis that a text below the least clearance needs
ROWS = ("displacement", "velocity", "acceleration")
UNITS = {"rad": ("deg", "deg/s", "deg/s\N{SUPERSCRIPT TWO}"), "m": ("m", "m/s", "m/s\N{SUPERSCRIPT TWO}")}


def joints_over_time_figure(run: Rollout, title: str = "") -> "Figure":
    """Displacement, velocity and acceleration of every joint; hinges in degrees, sliding joints beside them in m.

    Thin broken lines: the straight path; shaded: where the plan leaves it. Dotted: speed limits that a joint
    comes near to. The form of Figures 9 to 14 of Parsa et al. 2008.

    Raises:
        RecordError: the run has no signal "qdd".
    """
    qdd = signal(run, "qdd", "joints_over_time")
    columns = _columns(run)
    straight = straight_path(run)
    figure = new_figure(2.9 + 4.7 * len(columns), 7.6)
    grid = figure.subplots(3, len(columns), sharex=True, squeeze=False)
    for column, (unit, joints) in enumerate(columns):
        scale = float(np.rad2deg(1.0)) if unit == "rad" else 1.0
        own = (run.q, run.qd, qdd)
        plain = (straight.q, straight.qd, straight.qdd) if straight else own
        for row, axes in enumerate(grid[:, column]):
            _curves(axes, run, joints, scale * own[row], scale * plain[row])
            _shade(axes, straight)
            dress(axes, "", f"{ROWS[row]} [{UNITS.get(unit, (unit, unit + '/s', unit + '/s2'))[row]}]")
            axes.margins(x=0.01)
        _limits(grid[1, column], joints, scale * run.qd, scale * speed_limits(run))
        _count_steps(grid[0, column], run)
        grid[-1, column].set_xlabel("time [s]", fontsize=9)
        figure.align_ylabels(grid[:, column])
        _legend(grid[1, column], straight)
    figure.suptitle(plan_headline(run, title), fontsize=10)
    return figure


def _columns(run: Rollout) -> list[tuple[str, list[int]]]:
    """The joints of each column of panels and their unit: hinges first; of many, about as many in each."""
    units = run.joint_units or ("rad",) * len(run.joint_names)
    found = []
    for unit in sorted(set(units), reverse=True):  # rad, then m
        joints = [j for j, own in enumerate(units) if own == unit]
        parts = np.array_split(joints, int(np.ceil(len(joints) / len(COLORS))))
        found += [(unit, part.tolist()) for part in parts]
    return found


def clearance_figure(run: Rollout, title: str = "") -> "Figure":
    """The smallest distance of all pairs of solids over time, the margin to keep, and where it is least.

    Raises:
        RecordError: the run has no signal "clearance", or nothing that can come near something.
    """
    values = signal(run, "clearance", "clearance")
    least = nearest(run)
    if least is None:
        raise RecordError("has nothing that could come near anything: no clearance to draw")
    unit, scale = ("mm", 1e3) if float(np.nanmax(values[np.isfinite(values)])) < 2.0 else ("m", 1.0)
    figure = new_figure(7.2, 3.8)
    axes = figure.subplots()
    axes.plot(run.time, scale * np.where(np.isfinite(values), values, np.nan), **line_style(0))
    axes.margins(x=0.01, y=0.08)
    low, high = axes.get_ylim()
    low = min(0.0, scale * least[0] - 0.08 * (high - low)) if least[0] < 0 else 0.0
    axes.set_ylim(low, high)
    _shade(axes, straight_path(run), "off the straight path")
    if low < 0:
        axes.axhspan(low, 0.0, color="#f6d5c5", linewidth=0, zorder=0.5, label="contact")
    kept = margin(run)
    if kept:
        axes.axhline(scale * kept, label=f"margin {length_text(kept)}", **{**line_style(1), "linewidth": 1.1})
    axes.plot([least[1]], [scale * least[0]], "o", color=COLORS[0], markersize=5, zorder=5)
    below = scale * least[0] - low > ROOM * (high - low)
    axes.annotate(
        f"{length_text(least[0])} at {least[1]:.3g} s", (least[1], scale * least[0]), (0, -9 if below else 9),
        textcoords="offset points", ha="center", va="top" if below else "bottom", fontsize=8, zorder=6,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1},
    )  # fmt: skip
    dress(axes, "time [s]", f"smallest distance [{unit}]")
    handles, texts = axes.get_legend_handles_labels()
    if handles:
        figure.legend(handles, texts, loc="outside lower center", ncols=len(texts), fontsize=9, frameon=False)
    figure.suptitle(plan_headline(run, title), fontsize=10)
    return figure


def _curves(axes: "Axes", run: Rollout, joints: list[int], values: Array, plain: Array) -> None:
    for color, index in zip(COLORS, joints, strict=False):
        name = run.joint_names[index].replace("_", " ")
        axes.plot(run.time, values[:, index], color=color, linewidth=1.4, label=name, zorder=3)
        if not np.allclose(plain[:, index], values[:, index], atol=1e-6):
            axes.plot(run.time, plain[:, index], color=color, zorder=2, **THIN)


def _shade(axes: "Axes", straight: Straight | None, label: str = "") -> None:
    """A grey band where the plan is off the straight path."""
    for number, (begin, end) in enumerate(straight.away if straight else ()):
        axes.axvspan(begin, end, label="" if number else label, **SHADE)


def _limits(axes: "Axes", joints: list[int], speeds: Array, limits: Array) -> None:
    """Speed limits (n) of the joints whose speeds (T, n) come near to theirs, on the side where they do."""
    label = "speed limit"
    for color, index in zip(COLORS, joints, strict=False):
        for side in (-1.0, 1.0):
            if (side * speeds[:, index]).max() > SHOWN_LIMIT * limits[index]:
                axes.axhline(side * limits[index], color=color, label=label, linewidth=0.9, linestyle=":")
                label = ""


def _count_steps(axes: "Axes", run: Rollout) -> None:
    """The plan's steps along the top."""
    from matplotlib.ticker import MaxNLocator

    count = steps(run)
    duration = float(run.time[-1] - run.time[0])
    if not count or duration <= 0:
        return
    start, step = float(run.time[0]), duration / count

    def counted(times: Any) -> Any:
        return (times - start) / step

    def timed(numbers: Any) -> Any:
        return start + numbers * step

    top = axes.secondary_xaxis("top", functions=(counted, timed))
    top.set_xlabel("step", fontsize=9)
    top.xaxis.set_major_locator(MaxNLocator(12, steps=[1, 2, 5, 10], integer=True))
    top.tick_params(labelsize=8)


def _legend(axes: "Axes", straight: Straight | None) -> None:
    """What the lines of a column of panels are, to the right of it."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles, texts = axes.get_legend_handles_labels()
    if straight and straight.away:
        handles += [Line2D([], [], color="#404040", **THIN), Patch(**SHADE)]
        texts += ["straight path", "off it"]
    look = {"fontsize": 9, "frameon": False, "handlelength": 2.2}
    axes.legend(handles, texts, loc="center left", bbox_to_anchor=(1.0, 0.5), **look)
