"""Where each configuration stands in a table, and which runs of two columns make a pair."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import FzcliError
from fzcli.record.labels import ABSENT, labels, leaves, shown
from fzcli.record.sweep_record import SweepRecord

Value = str | float
Place = tuple[Value, Value]
CONFIGURATION = "configuration"  # an axis with a heading for all that a configuration changes
_NOTHING = object()


@dataclass(frozen=True)
class Places:
    """The headings down and across, and of each configuration its ``place`` and ``kind``.

    Configurations of one row and one kind differ only in what parts the columns. ``notes``: over what
    cells are pooled.
    """

    rows: tuple[Value, ...]
    columns: tuple[Value, ...]
    place: tuple[Place, ...]
    kind: tuple[int, ...]
    notes: tuple[str, ...]

    def members(self, record: SweepRecord) -> dict[Place, NDArray[np.intp]]:
        """Indices of the runs of every cell that has any, row by row."""
        config = record.metrics["config"]
        found = {}
        for place in ((row, column) for row in self.rows for column in self.columns):
            chosen = [index for index, one in enumerate(self.place) if one == place]
            found[place] = np.flatnonzero(np.isin(config, chosen))
        return {place: chosen for place, chosen in found.items() if chosen.size}

    def pair_numbers(self, record: SweepRecord) -> NDArray[np.int64]:
        """A number a run, which two runs of a row share when they are of one kind and one trajectory."""
        trajectory = np.asarray(record.metrics["trajectory"], dtype=np.int64)
        span = int(trajectory.max(initial=0)) + 1
        kind = np.array(self.kind, dtype=np.int64)
        return kind[np.asarray(record.metrics["config"], dtype=np.int64)] * span + trajectory


def places_of(record: SweepRecord, rows: str, columns: str | None) -> Places:
    """The places of a sweep's configurations by the entries that go down and across.

    A configuration that does not set an entry stands under the value which its complete run has.
    """
    varied = _Varied(record)
    down = varied.headings(rows, columns)
    across = varied.headings(columns, None if columns == rows else rows) if columns else [""] * len(down)
    place = tuple(zip(down, across, strict=True))
    kinds = _kinds(varied, place)
    numbers = {text: number for number, text in enumerate(dict.fromkeys(kinds))}
    notes = [_note(path, varied.values[path], place) for path in varied.within(place)]
    if len(set(zip(place, kinds, strict=True))) < len(place):
        notes.append("some cells pool configurations that do not differ")
    return Places(
        rows=tuple(dict.fromkeys(down)),
        columns=tuple(dict.fromkeys(across)),
        place=place,
        kind=tuple(numbers[text] for text in kinds),
        notes=tuple(notes),
    )


def _kinds(varied: "_Varied", place: Sequence[Place]) -> list[str]:
    """Of every configuration, as text, its values of the entries over which cells of its row are pooled."""
    found = [""] * len(place)
    for row in dict.fromkeys(row for row, _ in place):
        inside = [index for index, (one, _) in enumerate(place) if one == row]
        pooled = varied.within(place, inside)
        for index in inside:
            found[index] = json.dumps([shown(varied.values[path][index]) for path in pooled])
    return found


def has_entry(config: Mapping[str, Any], path: str) -> bool:
    """Whether a configuration sets this entry, by itself or within a mapping."""
    return _entry(config, path) is not _NOTHING


def _entry(entries: Any, path: str) -> Any:
    """The value at a dotted path through mappings whose keys may have dots themselves."""
    if isinstance(entries, Sequence) and not isinstance(entries, str):
        entries = {str(index): value for index, value in enumerate(entries)}
    if not isinstance(entries, Mapping):
        return _NOTHING
    if path in entries:
        return entries[path]
    inner = (_entry(value, path[len(key) + 1 :]) for key, value in entries.items() if path.startswith(f"{key}."))
    return next((value for value in inner if value is not _NOTHING), _NOTHING)


class _Varied:
    """What the configurations of a sweep set: ``values`` of every entry, by path, one a configuration."""

    def __init__(self, record: SweepRecord) -> None:
        self.record = record
        self.flat = [leaves(config) for config in record.configs]
        self.values = {path: self.of(path) for one in self.flat for path in one}

    @cached_property
    def runs(self) -> list[Mapping[str, Any]]:
        """The complete run of every configuration, out of the record's own specification; none where it has none."""
        from fzcli.spec.reader import read_text

        try:
            found = _entry(read_text(self.record.provenance.spec_text).value, "configurations")
        except FzcliError:  # an origin that is no specification
            return []
        whole = isinstance(found, list) and len(found) == len(self.flat)
        return [one.get("run", {}) for one in found] if whole else []

    def of(self, path: str) -> list[Any]:
        """An entry of every configuration: as set, or, where it is not set, of the complete run."""
        values = [_entry(config, path) for config in self.record.configs]
        if any(value is _NOTHING for value in values) and self.runs:
            values = _completed(values, [_entry(run, path) for run in self.runs])
        return [ABSENT if value is _NOTHING else value for value in values]

    def headings(self, path: str, other: str | None) -> list[Value]:
        """Of every configuration on the axis of this entry; ``other`` is the entry on the other axis."""
        if path == CONFIGURATION:
            return [*labels(self._beside(other), lambda: self.runs)]
        values = self.of(path)
        if any(isinstance(value, Mapping) for value in values) and any(value != values[0] for value in values):
            return [*labels([{path: value} for value in values])]
        return [float(value) if _is_number(value) else shown(value) for value in values]

    def within(self, place: Sequence[Place], inside: Sequence[int] | None = None) -> list[str]:
        """Entries that differ between configurations of one place, of all or of those ``inside``."""
        chosen = range(len(place)) if inside is None else inside
        where = [place[index] for index in chosen]
        cells = {path: _by_place([values[index] for index in chosen], where) for path, values in self.values.items()}
        return [path for path, found in cells.items() if any(len(met) > 1 for met in found)]

    def _beside(self, other: str | None) -> list[dict[str, Any]]:
        """What each configuration sets that does not go along with the entry on the other axis."""
        if other == CONFIGURATION:
            return [{} for _ in self.flat]
        heads = [""] * len(self.flat) if other is None else [shown(value) for value in self.of(other)]
        free = [path for path in self.within([(head, "") for head in heads]) if not f"{path}.".startswith(f"{other}.")]
        return [{path: one[path] for path in free if path in one} for one in self.flat]


