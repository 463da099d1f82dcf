"""A sweep whose runs are plans (``run: plan``): from its file to configurations, and to the runs of a trajectory."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fzcli.errors import Problem, SpecError
from fzcli.plan.load import fitted, plan_of
from fzcli.plan.plan_spec import PLANNER_SPECS, PlanRun
from fzcli.spec.document import Document, Node
from fzcli.spec.load import check_kind, load_robot
from fzcli.spec.overlay import overlaid, without
from fzcli.spec.sets import apply_sets
from fzcli.sweep.builds import split
from fzcli.sweep.checks import check_expected, check_one_source
from fzcli.sweep.draws import candidate, generator, sources
from fzcli.sweep.own_section import OwnSection, own_section
from fzcli.sweep.resolve import Drawn, configurations_of, plain, resolved_runs, with_values
from fzcli.sweep.scene_spec import SceneDraw
from fzcli.sweep.scenes import draw_scene
from fzcli.sweep.sweep_spec import OWN_KEYS, SweepFile, Trajectories
from fzcli.sweep.trajectories import FilterError

BY_SCENES = ("start.q", "goal")  # fields that random scenes give


@dataclass(frozen=True)
class PlanSweep:
    """A sweep of plans, resolved: ``changes`` of each configuration as written, ``specs`` their full run specs.

    ``document`` has the options applied.
    """

    file: SweepFile
    document: Document
    changes: list[dict[str, Any]]
    specs: list[PlanRun]
    draws: tuple[Drawn, ...]


@dataclass(frozen=True)
class PlanTrajectory:
    """The plans of one trajectory, one a configuration, and the numbers drawn for it, by path."""

    specs: tuple[PlanRun, ...]
    drawn: dict[str, tuple[float, ...]]


@dataclass(frozen=True)
class PlanDrawing:
    """What the plans of any trajectory are drawn from."""

    specs: tuple[PlanRun, ...]
    draws: tuple[Drawn, ...]
    scenes: SceneDraw | None
    plan: Trajectories

    def trajectory(self, place: int) -> PlanTrajectory:
        """The one at a place counted from the first, the same for all configurations.

        A scene of the first one's robot is drawn first, then the fields that are drawn.

        Raises FilterError where no scene fits.
        """
        index, fields = self.plan.first + place, {}
        ((random, apart),) = sources(self.plan, self.draws, range(place, place + 1))
        if self.scenes is not None:
            scene_random = random if isinstance(random, np.random.Generator) else generator(self.plan.seed, index)
            found = draw_scene(self.specs[0], self.scenes, scene_random)
            if found is None:
                text = f"scenes: none of {self.scenes.most} candidates of trajectory {index} fits"
                raise FilterError(f"{text}: start and goal clear, the straight path not")
            fields = found
        values = split(self.draws, candidate(self.draws, random, apart))
        specs = (with_values(spec.model_copy(update=fields), values) for spec in self.specs)
        drawn = {path: tuple(float(v) for v in value) for path, value in values.items()}
        return PlanTrajectory(tuple(specs), drawn | _numbers(fields))


def _numbers(fields: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    """What of a drawn scene has one size in all scenes."""
    if not fields:
        return {}
    goal = fields["goal"]
    ends = {"goal.q": goal.q} if goal.q is not None else {"goal.position": goal.position, "goal.rpy": goal.rpy}
    return {"start.q": fields["start"].q, **ends}


def resolve_plans(document: Document, sets: Sequence[str] = ()) -> PlanSweep:
    """Validate a sweep of plans and all its configurations. Raises SpecError with every problem found."""
    document = apply_sets(document, sets) if sets else document
    check_kind(document, "sweep")
    own = own_section(document, PlanRun)
    base = overlaid(without(document, OWN_KEYS), {"kind": "plan"})
    configurations = configurations_of(document, own)
    check_one_source(document, own)
    problems = list(_misplaced(document, own, configurations))
    if problems:
        raise SpecError(problems)
    check_expected(document, own, configurations)
    kinds = _planner_kinds(base, configurations)

    def make(one: Document) -> PlanRun:
        return plan_of(fitted(_standing_in(one) if own.file.scenes else one, kinds))

    specs, draws = resolved_runs(document, own, base, configurations, make)
    return PlanSweep(own.file, document, plain(configurations), specs, draws)


def _misplaced(document: Document, own: OwnSection, configurations: list[dict[str, Node]]) -> Iterator[Problem]:
    """Fields with two sources, and parts of a sweep that plans have not."""
    if own.file.trajectories.keep_if is not None:
        text = "is for simulations; scenes are drawn until they fit"
        yield document.problem(text, ("trajectories", "keep_if"), at_key=True)
    places: list[tuple[tuple[str | int, ...], str]] = [(("grid", path), path) for path in own.file.grid]
    places += [(("zip", path), path) for path in own.file.zip_]
    places += [(("list", i, path), path) for i, entry in enumerate(own.file.list_) for path in entry]
    places += [(("trajectories", "draw", path), path) for path in own.file.trajectories.draw]
    followed = [(("replay",), "replay")] if document.value.get("replay") is not None else []
    for at, path in (*followed, *places):
        if path.partition(".")[0] == "replay":
            text = "a sweep makes plans and follows none; `fzcli simulate` replays a plan"
            yield document.problem(text, at, at_key=True)
    if own.file.scenes is None:
        return
    text = "is drawn as well (scenes); a field has one source"
    start = document.value.get("start")
    if isinstance(start, dict) and "q" in start:
        yield document.problem(text, ("start", "q"), at_key=True)
    if "goal" in document.value:
        yield document.problem(text, ("goal",), at_key=True)
    for at, path in places:
        if path.startswith("scene") or any(f"{path}.".startswith(f"{other}.") for other in BY_SCENES):
            yield document.problem(text, at, at_key=True)


def _planner_kinds(base: Document, configurations: Sequence[Mapping[str, Node]]) -> set[str]:
    """Kinds of planners that occur anywhere in the sweep."""
    written = base.value.get("planner")
    kinds = {written.get("kind", "detour") if isinstance(written, dict) else "detour"}
    kinds |= {str(changes["planner.kind"].value) for changes in configurations if "planner.kind" in changes}
    return kinds & set(PLANNER_SPECS)


def _standing_in(document: Document) -> Document:
    """With a start and a goal in the middle of the joint limits, in place of those to be drawn.

    Unchanged where the robot cannot be read: the run itself is refused then, by its robot.
    """
    name = document.value.get("robot")
    if not isinstance(name, str):
        return document
    try:
        joints = [link.joint for link in load_robot(name, document.path).links if link.joint.type != "fixed"]
    except SpecError:
        return document
    middle = [float(np.mean(joint.position)) if joint.position else 0.0 for joint in joints]
    return overlaid(document, {"start.q": middle, "goal": {"q": middle}})
