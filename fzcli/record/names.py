"""Every name, unit and shape that a result file has by itself, in one place.

Names that a run brings along (signals, metrics, certificate entries, configuration and draw columns)
carry their own unit and meaning; everything else in a file is listed here.
"""

from dataclasses import dataclass

from fzcli.spec.quantity import Signal

FORMAT = 1  # raised when a reader of the old layout could misread the new one

QUATERNION = ("w", "x", "y", "z")
AXIS = ("x", "y", "z")
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")


@dataclass(frozen=True)
class Name:
    """A dataset: name, unit, meaning, and its dimensions (time first where it has one)."""

    name: str
    unit: str
    long_name: str
    dims: tuple[str, ...] = ()


# Trajectories of one run, in the order of the file; each is an attribute of Rollout.
TRAJECTORIES = (
    Name("q", "rad", "joint positions", ("time", "joint")),
    Name("qd", "rad/s", "joint velocities", ("time", "joint")),
    Name("base_position", "m", "origin of the base link's frame, world axes", ("time", "axis")),
    Name("base_quat", "1", "attitude of the base, body to world, w x y z", ("time", "quaternion")),
    Name(
        "base_twist",
        "m/s, rad/s",
        "twist of the base link's origin, linear first, world axes",
        ("time", "twist"),
    ),
    Name("tip_position", "m", "position of the tip, world axes", ("time", "axis")),
    Name("tip_quat", "1", "attitude of the tip, body to world, w x y z", ("time", "quaternion")),
)

# Dimensions and the coordinates that label them.
DIMENSIONS = {
    item.name: item
    for item in (
        Name("time", "s", "time since the start of the run"),
        Name("step", "1", "index of the sample"),
        Name("joint", "", "active joint"),
        Name("axis", "", "world axis"),
        Name("quaternion", "", "component of a quaternion"),
        Name("twist", "", "component of a twist, linear (m/s) then angular (rad/s), world axes"),
        Name("run", "1", "index of the run"),
        Name("config", "1", "index of the configuration"),
        Name("trajectory", "1", "index of the trajectory, the same in every configuration"),
        Name("kept", "1", "index of the run among those kept whole"),
        Name("shard", "1", "index of the shard among those that keep runs"),
    )
}

# Single values and columns that files add to what the runs bring along.
EXTRAS = {
    item.name: item
    for item in (
        Name("status", "1", "how the run ended"),
        Name("status_reason", "", "why the run ended so"),
        Name("status_advice", "", "what to try"),
        Name("config", "1", "index of the run's configuration"),
        Name("trajectory", "1", "index of the run's trajectory"),
        Name("role", "", "why the run was kept (best, median or worst), or the name of the variant"),
        Name("n_steps", "1", "samples of the run; what follows them is padding"),
        Name("spec_text", "", "the run's specification, resolved"),
        Name("spec_hash", "", "hash of the resolved specification"),
        Name("engine", "", "what computed the run"),
        Name("seed", "1", "root seed of the random draws"),
        Name("versions", "", "versions of the software, JSON"),
        Name("argv", "", "command line, JSON"),
        Name("configs_json", "", "the configuration, JSON"),
        Name("provenance_json", "", "origin of the kept run where it differs from the sweep's, JSON"),
        Name("shard_file", "", "file beside this one that keeps runs"),
        Name("shard_sha256", "", "hash of what is in it"),
        Name("shard_kept", "1", "runs that it keeps"),
        Name("table_json", "", "the table section of the specification, JSON"),
        Name("beside_csv", "", "published numbers to show beside the results, CSV"),
    )
}

# Columns of a sweep that index its rows: integers, not measurements.
INDEX_COLUMNS = ("config", "trajectory", "status")

# A signal of one of these names is stored as signal_NAME.
RESERVED = frozenset(DIMENSIONS) | frozenset(EXTRAS) | {item.name for item in TRAJECTORIES}

# Component labels that have a dimension of their own.
KNOWN_LABELS = {AXIS: "axis", QUATERNION: "quaternion", TWIST: "twist"}


def signal_of(name: str, info: Signal | None) -> Signal:
    """The description of a metric or signal, or a plain one made from its name where there is none."""
    if info is not None:
        return info
    if name in INDEX_COLUMNS:
        extra = EXTRAS[name]
        return Signal(name, extra.unit, extra.long_name)
    return Signal(name, "1", name.replace("_", " "))
