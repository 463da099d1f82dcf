"""Synthetic runs and sweeps: plausible in shape, random in content, made from a seed."""

from typing import Any

import numpy as np

from fzcli.loop.rollout import Rollout
from fzcli.record.sweep_record import KeptRun, SweepRecord
from fzcli.spec.quantity import Signal
from fzcli.spec.result import Provenance, Status

JOINTS = ("q1", "q2", "q3", "q4")
SIGNALS = {
    "tip_error": Signal("tip_error", "m", "norm of the tip's position error"),
    "gain": Signal("gain", "1/s", "null-space gain", ("yaw",)),
    "oscillating_joints": Signal("oscillating_joints", "1", "joints that oscillate"),
    "firing_strength": Signal("firing_strength", "1", "firing of each rule", ("rule1", "rule2", "rule3")),
}
METRICS = {
    "tip_error_mean": Signal("tip_error_mean", "m", "mean tip error"),
    "tip_error_max": Signal("tip_error_max", "m", "largest tip error"),
    "yaw_abs_max": Signal("yaw_abs_max", "rad", "largest absolute base yaw"),
    "yaw_abs_mean": Signal("yaw_abs_mean", "rad", "mean absolute base yaw"),
    "oscillating_joints_mean": Signal("oscillating_joints_mean", "1", "oscillating joints a step"),
    "momentum_angular_max": Signal("momentum_angular_max", "N m s", "worst angular momentum residual"),
}
ORIGIN = Provenance(
    spec_text="kind: sweep\nabout: naïve ünïcode\n",
    spec_hash="0123abcd",
    engine="compiled c",
    seed=2**70 + 1,
    versions={"fzcli": "0.1.0", "casadi": "3.8"},
    argv=("fzcli", "sweep", "runs/table2.yaml"),
)


def unit_rows(rng: np.random.Generator, steps: int) -> np.ndarray:
    """Unit quaternions near the identity that wander slowly, (steps, 4)."""
    vector = np.cumsum(rng.normal(size=(steps, 3)), axis=0) * 2e-3
    quaternions = np.hstack([np.ones((steps, 1)), vector])
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def make_rollout(
    seed: int = 0, steps: int = 200, tuned: bool = True, dt: float = 0.01, **changes: Any
) -> Rollout:
    """A run with smooth random arrays; ``tuned`` adds the signals of a tuner."""
    rng = np.random.default_rng(seed)
    n = len(changes.get("joint_names", JOINTS))
    walk = np.cumsum(rng.normal(size=(steps, n)), axis=0) * 1e-2
    signals = {"tip_error": np.abs(rng.normal(size=steps)) * 1e-5}
    if tuned:
        signals["gain"] = 10 + np.cumsum(np.abs(rng.normal(size=(steps, 1))), axis=0)
        signals["oscillating_joints"] = (rng.random(steps) < 0.02).astype(float)
        signals["firing_strength"] = rng.random((steps, 3))
    fields: dict[str, Any] = {
        "time": np.arange(steps) * dt,
        "q": walk,
        "qd": np.diff(walk, axis=0, prepend=0.0) / dt,
        "base_position": np.cumsum(rng.normal(size=(steps, 3)), axis=0) * 1e-3,
        "base_quat": unit_rows(rng, steps),
        "base_twist": rng.normal(size=(steps, 6)),
        "tip_position": np.cumsum(rng.normal(size=(steps, 3)), axis=0) * 1e-3,
        "tip_quat": unit_rows(rng, steps),
        "signals": signals,
        "signal_info": {name: SIGNALS[name] for name in signals},
        "joint_names": JOINTS,
        "metrics": {"tip_error_mean": float(signals["tip_error"].mean()), "yaw_abs_max": 0.1 + 0.2},
        "metric_info": METRICS,
        "certificate": {"momentum_angular_max": 1e-13, "clearance_min": float("nan")},
        "status": Status("flagged", "tip error 2e-2 m > 1e-2 m", "lower the gain"),
        "provenance": ORIGIN,
    }
    return Rollout(**{**fields, **changes})


