"""Run specs to rollouts: one run, or several of one closed loop, with every signal kept."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fzcli.loop.assemble import closed_loop, parameter_row, step_counts
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.engine import Batch, Engine
from fzcli.loop.events import make_engine
from fzcli.loop.reductions import seen
from fzcli.loop.replay import ATTITUDE_ERROR, attitude_error
from fzcli.loop.rollout import Rollout
from fzcli.loop.run_spec import BoundsSpec, SimulateRun
from fzcli.loop.verdict import BOUNDED, OUTCOME, outcomes, status_of
from fzcli.loop.versions import versions
from fzcli.spec.hashing import spec_hash
from fzcli.spec.quantity import Signal
from fzcli.spec.reader import dump
from fzcli.spec.result import Provenance

Array = NDArray[np.float64]
KINEMATIC = "kinematic"  # the variant that a run at torque level follows
STATE_SIGNALS = ("q", "qd", "base_position", "base_quat", "base_twist", "tip_position", "tip_quat")


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
