"""The certified check of a whole path: the golden case, and thin fast things that samples miss."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from fzcli.model import RobotModel, build_model
from fzcli.model.collision import Clearance, SelfPairs, build_clearance
from fzcli.model.gauss_magnus import path_piece
from fzcli.plan.continuous import Motion, contact_windows, path_clearance
from fzcli.plan.scene import Obstacle, Scene, build_scene
from fzcli.spec.load import load_robot
from fzcli.spec.tool import Tool, with_tool

Array = NDArray[np.float64]
START, GOAL = np.radians([-60, 20, 100, 0, 40, 0]), np.radians([60, 40, 80, 0, 60, 0])
SECONDS = 4.0
STEP = SECONDS / 20


@dataclass(frozen=True)
class Path:
    """The golden case's path, written out: 3-4-5 law and one half-cycloidal detour (steps k0 to k1)."""

    start: Array
    goal: Array
    peak: Array
    window: tuple[float, float] = (0.0, 1.0)

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        s = time / SECONDS
        u = np.clip(4 * (time / STEP - self.window[0]) / (self.window[1] - self.window[0]), 0, 4)
        wave = np.sin(np.pi * u) / np.pi
        bump = np.where(u < 2, u - wave, 4 - u + wave) / 2
        q = self.start + np.outer(6 * s**5 - 15 * s**4 + 10 * s**3, self.goal - self.start)
        return q + np.outer(bump, self.peak), np.zeros_like(q), np.zeros_like(q)

    def speed_bound(self, begin: float, end: float) -> Array:
        law = 1.875 * np.abs(self.goal - self.start) / SECONDS
        return np.asarray(law + 4 * np.abs(self.peak) / ((self.window[1] - self.window[0]) * STEP))


def golden() -> tuple[RobotModel, Scene, Clearance]:
    model = build_model(with_tool(load_robot("melfa_rv1a"), Tool(xyz=(0, 0, 0.1))))
    scene = build_scene([Obstacle.model_validate({"sphere": {"center": (0.338, 0, 0.345), "radius": 0.05}})])
    return model, scene, build_clearance(model, scene.kinds, scene.names, own=SelfPairs((), ()))


def path(delta: float = 0.0, window: tuple[float, float] = (0.0, 1.0)) -> Path:
    return Path(START, GOAL, np.radians([0, delta, 0, 0, 0, 0]), window)


def test_tip_of_the_golden_case() -> None:
    model, _, _ = golden()
    forward = model.function("forward_kinematics")
    for step, delta, expected in (
        (8, path(), (0.310918, -0.125033, 0.354828)),
        (10, path(), (0.338432, 0, 0.345062)),
        (10, path(-30, (5, 15)), (0.270559, 0, 0.508240)),
    ):
        position = forward(delta.at(np.array([step * STEP]))[0][0], [1, 0, 0, 0])[0]
        np.testing.assert_allclose(np.array(position).ravel(), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("delta", "window", "clearance", "step"),
    [
        (0.0, (0.0, 1.0), -0.084564, 10),
        (-30.0, (8.0, 12.0), 0.0055618, 11.2737),
        (-30.0, (5.0, 15.0), 0.0818314, None),
    ],
)
def test_clearances_of_the_golden_case(
    delta: float, window: tuple[float, float], clearance: float, step: float | None
) -> None:
    model, scene, distances = golden()
    motion = Motion(model, path(delta, window), scene)
    found = path_clearance(distances, motion, 0, SECONDS, tolerance=1e-6)
    assert found.clearance == pytest.approx(clearance, abs=1e-5 if delta else 1e-6)
    assert 0 <= found.clearance - found.at_least <= 1e-6
    assert str(found.pair) == "J6_link and sphere 1"
    if step is not None:
        assert found.time / STEP == pytest.approx(step, abs=2e-3)
    at_steps = distances.at(motion.path.at(np.arange(21) * STEP)[0], scene.numbers(np.arange(21) * STEP))
    if window == (8.0, 12.0):
        assert at_steps.min() == pytest.approx(0.020534, abs=1e-5)  # what the paper's own check sees


