"""A plan judged without fzcli's kinematics and distances: frames multiplied out in NumPy, distances by coal."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fzcli.plan.plan_spec import PlanRun
from fzcli.plan.scene import Obstacle
from fzcli.plan.world import Path
from fzcli.spec.robot import Robot
from fzcli.spec.shapes import BoxShape, Shape, SphereShape
from fzcli.spec.tool import with_tool

Array = NDArray[np.float64]
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def frame(xyz: Array, turn: Array) -> Array:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = turn, xyz
    return found


def turned(rpy: object) -> Array:
    return np.asarray(Rotation.from_euler("xyz", rpy).as_matrix())


def attitude(quat: Array) -> Array:
    return np.asarray(Rotation.from_quat(quat[[1, 2, 3, 0]]).as_matrix())


def link_frames(robot: Robot, q: Array, base: Array) -> dict[str, Array]:
    """Of every link and the base in the world; q in the order of the active joints."""
    frames = {robot.base.name: base, "base": base}
    values = iter(q)
    for link in robot.links:
        axis = np.array(link.joint.axis)
        moved = np.eye(4)
        if link.joint.type == "prismatic":
            moved[:3, 3] = next(values) * axis
        elif link.joint.type != "fixed":
            moved[:3, :3] = Rotation.from_rotvec(next(values) * axis).as_matrix()
        frames[link.name] = frames[link.parent] @ frame(link.at.xyz, turned(link.at.rpy)) @ moved
    return frames


def in_coal(shape: Shape, place: Array) -> tuple[object, object]:
    import coal

    solid = shape.solid
    if isinstance(solid, SphereShape):
        return coal.Sphere(solid.radius), in_place(place @ frame(solid.center, np.eye(3)))
    if isinstance(solid, BoxShape):
        return coal.Box(*solid.size), in_place(place @ frame(solid.center, turned(solid.rpy)))
    start, end = np.array(solid.start), np.array(solid.end)
    length = float(np.linalg.norm(end - start))
    along, _ = Rotation.align_vectors([(end - start) / length], [[0.0, 0.0, 1.0]])
    return coal.Capsule(solid.radius, length), in_place(place @ frame((start + end) / 2, along.as_matrix()))


def in_place(place: Array) -> object:
    import coal

    return coal.Transform3s(place[:3, :3], place[:3, 3])


def obstacle_place(obstacle: Obstacle, time: float) -> Array:
    """Its motion as a frame: by its velocity, without waypoints or spin."""
    return frame(time * np.array(obstacle.velocity), np.eye(3))


def clearances(spec: PlanRun, q: Array, times: Array, poses: Iterator[Array], own: set[frozenset[str]]) -> Array:
    """Smallest distance (T,) by coal: links and base against obstacles, and pairs ``own`` of links."""
    import coal

    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    robot = spec.robot if spec.tool is None else with_tool(spec.robot, spec.tool)
    carried = [(robot.base.name, shape) for shape in robot.base.collision]
    carried += [(link.name, shape) for link in robot.links for shape in link.collision]
    least = []
    for posture, time, base in zip(q, times, poses, strict=True):
        frames = link_frames(robot, posture, base)
        placed = [(name, in_coal(shape, frames[name])) for name, shape in carried]
        stand = [in_coal(one, obstacle_place(one, float(time))) for one in spec.scene]
        pairs = [(solid, other) for _, solid in placed for other in stand]
        pairs += [
            (solid, other)
            for k, (name, solid) in enumerate(placed)
            for second, other in placed[:k]
            if frozenset((name, second)) in own
        ]
        least.append(min(coal.distance(*a, *b, request, coal.DistanceResult()) for a, b in pairs))
    return np.array(least)


def ridden(robot: Robot, path: Path, duration: float, times: Array) -> list[Array]:
    """The base's frame (4, 4) at times when it floats, at rest at first: momentum solved body by body in NumPy.

    The base turns by R' = R [w]x, where w makes the angular momentum about the whole centre of mass zero, which
    itself stays where it is.
    """

    def rate(time: float, quat: Array) -> Array:
        q, qd, _ = path.at(np.array([time]))
        w = base_rate(robot, q[0], qd[0])
        x, y, z = w
        own = np.array([[0, -x, -y, -z], [x, 0, z, -y], [y, -z, 0, x], [z, y, -x, 0]])
        return np.asarray(0.5 * own @ quat)

    found = solve_ivp(rate, (0.0, duration), UPRIGHT, "DOP853", times, rtol=1e-11, atol=1e-12)
    start = center_of_mass(robot, path.at(np.zeros(1))[0][0])
    frames = []
    for time, quat in zip(times, found.y.T, strict=True):
        R = attitude(quat / np.linalg.norm(quat))
        frames.append(frame(start - R @ center_of_mass(robot, path.at(np.array([time]))[0][0]), R))
    return frames


def center_of_mass(robot: Robot, q: Array) -> Array:
    """Of base and links (3) [m], base axes."""
    bodies = list(bodies_of(robot, q))
    return np.asarray(sum(mass * com for mass, com, _ in bodies) / sum(mass for mass, _, _ in bodies))


def bodies_of(robot: Robot, q: Array) -> Iterator[tuple[float, Array, Array]]:
    """Mass, centre of mass (3) and rotation (3, 3) of base and links, base axes."""
    frames = link_frames(robot, q, np.eye(4))
    yield robot.base.mass, np.array(robot.base.com), np.eye(3)
    for link in robot.links:
        place = frames[link.name]
        yield link.mass, place[:3, 3] + place[:3, :3] @ np.array(link.com), place[:3, :3]


def base_rate(robot: Robot, q: Array, qd: Array) -> Array:
    """The base's angular velocity (3) [rad/s], base axes, without momentum; joint rates by finite differences."""
    step = 1e-6
    before, after = list(bodies_of(robot, q - step * qd)), list(bodies_of(robot, q + step * qd))
    whole = center_of_mass(robot, q)
    drift = (center_of_mass(robot, q + step * qd) - center_of_mass(robot, q - step * qd)) / (2 * step)
    inertias = [robot.base.inertia, *(link.inertia for link in robot.links)]
    inertia, momentum = np.zeros((3, 3)), np.zeros(3)
    for (mass, com, R), (_, early, Ra), (_, late, Rb), own in zip(
        bodies_of(robot, q), before, after, inertias, strict=True
    ):
        xx, yy, zz, xy, xz, yz = own
        own_inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
        r, v = com - whole, (late - early) / (2 * step) - drift
        spin = Rotation.from_matrix(Rb @ Ra.T).as_rotvec() / (2 * step)
        momentum += mass * np.cross(r, v) + own_inertia @ spin
        inertia += own_inertia + mass * (float(r @ r) * np.eye(3) - np.outer(r, r))
    return np.asarray(-np.linalg.solve(inertia, momentum))


