"""YAML text -> nodes with places, from PyYAML's event stream, in bounded time and memory.

Events rather than PyYAML's own node graph, so that depth, size and cycles are refused while reading.
"""

from dataclasses import dataclass

import yaml

from fzcli.errors import Problem, SpecError
from fzcli.spec.document import Node, Source
from fzcli.spec.nearest import shown
from fzcli.spec.scalars import plain_scalar

MAX_DEPTH = 64
MAX_NODES = 100_000

_KEY = "a key must be one word or number, not a list or a mapping"
_Loader: type = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass
class _Built:
    """A node with its size and height after aliases are expanded; ``open`` while its end is awaited."""

    node: Node
    size: int = 1
    height: int = 1
    open: bool = False
    key: str | None = None  # the key that waits for its value, in a mapping


class _Composer:
    def __init__(self, source: Source) -> None:
        self.source = source
        self.problems: list[Problem] = []
        self.stack: list[_Built] = []
        self.anchors: dict[str, _Built] = {}
        self.root: Node | None = None

    def problem(self, message: str, node: Node) -> Problem:
        snippet = self.source.snippet(node.line, node.column)
        return Problem(message, "", self.source.name, node.line, node.column, snippet)

    def take(self, event: yaml.Event) -> None:
        mark = event.start_mark
        node = Node(self.source)
        if mark is not None:
            node.line, node.column = mark.line + 1, mark.column + 1
        if isinstance(event, yaml.ScalarEvent):
            node.style = event.style or ""
            node.content = event.value
            self.start(event, node, is_open=False)
        elif isinstance(event, yaml.MappingStartEvent):
            node.content = {}
            self.start(event, node, is_open=True)
        elif isinstance(event, yaml.SequenceStartEvent):
            node.content = []
            self.start(event, node, is_open=True)
        elif isinstance(event, yaml.MappingEndEvent | yaml.SequenceEndEvent):
            done = self.stack.pop()
            done.open = False
            self.add(done)
        elif isinstance(event, yaml.AliasEvent):
            self.alias(str(event.anchor), node)
        elif isinstance(event, yaml.DocumentStartEvent) and self.root is not None:
            raise SpecError(self.problem("a second document starts here; put it into its own file", node))

    def start(self, event: yaml.NodeEvent, node: Node, *, is_open: bool) -> None:
        built = _Built(node, open=is_open)
        if event.anchor is not None:
            self.anchors[event.anchor] = built
        tag = getattr(event, "tag", None)
        if tag is not None:
            word = str(tag).replace("tag:yaml.org,2002:", "!!")
            self.problems.append(self.problem(f"tags such as {word} are not read here; remove it", node))
        if not is_open:
            self.scalar(built)
            return
        if self.waits_for_key():
            raise SpecError(self.problem(_KEY, node))
        self.stack.append(built)
        self.check_depth(len(self.stack), node)

    def scalar(self, built: _Built) -> None:
        node = built.node
        if "\0" in str(node.content):  # an escape makes one; no file of results holds it
            self.problems.append(self.problem("holds a NUL character; no text may", node))
        if not self.waits_for_key() and not node.style:
            try:
                node.content = plain_scalar(str(node.content))
            except ValueError as error:
                self.problems.append(self.problem(str(error), node))
        self.add(built)

    def alias(self, anchor: str, node: Node) -> None:
        target = self.anchors.get(anchor)
        if target is None:
            raise SpecError(self.problem(f"alias *{anchor} has no anchor &{anchor} before it", node))
        if target.open:
            raise SpecError(self.problem(f"alias *{anchor} lies inside its own anchor: a cycle", node))
        if self.waits_for_key() and isinstance(target.node.content, list | dict):
            raise SpecError(self.problem(_KEY, node))
        self.check_depth(len(self.stack) + target.height, node)
        self.add(target)

    def waits_for_key(self) -> bool:
        top = self.stack[-1] if self.stack else None
        return top is not None and isinstance(top.node.content, dict) and top.key is None

    def add(self, built: _Built) -> None:
        """Hand a finished node to the collection it lies in, counting its size and height."""
        if not self.stack:
            self.root = built.node
            return
        top, node = self.stack[-1], built.node
        top.size += built.size
        top.height = max(top.height, built.height + 1)
        if sum(part.size for part in self.stack) > MAX_NODES:
            text = f"more than {MAX_NODES} values, aliases written out; split the file"
            raise SpecError(self.problem(text, node))
        content = top.node.content
        if isinstance(content, list):
            content.append(node)
        elif isinstance(content, dict) and top.key is None:
            self.key(top, node, content)
        elif isinstance(content, dict) and top.key is not None:
            content.setdefault(top.key, node)
            top.key = None

    def key(self, top: _Built, node: Node, content: "dict[str, Node]") -> None:
        name = node.content if isinstance(node.content, str) else shown(node.content)
        top.key = name
        if name == "<<" and not node.style:
            self.problems.append(self.problem("merge keys (<<) are not YAML 1.2; write the keys out", node))
        if name in content:
            text = f"key '{name}' stands twice in one mapping, first in line {top.node.key_places[name][0]}"
            self.problems.append(self.problem(text, node))
        elif node.line is not None and node.column is not None:
            top.node.key_places[name] = (node.line, node.column)

    def check_depth(self, depth: int, node: Node) -> None:
        if depth > MAX_DEPTH:
            raise SpecError(self.problem(f"nested more than {MAX_DEPTH} levels deep", node))


def compose(source: Source) -> Node:
    """The root node of a source's text.

    Raises:
        SpecError: not YAML, a tag, a NUL character, a merge or duplicate key, an alias without anchor or in
            a cycle, more than one document, no document, or more depth or nodes than ``MAX_DEPTH`` and ``MAX_NODES``.
    """
    composer = _Composer(source)
    try:
        for event in yaml.parse(source.text or "", Loader=_Loader):
            composer.take(event)
    except yaml.MarkedYAMLError as error:
        raise SpecError(_syntax_problem(error, source)) from None
    except (yaml.YAMLError, UnicodeError) as error:
        reason = getattr(error, "reason", None) or "characters that text must not hold"
        raise SpecError(Problem(f"not YAML: {reason}", file=source.name)) from None
    if composer.problems:
        raise SpecError(composer.problems)
    if composer.root is None or composer.root.content is None:
        raise SpecError(Problem("is empty", file=source.name))
    return composer.root


def _syntax_problem(error: yaml.MarkedYAMLError, source: Source) -> Problem:
    mark = error.problem_mark or error.context_mark
    text = f"not YAML: {error.problem or error.context}"
    if error.context and error.problem:
        text += f" {error.context}"
    if mark is None:
        return Problem(text, file=source.name)
    line, column = mark.line + 1, mark.column + 1
    return Problem(text, "", source.name, line, column, source.snippet(line, column))
