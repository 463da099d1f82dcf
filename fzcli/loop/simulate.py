"""Run specs to rollouts: one run, or several of one closed loop, with every signal kept."""

import platform
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.errors import Problem, SpecError
from fzcli.loop.assemble import closed_loop, parameter_row, step_counts
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.engine import Batch, Engine
from fzcli.loop.events import make_engine
from fzcli.loop.reach import out_of_reach
from fzcli.loop.reductions import seen
from fzcli.loop.replay import ATTITUDE_ERROR, attitude_error
from fzcli.loop.rollout import Rollout
from fzcli.loop.run_spec import BoundsSpec, SimulateRun, misfits, simulate_model
from fzcli.loop.verdict import BOUNDED, OUTCOME, outcomes, status_of
from fzcli.spec.base import SpecModel
from fzcli.spec.document import Document
from fzcli.spec.hashing import spec_hash
from fzcli.spec.library import find
from fzcli.spec.load import check_kind
from fzcli.spec.overlay import overlaid, without
from fzcli.spec.parse import parse
from fzcli.spec.quantity import Signal
from fzcli.spec.reader import dump, read
from fzcli.spec.references import BESIDE
from fzcli.spec.result import Provenance
from fzcli.spec.sets import apply_sets
from fzcli.spec.units import quantity

Array = NDArray[np.float64]
KINEMATIC = "kinematic"  # the variant that a run at torque level follows
STATE_SIGNALS = ("q", "qd", "base_position", "base_quat", "base_twist", "tip_position", "tip_quat")


def load_run(run: str | Path | Document, sets: Sequence[str] = ()) -> tuple[SimulateRun, dict[str, SimulateRun]]:
    """A run and its variants, by path or name, or as read. Raises SpecError with every problem found."""
    return runs_of(run if isinstance(run, Document) else read_run(run), sets)


def read_run(run: str | Path) -> Document:
    """A run file, by path or name. Raises SpecError where there is none."""
    return read(run if isinstance(run, Path) or run == "-" else find("runs", run))


def runs_of(document: Document, sets: Sequence[str] = ()) -> tuple[SimulateRun, dict[str, SimulateRun]]:
    """The run that a document says, and its variants. Raises SpecError with every problem found."""
    if sets:
        document = apply_sets(document, sets)
        if any(one.partition("=")[0].strip() == "controller.kind" for one in sets):
            document = fitted(document)  # the file's fields of the kind before go with it
    spec = run_of(document)
    missing = out_of_reach(spec)
    if missing:
        raise SpecError(document.problem(missing, ("reference", "position")))
    return spec, variants_of(document, spec)


def run_of(document: Document, sets: Sequence[str] = ()) -> SimulateRun:
    """Validate a document as a simulation. Raises SpecError with every problem found."""
    document = apply_sets(document, sets) if sets else document
    check_kind(document, "simulate")
    spec = parse(document, simulate_model(), context={BESIDE: document.path})
    problems = [document.problem(text, path) for path, text in misfits(spec)] or _wrong_units(document, spec)
    if problems:
        raise SpecError(problems)
    return spec


def _wrong_units(document: Document, spec: SimulateRun) -> list[Problem]:
    """Joint positions whose written unit is not their joint's: a length for a revolute one, or an angle."""
    types = [link.joint.type for link in spec.robot.links if link.joint.type != "fixed"]
    problems = []
    for i, (written, kind) in enumerate(zip(document.value["start"]["q"], types, strict=True)):
        try:
            quantity(written, "length" if kind == "prismatic" else "angle")
        except ValueError as error:
            problems.append(document.problem(str(error), ("start", "q", i)))
    return problems


def variants_of(document: Document, spec: SimulateRun, sets: Sequence[str] = ()) -> dict[str, SimulateRun]:
    """The runs that ``compare`` names, each the file's run with some fields changed."""
    document = apply_sets(document, sets) if sets else document
    found: dict[str, SimulateRun] = {}
    problems: list[Problem] = []
    for name, changes in spec.compare.items():
        try:
            found[name] = run_of(variant(document, changes))
        except SpecError as error:
            problems += [_in_variant(document, name, changes, problem) for problem in error.problems]
    if problems:
        raise SpecError(problems)
    return found


def _in_variant(document: Document, name: str, changes: dict[str, Any], problem: Problem) -> Problem:
    """The problem placed in ``compare``, at the change that made it where one did."""
    change = next((path for path in changes if f"{problem.field}.".startswith(f"{path}.")), None)
    if change is None:
        return replace(problem, field=f"compare.{name}: {problem.field}")
    placed = document.problem(problem.message, ("compare", name, change), at_key=True)
    return replace(placed, field=f"compare.{name}.{problem.field}")


def variant(document: Document, changes: dict[str, Any]) -> Document:
    """The document with fields changed; where the controller's kind changes, fields it lacks are dropped."""
    changed = overlaid(without(document, ["compare"]), changes)
    fit = fitted(changed)
    kept = fit.value.get("controller")
    lost = [path for path in changes if path.startswith("controller.") and path.split(".")[1] not in (kept or {})]
    if isinstance(kept, dict) and lost:
        known = ", ".join(f"controller.{key}" for key in kept)
        text = f"{kept.get('kind')!r} has no such field; it has {known}"
        raise SpecError([Problem(text, path, document.file) for path in lost])
    return fit


