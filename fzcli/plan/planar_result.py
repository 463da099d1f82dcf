"""A found path of a planar 3-RRR as a Plan: sampled, measured, certified."""

import numpy as np
from numpy.typing import NDArray

from fzcli.model.collision import many
from fzcli.plan.continuous import PathClearance
from fzcli.plan.detour_planner import CERTIFIED, Attempt
from fzcli.plan.joint_path import JointPath
from fzcli.plan.plan import Plan
from fzcli.plan.planar_bounds import STILL
from fzcli.plan.planar_task import PlanarTask
from fzcli.plan.result import CERTIFICATE, FEWEST, METRICS, SAMPLE, as_plan, kept, knot_jump
from fzcli.plan.task import AnyTask, Task
from fzcli.plan.world import Path
from fzcli.spec.quantity import Signal
from fzcli.spec.result import Provenance, Status

Array = NDArray[np.float64]
LEGS = ("leg1", "leg2", "leg3")
LINE = ("foot", "elbow", "corner")
POSE = ("x", "y", "phi")
MEASURES = ("leg1", "leg2", "leg3", "det_A")
OWN = {
    "singularity_min": ("1", "smallest singularity measure met: sine of an elbow, or |det A| (see signal singularity)"),
    "singularity_at_least": ("1", "no smaller one exists at any time of the path"),
    "singularity_time": ("s", "when it is met"),
    "closure_error_max": ("m", "by which a leg is longer or shorter than it is, at any sample"),
}
SIGNALS = {
    "pose": Signal("pose", "m or rad", "platform: x, y and angle, base frame", POSE),
    "singularity": Signal(
        "singularity", "1", "sines of the elbows (type I) and det A (type II), positive on the branch", MEASURES
    ),
}


def states(task: PlanarTask, path: Path, time: Array) -> tuple[Array, Array]:
    """Poses (T, 3) and the nine joints (T, 9) of the open tree along a path."""
    poses = task.world.ride(path).at(time)
    return poses, many(task.world.body.state, poses, path.at(time)[0])[0]


def leg_lines(task: PlanarTask, state: Array) -> dict[str, Array]:
    """Each leg as a line (T, 9) over its foot, elbow and end, and the platform's three corners, [m]."""
    feet = np.array(task.world.body.model.robot.base.corners)
    lines = {}
    for leg, foot in zip(LEGS, feet, strict=True):
        points = many(task.world.body.tree.function("arm", leg), state)[0].reshape(len(state), -1, 3)
        start = np.broadcast_to([*foot, 0.0], (len(state), 3))
        lines[leg] = np.hstack([start, points[:, -2], points[:, -1]])
    lines["platform"] = np.hstack([lines[leg][:, 6:] for leg in LEGS])
    return lines


def as_any_plan(task: AnyTask, attempt: Attempt, provenance: Provenance) -> Plan:
    """The plan of a found path, whatever the robot."""
    if isinstance(task, PlanarTask):
        return as_planar_plan(task, attempt, provenance)
    if isinstance(task, Task):
        return as_plan(task, attempt, provenance)
    raise TypeError(f"no task of a plan: {type(task).__name__}")


def as_planar_plan(task: PlanarTask, attempt: Attempt, provenance: Provenance) -> Plan:
    """Sample every 10 ms or less, and measure."""
    path, world = attempt.path, task.world
    time = np.linspace(0.0, path.duration, max(FEWEST, int(np.ceil(path.duration / SAMPLE)) + 1))
    q, qd, qdd = path.at(time)
    poses, state = states(task, path, time)
    tip = np.column_stack([poses[:, :2], np.zeros(len(time))])
    distances = world.columns(q, poses, time)[:, : len(world.clearance.scene.pairs)]
    certificate, found = _certificate(task, attempt, (q, qd, qdd), poses)
    metrics = _metrics(task, attempt, (q, qd, qdd), tip)
    lines = leg_lines(task, state)
    about = {**METRICS, **CERTIFICATE, **OWN}
    return Plan(
        time=time,
        q=q,
        qd=qd,
        qdd=qdd,
        base_position=np.zeros((len(time), 3)),
        base_quat=np.tile(STILL[1], (len(time), 1)),
        base_twist=np.zeros((len(time), 6)),
        tip_position=tip,
        tip_quat=_quaternions(poses[:, 2]),
        straight_tip=_straight(task, path, time),
        clearance=distances.min(axis=1, initial=np.inf),
        arms=lines,
        arm_names={name: ("corner1", "corner2", "corner3") if name == "platform" else LINE for name in lines},
        obstacles={one.name: one.position(time) for one in world.scene.named},
        joint_names=world.model.joint_names,
        joint_units=("rad",) * 3,
        detours=path.detours if isinstance(path, JointPath) else (),
        method=attempt.method,
        metrics=metrics,
        metric_info={name: Signal(name, *about[name]) for name in (*metrics, *certificate)},
        certificate=certificate,
        status=_status(task, found, certificate),
        provenance=provenance,
        signals={"pose": poses, "singularity": world.measures(poses, q)},
        signal_info=SIGNALS,
    )


