"""What a tune file says: a sweep's fields, and which numbers of its run are varied to what end."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from fzcli.errors import SpecError
from fzcli.loop.run_spec import SimulateRun
from fzcli.spec.base import SpecModel
from fzcli.spec.condition import Condition
from fzcli.spec.document import Document, Node
from fzcli.spec.load import check_kind
from fzcli.spec.overlay import overlaid, without
from fzcli.spec.parse import parse
from fzcli.spec.sets import apply_sets
from fzcli.sweep.resolve import Sweep, resolve
from fzcli.sweep.vary import numbers_at


class Vary(SpecModel):
    """How a field is varied: from ``low`` to ``high``, or all its numbers by one factor between them."""

    low: float
    high: float
    scale: bool = False

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, value: Any) -> Any:
        scale = isinstance(value, dict) and set(value) == {"scale"}
        ends = value["scale"] if isinstance(value, dict) and scale else value
        if isinstance(ends, list | tuple) and len(ends) == 2:
            return {"low": ends[0], "high": ends[1], "scale": scale}
        if isinstance(value, dict) and set(value) == {"low", "high", "scale"}:
            return value
        raise ValueError("must be two numbers, [LOW, HIGH], or {scale: [LOW, HIGH]}")

    @model_validator(mode="after")
    def _in_order(self) -> "Vary":
        if not self.low < self.high:
            raise ValueError(f"the lower end {self.low:g} must lie below the upper {self.high:g}")
        if self.scale and self.low <= 0:
            raise ValueError("factors are above 0")
        return self

    @property
    def logarithmic(self) -> bool:
        """Whether it is varied by its logarithm: factors, and what may grow tenfold."""
        return self.low > 0 and (self.scale or self.high >= 10 * self.low)


class TuneSection(SpecModel):
    """What is varied, to what end, and how long."""

    vary: Annotated[
        dict[str, Vary],
        Field(min_length=1, description="field of the run -> [LOW, HIGH] in SI, or {scale: [LOW, HIGH]}"),
    ]
    minimise: Annotated[str, Field(description="metric whose mean over all runs is made small")]
    lost: Annotated[
        str | None,
        Field(description="what makes a run count as lost; no more may be than of the baseline"),
    ] = None
    baseline: Annotated[
        dict[str, Any] | None,
        Field(description="changes to the run that make what it is compared with; by default the file's own numbers"),
    ] = None
    margin: Annotated[
        float,
        Field(ge=0, lt=1, description="share of the baseline's lost runs left free, for trajectories not seen"),
    ] = 0.0
    held_out: Annotated[float, Field(ge=0, le=0.9, description="share of the trajectories that judge it")] = 0.5
    candidates: Annotated[int, Field(ge=5, description="of a generation")] = 24
    generations: Annotated[int, Field(ge=0)] = 20
    seed: Annotated[int, Field(ge=0)] = 0

    @field_validator("lost")
    @classmethod
    def _condition(cls, text: str | None) -> str | None:
        if text is not None:
            Condition.of(text)
        return text


class TuneFile(SpecModel):
    """The field that makes a sweep file one that is tuned."""

    tune: TuneSection


@dataclass(frozen=True)
class Tuning:
    """A tuning, resolved: the sweep that candidates run, what is varied in it, and what it is compared with.

    ``baseline`` is empty where that is the file's own numbers.
    """

    sweep: Sweep
    section: TuneSection
    document: Document
    baseline: tuple[SimulateRun, ...] = ()
    kind: Literal["tune"] = "tune"


def resolve_tuning(document: Document, sets: tuple[str, ...] = ()) -> Tuning:
    """Validate a tune file. Raises SpecError with every problem found."""
    document = apply_sets(document, sets) if sets else document
    check_kind(document, "tune")
    others = [key for key in document.value if key != "tune"]
    section = parse(without(document, others), TuneFile).tune
    sweep = resolve(overlaid(without(document, ["tune"]), {"kind": "sweep"}))
    baseline = _baseline(document, section)
    problems = []
    for path, vary in section.vary.items():
        wrong = _unfit(sweep, path, vary)
        if wrong:
            problems.append(document.problem(wrong, ("tune", "vary", path), at_key=True))
    if problems:
        raise SpecError(problems)
    return Tuning(sweep, section, document, baseline)


def _baseline(document: Document, section: TuneSection) -> tuple[SimulateRun, ...]:
    """The runs that the changes of ``tune.baseline`` make, without the sweep's own configurations."""
    if not section.baseline:
        return ()
    plain = without(document, ["tune", "grid", "zip", "list"])
    changes = {path: document.node(("tune", "baseline", path)) for path in section.baseline}
    source = document.root.source
    listed = Node(source, content=[Node(source, content=changes)])
    whole = overlaid(plain, {"kind": "sweep", "list": listed})
    return tuple(resolve(whole).specs)


def _unfit(sweep: Sweep, path: str, vary: Vary) -> str:
    """Why a field cannot be varied so."""
    overlap = [other for other in {p for c in sweep.changes for p in c} | {one.path for one in sweep.draws}
               if f"{path}.".startswith(f"{other}.") or f"{other}.".startswith(f"{path}.")]  # fmt: skip
    if overlap:
        return f"is drawn or swept as well ({overlap[0]}); a field has one source"
    count = min(numbers_at(spec.model_dump(mode="json"), path) for spec in sweep.specs)
    if not count:
        return "is not a number of the run, nor a section with numbers"
    return "holds several numbers: scale them, or name one" if count > 1 and not vary.scale else ""
