"""One period's command of the reaching laws: the oracle's numbers, speeds, limits, and the free last joint."""

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fzcli
from fzcli.control.law import Law
from fzcli.control.registry import controllers
from fzcli.model import RobotModel
from fzcli.plan.target import quaternion_to
from tests.loop.reaching_cases import skew_arm, unit
from tests.oracle.fabrik_points import Array, Chain, chain_of
from tests.oracle.fabrik_reference import Settings, State, Task, command, placed
from tests.oracle.numpy_reference import quat_exp, quat_multiply, rotation_from_quat
from tests.oracle.random_trees import random_state

PERIOD = 0.01
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
LAWS: dict[str, tuple[dict[str, Any], Settings]] = {
    "literal": ({"kind": "fabrik", "variant": "literal"}, Settings(variant="literal")),
    "unclamped": ({"kind": "fabrik", "variant": "literal", "clamp": False}, Settings("literal", clamped=False)),
    "n1": ({"kind": "fabrik", "variant": "n1"}, Settings(variant="N1")),
    "n10": ({"kind": "fabrik", "variant": "n10"}, Settings(variant="N10")),
    "n10 short": (
        {"kind": "fabrik", "sweeps": 3, "sweep_cap": 0.7, "virtual_tip": 0.05},
        Settings(variant="N10", sweeps=3, sweep_cap=0.7, virtual_tip=0.05),
    ),
    "follow": (
        {"kind": "fabrik", "variant": "n1", "follow": [[5], [3], [4], [5], [6]]},
        Settings(variant="N1", followed=((4,), (2,), (3,), (4,), (5,))),
    ),
    "dls": ({"kind": "dls"}, Settings(variant="dls")),
}
direction_quat = ca.Function("direction_quat", [d := ca.SX.sym("d", 3)], [quaternion_to(d)])


def law_of(model: RobotModel, fields: dict[str, Any]) -> tuple[Law, ca.Function]:
    """The law, and its outputs as a function of the inputs, memory and parameters, its inner loop in place."""
    entry = controllers()[fields["kind"]]
    law = entry.build(model, entry.spec.model_validate(fields))
    names = [name for name in law.function.name_in() if name != "turned"]
    given = [ca.MX.sym(name, law.function.size1_in(name)) for name in names]
    turned = ca.MX(0, 1)
    if law.inner is not None:
        turned, fixed = law.inner.before(*given[: law.inner.before.n_in()])
        for _ in range(law.inner.count):
            turned = law.inner.turn(turned, fixed)
    return law, ca.Function("outputs", given, law.function(*given, turned), names, law.function.name_out())


class OnePeriod:
    """dq (n) of a law at a state, the target standing still unless it is said how it moves."""

    def __init__(self, robot: Any, fields: dict[str, Any]) -> None:
        self.model = fzcli.build_model(robot)
        entry = controllers()[fields["kind"]]
        spec = entry.spec.model_validate(fields)
        self.law, self.function = law_of(self.model, fields)
        values = [np.ravel(spec.value_at(p.path.removeprefix("controller."))) for p in self.law.parameters]
        self.parameters = np.concatenate(values) if values else np.zeros(0)
        self.memory = np.array(self.law.memory0(self.parameters)).ravel()

    def __call__(self, state: State, target: Array, tip_quat: Array, **given: Array | float) -> Array:
        inputs = {
            "q": state.q,
            "base_quat": state.quat,
            "tip_position": target - state.anchor,
            "tip_quat": tip_quat,
            "period": PERIOD,
            "memory": self.memory,
            "parameters": self.parameters,
        } | given
        names = self.function.name_in()
        row = [inputs.get(name, np.zeros(self.function.size1_in(name))) for name in names]
        found = dict(zip(self.function.name_out(), self.function(*row), strict=True))
        return np.array(found["command"]).ravel() * float(inputs["period"])


@cache
def _ur5(floating: bool) -> tuple[Any, Chain]:
    robot = fzcli.load_robot("ur5_free_flyer")
    robot = robot.model_copy(update={"base": robot.base.model_copy(update={"floating": floating})})
    return robot, chain_of(robot)


