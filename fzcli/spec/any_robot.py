"""Robots of either kind, trees of links and planar 3-RRRs, from files."""

from pathlib import Path

from fzcli.spec.document import Document
from fzcli.spec.library import find
from fzcli.spec.load import check_kind, robot_of
from fzcli.spec.parse import parse
from fzcli.spec.planar import Planar3RRR
from fzcli.spec.reader import read
from fzcli.spec.robot import Robot
from fzcli.spec.urdf import read_urdf

AnyRobot = Robot | Planar3RRR


def planar_of(document: Document) -> Planar3RRR:
    """The planar 3-RRR that a document describes.

    Raises:
        SpecError: every problem of the document, with its places.
    """
    check_kind(document, "planar_3rrr")
    found = parse(document, Planar3RRR)
    name = found.name or (document.path.stem if document.path else "planar_3rrr")
    return found.model_copy(update={"name": name})


def any_robot_of(document: Document) -> AnyRobot:
    """The robot of a document, a tree of links or a planar 3-RRR. Raises SpecError as their own readers."""
    return planar_of(document) if check_kind(document, "robot", "planar_3rrr") == "planar_3rrr" else robot_of(document)


def load_any_robot(source: Path | str, beside: Path | None = None) -> AnyRobot:
    """A robot of either kind by path or name (see ``library.find``).

    Raises:
        SpecError: every problem of the file, with its places.
    """
    path = Path(source) if isinstance(source, Path) or source == "-" else find("robots", source, beside)
    if path.suffix.lower() == ".urdf":
        return read_urdf(path)
    return any_robot_of(read(path))
