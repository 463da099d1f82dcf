"""Published numbers to show beside a table's own, from a CSV file."""

import csv

from fzcli.errors import RecordError
from fzcli.record.table_places import Place, Value
from fzcli.record.table_spec import TableSpec
from fzcli.spec.nearest import hint


def read_paper(spec: TableSpec) -> dict[Place, dict[str, float]]:
    """The published numbers by row, column and metric; empty entries of the file are left out.

    Raises:
        RecordError: a column of the table is missing in the file, or an entry is no number.
    """
    if not spec.beside_text:
        return {}
    lines = [line for line in spec.beside_text.splitlines() if line.strip() and not line.startswith("#")]
    reader = csv.DictReader(lines)
    names = reader.fieldnames or []
    for key in (spec.rows, spec.columns):
        if key is not None and key not in names:
            raise RecordError(f"table: beside: {spec.beside}: no column {key}{hint(key, names)}")
    found: dict[Place, dict[str, float]] = {}
    for number, line in enumerate(reader, start=1):
        place = (
            _number_or_text(line[spec.rows]),
            _number_or_text(line[spec.columns]) if spec.columns else "",
        )
        try:
            cell = {
                name: float(text)
                for name, text in line.items()
                if name not in (spec.rows, spec.columns) and text
            }
        except (TypeError, ValueError) as error:
            raise RecordError(f"table: beside: {spec.beside}: entry {number}: {error}") from error
        found[place] = cell
    return found


def _number_or_text(text: str) -> Value:
    try:
        return float(text)
    except ValueError:
        return text
