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


def without(document: Document, keys: Iterable[str], *inside: str) -> Document:
    """The document without these keys of its root mapping, or of the mapping at ``inside``."""
    return Document(_without(document.root, set(keys), inside))


def _without(node: Node, gone: set[str], inside: tuple[str, ...]) -> Node:
    content = node.content
    if not isinstance(content, dict):
        return node
    if not inside:
        return replace(node, content={key: value for key, value in content.items() if key not in gone})
    if inside[0] not in content:
        return node
    return replace(node, content={**content, inside[0]: _without(content[inside[0]], gone, inside[1:])})
