"""Configurations and their entries as short text, for headings, labels and notes."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

ABSENT = "-"  # heads what has no such entry
_LITERALS = ("true", "false", "null", ABSENT)


def leaves(entries: Mapping[str, Any]) -> dict[str, Any]:
    """The entries with nested mappings taken apart: dotted path -> value that is no mapping."""
    found: dict[str, Any] = {}
    for key, value in entries.items():
        inner = leaves(value) if isinstance(value, Mapping) else {}
        found |= {f"{key}.{rest}": one for rest, one in inner.items()} if inner else {key: value}
    return found


def shown(value: Any) -> str:
    """A value as the YAML file would have it, numbers as short as they are exact."""
    if isinstance(value, str):
        return value
    if isinstance(value, float) and float(f"{value:g}") == value:
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(shown(one) for one in value)}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {shown(one)}' for key, one in value.items())}}}"
    return json.dumps(value)


def spoken(path: str, value: Any) -> str:
    """An entry in words: names speak for themselves, all other values come with the last part of the path."""
    text = shown(value)
    is_name = isinstance(value, str) and text[:1].isalpha() and text not in _LITERALS
    return text if is_name else f"{path.rpartition('.')[2]} {text}"


def labels(
    entries: Sequence[Mapping[str, Any]], resolved: Callable[[], Sequence[Mapping[str, Any]]] = tuple
) -> list[str]:
    """What tells each set of entries from the others; two labels are equal when their sets are.

    A set that changes nothing is named by its ``resolved`` values of what the others change.
    """
    flat = [leaves(one) for one in entries]
    paths = dict.fromkeys(path for one in flat for path in one)
    telling = [path for path in paths if len({_key(one, path) for one in flat}) > 1]
    if not telling:
        return ["all runs"] * len(flat)
    named = [{path: one[path] for path in telling if path in one} for one in flat]
    runs = resolved() if not all(named) else ()
    for index, one in enumerate(map(leaves, runs)):
        named[index] = named[index] or {path: one[path] for path in telling if path in one}
    keys = [json.dumps(one, sort_keys=True) for one in flat]
    texts = [", ".join(spoken(*item) for item in one.items()) for one in named]
    if len(set(texts)) < len(set(keys)):
        texts = [", ".join(f"{path} {shown(value)}" for path, value in one.items()) for one in named]
    return _distinct(texts, keys)


def _distinct(texts: Sequence[str], keys: Sequence[str]) -> list[str]:
    """The texts, numbered where unlike keys have the same."""
    taken: dict[str, str] = {}
    for text, key in zip(texts, keys, strict=True):
        if key not in taken:
            alike = [one for one in taken.values() if one.partition(" (")[0] == (text or "unchanged")]
            taken[key] = f"{text or 'unchanged'} ({len(alike) + 1})" if alike else text or "unchanged"
    return [taken[key] for key in keys]


def _key(entries: Mapping[str, Any], path: str) -> str:
    return json.dumps(entries[path], sort_keys=True) if path in entries else ""
