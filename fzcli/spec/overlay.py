"""Documents with single values put over them or taken out, every value keeping the place it came from."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from fzcli.spec.document import Document, Node, Source, node_of
from fzcli.spec.sets import put


def overlaid(document: Document, values: Mapping[str, Any]) -> Document:
    """The document with each dotted path set to a value: a Node (it keeps its place) or plain Python.

    Raises:
        SpecError: a path that leads through a single value or past a list's end.
    """
    root = document.root
    for path, value in values.items():
        source = value.source if isinstance(value, Node) else Source(document.file)
        node = value if isinstance(value, Node) else node_of(value, source)
        root = put(root, path.split("."), node, source, path)
    return Document(root)


def without(document: Document, keys: Iterable[str], inside: str = "") -> Document:
    """The document without these keys of its root mapping, or of the mapping ``inside``."""
    root = document.root
    gone = set(keys)
    if not isinstance(root.content, dict):
        return document
    if not inside:
        return Document(replace(root, content={k: v for k, v in root.content.items() if k not in gone}))
    section = root.content.get(inside)
    if section is None or not isinstance(section.content, dict):
        return document
    kept = replace(section, content={k: v for k, v in section.content.items() if k not in gone})
    return Document(replace(root, content={**root.content, inside: kept}))
