"""Sweeps of plans: the same rows whoever makes them, judged by engines of their own; what makes no sense is refused."""

import itertools
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fzcli.errors import SpecError
from fzcli.plan.plan import Plan
from fzcli.plan.planning import Task, planned_robot, prepare, solve
from fzcli.plan.result import as_plan
from fzcli.record.sweep_record import SweepRecord
from fzcli.spec.document import document_of
from fzcli.spec.reader import read
from fzcli.spec.result import Provenance
from fzcli.sweep.execute import load_sweep, resolve_any, run_sweep
from fzcli.sweep.plan_sweep import PlanDrawing, PlanSweep, resolve_plans
from fzcli.sweep.trajectories import FilterError
from tests.plan.independent import attitude, clearances, frame, link_frames, momentum, ridden, turned

RUNS = Path(__file__).parents[2] / "runs"
COUNT, SAMPLES = 3, 401
FLYERS = (0, 3, 8)  # scenes of the free flyer, of spheres and of panels


def scenes200(**changes: Any) -> PlanSweep:
    """The shipped sweep with few scenes."""
    data = read(RUNS / "scenes200.yaml").value
    return resolve_plans(document_of({**data, "trajectories": {"count": COUNT, "seed": 2008}, **changes}))


def plans_of(sweep: PlanSweep, index: int) -> list[tuple[Task, Any, Plan]]:
    """Task, path and plan of every configuration of a scene."""
    drawing = PlanDrawing(tuple(sweep.specs), sweep.draws, sweep.file.scenes, sweep.file.trajectories)
    tasks = [prepare(spec) for spec in drawing.trajectory(index).specs]
    attempts = [solve(task) for task in tasks]
    origin = Provenance("", "", "")
    return [(task, one.path, as_plan(task, one, origin)) for task, one in zip(tasks, attempts, strict=True)]


@cache
def record() -> SweepRecord:
    return run_sweep(scenes200(), jobs=1)


def assert_same(one: SweepRecord, other: SweepRecord) -> None:
    """All columns but the time that planning took."""
    assert set(one.metrics) == set(other.metrics)
    for name in set(one.metrics) - {"plan_time"}:
        np.testing.assert_array_equal(one.metrics[name], other.metrics[name], err_msg=name)
    for name in one.draws:
        np.testing.assert_array_equal(one.draws[name], other.draws[name])
    assert [(run.config, run.trajectory, run.role) for run in one.kept] == [
        (run.config, run.trajectory, run.role) for run in other.kept
    ]


def test_jobs_do_not_matter() -> None:
    assert_same(record(), run_sweep(scenes200(), jobs=2))


def test_a_scene_is_found_by_its_index_alone() -> None:
    """And made again it gives the same rows to the last bit."""
    last = run_sweep(scenes200(trajectories={"count": 1, "first": COUNT - 1, "seed": 2008}), jobs=1)
    rows = record().metrics["trajectory"] == COUNT - 1
    for name in set(last.metrics) - {"plan_time"}:
        np.testing.assert_array_equal(last.metrics[name], record().metrics[name][rows], err_msg=name)


def test_what_the_rows_say() -> None:
    """All planners but the paper's solve these scenes; what the paper's calls clear is in contact."""
    metrics = record().metrics
    solved = metrics["solved"].reshape(4, COUNT)
    np.testing.assert_array_equal(solved[:3], 1.0)
    np.testing.assert_array_equal(metrics["contact"][metrics["solved"] == 1], 0.0)
    np.testing.assert_array_equal(solved[3], 0.0)
    paper = metrics["claimed"].reshape(4, COUNT)[3] == 1
    np.testing.assert_array_equal(metrics["contact"].reshape(4, COUNT)[3], np.where(paper, 1.0, np.nan))
    assert {run.role for run in record().kept} <= {"best", "median", "worst"}
    spans = metrics["path_length"].reshape(4, COUNT)
    assert (spans[0] <= spans[2]).sum() >= COUNT - 1  # detours are shorter than corners


def test_no_plan_that_is_called_clear_touches_anything() -> None:
    """By coal on frames multiplied out in NumPy, at 401 times; limits and speeds of the joints hold at 4001."""
    pytest.importorskip("coal")
    sweep = scenes200(list=[{"planner.kind": "detour"}, {"planner.kind": "rrt_connect"}])
    for task, path, plan in itertools.chain(*(plans_of(sweep, index) for index in range(COUNT))):
        times = np.linspace(0.0, path.duration, SAMPLES)
        own = {frozenset((pair.link, pair.other)) for pair in task.world.clearance.pairs if pair.obstacle < 0}
        least = clearances(task.spec, path.at(times)[0], times, iter([np.eye(4)] * SAMPLES), own).min()
        assert plan.status.name == "ok"
        assert least >= task.spec.margin - 1e-6
        q, qd, _ = path.at(np.linspace(0.0, path.duration, 4001))
        joints = [link.joint for link in task.spec.robot.links]
        low, high = np.array([joint.position for joint in joints]).T
        assert (q >= low).all()
        assert (q <= high).all()
        assert (np.abs(qd) <= np.array([joint.speed for joint in joints]) * (1 + 1e-9)).all()


