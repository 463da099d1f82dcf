"""The planner of smooth detours: the golden case, what its certificate says, and that nothing is left to chance."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from independent import clearances
from numpy.typing import NDArray

from fzcli.model import RobotModel, build_model
from fzcli.model.gauss_magnus import path_piece
from fzcli.plan.base_ride import build_ride
from fzcli.plan.detour_planner import met_windows
from fzcli.plan.detour_search import DetourProblem, WindowProblem, patterns
from fzcli.plan.joint_path import Detour, JointPath
from fzcli.plan.load import load_plan, make_plan, task_of
from fzcli.plan.plan import Plan
from fzcli.plan.planning import solve
from fzcli.plan.rrt_planner import SHORTEST, ChainedPath, timed
from fzcli.plan.scene import Obstacle, build_scene
from fzcli.plan.world import World, build_world
from fzcli.spec.document import document_of
from fzcli.spec.load import load_robot
from fzcli.spec.tool import Tool, with_tool

Array = NDArray[np.float64]
START, GOAL = np.deg2rad([-60.0, 20.0, 100.0, 0.0, 40.0, 0.0]), np.deg2rad([60.0, 40.0, 80.0, 0.0, 60.0, 0.0])
SPHERE = {"sphere": {"center": (0.338, 0.0, 0.345), "radius": 0.05}}
PANEL = {"box": {"center": (0.3, 0.3, 0.5), "rpy": (0.3, -0.2, 0.5), "size": (0.2, 0.2, 0.02)}}
WEIGHTS = np.array([1, 1, 1, 0.3, 0.3, 0.05])
OWN = {frozenset(("J2_link", "J6_link")), frozenset(("J3_link", "J6_link"))}


@cache
def golden() -> Plan:
    return make_plan(load_plan("runs/melfa_obstacle.yaml"))


@cache
def model_of(name: str) -> RobotModel:
    return build_model(with_tool(load_robot(name), Tool(xyz=(0.0, 0.0, 0.1))))


def world_of(name: str, obstacles: Sequence[dict[str, Any]], quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> World:
    scene = build_scene([Obstacle.model_validate(one) for one in obstacles])
    return build_world(model_of(name), scene, (0.1, 0.2, -0.05) if quat[0] != 1 else (0.0, 0.0, 0.0), quat)


def test_the_golden_case() -> None:
    """Window 5 to 15; peaks about (0, -6.85, -6.96, 0, -11.70, 0) deg; cost 0.0415 rad2 within 2 %."""
    plan = golden()
    assert plan.method == "detour"
    (detour,) = plan.detours
    step = plan.metrics["duration"] / 20
    assert (detour.begin / step, detour.end / step) == pytest.approx((5, 15))
    wanted, told_apart = np.array([0, -6.85, -6.96, 0, -11.70, 0]), np.array([1.0, 0.05, 0.05, 1.0, 0.05, 0.05])
    assert (np.abs(np.rad2deg(detour.peak) - wanted) < told_apart).all()  # joints 1 and 4 hardly count in the cost
    assert plan.metrics["cost"] == pytest.approx(0.0415, rel=0.02)
    assert plan.metrics["cost"] == pytest.approx(float(WEIGHTS @ detour.peak**2), rel=1e-12)
    assert plan.metrics["speed_ratio_max"] == pytest.approx(0.3125, rel=1e-3)
    assert plan.status.name == "ok"


def test_the_straight_path_is_met_when_the_study_says() -> None:
    world = world_of("melfa_rv1a", [SPHERE])
    ((begin, end),) = met_windows(world, JointPath(START, GOAL - START, 4.0), 0.0)
    assert (begin / 0.2, end / 0.2) == pytest.approx((8.705, 11.295), abs=0.1)


def test_the_plan_has_two_derivatives_without_jumps() -> None:
    plan = golden()
    path = JointPath(START, GOAL - START, 4.0, detours=plan.detours)
    assert plan.certificate["knot_jump_max"] <= 1e-9
    for knot in (0.0, plan.detours[0].begin, 2.0, plan.detours[0].end, 4.0):
        before, after = path.at(np.array([knot - 1e-12])), path.at(np.array([knot + 1e-12]))
        for one, other, size in zip(before, after, (1.0, 1.0, 3.0), strict=True):
            assert np.abs(one - other).max() <= 1e-9 * size
    np.testing.assert_array_equal(path.at(plan.time)[0], plan.q)


def test_the_certificate_is_true() -> None:
    """Least distance by coal on frames of their own, at 2001 times: never below what is certified."""
    pytest.importorskip("coal")
    task, plan = load_plan("runs/melfa_obstacle.yaml"), golden()
    times = np.linspace(0.0, 4.0, 2001)
    q, qd, _ = JointPath(START, GOAL - START, 4.0, detours=plan.detours).at(times)
    least = clearances(task.spec, q, times, iter([np.eye(4)] * len(times)), OWN).min()
    assert plan.certificate["clearance_at_least"] - 1e-6 <= least <= plan.certificate["clearance_min"] + 1e-5
    assert least >= task.spec.margin - 1e-6
    low, high = task.model.tree.position_limits.T
    assert (q >= low).all()
    assert (q <= high).all()
    assert (np.abs(qd) <= task.speeds).all()


def test_the_same_plan_bit_for_bit() -> None:
    one, other = golden(), make_plan(load_plan("runs/melfa_obstacle.yaml"))
    for name in ("q", "qd", "qdd", "clearance"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    sets = ["planner={kind: rrt_connect, seed: 3}"]
    trees = [make_plan(load_plan("runs/melfa_obstacle.yaml", sets)) for _ in range(2)]
    np.testing.assert_array_equal(trees[0].q, trees[1].q)
    assert trees[0].method == "rrt_connect"
    elsewhere = make_plan(load_plan("runs/melfa_obstacle.yaml", ["planner={kind: rrt_connect, seed: 4}"]))
    assert trees[0].q.shape != elsewhere.q.shape or not np.array_equal(trees[0].q, elsewhere.q)


def test_a_path_over_corners_keeps_speeds_accelerations_and_margin() -> None:
    plan = make_plan(
        load_plan(
            "runs/melfa_obstacle.yaml",
            ["planner={kind: rrt_connect, seed: 1}", "accelerations=[3, 3, 3, 6, 6, 6]", "duration=fastest"],
        )
    )
    assert plan.status.name == "ok"
    assert (np.abs(plan.qdd) <= np.array([3, 3, 3, 6, 6, 6]) * (1 + 1e-6)).all()
    assert plan.certificate["clearance_min"] >= 0.01 - 1e-6
    assert plan.certificate["knot_jump_max"] <= 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_no_edge_is_so_short_that_it_takes_any_acceleration(seed: int) -> None:
    """From rest to rest over the shortest edge at full speed: 5.7735 / 1.875^2 v^2 / way, and no more."""
    task = load_plan("runs/melfa_obstacle.yaml", [f"planner={{kind: rrt_connect, seed: {seed}}}", "duration=fastest"])
    path = solve(task).path
    assert isinstance(path, ChainedPath)
    assert min(np.abs(part.travel).max() for part in path.parts) >= SHORTEST
    _, _, qdd = path.at(np.linspace(0.0, path.duration, 4001))
    assert np.abs(qdd).max() <= 1.6423 * task.speeds.max() ** 2 / SHORTEST
    _, _, slow = solve(load_plan("runs/melfa_obstacle.yaml", [f"planner={{kind: rrt_connect, seed: {seed}}}"])).path.at(
        np.linspace(0.0, 4.0, 4001)
    )
    assert np.abs(slow).max() < 20.0


def test_a_sliver_takes_as_long_as_the_shortest_edge() -> None:
    task = load_plan("runs/melfa_obstacle.yaml", ["duration=fastest"])
    corners = [START, 0.5 * (START + GOAL), 0.5 * (START + GOAL) + 1e-7, GOAL]
    path = timed(corners, task.nominal(GOAL), task.spec, task.speeds, task.accelerations)
    whole = timed([START, START + SHORTEST], task.nominal(GOAL), task.spec, task.speeds, task.accelerations)
    assert path.parts[1].duration == pytest.approx(whole.duration, rel=1e-6)


def test_limits_hold_between_the_samples_too() -> None:
    """A goal near a joint's limit, where the least detour would go past it."""
    document = {
        "kind": "plan",
        "robot": "melfa_rv1a",
        "tool": {"xyz": [0, 0, 0.1]},
        "start": {"q": [float(v) for v in np.deg2rad([-60, 20, 100, 0, 40, 0])]},
        "goal": {"q": [float(v) for v in np.deg2rad([60, 40, 62, 0, 60, 0])]},
        "duration": 4.0,
        "margin": 0.01,
        "scene": [{"sphere": {"center": [0.35, 0.0, 0.35], "radius": 0.06}}],
    }
    for planner in ({"kind": "detour", "weights": [9, 9, 0.1, 1, 1, 1]}, {"kind": "detour", "window": [8, 14]}):
        plan = make_plan(task_of(document_of({**document, "planner": planner})))
        assert plan.certificate["joint_limit_excess_max"] == 0
        assert plan.certificate["joint_speed_excess_max"] <= 1e-9
        assert plan.status.name == "ok"


