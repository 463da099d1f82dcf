"""Metrics, certificate and status of a run and its variants as text."""

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from fzcli.cli.options import SummaryFormat

if TYPE_CHECKING:
    from fzcli.loop.rollout import Rollout


def summary(runs: "Mapping[str, Rollout]", format: SummaryFormat) -> str:
    """The runs by name, in one of the formats; the first is the run itself."""
    if format is SummaryFormat.json:
        return json.dumps({name: _entry(run) for name, run in runs.items()}, indent=1) + "\n"
    if format is SummaryFormat.csv:
        return _csv(runs)
    return _text(runs)


def _entry(run: "Rollout") -> dict[str, Any]:
    status = run.status
    return {
        "status": status.name,
        "reason": status.reason,
        "advice": status.advice,
        "metrics": {
            name: _number(value) for name, value in run.metrics.items() if name not in run.certificate
        },
        "certificate": {name: _number(value) for name, value in run.certificate.items()},
        "engine": run.provenance.engine,
        "spec_hash": run.provenance.spec_hash,
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _csv(runs: "Mapping[str, Rollout]") -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["run", "group", "name", "unit", "value"])
    for name, run in runs.items():
        writer.writerow([name, "status", "status", "", run.status.name])
        for metric, value in run.metrics.items():
            group = "certificate" if metric in run.certificate else "metrics"
            writer.writerow([name, group, metric, run.metric_info[metric].unit, repr(value)])
    return stream.getvalue()


def _text(runs: "Mapping[str, Rollout]") -> str:
    rows = list(_rows(runs))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [
            f"{text:<{width}}" if i == 0 else f"{text:>{width}}"
            for i, (text, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join([*lines, *_endings(runs)]) + "\n"


def _rows(runs: "Mapping[str, Rollout]") -> Iterator[list[str]]:
    """A row a metric, a column a run; what the certificate holds stands last."""
    every = list(runs.values())
    names = dict.fromkeys(name for run in every for name in run.metrics)
    units = {name: signal.unit for run in every for name, signal in run.metric_info.items()}
    certified = dict.fromkeys(name for run in every for name in run.certificate)
    yield ["", *runs]
    yield ["status", *(run.status.name for run in every)]
    for name in (*(name for name in names if name not in certified), "", *certified):
        if not name:
            yield ["certificate", *("" for _ in every)]
            continue
        unit = units.get(name, "1")
        label = name if unit in ("", "1") else f"{name} [{unit}]"
        shown = [_shown(run.metrics.get(name)) for run in every]
        if name == "outcome":
            shown = [_outcome(run.metrics.get(name)) for run in every]
        yield [label, *shown]


def _outcome(code: float | None) -> str:
    """How a run with a target ended, in a word or two."""
    words = ("arrived", "out of reach", "no posture", "at rest", "moving")
    return "-" if code is None or math.isnan(code) else words[int(code)]


def _shown(value: float | None) -> str:
    if value is None or math.isnan(value):
        return "-"
    return f"{value:.0f}" if value == int(value) and abs(value) < 1e6 else f"{value:.4g}"


def _endings(runs: "Mapping[str, Rollout]") -> Iterator[str]:
    for name, run in runs.items():
        if run.status.reason:
            yield f"{name}: {run.status.name}: {run.status.reason}"
            yield f"{name}: advice: {run.status.advice}"
