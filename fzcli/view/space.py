"""Drawing in three dimensions: axes of one scale, a view angle that shows much, and what stands in the scene."""

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
ELEVATION = 22.0  # deg
# Azimuths [deg] that keep clear of the axes' own directions, along which an axis shrinks to a point.
AZIMUTHS = tuple(quarter + offset for quarter in (-90, 0, 90, -180) for offset in (25, 35, 45, 55, 65))
ROOM = np.array([5.2, 4.5])  # inches that a scene with its axis labels may fill
PAD = 0.12  # inches around it
TARGET_COLOR = "#D55E00"
FAINT = "#8c8c8c"


@dataclass(frozen=True)
class View:
    """A direction to look from, as Matplotlib's angles [deg]; no perspective, so that lengths compare."""

    azimuth: float
    elevation: float = ELEVATION

    @property
    def page(self) -> Array:
        """World directions to the right and up on the page, and towards the reader, (3, 3)."""
        a, e = np.deg2rad([self.azimuth, self.elevation])
        right = [-np.sin(a), np.cos(a), 0.0]
        up = [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)]
        return np.array([right, up, np.cross(right, up)])


def best_view(points: Array, arrow: Array | None = None) -> View:
    """The view in which points (N, 3), at least 2, spread widest on the page, no arrow (3,) being seen end-on."""
    spread = np.cov(points.T)
    merits = []
    for azimuth in AZIMUTHS:
        flat = View(azimuth).page[:2]
        shown = 1.0 if arrow is None else float(np.linalg.norm(flat @ arrow) / np.linalg.norm(arrow))
        merits.append(float(np.linalg.det(flat @ spread @ flat.T)) * min(shown, 0.35))
    return View(AZIMUTHS[int(np.argmax(merits))])


