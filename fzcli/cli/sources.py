"""What a command is pointed at: result files, and YAML files by path or name; and where results go."""

from dataclasses import dataclass
from pathlib import Path

from fzcli.errors import SpecError, UsageError

KINDS = ("robot", "planar_3rrr", "rulebase", "simulate", "sweep", "plan", "train", "tune")
_FOLDERS = ("robots", "rulebases", "runs")


def find_any(source: str) -> Path:
    """The file that a path, or the bare name of a robot, rule base or run, means.

    Raises:
        SpecError: there is none; the nearest names are given.
    """
    from fzcli.spec.library import FOLDERS, find

    if source == "-" or Path(source).exists():
        return Path(source)
    if Path(source).suffix or len(Path(source).parts) > 1:
        return find("runs", source)
    found = []
    for folder in FOLDERS:
        try:
            found.append(find(folder, source))
        except SpecError:
            continue
    return found[0] if found else _refuse(source)


def _refuse(source: str) -> Path:
    from fzcli.spec.library import shipped_root
    from fzcli.spec.nearest import hint

    places = [Path(folder) for folder in _FOLDERS] + [shipped_root() / folder for folder in _FOLDERS]
    known = {item.stem for place in places if place.is_dir() for item in place.glob("*.yaml")}
    raise SpecError(f"no file, robot, rule base or run named '{source}'{hint(source, sorted(known))}")


def is_result(path: Path) -> bool:
    """Whether the file is HDF5, or is called so."""
    if path.suffix.lower() in (".h5", ".hdf5"):
        return True
    try:
        with path.open("rb") as file:
            return file.read(8) == b"\x89HDF\r\n\x1a\n"
    except OSError:
        return False


@dataclass(frozen=True)
class RunSource:
    """A run file: ``path`` to read (or "-"), the ``name`` of its results and the ``folder`` they go to."""

    path: Path | str
    name: str
    folder: Path

    def output(self, asked: Path | None, suffix: str = ".h5") -> Path:
        """The file to write: ``asked``, NAME.h5 in it if it is a folder, else FOLDER/NAME/NAME.h5.

        Raises:
            UsageError: there is something of that name that is no file, such as a device.
        """
        if asked is None:
            path = self.folder / self.name / f"{self.name}{suffix}"
        elif asked.is_dir() or (not asked.suffix and not asked.exists()):
            path = asked / f"{self.name}{suffix}"
        else:
            path = asked
        if path.exists() and not path.is_file():
            raise UsageError(f"{path}: is there already, and is not a file")
        return path


def run_source(run: str) -> RunSource:
    """Where a run is read from and its results go: beside a local file, else into ./runs.

    Raises:
        SpecError: there is no such run; the nearest names are given.
        UsageError: it is a result.
    """
    from fzcli.spec.library import find, shipped_root

    if run == "-":
        return RunSource("-", "stdin", Path("runs"))
    path = find("runs", run)
    if is_result(path):
        raise UsageError(f"{run}: is a result; name the run that it comes from, and the result itself with -o")
    by_name = not Path(run).suffix and len(Path(run).parts) == 1
    shipped = by_name and path.resolve().parent == (shipped_root() / "runs").resolve()
    return RunSource(path, path.stem, Path("runs") if shipped else path.parent)
