"""The identity of a resolved spec."""

import hashlib
import json
from pathlib import PurePath
from typing import Any

from pydantic import BaseModel


def spec_hash(value: Any) -> str:
    """SHA-256 (hex) of a spec's canonical JSON: independent of key order, floats to the last bit.

    ``value`` is a model or plain Python; paths count as their text, tuples as lists.

    Raises:
        ValueError: a number that is not finite.
        TypeError: a value that JSON has no word for.
    """
    text = json.dumps(
        value, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False, default=_plain
    )
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return {name: getattr(value, name) for name in type(value).model_fields}
    if isinstance(value, PurePath):
        return str(value)
    raise TypeError(f"cannot hash a {type(value).__name__}")