class Scene:
    """A figure of one 3-D plot in metres, the same scale along x, y and z, with room for points (N, 3).

    An arrow (3,) is a direction that must be seen. Without a ``view`` the best is taken.
    """

    def __init__(self, points: Array, arrow: Array | None = None, view: View | None = None) -> None:
        from matplotlib.figure import Figure

        self.view = view or best_view(points, arrow)
        self.figure: Figure = Figure(figsize=(6.0, 6.0))
        self.axes: Any = self.figure.add_axes((0, 0, 1, 1), projection="3d", computed_zorder=False)
        low, high = np.min(points, axis=0), np.max(points, axis=0)
        size = float(np.max(high - low)) or 1.0
        self.extent = np.maximum(1.08 * (high - low), 0.35 * size)  # a flat box would hide its own ticks
        self._limits = 0.5 * (low + high) + 0.5 * np.outer([-1, 1], self.extent)
        self._dress()

    @property
    def floor(self) -> float:
        """The lowest z that is shown [m]."""
        return float(self._limits[0, 2])

    def _dress(self) -> None:
        from matplotlib.ticker import FixedLocator

        axes = self.axes
        axes.patch.set_visible(False)
        axes.set_proj_type("ortho")
        axes.view_init(elev=self.view.elevation, azim=self.view.azimuth)
        share = self.extent / np.max(self.extent)
        for name, limits, part in zip("xyz", self._limits.T, share, strict=True):
            getattr(axes, f"set_{name}lim")(*limits)
            getattr(axes, f"set_{name}label")(f"{name} [m]", fontsize=9)
            axis = getattr(axes, f"{name}axis")
            axis.set_major_locator(FixedLocator(inner_ticks(limits, max(3, round(6 * part)))))
            axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
            axis._axinfo["grid"].update(color="#dcdcdc", linewidth=0.4)
        axes.tick_params(labelsize=8, pad=2)
        axes.tick_params(axis="z", pad=5)
        axes.zaxis.labelpad = 7
        flatness = float(self.extent[2] / np.max(self.extent))
        axes.xaxis.labelpad = axes.yaxis.labelpad = 4 + 8 * max(0.0, 0.6 - flatness)  # its offset shrinks with height
        axes.set_box_aspect(self.extent)

    def path(self, points: Array, **look: Any) -> Any:
        """A polyline through points (N, 3)."""
        x, y, z = np.asarray(points, dtype=np.float64).reshape(-1, 3).T
        return self.axes.plot(x, y, z, **look)[0]

    def faces(self, corners: Array, **look: Any) -> Any:
        """Polygons (N, k, 3)."""
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

        return self.axes.add_collection3d(Poly3DCollection(corners, **look))

    def cube(self, centre: Array, quat: Array, edge: float, color: tuple[float, ...]) -> None:
        """A body as a pale cube about the origin of its frame, turned as it is."""
        pale = (*color[:3], 0.1)
        self.faces(cube_faces(centre, quat, edge), facecolor=pale, edgecolor=color, linewidth=0.9, zorder=5)

    def target(self, position: Array, direction: Array | None, length: float) -> None:
        """The end of a target's path (T, 3), and an arrow [m] that ends there along its last direction (T, 3)."""
        here = position[-1]
        if float(np.max(np.ptp(position, axis=0))) > 1e-6:
            dashes = {"linestyle": (0, (4, 2)), "linewidth": 1.2, "zorder": 3}
            self.path(position, color=TARGET_COLOR, label="target's path", **dashes)
        look = {"linestyle": "none", "markeredgecolor": "white", "markeredgewidth": 0.6, "zorder": 40}
        self.path(here, marker="*", markersize=12, color=TARGET_COLOR, label="target", **look)
        if direction is None:
            return
        along = length * direction[-1]
        self.path(np.array([here - along, here]), color=TARGET_COLOR, linewidth=1.8, zorder=8)
        across = np.cross(self.view.page[2], along)  # the head lies flat on the page
        across *= 0.07 * length / (float(np.linalg.norm(across)) or 1.0)
        neck, back = here - 0.18 * along, here - 0.42 * along
        self.faces(np.array([[neck, back + across, back - across]]), facecolor=TARGET_COLOR, linewidth=0, zorder=8)

    def finish(self, title: str) -> "Figure":
        """Title above, legend to the right, and the figure cut to what it holds."""
        heading = self.figure.suptitle(title, fontsize=10, va="top", linespacing=1.3)
        legend = self.figure.legend(loc="center left", fontsize=9, frameon=False, borderpad=0)
        low, size = self._fit()
        beside, above = (np.array(item.get_window_extent().size) / self.figure.dpi for item in (legend, heading))
        wide = max(3 * PAD + size[0] + beside[0], 2 * PAD + above[0])
        high = 3 * PAD + max(size[1], beside[1]) + above[1]
        side = self.figure.get_figwidth()
        corner = np.array([PAD, PAD]) - low
        self.figure.set_size_inches(wide, high)
        self.axes.set_position((corner[0] / wide, corner[1] / high, side / wide, side / high))
        legend.set_bbox_to_anchor(((2 * PAD + size[0]) / wide, (PAD + 0.5 * size[1]) / high))
        heading.set_position((0.5, 1.0 - PAD / high))
        return self.figure

    def _fit(self) -> tuple[Array, Array]:
        """Zooms until the box with its labels fills ROOM; gives its lower left corner and its size [inches]."""
        zoom = 1.0
        for _ in range(5):  # the labels keep their size, so that one step does not get there
            low, high = self._bounds()
            zoom *= float(np.min(ROOM / (high - low)))
            self.axes.set_box_aspect(self.extent, zoom=zoom)
        low, high = self._bounds()
        return low, high - low

    def _bounds(self) -> tuple[Array, Array]:
        """Corners on the page [inches] of the axes' box, axis labels and texts."""
        self.figure.draw_without_rendering()
        dots = [self._dots(np.array(list(product(*self._limits.T))))]
        dots += [axis.get_tightbbox().get_points() for axis in (self.axes.xaxis, self.axes.yaxis, self.axes.zaxis)]
        for text in self.axes.texts:  # each may lie to any side of its place
            place, size = self._dots(np.array([text.get_position_3d()])), np.array(text.get_window_extent().size)
            dots += [place - size, place + size]
        every = np.vstack(dots)
        return every.min(axis=0) / self.figure.dpi, every.max(axis=0) / self.figure.dpi


    def _dots(self, points: Array) -> Array:
        """Where points (N, 3) lie on the page, (N, 2) dots."""
        from mpl_toolkits.mplot3d import proj3d  # type: ignore[import-untyped]

        x, y, _ = proj3d.proj_transform(*points.T, self.axes.get_proj())
        flat: Array = self.axes.transData.transform(np.column_stack([x, y]))
        return flat


def inner_ticks(limits: Array, count: int) -> list[float]:
    """Two or more even ticks, about ``count``, clear of the ends of an axis, where they would meet another's."""
    from matplotlib.ticker import MaxNLocator

    ticks: list[float] = []
    low, high = limits
    margin = 0.07 * (high - low)
    while len(ticks) < 2:
        even = MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(low, high)
        ticks = [float(tick) for tick in even if low + margin <= tick <= high - margin]
        count += 1
    return ticks


def cube_faces(centre: Array, quat: Array, edge: float) -> Array:
    """The corners of the faces of a cube turned by a quaternion w x y z, (6, 4, 3)."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(np.asarray(quat)[[1, 2, 3, 0]]).as_matrix()
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    faces = [np.insert(square, axis, side, axis=1) for axis in range(3) for side in (-1.0, 1.0)]
    corners: Array = np.asarray(centre) + 0.5 * edge * np.array(faces) @ turn.T
    return corners
