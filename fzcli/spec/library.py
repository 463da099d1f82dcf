"""Where robots, rule bases and runs are found by name, and the copy that ``fzcli init`` makes."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from fzcli.errors import Problem, SpecError, UsageError
from fzcli.spec.nearest import hint
from fzcli.spec.schema import json_schema

Folder = Literal["robots", "rulebases", "runs"]
FOLDERS: tuple[Folder, ...] = ("robots", "rulebases", "runs")
_SUFFIXES: dict[Folder, tuple[str, ...]] = {
    "robots": (".yaml", ".yml", ".urdf"),
    "rulebases": (".yaml", ".yml"),
    "runs": (".yaml", ".yml"),
}
_COPIED = (".yaml", ".yml", ".urdf", ".csv")
_KIND = re.compile(r"^kind: *(\w+)", re.MULTILINE)
_KINDS_IN: dict[Folder, tuple[str, ...]] = {
    "robots": ("robot", "planar_3rrr"),
    "rulebases": ("rulebase",),
    "runs": ("simulate", "sweep", "plan", "train"),
}
_KINDS = tuple(kind for kinds in _KINDS_IN.values() for kind in kinds)
_NOUNS: dict[Folder, str] = {"robots": "robot", "rulebases": "rule base", "runs": "run"}


def shipped_root() -> Path:
    """The folder that holds the shipped robots, rulebases and runs: in the wheel, or the source tree."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "shipped"
    return inside if inside.is_dir() else package.parent


def find(folder: Folder, name: str, beside: Path | None = None) -> Path:
    """The file that a name means.

    ``beside`` is the file that holds the name, or its folder; without one, the working directory.
    A name with a folder or an ending is a path, from there, else from the working directory. A bare
    name is looked for there, in the folder ``robots`` (``rulebases``, ``runs``) in it, next to it and
    in the working directory, and last among the shipped files. A file that says it is of another kind is passed over.

    Raises:
        SpecError: there is none; the nearest names are given.
    """
    near = Path() if beside is None else beside if beside.is_dir() else beside.parent
    path = Path(name).expanduser()
    if path.suffix or len(path.parts) > 1:
        places = [near / path, path]
        for place in places:
            if place.exists():
                return place
        names = sorted(item.name for item in _files(folder, places[0].parent))
        raise SpecError(Problem(f"no such file '{name}'{hint(path.name, names, 'there are')}"))
    places = [near, near / folder, near / ".." / folder, Path() / folder, shipped_root() / folder]
    for place in places:
        for suffix in _SUFFIXES[folder]:
            found = place / f"{name}{suffix}"
            if name and found.is_file() and not _same(found, beside) and not _other_kind(found, folder):
                return found
    known = {item.stem for place in places[1:] for item in _files(folder, place)}
    raise SpecError(Problem(f"no {_NOUNS[folder]} named '{name}'{hint(name, sorted(known))}"))


def _same(found: Path, beside: Path | None) -> bool:
    return beside is not None and beside.exists() and found.samefile(beside)


def _other_kind(found: Path, folder: Folder) -> bool:
    """Whether the file says that it is of another kind: the run r3 beside a run is not the robot r3."""
    if found.suffix == ".urdf" or found.resolve().parent.name == folder:
        return False
    try:
        said = _KIND.search(found.read_text(encoding="utf-8", errors="replace")[:100_000])
    except OSError:
        return False
    return said is not None and said[1] in _KINDS and said[1] not in _KINDS_IN[folder]


def _files(folder: Folder, place: Path) -> Iterator[Path]:
    """The files of a kind in a place; none when the place is no readable folder."""
    try:
        yield from sorted(item for item in place.iterdir() if item.suffix in _SUFFIXES[folder])
    except OSError:
        return


def init(directory: Path | str, schemas: Mapping[str, Mapping[str, Any]] | None = None) -> list[Path]:
    """Copy the shipped robots, rulebases and runs into a directory, with JSON Schemas for editors.

    The schemas of robots and rule bases, and of what else ``schemas`` maps to one, are written as
    ``schemas/KIND.json``, where the first line of each shipped file names them. Returns the files written.

    Raises:
        UsageError: one of the files exists already (nothing is written then), or cannot be written.
    """
    target = Path(directory)
    contents: dict[Path, bytes] = {}
    for folder in FOLDERS:
        for item in sorted((shipped_root() / folder).glob("*")):
            if item.is_file() and item.suffix in _COPIED:
                contents[target / folder / item.name] = item.read_bytes()
    own = {
        "robot": json_schema("robot"),
        "planar_3rrr": json_schema("planar_3rrr"),
        "rulebase": json_schema("rulebase"),
    }
    for kind, schema in {**own, **(schemas or {})}.items():
        contents[target / "schemas" / f"{kind}.json"] = schema_text(schema).encode()
    present = [str(path) for path in contents if path.exists()]
    if present:
        more = f" and {len(present) - 1} more" if len(present) > 1 else ""
        raise UsageError(f"{present[0]}{more} exist already; nothing was written, name another directory")
    try:
        for path, data in contents.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    except OSError as error:
        raise UsageError(f"cannot write to {directory}: {error.strerror}") from None
    return list(contents)


def schema_text(schema: Mapping[str, Any]) -> str:
    """A JSON Schema as the text of its file."""
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"
