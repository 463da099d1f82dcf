"""Plans of the planar 3-RRR: judged by geometry of our own, bounded, kept off singularities, refused by name."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import fzcli
from fzcli.errors import SpecError
from fzcli.loop.execution import execute, mission_of
from fzcli.model.collision import many
from fzcli.model.planar_3rrr import MODES
from fzcli.model.planar_body import PlanarBody
from fzcli.plan.built import planar_body_of
from fzcli.plan.load import load_plan, make_plan, task_of
from fzcli.plan.plan import Plan
from fzcli.plan.planar_bounds import reach_of
from fzcli.plan.planar_task import PlanarTask
from fzcli.plan.planning import NoPlanError, solve
from fzcli.plan.world import Path as JointMotion
from fzcli.spec.any_robot import load_any_robot
from fzcli.spec.document import document_of
from fzcli.spec.planar import Planar3RRR

Array = NDArray[np.float64]
RUN = "runs/rrr_obstacle.yaml"
FEET, CORNERS = 0.4, 0.1  # circumradii of base and platform, and links, as robots/rrr_planar.yaml says them
LINK, HALF = 0.25, 0.01
ANGLES = np.deg2rad([210.0, 330.0, 90.0])
UP = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
SIMPLE: dict[str, Any] = {
    "kind": "plan",
    "robot": "rrr_planar",
    "branch": "+++",
    "start": {"pose": [-0.12, -0.05, 0.1]},
    "goal": {"pose": [0.12, 0.03, -0.2]},
    "duration": 4.0,
}


@cache
def body() -> PlanarBody:
    robot = load_any_robot("rrr_planar")
    assert isinstance(robot, Planar3RRR)
    return planar_body_of(robot)


@cache
def made() -> tuple[PlanarTask, Plan, JointMotion]:
    task = load_plan(RUN)
    assert isinstance(task, PlanarTask)
    return task, make_plan(task), solve(task).path


def task(**changes: Any) -> PlanarTask:
    found = task_of(document_of({**SIMPLE, **changes}))
    assert isinstance(found, PlanarTask)
    return found


def corners(pose: Array) -> Array:
    """Platform corners (3, 2) at a pose."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return pose[:2] + CORNERS * UP @ np.array([[c, s], [-s, c]])


def inverse(pose: Array, signs: Array) -> Array:
    """Joint angles (3) by the cosine law."""
    way = corners(pose) - FEET * UP
    span = np.linalg.norm(way, axis=1)
    return np.arctan2(way[:, 1], way[:, 0]) + signs * np.arccos(span / (2 * LINK))


def det_a(pose: Array, theta: Array) -> float:
    elbows = FEET * UP + LINK * np.column_stack([np.cos(theta), np.sin(theta)])
    u, r = corners(pose) - elbows, corners(pose) - pose[:2]
    return float(np.linalg.det(np.column_stack([u, u[:, 1] * r[:, 0] - u[:, 0] * r[:, 1]])))


def followed(theta: Array, pose: Array, signs: Array) -> Array:
    """Poses (T, 3) along joint angles (T, 3): the closed-form inverse, inverted by Newton's method with differences."""
    found = [pose]
    for wanted in theta[1:]:
        now = found[-1].copy()
        for _ in range(6):
            miss = np.remainder(inverse(now, signs) - wanted + np.pi, 2 * np.pi) - np.pi
            h = 1e-6
            slope = [(inverse(now + d, signs) - inverse(now - d, signs)) / (2 * h) for d in h * np.eye(3)]
            now = now - np.linalg.solve(np.transpose(slope), miss)
        found.append(now)
    return np.array(found)


