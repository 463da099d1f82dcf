"""The look shared by all figures: colours, axes, saving. No global matplotlib state is touched."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fzcli.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, told apart by readers with any colour vision; yellow left out, too pale for lines.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
SUFFIXES = (".png", ".svg", ".pdf")


def new_figure(width: float, height: float) -> "Figure":
    """An empty figure, sizes in inches, that lays itself out."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    figure.set_layout_engine("constrained", w_pad=0.08, h_pad=0.06)
    return figure


def line_style(index: int) -> dict[str, Any]:
    """Colour and dash of the line number ``index``; the dash changes when the colours are used up."""
    return {
        "color": COLORS[index % len(COLORS)],
        "linestyle": DASHES[index // len(COLORS) % len(DASHES)],
        "linewidth": 1.4,
    }


def dress(axes: "Axes", xlabel: str = "", ylabel: str = "") -> None:
    """Labels, a quiet grid, no box."""
    axes.set_xlabel(xlabel, fontsize=9)
    axes.set_ylabel(ylabel, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(True, linewidth=0.4, color="#d0d0d0")
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def side_legend(axes: "Axes") -> None:
    """A legend to the right of the panel, where it hides nothing."""
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False, handlelength=2.2)


def with_unit(name: str, unit: str) -> str:
    """An axis label: name in words, unit in brackets unless it is dimensionless."""
    words = name.replace("_", " ")
    return words if unit in ("", "1") else f"{words} [{unit}]"


def log_worthy(values: Sequence[float], ratio: float = 30.0) -> bool:
    """Whether positive values span so much that a logarithmic axis shows them better."""
    return bool(values) and min(values) > 0 and max(values) / min(values) >= ratio


def output_path(source: Path, out: Path | str | None, tag: str) -> Path:
    """Where a figure goes: ``out`` itself, ``SOURCE-TAG.png`` in the folder ``out``, or beside the source.

    Raises:
        UsageError: the suffix of ``out`` is none that can be drawn.
    """
    name = f"{source.stem}-{tag}.png"
    if out is None:
        return source.with_name(name)
    out = Path(out)
    if out.is_dir() or not out.suffix:
        return out / name
    if out.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{out}: cannot draw {out.suffix!r} files; expected one of {', '.join(SUFFIXES)}")
    return out


def save(figure: "Figure", path: Path) -> Path:
    """Writes the figure in the format its suffix names.

    Raises:
        UsageError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=150)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror or error}") from error
    return path
