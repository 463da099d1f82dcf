"""Two hundred unknown spheres, seen at step 8 of 20: what comes of them, judged by coal on frames of their own."""

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.online_scenes import Scenes, Unknown
from fzcli.loop.execution import Execution, build_mission, execute

Array = NDArray[np.float64]
RADII = (0.055, 0.055, 0.045, 0.035)
ROWS = ((0, 0.3, 0, -90), (-90, 0, 0.25, 0), (-90, 0, 0.09, -90), (0, 0.16, 0, 90), (0, 0, 0, -90), (180, 0.172, 0, 0))


def origins(q: Array) -> Array:
    """Of the DH frames 1, 2, 3, 4 and the tool tip, (5, 3) [m]: multiplied out anew from the manual's table."""
    frame, found = np.eye(4), []
    for (offset, d, a, twist), angle in zip(ROWS, q, strict=True):
        s, c = np.sin(angle + np.radians(offset)), np.cos(angle + np.radians(offset))
        st, ct = np.sin(np.radians(twist)), np.cos(np.radians(twist))
        row = [[c, -s * ct, s * st, a * c], [s, c * ct, -c * st, a * s], [0, st, ct, d], [0, 0, 0, 1]]
        frame = frame @ np.array(row)
        found.append(frame[:3, 3])
    return np.array([found[0], found[1], found[2], found[3], found[5]])


def nearest_by_coal(found: Execution, one: Unknown) -> float:
    """The smallest distance of sphere and arm, and of the arm's ends among themselves, at all samples."""
    import coal

    sphere = one.spec.scene[0].sphere
    assert sphere is not None
    ball, least = coal.Sphere(sphere.radius), np.inf
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.enable_signed_distance = True
    for time, q in zip(found.plan.time, found.plan.q, strict=True):
        points = origins(q)
        there = coal.Transform3s(np.eye(3), np.array(sphere.center) + time * np.array(one.spec.scene[0].velocity))
        arm = [capsule(points[i], points[i + 1], radius) for i, radius in enumerate(RADII)]
        pairs = [(part, (ball, there)) for part in arm] + [(arm[0], arm[3]), (arm[1], arm[3])]
        for part, other in pairs:
            result.clear()
            least = min(least, coal.distance(*part, *other, request, result))
    return float(least)


def capsule(start: Array, end: Array, radius: float) -> tuple[object, object]:
    import coal

    length = np.linalg.norm(end - start)
    z = (end - start) / length
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    return coal.Capsule(radius, length), coal.Transform3s(np.column_stack([x, np.cross(z, x), z]), (start + end) / 2)


@pytest.mark.long
@pytest.mark.parametrize("moving", [False, True])
def test_a_hundred_unknown_spheres(moving: bool) -> None:
    pytest.importorskip("coal")
    scenes, count = Scenes(), 100
    low, high = scenes.model.tree.position_limits.T
    ahead = solved = 0
    for number in range(count):
        one = scenes.draw(number, moving)
        found = execute(build_mission(one.spec))
        plan = found.plan
        assert len(plan.time) >= 401
        nearest = nearest_by_coal(found, one)
        assert nearest == pytest.approx(plan.clearance.min(), abs=1e-5)
        assert nearest >= (0.01 - 1e-5 if plan.status.name == "ok" else 0.0)
        assert (plan.q >= low - 1e-9).all()
        assert (plan.q <= high + 1e-9).all()
        assert (np.abs(plan.qd) <= scenes.model.tree.speed_limits + 1e-9).all()
        assert plan.certificate["knot_jump_max"] < 1e-9
        assert plan.status.name == "ok" or plan.status.reason.startswith("stopped on the path")
        if one.contact >= 10:  # two steps after the sight
            ahead += 1
            solved += plan.status.name == "ok"
    assert ahead >= 75
    assert solved >= 0.95 * ahead