def from_point(pose: Array, theta: Array, point: Array) -> float:
    """The distance [m] of a point from the robot: legs and platform sides, with their width."""
    feet, ends = FEET * UP, corners(pose)
    elbows = feet + LINK * np.column_stack([np.cos(theta), np.sin(theta)])
    starts = np.vstack([feet, elbows, ends])
    ways = np.vstack([elbows, ends, np.roll(ends, -1, axis=0)]) - starts
    share = np.clip(((point - starts) * ways).sum(axis=1) / (ways**2).sum(axis=1), 0, 1)
    return float(np.linalg.norm(point - starts - share[:, None] * ways, axis=1).min()) - HALF


def test_geometry_of_our_own_finds_the_plan_clear_on_its_branch() -> None:
    planned, plan, path = made()
    times = np.linspace(0.0, path.duration, 4001)
    theta, signs = path.at(times)[0], np.array([-1.0, -1.0, -1.0])
    poses = followed(theta, np.array([-0.09, -0.1, -0.15]), signs)
    turned = np.remainder(np.array([inverse(pose, signs) for pose in poses]) - theta + np.pi, 2 * np.pi) - np.pi
    assert np.abs(turned).max() < 1e-9
    near = np.array([from_point(p, q, np.array([-0.21, -0.02])) for p, q in zip(poses, theta, strict=True)]) - 0.03
    assert near.min() >= 0.01 - 1e-6
    assert near.min() == pytest.approx(plan.certificate["clearance_min"], abs=1e-6)
    assert plan.certificate["clearance_at_least"] <= near.min()
    np.testing.assert_allclose(near[::10], plan.clearance, atol=1e-9)
    np.testing.assert_allclose(poses[::10], plan.signals["pose"], atol=1e-9)
    dets = np.array([det_a(pose, q) for pose, q in zip(poses[::10], theta[::10], strict=True)])
    np.testing.assert_allclose(-dets / (LINK**3 * CORNERS), plan.signals["singularity"][:, 3], rtol=1e-9)
    assert dets.max() < 0
    np.testing.assert_allclose(poses[-1], planned.spec.goal.pose, atol=1e-9)


def test_certificate_and_detour_of_the_shipped_run() -> None:
    planned, plan, path = made()
    sure = plan.certificate
    assert plan.status.name == "ok"
    assert sure["knot_jump_max"] <= 1e-9
    assert sure["singularity_at_least"] > planned.spec.off_singular
    assert sure["singularity_at_least"] <= sure["singularity_min"]
    assert sure["closure_error_max"] < 1e-12
    assert sure["goal_error_max"] < 1e-9
    assert sure["joint_speed_excess_max"] == 0
    (detour,) = plan.detours
    step = path.duration / 20
    assert (detour.begin / step, detour.end / step) == pytest.approx((8, 15))
    peaks = np.rad2deg(detour.peak)
    assert peaks[0] < -10
    assert peaks[0] == min(peaks)
    straight = planned.nominal(path.goal)
    met = np.linspace(0.0, path.duration, 801)
    touched = met[planned.world.distances(straight, met).min(axis=1) < 0] / step
    assert touched[0] > 9  # not in contact when it is seen, nor when the motion can change
    assert touched[-1] < 15


def test_two_derivatives_without_jumps() -> None:
    _, _, path = made()
    h = 1e-5 * path.duration
    times = np.linspace(2 * h, path.duration - 2 * h, 4001)
    _, qd, qdd = path.at(times)
    early, late = path.at(times - h), path.at(times + h)
    np.testing.assert_allclose((late[0] - early[0]) / (2 * h), qd, atol=1e-5 * np.abs(qd).max())
    np.testing.assert_allclose((late[1] - early[1]) / (2 * h), qdd, atol=2e-3 * np.abs(qdd).max())


