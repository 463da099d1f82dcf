"""Today's numbers against the frozen ones (see golden_table2)."""

import json
from typing import Any

import pytest

from fzcli.loop.compiler import find_compiler
from fzcli.loop.simulate import simulate
from tests.golden.golden_table2 import FILE, OSCILLATION
from tests.loop.cases import run_spec

ROWS = json.loads(FILE.read_text(encoding="ascii"))


def _ours(row: dict[str, Any]) -> dict[str, float]:
    spec = run_spec(
        start__q=row["line"]["q"],
        controller__kind=row["kind"],
        controller__gain=row["gain"],
        controller__oscillation=OSCILLATION,
        **{f"reference__{name}": row["line"][name] for name in ("direction", "length", "duration")},
    )
    return dict(simulate(spec).metrics)


@pytest.mark.usefixtures("machine")
@pytest.mark.parametrize("row", ROWS, ids=[f"{row['kind']}-{i % 5}" for i, row in enumerate(ROWS)])
def test_the_machine_gives_the_frozen_numbers(row: dict[str, Any]) -> None:
    found = _ours(row)
    assert {name: found[name] for name in row["metrics"]} == pytest.approx(row["metrics"], rel=1e-9, abs=1e-15)


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("kind", ["clik", "fuzzy_clik"])
def test_the_compiled_engine_gives_the_frozen_numbers(kind: str) -> None:
    for row in (row for row in ROWS if row["kind"] == kind):
        found = _ours(row)
        assert {name: found[name] for name in row["metrics"]} == pytest.approx(row["metrics"], rel=1e-9, abs=1e-15)
