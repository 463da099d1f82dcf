"""A plan in space: the arm on its way among the obstacles, all true to size."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError
from fzcli.loop.rollout import Rollout
from fzcli.view.arm_plot import time_shades, typical_steps
from fzcli.view.planned import base_solids, nearest, obstacles, plan_headline, solid_at
from fzcli.view.solids import Solid, Solids, finely, open_view
from fzcli.view.space import FAINT, Scene
from fzcli.view.style import COLORS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fzcli.plan.scene import Obstacle

Array = NDArray[np.float64]
Painted = tuple[Solid, tuple[float, ...]]
SHOWN = 7  # arms: at the start, at the end, where the arm is nearest to something, and between
SPACING = 0.008  # of lines, as a share of the scene's size: how finely they are cut where a solid hides them
LOOKED_AT = 5  # every how manieth sample of the tip's path decides on the view
STANDING = (0.72, 0.45, 0.20)
BODY = ((0.60, 0.60, 0.64), (0.40, 0.40, 0.46))  # first and last
CUT = 0.08  # of a free base below all else, as a share of the scene's size


def path_figure(run: Rollout, title: str = "") -> "Figure":
    """The tip's path and the arm at some steps, light to dark as time goes, among the obstacles of the scene.

    Obstacles are true to size; moving ones stand where they are when the arm is drawn, in its shade. What a
    solid hides shows faintly through it. A free base is cut off below. The form of Figures 7 and 15 of Parsa
    et al. 2008.

    Raises:
        RecordError: a sample is not finite.
    """
    arms = _arms(run)
    shown = _shown(run, arms)
    shades = time_shades(len(shown))
    scenery, bases = _scenery(run, shown, shades), _bases(run, shown)
    bodies = [arm[shown].reshape(-1, 3) for arm in arms] + [arm[:, -1] for arm in arms]
    points = np.vstack([*bodies, *(solid.corners for solid, _ in scenery)])
    size = float(np.ptp(points, axis=0).max())
    cut = [-np.inf, -np.inf, points[:, 2].min() - CUT * size]
    standing = [solid for solid, color in scenery if color is STANDING]
    lines = [arm[::LOOKED_AT, -1] for arm in arms] + [finely(arm[k], 0.02) for arm in arms for k in shown]
    view = open_view(points, np.vstack(lines), standing)
    scene = Scene(np.vstack([points, *(np.maximum(solid.corners, cut) for solid, _ in bases)]), view=view)
    solids = Solids(scene, shadows=not bases)
    for solid, color in (*scenery, *bases):
        solids.add(solid, color)
    solids.draw()
    _draw_tips(solids, run, arms, SPACING * size, shadows=not bases)
    for rank, (step, color) in enumerate(zip(shown, shades, strict=True)):
        _draw_arms(solids, [arm[step] for arm in arms], 10.0 + rank, SPACING * size, color, f"{run.time[step]:.2f} s")
    _explain(scene, run, bool(bases))
    _name(scene, run, float(run.time[shown[0]]))
    return scene.finish(plan_headline(run, title))


def _draw_tips(solids: Solids, run: Rollout, arms: list[Array], spacing: float, shadows: bool) -> None:
    """The paths of the tips, that of the first without detours, and their shadows on the floor."""
    for number, arm in enumerate(arms):
        look = {"color": COLORS[1], "linewidth": 1.6}
        solids.line(arm[:, -1], 30.0, spacing, label="" if number else "tip" if len(arms) == 1 else "tips", **look)
    straight = run.signals.get("straight_tip")
    if straight is not None and not np.allclose(straight, run.tip_position, atol=1e-6):
        look = {"color": COLORS[1], "linewidth": 1.1, "linestyle": (0, (4, 2))}
        label = "tip, no detour" if len(arms) == 1 else "first tip, no detour"
        solids.line(np.asarray(straight), 29.0, spacing, label=label, **look)
    for number, arm in enumerate(arms if shadows else []):
        below = np.column_stack([arm[:, -1, :2], np.full(len(arm), solids.scene.floor)])
        look = {"color": "#b0b0b0", "linewidth": 1.0, "zorder": 1.5}
        solids.scene.path(below, label="" if number else "from above", **look)


def _draw_arms(
    solids: Solids, arms: list[Array], zorder: float, spacing: float, color: tuple[float, ...], label: str
) -> None:
    """The arms (k, 3) at one time."""
    dot = {"marker": "o", "markersize": 4, "markeredgecolor": "white", "markeredgewidth": 0.5}
    for number, arm in enumerate(arms):
        if len(arm) > 1:
            look = {"color": color, "linewidth": 2.2, "solid_capstyle": "round"}
            solids.line(arm, zorder, spacing, label="" if number else label, **look)
            solids.dots(arm, zorder, color=color, **dot)


def _arms(run: Rollout) -> list[Array]:
    """The arms as lines (T, k, 3), the first tip's first, or that tip alone."""
    found = [np.asarray(run.signals[name]) for name in run.signals if name.split("_")[:2] == ["arm", "points"]]
    arms = [points.reshape(len(run.time), -1, 3) for points in found] or [run.tip_position[:, None, :]]
    if not all(np.isfinite(arm).all() for arm in arms):
        raise RecordError("has samples that are not finite, which no plan has")
    return arms