def test_when_the_golden_case_hits() -> None:
    model, scene, distances = golden()
    ((begin, end),) = contact_windows(distances, Motion(model, path(), scene), 0, SECONDS)
    assert (begin / STEP, end / STEP) == pytest.approx((8.705, 11.295), abs=0.01)
    assert contact_windows(distances, Motion(model, path(-30, (8, 12)), scene), 0, SECONDS) == []
    margin = contact_windows(distances, Motion(model, path(-30, (8, 12)), scene), 0, SECONDS, margin=0.01)
    assert 1 <= len(margin) <= 2
    assert all(8 < begin / STEP < end / STEP < 12 for begin, end in margin)


def test_nobody_asks_beyond_enough() -> None:
    model, scene, distances = golden()
    motion = Motion(model, path(-30, (5, 15)), scene)
    found = path_clearance(distances, motion, 0, SECONDS, enough=0.01)
    exact = path_clearance(distances, motion, 0, SECONDS)
    assert 0.01 <= found.at_least <= exact.clearance <= found.clearance
    assert found.samples < exact.samples / 5


def test_a_budget_leaves_an_honest_bound() -> None:
    model, scene, distances = golden()
    motion = Motion(model, path(-30, (8, 12)), scene)
    found = path_clearance(distances, motion, 0, SECONDS, budget=100)
    exact = path_clearance(distances, motion, 0, SECONDS)
    assert found.samples <= 100
    assert found.at_least < exact.at_least
    assert found.clearance >= exact.at_least


def thin(rng: np.random.Generator, model: RobotModel, way: Path) -> Obstacle:
    """A small or thin obstacle that crosses the arm at some time, fast: 10 mm thick, up to 10 m/s."""
    when = rng.uniform(0.1, 0.9) * SECONDS
    tip = np.array(model.forward_kinematics(way.at(np.array([when]))[0][0], [1, 0, 0, 0])[0]).ravel()
    there = tip * rng.uniform(0.6, 1.05) + rng.normal(size=3) * 0.03
    velocity = rng.normal(size=3)
    velocity *= 10 ** rng.uniform(-1, 1) / np.linalg.norm(velocity)
    center = there - velocity * when
    body = rng.normal(size=3) * 0.2
    shapes = (
        {"sphere": {"center": tuple(center), "radius": 0.005}},
        {"capsule": {"from": tuple(center - body), "to": tuple(center + body), "radius": 0.005}},
        {"box": {"center": tuple(center), "size": (0.3, 0.2, 0.005), "rpy": tuple(rng.uniform(-3, 3, 3))}},
    )
    spin = tuple(rng.normal(size=3) * rng.choice([0.0, 5.0]))
    return Obstacle.model_validate({**shapes[rng.integers(3)], "velocity": tuple(velocity), "spin": spin})


def adversary(seed: int) -> tuple[Clearance, Motion]:
    """A random path and one to three thin things that cross it."""
    model, _, _ = golden()
    rng = np.random.default_rng([30, seed])
    start, goal = rng.uniform(*model.tree.position_limits.T, (2, 6))
    way = Path(start, goal, rng.normal(size=6) * rng.choice([0.0, 0.3]), (5.0, 15.0))
    scene = build_scene([thin(rng, model, way) for _ in range(rng.integers(1, 4))])
    return build_clearance(model, scene.kinds, own=SelfPairs((), ())), Motion(model, way, scene)


def test_no_contact_is_missed() -> None:
    """And the adversary is real: most of these contacts fall between whole steps, which alone would miss them."""
    contacts = missed = 0
    for seed in range(40):
        distances, motion = adversary(seed)
        times = np.linspace(0, SECONDS, 8001)
        dense = distances.at(motion.path.at(times)[0], motion.scene.numbers(times)).min(axis=1)
        found = path_clearance(distances, motion, 0, SECONDS, tolerance=1e-4)
        assert found.at_least <= dense.min()
        assert found.clearance <= dense.min() + 1e-4
        assert found.clearance - found.at_least <= 1e-4
        windows = contact_windows(distances, motion, 0, SECONDS)
        inside = np.zeros(len(times), dtype=bool)
        for begin, end in windows:
            inside |= (times >= begin) & (times <= end)
        assert not (dense[~inside] < 0).any()
        assert bool(windows) == (found.at_least < 0)
        assert sum(end - begin for begin, end in windows) <= np.count_nonzero(dense < 2e-3) * 5e-4 + 4e-3
        contacts += bool(windows)
        missed += bool(windows) and dense[::400].min() > 0
    assert contacts >= 20
    assert missed >= 8


