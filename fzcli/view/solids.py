"""Solids true to size in a drawing without perspective: their outlines, and what they hide from the reader."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fzcli.view.space import AZIMUTHS, Scene, View

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
ARC = 40  # points of half a circle
STEPS = 200  # of a look towards the reader
TOUCH = 1e-4  # m: nearer than this is inside
SHADOW = (0.87, 0.87, 0.87)
LIGHT = np.array([-0.35, 0.25, 1.0])  # on the page: right, up, towards the reader
CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))


@dataclass(frozen=True)
class Round:
    """A sphere or a capsule: all points within ``radius`` [m] of the segment from ``start`` (3) to ``end`` (3) [m]."""

    start: Array
    end: Array
    radius: float

    @property
    def middle(self) -> Array:
        """(3) [m]."""
        return np.asarray(0.5 * (self.start + self.end))

    @property
    def corners(self) -> Array:
        """Points (N, 3) [m] whose axis-aligned hull holds the solid."""
        return np.vstack([self.start + 2 * self.radius * CORNERS, self.end + 2 * self.radius * CORNERS])

    def distance(self, points: Array) -> Array:
        """Signed distance (N,) [m] of points (N, 3)."""
        way = self.end - self.start
        share = np.clip((points - self.start) @ way / (float(way @ way) or 1.0), 0.0, 1.0)
        return np.asarray(np.linalg.norm(points - self.start - share[:, None] * way, axis=1) - self.radius)

    def faces(self, view: View) -> list[tuple[Array, float]]:
        """The outline (N, 3), flat on the page, and how bright it is."""
        right, up, _ = view.page
        way = self.end - self.start
        angle = float(np.arctan2(way @ up, way @ right))
        turn = angle + np.linspace(-0.5, 0.5, ARC) * np.pi
        arc = self.radius * (np.outer(np.cos(turn), right) + np.outer(np.sin(turn), up))
        return [(np.vstack([self.end + arc, self.start - arc]), 1.0)]

    @property
    def shadow(self) -> Array:
        """Its outline (N, 2) from above [m]."""
        return self.faces(View(-90.0, 90.0))[0][0][:, :2]

    def edges(self, view: View) -> list[Array]:
        """Lines (N, 3) on the surface that make it look round: the half circles that face the reader."""
        way = self.end - self.start
        length = float(np.linalg.norm(way))
        axis = way / length if length > 0 else np.array([0.0, 0.0, 1.0])
        across = np.cross(axis, view.page[2])
        size = float(np.linalg.norm(across))
        if size < 1e-3:  # seen end-on, the half circle is the outline
            return []
        across /= size
        front = np.cross(across, axis)
        turn = np.linspace(0.0, np.pi, ARC)
        ring = self.radius * (np.outer(np.cos(turn), across) + np.outer(np.sin(turn), front))
        return [self.start + ring] if length == 0 else [self.start + ring, self.end + ring]


@dataclass(frozen=True)
class Block:
    """A box: ``center`` (3) [m], its axes in the world as the columns of ``turn`` (3, 3), edge lengths ``size`` (3)."""

    center: Array
    turn: Array
    size: Array

    @property
    def middle(self) -> Array:
        """(3) [m]."""
        return self.center

    @property
    def corners(self) -> Array:
        """(8, 3) [m]."""
        return np.asarray(self.center + CORNERS * self.size @ self.turn.T)

    def distance(self, points: Array) -> Array:
        """Signed distance (N,) [m] of points (N, 3)."""
        out = np.abs((points - self.center) @ self.turn) - 0.5 * self.size
        return np.asarray(np.linalg.norm(np.maximum(out, 0.0), axis=1) + np.minimum(out.max(axis=1), 0.0))

    def faces(self, view: View) -> list[tuple[Array, float]]:
        """The faces (4, 3) that face the reader, and how bright each is."""
        square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
        light = LIGHT / np.linalg.norm(LIGHT)
        found = []
        for axis, side in product(range(3), (-0.5, 0.5)):
            normal = 2 * side * self.turn[:, axis]
            if view.page[2] @ normal > 1e-9:
                own = np.insert(square, axis, side, axis=1) * self.size
                found.append((self.center + own @ self.turn.T, max(0.0, float(light @ view.page @ normal))))
        return found

    @property
    def shadow(self) -> Array:
        """Its outline (N, 2) from above [m]."""
        from scipy.spatial import ConvexHull

        flat = self.corners[:, :2]
        return np.asarray(flat[ConvexHull(flat).vertices])

    def edges(self, view: View) -> list[Array]:
        """The edges are those of the faces."""
        return []


Solid = Round | Block


def solid_of(kind: str, numbers: ArrayLike) -> Solid:
    """A sphere's center and radius, a capsule's ends and radius, a box's center, quaternion w x y z and size."""
    n = np.asarray(numbers, dtype=np.float64)
    if kind == "sphere":
        return Round(n[:3], n[:3], float(n[3]))
    if kind == "capsule":
        return Round(n[:3], n[3:6], float(n[6]))
    from scipy.spatial.transform import Rotation

    return Block(n[:3], Rotation.from_quat(n[[4, 5, 6, 3]]).as_matrix(), n[7:10])