def fitted(document: Document) -> Document:
    """Without the fields of a controller, of the run or its replay, that its kind lacks but another kind knows."""
    from fzcli.control.registry import controllers
    from fzcli.control.torque.registry import TORQUE_CONTROLLERS

    own = {kind: entry.spec for kind, entry in controllers().items()}
    torque = {kind: entry.spec for kind, entry in TORQUE_CONTROLLERS.items()}
    return _fitted(_fitted(document, ("controller",), own), ("replay", "controller"), torque)


def _fitted(document: Document, place: tuple[str, ...], kinds: Mapping[str, type[SpecModel]]) -> Document:
    found: Any = document.value
    for key in place:
        found = found.get(key) if isinstance(found, dict) else None
    if not isinstance(found, dict) or found.get("kind") not in kinds:
        return document
    own = kinds[found["kind"]].model_fields
    elsewhere = {name for spec in kinds.values() for name in spec.model_fields}
    return without(document, [key for key in found if key in elsewhere and key not in own], *place)


def simulate(spec: SimulateRun, argv: Sequence[str] = ()) -> Rollout:
    """Run one simulation with every signal kept."""
    loop = closed_loop(spec, record=True)
    row = parameter_row(spec, loop.parameters)[None, :]
    engine = make_engine(loop, lanes=1)
    batch = engine.run(row, step_counts(loop, spec, row), record=True)
    return rollouts(engine, batch, [spec.bounds], [provenance(spec, engine, argv)], replay=True)[0]


def simulate_all(spec: SimulateRun, variants: Mapping[str, SimulateRun], argv: Sequence[str] = ()) -> Rollout:
    """The run, with its variants beside it; of one at torque level also the motion that it follows."""
    if spec.replay is not None and KINEMATIC not in variants:
        variants = {KINEMATIC: spec.model_copy(update={"replay": None}), **variants}
    beside = {name: simulate(variant, argv) for name, variant in variants.items()}
    return replace(simulate(spec, argv), variants=beside)


def rollouts(
    engine: Engine,
    batch: Batch,
    bounds: Sequence[BoundsSpec],
    origins: Sequence[Provenance],
    replay: bool = False,
) -> list[Rollout]:
    """The recorded runs of a batch, each cut at its end; ``replay``: judged by a finer integration, too."""
    return [_rollout(engine.loop, batch, i, bounds[i], origin, replay) for i, origin in enumerate(origins)]


def _rollout(
    loop: ClosedLoop, batch: Batch, i: int, bounds: BoundsSpec, origin: Provenance, replay: bool
) -> Rollout:
    if batch.record is None:
        raise ValueError("the batch was run without a record")
    end = int(batch.ends[i])
    rows = batch.record[i, : end + 1]
    arrays: dict[str, Array] = {}
    column = 0
    for signal in loop.signals:
        block = rows[:, column : column + signal.size]
        arrays[signal.name] = np.ascontiguousarray(block if signal.components else block[:, 0])
        column += signal.size
    values = seen(batch.metrics[i])
    values[~np.isfinite(values)] = np.nan
    metrics = {metric.name: float(value) for metric, value in zip(loop.metrics, values, strict=True)}
    metrics["n_steps"] = float(end)
    time: Array = loop.dt * np.arange(end + 1, dtype=np.float64)
    info = {m.name: Signal(m.name, m.unit, m.long_name, truth=m.truth) for m in loop.metrics}
    info["n_steps"] = Signal("n_steps", "1", "steps taken")
    if "arrived" in metrics:
        metrics["outcome"] = float(outcomes({name: np.array([value]) for name, value in metrics.items()})[0])
        info["outcome"] = OUTCOME
    if replay and loop.path_piece is not None:
        metrics[ATTITUDE_ERROR] = attitude_error(loop.path_piece, arrays["q"], arrays["base_quat"])
        about = "largest error of the base's attitude, against a replay of the joints in 8 pieces a step"
        info[ATTITUDE_ERROR] = Signal(ATTITUDE_ERROR, "rad", about)
    names = [name for name in metrics if name in loop.certificate_names or name in (*BOUNDED, ATTITUDE_ERROR)]
    return Rollout(
        time=time,
        q=arrays["q"],
        qd=arrays["qd"],
        base_position=arrays["base_position"],
        base_quat=arrays["base_quat"],
        base_twist=arrays["base_twist"],
        tip_position=arrays["tip_position"],
        tip_quat=arrays["tip_quat"],
        signals={name: values for name, values in arrays.items() if name not in STATE_SIGNALS},
        signal_info={signal.name: signal for signal in loop.signals},
        joint_names=next(signal.components for signal in loop.signals if signal.name == "q"),
        joint_units=loop.joint_units,
        metrics=metrics,
        metric_info=info,
        certificate={name: metrics[name] for name in names},
        status=status_of(metrics, int(batch.stops[i]), bounds, float(time[-1])),
        provenance=origin,
    )


def provenance(spec: Any, engine: Engine, argv: Sequence[str] = (), seed: int | None = None) -> Provenance:
    """Resolved spec, hash, engine and versions of a result."""
    resolved = spec.model_dump(mode="json")
    return Provenance(
        spec_text=dump(resolved),
        spec_hash=spec_hash(resolved),
        engine=engine.name,
        seed=seed,
        versions=versions(),
        argv=tuple(argv),
    )


@cache
def versions() -> Mapping[str, str]:
    """Versions of everything that the numbers depend on."""
    found = {"python": platform.python_version(), "platform": sys.platform}
    for name in ("fzcli", "casadi", "numpy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "source tree"
    return found
