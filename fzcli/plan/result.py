"""A found path as a Plan: sampled, measured, certified."""

from collections.abc import Mapping
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.model.algebra import cross, rotate
from fzcli.model.attitude import rotation_matrix
from fzcli.model.collision import many
from fzcli.plan import neural_goal, quaternions
from fzcli.plan.detour_planner import Attempt
from fzcli.plan.joint_path import JointPath
from fzcli.plan.peaks import limit_excess, peak_times
from fzcli.plan.plan import Plan
from fzcli.plan.task import Task, poses_of
from fzcli.plan.world import Path
from fzcli.spec.quantity import Signal
from fzcli.spec.result import Provenance, Status

Array = NDArray[np.float64]
SAMPLE = 0.01  # s
FEWEST, MOST = 401, 100_001  # samples
EXCESS = 1e-9  # rad or m, and per second: what a limit may be exceeded by
GOAL_MISSED = 1e-3  # m and rad
CERTIFICATE = {
    "clearance_min": ("m", "smallest distance met on the whole path"),
    "clearance_at_least": ("m", "no smaller distance exists at any time of the path"),
    "clearance_time": ("s", "when the smallest distance is met"),
    "joint_limit_excess_max": ("rad or m", "largest excess of joint position"),
    "joint_speed_excess_max": ("rad/s or m/s", "largest excess of joint speed"),
    "joint_acceleration_excess_max": ("rad/s2 or m/s2", "largest excess of joint acceleration, where it has a limit"),
    "goal_error_max": ("m or rad", "by which joints or tips miss the goal at the end"),
    "knot_jump_max": ("1", "largest jump of position, velocity and acceleration at the path's knots, relative"),
}
METRICS = {
    "duration": ("s", "of the path"),
    "path_length": ("rad or m", "of the joint path"),
    "tip_path_length": ("m", "of the tip's path in the world"),
    "speed_ratio_max": ("1", "largest joint speed over its limit"),
    "acceleration_max": ("rad/s2 or m/s2", "largest joint acceleration"),
    "cost": ("rad2 or m2", "weighted squares of the detours' peaks"),
    "base_turn": ("rad", "by which the base has turned at the end"),
}


def as_plan(task: Task, attempt: Attempt, provenance: Provenance) -> Plan:
    """Sample (`sample_times`), measure and certify."""
    path, world, model = attempt.path, task.world, task.model
    attempt = replace(attempt, clearance=task.judged(path))  # who found it asked for no more than the margin
    time = sample_times(path)
    q, qd, qdd = path.at(time)
    position, quat = world.base(path, time)
    distances = world.clearance.at(q, world.scene.numbers(time), position, quat)
    clearance = distances.min(axis=1, initial=np.inf)
    tip, rotations = _tip(task, q, position, quat)
    arms = {name: _arm(task, name, q, position, quat) for name in model.tips}
    peaks = path.at(peak_times(path))
    certificate = _certificate(task, attempt, peaks, (q[-1], position[-1], quat[-1]))
    metrics = {
        "duration": path.duration,
        "path_length": float(np.linalg.norm(np.diff(q, axis=0), axis=1).sum()),
        "tip_path_length": float(np.linalg.norm(np.diff(tip, axis=0), axis=1).sum()),
        "speed_ratio_max": float((np.abs(peaks[1]) / task.speeds).max(initial=0.0)),
        "acceleration_max": float(np.abs(peaks[2]).max()),
        "cost": attempt.cost,
        "base_turn": 2 * float(np.arccos(min(1.0, abs(float(quat[-1] @ quat[0]))))),
    }
    if task.neural is not None:
        metrics |= task.neural.told(path.goal)
    about = {**METRICS, **neural_goal.METRICS, **CERTIFICATE}
    return Plan(
        time=time,
        q=q,
        qd=qd,
        qdd=qdd,
        base_position=position,
        base_quat=quat,
        base_twist=_base_twist(task, q, qd, quat),
        tip_position=tip,
        tip_quat=_quaternions(rotations),
        straight_tip=_straight_tip(task, path, time, tip),
        clearance=clearance,
        arms=arms,
        arm_names={name: ("base", *(model.joint_names[j] for j in model.carriers(name)), "tip") for name in arms},
        obstacles=_obstacles(task, time),
        joint_names=model.joint_names,
        joint_units=tuple("m" if body.prismatic else "rad" for body in model.tree.bodies),
        detours=path.detours if isinstance(path, JointPath) else (),
        method=attempt.method,
        metrics=metrics,
        metric_info={name: Signal(name, *about[name]) for name in (*metrics, *certificate)},
        certificate=certificate,
        status=_status(task, attempt, certificate),
        provenance=provenance,
    )