def test_the_obstacle_is_met_on_the_way() -> None:
    """Planned without it, seen at step 7, answered from step 8 on by the detour that the plan has too."""
    run = execute(mission_of(document_of(_text())))
    _, plan, _ = made()
    (event,) = run.events
    assert (event.step, event.answer.kind) == (7, "detour")
    assert run.plan.status.name == "ok"
    assert run.plan.certificate["clearance_min"] >= 0.01 - 1e-6
    (detour,), (known,) = run.plan.detours, plan.detours
    assert (detour.begin, detour.end) == pytest.approx((known.begin, known.end))
    np.testing.assert_allclose(detour.peak, known.peak, atol=np.deg2rad(0.2))
    before = run.plan.time <= 8 * run.step
    straight = made()[0].nominal(run.path.goal)
    np.testing.assert_allclose(run.plan.q[before], straight.at(run.plan.time[before])[0], atol=1e-12)


def test_with_nothing_to_see_it_stops_where_the_answer_is_stop() -> None:
    run = execute(mission_of(document_of({**_text(), "execution": {"answer": "stop"}})))
    assert run.plan.status.name == "flagged"
    assert run.plan.status.reason.startswith("stopped on the path at ")
    assert run.plan.certificate["clearance_min"] > 0
    assert run.plan.certificate["singularity_at_least"] > 0


def _text() -> dict[str, Any]:
    from fzcli.spec.reader import read

    value: dict[str, Any] = read(Path(RUN)).value
    return value


def test_a_moving_obstacle() -> None:
    """A ball that comes up from below and goes down again, in the platform's way only for a while."""
    way = {"times": [0.0, 2.0, 4.0], "positions": [[-0.21, 0.12, 0], [-0.21, -0.02, 0], [-0.21, 0.12, 0]]}
    moved = {**_text(), "scene": [{"sphere": {"radius": 0.03}, "waypoints": way}]}
    moved["planner"] = {"kind": "detour"}
    plan = make_plan(task_of(document_of(moved)))
    assert plan.status.name == "ok"
    assert plan.detours
    poses, balls = plan.signals["pose"], plan.obstacles["sphere 1"][:, :2]
    near = [from_point(p, q, ball) - 0.03 for p, q, ball in zip(poses, plan.q, balls, strict=True)]
    np.testing.assert_allclose(near, plan.clearance, atol=1e-9)


def test_pose_and_branch_do_not_depend_on_how_start_and_goal_are_said() -> None:
    by_pose = task()
    by_angles = task(
        start={"q": by_pose.first.theta.tolist()}, goal={"q": by_pose.goal.theta.tolist()}, branch="+++ det+"
    )
    np.testing.assert_allclose(by_angles.first.pose, by_pose.first.pose, atol=1e-9)
    np.testing.assert_allclose(by_angles.goal.pose, by_pose.goal.pose, atol=1e-9)
    one, other = make_plan(by_pose), make_plan(by_angles)
    np.testing.assert_allclose(one.signals["pose"], other.signals["pose"], atol=1e-8)
    assert one.method == "straight"
    assert one.certificate["clearance_min"] == np.inf


def test_nothing_moves_farther_than_the_bound_says() -> None:
    """Random postures and small moves of the drives: the platform, the rods and the measures keep within the reach."""
    rng, model = np.random.default_rng(11), body().model
    radius, tried = CORNERS, 0
    for mode in MODES:
        poses = rng.uniform([-0.15, -0.15, -0.35], [0.15, 0.15, 0.35], (60, 3))
        poses = poses[model.reachable(poses)]
        theta = model.inverse_many(poses, mode)
        turns = rng.uniform(0.0, 0.01, (len(poses), 1)) * np.ones(3)
        reach = reach_of(model, poses, theta, turns)
        for _ in range(4):
            goal = theta + turns * rng.uniform(-1, 1, theta.shape)
            ends = many(body().assembled, poses, theta, goal)[0]
            held = np.isfinite(reach.way)
            moved = np.linalg.norm((ends - poses) / [radius, radius, 1.0], axis=1)
            assert (moved[held] <= reach.way[held]).all()
            change = np.abs(model.measures(ends, goal) - model.measures(poses, theta))
            assert (change[held] <= reach.of_measures()[held]).all()
            state = np.abs(many(body().state, ends, goal)[0] - many(body().state, poses, theta)[0])
            state[:, :6] = np.abs(np.remainder(state[:, :6] + np.pi, 2 * np.pi) - np.pi)
            assert (state[held] <= reach.of_tree(radius)[held] + 1e-12).all()
            tried += int(held.sum())
    assert tried > 800