def free_motion(model: RobotModel, way: Path, scene: Scene) -> Motion:
    """The base carried along the path at zero momentum, in 400 pieces, interpolated by a last partial one."""
    piece = path_piece(model)
    edges = np.linspace(0, SECONDS, 401)
    q = way.at(edges)[0]
    quats = [np.array([1.0, 0, 0, 0])]
    for here, there in pairwise(q):
        quats.append(np.array(piece(quats[-1], here, there - here)[0]).ravel())
    com = np.array(model.com(q[0], quats[0])).ravel()

    def base(times: Array) -> tuple[Array, Array]:
        assert (np.diff(times) > 0).all()  # as promised to those who carry the base along in pieces
        index = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, 399)
        now = way.at(times)[0]
        steps = piece.map(len(times))(np.array(quats)[index].T, q[index].T, (now - q[index]).T)
        attitude = np.array(steps[0])
        offset = np.array(model.function("com").map(len(times))(now.T, attitude))
        return com - offset.T, attitude.T

    return Motion(model, way, scene, base)


@pytest.mark.parametrize("seed", range(6))
def test_the_base_moves_along(seed: int) -> None:
    model = build_model(with_tool(load_robot("melfa_free_flyer"), Tool(xyz=(0, 0, 0.1))))
    rng = np.random.default_rng([31, seed])
    way = path()
    there = rng.uniform((0.1, -0.4, -0.2), (0.5, 0.4, 0.6))
    scene = build_scene(
        [
            Obstacle.model_validate({"sphere": {"center": tuple(there), "radius": 0.03}}),
            Obstacle.model_validate({"box": {"center": (0.9, 0, -0.4), "size": (0.5, 0.8, 0.02)}}),
        ]
    )
    distances = build_clearance(model, scene.kinds)
    motion = free_motion(model, way, scene)
    times = np.linspace(0, SECONDS, 4001)
    assert motion.base is not None
    position, quat = motion.base(times)
    dense = distances.at(way.at(times)[0], scene.numbers(times), position, quat).min()
    found = path_clearance(distances, motion, 0, SECONDS, tolerance=1e-4)
    assert found.at_least <= dense <= found.clearance + 1e-4
    assert found.clearance - found.at_least <= 1e-4
    with pytest.raises(ValueError, match="a floating base moves along the path: its poses are needed"):
        path_clearance(distances, Motion(model, way, scene), 0, SECONDS)


def test_nothing_to_meet() -> None:
    model, _, _ = golden()
    none = build_clearance(model, (), own=SelfPairs((), ()))
    motion = Motion(model, path(), build_scene([]))
    found = path_clearance(none, motion, 0, SECONDS)
    assert (found.clearance, found.at_least, found.pair) == (np.inf, np.inf, None)
    assert contact_windows(none, motion, 0, SECONDS) == []


def test_a_robot_that_meets_itself() -> None:
    model = build_model(load_robot("dual_arm"))
    distances = build_clearance(model, ())
    towards = np.concatenate([np.radians([-90, 90, 60, 0, 0, 0]), np.radians([90, 90, 60, 0, 0, 0])])
    away = np.concatenate([np.radians([90, 0, 90, 0, 0, 0]), np.radians([-90, 0, 90, 0, 0, 0])])
    motion = Motion(model, Path(away, towards, np.zeros(12)), build_scene([]), free_pose)
    windows = contact_windows(distances, motion, 0, SECONDS)
    found = path_clearance(distances, motion, 0, SECONDS, tolerance=1e-4)
    assert found.clearance < 0
    assert windows
    assert found.pair is not None
    assert (found.pair.link.split("_")[0], found.pair.other.split("_")[0]) == ("left", "right")


def free_pose(times: Array) -> tuple[Array, Array]:
    """Own pairs do not ask where the base is."""
    return np.zeros((len(times), 3)), np.tile([1.0, 0, 0, 0], (len(times), 1))