@pytest.mark.parametrize("name", ["melfa_rv1a", "melfa_free_flyer"])
@pytest.mark.parametrize("windows", [((1.0, 3.0),), ((0.0, 2.0), (1.0, 3.0), (2.0, 4.0))])
def test_derivatives_of_the_search_are_those_of_differences(
    name: str, windows: tuple[tuple[float, float], ...]
) -> None:
    quat = (1.0, 0.0, 0.0, 0.0) if name == "melfa_rv1a" else (0.5, 0.5, -0.5, 0.5)
    world = world_of(name, [SPHERE, PANEL], quat)
    problem = DetourProblem(world, JointPath(START, GOAL - START, 4.0), np.ones(6), 0.01, np.full(6, np.inf))
    shape, rng = WindowProblem(problem, windows), np.random.default_rng(4)
    x, h = 0.3 * rng.normal(size=6 * len(windows)), 1e-6
    _, slopes = shape.clearances(x, 1000.0)
    sides = [[shape.clearances(x + s * h * e, 1000.0)[0] for s in (1, -1)] for e in np.eye(len(x))]
    np.testing.assert_allclose(slopes, np.column_stack([(a - b) / (2 * h) for a, b in sides]), atol=2e-8)


@pytest.mark.parametrize("name", ["melfa_rv1a", "melfa_free_flyer"])
def test_starts_are_compared_by_what_they_miss(name: str) -> None:
    """All at once as one by one; nothing is missed where every distance and limit holds."""
    world = world_of(name, [SPHERE])
    nominal = JointPath(START, GOAL - START, 4.0)
    problem = DetourProblem(world, nominal, WEIGHTS, 0.01, model_of(name).tree.speed_limits)
    shape, starts = WindowProblem(problem, ((1.0, 3.0),)), np.array(list(patterns(6))[:12])
    np.testing.assert_allclose(shape.violations(starts), [shape.violation(x) for x in starts], atol=1e-12)
    assert shape.violation(np.zeros(6)) > 0.05
    if name == "melfa_rv1a":
        assert shape.violation(1.5 * golden().detours[0].peak) == 0.0


