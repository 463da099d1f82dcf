"""How runs come to their target: distance, angle to the wanted direction, and how far the base turns."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.rollout import Rollout
from fzcli.view.joint_plot import shade_drives
from fzcli.view.style import dress, line_style, log_worthy, new_figure
from fzcli.view.target import drives, headline, outcome, signal, tolerance

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
BROKEN = (0, (4, 2))


@dataclass(frozen=True)
class Curve:
    """One line of the figure: distance (T,) [m], angle (T,) [rad] or NaN, turn of the base (T,) [rad] or NaN."""

    label: str
    run: Rollout
    distance: Array
    angle: Array
    turn: Array
    look: dict[str, Any]


def reach_figure(runs: Sequence[tuple[str, Rollout]], title: str = "") -> "Figure":
    """Labelled runs together: distance to the target, angle to the wanted direction, turn of the base.

    The first run lies on top. Broken lines: where the tip of a run that leaves out the base's turn really is.
    Horizontal lines: the tolerances of the stop condition, where the first run's specification has them.
    Of one run the drives after a restart are shaded; of several they are the wide parts of the lines.

    Raises:
        RecordError: a run has no signal "target_distance".
    """
    curves = _curves(runs)
    angled = any(np.isfinite(curve.angle).any() for curve in curves)
    turned = any(float(np.nanmax(curve.turn, initial=0.0)) > 0 for curve in curves)
    rows = 1 + angled + turned
    figure = new_figure(7.2, 1.0 + 2.0 * rows)
    all_axes = np.atleast_1d(figure.subplots(rows, 1, sharex=True))
    far = max((float(np.max(values)) for c in curves if len(values := c.distance[np.isfinite(c.distance)])), default=0)
    unit, scale = ("mm", 1e3) if far < 10.0 else ("m", 1.0)
    allowed = tolerance(runs[0][1], "position")
    _errors(all_axes[0], curves, [scale * c.distance for c in curves], allowed and scale * allowed, unit)
    dress(all_axes[0], "", f"distance to target [{unit}]")
    if angled:
        allowed = tolerance(runs[0][1], "direction", "orientation")
        angles = [np.rad2deg(c.angle) for c in curves]
        _errors(all_axes[1], curves, angles, allowed and float(np.rad2deg(allowed)), "deg")
        dress(all_axes[1], "", "angle to target [deg]")
    if turned:
        _lines(all_axes[-1], curves, [np.rad2deg(c.turn) for c in curves])
        all_axes[-1].set_ylim(bottom=-0.04 * all_axes[-1].get_ylim()[1])
        dress(all_axes[-1], "", "base turned by [deg]")
    all_axes[-1].set_xlabel("time [s]")
    for axes in all_axes:
        axes.margins(x=0.01)
    for axes in all_axes[:-1]:
        axes.tick_params(labelbottom=False)
    figure.align_ylabels(all_axes)
    figure.suptitle(headline(runs[0][1], title) if len(runs) == 1 else title, fontsize=10)
    _legend(figure, all_axes[0], len(curves))
    return figure


def turn_angle(quat: Array) -> Array:
    """The angle (T,) rad, 0 to pi, between each attitude (T, 4) w x y z and the first."""
    scalar, vector = quat[:, 0], quat[:, 1:]
    apart = scalar[0] * vector - scalar[:, None] * vector[0] - np.cross(vector[0], vector)
    angle: Array = 2.0 * np.arctan2(np.linalg.norm(apart, axis=1), np.abs(quat @ quat[0]))
    return angle


def _curves(runs: Sequence[tuple[str, Rollout]]) -> list[Curve]:
    curves = []
    for index, (label, run) in enumerate(runs):
        distance = signal(run, "target_distance", "reach")
        none = np.full(len(run.time), np.nan)
        look = {**line_style(index), "zorder": 4 - index / len(runs)}
        angle = np.asarray(run.signals.get("target_angle", none))
        turn = turn_angle(run.base_quat)
        curves.append(Curve(f"{label}: {outcome(run)}", run, distance, angle, turn, look))
        if "miss_distance" in run.signals:
            miss, off = np.asarray(run.signals["miss_distance"]), np.asarray(run.signals.get("miss_angle", none))
            text = f"{label}, on the base that turns: {1e3 * miss[-1]:.3g} mm off"
            curves.append(Curve(text, run, miss, off, none, {**look, "linestyle": BROKEN}))
    return curves


def _errors(
    axes: "Axes", curves: Sequence[Curve], histories: Sequence[Array], limit: float | None, unit: str
) -> None:
    """Errors, and what is allowed of them; on a logarithmic axis where they span much."""
    from matplotlib.ticker import NullFormatter

    positive = [np.where(values > 0, values, np.nan) for values in histories]
    every = [float(value) for values in positive for value in values[np.isfinite(values)]]
    if log_worthy([*every, *([limit] if limit else [])]):
        axes.set_yscale("log")
        _lines(axes, curves, positive)
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
        if limit:  # an error that passes through zero on its way would stretch the axis without end
            ends = [float(values[-1]) for values in positive if np.isfinite(values[-1])]
            axes.set_ylim(bottom=0.5 * min([0.4 * limit, *ends]))
    else:
        _lines(axes, curves, histories)
        axes.set_ylim(bottom=0)
    if limit:
        axes.axhline(limit, color="#808080", linewidth=1.0, zorder=1)
        axes.annotate(
            f"tolerance {limit:.3g} {unit}", (0.0, limit), (5, 3), ("axes fraction", "data"), "offset points",
            ha="left", va="bottom", fontsize=8, color="#404040",
        )  # fmt: skip


def _lines(axes: "Axes", curves: Sequence[Curve], histories: Sequence[Array]) -> None:
    """A line a curve, with a dot where it ends, and the drives after a restart."""
    for curve, values in zip(curves, histories, strict=True):
        time, color = curve.run.time, curve.look["color"]
        axes.plot(time, values, label=curve.label, **curve.look)
        axes.plot(time[-1:], values[-1:], marker="o", markersize=4, color=color, zorder=curve.look["zorder"])
        for start, end in drives(curve.run) if len(curves) > 1 else ():
            part = (time >= start) & (time <= end)
            axes.plot(time[part], values[part], color=color, linewidth=5, alpha=0.3, zorder=2)
    if len(curves) == 1:
        shade_drives(axes, curves[0].run)


def _legend(figure: "Figure", axes: "Axes", count: int) -> None:
    """Below the panels: what the lines are; of a single one, which the title names, only the shading."""
    handles, texts = axes.get_legend_handles_labels()
    if count == 1:
        handles, texts = handles[1:], texts[1:]
    if handles:
        across = 1 if len(handles) < 4 else 2
        figure.legend(handles, texts, loc="outside lower center", ncols=across, fontsize=9, frameon=False)
