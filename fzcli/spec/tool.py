"""A tool on a robot's tip: the tip moves to its end, and it is a solid as the link that carries it."""

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from fzcli.errors import Problem, SpecError
from fzcli.spec.nearest import hint
from fzcli.spec.physics import Array, rotation_of, rpy_of, snapped, vector
from fzcli.spec.robot import Frame, Link, Robot, Tip, Vector3
from fzcli.spec.shapes import Angles, CapsuleShape, Extent, Point, Shape

TOUCHING = 1e-9  # [m] an end of a capsule this close to the tip ends at it


class Tool(Frame):
    """A rigid tool without mass: the pose of its end in the tip's frame, and how thick it is."""

    xyz: Point = (0.0, 0.0, 0.0)
    rpy: Angles = (0.0, 0.0, 0.0)
    radius: Annotated[
        Extent | None, Field(description="[m] of the capsule from tip to end; default: that of the capsule before it")
    ] = None


def with_tool(robot: Robot, tool: Tool, tip: str | None = None) -> Robot:
    """The robot with a tip (the first by default) moved to the end of a tool and the tool as a capsule.

    The capsule that ends at the tip is lengthened where the tool goes straight on with its radius;
    otherwise the tool is a capsule of its own. A robot without any solids gets none.

    Raises:
        SpecError: an unknown tip, or nothing says how thick the tool is.
    """
    name = next(iter(robot.tips)) if tip is None else tip
    if name not in robot.tips:
        raise SpecError(Problem(f"no tip '{name}'{hint(name, robot.tips, 'known tips')}", field="tip"))
    old = robot.tips[name]
    turn = rotation_of(old.rpy)
    end = vector(np.array(old.xyz) + turn @ tool.xyz)
    tips = {**robot.tips, name: Tip(link=old.link, xyz=end, rpy=rpy_of(snapped(turn @ rotation_of(tool.rpy))))}
    solid = robot.base.collision or any(link.collision for link in robot.links)
    links = robot.links
    if solid and math.dist(old.xyz, end) > TOUCHING:
        links = tuple(_thickened(link, old.xyz, end, tool) if link.name == old.link else link for link in links)
    return robot.model_copy(update={"tips": tips, "links": links})


def _thickened(link: Link, tip: Vector3, end: Vector3, tool: Tool) -> Link:
    """The link with the tool among its solids."""
    for index, shape in enumerate(link.collision):
        capsule = shape.capsule
        if capsule is None or not _ends_at(capsule, tip):
            continue
        start = capsule.end if math.dist(capsule.start, tip) < TOUCHING else capsule.start
        radius = tool.radius or capsule.radius
        if radius == capsule.radius and _straight(np.array(start), np.array(tip), np.array(end)):
            longer = Shape(capsule=CapsuleShape(start=start, end=end, radius=radius))
            solids = (*link.collision[:index], longer, *link.collision[index + 1 :])
        else:
            solids = (*link.collision, Shape(capsule=CapsuleShape(start=tip, end=end, radius=radius)))
        return link.model_copy(update={"collision": solids})
    if tool.radius is None:
        text = f"radius is missing: no capsule of link '{link.name}' ends at the tip to say how thick the tool is"
        raise SpecError(Problem(text, field="tool"))
    own = Shape(capsule=CapsuleShape(start=tip, end=end, radius=tool.radius))
    return link.model_copy(update={"collision": (*link.collision, own)})


def _ends_at(capsule: CapsuleShape, tip: Vector3) -> bool:
    return min(math.dist(capsule.start, tip), math.dist(capsule.end, tip)) < TOUCHING


def _straight(start: Array, tip: Array, end: Array) -> bool:
    """Whether the way from start over tip to end never turns."""
    before, after = tip - start, end - tip
    along = float(before @ after)
    across = float(np.linalg.norm(np.cross(before, after)))
    return along > 0 and across < TOUCHING * float(np.linalg.norm(before))
