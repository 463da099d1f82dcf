"""``--set a.b=v``: single values put over a document, their errors pointing at the option itself."""

from collections.abc import Sequence
from dataclasses import replace

from fzcli.errors import Problem, SpecError
from fzcli.spec.compose import compose
from fzcli.spec.document import Document, Node, Source, item_name
from fzcli.spec.nearest import hint, shown


def apply_sets(document: Document, sets: Sequence[str]) -> Document:
    """The document with every ``KEY=VALUE`` applied in order; the document itself is not changed.

    KEY is a dotted path; a list's item is named by its number (from 0) or its ``name``. VALUE is YAML.
    A key that does not exist yet is made: whether it may be there is for the model to say. null takes a key out.

    Raises:
        SpecError: no ``=``, a value that is not YAML, a path through a single value, or an item that
            the list does not have; all problems at once.
    """
    problems: list[Problem] = []
    root = document.root
    for text in sets:
        try:
            root = _applied(root, text)
        except SpecError as error:
            problems += error.problems
    if problems:
        raise SpecError(problems)
    return Document(root)


def _applied(root: Node, text: str) -> Node:
    name = f"--set {text}"
    key, equals, value = text.partition("=")
    key = key.strip()
    if not equals or not key:
        raise SpecError(Problem("write KEY=VALUE, such as controller.gain=100", file=name))
    if not value.strip():
        raise SpecError(Problem("has no value; write null for none, '' for empty text", key, name))
    if value.strip() in ("null", "~"):
        return _without(root, key.split("."))
    source = Source(name)
    try:
        node = _placeless(compose(Source(name, value)), source)
    except SpecError as error:
        raise SpecError([Problem(problem.message, key, name) for problem in error.problems]) from None
    return put(root, key.split("."), node, source, key)


def _without(node: Node, steps: list[str]) -> Node:
    """The node without the key at the steps, where it has one: null stands for none."""
    if not isinstance(node.content, dict):
        return node
    count = _key_length(node.content, steps)
    name = ".".join(steps[:count])
    if name not in node.content:
        return node
    if count == len(steps):
        return replace(node, content={key: child for key, child in node.content.items() if key != name})
    return replace(node, content={**node.content, name: _without(node.content[name], steps[count:])})


def _placeless(node: Node, source: Source) -> Node:
    """The node pointing at the option instead of at a line of it."""
    content = node.content
    if isinstance(content, dict):
        content = {key: _placeless(child, source) for key, child in content.items()}
    elif isinstance(content, list):
        content = [_placeless(child, source) for child in content]
    return Node(source, content=content)


def put(node: Node, steps: list[str], value: Node, source: Source, key: str) -> Node:
    """The node with ``value`` at the steps below it, mappings made on the way; ``key`` names it in errors.

    Raises:
        SpecError: a path through a single value, or an item that a list does not have.
    """
    if not steps:
        return value
    content = node.content
    if content is None or isinstance(content, bool):  # a switch stands for its section's defaults
        node = replace(node, source=source, line=None, column=None)
        content = {}
    if isinstance(content, list):
        index = _index(node, content, steps[0], source, key)
        below = put(content[index], steps[1:], value, source, key)
        return replace(node, content=[*content[:index], below, *content[index + 1 :]])
    if isinstance(content, dict):
        count = _key_length(content, steps)
        name = ".".join(steps[:count])
        child = content.get(name, Node(source))
        return replace(node, content={**content, name: put(child, steps[count:], value, source, key)})
    text = f"'{'.'.join(key.split('.')[: -len(steps)])}' is the single value {shown(content)}"
    raise SpecError(Problem(f"{text}; nothing lies inside it", key, source.name))


def _key_length(content: dict[str, Node], steps: list[str]) -> int:
    """How many steps make up the key: the longest existing one, all of them among dotted keys, or one."""
    for count in range(len(steps), 0, -1):
        if ".".join(steps[:count]) in content:
            return count
    return len(steps) if any("." in name for name in content) else 1


def _index(node: Node, content: list[Node], step: str, source: Source, key: str) -> int:
    if step.isdecimal() and int(step) < len(content):
        return int(step)
    names = [item_name(child) for child in content]
    if step in names:
        return names.index(step)
    known = [name for name in names if name]
    text = f"no item '{step}' among {len(content)}"
    if content:
        text += f", numbered from 0 to {len(content) - 1}"
    raise SpecError(Problem(text + hint(step, known, "named"), key, source.name))
