"""Tables of sweeps whose configurations stand in a list: values that the file itself gives."""

from typing import Any

import pytest

from fzcli.record.table import build_table
from fzcli.spec.document import document_of
from fzcli.sweep.execute import run_sweep, table_spec
from fzcli.sweep.resolve import resolve
from tests.loop.cases import raw_run

pytestmark = pytest.mark.usefixtures("machine")
LIST = [{}, {"controller.kind": "unconstrained"}, {"controller.gain": 100, "step": "20 ms"}]


def table_of(**section: Any) -> Any:
    data = {**raw_run(duration=0.1), "kind": "sweep", "trajectories": {"count": 2}, "list": LIST, "table": section}
    sweep = resolve(document_of(data))
    return build_table(run_sweep(sweep), table_spec(sweep))


def test_a_row_has_the_value_of_the_file_where_the_list_does_not_set_it() -> None:
    table = table_of(rows="step", columns="controller.kind", show=["tip_error_mean"])
    assert (table.rows, table.columns) == ((0.01, 0.02), (raw_run()["controller"]["kind"], "unconstrained"))
    assert table.cells[0.01, "unconstrained"].differences["tip_error_mean"].count == 2


def test_a_section_without_rows_gives_each_configuration_its_own() -> None:
    table = table_of(show=["tip_error_mean"])
    assert table.row_key == "configuration"
    assert table.rows[1:] == ("unconstrained", "gain 100, step 20 ms")
    assert table.rows[0].startswith(f"{raw_run()['controller']['kind']}, ")
