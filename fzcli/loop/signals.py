"""Everything that a recorded run shows beside the signals of its law."""

import casadi as ca

from fzcli.loop.parts import Parts
from fzcli.model.algebra import rotate
from fzcli.model.attitude import multiply, quaternion_from_matrix, rotation_matrix
from fzcli.spec.quantity import Signal

XYZ, WXYZ = ("x", "y", "z"), ("w", "x", "y", "z")


def state_signals(
    parts: Parts, plant_state: ca.SX, derivative: ca.SX, com: ca.SX, com_velocity: ca.SX
) -> dict[Signal, ca.SX]:
    """Joints, base, tip and arm at a sample; ``com`` (3) and its velocity, world."""
    model = parts.model
    q, quat = parts.plant.observe(plant_state)
    R = rotation_matrix(quat)
    qd, velocity, rate = parts.plant.motion(plant_state, derivative)
    position, rotation, _ = model.function("tip", parts.tip)(q)
    origin = com - rotate(R, model.function("body")(q)[0]) if model.floating else com
    points = model.function("arm", parts.tip)(q)
    arm = [origin + rotate(R, points[:, i]) for i in range(points.shape[1])]
    names = ("base", *(model.joint_names[j] for j in model.carriers(parts.tip)), "tip")
    return {
        Signal("q", "rad or m", "joint positions", model.joint_names): q,
        Signal("qd", "rad/s or m/s", "joint speeds", model.joint_names): qd,
        Signal("base_position", "m", "origin of the base link's frame, world", XYZ): origin,
        Signal("base_quat", "1", "base attitude, body to world", WXYZ): quat,
        Signal("base_twist", "m/s, rad/s", "base twist, world axes", ("vx", "vy", "vz", "wx", "wy", "wz")): (
            ca.vertcat(velocity + com_velocity, rate)
        ),
        Signal("tip_position", "m", "tip position, world", XYZ): com + rotate(R, position),
        Signal("tip_quat", "1", "tip attitude, tip to world", WXYZ): multiply(quat, quaternion_from_matrix(rotation)),
        Signal(
            "arm_points",
            "m",
            "base frame, joints that carry the tip, and tip, world",
            tuple(f"{name}_{axis}" for name in names for axis in XYZ),
        ): ca.vertcat(*arm),
    }
