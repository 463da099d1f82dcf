"""Names near a mistyped one: the end of every message about an unknown name."""

from collections.abc import Iterable
from difflib import get_close_matches


def hint(word: object, names: Iterable[object], what: str = "known") -> str:
    """``"; did you mean 'mass'?"`` when a name is near, else ``"; known: a, b"`` (empty without names)."""
    known = [str(name) for name in names]
    lower = {name.lower(): name for name in reversed(known)}
    near = get_close_matches(str(word).lower(), lower, n=1, cutoff=0.6)
    if near:
        return f"; did you mean '{lower[near[0]]}'?"
    if not known:
        return ""
    listed = ", ".join(known[:20]) + (", ..." if len(known) > 20 else "")
    return f"; {what}: {listed}"


def shown(value: object, width: int = 60) -> str:
    """A value as a message shows it: text in quotes, YAML's words for the rest, cut to ``width``."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a mapping"
    text = repr(value)
    return text if len(text) <= width else f"{text[: width - 4]} ..."