def _quaternions(angles: Array) -> Array:
    """w, x, y, z (T, 4) of turns about z (T,) [rad]."""
    nothing = np.zeros(len(angles))
    return np.column_stack([np.cos(angles / 2), nothing, nothing, np.sin(angles / 2)])


def _straight(task: PlanarTask, path: Path, time: Array) -> Array:
    """Where the platform's centre (T, 3) [m] would be on the straight joint path to the same end; NaN where lost."""
    straight = JointPath(path.start, path.goal - path.start, path.duration, task.spec.law)
    poses = task.world.ride(straight).at(time)
    return np.column_stack([poses[:, :2], np.zeros(len(time))])


def _metrics(task: PlanarTask, attempt: Attempt, joints: tuple[Array, Array, Array], tip: Array) -> dict[str, float]:
    q, qd, qdd = joints
    return {
        "duration": attempt.path.duration,
        "path_length": float(np.linalg.norm(np.diff(q, axis=0), axis=1).sum()),
        "tip_path_length": float(np.linalg.norm(np.diff(tip, axis=0), axis=1).sum()),
        "speed_ratio_max": float((np.abs(qd) / task.speeds).max(initial=0.0)),
        "acceleration_max": float(np.abs(qdd).max()),
        "cost": attempt.cost,
    }


def _certificate(
    task: PlanarTask, attempt: Attempt, joints: tuple[Array, Array, Array], poses: Array
) -> tuple[dict[str, float], PathClearance]:
    q, qd, qdd = joints
    scene, singular = task.world.certified_parts(attempt.path, CERTIFIED)
    low, high = task.world.model.tree.position_limits.T
    closure = many(task.world.body.model.function("closure"), poses, q)[0]
    return {
        "clearance_min": scene.clearance,
        "clearance_at_least": scene.at_least,
        "clearance_time": scene.time,
        "singularity_min": singular.clearance,
        "singularity_at_least": singular.at_least,
        "singularity_time": singular.time,
        "joint_limit_excess_max": max(0.0, float((low - q).max()), float((q - high).max())),
        "joint_speed_excess_max": max(0.0, float((np.abs(qd) - task.speeds).max())),
        "joint_acceleration_excess_max": max(0.0, float((np.abs(qdd) - task.accelerations).max())),
        "goal_error_max": _goal_error(task, q[-1], poses[-1]),
        "knot_jump_max": knot_jump(attempt),
        "closure_error_max": float(np.abs(closure).max()),
    }, scene


def _goal_error(task: PlanarTask, q: Array, pose: Array) -> float:
    """Of the joints, or of the platform's pose as the legs lead it there."""
    if task.spec.goal.pose is None:
        return float(np.abs(q - task.goal.theta).max())
    error = pose - task.goal.pose
    return float(max(np.hypot(error[0], error[1]), abs(np.remainder(error[2] + np.pi, 2 * np.pi) - np.pi)))


def _status(task: PlanarTask, found: PathClearance, certificate: dict[str, float]) -> Status:
    """ok, or what is not kept."""
    margin, off = task.spec.margin, task.spec.off_singular
    if found.clearance < 0:
        text = f"contact: {found.pair} overlap by {-1e3 * found.clearance:.3g} mm at {found.time:.4g} s"
        return Status("failed", text, "ask for a margin, or lead the path round it")
    if certificate["singularity_at_least"] <= 0:
        text = f"meets a singularity at {certificate['singularity_time']:.4g} s"
        return Status("failed", text, "beyond it the drives do not lead the platform on its branch")
    if found.clearance < margin - 1e-6:
        return Status("flagged", f"{found.pair} come within {1e3 * found.clearance:.3g} mm", "lower margin")
    if certificate["singularity_min"] < off - 1e-6:
        text = f"singularity_min {certificate['singularity_min']:.3g}, off_singular asks for {off:g}"
        return Status("flagged", text, "lower off_singular")
    return kept(certificate)
