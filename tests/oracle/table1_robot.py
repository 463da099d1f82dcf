"""The paper's 4R test bed typed in by hand, apart from robots/bulgarelli4.yaml."""

import numpy as np
from numpy.typing import NDArray

from fzcli.spec.robot import Base, Frame, Joint, Link, Robot, Tip

CENTRE = np.array([0.928, -1.393, 0.303, 0.549])  # of the start postures [rad]
HALF_WIDTH = 0.49  # rad
LENGTHS = {"link7": 1.0, "link8": 1.0, "link9": 1.0, "link10": 0.5}  # m
ALONG = {"link7": "z", "link8": "x", "link9": "z", "link10": "z"}
AXES = {
    "link7": (0.0, 1.0, 0.0),
    "link8": (0.0, 1.0, 0.0),
    "link9": (0.0, 1.0, 0.0),
    "link10": (1.0, 0.0, 0.0),
}


def bulgarelli4() -> Robot:
    """Masses, lengths and inertias of Bulgarelli 2011, Table 1; axes and mount reconstructed."""
    at, parent = np.array([0.0, 0.0, 0.15]), "base"
    links = []
    for number, (name, length) in enumerate(LENGTHS.items(), start=1):
        k = "xyz".index(ALONG[name])
        moments = np.full(3, 0.1892 if name == "link10" else 0.3358)
        moments[k] = 0.0450
        joint = Joint(name=f"q{number}", type="revolute", axis=AXES[name])
        along = length * np.eye(3)[k]
        links.append(
            Link(
                name=name,
                parent=parent,
                at=Frame(xyz=(float(at[0]), float(at[1]), float(at[2]))),
                joint=joint,
                mass=4.0,
                com=(float(along[0]) / 2, float(along[1]) / 2, float(along[2]) / 2),
                inertia=(float(moments[0]), float(moments[1]), float(moments[2]), 0.0, 0.0, 0.0),
            )
        )
        at, parent = along, name
    base = Base(mass=16.0, inertia=(0.576, 0.576, 0.576, 0.0, 0.0, 0.0))
    hand = Tip(link="link10", xyz=(0.0, 0.0, 0.5))
    return Robot(name="bulgarelli4", base=base, links=tuple(links), tips={"hand": hand})


def draw_start_and_line(
    rng: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.float64], float, float]:
    """One candidate trajectory: q0 (4,) [rad], direction (3,), length [m], duration [s]."""
    q0 = CENTRE + rng.uniform(-HALF_WIDTH, HALF_WIDTH, 4)
    direction = rng.standard_normal(3)
    length, duration = rng.uniform(0.29, 0.89), rng.uniform(10.0, 15.0)
    return q0, direction / np.linalg.norm(direction), float(length), float(duration)
