"""What a sweep's parts must not do: set a field twice, change a field that no kind has, expect what is not run."""

from fzcli.control.registry import controllers
from fzcli.errors import SpecError
from fzcli.spec.document import Document, Node
from fzcli.spec.nearest import hint
from fzcli.sweep.own_section import OwnSection


def check_one_source(document: Document, own: OwnSection) -> None:
    """A drawn field may be set nowhere else: the draw would win without a word. Nor may a list set an axis.

    A list may leave out a section (null) in which fields are drawn: they are not there then.
    """
    drawn, axes, zipped = list(own.file.trajectories.draw), list(own.file.grid), list(own.file.zip_)
    listed = [
        (("list", i, path), path)
        for i, entry in enumerate(own.file.list_)
        for path in entry
        if entry[path] is not None or path in drawn
    ]
    tried = [(("trajectories", "keep_if", "with", path), path) for path in own.keep_if_changes or {}]
    places: list[tuple[tuple[str | int, ...], str]] = [(("grid", path), path) for path in axes]
    steps: list[tuple[tuple[str | int, ...], str]] = [(("zip", path), path) for path in zipped]
    problems = [
        document.problem(f"is drawn as well (trajectories.draw: {other}); a field has one source", at, at_key=True)
        for at, path in [*places, *steps, *listed, *tried]
        for other in drawn
        if _overlap(path, other)
    ]
    problems += [
        document.problem(f"is an axis of the grid as well ({other}); a field has one source", at, at_key=True)
        for at, path in [*listed, *steps]
        for other in axes
        if _overlap(path, other)
    ]
    problems += [
        document.problem(f"is zipped as well ({other}); a field has one source", at, at_key=True)
        for at, path in listed
        for other in zipped
        if _overlap(path, other)
    ]
    lengths = {path: len(values) for path, values in own.file.zip_.items()}
    longest = max(lengths.values(), default=0)
    problems += [
        document.problem(f"has {length} values beside {longest}: zipped fields go together", ("zip", path), at_key=True)
        for path, length in lengths.items()
        if length != longest
    ]
    for path, values in own.file.grid.items():
        doubled = next((value for i, value in enumerate(values) if value in values[:i]), None)
        if doubled is not None:
            problems.append(document.problem(f"{doubled!r} stands twice", ("grid", path), at_key=True))
    if problems:
        raise SpecError(problems)


def _overlap(one: str, other: str) -> bool:
    return f"{one}.".startswith(f"{other}.") or f"{other}.".startswith(f"{one}.")


def check_controller_keys(base: Document, kinds: set[str]) -> None:
    """A controller's key must be known to one of the kinds in the sweep, else it is misspelt."""
    written = base.value.get("controller")
    known = {name for kind in kinds for name in controllers()[kind].spec.model_fields}
    if not isinstance(written, dict) or not known:
        return
    if written.get("kind", next(iter(kinds))) not in controllers():
        return  # the run itself is refused, by its kind
    problems = [
        base.problem(f"unknown key{hint(key, known)}", ("controller", key), at_key=True)
        for key in written
        if key not in known
    ]
    if problems:
        raise SpecError(problems)


def check_changed_keys(document: Document, own: OwnSection, kinds: set[str]) -> None:
    """The same for the keys that grid, list and filter change: `fitted` would drop them without a word."""
    known = {name for kind in kinds for name in controllers()[kind].spec.model_fields}
    places: list[tuple[tuple[str | int, ...], str]] = [(("grid", path), path) for path in own.file.grid]
    places += [(("zip", path), path) for path in own.file.zip_]
    places += [(("list", i, path), path) for i, entry in enumerate(own.file.list_) for path in entry]
    places += [(("trajectories", "keep_if", "with", path), path) for path in own.keep_if_changes or {}]
    problems = []
    for at, path in places:
        head, _, key = path.partition(".")
        key = key.partition(".")[0]
        if head == "controller" and key and known and key not in known:
            problems.append(document.problem(f"unknown key{hint(key, known)}", at, at_key=True))
    if problems:
        raise SpecError(problems)


def check_expected(document: Document, own: OwnSection, configurations: list[dict[str, Node]]) -> None:
    """``expect_failures`` must speak of configurations that there are."""
    expected = own.file.expect_failures
    if not isinstance(expected, dict):
        return
    for path, value in expected.items():
        values = [configuration[path].value for configuration in configurations if path in configuration]
        if value not in values:
            known = {path for configuration in configurations for path in configuration}
            text = f"no configuration has {path}: {value!r}" + (hint(path, known) if path not in known else "")
            raise SpecError(document.problem(text, ("expect_failures", path), at_key=True))
