"""The planners that a plan can name: what each of them tries, one stage after the other."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fzcli.plan.detour_planner import Attempt, one_detour, stretched, three_detours
from fzcli.plan.detour_search import DetourProblem
from fzcli.plan.joint_path import JointPath
from fzcli.plan.paper_planner import trial_and_error
from fzcli.plan.plan_spec import DetourPlannerSpec, PaperPlannerSpec, PlanRun, RrtPlannerSpec, acceleration_limits
from fzcli.plan.planar_spec import AnyRun
from fzcli.plan.rrt_planner import rrt_connect
from fzcli.plan.scene import build_scene
from fzcli.plan.world import AnyWorld, World

Find = Callable[[AnyWorld, JointPath, AnyRun], Attempt | None]  # from a nominal path to one that keeps clear


@dataclass(frozen=True)
class Stage:
    """One way to find a path, told as ``about``, tried for at most ``goals`` final postures."""

    about: str
    find: Find
    goals: int = 8


def stages_of(spec: AnyRun) -> list[Stage]:
    """What the plan's planner tries, in order: each for all final postures before the next one."""
    planner = spec.planner
    if isinstance(planner, PaperPlannerSpec):
        return [Stage("trial and error in the fixed window", _trials)]
    if isinstance(planner, RrtPlannerSpec):
        return [_tree(planner, spec, goals=8)]
    stages = [Stage("one detour", _one_detour)]
    for fallback in planner.fallbacks:
        if fallback == "rrt_connect" and isinstance(planner, DetourPlannerSpec):
            stages.append(_tree(planner, spec, goals=2))
        else:
            stages.append(Stage("three detours", _three_detours, goals=2))
    return stages


def _trials(world: AnyWorld, nominal: JointPath, spec: AnyRun) -> Attempt | None:
    return trial_and_error(world, nominal, spec) if isinstance(world, World) and isinstance(spec, PlanRun) else None


def _tree(planner: DetourPlannerSpec | RrtPlannerSpec, spec: AnyRun, goals: int) -> Stage:
    def find(world: AnyWorld, nominal: JointPath, spec: AnyRun) -> Attempt | None:
        if not (isinstance(world, World) and isinstance(spec, PlanRun)):
            return None
        return rrt_connect(world, nominal, spec, planner.iterations, planner.seed)

    floats = isinstance(spec, PlanRun) and spec.robot.base.floating and not spec.hold_base
    if floats or build_scene(spec.scene).moving:
        return Stage("RRTConnect, which is for bases and scenes that stand still", find, goals)
    return Stage(f"RRTConnect, {planner.iterations} iterations", find, goals)


def _one_detour(world: AnyWorld, nominal: JointPath, spec: AnyRun) -> Attempt | None:
    """The least detour at any speed where it keeps the limits, else the least that does, else the least in more time.

    In a scene that moves, a path in more time would meet other obstacles: there it is the least within the speeds.
    """
    window = getattr(spec.planner, "window", None)
    kept = _problem(world, nominal, spec, world.model.tree.speed_limits)
    if not _may_stretch(world, spec):
        return one_detour(kept, spec.margin, spec.steps, window)
    free = one_detour(replace(kept, speeds=np.full(world.model.n, np.inf)), spec.margin, spec.steps, window)
    slow = None if free is None else _in_more_time(free, world, spec)
    if slow is None or slow is free:
        return slow
    found = one_detour(kept, spec.margin, spec.steps, window)
    return slow if found is None else _in_more_time(found, world, spec)


def _three_detours(world: AnyWorld, nominal: JointPath, spec: AnyRun) -> Attempt | None:
    if not _may_stretch(world, spec):
        return three_detours(_problem(world, nominal, spec, world.model.tree.speed_limits), spec.margin)
    found = three_detours(_problem(world, nominal, spec, np.full(world.model.n, np.inf)), spec.margin)
    return None if found is None else _in_more_time(found, world, spec)


def _problem(world: AnyWorld, nominal: JointPath, spec: AnyRun, speeds: np.ndarray) -> DetourProblem:
    weights = getattr(spec.planner, "weights", None) or (1.0,) * world.model.n
    return DetourProblem(world, nominal, np.array(weights), spec.margin, speeds)


def _may_stretch(world: AnyWorld, spec: AnyRun) -> bool:
    return spec.stretch and not world.scene.moving


def _in_more_time(found: Attempt, world: AnyWorld, spec: AnyRun) -> Attempt:
    """The same path, as slow as the joints need it: in a scene that stands still it stays as clear."""
    if not isinstance(found.path, JointPath):
        return found
    slow = stretched(found.path, world.model.tree.speed_limits, acceleration_limits(spec, world.model.n))
    if slow is found.path:
        return found
    return replace(found, path=slow, method=f"{found.method}, stretched")
