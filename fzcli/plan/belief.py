"""What a robot under way believes about the obstacles: what it was told, and what it sees at every step."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.scene import STILL, Obstacle, Scene
from fzcli.plan.world import AnyWorld, Path

Array = NDArray[np.float64]
FAR = np.array([0.0, 0.0, 1e4])  # m: where an obstacle waits that nobody knows of; the Functions have a place for it
SAME = 1e-9  # m and m/s: below this nothing has changed


def seen_now(world: AnyWorld, path: Path, step: int, now: float) -> frozenset[int]:
    """Numbers of the obstacles that are seen at a step: from their step on, or when nearer than their range.

    ``world`` holds the true obstacles; those without a step and a range are known from the start, and not seen.
    """
    obstacles = world.scene.obstacles
    found = {i for i, one in enumerate(obstacles) if one.seen_at_step is not None and one.seen_at_step <= step}
    if any(one.seen_within is not None for one in obstacles):
        distances = world.distances(path, np.array([now]))[0]
        for pair, distance in zip(world.clearance.pairs, distances, strict=True):
            within = obstacles[pair.obstacle].seen_within if pair.obstacle >= 0 else None
            if within is not None and distance <= within:
                found.add(pair.obstacle)
    return frozenset(found)


def believed(scene: Scene, seen: Iterable[int], now: float) -> Scene:
    """The scene as believed: what is known moves as it does, what is seen goes on as now, the rest is far away.

    Of an obstacle that is seen, place and velocity are measured ``now`` [s]; it is taken to keep the velocity.
    """
    chosen = set(seen)
    return Scene(
        tuple(
            one if one.known else _as_seen(one, now) if i in chosen else _elsewhere(one)
            for i, one in enumerate(scene.named)
        )
    )


def changed(before: Scene, after: Scene, now: float, end: float) -> bool:
    """Whether two beliefs place some obstacle differently between two times [s]."""
    times = np.array([now, end])
    return bool(np.abs(before.numbers(times) - after.numbers(times)).max(initial=0.0) > SAME * max(1.0, end - now))


def _as_seen(one: Obstacle, now: float) -> Obstacle:
    moment = np.array([now])
    velocity = one.velocity_at(moment)[0]
    return _moved(one, one.position(moment)[0] - velocity * now - one.middle, velocity)


def _elsewhere(one: Obstacle) -> Obstacle:
    return _moved(one, FAR - one.middle, np.zeros(3)).model_copy(update={"spin": STILL})


def _moved(one: Obstacle, shift: Array, velocity: Array) -> Obstacle:
    """Shifted as it stands at time 0, with another velocity."""
    solid = one.solid
    names = ("start", "end") if one.kind == "capsule" else ("center",)
    points = {name: tuple((np.array(getattr(solid, name)) + shift).tolist()) for name in names}
    changes = {one.kind: solid.model_copy(update=points), "velocity": tuple(velocity.tolist()), "waypoints": None}
    return one.model_copy(update=changes)
