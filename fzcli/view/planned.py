"""What a plan's own specification says about it: the straight path, limits, margin, and the solids of its scene."""

from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.rollout import Rollout
from fzcli.view.solids import Block, Round, Solid, solid_of
from fzcli.view.target import specification

if TYPE_CHECKING:
    from fzcli.plan.scene import Obstacle

Array = NDArray[np.float64]
SIGNALS = ("qdd", "clearance")  # that make a run a plan
AWAY = 1e-8  # rad or m: off the straight path


@dataclass(frozen=True)
class Straight:
    """Positions, velocities, accelerations (T, n) of the joints on the straight path, and when the plan leaves it."""

    q: Array
    qd: Array
    qdd: Array
    away: tuple[tuple[float, float], ...]


def is_plan(run: Rollout) -> bool:
    """Whether the run is a plan."""
    return all(name in run.signals for name in SIGNALS)


def straight_path(run: Rollout) -> Straight | None:
    """The path without detours: from start to end by the plan's law, in its duration; None where no law is named."""
    from fzcli.plan.joint_path import JointPath
    from fzcli.plan.time_laws.registry import TIME_LAWS

    law = specification(run).get("law")
    duration = float(run.time[-1] - run.time[0])
    if law not in TIME_LAWS or duration <= 0:
        return None
    path = JointPath(run.q[0], run.q[-1] - run.q[0], duration, law)
    q, qd, qdd = path.at(run.time - run.time[0])
    off = (np.abs(run.q - q) > AWAY * max(1.0, float(np.abs(run.q).max()))).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], off, [False]]).astype(int)))
    last = len(run.time) - 1
    away = tuple((float(run.time[max(0, a - 1)]), float(run.time[min(b, last)])) for a, b in edges.reshape(-1, 2))
    return Straight(q, qd, qdd, away)


def speed_limits(run: Rollout) -> Array:
    """Of the joints (n) [rad/s or m/s], infinite where none is known."""
    robot = specification(run).get("robot")
    if isinstance(robot, dict) and isinstance(robot.get("drives"), dict):
        return np.full(len(run.joint_names), robot["drives"].get("speed") or np.inf)
    links = robot.get("links", ()) if isinstance(robot, dict) else ()
    joints = {link["joint"]["name"]: link["joint"].get("speed") for link in links if "joint" in link}
    return np.array([joints.get(name) or np.inf for name in run.joint_names], dtype=np.float64)


def margin(run: Rollout) -> float | None:
    """The distance that the plan was to keep [m]."""
    value = specification(run).get("margin")
    return float(value) if isinstance(value, int | float) else None


def steps(run: Rollout) -> int | None:
    """Into how many steps the plan's duration is parted, by which windows are counted."""
    value = specification(run).get("steps")
    return value if isinstance(value, int) else None


def obstacles(run: Rollout) -> tuple["Obstacle", ...]:
    """What was not to be touched, in the plan's order."""
    from fzcli.plan.scene import Obstacle

    return tuple(Obstacle.model_validate(one) for one in specification(run).get("scene") or ())


def solid_at(obstacle: "Obstacle", time: float) -> Solid:
    """An obstacle where it is at a time [s]."""
    return solid_of(obstacle.kind, obstacle.numbers([time])[0])


def base_solids(run: Rollout, step: int) -> list[Solid]:
    """The base's own solids at a sample, as its specification has them; none where the base does not float."""
    robot = specification(run).get("robot")
    base: dict[str, Any] = robot.get("base", {}) if isinstance(robot, dict) else {}
    if not base.get("floating"):
        return []
    from scipy.spatial.transform import Rotation

    from fzcli.plan.scene import Obstacle

    turn = Rotation.from_quat(run.base_quat[step][[1, 2, 3, 0]]).as_matrix()
    own = [solid_at(Obstacle.model_validate(one), 0.0) for one in base.get("collision") or ()]
    return [_moved(solid, turn, run.base_position[step]) for solid in own]


def _moved(solid: Solid, turn: Array, shift: Array) -> Solid:
    if isinstance(solid, Round):
        return Round(turn @ solid.start + shift, turn @ solid.end + shift, solid.radius)
    return Block(turn @ solid.center + shift, turn @ solid.turn, solid.size)


def nearest(run: Rollout) -> tuple[float, float] | None:
    """The smallest distance [m] and its time [s]: certified, where the plan says so; None where there is none."""
    values = np.asarray(run.signals["clearance"])
    if not np.isfinite(values).any():
        return None
    least, when = (float(run.metrics.get(name, np.nan)) for name in ("clearance_min", "clearance_time"))
    if np.isfinite([least, when]).all():
        return least, when
    place = int(np.nanargmin(values))
    return float(values[place]), float(run.time[place])


def plan_headline(run: Rollout, title: str) -> str:
    """What is drawn, and below it how the plan is judged."""
    status, found = run.status, nearest(run)
    ending = f"{status.name}: {status.reason}" if status.reason else status.name
    if found is not None:
        ending += f"; smallest clearance {length_text(found[0])} at {found[1]:.3g} s"
    return "\n".join([*([title] if title else []), *wrap(ending, 70)])


def length_text(value: float) -> str:
    """Short, in mm or m."""
    return f"{1e3 * value:.3g} mm" if abs(value) < 1 else f"{value:.3g} m"
