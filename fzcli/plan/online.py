"""A path under way that would touch something: a detour from where the arm is, else a smooth stop on the path.

A half-cycloidal detour begins and ends at rest in value, rate and acceleration. One that begins a step from now
leaves position, velocity and acceleration of the arm as they are then, whatever they are: the path stays C2.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fzcli.plan.braked_path import BrakedPath
from fzcli.plan.continuous import PathClearance
from fzcli.plan.detour_planner import CERTIFIED, LOOKED_AT, SLACK, certified, polished
from fzcli.plan.detour_search import AMPLITUDES, Budget, DetourProblem, SpentError, WindowProblem, patterns
from fzcli.plan.joint_path import JointPath
from fzcli.plan.online_spec import AnswerPolicy
from fzcli.plan.window_ride import Window
from fzcli.plan.world import AnyWorld, Path

Array = NDArray[np.float64]
RETURNS = (8, 6, 4)  # steps after the sight at which a detour may be over, beside all that are left
BRAKES = (4.0, 3.0, 2.0, 1.0, 0.5)  # steps that a stop may take, the smoothest first
BACK = (2.0, 4.0, 8.0)  # steps of path that the arm may go back, where it would be met at rest
GLANCES = 60  # samples of a stop, before it is certified
EACH = 80  # evaluations from one start: most that lead anywhere do so in 30
STARTS = 2  # patterns of signs that are tried
TOLERANCE = 1e-9  # rad/s2 or m/s2
AnswerKind = Literal["keep", "detour", "stop"]


@dataclass(frozen=True)
class Situation:
    """A path under way at a whole step: ``world`` with the obstacles as believed now, ``step`` of ``steps``.

    ``seconds`` a step; ``weights`` (n) of the squared peaks; ``accelerations`` (n), their limits; ``margin`` [m] to
    keep; ``evaluations`` that a search may take.
    """

    world: AnyWorld
    path: Path
    step: int
    steps: int
    seconds: float
    weights: Array
    accelerations: Array
    margin: float
    evaluations: int

    @property
    def now(self) -> float:
        """[s]"""
        return self.step * self.seconds

    @property
    def begin(self) -> float:
        """The earliest time [s] at which the motion can change: one step is left to find an answer."""
        return (self.step + 1) * self.seconds


@dataclass(frozen=True)
class Answer:
    """The path to follow, why, and its certified clearance [m] from now to its end among the obstacles as believed.

    ``margin`` [m]: what was asked for; ``until``: the step at which a detour is over, or the arm at rest;
    ``evaluations``: taken by the search.
    """

    kind: AnswerKind
    path: Path
    clearance: float
    margin: float
    until: float
    reason: str = ""
    evaluations: int = 0


def respond(situation: Situation, policy: AnswerPolicy = "detour") -> Answer:
    """Keep to the path where it stays clear, or is over before the motion can change; else lead it round; else stop.

    The stop is made ready before the search, so that there is always something to do when the step is over.
    """
    s = situation
    ahead = certified(s.world, s.path, s.margin + 10 * CERTIFIED, s.now)
    if policy == "none" or _keeps(ahead, s.margin) or s.step + 1 >= s.steps:
        return Answer("keep", s.path, ahead.at_least, s.margin, s.steps)
    leading = certified(s.world, s.path, s.margin + 10 * CERTIFIED, s.now, s.begin)
    margin = min(s.margin, leading.at_least - SLACK)  # what is too near before the motion can change, stays so
    halt = _stop(s, margin)
    hopeless = _hopeless(s, margin, leading)
    if policy == "stop" or hopeless:
        return _because(halt, hopeless or _met(ahead))
    found, why, used = _detour(s, margin)
    return found or _because(halt, f"{_met(ahead)}; {why}", used)


def warm(situation: Situation) -> None:
    """Load and build what the first answer would otherwise spend its time on."""
    s = situation
    certified(s.world, s.path, 0.0, s.now, s.begin)
    if isinstance(s.path, JointPath):
        shape = WindowProblem(_problem(s, s.path, s.margin, Budget()), ((s.begin, s.path.duration),))
        shape.violations(np.zeros((1, len(s.weights))))
        shape.optimise(np.zeros(len(s.weights)), -np.inf)


def return_steps(step: int, steps: int) -> tuple[int, ...]:
    """Steps at which a detour may be over that begins one step after ``step``: all that are left first, then fewer.

    Seen at step 8 of 20: 20, 16, 14, 12.
    """
    return (steps, *(step + after for after in RETURNS if step + 1 < step + after < steps))


def _keeps(found: PathClearance, margin: float) -> bool:
    return found.at_least >= margin - SLACK - CERTIFIED and found.clearance >= margin - SLACK


def _met(found: PathClearance) -> str:
    apart = f"overlap by {-1e3 * found.clearance:.3g} mm" if found.clearance < 0 else "come too near"
    return f"{found.pair} would {apart} at {found.time:.3g} s"


def _hopeless(s: Situation, margin: float, leading: PathClearance) -> str:
    """Why no detour can help: contact before the motion can change, or an obstacle where the path ends."""
    if leading.clearance < 0:
        now = s.world.distances(s.path, np.array([s.now]))[0]
        worst = int(now.argmin())
        if now[worst] < 0:
            apart = f"{s.world.clearance.pairs[worst]} overlap by {-1e3 * now[worst]:.3g} mm"
            return f"in contact already when it is seen, at {s.now:.3g} s: {apart}"
        return f"{_met(leading)}, before the motion can change"
    distances = s.world.distances(s.path, np.array([s.path.duration]))[0]
    worst = int(distances.argmin())
    if distances[worst] < margin:
        pair = s.world.clearance.pairs[worst]
        left = f"{1e3 * distances[worst]:.3g} mm apart" if distances[worst] >= 0 else "in contact"
        return f"the goal is covered: {pair} will be {left} at {s.path.duration:.3g} s"
    return ""


def _detour(s: Situation, margin: float) -> tuple[Answer | None, str, int]:
    """The first detour that keeps clear, or none and why, and the evaluations that it took."""
    if not isinstance(s.path, JointPath):
        return None, "a path over corners is not led round", 0
    left, tried = s.evaluations, 0
    for windows, x in _starts(s, s.path, margin):
        problem = _problem(s, s.path, margin, Budget(min(left, EACH)))
        try:
            found = polished(problem, WindowProblem(problem, windows), x, margin, "detour")
        except SpentError:
            found = None
        left, tried = left - problem.budget.used, tried + 1
        if found is not None and _gentle(s, found.path):
            until = max(window[1] for window in windows) / s.seconds
            used = s.evaluations - left
            return Answer("detour", found.path, found.clearance.at_least, margin, until, evaluations=used), "", used
        if left < 1:
            return None, f"no detour found in {s.evaluations} evaluations", s.evaluations
    return None, f"no detour keeps clear, of {tried} searches", s.evaluations - left


def _problem(s: Situation, path: JointPath, margin: float, budget: Budget) -> DetourProblem:
    return DetourProblem(s.world, path, s.weights, margin, s.world.model.tree.speed_limits, s.now, budget)


def _starts(s: Situation, path: JointPath, margin: float) -> Iterator[tuple[tuple[Window, ...], Array]]:
    """Windows and peaks to start from: no detour in each window that can help, the longest first; then two detours
    that overlap, over all that is left; then the best patterns of signs for these, and for one.
    """
    n, step, last = len(s.weights), s.seconds, s.steps * s.seconds
    near = s.world.distances(path, np.linspace(s.now, last, GLANCES)).min(axis=1) < margin
    over = s.now + (last - s.now) * float(np.flatnonzero(near).max(initial=0)) / (GLANCES - 1)
    for end in return_steps(s.step, s.steps):
        if end == s.steps or end * step > over:  # what is met after the return, is met all the same
            yield ((s.begin, end * step),), np.zeros(n)
    whole, way = ((s.begin, last),), last - s.begin
    parted = ((s.begin, s.begin + 0.6 * way), (s.begin + 0.4 * way, last))
    yield parted, np.zeros(2 * n)
    for windows in (parted, whole):
        tried = np.array([np.tile(x, len(windows)) for x in patterns(n) if np.abs(x).max() == AMPLITUDES[1]])
        missed = WindowProblem(_problem(s, path, margin, Budget()), windows).violations(tried)
        for place in np.argsort(missed, kind="stable")[:STARTS]:
            yield windows, tried[place]


def _gentle(s: Situation, path: Path) -> bool:
    """Whether joint accelerations keep their limits from now on."""
    forces = path.at(np.linspace(s.now, path.duration, LOOKED_AT))[2]
    return bool((np.abs(forces) <= s.accelerations + TOLERANCE).all())


def _stop(s: Situation, margin: float) -> Answer:
    """The smoothest stop that keeps clear, the arm at rest included; else the one that stays farthest away.

    Where the arm would be met at rest, it goes back a little. After a contact, nothing but the most sudden one helps.
    """
    brakes = [brake for brake in BRAKES if _gentle(s, _halt(s, brake))] or list(BRAKES[:1])
    if margin < 0:
        return _certified_stop(s, _halt(s, brakes[-1]), margin)
    seen: list[tuple[float, BrakedPath]] = []
    for halt in (_halt(s, brake, back) for back in (0.0, *BACK) for brake in brakes if back <= s.step):
        least = float(s.world.distances(halt, np.linspace(s.now, halt.duration, GLANCES)).min(initial=np.inf))
        seen.append((least, halt))
        if least >= margin:
            answer = _certified_stop(s, halt, margin)
            if answer.clearance >= margin - SLACK - CERTIFIED:
                return answer
    return _certified_stop(s, max(seen, key=lambda one: one[0])[1], margin)


def _certified_stop(s: Situation, halt: BrakedPath, margin: float) -> Answer:
    found = certified(s.world, halt, margin + 10 * CERTIFIED, s.now)
    return Answer("stop", halt, found.at_least, margin, halt.stopped / s.seconds)


def _halt(s: Situation, brake: float, back: float = 0.0) -> BrakedPath:
    """A stop within ``brake`` steps that then goes ``back`` steps of the path."""
    halt = BrakedPath(s.path, s.begin, brake * s.seconds, s.path.duration, back * s.seconds)
    return replace(halt, end=max(halt.end, halt.rest))


def _because(halt: Answer, reason: str, evaluations: int = 0) -> Answer:
    return Answer(halt.kind, halt.path, halt.clearance, halt.margin, halt.until, reason, evaluations)
