"""Result files as figures on disk."""

from pathlib import Path
from typing import Any

from fzcli.errors import RecordError, UsageError
from fzcli.loop.rollout import Rollout
from fzcli.record.info import describe
from fzcli.record.rollout_file import read_rollout
from fzcli.record.sweep_file import config_text, read_sweep, read_table_spec
from fzcli.record.sweep_record import KeptRun, SweepRecord
from fzcli.record.table import build_table
from fzcli.view.arm_plot import configurations_figure, tip_path_figure
from fzcli.view.joint_plot import joints_figure
from fzcli.view.plan_path_plot import path_figure
from fzcli.view.plan_plot import clearance_figure, joints_over_time_figure
from fzcli.view.planar_plan_plot import is_planar, planar_path_figure, singularity_figure
from fzcli.view.planned import is_plan, nearest
from fzcli.view.reach_plot import reach_figure
from fzcli.view.rollout_plot import plot_comparison, rollout_figure
from fzcli.view.style import output_path, save
from fzcli.view.table_plot import table_figure
from fzcli.view.target import has_target, spec_section
from fzcli.view.torque_plot import at_torque_level, following_figure, torque_figure

SWEEP_FIGURES = ("table", "comparison", "runs")
TARGET_FIGURES = ("configurations", "tip_path", "joints", "reach")
TORQUE_FIGURES = ("following", "torques")
PLAN_FIGURES = ("joints_over_time", "path", "clearance")
RUN_FIGURES = ("run", "comparison", *TARGET_FIGURES, *PLAN_FIGURES, "singularity", *TORQUE_FIGURES)


def plot(path: Path | str, out: Path | str | None = None, what: str | None = None) -> list[Path]:
    """Draws a result file; gives the paths of the figures, png unless ``out`` has another suffix.

    A run: without ``what`` those with a target are drawn as "configurations", "tip_path", "joints" and
    "reach", plans as "joints_over_time", "path" and (where anything can come near) "clearance", those of a
    planar 3-RRR as "singularity" too, those at torque level as "following" and "torques", others as
    "comparison" (yaw and gains of all) where they have variants, else as "run". A sweep:
    "table" (needs a table section), "comparison" (kept runs of one trajectory), "runs" (each kept run);
    without ``what`` the first two where they apply, the last where neither does. ``out`` is a file (one
    figure) or a folder; None is beside ``path``.

    Raises:
        RecordError: the file cannot be read, or has nothing to draw as ``what``.
        UsageError: ``what`` or the suffix of ``out`` is unknown, or ``out`` cannot be written.
    """
    path = Path(path)
    kind = describe(path).kind
    known = RUN_FIGURES if kind == "rollout" else SWEEP_FIGURES
    if what is not None and what not in known:
        raise UsageError(f"plot: {what!r}: of a {kind} there are {', '.join(known)}")
    figures = _run_figures(path, what) if kind == "rollout" else _sweep_figures(path, what)
    if len(figures) > 1 and out is not None and Path(out).suffix and not Path(out).is_dir():
        names = ", ".join(tag for tag, _ in figures)
        raise UsageError(
            f"plot: {out}: one file for {len(figures)} figures ({names}); name a folder or one of them"
        )
    return [save(figure, output_path(path, out, tag)) for tag, figure in figures]


def _run_figures(path: Path, what: str | None) -> list[tuple[str, Any]]:
    rollout = read_rollout(path)
    if what is not None:
        tags: tuple[str, ...] = (what,)
    elif at_torque_level(rollout):
        tags = TORQUE_FIGURES
    elif has_target(rollout):
        tags = TARGET_FIGURES
    elif is_plan(rollout):
        tags = PLAN_FIGURES if nearest(rollout) is not None else PLAN_FIGURES[:-1]
        tags += ("singularity",) if is_planar(rollout) else ()
    else:
        tags = ("comparison" if rollout.variants else "run",)
    try:
        return [(tag, _run_figure(rollout, tag, path.stem)) for tag in tags]
    except RecordError as error:
        raise RecordError(f"{path}: {error}") from error


