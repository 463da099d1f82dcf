"""A plan followed step by step among obstacles as they truly move: what is seen on the way is answered on the way."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fzcli.errors import SpecError
from fzcli.plan.belief import believed, changed, seen_now
from fzcli.plan.braked_path import BrakedPath
from fzcli.plan.detour_planner import Attempt
from fzcli.plan.joint_path import JointPath
from fzcli.plan.load import any_plan_of, origin_of, prepare_any, prepared, with_sets
from fzcli.plan.online import Answer, Situation, respond, warm
from fzcli.plan.peaks import peak_times
from fzcli.plan.plan import Plan
from fzcli.plan.plan_spec import DetourFields
from fzcli.plan.planar_result import as_any_plan
from fzcli.plan.planar_spec import AnyRun
from fzcli.plan.planning import AnyTask, solve
from fzcli.plan.result import EXCESS
from fzcli.plan.scene import build_scene
from fzcli.plan.world import AnyWorld, Path
from fzcli.spec.document import Document
from fzcli.spec.result import Status


@dataclass(frozen=True)
class Mission:
    """A plan to be followed. ``known``: the task of planning it with what is known at first; ``world``: as it is."""

    spec: AnyRun
    known: AnyTask
    world: AnyWorld


@dataclass(frozen=True)
class Event:
    """Something new was seen at a step [s from the start], and answered; ``seconds``: what that took, measured."""

    step: int
    time: float
    answer: Answer
    seconds: float


@dataclass(frozen=True)
class Execution:
    """What was driven, judged among the true obstacles, and the events on the way. ``step``: seconds a step."""

    plan: Plan
    events: tuple[Event, ...]
    step: float
    path: Path


def mission_of(document: Document, sets: Sequence[str] = ()) -> Mission:
    """Validate a plan that is to be followed. Raises SpecError with every problem found."""
    document = with_sets(document, sets)
    spec = any_plan_of(document)
    late = [i for i, one in enumerate(spec.scene) if (one.seen_at_step or 0) >= spec.steps]
    if late:
        text = f"comes after the last step: the path has {spec.steps}"
        raise SpecError([document.problem(text, ("scene", i, "seen_at_step")) for i in late])
    return build_mission(spec, lambda known: prepared(document, known))


def build_mission(spec: AnyRun, prepare: Callable[[AnyRun], AnyTask] = prepare_any) -> Mission:
    """A plan to be followed; ``prepare`` makes the task of planning with what is known at first.

    Raises SpecError with every problem found.
    """
    scene = build_scene(spec.scene)
    known = tuple(one for one in scene.named if one.known)
    task = prepare(spec.model_copy(update={"scene": known}))
    return Mission(spec, task, task.world.among(scene))


def execute(mission: Mission, argv: Sequence[str] = ()) -> Execution:
    """Plan with what is known, then follow the plan.

    At every step the obstacles in sight are measured; where one is new, or moves otherwise than believed, the path
    is looked at again and, if need be, led round or stopped. What the arm does between now and the next step stays.
    Raises NoPlanError where there is no plan to begin with.
    """
    path = solve(mission.known).path
    step = path.duration / mission.spec.steps
    warm(_situation(mission, mission.world, path, 0, step))
    path, events = _followed(mission, path, step)
    task = mission.known.among(mission.spec, mission.world.scene)
    attempt = Attempt(path, _method(events), _cost(mission, path), task.judged(path))
    plan = as_any_plan(task, attempt, origin_of(mission.spec, argv))
    followed = _inner(path)
    detours = followed.detours if isinstance(followed, JointPath) else ()
    plan = replace(plan, detours=detours, status=_status(mission, plan, attempt, events))
    return Execution(plan, events, step, path)


def _followed(mission: Mission, path: Path, step: float) -> tuple[Path, tuple[Event, ...]]:
    spec, truth = mission.spec, mission.world
    seen: frozenset[int] = frozenset()
    belief = believed(truth.scene, seen, 0.0)
    events: list[Event] = []
    for number in range(spec.steps):
        now = number * step
        seen |= seen_now(truth, path, number, now)
        sight = believed(truth.scene, seen, now)
        if not changed(belief, sight, now, path.duration):
            continue
        belief = sight
        begin = time.perf_counter()
        answer = respond(_situation(mission, truth.among(belief), path, number, step), spec.execution.answer)
        events.append(Event(number, now, answer, time.perf_counter() - begin))
        path = answer.path
        if answer.kind == "stop":  # for good
            break
    return path, tuple(events)


def _situation(mission: Mission, world: AnyWorld, path: Path, number: int, step: float) -> Situation:
    spec, n = mission.spec, mission.known.world.model.n
    weights = _weights(spec, n)
    limits = mission.known.accelerations
    return Situation(world, path, number, spec.steps, step, weights, limits, spec.margin, spec.execution.evaluations)


def _weights(spec: AnyRun, n: int) -> np.ndarray:
    given = spec.planner.weights if isinstance(spec.planner, DetourFields) else None
    return np.array(given or (1.0,) * n)


def _method(events: Sequence[Event]) -> str:
    answers = [f"{event.answer.kind} at step {event.step}" for event in events if event.answer.kind != "keep"]
    return ", ".join(answers) or "as planned"


def _inner(path: Path) -> Path:
    return path.path if isinstance(path, BrakedPath) else path


def _cost(mission: Mission, path: Path) -> float:
    """Weighted squares of the peaks of all detours; NaN where the path is of another kind."""
    inner = _inner(path)
    if not isinstance(inner, JointPath):
        return float("nan")
    weights = _weights(mission.spec, len(inner.start))
    return float(sum((weights * detour.peak**2).sum() for detour in inner.detours))


def _status(mission: Mission, plan: Plan, attempt: Attempt, events: Sequence[Event]) -> Status:
    """Judged by the truth: contact fails; a stop, or a margin that is not kept, is flagged."""
    told = next((event.answer.reason for event in reversed(events) if event.answer.reason), "")
    found, path = attempt.clearance, attempt.path
    if isinstance(path, BrakedPath):
        told += _harsh(plan, path, mission.known.accelerations)
    if found.clearance < 0:
        apart = f"{found.pair} overlap by {-1e3 * found.clearance:.3g} mm at {found.time:.4g} s"
        return Status("failed", f"contact: {apart}" + (f" ({told})" if told else ""), _advice(mission))
    if isinstance(path, BrakedPath):
        back = f", then back by {path.back:.3g} s of the path" if path.back else ""
        text = f"stopped on the path at {path.stopped:.4g} s{back}: {told}"
        return Status("flagged", text, "see it earlier, or plan anew from where the arm stands")
    if plan.status.name == "flagged" and found.clearance < mission.spec.margin:
        return replace(plan.status, advice="see it earlier, or ask for a smaller margin")
    return plan.status


def _harsh(plan: Plan, halt: BrakedPath, limits: np.ndarray) -> str:
    """By how much a stop exceeds the stated joint accelerations (n), in words; empty where it keeps them."""
    most = np.abs(halt.at(peak_times(halt, halt.begin, halt.rest))[2]).max(axis=0)
    worst = int((most - limits).argmax())
    if most[worst] <= limits[worst] + EXCESS:
        return ""
    name, unit = plan.joint_names[worst], plan.joint_units[worst]
    return f"; the stop takes {name} to {most[worst]:.6g} {unit}/s2, beyond its limit of {limits[worst]:.6g} {unit}/s2"


def _advice(mission: Mission) -> str:
    if mission.spec.execution.answer == "none":
        return "execution.answer: detour leads the path round what is seen"
    return "see it earlier (seen_at_step, seen_within), or let the plan know it from the start"