def make_sweep(trajectories: int = 40, kept: int = 3, seed: int = 0, steps: int = 120) -> SweepRecord:
    """A sweep over two kinds and five gains with paired trajectories, some runs lost and some failed."""
    rng = np.random.default_rng(seed)
    gains = [10.0, 100.0, 500.0, 1000.0, 5000.0]
    configs = [
        {"controller.kind": kind, "controller.gain": g} for kind in ("clik", "fuzzy_clik") for g in gains
    ]
    config = np.repeat(np.arange(len(configs)), trajectories)
    trajectory = np.tile(np.arange(trajectories), len(configs))
    gain = np.array([configs[index]["controller.gain"] for index in config])
    fuzzy = config >= len(gains)
    level = rng.lognormal(0, 0.5, trajectories)[trajectory]
    runs = len(config)
    yaw = np.where(fuzzy, 0.01, 0.03 / np.log10(gain)) * level
    error = 2.5e-5 * rng.lognormal(0, 0.3, runs)
    lost = rng.random(runs) < np.where(fuzzy, 0.015, gain / 16000)
    status = np.where(lost, 1, 0).astype(np.int8)
    failed = lost & (gain == 5000.0) & (rng.random(runs) < 0.2) & ~fuzzy
    status[failed] = 2
    metrics = {
        "config": config,
        "trajectory": trajectory,
        "status": status,
        "tip_error_mean": np.where(failed, np.nan, error + np.where(lost, 0.2 * rng.random(runs), 0)),
        "tip_error_max": np.where(failed, np.nan, error * 3 + np.where(lost, 0.5, 0)),
        "yaw_abs_max": yaw * 2.3,
        "yaw_abs_mean": yaw,
        "oscillating_joints_mean": rng.random(runs) * gain / 5000,
        "momentum_angular_max": 1e-13 * rng.random(runs),
        "n_steps": np.full(runs, float(steps)),
    }
    runs_kept = tuple(
        KeptRun(
            index % len(configs),
            index,
            ("best", "median", "worst")[index % 3],
            make_rollout(index, steps - 7 * index % steps, tuned=index % len(configs) >= 5),
        )
        for index in range(kept)
    )
    return SweepRecord(
        configs=configs,
        metrics=metrics,
        metric_info=METRICS,
        certificate_names=("momentum_angular_max",),
        draws={"start.q": rng.random((trajectories, 4)), "reference.length": rng.random((trajectories, 1))},
        draw_info={"candidates": 5 * trajectories, "accepted": trajectories},
        kept=runs_kept,
        provenance=ORIGIN,
    )


TABLE = {
    "rows": "controller.gain",
    "columns": "controller.kind",
    "show": ["tip_error_mean", "yaw_abs_max", "yaw_abs_mean", "oscillating_joints_mean", "lost"],
    "beside": "bulgarelli2011-table2.csv",
}

REACHED = {
    "arrived": Signal("arrived", "1", "whether the target was reached", truth=True),
    "arrival_time": Signal("arrival_time", "s", "time to the target"),
    "target_distance_final": Signal("target_distance_final", "m", "distance from the target at the end"),
    "restarts": Signal("restarts", "1", "searches for another posture"),
}


def make_reaching_sweep(
    configs: list[dict[str, Any]], shares: tuple[float, ...], trajectories: int = 500, seed: int = 0
) -> SweepRecord:
    """A sweep of runs that reach a target or not: of each configuration about this share, on the same targets."""
    rng = np.random.default_rng(seed)
    size = (len(configs), trajectories)
    hardness = rng.random(trajectories)
    arrived = 0.7 * hardness + 0.3 * rng.random(size) < np.array(shares)[:, None]
    time = rng.lognormal(-0.3, 0.5, size) * (1 + 0.3 * np.arange(len(configs)))[:, None]
    metrics = {
        "config": np.repeat(np.arange(len(configs)), trajectories),
        "trajectory": np.tile(np.arange(trajectories), len(configs)),
        "status": np.zeros(arrived.size, dtype=np.int8),
        "arrived": arrived.ravel().astype(float),
        "arrival_time": np.where(arrived, time, np.nan).ravel(),
        "target_distance_final": np.where(arrived, 0.009 * rng.random(size), rng.random(size)).ravel(),
        "restarts": rng.poisson(0.2, size).ravel().astype(float),
    }
    return SweepRecord(configs, metrics, REACHED, (), {}, {}, (), ORIGIN)
