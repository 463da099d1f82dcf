"""A plan to be made, and how one stage of a planner makes it: on a free base, until the goal in the world is met."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import Problem, SpecError
from fzcli.model import RobotModel
from fzcli.plan.built import goal_solver_of
from fzcli.plan.continuous import PathClearance
from fzcli.plan.detour_planner import EXACT, Attempt, certified, keeps, stretched
from fzcli.plan.detour_search import FINE
from fzcli.plan.inertial_goal import Departure, PathLaw, path_law
from fzcli.plan.joint_path import JointPath, fastest, law_values
from fzcli.plan.neural_goal import NeuralGoal
from fzcli.plan.plan_spec import LONGEST, PlanFields, PlanRun, PoseGoal, acceleration_limits
from fzcli.plan.planar_spec import AnyRun
from fzcli.plan.planners import Stage
from fzcli.plan.scene import Scene
from fzcli.plan.world import AnyWorld, Path, World

Array = NDArray[np.float64]
MET = 1e-6  # m and rad: a pose that is met
ROUNDS = 5  # of planning and moving the final joints
ROOM = 5e-4  # m: planned for beyond the margin, for the final joints to move in
GOAL_PIECES = 64  # of a path with detours, for the base's attitude at its end


@dataclass(frozen=True)
class Task:
    """A plan to be made: ``goals``, final postures (n) in the order in which they are tried.

    ``neural``: what networks made of the goal, where they were asked.
    """

    spec: PlanRun
    world: World
    start: Array
    goals: tuple[Array, ...]
    neural: NeuralGoal | None = None

    @property
    def model(self) -> RobotModel:
        """Of the robot with its tool."""
        return self.world.model

    @property
    def speeds(self) -> Array:
        """Joint speed limits (n), infinite where none is stated."""
        return self.model.tree.speed_limits

    @property
    def accelerations(self) -> Array:
        """Joint acceleration limits (n), infinite where none is given."""
        return acceleration_limits(self.spec, self.model.n)

    def nominal(self, goal: Array) -> JointPath:
        """The straight joint path to a final posture in the duration that is asked for."""
        return nominal_path(self.spec, self.start, goal, (self.speeds, self.accelerations))

    def find(self, stage: Stage, goal: Array) -> Attempt | None:
        """A path to a final posture that keeps clear, by one stage of the planner."""
        return _found(self, stage, goal)

    def among(self, spec: AnyRun, scene: Scene) -> "Task":
        """The same start and goals among other obstacles, as another spec says them. Raises TypeError for its kind."""
        if not isinstance(spec, PlanRun):
            raise TypeError("the plan of another kind of robot")
        return replace(self, spec=spec, world=self.world.among(scene))

    def judged(self, path: Path) -> PathClearance:
        """The certified clearance of a path."""
        return certified(self.world, path, np.inf)


class AnyTask(Protocol):
    """What makes a plan of a `Task`, whatever the robot."""

    @property
    def spec(self) -> AnyRun: ...
    @property
    def goals(self) -> tuple[Array, ...]: ...
    @property
    def accelerations(self) -> Array: ...
    @property
    def world(self) -> AnyWorld: ...
    def find(self, stage: Stage, goal: Array) -> Attempt | None: ...
    def among(self, spec: AnyRun, scene: Scene) -> "AnyTask": ...
    def judged(self, path: Path) -> PathClearance: ...


def nominal_path(spec: PlanFields, start: Array, goal: Array, limits: tuple[Array, Array]) -> JointPath:
    """The straight joint path in the duration that is asked for; ``limits``: joint speeds and accelerations (n).

    Raises SpecError where the limits ask for more than ``LONGEST``.
    """
    shortest = fastest(start, goal, *limits, spec.law)
    if shortest > LONGEST:
        text = f"the joints would need {shortest:.3g} s; no path is longer than {LONGEST:g} s"
        raise SpecError(Problem(text, field="accelerations"))
    if spec.duration == "fastest":
        return JointPath(start, goal - start, max(shortest * (1 + 1e-9), 1e-3), spec.law)
    duration = max(spec.duration, shortest * (1 + 1e-9)) if spec.stretch else spec.duration
    return JointPath(start, goal - start, duration, spec.law)


def _found(task: Task, stage: Stage, goal: Array) -> Attempt | None:
    """A path to a final posture; on a free base round after round, until the detours' own effect on the end is met."""
    if not task.model.floating or task.spec.goal.q is not None:
        return stage.find(task.world, task.nominal(goal), task.spec)
    asked = task.spec.model_copy(update={"margin": task.spec.margin + ROOM})
    for _ in range(ROUNDS):
        attempt = stage.find(task.world, task.nominal(goal), asked)
        if attempt is None:
            return None
        met, following = meeting(task, attempt)
        if met is not None or following is None:
            return met
        goal = following
    return None


def poses_of(task: Task) -> dict[str, tuple[Array, Array]]:
    """Position (3) and rotation (3, 3) in the world that each tip of the goal is to have; none for joint goals."""
    goal = task.spec.goal
    poses = dict(goal.tips)
    if goal.position is not None:
        poses[task.model.tips[0]] = PoseGoal(position=goal.position, rpy=goal.rpy)
    return {tip: (np.array(pose.position), rotation_of(pose)) for tip, pose in poses.items()}


def meeting(task: Task, attempt: Attempt) -> tuple[Attempt | None, Array | None]:
    """The path with its final joints moved so that it meets the goal in the world in spite of its detours.

    The base's attitude at the end hangs on the whole path. Gives None for a path that then does not keep clear, and
    the final joints to plan for next; None for those where the goal is not met at all.
    """
    path = attempt.path
    if not isinstance(path, JointPath):
        return None, None
    poses = poses_of(task)
    solver = goal_solver_of(task.model, tuple(poses))
    departure = Departure(task.start, task.world.base_quat, task.world.base_position)
    end = solver.solve(departure, list(poses.values()), path.goal, _law_of(path))
    low, high = task.model.tree.position_limits.T
    if end.error > MET or np.maximum(low - end.q, end.q - high).max() > MET:
        return None, None
    moved = replace(path, travel=end.q - path.start)
    moved = stretched(moved, task.speeds, task.accelerations) if task.spec.stretch else moved
    q, _, _ = moved.at(np.linspace(0.0, moved.duration, FINE))
    if max(float((low - q).max()), float((q - high).max())) > EXACT:
        return None, end.q
    clearance = keeps(task.world, moved, task.spec.margin)
    return (None if clearance is None else replace(attempt, path=moved, clearance=clearance)), end.q


def _law_of(path: JointPath) -> PathLaw:
    """The path as the solver of final joints wants it: over s from 0 to 1."""

    def share(s: Array) -> tuple[Array, Array]:
        values = law_values(path.law, s)
        return values[0], values[1]

    def offset(s: Array) -> tuple[Array, Array]:
        found = np.zeros((2, len(path.start), len(s)))
        for detour in path.detours:
            place, rate, _ = detour.at(s * path.duration)
            found += np.array([place.T, rate.T * path.duration])
        return found[0], found[1]

    return path_law(len(path.start), share, offset, pieces=GOAL_PIECES)


def rotation_of(pose: PoseGoal) -> Array:
    """The rotation (3, 3) of a pose in the world; the identity where none is asked for."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_euler("xyz", pose.rpy or (0.0, 0.0, 0.0)).as_matrix())
