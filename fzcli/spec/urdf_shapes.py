"""Collision geometry of a URDF as solids: boxes and spheres as they are, cylinders and meshes in capsules."""

import math
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from fzcli.spec.physics import Array, rpy_of, snapped, vector
from fzcli.spec.shapes import BoxShape, CapsuleShape, Shape, SphereShape

MAX_MESH_BYTES = 100_000_000
ROUNDS = 300  # of the enclosing circle: within 1 % of the smallest


def read_collisions(link: Any, folder: Path) -> tuple[tuple[Shape, ...], tuple[str, ...]]:
    """The solids of a yourdfpy link in its frame, and a note for each piece of geometry that cannot be read.

    A cylinder becomes the capsule about it with the same axis, radius and length; a mesh a capsule that holds
    all of its points. Meshes are looked for beside the URDF; package://NAME/... in the folders above it too.

    Raises:
        ValueError: a solid without extent, or numbers that are not finite.
    """
    shapes, gaps = [], []
    for collision in link.collisions:
        origin = np.eye(4) if collision.origin is None else collision.origin
        turn, shift = snapped(origin[:3, :3]), np.asarray(origin[:3, 3], dtype=np.float64)
        geometry = collision.geometry
        try:
            if geometry.mesh is None:
                shapes.append(_primitive(geometry, turn, shift))
                continue
        except ValidationError as error:
            details = error.errors()[0]
            raise ValueError(f"<collision>: {'.'.join(map(str, details['loc']))}: {details['msg']}") from None
        try:
            points = _mesh_points(geometry.mesh, folder)
        except (OSError, ValueError) as error:
            gaps.append(f"mesh '{geometry.mesh.filename}': {error}")
            continue
        shapes.append(bounding_capsule(points @ turn.T + shift))
    return tuple(shapes), tuple(gaps)


def _primitive(geometry: Any, turn: Array, shift: Array) -> Shape:
    if geometry.sphere is not None:
        return Shape(sphere=SphereShape(center=vector(shift), radius=float(geometry.sphere.radius)))
    if geometry.box is not None:
        size = vector(geometry.box.size)
        return Shape(box=BoxShape(center=vector(shift), rpy=rpy_of(turn), size=size))
    half, radius = 0.5 * float(geometry.cylinder.length), float(geometry.cylinder.radius)
    ends = (vector(shift - half * turn[:, 2]), vector(shift + half * turn[:, 2]))
    return Shape(capsule=CapsuleShape(start=ends[0], end=ends[1], radius=radius))


def _mesh_points(mesh: Any, folder: Path) -> Array:
    """The corners (k, 3) [m] of a mesh file, scaled."""
    path = next((place for place in _places(mesh.filename, folder) if place.is_file()), None)
    if path is None:
        raise ValueError("no such file")
    if path.stat().st_size > MAX_MESH_BYTES:
        raise ValueError(f"is larger than {MAX_MESH_BYTES // 1_000_000} MB")
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            loaded: Any = trimesh.load(path, force="mesh")
        points = np.asarray(loaded.vertices, dtype=np.float64)
    except Exception as error:  # each format's reader fails in its own way
        raise ValueError(f"cannot be read: {type(error).__name__}") from None
    points = points * (1.0 if mesh.scale is None else np.asarray(mesh.scale, dtype=np.float64))
    if points.ndim != 2 or len(points) == 0 or not np.isfinite(points).all():
        raise ValueError("has no points, or some that are not finite")
    return points


def _places(name: str, folder: Path) -> Iterator[Path]:
    scheme, mark, rest = name.partition("://")
    if not mark:
        yield folder / name
    elif scheme == "file":
        yield Path(rest)
    elif scheme == "package":
        for above in (folder, *folder.resolve().parents):
            yield above / rest
            yield above / rest.partition("/")[2]


def bounding_capsule(points: Array) -> Shape:
    """A small capsule (a sphere, where no longer one is needed) that holds all points (k, 3).

    Its axis is the one of the points' three principal axes that gives the smallest volume.
    """
    axes = np.linalg.eigh(np.cov((points - points.mean(axis=0)).T) if len(points) > 1 else np.eye(3))[1]
    start, end, radius = min((_about(points, axis) for axis in axes.T), key=_volume)
    if math.dist(start, end) == 0:
        return Shape(sphere=SphereShape(center=vector(start), radius=radius))
    return Shape(capsule=CapsuleShape(start=vector(start), end=vector(end), radius=radius))


def _volume(capsule: tuple[Array, Array, float]) -> float:
    start, end, radius = capsule
    return radius**2 * (math.dist(start, end) + 4 / 3 * radius)


def _about(points: Array, axis: Array) -> tuple[Array, Array, float]:
    """The capsule along an axis: an enclosing circle across it, ends no farther out than some point asks for."""
    along = points @ axis
    flat = points - np.outer(along, axis)
    center = flat.mean(axis=0)
    for step in range(1, ROUNDS):  # Badoiu and Clarkson 2003: towards the farthest point, ever less
        center = center + (flat[np.argmax(((flat - center) ** 2).sum(axis=1))] - center) / (step + 1)
    off = np.sqrt(((flat - center) ** 2).sum(axis=1))
    radius = max(float(off.max()) * (1 + 1e-9), 1e-6)
    slack = np.sqrt(radius**2 - off**2)
    low, high = float((along + slack).min()), float((along - slack).max())
    if low > high:
        low = high = 0.5 * (low + high)
    return center + low * axis, center + high * axis, radius
