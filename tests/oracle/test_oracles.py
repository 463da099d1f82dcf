"""The two oracles agree with each other, and the random trees have the features they promise."""

import numpy as np
import pytest

from fzcli.spec.robot import Robot
from tests.oracle.numpy_reference import NumpyReference, depth_first
from tests.oracle.pinocchio_oracle import PinocchioOracle
from tests.oracle.random_trees import random_robot, random_states

SEEDS = range(42)


def _close(actual: np.ndarray, expected: np.ndarray, what: str) -> None:
    scale = max(1.0, float(np.max(np.abs(expected), initial=0.0)))
    error = float(np.max(np.abs(actual - expected), initial=0.0)) / scale
    assert error <= 1e-12, f"{what}: relative error {error:.2e}"


@pytest.mark.parametrize("seed", SEEDS)
def test_numpy_and_pinocchio_agree(seed: int) -> None:
    robot = random_robot(seed)
    ours, theirs = NumpyReference(robot), PinocchioOracle(robot)
    assert ours.joint_names == theirs.joint_names
    for index, s in random_states(ours.n, seed, 4):
        where = f"seed {seed} state {index}"
        for name in ("com", "system_inertia", "base_rate_map", "base_twist_map"):
            _close(
                getattr(ours, name)(s.q, s.base_quat),
                getattr(theirs, name)(s.q, s.base_quat),
                f"{where} {name}",
            )
        for a, b in zip(
            ours.momentum_map(s.q, s.base_quat), theirs.momentum_map(s.q, s.base_quat), strict=True
        ):
            _close(a, b, f"{where} momentum_map")
        state = (s.q, s.base_quat, s.qd, s.base_twist)
        _close(ours.momentum(*state), theirs.momentum(*state), f"{where} momentum")
        _close(ours.generalized_inertia(s.q), theirs.generalized_inertia(s.q), f"{where} generalized_inertia")
        for tip in robot.tips:
            place = f"{where} tip {tip}"
            ours_fk, theirs_fk = (o.forward_kinematics(s.q, s.base_quat, tip) for o in (ours, theirs))
            _close(ours_fk[0], theirs_fk[0], f"{place} position")
            _close(ours_fk[1], theirs_fk[1], f"{place} rotation")
            jacobians = [o.generalized_jacobian(s.q, s.base_quat, tip) for o in (ours, theirs)]
            _close(jacobians[0], jacobians[1], f"{place} generalized_jacobian")


def _features(robot: Robot) -> set[str]:
    parents = [link.parent for link in robot.links]
    found = {link.joint.type for link in robot.links} | {"floating" if robot.base.floating else "fixed base"}
    for link in robot.links:
        if link.joint.type == "fixed":
            found |= {"fixed first"} if link.parent == "base" else set()
            found |= {"fixed last"} if link.name not in parents else set()
            found |= {"fixed middle"} if link.parent != "base" and link.name in parents else set()
    found |= {"branch"} if any(parents.count(p) > 1 for p in parents if p != "base") else set()
    found |= {"file order is not depth first"} if list(robot.links) != depth_first(robot) else set()
    found |= {"one link"} if len(robot.links) == 1 else set()
    found |= {"nine links"} if len(robot.links) == 9 else set()
    found |= {"tip on a carrier"} if "middle" in robot.tips else set()
    return found


def test_random_trees_have_every_feature() -> None:
    counts: dict[str, int] = {}
    for seed in SEEDS:
        for feature in _features(random_robot(seed)):
            counts[feature] = counts.get(feature, 0) + 1
    for feature, least in {
        "fixed first": 8,
        "fixed middle": 8,
        "fixed last": 8,
        "prismatic": 15,
        "continuous": 10,
        "revolute": 20,
        "branch": 10,
        "fixed base": 4,
        "floating": 30,
        "tip on a carrier": 20,
        "file order is not depth first": 5,
        "one link": 1,
        "nine links": 1,
    }.items():
        assert counts.get(feature, 0) >= least, (feature, counts)


def test_random_inertias_are_physical() -> None:
    for seed in SEEDS:
        robot = random_robot(seed)
        for body in (robot.base, *robot.links):
            xx, yy, zz, xy, xz, yz = body.inertia
            a, b, c = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            assert a > 0.0
            assert a + b > c


def test_a_seed_gives_the_same_robot() -> None:
    assert random_robot(5) == random_robot(5)
    assert random_robot(5) != random_robot(11)
