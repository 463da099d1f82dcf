"""Short trainings that the tests of this folder share."""

from typing import Any

from fzcli.learn.train import train_of
from fzcli.learn.train_spec import TrainRun
from fzcli.spec.document import document_of

PLANAR: dict[str, Any] = {
    "kind": "train",
    "robot": "rrr_planar",
    "map": {"kind": "planar_forward", "radius": 0.1, "turn": "15 deg", "modes": ["+++", "++-"], "off_singular": 0.1},
    "samples": {"train": 600, "test": 300},
    "seed": 3,
    "trainer": {"kind": "levenberg_marquardt", "iterations": 60, "starts": 2},
}
ARM: dict[str, Any] = {
    "kind": "train",
    "robot": "melfa_rv1a",
    "map": {
        "kind": "arm_inverse",
        "branches": ["front, elbow up, noflip"],
        "joints": {
            "J1": ["-30 deg", "30 deg"],
            "J2": ["0 deg", "40 deg"],
            "J3": ["80 deg", "120 deg"],
            "J4": ["-40 deg", "40 deg"],
            "J5": ["20 deg", "70 deg"],
            "J6": ["-60 deg", "60 deg"],
        },
    },
    "samples": {"train": 2000, "test": 300},
    "network": {"hidden": [20]},
    "trainer": {"kind": "levenberg_marquardt", "iterations": 25, "starts": 1},
    "refine": {"steps": [1, 3, 5]},
}


def run(base: dict[str, Any], **changes: Any) -> TrainRun:
    """A run with some of its sections changed."""
    return train_of(document_of({**base, **changes}))
