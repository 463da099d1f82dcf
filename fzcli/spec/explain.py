"""pydantic's error types in plain words: the rule, the value, and the nearest valid name."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel

from fzcli.spec.document import Steps
from fzcli.spec.nearest import hint, shown

MISSING = "is missing"
_WANTED = {
    "string": "text",
    "float": "a number",
    "decimal": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "list": "a list",
    "tuple": "a list",
    "set": "a list",
    "dict": "a mapping",
    "mapping": "a mapping",
    "model": "a mapping",
    "dataclass": "a mapping",
    "none": "nothing",
}
_BOUNDS = {
    "greater_than": (">", "gt"),
    "greater_than_equal": (">=", "ge"),
    "less_than": ("<", "lt"),
    "less_than_equal": ("<=", "le"),
    "multiple_of": ("a multiple of", "multiple_of"),
}


@dataclass(frozen=True)
class Fault:
    """One of pydantic's errors: its type, location, message, input and context."""

    type: str
    loc: tuple[int | str, ...]
    message: str
    input: Any
    context: dict[str, Any]


def explain(fault: Fault, model: Any) -> tuple[str, Steps, bool]:
    """The message; steps below the fault's location to point at; whether the key itself is at fault."""
    special = _SPECIAL.get(fault.type)
    if special is not None:
        return special(fault, model)
    return _plain(fault), (), fault.loc[-1:] == ("[key]",)


def _plain(fault: Fault) -> str:
    got = f", got {shown(fault.input)}"
    if fault.type in _BOUNDS:
        word, key = _BOUNDS[fault.type]
        return f"must be {word} {fault.context[key]}{got}"
    if fault.type in ("value_error", "assertion_error"):
        return str(fault.context["error"])
    if fault.type == "finite_number":
        return f"must be a finite number{got}"
    if fault.type in ("too_short", "too_long"):
        return _length(fault)
    if fault.type in ("literal_error", "enum"):
        near = hint(fault.input, re.findall(r"'([^']*)'", fault.context["expected"]))
        return f"must be {fault.context['expected']}{got}{near if 'did you mean' in near else ''}"
    noun = fault.type.partition("_")[0]
    if fault.type.endswith(("_type", "_parsing", "_from_float", "_attributes_type")) and noun in _WANTED:
        return f"must be {_WANTED[noun]}{got}"
    text = fault.message.removeprefix("Input ").rstrip(".")
    return f"{text[:1].lower()}{text[1:]}{got}"


def _length(fault: Fault) -> str:
    short = fault.type == "too_short"
    bound = fault.context["min_length" if short else "max_length"]
    items = "item" if bound == 1 else "items"
    return f"needs {'at least' if short else 'at most'} {bound} {items}, has {fault.context['actual_length']}"


def _unknown_key(fault: Fault, model: Any) -> tuple[str, Steps, bool]:
    names: list[str] = []
    for found in models_at(model, fault.loc[:-1]):
        names += [field.alias or name for name, field in found.model_fields.items()]
    return "unknown key" + hint(fault.loc[-1], dict.fromkeys(names), "known keys"), (), True


def _missing(fault: Fault, model: Any) -> tuple[str, Steps, bool]:
    if isinstance(fault.loc[-1], int):
        has = len(fault.input) if isinstance(fault.input, list | tuple) else fault.loc[-1]
        return f"needs {fault.context['needed']} items, has {has}", (), False
    return MISSING, (), False


def _unknown_kind(fault: Fault, model: Any) -> tuple[str, Steps, bool]:
    key = str(fault.context["discriminator"]).strip("'")
    known = re.findall(r"'([^']*)'", fault.context["expected_tags"])
    tag = str(fault.context["tag"])
    near = hint(tag, known)
    listed = f" (known: {', '.join(known)})" if "did you mean" in near else ""
    return f"unknown {key} '{tag}'{near}{listed}", (key,), False


def _no_kind(fault: Fault, model: Any) -> tuple[str, Steps, bool]:
    key = str(fault.context["discriminator"]).strip("'")
    kinds: list[str] = []
    for found in models_at(model, fault.loc):
        field = found.model_fields.get(key)
        kinds += [str(word) for word in get_args(field.annotation)] if field else []
    return f"is missing; one of {', '.join(dict.fromkeys(kinds))}", (key,), False


_SPECIAL: dict[str, Callable[[Fault, Any], tuple[str, Steps, bool]]] = {
    "extra_forbidden": _unknown_key,
    "missing": _missing,
    "union_tag_invalid": _unknown_kind,
    "union_tag_not_found": _no_kind,
}


def models_at(kind: Any, loc: tuple[int | str, ...]) -> Iterator[type[BaseModel]]:
    """The models that may stand at a location of pydantic's, in which unions leave their tags."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        yield from models_at(arguments[0], loc)
    elif origin in (Union, UnionType):
        yield from _union_models(arguments, loc)
    elif origin in (list, tuple, set, frozenset, dict):
        for argument in arguments if loc else ():
            yield from models_at(argument, loc[1:])
    elif isinstance(kind, type) and issubclass(kind, BaseModel):
        if not loc:
            yield kind
        for name, field in kind.model_fields.items():
            if loc and loc[0] in (name, field.alias):
                yield from models_at(field.annotation, loc[1:])


def _union_models(arms: tuple[Any, ...], loc: tuple[int | str, ...]) -> Iterator[type[BaseModel]]:
    tagged = [arm for arm in arms if loc and loc[0] in _tags(arm)]
    for arm in tagged or arms:
        yield from models_at(arm, loc[1:] if tagged else loc)


def _tags(arm: Any) -> set[Any]:
    """What pydantic may write into a location for this arm: its kind, its tag or its class's name."""
    tags = {getattr(extra, "tag", None) for extra in getattr(arm, "__metadata__", ())}
    model = get_args(arm)[0] if get_origin(arm) is Annotated else arm
    if isinstance(model, type) and issubclass(model, BaseModel):
        tags.add(model.__name__)
        for field in model.model_fields.values():
            if get_origin(field.annotation) is Literal:
                tags.update(get_args(field.annotation))
    return tags - {None}
