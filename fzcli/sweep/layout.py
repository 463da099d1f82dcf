"""How a sweep's runs are parted into shards: any run, and any shard, is found by its index; no list is made.

Run ``config * count + place`` is configuration ``config`` on trajectory ``first + place``. A shard is a block of
trajectories by a block of configurations, all of them unless there are more than a shard holds. The parts hang on the
sweep alone, never on the machine, so that a sweep begun anywhere goes on anywhere.
"""

from dataclasses import dataclass

from fzcli.sweep.meaning import AnySweep
from fzcli.sweep.resolve import Sweep

SMALLEST, LARGEST = 64, 2048  # runs of a shard
PARTS = 16  # shards that a sweep has at least, where they do not become too small
PLANS = 64  # a plan takes a thousand times longer than a run: shards of up to as many, as few as one
LANES = 8  # trajectories come in whole vectors of lanes


@dataclass(frozen=True)
class Piece:
    """The runs of shard ``index``: ``places`` of trajectories, counted from the first, by ``configs``."""

    index: int
    configs: range
    places: range

    @property
    def runs(self) -> int:
        """How many."""
        return len(self.configs) * len(self.places)


@dataclass(frozen=True)
class Layout:
    """``configs`` by ``count`` runs in shards of ``width`` configurations by ``height`` trajectories."""

    configs: int
    count: int
    width: int
    height: int

    @property
    def runs(self) -> int:
        """Of the whole sweep."""
        return self.configs * self.count

    @property
    def across(self) -> int:
        """Shards side by side: blocks of configurations."""
        return -(-self.configs // self.width)

    @property
    def shards(self) -> int:
        """How many there are."""
        return self.across * -(-self.count // self.height)

    def piece(self, index: int) -> Piece:
        """Shard ``index``: all configurations of the first trajectories come first."""
        row, column = divmod(index, self.across)
        configs = range(column * self.width, min((column + 1) * self.width, self.configs))
        return Piece(index, configs, range(row * self.height, min((row + 1) * self.height, self.count)))

    def shard_of(self, run: int) -> int:
        """The shard that run ``run`` is in."""
        config, place = divmod(run, self.count)
        return place // self.height * self.across + config // self.width


def layout_of(sweep: AnySweep) -> Layout:
    """How a sweep is parted."""
    configs, count = len(sweep.specs), sweep.file.trajectories.count
    total = configs * count
    if not isinstance(sweep, Sweep):
        aim, least = max(1, min(PLANS, total // (2 * PARTS))), 1
    elif _keeps_many(sweep):
        aim, least = SMALLEST, SMALLEST  # whole trajectories take a thousand times a row's room
    else:
        aim, least = max(SMALLEST, min(LARGEST, total // PARTS)), SMALLEST
    width = min(configs, aim)
    height = max(aim // width, -(-least // width))
    height = height // LANES * LANES if height >= LANES else height
    return Layout(configs, count, width, min(height, count))


def _keeps_many(sweep: Sweep) -> bool:
    return any(spec.record.keep in ("failures", "full") or spec.record.every for spec in sweep.specs)
