"""Seeded random robots and states: every tree replays from its seed alone."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fzcli.spec.robot import Base, Frame, Joint, JointType, Link, Robot, Tip

Array = NDArray[np.float64]
ROOT_SEED = 20110704  # keeps these draws apart from other seeded draws of the tests
FIXED_PLACES = ((), ("first",), ("middle",), ("last",), ("first", "middle", "last"), ("any",))


@dataclass(frozen=True)
class State:
    """A random state: q (n,), base_quat (4,) w x y z, qd (n,), base_twist (6,) linear first."""

    q: Array
    base_quat: Array
    qd: Array
    base_twist: Array


def random_robot(seed: int) -> Robot:
    """A random tree of 1 to 9 links; seed % 6 says where fixed joints are forced (FIXED_PLACES).

    Seeds with seed % 7 == 6 stand on a fixed base, those with seed % 3 == 0 have axis-aligned joint
    axes and frames turned by quarter turns, odd seeds have at least one prismatic joint. Links stand
    in an order that respects parents but is not depth first in general.
    """
    rng = np.random.default_rng((ROOT_SEED, seed))
    places = FIXED_PLACES[seed % len(FIXED_PLACES)]
    count = int(rng.integers(max(1, len(places) + (1 if places else 0)), 10))
    if "middle" in places:
        count = max(count, 3)
    parents = _random_parents(rng, count, places)
    types = _random_types(rng, parents, places, prismatic=seed % 2 == 1)
    aligned = seed % 3 == 0
    links = tuple(
        Link(
            name=f"link{k}",
            parent="base" if parent < 0 else f"link{parent}",
            at=_random_frame(rng, aligned),
            joint=Joint(name=f"joint{k}", type=types[k], axis=_random_axis(rng, aligned)),
            mass=float(rng.uniform(0.2, 15.0)),
            com=_vector(rng.uniform(-0.4, 0.4, 3)),
            inertia=random_inertia(rng, scale=float(rng.uniform(0.01, 2.0))),
        )
        for k, parent in enumerate(parents)
    )
    base = Base(
        floating=seed % 7 != 6,
        mass=float(rng.uniform(5.0, 120.0)),
        com=_vector(rng.uniform(-0.3, 0.3, 3)),
        inertia=random_inertia(rng, scale=float(rng.uniform(0.5, 8.0))),
    )
    return Robot(name=f"random{seed}", base=base, links=links, tips=_random_tips(rng, parents))


def random_state(n: int, rng: np.random.Generator) -> State:
    """A random state of a robot with n active joints; the attitude is uniform on the rotations."""
    quat = rng.standard_normal(4)
    return State(
        q=rng.uniform(-np.pi, np.pi, n),
        base_quat=quat / np.linalg.norm(quat),
        qd=rng.uniform(-1.5, 1.5, n),
        base_twist=rng.uniform(-1.0, 1.0, 6),
    )


def random_states(n: int, seed: int, count: int) -> Iterator[tuple[int, State]]:
    """The states 0 .. count-1 that belong to a seed, each with its index, each drawn by itself."""
    for index in range(count):
        yield index, random_state(n, np.random.default_rng((ROOT_SEED, seed, index)))


def random_inertia(rng: np.random.Generator, scale: float) -> tuple[float, float, float, float, float, float]:
    """A physical inertia (xx, yy, zz, xy, xz, yz) [kg m2] from random second moments of mass.

    trace(S) E - S with S positive definite is positive definite and keeps the triangle inequality.
    """
    axes = _random_rotation(rng)
    second = axes @ np.diag(scale * rng.uniform(0.05, 1.0, 3)) @ axes.T
    inertia = np.trace(second) * np.eye(3) - second
    xx, yy, zz, xy, xz, yz = (
        float(inertia[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    )
    return xx, yy, zz, xy, xz, yz


def _random_parents(rng: np.random.Generator, count: int, places: tuple[str, ...]) -> list[int]:
    """Parent of each link, -1 the base; chains are likely, branches common.

    A forced "middle" needs a link with a parent and a child, so that the first three make a chain.
    """
    parents = [-1]
    for k in range(1, count):
        if ("middle" in places and k < 3) or rng.random() < 0.6:
            parents.append(k - 1)
        else:
            parents.append(int(rng.integers(-1, k)))
    return parents


def _random_types(
    rng: np.random.Generator, parents: list[int], places: tuple[str, ...], prismatic: bool
) -> list[JointType]:
    count = len(parents)
    kinds: tuple[JointType, ...] = ("revolute", "continuous", "prismatic")
    types: list[JointType] = [kinds[i] for i in rng.choice(3, size=count, p=(0.5, 0.2, 0.3))]
    if "any" in places:
        types = ["fixed" if rng.random() < 0.35 else kind for kind in types]
    if "first" in places:
        types[0] = "fixed"
    if "middle" in places:
        types[1] = "fixed"
    if "last" in places:
        types[count - 1] = "fixed"
    movable = [k for k, kind in enumerate(types) if kind != "fixed"]
    if not movable:
        types[count - 1], movable = "revolute", [count - 1]
    if prismatic and len(movable) > 1 and all(types[k] != "prismatic" for k in movable):
        types[movable[int(rng.integers(len(movable)))]] = "prismatic"
    return types


def _random_tips(rng: np.random.Generator, parents: list[int]) -> dict[str, Tip]:
    """A tip on every leaf, the last one first, one on a link that carries others if any, one on the base."""
    carriers = sorted(set(parents) - {-1})
    leaves = [k for k in range(len(parents)) if k not in carriers]
    places = {f"tip{k}": k for k in reversed(leaves)}
    if carriers:
        places["middle"] = int(rng.choice(carriers))
    links = {name: f"link{k}" for name, k in places.items()} | {"hull": "base"}
    tips = {}
    for name, link in links.items():
        frame = _random_frame(rng, aligned=False)
        tips[name] = Tip(link=link, xyz=frame.xyz, rpy=frame.rpy)
    return tips


def _random_frame(rng: np.random.Generator, aligned: bool) -> Frame:
    xyz = rng.uniform(-0.7, 0.7, 3)
    rpy = rng.uniform(-np.pi, np.pi, 3)
    if aligned:
        rpy = rng.integers(-2, 3, 3) * (np.pi / 2)
    return Frame(xyz=_vector(xyz), rpy=_vector(rpy))


def _random_axis(rng: np.random.Generator, aligned: bool) -> tuple[float, float, float]:
    if aligned:
        return _vector(np.eye(3)[int(rng.integers(3))] * float(rng.choice((-1.0, 1.0))))
    axis = rng.standard_normal(3)
    return _vector(axis / np.linalg.norm(axis))


def _random_rotation(rng: np.random.Generator) -> Array:
    orthogonal, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return orthogonal * np.sign(np.linalg.det(orthogonal))


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
