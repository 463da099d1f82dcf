"""The closed loop of Table 2 written in CasADi the plain way: the baseline that our own step is measured against.

World-frame sums over links, one 3x3 inverse each for base and task, the null-space projector as a
matrix, the oscillation memory as a shift register in the state; CasADi's own optimisations only.
It is what one writes from the textbook, and its numbers agree with our step's.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from fzcli.fuzzy.surface import build_surface
from fzcli.model.tree import Tree
from fzcli.spec.rulebase import Rulebase

KP, DAMPING, DT = 3.2, 1e-8, 0.01
AVERAGE, WINDOW, IGNORE = 5, 8, 1e-3


@dataclass(frozen=True)
class PlainLoop:
    """``step``: (state, parameters) -> (state, tip error, |yaw|, oscillating joints); sizes for a driver."""

    step: ca.Function
    state_size: int
    parameter_size: int


def rotation(axis: np.ndarray, angle: Any) -> Any:
    """R (3, 3) about a fixed axis, by Rodrigues' formula."""
    K = ca.skew(ca.DM(axis))
    return ca.SX.eye(3) + ca.sin(angle) * K + (1 - ca.cos(angle)) * ca.mtimes(K, K)


def quaternion_matrix(b: Any) -> Any:
    """R (3, 3) of a unit quaternion w, x, y, z."""
    w, v = b[0], b[1:4]
    return (w**2 - ca.dot(v, v)) * ca.SX.eye(3) + 2 * ca.mtimes(v, v.T) + 2 * w * ca.skew(v)


def kinematics(tree: Tree, q: Any, R_base: Any) -> dict[str, Any]:
    """Generalized Jacobian, base rate map and CoM quantities in world axes, base frame's origin at zero."""
    R, p, axes = [], [], []
    for i, body in enumerate(tree.bodies):
        parent_R = R_base if body.parent < 0 else R[body.parent]
        parent_p = ca.SX.zeros(3) if body.parent < 0 else p[body.parent]
        p.append(parent_p + ca.mtimes(parent_R, ca.DM(body.place.translation)))
        turned = ca.mtimes(parent_R, ca.DM(body.place.rotation))
        axes.append(ca.mtimes(turned, ca.DM(body.axis)))
        R.append(ca.mtimes(turned, rotation(body.axis, q[i])))
    n = len(tree.bodies)
    links = [(R_base, ca.SX.zeros(3), tree.base, -1)]
    links += [(R[i], p[i], body.inertia, i) for i, body in enumerate(tree.bodies)]
    centres = [o + ca.mtimes(Ri, ca.DM(part.first_moment / part.mass)) for Ri, o, part, _ in links]
    com = sum(part.mass * c for (_, _, part, _), c in zip(links, centres, strict=True)) / tree.mass
    inertia, momentum, com_jacobian = ca.SX.zeros(3, 3), ca.SX.zeros(3, n), ca.SX.zeros(3, n)
    for (Ri, _, part, i), centre in zip(links, centres, strict=True):
        c = part.first_moment / part.mass
        about = part.tensor - part.mass * (c @ c * np.eye(3) - np.outer(c, c))
        world = ca.mtimes(ca.mtimes(Ri, ca.DM(about)), Ri.T)
        arm = centre - com
        inertia += world + part.mass * (ca.dot(arm, arm) * ca.SX.eye(3) - ca.mtimes(arm, arm.T))
        for j in tree.ancestors(i):
            velocity = ca.cross(axes[j], centre - p[j])
            momentum[:, j] += ca.mtimes(world, axes[j]) + part.mass * ca.cross(arm, velocity)
            com_jacobian[:, j] += part.mass * velocity / tree.mass
    tip = next(iter(tree.tips.values()))
    point = p[tip.body] + ca.mtimes(R[tip.body], ca.DM(tip.place.translation))
    W = -ca.mtimes(ca.inv(inertia), momentum)
    J = ca.SX.zeros(3, n)
    for j in tree.ancestors(tip.body):
        J[:, j] = ca.cross(axes[j], point - p[j])
    J = J - com_jacobian - ca.mtimes(ca.skew(point - com), W)
    return {"J": J, "W": W, "com": com, "com_jacobian": com_jacobian, "tip": point - com}


