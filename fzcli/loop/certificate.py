"""The certificate: how well a run kept the laws it must keep, measured inside the compiled step."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fzcli.loop.parts import Parts
from fzcli.model.algebra import dot, rotate
from fzcli.model.attitude import rotation_matrix
from fzcli.spec.quantity import Metric


@dataclass(frozen=True)
class Certifier:
    """Worst residuals of a run: memory inside the step, results at its end.

    Linear momentum: total of the motion at a sample, less the conserved one. Angular momentum: mean
    of its error at both ends of a step, taken with the rates held over the step, so that it shows
    the integrator's order. Smallest singular value: that of the task's Jacobian at the posture where
    trace((J J^T)^-1) is largest.
    """

    memory: ca.SX
    memory0: ca.SX
    memory_next: ca.SX
    previous_next: ca.SX
    results: ca.SX
    metrics: tuple[Metric, ...]

    @staticmethod
    def of(
        parts: Parts,
        state: ca.SX,
        derivative: ca.SX,
        moving: ca.SX,
        previous: ca.SX,
        L: ca.SX,
        signals: dict[str, ca.SX],
    ) -> "Certifier":
        """``derivative`` holds at the sample, ``moving`` over the step, ``previous`` over the one before."""
        begin = ca.SX.sym("begin", 3) if parts.method != "euler" and parts.model.floating else None
        rows = _momentum_rows(parts, state, derivative, previous, L, begin)
        quat = parts.plant.observe(state)[1]
        rows["quaternion_norm_error_max"] = _Row(
            0.5 * ca.fabs(dot(quat, quat) - 1), "1", "largest error of the base quaternion's norm"
        )
        rows["step_travel_max"] = _Row(
            parts.plant.travel(moving, parts.dt), "rad or m", "longest step of joints and base together", True
        )
        rows.update(_limit_rows(parts, state, derivative))
        memory = [ca.SX.sym(name) for name in rows]
        following = [ca.fmax(old, row.value) for old, row in zip(memory, rows.values(), strict=True)]
        results = [ca.sqrt(old) if row.squared else old for old, row in zip(memory, rows.values(), strict=True)]
        metrics = [Metric(name, "", "max", row.unit, row.long_name) for name, row in rows.items()]
        first = [ca.SX(0) for _ in rows]
        if begin is not None:  # the rates held over a step miss the momentum at its begin, too
            memory.append(begin)
            following.append(_angular_error(parts, state, moving, L))
            first.append(ca.SX.zeros(3))
        posture = _singular_value(parts, state, signals)
        if posture is not None:
            memory.append(posture.memory)
            following.append(posture.following)
            first.append(posture.first)
            results.append(posture.result)
            metrics.append(Metric("singular_value_min", "", "min", "1", "smallest singular value of the task"))
        return Certifier(
            ca.vertcat(*memory),
            ca.vertcat(*first),
            ca.vertcat(*following),
            moving,
            ca.vertcat(*results),
            tuple(metrics),
        )


@dataclass(frozen=True)
class _Row:
    value: ca.SX
    unit: str
    long_name: str
    squared: bool = False


def _angular_error(parts: Parts, state: ca.SX, derivative: ca.SX, momentum: ca.SX) -> ca.SX:
    """World axes, so that the errors of two samples can be added, (3)."""
    R = rotation_matrix(parts.plant.observe(state)[1])
    return rotate(R, parts.plant.residual(state, derivative, momentum)[1])


def _momentum_rows(
    parts: Parts, state: ca.SX, derivative: ca.SX, previous: ca.SX, momentum: ca.SX, begin: ca.SX | None
) -> dict[str, _Row]:
    if not parts.model.floating:
        return {}
    linear = parts.plant.residual(state, derivative, momentum)[0]
    angular = 0.5 * parts.plant.residual(state, previous, momentum)[1]
    if begin is not None:
        angular = 0.5 * (begin + _angular_error(parts, state, previous, momentum))
    return {
        "linear_momentum_max": _Row(dot(linear, linear), "N s", "largest linear momentum error", True),
        "angular_momentum_max": _Row(dot(angular, angular), "N m s", "largest angular momentum error", True),
    }


def _limit_rows(parts: Parts, state: ca.SX, derivative: ca.SX) -> dict[str, _Row]:
    """Excess over joint limits, where the robot states any; 0 when kept."""
    q = parts.plant.observe(state)[0]
    qd = parts.plant.motion(state, derivative)[0]
    tree = parts.model.tree
    rows: dict[str, _Row] = {}
    speeding = [ca.fabs(qd[i]) - limit for i, limit in enumerate(tree.speed_limits) if np.isfinite(limit)]
    if speeding:
        rows["joint_speed_excess_max"] = _Row(_largest(speeding), "rad/s or m/s", "largest excess of joint speed")
    beyond = [low - q[i] for i, low in enumerate(tree.position_limits[:, 0]) if np.isfinite(low)]
    beyond += [q[i] - high for i, high in enumerate(tree.position_limits[:, 1]) if np.isfinite(high)]
    if beyond:
        rows["joint_limit_excess_max"] = _Row(_largest(beyond), "rad or m", "largest excess of joint position")
    return rows


def _largest(values: list[ca.SX]) -> ca.SX:
    largest = values[0]
    for value in values[1:]:
        largest = ca.fmax(largest, value)
    return largest


@dataclass(frozen=True)
class _Posture:
    memory: ca.SX
    first: ca.SX
    following: ca.SX
    result: ca.SX


def _singular_value(parts: Parts, state: ca.SX, signals: dict[str, ca.SX]) -> _Posture | None:
    """Keep the joint values at which the task is conditioned worst; one singular value at the end."""
    if parts.law.singular_value is None:
        return None
    q = parts.plant.observe(state)[0]
    trace = signals[parts.law.conditioning]
    worst, posture = ca.SX.sym("worst_trace"), ca.SX.sym("worst_q", parts.model.n)
    worse = trace > worst
    kept = ca.vertcat(ca.if_else(worse, trace, worst), ca.if_else(worse, q, posture))
    first = ca.SX.zeros(1 + parts.model.n)
    return _Posture(ca.vertcat(worst, posture), first, kept, parts.law.singular_value(posture))