@pytest.mark.parametrize("index", FLYERS)
def test_a_free_flyer_meets_its_pose_on_the_true_plant(index: int) -> None:
    """Driven along the path by an integrator of its own, momentum body by body in NumPy; nothing touched on the way."""
    pytest.importorskip("coal")
    sweep = load_sweep("free_flyer100", ["grid.hold_base=[false]"])
    assert isinstance(sweep, PlanSweep)
    task, path, plan = plans_of(sweep, index)[0]
    assert plan.status.name == "ok"
    robot, goal, times = planned_robot(task.spec), task.spec.goal, np.linspace(0.0, path.duration, SAMPLES)
    bases = ridden(robot, path, path.duration, times)
    tip = next(iter(robot.tips.values()))
    end = link_frames(robot, path.goal, bases[-1])[tip.link] @ frame(np.array(tip.xyz), turned(tip.rpy))
    np.testing.assert_allclose(end[:3, 3], goal.position, atol=1e-4)
    np.testing.assert_allclose(end[:3, :3], turned(goal.rpy), atol=1e-4)
    own = {frozenset((pair.link, pair.other)) for pair in task.world.clearance.pairs if pair.obstacle < 0}
    assert clearances(task.spec, path.at(times)[0], times, iter(bases), own).min() >= task.spec.margin - 1e-5
    for i in range(1, len(plan.time) - 1, 40):
        base = frame(plan.base_position[i], attitude(plan.base_quat[i]))
        (linear, angular), sizes = momentum(robot, plan.q[i], plan.qd[i], base, plan.base_twist[i])
        assert np.linalg.norm(linear) <= 1e-9 * sizes[0]
        assert np.linalg.norm(angular) <= 1e-9 * sizes[1]


SCENES = {"count": [1, 1], "radius": ["40 mm", "80 mm"]}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"run": "simulate"}, "tool: unknown key"),
        ({"start": {"q": [0, 0, 0, 0, 0, 0]}}, "start.q: is drawn as well (scenes); a field has one source"),
        ({"goal": {"position": [0.3, 0, 0.5]}}, "goal: is drawn as well (scenes); a field has one source"),
        ({"grid": {"goal.q": [[0, 0, 1, 0, 0, 0]]}}, "grid.goal.q: is drawn as well (scenes)"),
        ({"list": [{"scene": []}]}, "list.0.scene: is drawn as well (scenes)"),
        (
            {"trajectories": {"count": 2, "draw": {"start.q": {"uniform": [[0] * 6, [1] * 6]}}}},
            "trajectories.draw.start.q: is drawn as well (scenes); a field has one source",
        ),
        (
            {"trajectories": {"count": 2, "keep_if": {"that": ["clearance_min > 0"]}}},
            "trajectories.keep_if: is for simulations; scenes are drawn until they fit",
        ),
        ({"scenes": {**SCENES, "count": [3, 1]}}, "scenes: count needs two numbers from 1 on, in order, got 3 and 1"),
        ({"scenes": {**SCENES, "radius": ["80 mm", "40 mm"]}}, "scenes: the lower end 0.08 lies above the upper 0.04"),
        ({"scenes": {**SCENES, "radius": [0, "40 mm"]}}, "scenes.radius.0: must be > 0, got 0"),
        ({"scenes": {**SCENES, "radus": 1}}, "scenes.radus: unknown key; did you mean 'radius'?"),
        ({"planer": {}}, "planer: unknown key; did you mean 'planner'?"),
        ({"list": [{"planner.kind": "papre"}]}, "planner.kind: unknown kind 'papre'; did you mean 'paper'?"),
        ({"list": [{"planner.wieghts": [1] * 6}]}, "planner.wieghts: unknown key; did you mean 'weights'?"),
        ({"grid": {"duration": [0]}}, "duration: must be > 0 or 'fastest', got 0"),
        ({"grid": {"margin": [-0.01]}}, "margin: must be >= 0, got -0.01"),
        ({"expect_failures": {"planner.kind": "rrt"}}, "expect_failures.planner.kind: no configuration has"),
    ],
)
def test_bad_sweeps_of_plans_are_refused(changes: dict[str, Any], text: str) -> None:
    data = read(RUNS / "scenes200.yaml").value
    with pytest.raises(SpecError) as caught:
        resolve_any(document_of({**data, **changes}))
    assert text in str(caught.value)


def test_scenes_are_for_plans() -> None:
    data = read(RUNS / "table2.yaml").value
    with pytest.raises(SpecError, match="scenes: are for plans; write run: plan"):
        resolve_any(document_of({**data, "scenes": SCENES}))


def test_a_table_of_what_there_is_not() -> None:
    with pytest.raises(SpecError, match="table: show: clearence_min: the sweep has no such metric; did you mean"):
        run_sweep(scenes200(table={"show": ["clearence_min"]}))


def test_where_no_scene_fits_the_trajectory_is_named() -> None:
    with pytest.raises(FilterError, match="scenes: none of 2 candidates of trajectory 0 fits"):
        run_sweep(scenes200(margin=3.0, scenes={**SCENES, "most": 2}), jobs=1)
