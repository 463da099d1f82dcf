"""A rule base as figures: the terms of every variable, and the surface they make."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fzcli.spec.rulebase import Input, Output, Rulebase, Term
from fzcli.view.style import COLORS, DASHES, dress, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SAMPLES = 400


def plot_rulebase(rulebase: Rulebase, surface: Any, out: Path | str) -> Path:
    """Draws terms and surface (a ``ca.Function`` of build_surface) into ``out``; gives its path.

    Raises:
        UsageError: the file cannot be written.
    """
    return save(rulebase_figure(rulebase, surface), Path(out))


def rulebase_figure(rulebase: Rulebase, surface: Any) -> "Figure":
    """A row of panels with the terms of every variable, and below them each output over the inputs."""
    variables: dict[str, Input | Output] = {**rulebase.inputs, **rulebase.outputs}
    across = max(2, min(3, len(variables)))
    rows = -(-len(variables) // across)
    heights = [2.7] * rows + [3.3] * len(rulebase.outputs)
    figure = new_figure(4.0 * across, sum(heights) + 0.3)
    grid = figure.add_gridspec(len(heights), across, height_ratios=heights)
    for index, (name, variable) in enumerate(variables.items()):
        _terms(figure.add_subplot(grid[index // across, index % across]), name, variable)
    for index, name in enumerate(rulebase.outputs):
        _surface(figure.add_subplot(grid[rows + index, :]), rulebase, surface, name)
    figure.suptitle(rulebase.name or rulebase.about, fontsize=10)
    return figure


def outline(term: Term, limits: tuple[float, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points of the line that shows a term between ``limits``: abscissae and memberships."""
    low, high = limits
    numbers = term.numbers
    if term.shape == "gaussian":
        x = np.linspace(low, high, _SAMPLES)
        return x, np.exp(-0.5 * ((x - numbers[0]) / numbers[1]) ** 2)
    if term.shape == "singleton":
        return np.array([numbers[0], numbers[0]]), np.array([0.0, 1.0])
    if term.shape == "ramp":
        foot, top = numbers
        end = max(high, top) if foot < top else min(low, top)
        start = min(low, foot) if foot < top else max(high, foot)
        points = [(start, 0.0), (foot, 0.0), (top, 1.0), (end, 1.0)]
    elif term.shape == "rectangle":
        points = [(numbers[0], 0.0), (numbers[0], 1.0), (numbers[1], 1.0), (numbers[1], 0.0)]
    elif term.shape == "triangle":
        points = [(numbers[0], 0.0), (numbers[1], 1.0), (numbers[2], 0.0)]
    else:
        points = [(numbers[0], 0.0), (numbers[1], 1.0), (numbers[2], 1.0), (numbers[3], 0.0)]
    x, y = np.array(points, dtype=np.float64).T
    return x, y


