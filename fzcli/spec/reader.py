"""The one door for YAML: files, standard input and texts become documents; values become text."""

import io
import sys
from pathlib import Path
from typing import Any

import yaml

from fzcli.errors import Problem, SpecError
from fzcli.spec.compose import compose
from fzcli.spec.document import Document, Source
from fzcli.spec.scalars import PATTERNS

MAX_BYTES = 10_000_000


def read(path: Path | str) -> Document:
    """Read one YAML file; ``-`` is standard input.

    Raises:
        SpecError: the file is missing, a directory, unreadable, binary, too large, empty or not YAML
            as fzcli reads it (see ``compose``).
    """
    if str(path) == "-":
        return read_text(_decode(sys.stdin.buffer.read(MAX_BYTES + 1), "<stdin>"), "<stdin>")
    return read_text(_decode(read_bytes(path), str(path)), str(path), Path(path))


def read_text(text: str, name: str = "<text>", path: Path | None = None) -> Document:
    """Read YAML text; ``name`` stands in messages, files named inside are looked for beside ``path``.

    Raises:
        SpecError: as ``read``.
    """
    if len(text) > MAX_BYTES:
        raise SpecError(Problem(f"is larger than {MAX_BYTES // 1_000_000} MB", file=name))
    return Document(compose(Source(name, text, path)))


def read_bytes(path: Path | str) -> bytes:
    """The bytes of a regular file (or pipe) of at most 10 MB.

    Raises:
        SpecError: it is missing, a directory, not readable or too large.
    """
    name = str(path)
    try:
        with Path(path).open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise SpecError(Problem("no such file", file=name)) from None
    except IsADirectoryError:
        raise SpecError(Problem("is a directory; name a file in it", file=name)) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SpecError(Problem(f"cannot be read: {reason}", file=name)) from None
    return _capped(data, name)


def _capped(data: bytes, name: str) -> bytes:
    if len(data) > MAX_BYTES:
        raise SpecError(Problem(f"is larger than {MAX_BYTES // 1_000_000} MB", file=name))
    return data


def _decode(data: bytes, name: str) -> str:
    _capped(data, name)
    if b"\0" in data:
        raise SpecError(Problem("is a binary file, not YAML text", file=name))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise SpecError(Problem(f"is not UTF-8 text (byte {error.start})", file=name, line=line)) from None


class _Dumper(yaml.SafeDumper):
    """Block style; short lists of scalars in one line; aliases never."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _float(dumper: yaml.SafeDumper, number: float) -> yaml.ScalarNode:
    words = {"inf": ".inf", "-inf": "-.inf", "nan": ".nan"}
    text = repr(float(number))
    return dumper.represent_scalar("tag:yaml.org,2002:float", words.get(text, text))


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    """Text; unusual line breaks escaped, for written raw they come back as other ones."""
    style = '"' if any(mark in text for mark in "\r\x85\u2028\u2029") else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.yaml_implicit_resolvers = {}  # YAML 1.1's; below, what this reader takes for other than text
for _tag, _pattern, _first in PATTERNS:
    _Dumper.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", _pattern, _first)
_Dumper.add_representer(str, _text)
_Dumper.add_multi_representer(float, _float)  # and NumPy's
_Dumper.add_representer(float, _float)
_Dumper.add_representer(tuple, lambda dumper, items: dumper.represent_list(items))


def dump(value: Any) -> str:
    """A plain Python value as YAML text that ``read_text`` gives back, floats exact, keys in order."""
    stream = io.StringIO()
    yaml.dump(
        value, stream, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=110, allow_unicode=True
    )
    return stream.getvalue()
