"""URDF, through yourdfpy, as a dialect of the one robot spec.

Format: wiki.ros.org/urdf/XML. The root link is the base, each leaf link a tip of its name.
"""

import io
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from fzcli.errors import Problem, SpecError
from fzcli.spec.document import Steps
from fzcli.spec.nearest import hint, shown
from fzcli.spec.physics import Inertia6, Vector3, check_body, rpy_of, snapped, turned_inertia, vector
from fzcli.spec.reader import read_bytes
from fzcli.spec.robot import Base, Frame, Friction, Joint, Link, Robot, Tip
from fzcli.spec.robot_file import UrdfBaseFile, UrdfRobotFile
from fzcli.spec.shapes import Shape
from fzcli.spec.tree import arranged
from fzcli.spec.urdf_shapes import read_collisions

_TYPES = ("revolute", "continuous", "prismatic", "fixed")
_NO_INERTIA: Inertia6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class _Body:
    mass: float = 0.0
    com: Vector3 = (0.0, 0.0, 0.0)
    inertia: Inertia6 = _NO_INERTIA
    collision: tuple[Shape, ...] = ()
    unread: tuple[str, ...] = ()


def read_urdf(path: Path, additions: UrdfRobotFile | None = None) -> Robot:
    """A URDF as a robot; ``additions`` (a YAML file that names the URDF) replace base, tips, name, solids.

    A link called "base" that is not the root becomes "base_frame": "base" names the base body.

    Raises:
        SpecError: not a URDF, a joint of another type than revolute, continuous, prismatic and fixed, a
            mimic joint, a body that cannot exist, a floating base without inertia, not a tree.
    """
    urdf = _parsed(path)
    root = _root(urdf, path)
    base, links = _bodies(urdf, root, additions.base if additions else UrdfBaseFile(), path)
    links = _solids(links, additions, path)
    tips = _tips(links, additions)

    def report(message: str, steps: Steps) -> Problem:
        return Problem(message, ".".join(map(str, steps)) if steps[0] == "tips" else "", str(path))

    return Robot(
        name=(additions and additions.name) or urdf.name or path.stem,
        about=additions.about if additions else "",
        base=base,
        links=arranged(links, tips, report),
        tips=tips,
    )


def _bodies(urdf: Any, root: str, overrides: UrdfBaseFile, path: Path) -> tuple[Base, list[Link]]:
    """The base and the links, each with the joint that carries it, in the order of the joints."""
    problems: list[Problem] = []
    bodies = {link.name: _Body() for link in urdf.links}
    for link in urdf.links:
        try:
            collision, unread = read_collisions(link, path.parent)
            bodies[link.name] = replace(_body(link), collision=collision, unread=unread)
        except ValueError as error:
            problems.append(Problem(f"link '{link.name}': {error}", file=str(path)))
    links = []
    for joint in urdf.joints:
        try:
            links.append(_link(joint, root, bodies[joint.child]))
        except ValueError as error:
            problems.append(Problem(f"joint '{joint.name}': {error}", file=str(path)))
    if not problems:
        try:
            return _base(root, bodies[root], overrides), links
        except ValueError as error:
            problems.append(Problem(str(error), file=str(path)))
    raise SpecError(problems)


def _parsed(path: Path) -> Any:
    """yourdfpy's robot: its links and joints as written."""
    data = read_bytes(path)
    if b"<!ENTITY" in data or b"<!DOCTYPE" in data:
        raise SpecError(Problem("a URDF needs no DOCTYPE or ENTITY; remove it", file=str(path)))
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        line, column = error.position
        text = f"not XML: {str(error).partition(':')[0]}"
        raise SpecError(Problem(text, "", str(path), line, column + 1)) from None
    if root.tag != "robot":
        raise SpecError(Problem("not a URDF: the outermost element must be <robot>", file=str(path)))
    if gaps := [Problem(text, file=str(path)) for part in root for text in _gaps(part)]:
        raise SpecError(gaps)
    from yourdfpy import URDF

    try:
        loaded = URDF.load(io.BytesIO(data), build_scene_graph=False, load_meshes=False)
    except (AttributeError, KeyError, TypeError, ValueError, IndexError) as error:
        raise SpecError(Problem(f"not a URDF: {error}", file=str(path))) from None
    return loaded.robot


