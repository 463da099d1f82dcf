"""Arms, poses and runs that the tests of the reaching laws share."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.run_file import run_of
from fzcli.loop.run_spec import SimulateRun
from fzcli.spec.document import document_of
from fzcli.spec.robot import Base, Frame, Joint, JointType, Link, Robot, Tip

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
HOME_A = np.deg2rad([0.0, -90.0, 0.0, -90.0, 0.0, 0.0])
HOME_B = np.deg2rad([0.0, -90.0, -90.0, -90.0, 90.0, 0.0])
STOP = {"position": "10 mm", "direction": "2 deg", "after": "10 s"}
# Reachable from home B; without a restart the law of that name settles beside it.
STALLING = {
    "fabrik": {"position": [0.0277, 0.1124, 0.2700], "direction": [0.6428, 0.4830, -0.5946]},
    "dls": {"position": [-0.2679, 0.5726, 0.4020], "direction": [-0.0498, -0.3665, 0.9291]},
}


def raw_reaching(**changes: Any) -> dict[str, Any]:
    """The UR5 from home B to a target, as plain data; dotted keys (``__`` for a dot) replace fields, None drops one."""
    data: dict[str, Any] = {
        "kind": "simulate",
        "robot": "ur5_free_flyer",
        "start": {"q": HOME_B.tolist()},
        "reference": {"kind": "target", "position": [0.3, 0.5, 0.8], "direction": [1.0, 1.0, -1.0]},
        "controller": {"kind": "fabrik"},
        "method": "gauss_magnus",
        "stop": dict(STOP),
    }
    for key, value in changes.items():
        *path, last = key.split("__")
        section = data
        for step in path:
            section = section.setdefault(step, {})
        if value is None:
            section.pop(last, None)
        else:
            section[last] = value
    return data


def reaching_run(robot: Robot | None = None, **changes: Any) -> SimulateRun:
    """The validated run of `raw_reaching`; ``robot``: an arm of `arm` instead of a file's."""
    if robot is None:
        return run_of(document_of(raw_reaching(**changes)))
    data = raw_reaching(**changes)
    data["robot"] = robot
    return run_of(document_of(data))


def arm(
    *joints: tuple[Vector, Vector],
    tip: Vector = (0.4, 0.0, 0.0),
    tip_rpy: Vector = (0.0, 0.0, 0.0),
    floating: bool = False,
    types: dict[int, JointType] | None = None,
    parents: dict[int, str] | None = None,
    limits: tuple[float, float] | None = None,
    speed: float | None = np.pi,
    com: Vector = (0.0, 0.0, 0.0),
) -> Robot:
    """A tree of links, each with its joint's place in the link before (or in its parent), and the joint's axis."""
    links = tuple(
        Link(
            name=f"link{i}",
            parent=(parents or {}).get(i, f"link{i - 1}" if i else "base"),
            at=Frame(xyz=place),
            joint=Joint(name=f"q{i}", type=(types or {}).get(i, "revolute"), axis=axis, speed=speed, position=limits),
            mass=1.0,
            com=com,
            inertia=(0.01, 0.01, 0.01, 0.0, 0.0, 0.0),
        )
        for i, (place, axis) in enumerate(joints)
    )
    base = Base(mass=10.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0), floating=floating)
    return Robot(name="arm", base=base, links=links, tips={"tip": Tip(link=links[-1].name, xyz=tip, rpy=tip_rpy)})


def vector(values: Array) -> Vector:
    """Three numbers as a tuple."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def skew_arm(rng: np.random.Generator, n: int, floating: bool) -> Robot:
    """A random serial arm of n hinges on skew axes, with masses off the joints."""
    return arm(
        *((vector(0.4 * rng.normal(size=3)), vector(rng.normal(size=3))) for _ in range(n)),
        tip=vector(0.4 * rng.normal(size=3)),
        floating=floating,
        com=vector(0.3 * rng.normal(size=3)),
    )


def unit(v: Array) -> Array:
    """v (3) scaled to length one."""
    return v / float(np.linalg.norm(v))
