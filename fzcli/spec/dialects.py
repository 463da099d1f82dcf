"""Robot files in frames and DH tables -> the one normalised robot."""

import numpy as np

from fzcli.errors import Problem
from fzcli.spec.document import Document, Steps
from fzcli.spec.physics import Array, rotation_of, rpy_of, snapped, tensor, turned_inertia, vector
from fzcli.spec.robot import Base, Frame, Friction, Joint, Link, Robot, Tip
from fzcli.spec.robot_file import (
    BaseFile,
    DhRobotFile,
    FrameFile,
    FrictionFile,
    JointFile,
    LinkFile,
    RobotFile,
    RowFile,
)
from fzcli.spec.shapes import placed
from fzcli.spec.tree import arranged

NO_INERTIA = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def from_frames(file: RobotFile, document: Document, name: str) -> Robot:
    """A robot written as explicit frames.

    Raises:
        SpecError: what ``tree.arranged`` finds.
    """
    before = ["base", *(link.name for link in file.links)]
    links = [_link(link, parent) for link, parent in zip(file.links, before, strict=False)]
    tips = {key: Tip(link=tip.link, xyz=tip.xyz, rpy=tip.rpy) for key, tip in file.tips.items()}
    return Robot(
        name=file.name or name,
        about=file.about,
        base=base_of(file.base),
        links=arranged(links, tips, document.problem),
        tips=tips,
    )


def base_of(base: BaseFile) -> Base:
    """The normalised base; a fixed one without mass counts as massless, which nothing asks for."""
    inertia = base.inertia or NO_INERTIA
    return Base(
        floating=base.floating,
        mass=base.mass or 0.0,
        com=base.com,
        inertia=inertia,
        collision=base.collision,
    )


def frame_of(frame: FrameFile) -> Frame:
    """The normalised frame."""
    return Frame(xyz=frame.xyz, rpy=frame.rpy)


def _link(link: LinkFile, before: str) -> Link:
    return Link(
        name=link.name,
        parent=link.parent or before,
        at=frame_of(link.at),
        joint=_joint(link.joint, f"{link.name}_joint"),
        mass=link.mass,
        com=link.com,
        inertia=link.inertia or NO_INERTIA,
        collision=link.collision,
    )


def _joint(joint: JointFile, default: str) -> Joint:
    return Joint(
        name=joint.name or default,
        type=joint.type,
        axis=joint.axis,
        position=joint.position,
        speed=joint.speed,
        effort=joint.effort,
        friction=friction_of(joint.friction),
    )


def friction_of(friction: FrictionFile | None) -> Friction | None:
    """The normalised friction."""
    if friction is None:
        return None
    return Friction(viscous=friction.viscous, coulomb=friction.coulomb, smoothing=friction.smoothing)


def from_dh(file: DhRobotFile, document: Document, name: str) -> Robot:
    """A robot written as a standard DH table.

    Joint i moves about (or along) z of DH frame i-1, so link i's frame is DH frame i-1 carried by q_i;
    DH frame i stands in it at ``A_i(q_i = 0)``, through which com, inertia, collision and tips pass.

    Raises:
        SpecError: what ``tree.arranged`` finds.
    """
    rows = file.dh.rows
    links, at, parent = [], frame_of(file.base.mount), "base"
    for row in rows:
        after = dh_transform(row)
        links.append(_row_link(row, parent, at, after))
        parent = links[-1].name
        at = Frame(xyz=vector(after[:3, 3]), rpy=rpy_of(after[:3, :3]))
    tips = {}
    names = {key: index for index, row in enumerate(rows) for key in (row.name, links[index].name)}
    for key, tip in file.tips.items():
        index = len(rows) - 1 if tip.link is None else names.get(tip.link)
        if index is None:  # left for the tree's check to refuse, with the rows' names
            tips[key] = Tip(link=str(tip.link), xyz=tip.xyz, rpy=tip.rpy)
            continue
        after = dh_transform(rows[index])
        turn = snapped(after[:3, :3] @ rotation_of(tip.rpy))
        xyz = vector(after[:3, :3] @ tip.xyz + after[:3, 3])
        tips[key] = Tip(link=links[index].name, xyz=xyz, rpy=rpy_of(turn))

    def report(message: str, path: Steps) -> Problem:
        return document.problem(message, _table_path(path))

    base = base_of(file.base)
    ordered = arranged(links, tips, report)
    return Robot(name=file.name or name, about=file.about, base=base, links=ordered, tips=tips)


def _table_path(path: Steps) -> Steps:
    """Where a path into links leads in a DH table."""
    if path[0] != "links":
        return path
    if len(path) > 2 and path[2] == "joint":
        path = (*path[:2], *path[3:])
    return ("dh", "rows", *path[1:])


def dh_transform(row: RowFile) -> Array:
    """``Rz(theta) Tz(d) Tx(a) Rx(alpha)`` (4, 4): DH frame i in frame i-1 at q = 0."""
    turn = rotation_of((0.0, 0.0, row.theta))
    transform = np.eye(4)
    transform[:3, :3] = snapped(turn @ rotation_of((row.alpha, 0.0, 0.0)))
    transform[:3, 3] = turn @ (row.a, 0.0, row.d)
    return transform


def _row_link(row: RowFile, parent: str, at: Frame, after: Array) -> Link:
    turn = after[:3, :3]
    return Link(
        name=row.link or f"{row.name}_link",
        parent=parent,
        at=at,
        joint=Joint(
            name=row.name,
            type=row.type,
            position=row.position,
            speed=row.speed,
            effort=row.effort,
            friction=friction_of(row.friction),
        ),
        mass=row.mass,
        com=vector(turn @ row.com + after[:3, 3]),
        inertia=turned_inertia(turn, tensor(row.inertia or NO_INERTIA)),
        collision=tuple(placed(shape, turn, after[:3, 3]) for shape in row.collision),
    )
