"""Figures of a run in space: the arm at typical steps, and the path of its tip."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import RecordError
from fzcli.loop.rollout import Rollout
from fzcli.view.space import FAINT, Scene, cube_faces
from fzcli.view.style import COLORS
from fzcli.view.target import headline, signal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
SHOWN = 7  # configurations: start, end, and those between
MARKS = 9  # time marks on a path, at most
EDGE = 0.2  # of the base's cube and of the approach arrow, as a share of the arm's length


def configurations_figure(run: Rollout, title: str = "") -> "Figure":
    """The arm at typical steps, light to dark as time goes, evenly spaced by the travel of its points.

    The base is a cube about the origin of its frame at the first and last step; its edge is a sign, not
    a measure. The form of Figure 8 of Dong et al. 2022.

    Raises:
        RecordError: the run has no signal "arm_points", or no sample is finite.
    """
    arms = signal(run, "arm_points", "configurations").reshape(len(run.time), -1, 3)
    rows = _finite_rows(arms)
    steps = rows[typical_steps(arms[rows], SHOWN)].tolist()
    edge = EDGE * float(np.linalg.norm(np.diff(arms[steps[0]], axis=0), axis=1).sum())
    ends = dict.fromkeys((steps[0], steps[-1]))
    cubes = [cube_faces(run.base_position[k], run.base_quat[k], edge).reshape(-1, 3) for k in ends]
    target = _target(run, rows)
    scene = Scene(np.vstack([arms[steps].reshape(-1, 3), *cubes, _target_points(target, edge)]), _arrow(target))
    shades = dict(zip(steps, time_shades(len(steps)), strict=True))
    digits = _digits(float(run.time[steps[-1]]))
    look = {"linewidth": 2.4, "marker": "o", "markersize": 4.5, "markeredgecolor": "white", "markeredgewidth": 0.5}
    for rank, (step, color) in enumerate(shades.items()):
        scene.path(arms[step], color=color, zorder=10 + rank, label=f"{run.time[step]:.{digits}f} s", **look)
    for step in ends:
        scene.cube(run.base_position[step], run.base_quat[step], edge, shades[step])
    if target is not None:
        scene.target(*target, edge)
    return scene.finish(headline(run, title))


def tip_path_figure(run: Rollout, title: str = "") -> "Figure":
    """The tip's path with marks in time, its start, end and target, and the path of the base frame's origin.

    The form of Figure 9 of Dong et al. 2022.

    Raises:
        RecordError: no sample is finite.
    """
    rows = _finite_rows(np.stack([run.tip_position, run.base_position], axis=1))
    tip, base = run.tip_position[rows], run.base_position[rows]
    size = float(np.max(np.ptp(np.vstack([tip, base]), axis=0))) or 1.0
    target = _target(run, rows)
    scene = Scene(np.vstack([tip, base, _target_points(target, EDGE * size)]), _arrow(target))
    floor = np.column_stack([tip[:, :2], np.full(len(tip), scene.floor)])
    scene.path(tip, color=COLORS[0], linewidth=1.8, zorder=10, label="tip")
    scene.path(floor, color="#cccccc", linewidth=1.2, zorder=1, label="tip, from above")
    for k in (0, -1):
        scene.path(np.array([floor[k], tip[k]]), color="#cccccc", linewidth=0.8, linestyle=(0, (2, 2)), zorder=1)
    scene.path(base, color=FAINT, linewidth=1.6, zorder=2, label="base origin")
    look = {"linestyle": "none", "marker": "o", "color": COLORS[0], "zorder": 20}
    scene.path(tip[0], markersize=7.5, markerfacecolor="white", markeredgewidth=1.5, label="start", **look)
    scene.path(tip[-1], markersize=6, label="end", **look)
    if target is not None:
        scene.target(*target, EDGE * size)
    _mark_times(scene, run.time[rows], tip, 0.025 * size)
    return scene.finish(headline(run, title))


def typical_steps(arms: Array, count: int) -> Rows:
    """At most ``count`` samples of points (T, k, 3), first and last among them, evenly spaced by their travel.

    The travel of all points counts, not the tip's alone, so that a swing of the arm about its tip is seen.
    """
    moves = np.linalg.norm(np.diff(arms, axis=0), axis=2).sum(axis=1)
    travel = np.concatenate([[0.0], np.cumsum(moves)])
    nearest = np.abs(travel[:, None] - np.linspace(0.0, travel[-1], count)).argmin(axis=0)
    return np.unique([0, *nearest[1:-1], len(arms) - 1]).astype(np.intp)


def time_shades(count: int) -> list[tuple[float, ...]]:
    """Colours from light to dark."""
    from matplotlib import colormaps

    return [tuple(color) for color in colormaps["viridis_r"](np.linspace(0.1, 1.0, count))]


def mark_interval(duration: float, count: int) -> float:
    """The shortest of 1, 2 and 5 times powers of ten that goes at most ``count`` times into a duration."""
    least = duration / count
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(step * power for step in (1, 2, 5, 10) if step * power >= least * (1 - 1e-9)))


def _digits(duration: float) -> int:
    """Decimals that tell times of a run from each other, two unless it is very short."""
    return 2 if duration <= 0 else max(2, 1 - int(np.floor(np.log10(duration))))


def _finite_rows(points: Array) -> Rows:
    """The samples at which points (T, k, 3) are finite."""
    rows = np.flatnonzero(np.isfinite(points).all(axis=(1, 2)))
    if not len(rows):
        raise RecordError("has no finite sample to draw")
    return rows


def _target(run: Rollout, rows: Rows) -> tuple[Array, Array | None] | None:
    """Positions and, where one is wanted, directions of the target at some samples."""
    if "target_position" not in run.signals:
        return None
    direction = run.signals.get("target_direction")
    return np.asarray(run.signals["target_position"])[rows], None if direction is None else np.asarray(direction)[rows]


def _target_points(target: tuple[Array, Array | None] | None, length: float) -> Array:
    """The points that a target and its arrow add to the scene, (N, 3)."""
    if target is None:
        return np.empty((0, 3))
    position, direction = target
    return position if direction is None else np.vstack([position, position[-1] - length * direction[-1]])


def _arrow(target: tuple[Array, Array | None] | None) -> Array | None:
    """The last wanted direction, (3,)."""
    return None if target is None or target[1] is None else target[1][-1]


def _mark_times(scene: Scene, time: Array, tip: Array, gap: float) -> None:
    """Dots on the path at even times, each with its time; those that would meet another are left out."""
    flat = scene.view.page[:2]
    middle, dots = flat @ tip.mean(axis=0), [flat @ tip[0], flat @ tip[-1]]
    labels: list[Array] = []
    size = gap * np.array([4.2, 1.6])  # about that of a label
    for instant, mark, ahead in even_marks(time, tip):
        here, way = flat @ mark, flat @ (ahead - mark)
        across = np.array([-way[1], way[0]]) / (float(np.linalg.norm(way)) or 1.0)
        across *= np.sign(across @ (here - middle)) or 1.0
        shift = np.where(np.abs(across) < 0.35, 0.0, np.sign(across))
        centre = here + gap * across + 0.5 * size * shift
        close = any(float(np.linalg.norm(here - other)) < 3 * gap for other in dots)
        if close or any((np.abs(centre - other) < size).all() for other in labels):
            continue
        dots.append(here)
        labels.append(centre)
        scene.path(mark, linestyle="none", marker="o", markersize=4, color=COLORS[0], zorder=15)
        side, level = ("right", "center", "left")[int(shift[0]) + 1], ("top", "center", "bottom")[int(shift[1]) + 1]
        place = mark + gap * (across @ flat)
        scene.axes.text(*place, f"{instant:g} s", ha=side, va=level, fontsize=8, color="#404040", zorder=30)


def even_marks(time: Array, tip: Array) -> list[tuple[float, Array, Array]]:
    """Even times, the places of the tip at them, and shortly after; the interval suits the time it is moving."""
    travel = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tip, axis=0), axis=1))])
    moving = float(time[np.searchsorted(travel, 0.8 * travel[-1])] - time[0])
    if moving <= 0:
        return []
    step = mark_interval(moving, MARKS)
    instants = step * np.arange(1, int(np.ceil((time[-1] - time[0]) / step - 1e-9)))
    places, ahead = _at(time[0] + instants, time, tip), _at(time[0] + instants + 0.2 * step, time, tip)
    return list(zip(instants.tolist(), places, ahead, strict=True))


def _at(instants: Array, time: Array, path: Array) -> Array:
    """A path (T, 3) at other times, (N, 3)."""
    return np.column_stack([np.interp(instants, time, values) for values in path.T])