def plain_loop(tree: Tree, rulebase: Rulebase | None) -> PlainLoop:
    """The loop with the paper's tuner, or with a fixed gain when ``rulebase`` is None."""
    n, m = len(tree.bodies), len(tree.bodies) + 6
    q, b, gain, k = ca.SX.sym("q", n), ca.SX.sym("b", 4), ca.SX.sym("gain"), ca.SX.sym("k")
    register, side = ca.SX.sym("register", m, AVERAGE - 1), ca.SX.sym("side", m)
    last, second = ca.SX.sym("last", m), ca.SX.sym("second", m)
    start, way, duration = ca.SX.sym("start", 3), ca.SX.sym("way", 3), ca.SX.sym("duration")
    R = quaternion_matrix(b)
    found = kinematics(tree, q, R)
    J, W = found["J"], found["W"]
    s = ca.fmin(1, k * DT / duration)
    wanted = start + way * (10 * s**3 - 15 * s**4 + 6 * s**5)
    speed = way * (30 * s**2 - 60 * s**3 + 30 * s**4) / duration
    error = wanted - found["tip"]
    yaw, pitch = ca.atan2(R[1, 0], R[0, 0]), ca.asin(-R[2, 0])
    row = ca.horzcat(ca.cos(yaw) * ca.tan(pitch), ca.sin(yaw) * ca.tan(pitch), 1)
    Jc = ca.mtimes(row, W)
    pseudo = ca.mtimes(J.T, ca.inv(ca.mtimes(J, J.T) + DAMPING * ca.SX.eye(3)))
    null = ca.SX.eye(n) - ca.mtimes(pseudo, J)
    qd = ca.mtimes(pseudo, KP * error + speed) + ca.mtimes(null, Jc.T * gain * -yaw)
    w = ca.mtimes(W, qd)
    linear = -ca.mtimes(found["com_jacobian"], qd) - ca.cross(w, found["com"])
    pitch_rate = -ca.sin(yaw) * w[0] + ca.cos(yaw) * w[1]
    roll_rate = (ca.cos(yaw) * w[0] + ca.sin(yaw) * w[1]) / ca.cos(pitch)
    velocity = ca.vertcat(qd, linear, roll_rate, pitch_rate, ca.mtimes(row, w))
    deviation = velocity - (ca.sum2(register) + velocity) / AVERAGE
    counts = ca.fabs(deviation) > IGNORE
    crossed = ca.logic_and(counts, deviation * side < 0)
    next_second = ca.if_else(crossed, last, second)
    next_last = ca.if_else(crossed, k, last)
    oscillating = ca.sum1(k - next_second < WINDOW)
    next_gain = gain
    if rulebase is not None:
        increment, _ = build_surface(rulebase)(ca.fabs(yaw) / 0.1, oscillating)
        next_gain = ca.fmax(0, gain + increment)
    angle = ca.norm_2(w) * DT
    axis = w / (ca.norm_2(w) + 1e-300)
    half = ca.vertcat(ca.cos(angle / 2), ca.sin(angle / 2) * axis)  # world axes: turned on the left
    turned = ca.vertcat(
        half[0] * b[0] - ca.dot(half[1:4], b[1:4]),
        half[0] * b[1:4] + b[0] * half[1:4] + ca.cross(half[1:4], b[1:4]),
    )
    state = ca.vertcat(q, b, gain, k, ca.vec(register), side, last, second)
    following = ca.vertcat(
        q + DT * qd,
        turned / ca.norm_2(turned),
        next_gain,
        k + 1,
        ca.vec(ca.horzcat(register[:, 1:], velocity)),
        ca.if_else(counts, deviation, side),
        next_last,
        next_second,
    )
    parameters = ca.vertcat(start, way, duration)
    step = ca.Function(
        "plain_step",
        [state, parameters],
        [following, ca.norm_2(error), ca.fabs(yaw), oscillating],
        ["state", "parameters"],
        ["state_next", "tip_error", "yaw_abs", "oscillating"],
    )
    return PlainLoop(step, state.shape[0], parameters.shape[0])


def first_state(plain: PlainLoop, tree: Tree, q0: np.ndarray, gain: float) -> np.ndarray:
    """The state before the first step, base at the world's attitude."""
    m = len(tree.bodies) + 6
    return np.concatenate([q0, [1, 0, 0, 0, gain, 0], np.zeros(m * AVERAGE), np.full(2 * m, -1e9)])


def line_parameters(tree: Tree, q0: np.ndarray, direction: np.ndarray, length: float, duration: float) -> np.ndarray:
    """Start of the tip relative to the CoM, way and duration."""
    start = np.array(ca.evalf(kinematics(tree, ca.SX(ca.DM(q0)), ca.SX.eye(3))["tip"])).ravel()
    return np.concatenate([start, np.asarray(direction) * length, [duration]])