def _gaps(part: ElementTree.Element) -> Iterator[str]:
    """What a link or joint lacks that yourdfpy takes for granted: names, and vectors of three numbers."""
    if part.tag not in ("link", "joint"):
        return
    who = f"{part.tag} '{part.get('name', '')}'"
    if not part.get("name"):
        yield f"a <{part.tag}> without a name"
    for role in ("parent", "child") if part.tag == "joint" else ():
        element = part.find(role)
        if element is None or not element.get("link"):
            yield f'{who} needs <{role} link="..."/>'
    for element in (*part.iter("origin"), *part.iter("axis")):
        for key in ("xyz", "rpy"):
            words = element.get(key, "0 0 0").split()
            if len(words) != 3 or not all(_is_finite(word) for word in words):
                yield f"{who}: {key} of <{element.tag}> must be three numbers, got {shown(element.get(key))}"


def _is_finite(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _root(urdf: Any, path: Path) -> str:
    """The one link that no joint carries."""
    problems = []
    names: Counter[str] = Counter(link.name for link in urdf.links)
    carried: dict[str, str] = {}
    for joint in urdf.joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in names:
                text = f"joint '{joint.name}': unknown {role} link '{link}'"
                problems.append(Problem(text + hint(link, names, "known links"), file=str(path)))
        if joint.child in carried:
            both = f"'{carried[joint.child]}' and '{joint.name}'"
            text = f"link '{joint.child}' is carried by two joints, {both}; a tree has no closed chains"
            problems.append(Problem(text, file=str(path)))
        carried[joint.child] = joint.name
    doubled = [name for name, count in names.items() if count > 1]
    problems += [Problem(f"link '{name}' stands twice", file=str(path)) for name in doubled]
    roots = [name for name in names if name not in carried]
    if not problems and len(roots) != 1:
        listed = ", ".join(roots) or "none, the links form a loop"
        problems.append(Problem(f"needs exactly one root link, has {listed}", file=str(path)))
    if problems:
        raise SpecError(problems)
    return roots[0]


def _body(link: Any) -> _Body:
    inertial = link.inertial
    if inertial is None:
        return _Body()
    if inertial.mass is None or inertial.inertia is None:
        raise ValueError("<inertial> needs <mass> and <inertia>")
    origin = np.eye(4) if inertial.origin is None else inertial.origin
    if not np.isfinite([inertial.mass, *inertial.inertia.flat]).all():
        raise ValueError("<inertial> holds numbers that are not finite")
    inertia = turned_inertia(snapped(origin[:3, :3]), inertial.inertia)
    check_body(float(inertial.mass), inertia)
    return _Body(float(inertial.mass), vector(origin[:3, 3]), inertia)


def _link(joint: Any, root: str, body: _Body) -> Link:
    if joint.mimic is not None:
        raise ValueError("mimic joints are not supported")
    if joint.type not in _TYPES:
        raise ValueError(f"type '{joint.type}' is not supported; known: {', '.join(_TYPES)}")
    origin = np.eye(4) if joint.origin is None else joint.origin
    at = Frame(xyz=vector(origin[:3, 3]), rpy=rpy_of(snapped(origin[:3, :3])))
    position, speed = _limits(joint)
    if not np.isfinite([*(position or ()), speed or 0.0]).all():
        raise ValueError("<limit> holds numbers that are not finite")
    return Link(
        name=_own(joint.child),
        parent="base" if joint.parent == root else _own(joint.parent),
        at=at,
        joint=Joint(
            name=joint.name,
            type=joint.type,
            axis=_axis(joint),
            position=position,
            speed=speed,
            effort=_effort(joint),
            friction=_friction(joint),
        ),
        mass=body.mass,
        com=body.com,
        inertia=body.inertia,
        collision=body.collision,
        unread=body.unread,
    )


def _own(name: str) -> str:
    return "base_frame" if name == "base" else name


def _axis(joint: Any) -> Vector3:
    length = math.hypot(*joint.axis)
    if joint.type == "fixed":
        return (0.0, 0.0, 1.0)
    if not 1e-9 < length < math.inf:
        raise ValueError("axis must have a direction, got a zero vector")
    return vector(joint.axis / length)


def _limits(joint: Any) -> tuple[tuple[float, float] | None, float | None]:
    """Position and speed limits; a speed limit of 0 is the customary way to state none."""
    limit = joint.limit
    if limit is None or joint.type == "fixed":
        return None, None
    speed = limit.velocity if limit.velocity else None
    if speed is not None and speed < 0:
        raise ValueError(f"velocity limit must be > 0, got {speed:g}")
    if joint.type == "continuous" or (limit.lower is None and limit.upper is None):
        return None, speed
    lower, upper = float(limit.lower or 0.0), float(limit.upper or 0.0)
    if not lower < upper:
        raise ValueError(f"lower limit must be below the upper one, got {lower:g} and {upper:g}")
    return (lower, upper), speed


def _effort(joint: Any) -> float | None:
    """The torque or force limit; 0 is the customary way to state none."""
    effort = joint.limit.effort if joint.limit is not None and joint.type != "fixed" else None
    if not effort:
        return None
    if not 0 < effort < math.inf:
        raise ValueError(f"effort limit must be > 0 and finite, got {effort:g}")
    return float(effort)


def _friction(joint: Any) -> Friction | None:
    """<dynamics>: damping is the viscous, friction the Coulomb part."""
    if joint.dynamics is None or joint.type == "fixed":
        return None
    viscous, coulomb = float(joint.dynamics.damping or 0.0), float(joint.dynamics.friction or 0.0)
    if not (0 <= viscous < math.inf and 0 <= coulomb < math.inf):
        raise ValueError(f"damping and friction must be >= 0 and finite, got {viscous:g} and {coulomb:g}")
    return Friction(viscous=viscous, coulomb=coulomb) if viscous or coulomb else None


def _base(root: str, body: _Body, overrides: UrdfBaseFile) -> Base:
    if overrides.mass is not None:
        inertia = overrides.inertia or _NO_INERTIA
        body = replace(body, mass=overrides.mass, com=overrides.com, inertia=inertia)
    if overrides.collision:
        body = replace(body, collision=overrides.collision, unread=())
    if overrides.floating and body.mass == 0:
        raise ValueError(
            f"base link '{root}' floats but has no inertia; give it one, or name this URDF in a YAML robot "
            "with base: {mass: ..., inertia: ...} or base: {floating: false}"
        )
    return Base(
        name=root,
        floating=overrides.floating,
        mass=body.mass,
        com=body.com,
        inertia=body.inertia,
        collision=body.collision,
        unread=body.unread,
    )


def _solids(links: list[Link], additions: UrdfRobotFile | None, path: Path) -> list[Link]:
    """The links with the solids that the additions give some of them."""
    given = additions.collision if additions else {}
    names = {link.name: None for link in links}
    unknown = [name for name in given if name not in names]
    if unknown:
        texts = [f"unknown link '{name}'{hint(name, names, 'known links')}" for name in unknown]
        raise SpecError([Problem(text, "collision", str(path)) for text in texts])
    return [
        link.model_copy(update={"collision": given[link.name], "unread": ()}) if link.name in given else link
        for link in links
    ]


def _tips(links: list[Link], additions: UrdfRobotFile | None) -> dict[str, Tip]:
    if additions and additions.tips is not None:
        return {key: Tip(link=tip.link, xyz=tip.xyz, rpy=tip.rpy) for key, tip in additions.tips.items()}
    return {link.name: Tip(link=link.name) for link in _leaves(links)}


def _leaves(links: list[Link]) -> Iterator[Link]:
    parents = {link.parent for link in links}
    return (link for link in links if link.name not in parents)
