"""Networks and their errors as a table: a row a network; rich and md in units to read, csv and json in SI."""

import csv
import io
import json
import math
from typing import TYPE_CHECKING

from fzcli.cli.describe import aligned
from fzcli.cli.options import TableFormat
from fzcli.spec.quantity import Signal

if TYPE_CHECKING:
    from fzcli.learn.network_set import NetworkSet

_SHOWN = {"m": (1e3, "mm"), "rad": (180 / math.pi, "deg")}


def network_table(networks: "NetworkSet", format: TableFormat) -> str:
    """The table in one of the formats."""
    from fzcli.learn.judge import metric_info

    info = metric_info(networks.refine)
    if format in (TableFormat.csv, TableFormat.json):
        return _machine(networks, info, format)
    rows = _rows(networks, info)
    if format is TableFormat.md:
        lines = ["| " + " | ".join(row) + " |" for row in rows]
        return "\n".join([lines[0], "|" + " ---: |" * len(rows[0]), *lines[1:]]) + "\n"
    texts = aligned([tuple(row) for row in rows])
    return "\n".join([*texts, *_legend(networks)]) + "\n"


def _machine(networks: "NetworkSet", info: tuple[Signal, ...], format: TableFormat) -> str:
    if format is TableFormat.json:
        found = {
            label: {name: value if math.isfinite(value) else None for name, value in one.metrics.items()}
            for label, one in networks.trained.items()
        }
        return json.dumps(found, indent=1) + "\n"
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["network", "metric", "unit", "value"])
    for label, one in networks.trained.items():
        writer.writerows([label, each.name, each.unit, repr(one.metrics[each.name])] for each in info)
    return stream.getvalue()


def _rows(networks: "NetworkSet", info: tuple[Signal, ...]) -> list[list[str]]:
    """The columns that tell most; a metric's name with its unit heads each."""
    units = {each.name: each.unit for each in info}
    steps = networks.refine.steps
    columns = {
        "mse_train": "mse train",
        "mse_test": "mse test",
        "raw_distance_rms": "raw rms",
        "raw_distance_max": "max",
        "raw_angle_rms": "rms",
        "raw_angle_max": "max",
        **{f"converged_{k}": f"after {k}" for k in steps},
        f"distance_max_{steps[-1]}": f"max after {steps[-1]}",
        "accepted": "gate",
        "false_accepts": "false",
        "seconds": "trained",
    }
    head = ["network"]
    for name, text in columns.items():
        _, unit = _SHOWN.get(units[name], (1.0, units[name]))
        share = name.startswith(("converged", "accepted"))
        head.append(f"{text} %" if share else text if unit == "1" else f"{text} {unit}")
    rows = [head]
    for label, one in networks.trained.items():
        rows.append([label, *(_cell(name, one.metrics[name], units[name]) for name in columns)])
    return rows


def _cell(name: str, value: float, unit: str) -> str:
    if name.startswith(("converged", "accepted")):
        return f"{100 * value:.4g}"
    return f"{value * _SHOWN.get(unit, (1.0, unit))[0]:.3g}"


def _legend(networks: "NetworkSet") -> list[str]:
    refine, samples = networks.refine, networks.spec["samples"]
    return [
        "",
        f"Errors on {samples['test']} poses apart from the {samples['train']} of the training. mse: of the outputs "
        "scaled to -1..1.",
        "raw: the network alone, distance and angle of the pose, root mean square and largest. after k: share within "
        f"{refine.distance:g} m and {refine.angle:g} rad after k Newton steps.",
        f"gate: share with a residual below {refine.gate:g} m and rad on the right branch after {refine.steps[-1]}; "
        "false: those among them with a wrong pose.",
    ]
