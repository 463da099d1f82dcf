"""The networks of one training run, with what tells whose they are."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from fzcli.errors import SpecError
from fzcli.learn.judge import Trained
from fzcli.learn.neural import NeuralKinematics
from fzcli.learn.train_spec import ArmInverseSpec, PlanarForwardSpec, RefineSpec, TrainRun
from fzcli.spec.any_robot import AnyRobot
from fzcli.spec.hashing import spec_hash
from fzcli.spec.planar import Planar3RRR


@dataclass(frozen=True)
class NetworkSet:
    """Trained networks by label, the labels that were skipped and why, and where they come from.

    ``spec`` is the resolved run without its robot; ``kinematics`` is what of the robot its kinematics depend on.
    """

    robot: str
    kinematics: dict[str, Any]
    spec: dict[str, Any]
    versions: dict[str, str]
    trained: Mapping[str, Trained]
    skipped: Mapping[str, str]

    @staticmethod
    def of(spec: TrainRun, trained: Mapping[str, Trained], skipped: Mapping[str, str]) -> "NetworkSet":
        """What a run has trained."""
        resolved = spec.model_dump(mode="json", exclude={"robot"}, by_alias=True)
        name = str(spec.robot.name)
        return NetworkSet(name, kinematics_of(spec.whole_robot), resolved, _versions(), trained, skipped)

    @property
    def robot_hash(self) -> str:
        """SHA-256 of the robot's kinematics."""
        return spec_hash(self.kinematics)

    @property
    def refine(self) -> RefineSpec:
        """Newton steps and gate that the networks were judged with."""
        return RefineSpec.model_validate(self.spec["refine"])

    def check_robot(self, robot: AnyRobot, where: str = "the networks") -> None:
        """Raises SpecError unless the networks were trained for a robot of these kinematics."""
        own = kinematics_of(robot)
        if spec_hash(own) == self.robot_hash:
            return
        field, trained, has = next(_differences(self.kinematics, own, ""), ("", "", ""))
        text = f"{where} were trained for the robot {self.robot!r}, not for {robot.name!r}"
        raise SpecError(f"{text}: {field} was {trained} there and is {has} here" if field else text)

    def kinematics_for(self, robot: AnyRobot, where: str = "the networks") -> NeuralKinematics:
        """The networks ready for use with a robot. Raises SpecError where they were trained for another."""
        from fzcli.learn.train import kinematic_map

        self.check_robot(robot, where)
        made: PlanarForwardSpec | ArmInverseSpec
        planar = self.spec["map"]["kind"] == "planar_forward"
        made = (PlanarForwardSpec if planar else ArmInverseSpec).model_validate(self.spec["map"])
        networks = {label: one.network for label, one in self.trained.items()}
        return NeuralKinematics(kinematic_map(robot, made), networks, self.refine)


def kinematics_of(robot: AnyRobot) -> dict[str, Any]:
    """What of a robot its kinematics relative to the base depend on: no masses, colours or names of its own."""
    if isinstance(robot, Planar3RRR):
        found: dict[str, Any] = robot.model_dump(mode="json", include={"kind", "base", "platform", "legs"})
        del found["legs"]["radius"]
        return found
    links = [
        link.model_dump(mode="json", include={"name", "parent", "at"})
        | {"joint": link.joint.model_dump(mode="json", include={"name", "type", "axis", "position"})}
        for link in robot.links
    ]
    tips = {name: tip.model_dump(mode="json") for name, tip in robot.tips.items()}
    return {"kind": "robot", "links": {link["name"]: link for link in links}, "tips": tips}


def _differences(one: Any, other: Any, path: str) -> Any:
    """Fields in which two values differ: path, and the value in each."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in dict.fromkeys([*one, *other]):
            inner = f"{path}.{key}" if path else str(key)
            yield from _differences(one.get(key, "absent"), other.get(key, "absent"), inner)
    elif one != other:
        yield path, _short(one), _short(other)


def _short(value: Any) -> str:
    return "present" if isinstance(value, dict) else str(value)


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for name in ("fzcli", "numpy", "casadi", "scikit-learn"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "source tree" if name == "fzcli" else "absent"
    return found
