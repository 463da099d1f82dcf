"""What a run at torque level shows and is measured by, beside the run whose motion it follows."""

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from fzcli.loop.guide import Guided
from fzcli.loop.signals import WXYZ, XYZ
from fzcli.loop.torque_plant import TorquePlant
from fzcli.model.algebra import dot, rotate
from fzcli.model.attitude import (
    conjugate,
    multiply,
    quaternion_from_matrix,
    roll_pitch_yaw,
    rotation_matrix,
    rotation_vector,
)
from fzcli.spec.quantity import Metric, Reduction, Signal

VELOCITY = ("vx", "vy", "vz", "wx", "wy", "wz")
MOMENTUM = ("px", "py", "pz", "lx", "ly", "lz")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")


@dataclass(frozen=True)
class Seen:
    """Expressions at one sample. ``state``, ``given``: of the plant; ``torque`` (n) as limited; ``sample``: of the
    motion that is followed; ``wanted`` (3): where the run's reference wants the tip, world; within the step the peaks
    of ``torque`` and ``power`` and the share ``saturated`` at a limit; ``moved``: energy [J] that went through the
    motors so far; ``energy0``: kinetic energy at the start.
    """

    state: ca.SX
    given: ca.SX
    torque: ca.SX
    sample: ca.SX
    wanted: ca.SX
    torque_peak: ca.SX
    power_peak: ca.SX
    saturated: ca.SX
    moved: ca.SX
    energy0: ca.SX


@dataclass(frozen=True)
class Row:
    """A signal, its value, and its metrics: name -> reduction."""

    signal: Signal
    value: ca.SX
    metrics: dict[str, Reduction] = field(default_factory=dict)
    certified: bool = False

    def described(self) -> list[Metric]:
        """The metrics, with the signal's unit and meaning."""
        words = {"mean": "mean", "max": "largest", "min": "smallest", "last": "last"}
        about = self.signal
        return [
            Metric(name, about.name, how, about.unit, f"{words[how]}: {about.long_name}")
            for name, how in self.metrics.items()
        ]


def torque_rows(plant: TorquePlant, guided: Guided, seen: Seen, aims: bool) -> list[Row]:
    """All signals of a sample; ``aims``: the run has a target to arrive at, not a reference to keep to."""
    report = _Report.of(plant, seen)
    return [
        *_state_rows(plant, seen, report),
        *_deviation_rows(plant, guided, seen, report, aims),
        *_load_rows(plant, seen, report),
        *_certificate_rows(plant, seen, report),
    ]


@dataclass(frozen=True)
class _Report:
    """`motion_report` at a sample, and the tip."""

    position: ca.SX
    twist: ca.SX
    energy: ca.SX
    momentum: ca.SX
    of_base: ca.SX
    reaction: ca.SX
    tip: ca.SX
    tip_rotation: ca.SX

    @staticmethod
    def of(plant: TorquePlant, seen: Seen) -> "_Report":
        position, twist, energy, momentum, of_base, reaction = plant.report(seen.state, seen.given)
        moved = (seen.state[plant.place.q], seen.state[plant.place.quat], seen.state[plant.place.qd], twist)
        point, rotation, _ = plant.model.function("tip_state", plant.tip)(*moved)
        return _Report(position, twist, energy, momentum, of_base, reaction, position + point, rotation)


