"""Networks: their answers beside the exact ones (figure 3 of Parsa 2008), and maps of their errors."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fzcli.errors import UsageError
from fzcli.learn.judge import Trained
from fzcli.learn.network_set import NetworkSet
from fzcli.learn.store import load
from fzcli.view.style import COLORS, dress, new_figure, output_path, save, side_legend

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FIGURES = ("comparison", "errors")
_COLUMNS, _SAMPLES = 3, 40  # of the comparison
_FLOOR = 1e-17  # m: what rounding leaves


def plot_networks(path: Path, out: Path | None = None, what: str | None = None) -> list[Path]:
    """Draws a file of networks; gives the figures' paths. Without ``what`` both: "comparison" and "errors".

    Raises:
        RecordError: the file cannot be read.
        UsageError: ``what`` or the suffix of ``out`` is unknown, or ``out`` cannot be written.
    """
    if what is not None and what not in FIGURES:
        raise UsageError(f"plot: {what!r}: of networks there are {', '.join(FIGURES)}")
    networks = load(path)
    wanted = FIGURES if what is None else (what,)
    if out is not None and out.suffix and len(wanted) > 1:
        raise UsageError(f"{out}: there are {len(wanted)} figures; name a folder, or choose one with --what")
    draw = {"comparison": comparison_figure, "errors": error_figure}
    return [save(draw[name](networks, path.stem), output_path(path, out, name)) for name in wanted]


def comparison_figure(networks: NetworkSet, title: str) -> Any:
    """Network and exact values of some test poses, a panel an output, three a row, for four networks at the most."""
    chosen = list(networks.trained.items())[:4]
    names = output_names(networks)
    rows = -(-len(names) // _COLUMNS)
    figure = new_figure(3.2 * _COLUMNS + 1, 2.1 * rows * len(chosen) + 0.9)
    figure.suptitle(f"{title}: networks of {networks.robot} beside the exact kinematics", fontsize=11)
    panels = figure.subplots(rows * len(chosen), _COLUMNS, squeeze=False)
    for number, (label, one) in enumerate(chosen):
        own = panels[number * rows : (number + 1) * rows].ravel()
        order = np.argsort(one.truth[:_SAMPLES, 0])
        own[0].set_title(label, fontsize=9, loc="left")
        for column, (axes, name) in enumerate(zip(own, names, strict=False)):
            _compare(axes, one.truth[order, column], one.raw[order, column], name)
        for axes in own[len(names) :]:
            axes.remove()
    for axes in panels[-1]:
        axes.set_xlabel("test poses, in the order of the first output", fontsize=8)
    side_legend(panels[0][-1])
    return figure


def _compare(axes: "Axes", truth: Any, raw: Any, name: str) -> None:
    if name.endswith("[rad]"):
        truth, raw, name = np.degrees(truth), np.degrees(_beside(raw, truth)), name.replace("rad", "deg")
    axes.plot(truth, "o", color=COLORS[0], markersize=5, fillstyle="none", label="exact")
    axes.plot(raw, "x", color=COLORS[1], markersize=4, label="network")
    dress(axes, "", name)


def output_names(networks: NetworkSet) -> list[str]:
    """Names of the outputs with units, as the file's map has them."""
    if networks.spec["map"]["kind"] == "planar_forward":
        return ["x [m]", "y [m]", "phi [rad]"]
    count = next(iter(networks.trained.values())).truth.shape[1]
    return [f"joint {number} [rad]" for number in range(1, count + 1)]


def _beside(angle: Any, truth: Any) -> Any:
    """Angles wound to within half a turn of the true ones."""
    return truth + np.remainder(angle - truth + np.pi, 2 * np.pi) - np.pi


def error_figure(networks: NetworkSet, title: str) -> Any:
    """Maps of the position error, a row a network: of the network alone, then after the last Newton step."""
    trained = list(networks.trained.items())
    panels = len(trained[0][1].error_map.panels)
    steps = networks.refine.steps[-1]
    figure = new_figure(2.5 * 2 * panels + 1.5, 2.3 * len(trained) + 0.8)
    text = f"{title}: position error of {networks.robot}'s networks, raw and after {steps} Newton steps"
    figure.suptitle(text, fontsize=10)
    grid = figure.subplots(len(trained), 2 * panels, squeeze=False)
    low, high = _range([one for _, one in trained])
    for row, (label, one) in zip(grid, trained, strict=True):
        for k, axes in enumerate(row):
            refined, panel = divmod(k, panels)
            image = _panel(axes, one, panel, bool(refined), (low, high))
            what = f"after {steps}" if refined else f"{label}, raw"
            axes.set_title(f"{what}: {one.error_map.panels[panel]}", fontsize=7)
    figure.colorbar(image, ax=grid, shrink=0.6, label="log10 of the error [m]")
    return figure


def _panel(axes: "Axes", one: Trained, panel: int, refined: bool, limits: tuple[float, float]) -> Any:
    shown = one.error_map
    values = (shown.refined if refined else shown.raw)[panel]
    logs = np.log10(np.clip(values, _FLOOR, 1e3))
    image = axes.pcolormesh(shown.x, shown.y, logs, cmap="viridis", vmin=limits[0], vmax=limits[1], shading="nearest")
    dress(axes, *shown.axes)
    axes.set_aspect("equal")
    return image


def _range(trained: list[Trained]) -> tuple[float, float]:
    """Powers of ten that hold the raw errors, and six more below for the refined ones."""
    raw = np.concatenate([one.error_map.raw.ravel() for one in trained])
    top = float(np.ceil(np.log10(np.clip(raw[np.isfinite(raw)].max(), 1e-9, 1e3))))
    return top - 9, top
