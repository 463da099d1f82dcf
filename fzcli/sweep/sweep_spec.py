"""What a sweep file says: which runs, drawn how, tabulated how. The run's own fields stand beside these."""

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from fzcli.loop.run_spec import RecordSpec
from fzcli.spec.base import SpecModel
from fzcli.spec.condition import Condition
from fzcli.spec.nearest import hint
from fzcli.sweep.scene_spec import SceneDraw

MOST_LAID_OUT = 1_000_000
DISTRIBUTIONS = {
    "uniform": 2,
    "log_uniform": 2,
    "normal": 2,
    "sphere": None,
    "choice": None,
}


class Draw(SpecModel):
    """A random field: one distribution with its numbers (scalars, or lists for a vector)."""

    distribution: Literal["uniform", "log_uniform", "normal", "sphere", "choice"]
    numbers: Any

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, value: Any) -> Any:
        if isinstance(value, dict) and len(value) == 1:
            name, numbers = next(iter(value.items()))
            if name not in DISTRIBUTIONS:
                raise ValueError(f"unknown distribution {name!r}{hint(name, DISTRIBUTIONS)}")
            return {"distribution": name, "numbers": numbers}
        if isinstance(value, dict) and set(value) == {"distribution", "numbers"}:
            return value
        raise ValueError("must be one distribution and its numbers, such as {uniform: [0, 1]}")

    @model_validator(mode="after")
    def _right_count(self) -> "Draw":
        wanted = DISTRIBUTIONS[self.distribution]
        if self.distribution == "sphere":
            if self.numbers not in (2, 3):
                raise ValueError("sphere takes the number of dimensions, 2 or 3")
        elif not isinstance(self.numbers, list) or not self.numbers:
            raise ValueError(f"{self.distribution} takes a list")
        elif wanted is not None and len(self.numbers) != wanted:
            raise ValueError(f"{self.distribution} takes {wanted} entries, got {len(self.numbers)}")
        return self


class KeepIf(SpecModel):
    """A filter of drawn trajectories: a run with these changes must meet these conditions."""

    with_: Annotated[
        dict[str, Any], Field(alias="with", default_factory=dict, description="changes of the run that is tried")
    ]
    that: Annotated[tuple[str, ...], Field(min_length=1, description="conditions such as tip_error_max < 1e-2")]
    most: Annotated[int, Field(ge=1, description="candidates tried for one trajectory at the most")] = 1000

    @field_validator("that")
    @classmethod
    def _conditions(cls, texts: tuple[str, ...]) -> tuple[str, ...]:
        for text in texts:
            Condition.of(text)
        return texts


class Trajectories(SpecModel):
    """How many runs of each configuration, and what is drawn for each, the same for all configurations."""

    count: Annotated[int, Field(ge=1, le=100_000_000)]
    seed: Annotated[int, Field(ge=0)] = 0
    first: Annotated[int, Field(ge=0, description="index of the first trajectory")] = 0
    sampling: Annotated[
        Literal["random", "latin_hypercube", "sobol"],
        Field(description="how uniform, log_uniform and choice fields are laid out; random: each by itself"),
    ] = "random"
    draw: Annotated[dict[str, Draw], Field(default_factory=dict)]
    keep_if: KeepIf | None = None

    @model_validator(mode="after")
    def _laid_out(self) -> "Trajectories":
        if self.sampling == "random":
            return self
        wrong = [path for path, one in self.draw.items() if one.distribution in ("normal", "sphere")]
        if wrong:
            raise ValueError(f"{wrong[0]}: {self.draw[wrong[0]].distribution} cannot be laid out by {self.sampling}")
        if self.keep_if is not None:
            raise ValueError(f"keep_if needs sampling: random; points of {self.sampling} are not drawn again")
        if self.sampling == "latin_hypercube" and self.count > MOST_LAID_OUT:
            raise ValueError(f"a Latin hypercube is laid out whole, of {MOST_LAID_OUT} points at most; use sobol")
        return self


class TableSection(SpecModel):
    """How the results are tabulated."""

    rows: Annotated[
        str, Field(description="a field that differs; configuration: all that one changes beside the columns' field")
    ] = "configuration"
    columns: Annotated[str | None, Field(description="as rows; differences are from the first column")] = None
    show: tuple[str, ...] = ()
    lost: Annotated[str | None, Field(description="what makes a run count as lost")] = None
    beside: Annotated[str | None, Field(description="CSV file of published numbers")] = None


class SweepFile(SpecModel):
    """The fields that make a run file a sweep; all others are those of the kind that ``run`` names."""

    kind: Literal["sweep"] = "sweep"
    run: Annotated[Literal["simulate", "plan"], Field(description="what every run is")] = "simulate"
    about: str = ""
    trajectories: Trajectories = Trajectories(count=1, draw={})
    scenes: Annotated[
        SceneDraw | None, Field(description="of plans: a random start, goal and obstacles for each trajectory")
    ] = None
    grid: Annotated[
        dict[str, Annotated[list[Any], Field(min_length=1)]],
        Field(default_factory=dict, description="field -> values; all combinations"),
    ]
    zip_: Annotated[
        dict[str, Annotated[list[Any], Field(min_length=1)]],
        Field(alias="zip", default_factory=dict, description="field -> values; all fields step together"),
    ]
    list_: Annotated[
        list[dict[str, Any]],
        Field(alias="list", default_factory=list, description="explicit changes, one set a configuration"),
    ]
    table: TableSection | None = None
    record: Annotated[RecordSpec | None, Field(description="of plans: which are kept with their paths")] = None
    expect_failures: Annotated[
        dict[str, Any] | bool, Field(description="configurations whose failed runs do not fail the sweep")
    ] = False


# of a sweep file; ``record`` is the run's own where the run has such a field
OWN_KEYS = ("run", "scenes", "trajectories", "grid", "zip", "list", "table", "record", "expect_failures")