def _terms(axes: "Axes", name: str, variable: Input | Output) -> None:
    low, high = variable.range
    for index, (label, term) in enumerate(variable.terms.items()):
        x, y = _refined(*outline(term, variable.range))
        inside = (x >= low) & (x <= high)
        style = {
            "color": COLORS[index % len(COLORS)],
            "linestyle": DASHES[index // len(COLORS) % len(DASHES)],
        }
        axes.plot(x[inside], y[inside], linewidth=1.6, label=label, **style)
    axes.margins(x=0.03)
    if isinstance(variable, Output) and _lopsided(variable):
        axes.set_xscale("symlog", linthresh=_threshold(variable), linscale=1.5)
        axes.set_xticks(_ticks(variable), [f"{tick:g}" for tick in _ticks(variable)])
        axes.set_xticks([], minor=True)
    axes.set_ylim(0, 1.06)
    dress(axes, name.replace("_", " "), "membership")
    place: dict[str, Any] = {
        "loc": "lower center",
        "bbox_to_anchor": (0.5, 1.0),
        "ncols": min(6, len(variable.terms)),
    }
    axes.legend(fontsize=8, frameon=False, handlelength=1.2, columnspacing=1.0, **place)


def _refined(
    x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same line with points in between, so that it is right on a bent axis as well."""
    at = np.linspace(0, len(x) - 1, 200 * (len(x) - 1) + 1)
    index = np.arange(len(x))
    return np.interp(at, index, x), np.interp(at, index, y)


def _edges(variable: Output) -> list[float]:
    return sorted(abs(x) for term in variable.terms.values() for x in term.numbers if x != 0)


def _lopsided(variable: Output) -> bool:
    """Whether the terms are of such different sizes that a linear axis would hide some of them."""
    edges = _edges(variable)
    return len(edges) > 1 and edges[-1] / edges[0] > 100


def _threshold(variable: Output) -> float:
    """Half width of the linear middle of a symlog axis: the smaller of the two sides."""
    low, high = variable.range
    return min(abs(low), abs(high)) or _edges(variable)[0]


def _ticks(variable: Output) -> list[float]:
    """Ticks of a symlog axis that do not crowd: zero, the ends of its linear middle, decades outside it."""
    low, high = variable.range
    middle = _threshold(variable)
    first = math.ceil(math.log10(middle) + 0.1)
    decades = [10.0**power for power in range(first, math.floor(math.log10(max(abs(low), abs(high)))) + 1)]
    both = [*(-decade for decade in decades), -middle, 0.0, middle, *decades]
    return sorted(tick for tick in both if low <= tick <= high)


def _surface(axes: "Axes", rulebase: Rulebase, surface: Any, output: str) -> None:
    """Output over the first input; a line for each of some values of the second, others at mid-range."""
    names = list(rulebase.inputs)
    x = np.linspace(*rulebase.inputs[names[0]].range, _SAMPLES)
    variable = rulebase.outputs[output]
    if len(names) == 1:
        axes.plot(x, _evaluate(rulebase, surface, output, x, math.nan), linewidth=1.6, color=COLORS[0])
    else:
        levels = _levels(rulebase.inputs[names[1]])
        lines = [(level, _evaluate(rulebase, surface, output, x, level)) for level in levels]
        for index, (span, values) in enumerate(_merged(lines)):
            label = f"{names[1].replace('_', ' ')} = {span}"
            axes.plot(x, values, linewidth=1.6, label=label, color=COLORS[index % len(COLORS)])
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    if _lopsided(variable):
        axes.set_yscale("symlog", linthresh=_threshold(variable), linscale=1.0)
        axes.set_yticks(_ticks(variable), [f"{tick:g}" for tick in _ticks(variable)])
        axes.set_yticks([], minor=True)
    dress(axes, names[0].replace("_", " "), output.replace("_", " "))
    axes.margins(x=0.01)
    if len(names) > 2:
        axes.set_title(f"{', '.join(names[2:])} at mid-range", fontsize=8, loc="right")


def _merged(lines: list[tuple[float, NDArray[np.float64]]]) -> list[tuple[str, NDArray[np.float64]]]:
    """Neighbouring lines that cannot be told apart become one, named by the span of their levels."""
    height = max(float(np.ptp([values for _, values in lines])), 1e-300)
    groups: list[list[tuple[float, NDArray[np.float64]]]] = []
    for level, values in lines:
        if groups and float(np.abs(values - groups[-1][0][1]).max()) < 0.1 * height:
            groups[-1].append((level, values))
        else:
            groups.append([(level, values)])
    return [
        (f"{group[0][0]:g}" if len(group) == 1 else f"{group[0][0]:g} to {group[-1][0]:g}", group[0][1])
        for group in groups
    ]


def _levels(variable: Input) -> list[float]:
    """Five values of an input between the outermost corners of its terms, where things change."""
    low, high = variable.range
    corners = [min(max(x, low), high) for term in variable.terms.values() for x in term.numbers]
    first, last = min(corners), max(corners)
    return sorted({first + part * (last - first) for part in (0.0, 0.25, 0.5, 0.75, 1.0)})


def _evaluate(
    rulebase: Rulebase, surface: Any, output: str, x: NDArray[np.float64], level: float
) -> NDArray[np.float64]:
    arguments = []
    for index in range(surface.n_in()):
        name = surface.name_in(index)
        if index == 0:
            arguments.append(x.reshape(1, -1))
        elif index == 1 and name in rulebase.inputs:
            arguments.append(np.full((1, len(x)), level))
        elif name in rulebase.inputs:
            arguments.append(np.full((1, len(x)), sum(rulebase.inputs[name].range) / 2))
        else:
            arguments.append(np.zeros((1, len(x))))
    results = surface.map(len(x))(*arguments)
    place = list(rulebase.outputs).index(output)
    chosen = results[place] if surface.n_out() > 1 else results
    return np.asarray(chosen, dtype=np.float64).ravel()
