"""Closed loops of a sweep: configurations that differ in run-time parameters alone share one build."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.assemble import closed_loop, parameter_row, step_counts
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.engine import Engine
from fzcli.loop.events import make_engine
from fzcli.loop.run_spec import SimulateRun
from fzcli.loop.stops import all_decided
from fzcli.model import RobotModel, build_model
from fzcli.spec.condition import Condition
from fzcli.spec.hashing import spec_hash
from fzcli.sweep.resolve import Drawn, with_values

Array = NDArray[np.float64]
EngineMaker = Callable[[ClosedLoop], Engine]
NOT_BUILT_IN = {"kind", "about", "duration", "bounds", "record", "compare"}


@dataclass
class Build:
    """One closed loop with its engines, made when first asked for."""

    loop: ClosedLoop
    spec: SimulateRun
    model: RobotModel
    make: EngineMaker = make_engine
    wanted: tuple[Condition, ...] = ()
    engines: dict[bool, Engine] = field(default_factory=dict)

    @cached_property
    def decides(self) -> bool:
        """Whether a run that ends without a stop meets all that is wanted."""
        return bool(self.wanted) and all_decided(self.wanted, self.loop.metrics)

    def engine(self, record: bool) -> Engine:
        """The engine that reduces metrics only, or the one that records every signal."""
        if record not in self.engines:
            loop = closed_loop(self.spec, True, self.model, self.wanted) if record else self.loop
            self.engines[record] = self.make(loop)
        return self.engines[record]


@dataclass(frozen=True)
class Rows:
    """Runs of one build: where they stand in the sweep, their parameters and steps."""

    build: Build
    runs: NDArray[np.int64]
    parameters: Array
    steps: NDArray[np.int64]


_Found = tuple[tuple[str, ...], str, Build]  # paths of what is not built in, the hash of all else, and the build


class Builds:
    """All closed loops of a sweep so far, by what is built into them."""

    def __init__(
        self,
        model: RobotModel | None = None,
        engine: EngineMaker = make_engine,
        like: "Builds | None" = None,
        wanted: tuple[Condition, ...] = (),
    ) -> None:
        """``model``: of the one robot that all runs have, where it is built already; ``engine``: makes engines.

        ``like``: whose builds these start with. ``wanted``: see `closed_loop`.
        """
        self._model, self._engine, self._wanted = model, engine, wanted
        self._found: list[_Found] = list(like._found) if like else []
        self._known: dict[int, tuple[SimulateRun, Build]] = {}
        self._rows: dict[int, Array] = {}
        self._fields: dict[tuple[int, tuple[str, ...]], tuple[bool, ...]] = {}

    def of(self, spec: SimulateRun, known: bool = True) -> Build:
        """The build that serves a run spec; a new one when none does. ``known``: it will be asked for again."""
        if id(spec) in self._known:
            return self._known[id(spec)][1]
        build = self._sought(spec)
        if known:
            self._known[id(spec)] = spec, build  # with the spec, so that its id stays its own
        return build

    def row_of(self, spec: SimulateRun) -> Array:
        """The parameters of a run spec that is asked for again and again."""
        if id(spec) not in self._rows:
            self._rows[id(spec)] = parameter_row(spec, self.of(spec).loop.parameters)
        return self._rows[id(spec)]

    def fields_of(self, spec: SimulateRun, draws: Sequence[Drawn]) -> tuple[bool, ...]:
        """Which of the drawn fields a run spec has that is asked for again and again."""
        key = id(spec), tuple(one.path for one in draws)
        if key not in self._fields:
            self.of(spec)
            self._fields[key] = tuple(spec.has(one.path) for one in draws)
        return self._fields[key]

    def _sought(self, spec: SimulateRun) -> Build:
        dump = spec.model_dump(mode="json", exclude=NOT_BUILT_IN)
        for paths, key, build in self._found:
            if build.wanted == self._wanted and _key(dump, paths, spec.start.drifting) == key:
                return build
        model = self._model or next((b.model for _, _, b in self._found if b.spec.robot == spec.robot), None)
        model = model or build_model(spec.robot)
        loop = closed_loop(spec, False, model, self._wanted)
        paths = tuple(parameter.path for parameter in loop.parameters)
        build = Build(loop, spec, model, self._engine, self._wanted)
        self._found.append((paths, _key(dump, paths, spec.start.drifting), build))
        return build

    def compile(self, record: bool, jobs: int) -> None:
        """Make the engines of all builds, several compilers at a time."""
        with ThreadPoolExecutor(max(1, jobs)) as pool:
            list(pool.map(lambda found: found[2].engine(record), self._found))


def _key(dump: Mapping[str, Any], paths: Sequence[str], drifting: bool) -> str:
    return spec_hash([_blanked(dump, [path.split(".") for path in paths]), drifting])


def _blanked(value: Any, paths: list[list[str]]) -> Any:
    """A copy with the values at the paths replaced by their shapes: the numbers are not built in."""
    if not isinstance(value, dict):
        return value
    ours = {path[0] for path in paths if len(path) == 1}
    gone = {"base_rpy"} if ["base_quat"] in paths else set()
    return {
        name: _shape(child)
        if name in ours
        else _blanked(child, [path[1:] for path in paths if len(path) > 1 and path[0] == name])
        for name, child in value.items()
        if name not in gone
    }


def _shape(value: Any) -> Any:
    """How many numbers stand there, and in what order: how many waypoints there are is built in."""
    if isinstance(value, list | tuple):
        return [_shape(item) for item in value]
    return None if value is None else 0


def rows_of(
    builds: Builds, spec: SimulateRun, draws: Sequence[Drawn], drawn: Array, runs: NDArray[np.int64]
) -> list[Rows]:
    """The runs of a configuration, one for every row of ``drawn``, grouped by build.

    Drawn fields that are run-time parameters only fill columns. Any other field means a build of its
    own for each of its values.
    """
    fields = builds.fields_of(spec, draws)
    if not all(fields):  # its controller may be of another kind
        drawn = drawn[:, np.repeat(fields, [one.size for one in draws])]
        draws = [one for one, has in zip(draws, fields, strict=True) if has]
    build = builds.of(spec)
    places = _columns(build.loop)
    if all(one.path in places for one in draws):
        table = np.tile(builds.row_of(spec), (len(drawn), 1))
        column = 0
        for one in draws:
            table[:, places[one.path]] = drawn[:, column : column + one.size]
            column += one.size
        return [Rows(build, runs, table, step_counts(build.loop, spec, table))]
    found: dict[int, tuple[Build, list[int], list[Array], list[int]]] = {}
    for i, values in enumerate(drawn):
        single = with_values(spec, split(draws, values))
        own = builds.of(single, known=False)
        row = parameter_row(single, own.loop.parameters)
        _, members, table_rows, steps = found.setdefault(id(own), (own, [], [], []))
        members.append(int(runs[i]))
        table_rows.append(row)
        steps.append(int(step_counts(own.loop, single, row[None, :])[0]))
    return [
        Rows(own, np.array(members), np.array(table_rows), np.array(steps))
        for own, members, table_rows, steps in found.values()
    ]


def split(draws: Sequence[Drawn], values: Array) -> dict[str, Array]:
    """A drawn vector by path."""
    parts: dict[str, Array] = {}
    column = 0
    for one in draws:
        parts[one.path] = values[column : column + one.size]
        column += one.size
    return parts


def _columns(loop: ClosedLoop) -> dict[str, slice]:
    places: dict[str, slice] = {}
    column = 0
    for parameter in loop.parameters:
        places[parameter.path] = slice(column, column + parameter.size)
        column += parameter.size
    return places