def test_the_base_rides_as_its_momentum_has_it() -> None:
    """Fine pieces of the same path by the model's own step; asked for in any order."""
    model = model_of("melfa_free_flyer")
    path = JointPath(START, GOAL - START, 4.0, detours=(Detour(np.array([0.4, -0.3, 0.2, 0, 0.5, 0]), 1.0, 3.0),))
    ride, piece = build_ride(model, path, np.array([1.0, 0, 0, 0])), path_piece(model)
    times = np.linspace(0.0, 4.0, 801)
    q, fine = path.at(times)[0], [np.array([1.0, 0, 0, 0])]
    for before, after in pairwise(q):
        fine.append(np.array(piece(fine[-1], before, after - before)[0]).ravel())
    order = np.random.default_rng(0).permutation(801)
    np.testing.assert_allclose(ride.at(times[order]), np.array(fine)[order], atol=2e-6)


def test_a_world_far_from_the_origin_is_as_the_one_at_it() -> None:
    """Distances of a base that stands or floats anywhere, the scene with it."""
    from scipy.spatial.transform import Rotation

    path = JointPath(START, GOAL - START, 4.0)
    times = np.linspace(0.0, 4.0, 50)
    here = world_of("melfa_free_flyer", [SPHERE])
    turn = Rotation.from_quat([0.1, -0.4, 0.3, 0.7])
    center = turn.apply(SPHERE["sphere"]["center"]) + np.array([1.0, -2.0, 3.0])  # type: ignore[index]
    sphere = Obstacle.model_validate({"sphere": {"center": tuple(center), "radius": 0.05}})
    quat = turn.as_quat()[[3, 0, 1, 2]]
    there = replace(
        here, scene=build_scene([sphere]), base_position=np.array([1.0, -2.0, 3.0]), base_quat=quat
    )
    np.testing.assert_allclose(here.distances(path, times), there.distances(path, times), atol=1e-12)