def test_the_platform_s_speed_is_that_of_the_jacobians() -> None:
    model = body().model
    pose = np.array([0.05, -0.03, 0.2])
    theta = model.inverse(pose)[MODES.index("++-")]
    A, b = (np.array(part) for part in model.jacobians(pose, theta))
    exact = np.linalg.solve(A, np.diag(b.ravel()))
    np.testing.assert_allclose(np.array(body().by_joints(pose, theta)), exact, rtol=1e-5, atol=1e-6)


def test_the_slope_of_the_nearest_distance_by_the_joints() -> None:
    planned, _, path = made()
    q = path.at(np.linspace(0.5, 3.5, 7))[0]
    numbers, h = planned.world.scene.numbers(np.zeros(7)), 1e-6
    _, slope = planned.world.nearest(q, numbers, 1000.0)
    differences = [
        (planned.world.nearest(q + d, numbers, 1000.0)[0] - planned.world.nearest(q - d, numbers, 1000.0)[0]) / (2 * h)
        for d in h * np.eye(3)
    ]
    np.testing.assert_allclose(slope, np.transpose(differences), atol=1e-6)


def test_a_straight_path_over_a_singularity_is_not_taken() -> None:
    """Both ends have det A > 0, but the straight joint path comes to where it vanishes."""
    ends = _over_a_singularity()
    crossing = task(branch="+-- det+", start={"pose": ends[0]}, goal={"pose": ends[1]}, planner={"fallbacks": []})
    straight = crossing.nominal(crossing.goal.theta)
    assert crossing.world.ride(straight).lost < straight.duration
    assert crossing.world.certified(straight, 0.0, straight.duration, 1e-4, np.inf).clearance == -np.inf
    with pytest.raises(NoPlanError, match="no path keeps 0 mm clear and off singularities for 1 final posture"):
        make_plan(crossing)


def _over_a_singularity() -> tuple[list[float], list[float]]:
    """The first of some random pairs of poses on one branch whose straight joint path loses it."""
    rng, model = np.random.default_rng(2), body().model
    for _ in range(200):
        poses = np.array([[-0.1, 0, 0], [0.1, 0, 0]]) + rng.uniform([0, -0.05, -0.3], [0, 0.08, 0.3], (2, 3))
        measures = model.measures(poses, model.inverse_many(poses, "+--"))
        if measures[:, 3].min() < 0.2 or np.abs(measures).min() < 0.2:
            continue
        found = task(branch="+-- det+", start={"pose": poses[0].tolist()}, goal={"pose": poses[1].tolist()})
        if np.isfinite(found.world.ride(found.nominal(found.goal.theta)).lost):
            return poses[0].tolist(), poses[1].tolist()
    raise AssertionError("no such pair")


