"""Names and files -> robots and rule bases, whichever dialect they are written in."""

from pathlib import Path

from fzcli.errors import Problem, SpecError
from fzcli.spec.dialects import from_dh, from_frames
from fzcli.spec.document import Document
from fzcli.spec.library import Folder, find
from fzcli.spec.nearest import shown
from fzcli.spec.parse import parse
from fzcli.spec.reader import read
from fzcli.spec.robot import Robot
from fzcli.spec.robot_file import DhRobotFile, RobotFile, UrdfRobotFile
from fzcli.spec.rulebase import Input, Output, Rulebase, RuleText, Term
from fzcli.spec.rulebase_file import RulebaseFile
from fzcli.spec.urdf import read_urdf

_DIALECTS = ("links", "dh", "urdf")


def load_robot(source: Path | str, beside: Path | None = None) -> Robot:
    """A robot by path (YAML or URDF; ``-`` is standard input) or by name (see ``library.find``).

    Raises:
        SpecError: every problem of the file, with its places.
    """
    path = _found("robots", source, beside)
    if path.suffix.lower() == ".urdf":
        return read_urdf(path)
    return robot_of(read(path))


def load_rulebase(source: Path | str, beside: Path | None = None) -> Rulebase:
    """A rule base by path (``-`` is standard input) or by name (see ``library.find``).

    The rules' text is kept with its places; the fuzzy room reads it.

    Raises:
        SpecError: every problem of the file, with its places.
    """
    return rulebase_of(read(_found("rulebases", source, beside)))


def _found(folder: Folder, source: Path | str, beside: Path | None) -> Path:
    if isinstance(source, Path) or source == "-":
        return Path(source)
    return find(folder, source, beside)


def check_kind(document: Document, *kinds: str) -> str:
    """The document's ``kind``.

    Raises:
        SpecError: it is not a mapping, or of none of these kinds.
    """
    value = document.value
    if not isinstance(value, dict):
        raise SpecError(document.problem(f"must be a mapping (key: value), got {shown(value)}"))
    wanted = " or ".join(kinds)
    if "kind" not in value:
        raise SpecError(document.problem(f"kind is missing; {wanted} is wanted"))
    if value["kind"] not in kinds:
        text = f"{wanted} is wanted, got {shown(value['kind'])}"
        raise SpecError(document.problem(text, ("kind",)))
    return str(value["kind"])


def robot_of(document: Document) -> Robot:
    """The robot that a document describes.

    Raises:
        SpecError: every problem of the document, with its places.
    """
    check_kind(document, "robot")
    present = [key for key in _DIALECTS if key in document.value]
    if len(present) != 1:
        have = f", has {' and '.join(present)}" if present else ""
        raise SpecError(document.problem(f"needs one of links, dh and urdf{have}"))
    name = document.path.stem if document.path else "robot"
    if present == ["dh"]:
        return from_dh(parse(document, DhRobotFile), document, name)
    if present == ["links"]:
        return from_frames(parse(document, RobotFile), document, name)
    file = parse(document, UrdfRobotFile)
    folder = document.path.parent if document.path else Path()
    path = folder / Path(file.urdf).expanduser()
    if not path.exists():
        raise SpecError(document.problem(f"no such file '{file.urdf}'", ("urdf",)))
    return read_urdf(path, file)


def rulebase_of(document: Document) -> Rulebase:
    """The rule base that a document describes.

    Raises:
        SpecError: every problem of the document, with its places.
    """
    check_kind(document, "rulebase")
    file = parse(document, RulebaseFile)
    problems = _outside(file, document)
    rules = []
    for index, text in enumerate(file.rules):
        line, column = document.text_place(("rules", index))
        if not text.strip():
            problems.append(document.problem("a rule without text", ("rules", index)))
        rules.append(RuleText(text=text, file=document.file, line=line, column=column))
    if problems:
        raise SpecError(problems)
    return Rulebase(
        name=file.name or (document.path.stem if document.path else ""),
        about=file.about,
        conjunction=file.conjunction,
        disjunction=file.disjunction,
        inputs={key: Input(range=item.range, terms=item.terms) for key, item in file.inputs.items()},
        outputs={key: Output(**dict(item)) for key, item in file.outputs.items()},
        rules=tuple(rules),
    )


def _outside(file: RulebaseFile, document: Document) -> list[Problem]:
    """Terms that reach past the range of their variable; a gaussian's tails may."""
    problems = []
    for section, variables in (("inputs", file.inputs), ("outputs", file.outputs)):
        for variable, item in variables.items():
            low, high = item.range
            for name, term in item.terms.items():
                for number in _reach(term):
                    if not low <= number <= high:
                        text = f"term {name} of {variable} reaches {number:g}"
                        text += f", outside the range {low:g} to {high:g}"
                        problems.append(document.problem(text, (section, variable, "terms", name)))
                        break
    return problems


def _reach(term: Term) -> tuple[float, ...]:
    return term.numbers[:1] if term.shape == "gaussian" else term.numbers