def sample_times(path: Path) -> Array:
    """Times (T,) [s] at which a plan is written: every 10 ms or less, but no more than ``MOST``."""
    return np.linspace(0.0, path.duration, min(max(FEWEST, int(np.ceil(path.duration / SAMPLE)) + 1), MOST))


def _tip(task: Task, q: Array, position: Array, quat: Array, tip: str | None = None) -> tuple[Array, Array]:
    """Position (T, 3) [m] and rotation (T, 3, 3) of a tip in the world, the first by default."""
    model = task.model
    turned, rotations = many(model.function("forward_kinematics", tip), q, quat)
    center = position + many(model.function("com"), q, quat)[0] if model.floating else position
    return center + turned, rotations.reshape(len(q), 3, 3).transpose(0, 2, 1)


def _straight_tip(task: Task, path: Path, time: Array, tip: Array) -> Array:
    """Where the tip (T, 3) [m] would be on the straight joint path to the same end."""
    if isinstance(path, JointPath) and not path.detours:
        return tip
    straight = JointPath(path.start, path.goal - path.start, path.duration, task.spec.law)
    position, quat = task.world.base(straight, time)
    return _tip(task, straight.at(time)[0], position, quat)[0]


def _certificate(
    task: Task, attempt: Attempt, peaks: tuple[Array, Array, Array], end: tuple[Array, Array, Array]
) -> dict[str, float]:
    """``peaks``: q, qd, qdd where they are largest; ``end``: joints, position and attitude of the base at the end."""
    found = attempt.clearance
    return {
        "clearance_min": found.clearance,
        "clearance_at_least": found.at_least,
        "clearance_time": found.time,
        **limit_excess(peaks, task.model.tree.position_limits, task.speeds, task.accelerations),
        "goal_error_max": _goal_error(task, *end),
        "knot_jump_max": knot_jump(attempt),
    }


def _goal_error(task: Task, q: Array, position: Array, quat: Array) -> float:
    """Of the joints, or of the worst tip's pose in the world as the true plant leads it there."""
    if task.spec.goal.q is not None:
        return float(np.abs(q - np.array(task.spec.goal.q)).max())
    return max(_tip_error(task, name, (q, position, quat)) for name in poses_of(task))


def _tip_error(task: Task, name: str, end: tuple[Array, Array, Array]) -> float:
    """Distance of a tip from its position, or the angle to its orientation where that is larger and asked for."""
    place, wanted = poses_of(task)[name]
    q, position, quat = (part[None] for part in end)
    tips, rotations = _tip(task, q, position, quat, name)
    error = float(np.linalg.norm(tips[0] - place))
    pose = task.spec.goal.tips.get(name)
    if task.spec.goal.rpy is None and (pose is None or pose.rpy is None):
        return error
    angle = float(np.arccos(np.clip((np.trace(rotations[0] @ wanted.T) - 1) / 2, -1, 1)))
    return max(error, angle if angle > 1e-7 else 0.0)