def _state_rows(plant: TorquePlant, seen: Seen, report: _Report) -> list[Row]:
    model, place = plant.model, plant.place
    q, quat = seen.state[place.q], seen.state[place.quat]
    R, points = rotation_matrix(quat), model.function("arm", plant.tip)(q)
    arm = [report.position + rotate(R, points[:, i]) for i in range(points.shape[1])]
    names = ("base", *(model.joint_names[j] for j in model.carriers(plant.tip)), "tip")
    places = tuple(f"{name}_{axis}" for name in names for axis in XYZ)
    joints = model.joint_names
    return [
        Row(Signal("q", "rad or m", "joint positions", joints), q),
        Row(Signal("qd", "rad/s or m/s", "joint speeds", joints), seen.state[place.qd]),
        Row(Signal("base_position", "m", "origin of the base link's frame, world", XYZ), report.position),
        Row(Signal("base_quat", "1", "base attitude, body to world", WXYZ), quat),
        Row(Signal("base_twist", "m/s, rad/s", "base twist, world axes", VELOCITY), report.twist),
        Row(Signal("tip_position", "m", "tip position, world", XYZ), report.tip),
        Row(Signal("tip_quat", "1", "tip attitude, tip to world", WXYZ), quaternion_from_matrix(report.tip_rotation)),
        Row(
            Signal("arm_points", "m", "base frame, joints that carry the tip, and tip, world", places),
            ca.vertcat(*arm),
        ),
        Row(Signal("torque", "N m or N", "torques of the motors, within their limits", joints), seen.torque),
        Row(
            Signal("base_reaction", "N, N m", "what the arm exerts on the base, at its frame's origin, world", WRENCH),
            report.reaction,
        ),
        Row(
            Signal("base_momentum", "N s, N m s", "momentum of the base, angular about the CoM, world", MOMENTUM),
            report.of_base,
        ),
    ]


def _deviation_rows(plant: TorquePlant, guided: Guided, seen: Seen, report: _Report, aims: bool) -> list[Row]:
    quat, followed = seen.state[plant.place.quat], seen.sample[guided.base_quat]
    yaw, wanted = (roll_pitch_yaw(rotation_matrix(one))[2] for one in (quat, followed))
    apart = _short_way(wanted - yaw)
    error: dict[str, Reduction] = {"tip_error_final": "last"}
    if not aims:
        error = {"tip_error_mean": "mean", "tip_error_max": "max"}
    turn = _size(rotation_vector(multiply(followed, conjugate(quat))))
    joints = seen.sample[guided.q] - seen.state[plant.place.q]
    return [
        Row(
            Signal("tip_error", "m", "distance of the tip from the run's reference"),
            _size(seen.wanted - report.tip),
            error,
        ),
        Row(Signal("yaw", "rad", "yaw of the base"), yaw),
        Row(Signal("yaw_abs", "rad", "size of the base's yaw"), ca.fabs(yaw), _max_and_mean("yaw_abs")),
        Row(
            Signal("tip_deviation", "m", "distance of the tip from that of the motion followed"),
            _size(seen.sample[guided.tip] - report.tip),
            _max_and_mean("tip_deviation"),
        ),
        Row(
            Signal("yaw_deviation", "rad", "distance of the base's yaw from that of the motion followed"),
            ca.fabs(apart),
            _max_and_mean("yaw_deviation"),
        ),
        Row(
            Signal("base_deviation", "rad", "angle between the base and that of the motion followed"),
            turn,
            {"base_deviation_max": "max"},
        ),
        Row(
            Signal("joint_deviation", "rad or m", "largest distance of a joint from the motion followed"),
            _largest(joints),
            {"joint_deviation_max": "max"},
        ),
    ]


