"""The closed loop of Bulgarelli 2011 written down sample by sample, on numpy_reference.

For reading and cross-checking, not for speed: about 1 ms a sample for four links.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fzcli.spec.robot import Robot
from tests.oracle.numpy_reference import NumpyReference, quat_exp, quat_multiply, rotation_from_quat

Array = NDArray[np.float64]
Increment = Callable[[float, float], float]  # (|ec| / scale, oscillating joints) -> step of Kc
LONG_AGO = -(10**9)


@dataclass(frozen=True)
class Loop:
    """Settings of the loop; the defaults are the test bed's.

    dt [s], kp [1/s], damping of J+ (lambda squared), samples of the moving average, window of the two
    crossings [samples], speeds ignored by the sign [rad/s or m/s], error that counts as 1 [rad].
    """

    dt: float = 0.01
    kp: float = 3.2
    damping: float = 1e-8
    average: int = 10
    window: int = 20
    ignore_below: float = 3e-4
    error_scale: float = 0.1


@dataclass(frozen=True)
class PlainRun:
    """Samples k = 0..N: time (T,), tip_error (T,) [m], yaw (T,) [rad], gain (T,) in force, oscillating
    (T,) joints, q (T, n), qd (T, n), quat (T, 4), base_velocity (T, 3) of the base's origin [m/s]."""

    time: Array
    tip_error: Array
    yaw: Array
    gain: Array
    oscillating: Array
    q: Array
    qd: Array
    quat: Array
    base_velocity: Array


class OscillationCounter:
    """Which velocities crossed their own moving average twice within the window."""

    def __init__(self, count: int, loop: Loop) -> None:
        self.loop = loop
        self.recent = np.zeros((loop.average, count))
        self.side = np.zeros(count)
        self.last = np.full(count, LONG_AGO)
        self.before_last = np.full(count, LONG_AGO)

    def count(self, k: int, velocities: Array) -> int:
        """Oscillating joints at sample k, whose velocities join the average first."""
        self.recent = np.vstack([self.recent[1:], velocities])
        distance = velocities - self.recent.mean(axis=0)
        for j, d in enumerate(distance):
            if abs(d) > self.loop.ignore_below and np.sign(d) != self.side[j]:
                if self.side[j] != 0:
                    self.before_last[j], self.last[j] = self.last[j], k
                self.side[j] = np.sign(d)
        return int(np.sum(k - self.before_last < self.loop.window))


def time_law_345(s: float) -> tuple[float, float]:
    """The 3-4-5 law S and dS/ds at s, held outside 0..1."""
    if s <= 0.0:
        return 0.0, 0.0
    if s >= 1.0:
        return 1.0, 0.0
    return 10 * s**3 - 15 * s**4 + 6 * s**5, 30 * s**2 - 60 * s**3 + 30 * s**4


def roll_pitch_yaw(rotation: Array) -> tuple[float, float, float]:
    """Angles [rad] with rotation = Rz(yaw) Ry(pitch) Rx(roll)."""
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    return (
        float(np.arctan2(rotation[2, 1], rotation[2, 2])),
        float(pitch),
        float(np.arctan2(rotation[1, 0], rotation[0, 0])),
    )


def angle_rates(rotation: Array) -> Array:
    """(3, 3): roll, pitch, yaw rates from the angular velocity in world axes."""
    _, pitch, yaw = roll_pitch_yaw(rotation)
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array(
        [
            [c / np.cos(pitch), s / np.cos(pitch), 0.0],
            [-s, c, 0.0],
            [c * np.tan(pitch), s * np.tan(pitch), 1.0],
        ]
    )


def run_plain_loop(
    robot: Robot,
    q0: ArrayLike,
    direction: ArrayLike,
    length: float,
    duration: float,
    gain: float,
    increment: Increment | None = None,
    base_quat: ArrayLike = (1.0, 0.0, 0.0, 0.0),
    loop: Loop | None = None,
) -> PlainRun:
    """Follow a straight tip line with equation 1; ``increment`` None keeps the gain fixed.

    q0 (n,), direction (3,) a unit vector in world, length [m], duration [s], gain Kc (0: no subtask).
    The gain in force at a sample is the one the tuner made in the sample before.
    """
    loop = loop or Loop()
    reference = NumpyReference(robot)
    q, quat = np.array(q0, float), np.array(base_quat, float)
    start, _ = reference.forward_kinematics(q, quat)
    line = length * np.array(direction, float)
    counter = OscillationCounter(reference.n + 6, loop)
    rows = []
    for k in range(int(np.ceil(duration / loop.dt - 1e-9)) + 1):
        law, law_rate = time_law_345(k * loop.dt / duration)
        x, _ = reference.forward_kinematics(q, quat)
        e, v_d = start + line * law - x, line * law_rate / duration
        rates = angle_rates(rotation_from_quat(quat))
        yaw = roll_pitch_yaw(rotation_from_quat(quat))[2]
        twist_map = reference.base_twist_map(q, quat)
        J, J_c = reference.generalized_jacobian(q, quat)[:3], rates[2] @ twist_map[3:]
        J_plus = J.T @ np.linalg.inv(J @ J.T + loop.damping * np.eye(3))
        g = J_c * gain * -yaw
        qd = g + J_plus @ (loop.kp * e + v_d - J @ g)
        base = twist_map @ qd
        oscillating = counter.count(k, np.concatenate([qd, base[:3], rates @ base[3:]]))
        error = float(np.linalg.norm(e))
        rows.append((k * loop.dt, error, yaw, gain, float(oscillating), q, qd, quat, base[:3]))
        if increment is not None:
            gain = max(0.0, gain + float(increment(abs(yaw) / loop.error_scale, float(oscillating))))
        turn = rotation_from_quat(quat).T @ base[3:] * loop.dt
        q, quat = q + loop.dt * qd, quat_multiply(quat, quat_exp(turn))
    return PlainRun(*(np.array(column) for column in zip(*rows, strict=True)))
