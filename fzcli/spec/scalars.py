"""What a plain YAML scalar means: the core schema of YAML 1.2, in which OFF and yes are text."""

import re

Scalar = None | bool | int | float | str

_NULL = re.compile(r"|~|null|Null|NULL")
_BOOL = re.compile(r"true|True|TRUE|false|False|FALSE")
_INT = re.compile(r"[-+]?[0-9]+")
_OCTAL = re.compile(r"0o[0-7]+")
_HEX = re.compile(r"0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INF = re.compile(r"[-+]?\.(inf|Inf|INF)")
_NAN = re.compile(r"\.(nan|NaN|NAN)")
_MAX_CHARACTERS = 400  # more than any float64 needs; Python itself refuses integers of 4300


def _whole(pattern: re.Pattern[str]) -> re.Pattern[str]:
    return re.compile(rf"(?:{pattern.pattern})\Z")


# tag, pattern, first characters: what a writer has to put in quotes to keep it text
PATTERNS: tuple[tuple[str, re.Pattern[str], list[str]], ...] = (
    ("null", _whole(_NULL), ["", "~", "n", "N"]),
    ("bool", _whole(_BOOL), list("tTfF")),
    ("int", _whole(_INT), list("+-0123456789")),
    ("int", _whole(_OCTAL), ["0"]),
    ("int", _whole(_HEX), ["0"]),
    ("float", _whole(_FLOAT), list("+-.0123456789")),
    ("float", _whole(_INF), list("+-.")),
    ("float", _whole(_NAN), ["."]),
    ("merge", re.compile(r"<<\Z"), ["<"]),
)


def plain_scalar(text: str) -> Scalar:
    """The value of an unquoted scalar (YAML 1.2.2, section 10.3.2).

    Raises:
        ValueError: a number of more than 400 characters.
    """
    if _NULL.fullmatch(text):
        return None
    if _BOOL.fullmatch(text):
        return text.lower() == "true"
    if text[0] not in "+-.0123456789":
        return text
    return _number(text)


def _number(text: str) -> int | float | str:
    is_float = _FLOAT.fullmatch(text) is not None
    if is_float and len(text) > _MAX_CHARACTERS:
        raise ValueError(f"a number of {len(text)} characters is too long")
    if _INT.fullmatch(text):
        return int(text)
    if is_float:
        return float(text)
    if _OCTAL.fullmatch(text):
        return int(text[2:], 8)
    if _HEX.fullmatch(text):
        return int(text[2:], 16)
    if _INF.fullmatch(text):
        return float("-inf" if text[0] == "-" else "inf")
    return float("nan") if _NAN.fullmatch(text) else text
