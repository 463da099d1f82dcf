"""One symbolic vector of named parts."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Vector:
    """``symbol``: all parts one after the other; ``vector["name"]`` is a part."""

    symbol: ca.SX
    parts: Mapping[str, ca.SX]

    @staticmethod
    def of(name: str, sizes: Mapping[str, int]) -> "Vector":
        """Fresh symbols, by name and size."""
        parts = {part: ca.SX.sym(f"{name}_{part}", size) for part, size in sizes.items()}
        return Vector(ca.vertcat(*parts.values()), parts)

    def __getitem__(self, part: str) -> ca.SX:
        return self.parts[part]

    @property
    def size(self) -> int:
        """Numbers in all parts together."""
        return int(self.symbol.shape[0])

    def filled(self, values: Mapping[str, ca.SX | float]) -> ca.SX:
        """A vector of these parts' values. Raises KeyError for a part without one."""
        return ca.densify(ca.vertcat(*(values[part] for part in self.parts)))
