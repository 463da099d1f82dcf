"""Inverse kinematics of any arm by damped Newton steps (Levenberg and Marquardt) with restarts.

The damping is the squared error itself (Chan and Lawrence 1988; Sugihara 2011 proves convergence): large while
the pose is far, gone at the end, where the convergence is quadratic. Needs no acceptance test.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.model.algebra import dot, gram
from fzcli.model.inverse.arm import Arm, arm_pose
from fzcli.model.inverse.pose_error import turn_between

Array = NDArray[np.float64]
DAMPING = 0.02  # of the squared error [m and rad taken alike]
LEAST_DAMPING = 1e-14  # keeps a singular posture's step finite
STRIDE = 1.0  # rad or m: longest step of one joint
Aim = Literal["pose", "position"]
PATIENCE = 6  # steps in which the error must halve


@dataclass(frozen=True)
class Found:
    """Where a search ended: q (m) of the arm, distance [m] and angle [rad] to the pose, starts and steps taken."""

    q: Array
    distance: float
    angle: float
    starts: int
    steps: int

    @property
    def error(self) -> float:
        """The larger of distance [m] and angle [rad]."""
        return max(self.distance, self.angle)


@dataclass(frozen=True)
class NumericInverse:
    """The search for postures of an arm. ``aim``: "pose", or "position" where any rotation will do.

    ``step``: q (m), position (3), rotation (3, 3) -> next (m) and error (2) at q: distance [m] and angle [rad].
    """

    arm: Arm
    aim: Aim
    step: ca.Function

    def search(
        self,
        position: Array,
        rotation: Array,
        start: Array,
        *,
        tolerance: float = 1e-10,
        starts: int = 60,
        steps: int = 60,
        seed: int = 0,
    ) -> Found:
        """From ``start`` (m), then from random postures, until the pose is met to ``tolerance`` [m and rad].

        The random postures are uniform within the limits, of a whole turn for hinges that have more. The one that
        came nearest is returned where none meets the pose.
        """
        walk = _Walk(self.step, position, rotation)
        best = walk.down(start, tolerance, steps)
        number, taken = 1, best.steps
        if best.error > tolerance and starts > 1:
            random, room = np.random.default_rng(seed), _room(self.arm)
            while best.error > tolerance and number < starts:
                found = walk.down(random.uniform(*room), tolerance, steps)
                best = found if found.distance + found.angle < best.distance + best.angle else best
                number, taken = number + 1, taken + found.steps
        return replace(best, starts=number, steps=taken)


def build(arm: Arm, aim: Aim = "pose", limited: bool = True) -> NumericInverse:
    """The search of an arm; if ``limited``, joints that cannot turn round whole keep to their limits at every step."""
    q, goal = ca.SX.sym("q", len(arm.joints)), ca.SX.sym("position", 3)
    goal_rotation = ca.SX.sym("rotation", 3, 3)
    position, rotation, jacobian = arm_pose(arm, q)
    away = goal - position
    turn, angle = turn_between(rotation, goal_rotation)
    error = ca.vertcat(away, turn)
    if aim == "position":
        error, angle, jacobian = away, ca.SX(0), jacobian[:3, :]
    damping = DAMPING * dot(error, error) + LEAST_DAMPING
    if jacobian.shape[1] < jacobian.shape[0]:
        square = gram(jacobian.T) + damping * ca.SX.eye(jacobian.shape[1])
        way = solved(square, ca.mtimes(jacobian.T, error))
    else:
        square = gram(jacobian) + damping * ca.SX.eye(jacobian.shape[0])
        way = ca.mtimes(jacobian.T, solved(square, error))
    longest = ca.mmax(ca.fabs(way))
    after = q + way * ca.fmin(1.0, STRIDE / ca.fmax(longest, 1e-300))
    for i, (low, high) in enumerate(arm.limits):
        if limited and not arm.full_turns[i]:
            value = ca.fmax(after[i], float(low)) if math.isfinite(low) else after[i]
            after[i] = ca.fmin(value, float(high)) if math.isfinite(high) else value
    outputs = ca.cse([ca.densify(after), ca.densify(ca.vertcat(ca.sqrt(dot(away, away)), angle))])
    step = ca.Function(
        "inverse_step", [q, goal, goal_rotation], outputs, ["q", "position", "rotation"], ["q_next", "error"]
    )
    return NumericInverse(arm, aim, step)


def solved(A: ca.SX, b: ca.SX) -> ca.SX:
    """A^-1 b (m) for a symmetric positive definite A (m, m), by L D L^T, unrolled."""
    m = A.shape[0]
    L, x = ca.SX.eye(m), [b[i] for i in range(m)]
    pivots: list[ca.SX] = []
    for j in range(m):
        weighted = [L[j, k] * pivots[k] for k in range(j)]
        pivots.append(A[j, j] - sum((L[j, k] * weighted[k] for k in range(j)), ca.SX(0)))
        for i in range(j + 1, m):
            L[i, j] = (A[i, j] - sum((L[i, k] * weighted[k] for k in range(j)), ca.SX(0))) / pivots[j]
            x[i] = x[i] - L[i, j] * x[j]
    x = [value / pivot for value, pivot in zip(x, pivots, strict=True)]
    for i in reversed(range(m)):
        x[i] = x[i] - sum((L[k, i] * x[k] for k in range(i + 1, m)), ca.SX(0))
    return ca.vertcat(*x)


def _room(arm: Arm) -> tuple[Array, Array]:
    """Bounds (m) of the random postures."""
    whole = arm.full_turns
    middle = arm.middle
    low = np.where(whole, middle - math.pi, np.where(np.isfinite(arm.limits[:, 0]), arm.limits[:, 0], -1.0))
    high = np.where(whole, middle + math.pi, np.where(np.isfinite(arm.limits[:, 1]), arm.limits[:, 1], 1.0))
    return low, np.maximum(low, high)


class _Walk:
    """One step after the other through buffers, which spare the conversions of a call."""

    def __init__(self, step: ca.Function, position: Array, rotation: Array) -> None:
        m = step.size1_in(0)
        buffer: Any
        buffer, self._evaluate = step.buffer()
        self._q, self._next, self._error = np.zeros(m), np.zeros(m), np.zeros(2)
        self._given = [np.ascontiguousarray(position, float), np.asarray(rotation, float).ravel(order="F").copy()]
        for i, given in enumerate([self._q, *self._given]):
            buffer.set_arg(i, given.data)
        for i, result in enumerate([self._next, self._error]):
            buffer.set_res(i, result.data)
        self._buffer = buffer  # it must outlive the calls

    def down(self, start: Array, tolerance: float, steps: int) -> Found:
        """Where the walk from ``start`` (m) ends: at the pose, or where the error has stopped to halve."""
        self._q[:] = start
        mark, since = math.inf, 0
        taken = 0
        while True:
            self._evaluate()
            distance, angle = self._error
            if (distance <= tolerance and angle <= tolerance) or taken == steps:
                break
            if distance + angle < 0.5 * mark:
                mark, since = distance + angle, 0
            elif since == PATIENCE:
                break
            else:
                since += 1
            self._q[:] = self._next
            taken += 1
        return Found(self._q.copy(), float(distance), float(angle), 1, taken)
