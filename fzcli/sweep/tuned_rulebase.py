"""A rule base whose numbers were tuned, as a file that says where they come from."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fzcli.record.hdf5 import replacing
from fzcli.spec.reader import dump
from fzcli.spec.rulebase import Input, Output, Rulebase
from fzcli.sweep.tune_scores import Score
from fzcli.sweep.tune_spec import Tuning
from fzcli.sweep.tuning import Tuned
from fzcli.sweep.vary import changed

FIELD = "controller.rulebase"
_HEAD = "# yaml-language-server: $schema=../schemas/rulebase.json\n#\n"


def write_rulebase(tuning: Tuning, found: Tuned, path: Path, argv: Sequence[str]) -> Path | None:
    """NAME-rulebase.yaml beside the result, where numbers of a rule base were tuned. Raises RecordError."""
    if not any(f"{field}.".startswith(f"{FIELD}.") for field in found.values):
        return None
    spec = changed(tuning.sweep.specs[0], tuning.section.vary, list(found.values.values()))
    if spec is None:
        return None
    rulebase: Rulebase = spec.controller.rulebase
    place = path.with_name(f"{path.stem}-rulebase.yaml")
    lines = [f"Tuned from {rulebase.name or 'a rule base'} by: {' '.join(argv)}"]
    lines += [f"{field}: {value:g}" for field, value in found.values.items()]
    if tuning.section.baseline:
        changes = ", ".join(f"{path}: {json.dumps(value)}" for path, value in tuning.section.baseline.items())
        lines.append(f"Compared with {changes}.")
    lines += list(_told(tuning.section.minimise, found))
    lines.append(f"Seed {found.seed}, {found.evaluations} candidates; tuning {found.identity}.")
    rules = "rules:\n" + "".join(f"  - {rule.text}\n" for rule in rulebase.rules)  # one a line, to be read
    text = _HEAD + "".join(f"# {line}\n" for line in lines) + dump(_written(rulebase)) + rules
    if not place.exists() or place.read_text(encoding="utf-8") != text:
        with replacing(place) as stream:
            stream.write(text.encode())
    return place


def _told(metric: str, found: Tuned) -> Sequence[str]:
    pairs = {"seen": (found.before, found.after), "held out": (found.held_out_before, found.held_out_after)}
    return [
        f"Trajectories {name}: {metric} {_score(before)} -> {_score(after)}."
        for name, (before, after) in pairs.items()
        if before is not None and after is not None
    ]


def _score(score: Score) -> str:
    return f"{score.mean:.5g} ({score.lost} of {score.runs} lost)"


def _written(rulebase: Rulebase) -> dict[str, Any]:
    """As a rule base file has it, without the rules."""
    return {
        "kind": "rulebase",
        "about": rulebase.about,
        "and": rulebase.conjunction,
        "or": rulebase.disjunction,
        "inputs": {name: _variable(one) for name, one in rulebase.inputs.items()},
        "outputs": {name: _output(one) for name, one in rulebase.outputs.items()},
    }


def _variable(one: Input | Output) -> dict[str, Any]:
    terms = {name: [term.shape, *term.numbers] for name, term in one.terms.items()}
    return {"range": list(one.range), "terms": terms}


def _output(one: Output) -> dict[str, Any]:
    exact = one.defuzzifier.method == "exact"
    how: Any = "centroid" if exact else {"midpoint": one.defuzzifier.samples}
    return {**_variable(one), "defuzzifier": how, "default": one.default}
