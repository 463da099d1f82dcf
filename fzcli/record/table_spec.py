"""How a sweep asks to be tabulated: the ``table:`` section of its specification."""

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fzcli.errors import RecordError, UsageError

DEFAULT_LOST = "tip_error_max > 1e-2"
COUNTS = ("runs", "lost", "flagged", "failed")
_RULE = re.compile(r"\s*(?P<name>[A-Za-z_]\w*)\s*(?P<sign><=|>=|<|>)\s*(?P<limit>[-+0-9.eE]+)\s*")


@dataclass(frozen=True)
class TableSpec:
    """Which configuration entry goes down the rows, which across, and which metrics are shown.

    ``configuration``, which rows are where none are named, stands for all that a configuration changes
    beside the entry on the other axis; entries that only go along with that one are left out.
    ``show`` may name counts (runs, lost, flagged, failed) beside metrics; they are always given.
    ``lost`` is the condition that counts a run as lost. ``beside_text`` is the text of the CSV file
    ``beside``: published numbers by row, column and metric.
    """

    rows: str = "configuration"
    columns: str | None = None
    show: tuple[str, ...] = ()
    lost: str | None = None
    beside: str | None = None
    beside_text: str = ""

    @classmethod
    def of(cls, section: Any, folders: tuple[Path, ...] = ()) -> "TableSpec":
        """From the section, a mapping or a model with these fields; ``beside`` is sought in ``folders``.

        Raises:
            UsageError: an entry is unknown, or rows are empty.
            RecordError: the file beside is missing.
        """
        if isinstance(section, TableSpec):
            return section
        fields = dict(section) if isinstance(section, Mapping) else section.model_dump()
        unknown = set(fields) - {"rows", "columns", "show", "lost", "beside"}
        if unknown or not fields.setdefault("rows", cls.rows):
            detail = (
                f"unknown entry {sorted(unknown)[0]!r}" if unknown else "rows: empty, name an entry of the grid or list"
            )
            raise UsageError(f"table: {detail}; it takes rows, columns, show, lost, beside")
        fields["show"] = tuple(fields.get("show") or ())
        beside = fields.get("beside")
        return cls(**fields, beside_text=_read_beside(str(beside), folders) if beside else "")

    def to_json(self) -> str:
        """The section as JSON, without the text of the file beside."""
        fields = asdict(self)
        del fields["beside_text"]
        return json.dumps(fields)

    @classmethod
    def from_json(cls, text: str, beside_text: str = "") -> "TableSpec":
        """The section that ``to_json`` wrote."""
        fields = json.loads(text)
        return cls(**{**fields, "show": tuple(fields["show"])}, beside_text=beside_text)

    @property
    def metrics(self) -> tuple[str, ...]:
        """What is shown, without the counts."""
        return tuple(name for name in self.show if name not in COUNTS)


def _read_beside(name: str, folders: tuple[Path, ...]) -> str:
    for folder in (*folders, Path()):
        path = folder / name
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise RecordError(f"table: beside: {name}: no such file")


@dataclass(frozen=True)
class LostRule:
    """A comparison of one metric with a limit; a run of which it cannot be told counts as lost."""

    name: str
    sign: str
    limit: float

    @classmethod
    def parse(cls, text: str) -> "LostRule":
        """From text such as ``tip_error_max > 1e-2``.

        Raises:
            UsageError: the text is not a metric, a sign and a number.
        """
        match = _RULE.fullmatch(text)
        try:
            if match:
                return cls(match["name"], match["sign"], float(match["limit"]))
        except ValueError:
            pass
        raise UsageError(f"table: lost: {text!r} is not of the form METRIC > NUMBER (or >=, <, <=)")

    def __str__(self) -> str:
        return f"{self.name} {self.sign} {self.limit:g}"
