"""Random scenes with one sphere that the robot does not know until step 8 of 20, and that its plan would touch.

An RV-1A with a tool of 100 mm goes between random postures; the sphere stands, or drifts at 5 to 20 cm/s, and meets
the arm on its way. Scenes that no motion could save are left out: what the arm meets before the first step at which
it can change its motion and half a step of braking, a goal that is covered, a sphere that meets the shoulder, which
no joint moves. The same number gives the same scene.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.built import model_of
from fzcli.plan.joint_path import JointPath, fastest
from fzcli.plan.plan_spec import PlanRun
from fzcli.plan.planning import planned_robot
from fzcli.plan.scene import Obstacle, build_scene
from fzcli.plan.world import World, build_world

Array = NDArray[np.float64]
STEPS, SEEN, FREE = 20, 8, 9.5  # the first contact comes no earlier than step FREE
MARGIN, SECONDS = 0.01, 4.0
SHOULDER, THICK = np.array([0.0, 0.0, 0.3]), 0.055  # m: end and radius of the upper arm's capsule
RUN = {
    "kind": "plan",
    "robot": "melfa_rv1a",
    "tool": {"xyz": (0, 0, 0.1)},
    "start": {"q": (0, 0, 1.5, 0, 0, 0)},
    "goal": {"q": (0, 0, 1.5, 0, 0, 0)},
    "duration": SECONDS,
    "margin": MARGIN,
    "planner": {"kind": "detour", "weights": (1, 1, 1, 0.3, 0.3, 0.05)},
}


@dataclass(frozen=True)
class Unknown:
    """A plan to follow, and the step at which it would first touch the sphere."""

    spec: PlanRun
    contact: float


class Scenes:
    """Scenes by number, of spheres that stand or drift."""

    def __init__(self) -> None:
        self.spec = PlanRun.model_validate(RUN)
        self.model = model_of(planned_robot(self.spec))

    def draw(self, number: int, moving: bool) -> Unknown:
        """The first candidate of this number that fits."""
        random = np.random.default_rng([2008, int(moving), number])
        limits, speeds = self.model.tree.position_limits.T, self.model.tree.speed_limits
        while True:
            a, b = random.uniform(*limits), random.uniform(*limits)
            seconds = max(SECONDS, fastest(a, b, speeds, np.full(len(a), np.inf)) * (1 + 1e-9))
            path = JointPath(a, b - a, seconds)
            sphere = self._sphere(path, moving, random)
            contact = _contact(build_world(self.model, build_scene((sphere,))), path, sphere)
            if contact is not None:
                begin = self.spec.start.model_copy(update={"q": tuple(a.tolist())})
                end = self.spec.goal.model_copy(update={"q": tuple(b.tolist())})
                changes = {"start": begin, "goal": end, "duration": seconds, "scene": (sphere,)}
                return Unknown(self.spec.model_copy(update=changes), contact)

    def _sphere(self, path: JointPath, moving: bool, random: np.random.Generator) -> Obstacle:
        """About the tip's way, which it meets at a random step."""
        when = random.uniform(FREE, 16) * path.duration / STEPS
        tip = np.array(self.model.function("arm")(path.at(when)[0][0]))[:, -1]
        center, velocity = tip + random.normal(0, 0.03, 3), random.normal(size=3)
        velocity *= random.uniform(0.05, 0.20) / np.linalg.norm(velocity) if moving else 0.0
        ball = {"center": tuple(center - velocity * when), "radius": random.uniform(0.04, 0.08)}
        return Obstacle.model_validate({"sphere": ball, "velocity": tuple(velocity), "seen_at_step": SEEN})


def _contact(world: World, path: JointPath, sphere: Obstacle) -> float | None:
    """The step of the first contact; None where the scene does not fit."""
    times = np.linspace(0.0, path.duration, 401)
    distances, steps = world.distances(path, times), STEPS * times / path.duration
    met = np.array(world.clearance.with_obstacles)
    apart = distances[:, met].min(axis=1)
    root = np.linalg.norm(sphere.position(times) - SHOULDER, axis=1) - THICK - sphere.numbers(times)[:, 3]
    if np.delete(distances, met, axis=1).min() < MARGIN or min(apart[-1], root.min()) < MARGIN + 0.002:
        return None
    hits = steps[apart < 0]
    good = len(hits) and hits[0] >= FREE and apart[steps <= SEEN + 1].min() >= MARGIN
    return float(hits[0]) if good else None
