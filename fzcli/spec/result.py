"""What every result carries besides its numbers: how it ended, and where it comes from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

StatusName = Literal["ok", "flagged", "failed"]
STATUS_NAMES: tuple[StatusName, ...] = ("ok", "flagged", "failed")  # their index is the code in files


@dataclass(frozen=True)
class Status:
    """How a run ended: ``ok``, ``flagged`` (a bound exceeded) or ``failed``, why, and what to try."""

    name: StatusName
    reason: str = ""
    advice: str = ""

    @property
    def code(self) -> int:
        """0 ok, 1 flagged, 2 failed: the value stored in files."""
        return STATUS_NAMES.index(self.name)


@dataclass(frozen=True)
class Provenance:
    """Where a result comes from: everything that is needed to make it again."""

    spec_text: str
    spec_hash: str
    engine: str
    seed: int | None = None
    versions: Mapping[str, str] = field(default_factory=dict)
    argv: tuple[str, ...] = ()
