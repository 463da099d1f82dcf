"""Planar robots, training runs and network files as lines of text."""

import math
from typing import TYPE_CHECKING

from fzcli.cli.describe import aligned

if TYPE_CHECKING:
    from fzcli.learn.network_set import NetworkSet
    from fzcli.learn.train_spec import TrainRun
    from fzcli.spec.planar import Planar3RRR


def describe_planar(robot: "Planar3RRR") -> list[str]:
    """The dimensions of a planar 3-RRR, and how many ways it has."""
    legs, drives = robot.legs, robot.drives
    facts = {"robot": f"{robot.name}, planar 3-RRR", "about": robot.about}
    for name, triangle in (("base", robot.base), ("platform", robot.platform)):
        corners = ", ".join(f"{math.degrees(angle):g}" for angle in triangle.angles)
        facts[name] = f"corners {triangle.radius:g} m from its centre, at {corners} deg"
    facts["legs"] = f"{legs.proximal:g} m and {legs.distal:g} m; half as wide as {legs.radius:g} m"
    limits = [f"{math.degrees(end):.6g}" for end in drives.position] if drives.position else []
    stated = [f"{' to '.join(limits)} deg"] if limits else []
    stated += [f"{math.degrees(drives.speed):.6g} deg/s"] if drives.speed else []
    facts["drives"] = ", ".join(stated) or "no limits stated"
    facts["modes"] = "8 inverse solutions (working modes), up to 6 forward ones"
    return aligned([(name, value) for name, value in facts.items() if value])


def describe_train(spec: "TrainRun") -> list[str]:
    """What is trained, on what, how."""
    from fzcli.learn.train import kinematic_map

    learned = kinematic_map(spec.whole_robot, spec.map)
    facts = {
        "kind": "train",
        "about": spec.about,
        "robot": str(spec.robot.name),
        "map": f"{', '.join(learned.input_names)} -> {', '.join(learned.output_names)}",
        "networks": f"{len(learned.labels)}: {'; '.join(learned.labels)}",
        "layers": f"{', '.join(map(str, spec.network.hidden))} {spec.network.activation} units",
        "trainer": spec.trainer.kind,
        "samples": f"{spec.samples.train} to train, {spec.samples.test} to test",
    }
    return aligned([(name, value) for name, value in facts.items() if value])


def describe_networks(networks: "NetworkSet") -> list[str]:
    """Whose networks a file holds, how they were trained, and their errors."""
    from fzcli.cli.network_table import network_table
    from fzcli.cli.options import TableFormat

    facts = {
        "networks": f"{len(networks.trained)} of the robot {networks.robot} ({networks.robot_hash[:12]})",
        "map": str(networks.spec["map"]["kind"]),
        "trainer": str(networks.spec["trainer"]["kind"]),
        "versions": ", ".join(f"{name} {one}" for name, one in networks.versions.items()),
        "skipped": ", ".join(networks.skipped),
    }
    lines = aligned([(name, value) for name, value in facts.items() if value])
    return [*lines, "", *network_table(networks, TableFormat.rich).splitlines()]
