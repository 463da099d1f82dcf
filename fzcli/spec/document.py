"""A read YAML text: its plain values, and the place in the text of each of them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from fzcli.errors import Problem
from fzcli.spec.scalars import Scalar

Step = str | int
Steps = tuple[Step, ...]
_BREAK = re.compile("\r\n|[\n\r\u0085\u2028\u2029]")
_SNIPPET_WIDTH = 100


@dataclass(frozen=True)
class Source:
    """Where nodes come from: a file's name and text; text is None where lines make no sense (--set)."""

    name: str
    text: str | None = None
    path: Path | None = None

    @cached_property
    def lines(self) -> list[str]:
        """The text's lines, without their ends."""
        return _BREAK.split(self.text or "")

    def snippet(self, line: int | None, column: int | None) -> str:
        """The line and a caret below the column, both indented by four; empty without a text."""
        if self.text is None or line is None or column is None or not 1 <= line <= len(self.lines):
            return ""
        start = max(0, column - 1 - _SNIPPET_WIDTH // 2) if column > _SNIPPET_WIDTH else 0
        shown = self.lines[line - 1][start : start + _SNIPPET_WIDTH].replace("\t", " ").rstrip()
        return f"    {shown}\n    {' ' * (column - 1 - start)}^"


@dataclass
class Node:
    """A YAML node: a scalar, a list or a mapping, with its place (line and column from 1).

    ``style`` is the scalar's quote or block mark; ``key_places`` say where a mapping's keys stand.
    """

    source: Source
    line: int | None = None
    column: int | None = None
    content: "Scalar | list[Node] | dict[str, Node]" = None
    style: str = ""
    key_places: dict[str, tuple[int, int]] = field(default_factory=dict)

    @property
    def value(self) -> Any:
        """The node as plain Python: dict, list, str, float, int, bool or None, freshly built."""
        if isinstance(self.content, dict):
            return {key: child.value for key, child in self.content.items()}
        if isinstance(self.content, list):
            return [child.value for child in self.content]
        return self.content

    def child(self, step: Step) -> "Node | None":
        """The node one step down, or None when there is none."""
        if isinstance(self.content, dict):
            return self.content.get(str(step))
        if isinstance(self.content, list) and isinstance(step, int) and 0 <= step < len(self.content):
            return self.content[step]
        return None


@dataclass(frozen=True)
class Document:
    """A YAML text (or a Python value that stands for one) with the place of every value in it."""

    root: Node

    @cached_property
    def value(self) -> Any:
        """The whole document as plain Python."""
        return self.root.value

    @property
    def file(self) -> str:
        """The file's name as the user gave it, ``<stdin>``, or the name of the text."""
        return self.root.source.name

    @property
    def path(self) -> Path | None:
        """The file's path, to resolve other files beside it; None for texts without one."""
        return self.root.source.path

    @property
    def text(self) -> str:
        """The YAML text as read (without overrides by --set)."""
        return self.root.source.text or ""

    def node(self, path: Sequence[Step]) -> Node:
        """The node at a path; where the path leads past the document, the deepest one on the way."""
        node = self.root
        for step in path:
            below = node.child(step)
            if below is None:
                return node
            node = below
        return node

    def place(self, path: Sequence[Step]) -> tuple[int | None, int | None]:
        """Line and column (from 1) of the value at a path, or of the deepest value on the way to it."""
        node = self.node(path)
        return node.line, node.column

    def text_place(self, path: Sequence[Step]) -> tuple[int | None, int | None]:
        """Line and column of the first character inside the text at a path, past quotes or a block mark."""
        node = self.node(path)
        if node.line is None or node.column is None:
            return None, None
        if node.style in ("'", '"'):
            return node.line, node.column + 1
        if node.style in ("|", ">"):
            for number, line in enumerate(node.source.lines[node.line :], node.line + 1):
                if line.strip():
                    return number, len(line) - len(line.lstrip()) + 1
        return node.line, node.column

    def field(self, path: Sequence[Step]) -> str:
        """A path as users write it, in --set too: dotted, list items by their name where they have one."""
        parts = []
        node: Node | None = self.root
        for step in path:
            parts.append(str(step) if node is None else _label(node, step))
            node = node.child(step) if node is not None else None
        return ".".join(parts)

    def problem(self, message: str, path: Sequence[Step] = (), *, at_key: bool = False) -> Problem:
        """A problem with the value at a path (or with its key), placed and with its line shown."""
        node = self.node(path)
        source, line, column = node.source, node.line, node.column
        if at_key and path:
            parent = self.node(path[:-1])
            line, column = parent.key_places.get(str(path[-1]), (line, column))
        return Problem(message, self.field(path), source.name, line, column, source.snippet(line, column))


def _label(node: Node, step: Step) -> str:
    """The item's own name when it is a plain one that no sibling has, else its number or key."""
    if not isinstance(node.content, list) or not isinstance(step, int):
        return str(step)
    name = item_name(node.child(step))
    alike = [child for child in node.content if item_name(child) == name] if name else []
    return name if name and len(alike) == 1 else str(step)


def item_name(node: Node | None) -> str | None:
    """The ``name`` of a list's item, when it can stand in a dotted path."""
    name = node.child("name") if node is not None and isinstance(node.content, dict) else None
    text = name.content if name is not None else None
    return text if isinstance(text, str) and text and "." not in text and not text.isdigit() else None


def document_of(value: Any, name: str = "<python>", path: Path | None = None) -> Document:
    """A plain Python value as a document without places, so that it passes the same checks.

    ``path`` is the file beside which other files are looked for.
    """
    return Document(node_of(value, Source(name, None, path)))


def node_of(value: Any, source: Source) -> Node:
    """A plain Python value (mappings, sequences, scalars) as nodes without places."""
    if isinstance(value, dict):
        return Node(source, content={str(key): node_of(item, source) for key, item in value.items()})
    if isinstance(value, list | tuple):
        return Node(source, content=[node_of(item, source) for item in value])
    return Node(source, content=value)
