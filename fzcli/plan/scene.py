"""What an arm must not touch: spheres, capsules and boxes in the world, standing or moving."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from fzcli.model.collision import NUMBERS, ObstacleKind, obstacle_numbers
from fzcli.plan.quaternions import exponential, product, rotations
from fzcli.spec.base import SpecModel
from fzcli.spec.shapes import BoxShape, CapsuleShape, Point, Shape
from fzcli.spec.units import AngularSpeed, Duration, Length, Speed

Array = NDArray[np.float64]
STILL = (0.0, 0.0, 0.0)


class Waypoints(SpecModel):
    """Where a solid's middle is, at times: straight lines between, at rest before the first and after the last."""

    times: tuple[Duration, ...] = Field(min_length=1)
    positions: tuple[Point, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _one_each(self) -> Self:
        if len(self.times) != len(self.positions):
            raise ValueError(f"positions has {len(self.positions)} entries for {len(self.times)} times")
        if any(late <= early for early, late in zip(self.times, self.times[1:], strict=False)):
            raise ValueError("times must increase")
        return self


class Obstacle(Shape):
    """A solid in the world, as it stands at time 0, and its motion."""

    name: Annotated[str, Field(description="default: its kind and number, such as sphere 1")] = ""
    velocity: Annotated[tuple[Speed, Speed, Speed], Field(description="of its middle, world axes")] = STILL
    spin: Annotated[
        tuple[AngularSpeed, AngularSpeed, AngularSpeed],
        Field(description="angular velocity about its middle, world axes"),
    ] = STILL
    waypoints: Waypoints | None = None
    seen_at_step: Annotated[
        int | None, Field(ge=0, description="not known before; seen from this step of the path on, by `fzcli simulate`")
    ] = None
    seen_within: Annotated[
        Length | None, Field(gt=0, description="not known before; seen when the arm is nearer, by `fzcli simulate`")
    ] = None

    @model_validator(mode="after")
    def _one_sight(self) -> Self:
        if self.seen_at_step is not None and self.seen_within is not None:
            raise ValueError("give seen_at_step or seen_within, not both")
        return self

    @model_validator(mode="after")
    def _one_motion(self) -> Self:
        if self.waypoints is not None and any(self.velocity):
            raise ValueError("give velocity or waypoints, not both")
        return self

    @property
    def known(self) -> bool:
        """Whether it is known from the start, with all of its motion."""
        return self.seen_at_step is None and self.seen_within is None

    @property
    def middle(self) -> Array:
        """Its middle (3) [m] at time 0 as written; waypoints, where there are any, say where it is."""
        solid = self.solid
        if isinstance(solid, CapsuleShape):
            return np.asarray(0.5 * (np.array(solid.start) + np.array(solid.end)))
        return np.array(solid.center)

    def position(self, times: ArrayLike) -> Array:
        """Its middle (T, 3) [m] at times (T) [s]."""
        t = np.asarray(times, dtype=np.float64)
        if self.waypoints is None:
            return np.asarray(self.middle + t[:, None] * np.array(self.velocity))
        knots, places = np.array(self.waypoints.times), np.array(self.waypoints.positions)
        return np.column_stack([np.interp(t, knots, places[:, axis]) for axis in range(3)])

    def velocity_at(self, times: ArrayLike) -> Array:
        """Velocity of its middle (T, 3) [m/s]; at a waypoint, the one after it."""
        t = np.asarray(times, dtype=np.float64)
        if self.waypoints is None:
            return np.broadcast_to(np.array(self.velocity), (len(t), 3)).copy()
        pace = np.vstack([np.zeros(3), self._paces, np.zeros(3)])
        return np.asarray(pace[np.searchsorted(self.waypoints.times, t, side="right")])

    def speed_bound(self, begin: float, end: float) -> float:
        """No point of it moves faster than this [m/s] between two times."""
        turning = float(np.linalg.norm(self.spin)) * self.reach
        if self.waypoints is None:
            return float(np.linalg.norm(self.velocity)) + turning
        knots = np.array(self.waypoints.times)
        met = (knots[:-1] < end) & (knots[1:] > begin)
        return float(np.linalg.norm(self._paces[met], axis=1).max(initial=0.0)) + turning

    @property
    def reach(self) -> float:
        """From its middle to the farthest of the points that a radius is grown about [m]."""
        solid = self.solid
        if isinstance(solid, CapsuleShape):
            return 0.5 * float(np.linalg.norm(np.array(solid.end) - np.array(solid.start)))
        return 0.5 * float(np.linalg.norm(solid.size)) if isinstance(solid, BoxShape) else 0.0

    @property
    def _paces(self) -> Array:
        """Velocities (segments, 3) between waypoints."""
        if self.waypoints is None:
            return np.zeros((0, 3))
        steps = np.diff(np.array(self.waypoints.times))
        return np.asarray(np.diff(np.array(self.waypoints.positions), axis=0).reshape(-1, 3) / steps[:, None])

    def numbers(self, times: ArrayLike) -> Array:
        """Its numbers (T, k) at times (T), as `fzcli.model.collision.obstacle_numbers` orders them."""
        t = np.asarray(times, dtype=np.float64)
        found = np.tile(obstacle_numbers(self), (len(t), 1))
        shift = self.position(t) - self.middle
        if self.kind != "capsule":
            found[:, :3] += shift
            if self.kind == "box" and any(self.spin):
                found[:, 3:7] = product(self._turns(t), found[:, 3:7])
            return found
        arms = found[:, 3:6] - self.middle
        if any(self.spin):
            arms = np.einsum("tij,tj->ti", rotations(self._turns(t)), arms)
        center = self.middle + shift
        found[:, :3], found[:, 3:6] = center - arms, center + arms
        return found

    def _turns(self, times: Array) -> Array:
        """By how much it has turned, quaternions (T, 4)."""
        return exponential(times[:, None] * np.array(self.spin))


@dataclass(frozen=True)
class Scene:
    """Obstacles in a fixed order: their kinds shape the Functions, their numbers go in at run time."""

    obstacles: tuple[Obstacle, ...] = ()

    @property
    def kinds(self) -> tuple[ObstacleKind, ...]:
        """Of the obstacles, in order."""
        return tuple(kind for one in self.obstacles for kind in NUMBERS if kind == one.kind)

    @property
    def names(self) -> tuple[str, ...]:
        """As given, else kind and number."""
        return tuple(one.name or f"{one.kind} {i + 1}" for i, one in enumerate(self.obstacles))

    @property
    def named(self) -> tuple[Obstacle, ...]:
        """The obstacles, each with its name."""
        pairs = zip(self.obstacles, self.names, strict=True)
        return tuple(one.model_copy(update={"name": name}) for one, name in pairs)

    @property
    def moving(self) -> bool:
        """Whether any obstacle moves."""
        return any(any(one.velocity) or any(one.spin) or one.waypoints for one in self.obstacles)

    def numbers(self, times: ArrayLike) -> Array:
        """All obstacles' numbers (T, k) at times (T) [s]; `fzcli.model.collision.Clearance` takes them."""
        t = np.atleast_1d(np.asarray(times, dtype=np.float64))
        parts = [one.numbers(t) for one in self.obstacles]
        return np.hstack(parts) if parts else np.zeros((len(t), 0))

    def speed_bounds(self, begin: float, end: float) -> Array:
        """No point of each obstacle is faster than this between two times, (obstacles) [m/s]."""
        return np.array([one.speed_bound(begin, end) for one in self.obstacles])


def build_scene(obstacles: Sequence[Obstacle]) -> Scene:
    """The scene of a run. Raises ValueError where two obstacles have one name."""
    doubled = doubled_names(obstacles)
    if doubled:
        raise ValueError(f"two obstacles are called '{doubled[0]}'")
    return Scene(tuple(obstacles))


def doubled_names(obstacles: Sequence[Obstacle]) -> list[str]:
    """Names that stand twice, those included that an obstacle has where none is given."""
    names = Scene(tuple(obstacles)).names
    return sorted({name for name in names if names.count(name) > 1})
