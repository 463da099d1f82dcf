"""Inverse kinematics beside others: how many of 10,000 reachable poses are met, and what a pose costs.

The protocol is that of TRAC-IK's own comparison: poses of postures drawn uniformly within the joint limits, the
search from the middle of the limits, met to 1e-5 m and rad. Every answer is judged by our forward kinematics.
"""

import statistics
import sys
from collections.abc import Callable

import casadi as ca
import numpy as np
from inverse_peers import CLOSE, Toolbox, TracIk
from numpy.typing import NDArray
from rounds import take_turns

import fzcli
from fzcli.model.inverse import InverseKinematics, build_inverse
from fzcli.model.inverse.arm import arm_pose
from fzcli.model.inverse.pose_error import pose_error

Array = NDArray[np.float64]
Solver = Callable[[Array, Array, Array], Array | None]
ROBOTS = ("ur5", "melfa_rv1a")
POSES, TIMED = 10_000, 250


def inverse() -> None:
    """Measure and print both arms."""
    for robot in ROBOTS:
        model = fzcli.build_model(fzcli.load_robot(robot))
        exact, search = build_inverse(model), build_inverse(model, kind="numeric")
        solvers: dict[str, Solver] = {
            f"ours, exact ({exact.kind}): every branch in limits": lambda p, R, q, own=exact: _first(own, p, R, q),
            "ours, search to 1e-5": lambda p, R, q, own=search: _first(own, p, R, q),
        }
        for kind in (TracIk, Toolbox):
            try:
                peer = kind(model)
            except ImportError as error:
                print(f"left out: {kind.__name__} ({error})")
            else:
                solvers[peer.name] = peer.solve
        _compare(robot, exact, solvers)


def _first(own: InverseKinematics, position: Array, rotation: Array, near: Array) -> Array | None:
    found = own.solve(position, rotation, near=near, tolerance=CLOSE)
    return found[0].q if found else None


def _compare(robot: str, exact: InverseKinematics, solvers: dict[str, Solver]) -> None:
    q = ca.SX.sym("q", 6)
    position, rotation, _ = arm_pose(exact.arm, q)
    goal, turn = ca.SX.sym("goal", 3), ca.SX.sym("turn", 3, 3)
    forward = ca.Function("forward", [q], [position, rotation])
    miss = ca.Function("miss", [q, goal, turn], [pose_error(position, rotation, goal, turn)])
    low, high = exact.arm.limits.T
    drawn = np.random.default_rng(2024).uniform(low, high, (POSES, 6))
    poses = [tuple(np.array(value) for value in forward(one)) for one in drawn]
    goals = [(p.ravel(), R) for p, R in poses]
    start = exact.arm.middle
    met = {}
    for name, solve in solvers.items():
        met[name] = sum(_judged(solve(p, R, start), p, R, miss, low, high) for p, R in goals)
    timed = {
        name: (lambda solve=solve: [solve(p, R, start) for p, R in goals[:TIMED]], TIMED)
        for name, solve in solvers.items()
    }
    form = exact.form
    if form is None:
        sys.exit(f"{robot} has no closed form")
    many, width = form.function.map(TIMED), (1, TIMED)
    given = (np.array([p for p, _ in goals[:TIMED]]).T, np.hstack([R for _, R in goals[:TIMED]]))
    all_eight = f"ours, exact ({exact.kind}): all eight, {TIMED} poses a call"
    found = take_turns({**timed, all_eight: (lambda: many(*given, np.tile(start[:, None], width)), TIMED)})
    print(f"\n{robot + ', microseconds a pose':66} {'median':>9} {'best':>9} {'met':>9}")
    for name, times in found.items():
        share = f"{met[name] / POSES:9.2%}" if name in met else ""
        print(f"{name:66} {statistics.median(times) / 1e3:9.1f} {min(times) / 1e3:9.1f} {share}")


def _judged(q: Array | None, p: Array, R: Array, miss: ca.Function, low: Array, high: Array) -> bool:
    """Within the tolerance a component, as TRAC-IK means it, and the limits; with room for single precision."""
    if q is None or (q < low - 1e-6).any() or (q > high + 1e-6).any():
        return False
    return bool(np.abs(np.array(miss(q, p, R))).max() <= 1.2 * CLOSE)


if __name__ == "__main__":
    inverse()
