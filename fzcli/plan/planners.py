"""The planners that a plan can name: (world, nominal path, spec, what was tried) -> a path that keeps clear."""

from collections.abc import Callable

import numpy as np

from fzcli.plan.detour_planner import Attempt, one_detour, stretched, three_detours
from fzcli.plan.detour_search import DetourProblem
from fzcli.plan.joint_path import JointPath
from fzcli.plan.plan_spec import DetourPlannerSpec, PlanRun
from fzcli.plan.world import World

# None where no path is found; what was tried is added to the list, for the error's text.
Planner = Callable[[World, JointPath, PlanRun, list[str]], Attempt | None]


def by_detours(world: World, nominal: JointPath, spec: PlanRun, tried: list[str]) -> Attempt | None:
    """One detour within the speeds; one in more time; then the fallbacks."""
    planner = spec.planner
    if not isinstance(planner, DetourPlannerSpec):
        raise TypeError("the planner of detours has a spec of its own")
    n = len(nominal.start)
    weights = np.array(planner.weights or (1.0,) * n)
    speeds = world.model.tree.speed_limits
    kept = DetourProblem(world, nominal, weights, spec.margin, speeds)
    tried.append("one detour")
    found = one_detour(kept, spec.margin, spec.steps)
    if found is not None:
        return found
    free = DetourProblem(world, nominal, weights, spec.margin, np.full(n, np.inf))
    if spec.stretch and not world.scene.moving:
        tried.append("one detour in more time")
        found = _in_more_time(one_detour(free, spec.margin, spec.steps), speeds)
        if found is not None:
            return found
    for fallback in planner.fallbacks:
        if fallback == "three_detours":
            tried.append("three detours")
            loose = spec.stretch and not world.scene.moving
            found = three_detours(free if loose else kept, spec.margin, spec.steps)
            found = _in_more_time(found, speeds) if loose else found
        else:
            from fzcli.plan.rrt_planner import rrt_connect

            tried.append(f"RRTConnect, {planner.iterations} iterations")
            found = rrt_connect(world, nominal, spec, planner.iterations, planner.seed)
        if found is not None:
            return found
    return None


def _in_more_time(found: Attempt | None, speeds: np.ndarray) -> Attempt | None:
    """The same path, as slow as the joints need it: in a scene that stands still it stays as clear."""
    if found is None or not isinstance(found.path, JointPath):
        return found
    slow = stretched(found.path, speeds)
    method = found.method if slow is found.path else f"{found.method}, stretched"
    return Attempt(slow, method, found.cost, found.clearance)


def by_tree(world: World, nominal: JointPath, spec: PlanRun, tried: list[str]) -> Attempt | None:
    """RRTConnect alone."""
    from fzcli.plan.rrt_planner import rrt_connect

    planner = spec.planner
    tried.append("RRTConnect")
    return rrt_connect(world, nominal, spec, getattr(planner, "iterations", 1), getattr(planner, "seed", 0))


def by_the_paper(world: World, nominal: JointPath, spec: PlanRun, tried: list[str]) -> Attempt | None:
    """Parsa 2008 as it stands: what it gives is judged by the whole arm like any other plan."""
    from fzcli.plan.paper_planner import trial_and_error

    tried.append("trial and error in the fixed window")
    return trial_and_error(world, nominal, spec)


PLANNERS: dict[str, Planner] = {"detour": by_detours, "rrt_connect": by_tree, "paper": by_the_paper}