def hides(solid: Solid, points: Array, way: Array) -> Mask:
    """Which of the points (N, 3) the solid holds, or hides from somebody far off along ``way`` (3), a unit vector.

    Found by walking that way, as far each time as the solid is away.
    """
    reach = float(np.linalg.norm(np.ptp(np.vstack([solid.corners, points]), axis=0)))
    gone = np.zeros(len(points))
    hit = np.zeros(len(points), dtype=bool)
    for _ in range(STEPS):
        distance = solid.distance(points + gone[:, None] * way)
        hit |= distance < TOUCH
        if (hit | (gone > reach)).all():
            break
        gone += np.where(hit, 0.0, np.maximum(distance, TOUCH))
    return hit


def open_view(spread: Array, lines: Array, solids: Sequence[Solid]) -> View:
    """The view in which points (N, 3) spread wide on the page and solids lie beside the lines' points (M, 3)."""
    covariance = np.cov(spread.T)
    merits = []
    for azimuth in AZIMUTHS:
        page = View(azimuth).page
        over = np.zeros(len(lines), dtype=bool)
        for solid in solids:
            over |= hides(solid, lines, page[2]) | hides(solid, lines, -page[2])
        area = float(np.sqrt(max(0.0, np.linalg.det(page[:2] @ covariance @ page[:2].T))))
        merits.append(area * (1.0 - float(over.mean())))
    return View(AZIMUTHS[int(np.argmax(merits))])


class Solids:
    """The solids of a scene, the farthest drawn first, and lines that run before and behind them."""

    def __init__(self, scene: Scene, shadows: bool = True) -> None:
        self.scene = scene
        self.shadows = shadows
        self.drawn: list[tuple[Solid, tuple[float, ...]]] = []

    def add(self, solid: Solid, color: tuple[float, ...]) -> None:
        """To be drawn in a colour (r, g, b)."""
        self.drawn.append((solid, color[:3]))

    def draw(self) -> None:
        """Draws all, down to the floor; lines are laid before and behind them afterwards."""
        view = self.scene.view
        self.drawn.sort(key=lambda one: float(view.page[2] @ one[0].middle))
        for rank, (solid, color) in enumerate(self.drawn):
            dark = tuple(0.62 * np.array(color))
            for corners, bright in solid.faces(view):
                pale = 1.0 - (0.30 + 0.25 * (1.0 - bright)) * (1.0 - np.array(color))
                look = {"facecolor": (*pale, 0.86), "edgecolor": dark, "linewidth": 0.8}
                standing = above(corners, self.scene.floor)
                if len(standing):
                    self.scene.faces(standing[None], zorder=self._level(rank), **look)
            if self.shadows:
                shadow = np.column_stack([solid.shadow, np.full(len(solid.shadow), self.scene.floor)])
                self.scene.faces(shadow[None], zorder=1, facecolor=(*SHADOW, 0.55), linewidth=0)
            for edge in solid.edges(view):
                self.scene.path(edge, color=dark, linewidth=0.6, zorder=self._level(rank) + 0.002)

    def line(self, points: Array, zorder: float, spacing: float, label: str = "", **look: object) -> None:
        """A polyline through points (N, 3), cut every ``spacing`` [m] into what is seen and what is hidden."""
        fine = finely(points, spacing)
        middles = 0.5 * (fine[1:] + fine[:-1])
        levels = self._levels(middles, zorder)
        for level in dict.fromkeys((zorder, *np.unique(levels).tolist())):
            mine = levels == level
            kept = np.concatenate([mine, [False]]) | np.concatenate([[False], mine])
            gaps = np.insert(np.where(kept[:, None], fine, np.nan), np.flatnonzero(~mine) + 1, np.nan, axis=0)
            self.scene.path(gaps, zorder=level, label=label if level == zorder else "", **look)

    def dots(self, points: Array, zorder: float, **look: object) -> None:
        """A mark at each of the points (N, 3)."""
        levels = self._levels(points, zorder)
        for level in np.unique(levels).tolist():
            self.scene.path(points[levels == level], zorder=level + 0.001, linestyle="none", **look)

    def _level(self, rank: int) -> float:
        """The drawing order of a solid: between 4 and 9."""
        return 4.0 + 5.0 * rank / max(1, len(self.drawn))

    def _levels(self, points: Array, seen: float) -> Array:
        """The drawing order (N,) of points: ``seen``, or just below the farthest solid that hides them."""
        levels = np.full(len(points), seen)
        for rank, (solid, _) in reversed(list(enumerate(self.drawn))):
            levels[hides(solid, points, self.scene.view.page[2])] = self._level(rank) - 0.01
        return levels


def above(corners: Array, floor: float) -> Array:
    """What of a polygon (N, 3) is not below a height, (M, 3); M is 0 where nothing is."""
    kept = []
    for here, ahead in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if here[2] >= floor:
            kept.append(here)
        if (here[2] - floor) * (ahead[2] - floor) < 0:
            kept.append(here + (floor - here[2]) / (ahead[2] - here[2]) * (ahead - here))
    return np.array(kept).reshape(-1, 3)


def finely(points: Array, spacing: float) -> Array:
    """The same polyline with more points (M, 3), none farther than ``spacing`` [m] from the one before."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    parts = [points[:1]]
    for a, b, step in zip(points[:-1], points[1:], steps, strict=True):
        count = max(1, int(np.ceil(step / spacing)))
        parts.append(a + np.linspace(0.0, 1.0, count + 1)[1:, None] * (b - a))
    return np.vstack(parts)
