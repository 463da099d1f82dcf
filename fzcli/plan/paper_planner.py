"""The procedure of Parsa 2008 as it stands, to show what it gives: not used by any other planner.

The gripper alone, a point, is looked at in whole steps; the detour stands in a fixed window and is "applied over one
or more joints" until the gripper is clear in every step. Of how joints and peaks are tried the paper says no more than
"try and error": here one joint after the other, either way, while the peak grows; then two at once, and so on.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fzcli.model.collision import many
from fzcli.plan.detour_planner import Attempt, certified
from fzcli.plan.joint_path import Detour, JointPath
from fzcli.plan.plan_spec import PaperPlannerSpec, PlanRun
from fzcli.plan.quaternions import rotations
from fzcli.plan.scene import Obstacle
from fzcli.plan.world import World

Array = NDArray[np.float64]
TRIALS = 24  # times that the peak grows


def trial_and_error(world: World, nominal: JointPath, spec: PlanRun) -> Attempt | None:
    """The first detour that the procedure calls clear, judged beside it by the whole arm at all times."""
    planner = spec.planner
    if not isinstance(planner, PaperPlannerSpec):
        raise TypeError("the paper's planner has a spec of its own")
    step = nominal.duration / spec.steps
    begin, end = planner.window[0] * step, min(planner.window[1], spec.steps) * step
    times = np.linspace(0.0, nominal.duration, spec.steps + 1)
    beyond = times <= begin if world.model.floating else (times <= begin) | (times >= end)  # no detour moves these
    if gripper_clearance(world, nominal, times[beyond]).min(initial=np.inf) < spec.margin:
        return None
    for peak in _peaks(planner, len(nominal.start)):
        path = replace(nominal, detours=(Detour(peak, begin, end),)) if peak.any() else nominal
        if gripper_clearance(world, path, times).min(initial=np.inf) >= spec.margin:
            return Attempt(path, "paper", float((peak * peak).sum()), certified(world, path, np.inf))
    return None


def _peaks(planner: PaperPlannerSpec, n: int) -> Iterator[Array]:
    yield np.zeros(n)
    for count in range(1, len(planner.joints) + 1):
        for trial in range(1, TRIALS + 1):
            for joints in itertools.combinations(planner.joints, count):
                for signs in itertools.product((1.0, -1.0), repeat=count):
                    peak = np.zeros(n)
                    peak[np.array(joints) - 1] = np.array(signs) * trial * planner.increment
                    yield peak


def gripper_clearance(world: World, path: JointPath, times: Array) -> Array:
    """Distance (T,) [m] of the tip, a point, from the nearest obstacle's surface."""
    q, _, _ = path.at(times)
    tips = many(world.model.function("arm"), q)[0].reshape(len(times), -1, 3)[:, -1]
    position, quat = world.base(path, times)
    tips = position + np.einsum("tij,tj->ti", rotations(quat), tips)
    found = [_from_point(one, tips, times) for one in world.scene.obstacles]
    return np.min(found, axis=0) if found else np.full(len(times), np.inf)


def _from_point(obstacle: Obstacle, points: Array, times: Array) -> Array:
    """Signed distance (T,) of points (T, 3) from an obstacle, as the paper's circumscribed sphere of its middle."""
    size = obstacle.reach
    solid = obstacle.solid
    radius = size + float(getattr(solid, "radius", 0.0))
    return np.asarray(np.linalg.norm(points - obstacle.position(times), axis=1) - radius)