def momentum(
    robot: Robot, q: Array, qd: Array, base: Array, twist: Array
) -> tuple[tuple[Array, Array], tuple[float, float]]:
    """Linear (3) and angular (3) about the centre of mass, world; and the sums of the bodies' own sizes of either.

    ``twist`` (6) of the base frame's origin, world axes: velocities are handed on from joint to joint.
    """
    frames, values = link_frames(robot, q, base), iter(qd)
    moving = {robot.base.name: (twist[:3], twist[3:])}
    bodies = [(robot.base, robot.base.name)]
    for link in robot.links:
        place, parent = frames[link.name], frames[link.parent]
        speed, spin = moving[link.parent]
        speed, axis = speed + np.cross(spin, place[:3, 3] - parent[:3, 3]), place[:3, :3] @ np.array(link.joint.axis)
        if link.joint.type == "prismatic":
            speed = speed + next(values) * axis
        elif link.joint.type != "fixed":
            spin = spin + next(values) * axis
        moving[link.name] = speed, spin
        bodies.append((link, link.name))
    parts = []
    for body, name in bodies:
        (speed, spin), R = moving[name], frames[name][:3, :3]
        arm = R @ np.array(body.com)
        xx, yy, zz, xy, xz, yz = body.inertia
        own = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T @ spin
        parts.append((body.mass, frames[name][:3, 3] + arm, speed + np.cross(spin, arm), own))
    whole = sum(mass * com for mass, com, _, _ in parts) / sum(mass for mass, _, _, _ in parts)
    linear = [mass * speed for mass, _, speed, _ in parts]
    angular = [np.cross(com - whole, p) + own for (_, com, _, own), p in zip(parts, linear, strict=True)]
    sizes = tuple(float(np.linalg.norm(part, axis=1).sum()) for part in (np.array(linear), np.array(angular)))
    return (np.sum(linear, axis=0), np.sum(angular, axis=0)), (sizes[0], sizes[1])