PLAN = """kind: plan
robot: rrr_planar
branch: "+++"
start: {pose: [-120 mm, -50 mm, 0.1]}
goal: {pose: [120 mm, 30 mm, -0.2]}
duration: 4 s
margin: 10 mm
scene:
  - sphere: {center: [0, 0.35, 0], radius: 0.02}
planner: {kind: detour, weights: [1, 1, 1]}
"""
FAR = "goal: {pose: [120 mm, 30 mm, -0.2]}"


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("duration", "tool: {xyz: [0, 0, 0.1]}\nduration", "plan.yaml:6:1: tool: a planar_3rrr carries no tool"),
        ("duration", "hold_base: true\nduration", "hold_base: the base of a planar_3rrr stands still"),
        ("duration", "ik: {kind: exact}\nduration", "ik: the inverse kinematics of a planar_3rrr are closed"),
        ("detour,", "rrt_connect,", "plan.yaml:10:17: planner.kind: must be 'detour', got 'rrt_connect'"),
        ("[1, 1, 1]", "[1, 1]", "planner.weights: has 2 values for 3 driven joints (joint1, joint2, joint3)"),
        ("[1, 1, 1]", "[1, 0, 1]", "planner.weights: every weight must be above 0"),
        ("4 s", "0 s", "duration: must be > 0 or 'fastest', got '0 s'"),
        ('"+++"', '"+ +"', "branch: must be a working mode, with the sign of det A where that is needed, got '+ +'"),
        ('"+++"', '"+++ det-"', "branch: there is no '+++ det-' at the start, which can be on '+++ det+', "),
        ('branch: "+++"\n', "", "start.pose: branch is needed: the start can be on '+++ det+', '++- det+', "),
        (FAR, "goal: {pose: [600 mm, 0, 0]}", "goal.pose: out of reach: leg 1 would have to span 0.872794 m; it"),
        (FAR, "goal: {q: [-20 deg, 130 deg, 200 deg]}", "the start is on '+++ det+', and the robot can be on "),
        (FAR, "goal: {q: [210 deg, 330 deg, 90 deg]}", "goal.q: the robot cannot be put together at these joint"),
        (FAR, "goal: {}", "goal: needs one of pose and q"),
        ("0.35, 0]", "0.35, 0.1]", "scene.0: must lie and move in the plane z = 0 of a planar_3rrr, and turn about z"),
        (
            "sphere: {center: [0, 0.35, 0], radius: 0.02}",
            "box: {size: [1, 1, 1]}",
            "scene.0: a planar_3rrr goes round spheres and capsules",
        ),
        ("radius: 0.02", "radius: -0.02", "scene.0.sphere.radius: must be > 0, got -0.02"),
        ("[0, 0.35, 0]", "[-0.12, -0.05, 0]", "start.pose: the start is in contact: sphere 1 stands inside the"),
        ("[0, 0.35, 0]", "[0.12, 0.14, 0]", "goal.pose: the goal is in contact: platform and sphere 1 overlap by"),
        ("margin", "off_singular: 0.9\nmargin", "start.pose: the start is near a singularity: the sine of leg"),
        ("rrr_planar", "rrr_planr", "robot: no robot named 'rrr_planr'; did you mean 'rrr_planar'?"),
    ],
)
def test_plans_that_make_no_sense_are_refused_in_words(tmp_path: Path, old: str, new: str, text: str) -> None:
    assert old in PLAN
    file = tmp_path / "plan.yaml"
    file.write_text(PLAN.replace(old, new, 1))
    with pytest.raises(SpecError) as caught:
        fzcli.plan(file, output=tmp_path / "plan.h5")
    assert text in str(caught.value).replace(f"{tmp_path}/", "")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plan.yaml"]


def test_a_robot_without_width_is_refused(tmp_path: Path) -> None:
    robot = Path("robots/rrr_planar.yaml").read_text().replace(", radius: 10 mm}", "}")
    (tmp_path / "thin.yaml").write_text(robot)
    (tmp_path / "plan.yaml").write_text(PLAN.replace("rrr_planar", "thin.yaml"))
    with pytest.raises(SpecError, match="robot 'thin' has no solids to judge collisions by; give its legs a radius"):
        fzcli.plan(tmp_path / "plan.yaml")


def test_a_sweep_of_plans_says_that_it_takes_no_planar_robot(tmp_path: Path) -> None:
    text = "kind: sweep\nrun: plan\nrobot: rrr_planar\nstart: {q: [0, 0, 0]}\ngoal: {q: [1, 1, 1]}\nduration: 4 s\n"
    (tmp_path / "sweep.yaml").write_text(text + "trajectories: {count: 1}\n")
    with pytest.raises(SpecError, match="planar_3rrr"):
        fzcli.sweep(tmp_path / "sweep.yaml")
