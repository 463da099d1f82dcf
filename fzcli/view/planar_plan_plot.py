"""Figures of a plan of a planar 3-RRR: the mechanism on its way among the obstacles, and its singularity measures."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.rollout import Rollout
from fzcli.view.arm_plot import time_shades, typical_steps
from fzcli.view.planned import nearest, obstacles, plan_headline, straight_path
from fzcli.view.style import COLORS, dress, line_style, new_figure
from fzcli.view.target import signal, spec_section, specification

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fzcli.plan.scene import Obstacle

Array = NDArray[np.float64]
SHOWN = 4  # mechanisms: at the start, at the end, where it is nearest to an obstacle, and between
ARC = 12  # points of half a circle
LEGS = ("arm_points", "arm_points_leg2", "arm_points_leg3")
PLATFORM = "arm_points_platform"
STANDING = "#B87333"
BASE = "#404040"
NAMES = ("sine of elbow 1", "of elbow 2", "of elbow 3", "det A")


def is_planar(run: Rollout) -> bool:
    """Whether the run is a plan of a planar 3-RRR."""
    return all(name in run.signals for name in (*LEGS, PLATFORM, "singularity"))


def planar_path_figure(run: Rollout, title: str = "") -> "Figure":
    """The mechanism at some steps, light to dark as time goes, and the path of the platform's centre.

    Links, platform and obstacles are true to size; moving obstacles stand where they are when the mechanism is
    drawn, in its shade. Broken: the path of the centre without detours. The form of Figure 7 of Parsa et al. 2008.
    """
    legs = [run.signals[name].reshape(-1, 3, 3)[:, :, :2] for name in LEGS]
    platform = run.signals[PLATFORM].reshape(-1, 3, 3)[:, :, :2]
    shown = _shown(run, np.concatenate([leg[:, 1:] for leg in legs], axis=1))
    shades = time_shades(len(shown))
    figure = new_figure(7.4, 5.7)
    axes = figure.subplots()
    radius = _radius(run)
    for step, color in zip(shown, shades, strict=True):
        sides = [leg[step, k : k + 2] for leg in legs for k in (0, 1)]
        sides += [platform[step][[k, (k + 1) % 3]] for k in range(3)]
        axes.fill(*platform[step].T, color=color, alpha=0.15, linewidth=0, zorder=2)
        _solids(axes, sides, radius, color)
        joints = np.vstack([leg[step, 1:] for leg in legs])
        axes.plot(*joints.T, "o", color="white", markeredgecolor=color, markersize=3, linewidth=0, zorder=5)
        axes.plot([], [], color=color, linewidth=4, label=f"{run.time[step]:.2f} s")
    feet = np.array([leg[0, 0] for leg in legs])
    axes.plot(*feet.T, "^", color=BASE, markersize=8, linestyle="none", label="driven joints", zorder=6)
    for number, foot in enumerate(feet, start=1):
        axes.annotate(str(number), foot, (0, -13), textcoords="offset points", ha="center", fontsize=8, color=BASE)
    centre: dict[str, Any] = {"color": COLORS[1], "zorder": 7}
    axes.plot(*run.tip_position[:, :2].T, linewidth=1.6, label="platform's centre", **centre)
    straight = np.asarray(run.signals["straight_tip"])
    if not np.allclose(straight, run.tip_position, atol=1e-6, equal_nan=True):
        axes.plot(*straight[:, :2].T, linewidth=1.1, linestyle=(0, (4, 2)), label="the same, no detour", **centre)
    for one in obstacles(run):
        _obstacle(axes, one, run, shown, shades)
    axes.set_aspect("equal")
    dress(axes, "x [m]", "y [m]")
    figure.legend(loc="outside right center", fontsize=9, frameon=False)
    figure.suptitle(plan_headline(run, title), fontsize=10)
    return figure


def singularity_figure(run: Rollout, title: str = "") -> "Figure":
    """Sines of the elbows (type I) and det A of unit directions (type II) over time, positive on the branch.

    Raises:
        RecordError: the run has no signal "singularity".
    """
    values = signal(run, "singularity", "singularity")
    figure = new_figure(7.2, 3.8)
    axes = figure.subplots()
    for number, (name, column) in enumerate(zip(NAMES, values.T, strict=True)):
        axes.plot(run.time, column, label=name, **line_style(number))
    off = specification(run).get("off_singular")
    if isinstance(off, int | float):
        axes.axhline(off, color=BASE, linewidth=1.0, linestyle=":", label="off_singular")
    straight = straight_path(run)
    for begin, end in straight.away if straight else ():
        axes.axvspan(begin, end, color="#ececec", linewidth=0, zorder=0)
    axes.set_ylim(bottom=min(0.0, float(values.min())))
    axes.margins(x=0.01)
    dress(axes, "time [s]", "singularity measure")
    figure.legend(loc="outside lower center", ncols=5, fontsize=9, frameon=False)
    figure.suptitle(plan_headline(run, title), fontsize=10)
    return figure


def _shown(run: Rollout, points: Array) -> list[int]:
    """Samples at which the mechanism is drawn: evenly by its travel, one moved to the least clearance."""
    chosen = typical_steps(np.concatenate([points, np.zeros((*points.shape[:2], 1))], axis=2), SHOWN)
    least = nearest(run)
    if least is not None:
        step = int(np.abs(run.time - least[1]).argmin())
        inner = np.arange(1, len(chosen) - 1)
        if len(inner) and step not in (chosen[0], chosen[-1]):
            chosen[inner[np.abs(chosen[inner] - step).argmin()]] = step
    return sorted({int(k) for k in chosen})


def _radius(run: Rollout) -> float:
    legs = spec_section(run, "robot").get("legs")
    return float(legs.get("radius", 0.0)) if isinstance(legs, dict) else 0.0


def _solids(axes: "Axes", sides: list[Array], radius: float, color: Any) -> None:
    from matplotlib.collections import PolyCollection

    outlines = [_capsule(side[0], side[1], radius) for side in sides]
    look = {"facecolor": color, "edgecolor": "white", "linewidth": 0.4, "alpha": 0.85, "zorder": 4}
    axes.add_collection(PolyCollection(outlines, **look))
    axes.update_datalim(np.vstack(outlines))


def _capsule(start: Array, end: Array, radius: float) -> Array:
    """The outline (N, 2) of a link in the plane; a circle where both ends are one."""
    way = end - start
    angle = float(np.arctan2(way[1], way[0]))
    half = np.linspace(-np.pi / 2, np.pi / 2, ARC)
    ends = ((end, angle + half), (start, angle + np.pi + half))
    return np.vstack([point + radius * np.column_stack([np.cos(a), np.sin(a)]) for point, a in ends])


def _obstacle(axes: "Axes", one: "Obstacle", run: Rollout, shown: list[int], shades: list[Any]) -> None:
    """An obstacle that stands, or where it is at the steps shown."""
    from matplotlib.patches import Polygon

    moving = bool(any(one.velocity) or any(one.spin) or one.waypoints)
    times = [float(run.time[k]) for k in shown] if moving else [0.0]
    for time, color in zip(times, shades if moving else [STANDING], strict=True):
        numbers = one.numbers([time])[0]
        start, end = numbers[:2], numbers[3:5] if one.kind == "capsule" else numbers[:2]
        look = {"facecolor": color, "edgecolor": STANDING, "linewidth": 1.2, "zorder": 3, "alpha": 0.9}
        axes.add_patch(Polygon(_capsule(start, end, float(numbers[-1])), **look))
    axes.plot([], [], "o", color=STANDING, markersize=8, linestyle="none", label=one.name or "obstacle")