def _load_rows(plant: TorquePlant, seen: Seen, report: _Report) -> list[Row]:
    rows = [
        Row(
            Signal("torque_peak", "N m or N", "largest torque of a joint within the step"),
            seen.torque_peak,
            {"torque_max": "max"},
        ),
        Row(
            Signal("power_peak", "W", "sum of the sizes of the motors' powers, its largest within the step"),
            seen.power_peak,
            {"power_max": "max"},
        ),
        Row(
            Signal("motor_energy", "J", "energy that went through the motors, in and out"),
            seen.moved,
            {"motor_energy": "last"},
        ),
        Row(Signal("kinetic_energy", "J", "of all bodies"), report.energy, {"kinetic_energy_max": "max"}),
        Row(Signal("work", "J", "done by all that acts, friction's negative"), seen.state[plant.place.work]),
        Row(
            Signal("reaction_force", "N", "size of the force that the arm exerts on the base"),
            _size(report.reaction[:3]),
            {"reaction_force_max": "max"},
        ),
        Row(
            Signal("reaction_moment", "N m", "size of the moment that the arm exerts on the base"),
            _size(report.reaction[3:]),
            {"reaction_moment_max": "max"},
        ),
        Row(
            Signal("base_spin", "N m s", "size of the base's angular momentum about the CoM"),
            _size(report.of_base[3:]),
            {"base_spin_max": "max"},
        ),
    ]
    if np.isfinite(plant.model.tree.effort_limits).any():
        about = Signal("saturated", "1", "share of the step in which a motor is at its limit")
        rows.append(Row(about, seen.saturated, {"saturated_mean": "mean"}))
    if plant.place.wheels.start < plant.place.wheels.stop:
        stored = seen.state[plant.place.wheels]
        rows.append(Row(Signal("wheel_momentum", "N m s", "of the reaction wheels, base axes", XYZ), stored))
        about = Signal("wheel_load", "N m s", "size of the reaction wheels' momentum")
        rows.append(Row(about, _size(stored), {"wheel_load_max": "max"}))
    return rows


def _certificate_rows(plant: TorquePlant, seen: Seen, report: _Report) -> list[Row]:
    place, tree = plant.place, plant.model.tree
    q, qd, quat = seen.state[place.q], seen.state[place.qd], seen.state[place.quat]
    rows = [
        Row(
            Signal("energy_error", "J", "kinetic energy less the start's and all work since"),
            ca.fabs(report.energy - seen.energy0 - seen.state[place.work]),
            {"energy_error_max": "max"},
            True,
        ),
        Row(
            Signal("quaternion_norm_error", "1", "error of the base quaternion's norm"),
            0.5 * ca.fabs(dot(quat, quat) - 1),
            {"quaternion_norm_error_max": "max"},
            True,
        ),
    ]
    if plant.model.floating:
        held = seen.state[place.velocity]
        stored = ca.SX.zeros(3)
        if place.wheels.start < place.wheels.stop:
            stored = rotate(rotation_matrix(quat), seen.state[place.wheels])
        for name, unit, value in (
            ("linear_momentum", "N s", report.momentum[:3] - held[:3]),
            ("angular_momentum", "N m s", report.momentum[3:] + stored - held[3:]),
        ):
            about = Signal(f"{name}_error", unit, f"{name.replace('_', ' ')} error")
            rows.append(Row(about, _size(value), {f"{name}_max": "max"}, True))
    speeding = [ca.fabs(qd[i]) - limit for i, limit in enumerate(tree.speed_limits) if np.isfinite(limit)]
    beyond = [low - q[i] for i, low in enumerate(tree.position_limits[:, 0]) if np.isfinite(low)]
    beyond += [q[i] - high for i, high in enumerate(tree.position_limits[:, 1]) if np.isfinite(high)]
    for name, unit, values in (("speed", "rad/s or m/s", speeding), ("limit", "rad or m", beyond)):
        if values:
            about = Signal(f"joint_{name}_excess", unit, f"excess over a joint's {name}, 0 when kept")
            most = ca.fmax(0.0, ca.mmax(ca.vertcat(*values)))
            rows.append(Row(about, most, {f"{about.name}_max": "max"}, True))
    return rows


def _max_and_mean(name: str) -> dict[str, Reduction]:
    return {f"{name}_max": "max", f"{name}_mean": "mean"}


def _short_way(apart: ca.SX) -> ca.SX:
    """An angle between -pi and pi."""
    return apart - 2 * np.pi * ca.floor(apart * (0.5 / np.pi) + 0.5)


def _size(vector: ca.SX) -> ca.SX:
    return ca.sqrt(dot(vector, vector))


def _largest(values: ca.SX) -> ca.SX:
    largest = ca.fabs(values[0])
    for i in range(1, values.shape[0]):
        largest = ca.fmax(largest, ca.fabs(values[i]))
    return largest