def _shown(run: Rollout, arms: list[Array]) -> list[int]:
    """Samples at which the arm is drawn: evenly by its travel, one moved to the least clearance."""
    chosen = typical_steps(np.concatenate(arms, axis=1), SHOWN)
    least = nearest(run)
    if least is None:
        return [int(k) for k in chosen]
    step = int(np.abs(run.time - least[1]).argmin())
    inner = np.arange(1, len(chosen) - 1)
    if len(inner) and step not in (chosen[0], chosen[-1]):
        chosen[inner[np.abs(chosen[inner] - step).argmin()]] = step
    return sorted({int(k) for k in chosen})


def _scenery(run: Rollout, shown: list[int], shades: list[tuple[float, ...]]) -> list[Painted]:
    """The obstacles to draw, and their colours."""
    found: list[Painted] = []
    for one in obstacles(run):
        if _moves(one):
            found += [(solid_at(one, float(run.time[k])), color) for k, color in zip(shown, shades, strict=True)]
        else:
            found.append((solid_at(one, 0.0), STANDING))
    return found


def _bases(run: Rollout, shown: list[int]) -> list[Painted]:
    """The solids of a free base, as it is first and last, and their colours."""
    ends = dict.fromkeys((shown[0], shown[-1]))
    return [(solid, color) for step, color in zip(ends, BODY, strict=False) for solid in base_solids(run, step)]


def _moves(obstacle: "Obstacle") -> bool:
    return bool(any(obstacle.velocity) or any(obstacle.spin) or obstacle.waypoints)


def _explain(scene: Scene, run: Rollout, based: bool) -> None:
    """What the colours of solids mean."""
    look: dict[str, Any] = {"linestyle": "none", "marker": "s", "markersize": 8, "alpha": 0.6}
    nowhere = np.full((1, 3), np.nan)
    every = obstacles(run)
    if not all(_moves(one) for one in every):
        scene.path(nowhere, color=STANDING, label="obstacle", **look)
    if any(_moves(one) for one in every):
        scene.path(nowhere, color=FAINT, label="moving obstacle,\nin the arm's shade", **look)
    if based:
        scene.path(nowhere, color=BODY[0], label="base, first and last", **look)


def _name(scene: Scene, run: Rollout, start: float) -> None:
    """The names of obstacles that were given one, above them."""
    up = scene.view.page[1]
    for one in obstacles(run):
        if one.name:
            corners = solid_at(one, start).corners
            place = corners.mean(axis=0) + (float((corners @ up).max()) - float(corners.mean(axis=0) @ up)) * up
            scene.axes.text(*place, one.name, ha="center", va="bottom", fontsize=8, color="#404040", zorder=40)