def knot_jump(attempt: Attempt) -> float:
    """Of position, velocity and acceleration on both sides of every knot, over their largest values."""
    path = attempt.path
    gap = 1e-12 * max(1.0, path.duration)
    at = np.array(sorted(path.knots))
    sizes = [float(np.abs(values).max()) for values in path.at(np.linspace(0.0, path.duration, 400))]
    jumps = [
        float(np.abs(b - a).max()) / max(size, 1e-12)
        for a, b, size in zip(path.at(at - gap), path.at(at + gap), sizes, strict=True)
    ]
    return max(jumps)


def _status(task: Task, attempt: Attempt, certificate: dict[str, float]) -> Status:
    """ok, or flagged with what is not kept: a plan of the paper's procedure may touch what it did not look at."""
    margin = task.spec.margin
    if certificate["clearance_min"] < 0:
        pair, when = attempt.clearance.pair, certificate["clearance_time"]
        text = f"contact: {pair} overlap by {-1e3 * certificate['clearance_min']:.3g} mm at {when:.4g} s"
        return Status("failed", text, "use planner: {kind: detour}, which watches the whole arm at all times")
    if certificate["clearance_min"] < margin - 1e-6:
        text = f"{attempt.clearance.pair} come within {1e3 * certificate['clearance_min']:.3g} mm"
        return Status("flagged", text, "lower margin, or use another planner")
    return kept(certificate)


def kept(certificate: Mapping[str, float]) -> Status:
    """ok, or flagged with what of limits, speeds, accelerations and goal is not kept."""
    for name in ("joint_limit_excess_max", "joint_speed_excess_max", "joint_acceleration_excess_max"):
        if certificate[name] > EXCESS:
            return Status("flagged", f"{name} {certificate[name]:.3g}", "give it more time, or stretch: true")
    if certificate["goal_error_max"] > GOAL_MISSED:
        return Status("flagged", f"goal_error_max {certificate['goal_error_max']:.3g}", "see the certificate")
    return Status("ok")


def _base_twist(task: Task, q: Array, qd: Array, quat: Array) -> Array:
    """Of the base frame's origin (T, 6), linear first, world axes: momentum is zero throughout."""
    if not task.model.floating:
        return np.zeros((len(q), 6))
    symbols = [ca.SX.sym(name, size) for name, size in (("q", task.model.n), ("qd", task.model.n), ("quat", 4))]
    com, _, com_jacobian, _, base_rate = task.model.function("body")(symbols[0])
    R, rate = rotation_matrix(symbols[2]), ca.mtimes(base_rate, symbols[1])
    linear = -rotate(R, ca.mtimes(com_jacobian, symbols[1]) + cross(rate, com))
    return many(ca.Function("base_twist", symbols, [ca.densify(ca.vertcat(linear, rotate(R, rate)))]), q, qd, quat)[0]


def _quaternions(rotations: Array) -> Array:
    """w, x, y, z (T, 4) of rotation matrices (T, 3, 3), without sudden changes of sign."""
    from scipy.spatial.transform import Rotation

    found = Rotation.from_matrix(rotations).as_quat()[:, [3, 0, 1, 2]]
    signs = np.cumprod(np.where(np.concatenate([[1.0], (found[1:] * found[:-1]).sum(axis=1)]) < 0, -1.0, 1.0))
    return np.asarray(found * signs[:, None])


def _arm(task: Task, tip: str, q: Array, position: Array, quat: Array) -> Array:
    """The polyline in the world of the arm that carries a tip, (T, 3 k), point after point."""
    own = many(task.model.function("arm", tip), q)[0]
    points = own.reshape(len(q), -1, 3)
    turn = quaternions.rotations(quat)
    return np.asarray((np.einsum("tij,tkj->tki", turn, points) + position[:, None, :]).reshape(len(q), -1))


def _obstacles(task: Task, time: Array) -> dict[str, Array]:
    """The middle of every obstacle (T, 3) [m]."""
    scene = task.world.scene
    return {name: one.position(time) for name, one in zip(scene.names, scene.obstacles, strict=True)}