def _states(chain: Chain, seed: int, count: int) -> list[State]:
    """Random joints and attitudes; in every other one a joint or two stand at or near a limit, or beyond."""
    rng, n = np.random.default_rng(seed), chain.body.n
    states = []
    for i in range(count):
        q = rng.uniform(-2 * np.pi, 2 * np.pi, n)
        for j in rng.integers(n, size=i % 3):
            q[j] = rng.choice([-1.0, 1.0]) * (2 * np.pi - rng.choice([0.0, 1e-12, 0.003, 0.02, -0.1]))
        quat = random_state(n, rng).base_quat
        anchor = rng.uniform(-1, 1, 3) if chain.body.floating else np.zeros(3)
        states.append(State(q, quat, anchor))
    return states


def _task(chain: Chain, state: State, rng: np.random.Generator) -> tuple[Task, Array]:
    """A target now near, now far, a direction, and a tip attitude whose z it is."""
    points, _ = placed(chain, state)
    target = points[-1] + rng.normal(size=3) * rng.choice([1e-4, 0.05, 1.0])
    direction = unit(unit(points[-1] - points[-2]) + rng.normal(size=3) * rng.choice([1e-6, 0.1, 3.0]))
    roll = quat_exp(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
    return Task(target, direction), quat_multiply(np.array(direction_quat(direction)).ravel(), roll)


@pytest.mark.parametrize("floating", [True, False], ids=["free", "fixed"])
@pytest.mark.parametrize(
    ("name", "task"),
    [(name, task) for name in LAWS for task in ("approach", "position") if (name, task) != ("follow", "position")],
)
def test_the_command_is_the_oracle_s(name: str, task: str, floating: bool) -> None:
    fields, settings = LAWS[name]
    robot, chain = _ur5(floating)
    law, rng, worst = OnePeriod(robot, {**fields, "task": task}), np.random.default_rng(7), 0.0
    for state in _states(chain, 11, 100):
        wanted, quat = _task(chain, state, rng)
        wanted = wanted if task == "approach" else Task(wanted.target)
        dq = law(state, wanted.target, quat)
        worst = max(worst, float(np.abs(dq - command(chain, state, wanted, settings)).max()))
    assert worst <= 1e-9  # 8e-14 found


@pytest.mark.parametrize("floating", [True, False], ids=["free", "fixed"])
@pytest.mark.parametrize("name", ["literal", "n1", "n10", "dls"])
def test_the_command_of_random_skew_arms(name: str, floating: bool) -> None:
    """3 to 7 hinges on skew axes, 6 arms, 17 states each."""
    fields, settings = LAWS[name]
    rng, worst = np.random.default_rng(3), 0.0
    for i in range(6):
        robot = skew_arm(rng, 3 + i % 5, floating)
        chain, law = chain_of(robot), OnePeriod(robot, {**fields, "task": "position"})
        for state in _states(chain, 100 + i, 17):
            target = placed(chain, state)[0][-1] + rng.normal(size=3) * 0.5
            dq = law(state, target, UPRIGHT)
            worst = max(worst, float(np.abs(dq - command(chain, state, Task(target), settings)).max()))
    assert worst <= 1e-9  # 2e-13 found


@pytest.mark.parametrize("name", ["literal", "n1", "n10", "dls"])
def test_speeds_and_limits_hold_at_any_state(name: str) -> None:
    """A joint beyond its limit is not led further out, at most back in."""
    robot, chain = _ur5(True)
    law, rng = OnePeriod(robot, {**LAWS[name][0]}), np.random.default_rng(5)
    for state in _states(chain, 23, 200):
        wanted, quat = _task(chain, state, rng)
        dq = law(state, wanted.target, quat)
        assert np.abs(dq).max() <= np.pi * PERIOD * (1 + 1e-12)
        over = np.maximum(np.abs(state.q + dq) - 2 * np.pi, 0)
        assert (over <= np.maximum(np.abs(state.q) - 2 * np.pi, 0) + 2e-15).all()


@pytest.mark.parametrize("name", ["literal", "n1", "n10", "dls"])
def test_the_world_s_axes_do_not_matter(name: str) -> None:
    robot, chain = _ur5(True)
    law, rng = OnePeriod(robot, LAWS[name][0]), np.random.default_rng(6)
    for state in _states(chain, 31, 20):
        wanted, quat = _task(chain, state, rng)
        turn, anchor = random_state(6, rng).base_quat, rng.normal(size=3)
        target = anchor + rotation_from_quat(turn) @ (wanted.target - state.anchor)
        moved = State(state.q, quat_multiply(turn, state.quat), anchor)
        np.testing.assert_allclose(
            law(moved, target, quat_multiply(turn, quat)), law(state, wanted.target, quat), atol=1e-10
        )


@pytest.mark.parametrize("name", ["n1", "n10", "dls"])
def test_a_moving_target_is_met_where_it_will_be(name: str) -> None:
    """The same command as for a target that stands where the moving one is after the period."""
    robot, chain = _ur5(True)
    law, rng = OnePeriod(robot, LAWS[name][0]), np.random.default_rng(8)
    for state in _states(chain, 37, 20):
        wanted, quat = _task(chain, state, rng)
        velocity, rate = rng.normal(size=3), rng.normal(size=3)
        later = quat_multiply(quat_exp(rate * PERIOD), quat)
        moving = law(state, wanted.target, quat, tip_velocity=velocity, tip_rate=rate)
        np.testing.assert_allclose(moving, law(state, wanted.target + velocity * PERIOD, later), atol=1e-10)


@pytest.mark.parametrize("name", ["literal", "n1", "n10"])
def test_at_the_target_nothing_moves(name: str) -> None:
    robot, chain = _ur5(True)
    law, rng = OnePeriod(robot, {**LAWS[name][0], "task": "pose"}), np.random.default_rng(9)
    for _ in range(30):
        state = State(rng.uniform(-3, 3, 6), random_state(6, rng).base_quat, rng.normal(size=3))
        position, rotation = chain.body.forward_kinematics(state.q, state.quat)
        quat = np.array(_quat_of(rotation)).ravel()
        assert np.abs(law(state, state.anchor + position, quat)).max() < 1e-7


def _quat_of(rotation: Array) -> Array:
    """A quaternion of a rotation matrix, by the rotation's axis; SciPy's is x y z w."""
    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return np.array([w, x, y, z])


# The free last joint


@pytest.mark.parametrize("flipped", [False, True])
def test_the_free_last_joint_rolls_the_tip_the_way_its_limits_allow(flipped: bool) -> None:
    """All joints where they shall be but the last: it turns by the roll that is missing, else the other way round."""
    robot, _ = _ur5(True)
    if flipped:  # the last axis against the tip's z
        last = robot.links[-1]
        turned = last.model_copy(update={"joint": last.joint.model_copy(update={"axis": (0.0, 0.0, -1.0)})})
        robot = robot.model_copy(update={"links": (*robot.links[:-1], turned)})
    chain = chain_of(robot)
    law, rng = OnePeriod(robot, {"kind": "fabrik", "task": "pose", "clamp": False}), np.random.default_rng(10)
    for _ in range(100):
        q = rng.uniform(-3, 3, 6)
        q[5] = rng.uniform(-2 * np.pi, 2 * np.pi)
        goal = q.copy()
        goal[5] += rng.uniform(-np.pi, np.pi)
        state = State(q, random_state(6, rng).base_quat, rng.normal(size=3))
        position, _ = chain.body.forward_kinematics(q, state.quat)
        _, rotation = chain.body.forward_kinematics(goal, state.quat)
        dq = law(state, state.anchor + position, _quat_of(rotation))
        away = (q[5] + dq[5] - goal[5]) / (2 * np.pi)
        assert abs(away - round(away)) < 1e-9
        assert abs(q[5] + dq[5]) <= 2 * np.pi + 1e-12
        inside = abs(goal[5]) <= 2 * np.pi
        assert not inside or abs(dq[5] - (goal[5] - q[5])) < 1e-8, "the short way where the limits allow it"


def test_a_direction_alone_leaves_the_last_joint_still() -> None:
    robot, chain = _ur5(True)
    law, rng = OnePeriod(robot, {"kind": "fabrik"}), np.random.default_rng(12)
    for state in _states(chain, 41, 20):
        wanted, quat = _task(chain, state, rng)
        assert law(state, wanted.target, quat)[5] == 0.0
