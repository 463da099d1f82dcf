"""Attitude on the group: quaternions (w, x, y, z), body to world, and roll, pitch, yaw (ZYX)."""

import casadi as ca

from fzcli.model.algebra import dot


def rotation_matrix(quat: ca.SX) -> ca.SX:
    """R (3, 3), body to world, of a unit quaternion (4)."""
    w, x, y, z = quat[0], quat[1], quat[2], quat[3]
    x2, y2, z2 = x + x, y + y, z + z
    xx, yy, zz = x * x2, y * y2, z * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    return ca.vertcat(
        ca.horzcat(1 - (yy + zz), xy - wz, xz + wy),
        ca.horzcat(xy + wz, 1 - (xx + zz), yz - wx),
        ca.horzcat(xz - wy, yz + wx, 1 - (xx + yy)),
    )


def multiply(a: ca.SX, b: ca.SX) -> ca.SX:
    """The quaternion product a b, (4)."""
    return ca.vertcat(
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def exponential(turn: ca.SX) -> ca.SX:
    """The unit quaternion (4) of a rotation vector ``turn`` (3) [rad] of any size."""
    angle = ca.sqrt(dot(turn, turn))
    half = 0.5 * angle
    sinc = ca.sin(half) / ca.fmax(angle, 1e-300)  # a zero turn gives 0 times 0, not 0 over 0
    return ca.vertcat(ca.cos(half), sinc * turn)


def attitude_step(quat: ca.SX, turn: ca.SX) -> ca.SX:
    """The unit quaternion (4) after a rotation vector ``turn`` (3) [rad] given in body axes.

    The product of unit quaternions is unit but for rounding, which one Newton step on the norm removes.
    """
    product = multiply(quat, exponential(turn))
    return product * (1.5 - 0.5 * dot(product, product))


def rotation_vector(quat: ca.SX) -> ca.SX:
    """The rotation vector (3) [rad] of a unit quaternion, the short way round; inverse of `exponential`."""
    sign = ca.if_else(quat[0] < 0, -1.0, 1.0)
    vector = sign * quat[1:4]
    sine = ca.sqrt(dot(vector, vector))
    angle = 2 * ca.atan2(sine, sign * quat[0])
    small = sine < 1e-8
    return vector * ca.if_else(small, 2.0, angle / ca.if_else(small, 1.0, sine))


def normalised(quat: ca.SX) -> ca.SX:
    """quat / |quat|, (4)."""
    return quat * (1 / ca.sqrt(dot(quat, quat)))


def conjugate(quat: ca.SX) -> ca.SX:
    """The inverse rotation, (4)."""
    return ca.vertcat(quat[0], -quat[1], -quat[2], -quat[3])


def quaternion_from_matrix(R: ca.SX) -> ca.SX:
    """A unit quaternion (4) of a rotation matrix (3, 3), by its largest component (Shepperd)."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    rows = [
        ca.vertcat(1 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]),
        ca.vertcat(R[2, 1] - R[1, 2], 1 + 2 * R[0, 0] - trace, R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]),
        ca.vertcat(R[0, 2] - R[2, 0], R[0, 1] + R[1, 0], 1 + 2 * R[1, 1] - trace, R[1, 2] + R[2, 1]),
        ca.vertcat(R[1, 0] - R[0, 1], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], 1 + 2 * R[2, 2] - trace),
    ]
    best, largest = rows[0], rows[0][0]
    for i in range(1, 4):
        better = rows[i][i] > largest
        best = ca.if_else(better, rows[i], best)
        largest = ca.fmax(largest, rows[i][i])
    return normalised(best)


def roll_pitch_yaw(R: ca.SX) -> ca.SX:
    """Roll, pitch, yaw (3) [rad] with R = Rz(yaw) Ry(pitch) Rx(roll)."""
    cosine = ca.sqrt(R[0, 0] * R[0, 0] + R[1, 0] * R[1, 0])
    return ca.vertcat(
        ca.atan2(R[2, 1], R[2, 2]), ca.atan2(-R[2, 0], cosine), ca.atan2(R[1, 0], R[0, 0])
    )


def starting_angles(R: ca.SX) -> ca.SX:
    """As `roll_pitch_yaw`, and at pitch +-90 deg, where only a sum of roll and yaw counts, with yaw 0."""
    cosine = ca.sqrt(R[0, 0] * R[0, 0] + R[1, 0] * R[1, 0])
    locked = ca.vertcat(ca.atan2(-R[1, 2], R[1, 1]), ca.atan2(-R[2, 0], cosine), 0)
    return ca.if_else(cosine < 1e-8, locked, roll_pitch_yaw(R))


def angle_rate_rows(R: ca.SX) -> ca.SX:
    """E (3, 3) with (roll, pitch, yaw) rates = E w, w the angular velocity in BODY axes.

    Without trigonometry, from R alone; singular at |pitch| = 90 deg. The yaw row equals
    [cos(yaw) tan(pitch), sin(yaw) tan(pitch), 1] in world axes.
    """
    cos2 = R[2, 1] * R[2, 1] + R[2, 2] * R[2, 2]
    inverse2 = 1 / cos2
    cosine = ca.sqrt(cos2)
    inverse = cosine * inverse2
    yaw = ca.horzcat(0, R[2, 1] * inverse2, R[2, 2] * inverse2)
    pitch = ca.horzcat(0, R[2, 2] * inverse, -R[2, 1] * inverse)
    roll = ca.horzcat(1, -R[2, 0] * yaw[1], -R[2, 0] * yaw[2])
    return ca.vertcat(roll, pitch, yaw)