def _run_figure(rollout: Rollout, what: str, title: str) -> Any:
    if what == "comparison" and not rollout.variants:
        raise RecordError("holds one run without variants, nothing to compare")
    variants, own = [*rollout.variants.items()], (_own_label(rollout, title), rollout)
    if what == "comparison":
        return plot_comparison([*variants, own], title)
    if what in TORQUE_FIGURES and not at_torque_level(rollout):
        raise RecordError(f"has no torques, which {what!r} is drawn from; give the run a section replay")
    if what == "following":
        return following_figure(dict([own, *variants]), title)
    if what == "reach":
        return reach_figure([own, *variants], title)
    draw = {
        "run": rollout_figure,
        "configurations": configurations_figure,
        "tip_path": tip_path_figure,
        "joints": joints_figure,
        "joints_over_time": joints_over_time_figure,
        "path": planar_path_figure if is_planar(rollout) else path_figure,
        "clearance": clearance_figure,
        "torques": torque_figure,
        "singularity": singularity_figure,
    }
    return draw[what](rollout, title)


def _own_label(rollout: Rollout, fallback: str) -> str:
    """What the run is called beside its variants: its kind of controller, where that tells it from them."""
    replay = spec_section(rollout, "replay").get("controller")
    controller = replay if isinstance(replay, dict) else spec_section(rollout, "controller")
    kind = " ".join(str(controller[key]) for key in ("kind", "variant") if controller.get(key))
    return kind if kind and kind not in rollout.variants else fallback


def _sweep_figures(path: Path, what: str | None) -> list[tuple[str, Any]]:
    record = read_sweep(path)
    figures: list[tuple[str, Any]] = []
    spec = read_table_spec(path)
    if what == "table" and spec is None:
        raise RecordError(f"{path}: has no table section to draw")
    if spec is not None and what in (None, "table"):
        figures.append(("table", table_figure(build_table(record, spec), path.stem)))
    if what == "comparison" or (what is None and len({run.trajectory for run in record.kept}) == 1):
        runs = _of_one_trajectory(record)
        if len(runs) > 1:
            title = f"{path.stem}, trajectory {runs[0].trajectory}"
            labelled = [(config_label(record, run.config), run.rollout) for run in runs]
            draw = reach_figure if all(has_target(run.rollout) for run in runs) else plot_comparison
            figures.append(("comparison", draw(labelled, title)))
        elif what == "comparison":
            raise RecordError(f"{path}: keeps no two configurations of one trajectory to compare")
    if what == "runs" or (what is None and not figures):
        if not record.kept:
            raise RecordError(f"{path}: keeps no runs to draw, and has no table section")
        figures += [_kept_figure(record, index, run) for index, run in enumerate(record.kept)]
    return figures


def _kept_figure(record: SweepRecord, index: int, run: KeptRun) -> tuple[str, Any]:
    title = f"{config_label(record, run.config)}; trajectory {run.trajectory}; {run.role}"
    return f"run{index}", rollout_figure(run.rollout, title)


def _of_one_trajectory(record: SweepRecord) -> list[KeptRun]:
    """The kept runs of the trajectory kept in most configurations, one a configuration."""
    best: dict[int, KeptRun] = {}
    for trajectory in dict.fromkeys(run.trajectory for run in record.kept):
        runs = {run.config: run for run in reversed(record.kept) if run.trajectory == trajectory}
        if len(runs) > len(best):
            best = runs
    return [best[config] for config in sorted(best)]


def config_label(record: SweepRecord, config: int) -> str:
    """What tells a configuration from the others, as short text; strings speak for themselves."""
    entries = record.configs[config]
    varied = [
        name for name in entries if len({config_text(other.get(name)) for other in record.configs}) > 1
    ] or list(entries)
    parts = []
    for name in varied:
        value = entries[name]
        shown = f"{value:g}" if isinstance(value, float) else config_text(value)
        parts.append(shown if isinstance(value, str) else f"{name.rsplit('.', 1)[-1]} {shown}")
    return ", ".join(parts) or f"configuration {config}"
