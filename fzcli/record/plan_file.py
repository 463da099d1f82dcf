"""A plan as a result file: that of a run, with accelerations, clearance and obstacles as its signals."""

from pathlib import Path

from fzcli.loop.rollout import Rollout
from fzcli.plan.plan import Plan
from fzcli.record.hdf5 import Precision
from fzcli.record.names import AXIS
from fzcli.record.rollout_file import write_rollout
from fzcli.spec.quantity import Signal


def as_rollout(plan: Plan) -> Rollout:
    """The plan as the run that it would be."""
    info = {
        "clearance": Signal("clearance", "m", "smallest distance of all pairs of solids"),
        "qdd": Signal("qdd", "rad/s2 or m/s2", "joint accelerations", plan.joint_names),
        "straight_tip": Signal("straight_tip", "m", "tip on the straight joint path, world", AXIS),
    }
    signals = {"clearance": plan.clearance, "qdd": plan.qdd, "straight_tip": plan.straight_tip}
    for number, (tip, points) in enumerate(plan.arms.items()):
        key = f"arm_points_{tip}" if number else "arm_points"
        names = tuple(f"{name}_{axis}" for name in plan.arm_names[tip] for axis in AXIS)
        info[key] = Signal(key, "m", f"base frame, joints that carry tip {tip}, and that tip, world", names)
        signals[key] = points
    for name, middle in plan.obstacles.items():
        key = "obstacle_" + "".join(c if c.isalnum() else "_" for c in name)
        info[key] = Signal(key, "m", f"middle of {name}, world", AXIS)
        signals[key] = middle
    info.update(plan.signal_info)
    signals.update(plan.signals)
    return Rollout(
        time=plan.time,
        q=plan.q,
        qd=plan.qd,
        base_position=plan.base_position,
        base_quat=plan.base_quat,
        base_twist=plan.base_twist,
        tip_position=plan.tip_position,
        tip_quat=plan.tip_quat,
        signals=signals,
        signal_info=info,
        joint_names=plan.joint_names,
        joint_units=plan.joint_units,
        metrics={**plan.metrics, **plan.certificate},
        metric_info=plan.metric_info,
        certificate=plan.certificate,
        status=plan.status,
        provenance=plan.provenance,
    )


def write_plan(plan: Plan, path: Path | str, precision: Precision = "f8") -> None:
    """Writes the plan to ``path``, whole or not at all; in doubles, because somebody may drive along it.

    Raises RecordError where the file cannot be written.
    """
    write_rollout(as_rollout(plan), path, precision)