def _completed(written: Sequence[Any], complete: Sequence[Any]) -> list[Any]:
    """Values as written, those that are not with the value of the complete run.

    Numbers are all of the complete runs, so that units do not mix; other values that one configuration
    writes, another that has the same is shown with too.
    """
    pairs = list(zip(written, complete, strict=True))
    if all(_is_number(known) for known in complete if known is not _NOTHING):
        return [value if known is _NOTHING else known for value, known in pairs]
    words = {shown(known): value for value, known in pairs if _NOTHING not in (value, known)}
    return [
        words.get(shown(known), known) if value is _NOTHING and known is not _NOTHING else value
        for value, known in pairs
    ]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _by_place(values: Sequence[Any], place: Sequence[Place]) -> list[list[str]]:
    """The unlike values at each place, as text."""
    found: dict[Place, dict[str, None]] = {}
    for where, value in zip(place, values, strict=True):
        found.setdefault(where, {})[shown(value)] = None
    return [list(one) for one in found.values()]


def _note(path: str, values: Sequence[Any], place: Sequence[Place]) -> str:
    cells = _by_place(values, place)
    pooled = [cell for cell in cells if len(cell) > 1]
    met = {value for cell in pooled for value in cell}
    texts = [text for text in dict.fromkeys(map(shown, values)) if text in met]
    who = "each cell pools" if len(pooled) == len(cells) else "some cells pool"
    return f"{who} {len(texts)} values of {path}: {', '.join(texts)}"
