"""Files of ``kind: planar_3rrr``."""

import pytest

from fzcli.errors import SpecError
from fzcli.spec.any_robot import load_any_robot, planar_of
from fzcli.spec.load import load_robot
from fzcli.spec.planar import Planar3RRR
from fzcli.spec.reader import read_text
from fzcli.spec.robot import Robot

TEXT = """\
kind: planar_3rrr
base: {radius: 400 mm, angles: [210 deg, 330 deg, 90 deg]}
platform: {radius: 100 mm, angles: [210 deg, 330 deg, 90 deg]}
legs: {proximal: 0.25, distal: 0.25}
drives: {position: [-90 deg, 90 deg], speed: 180 deg/s}
"""


def test_both_kinds_load_by_name() -> None:
    planar = load_any_robot("rrr_planar")
    assert isinstance(planar, Planar3RRR)
    assert planar.name == "rrr_planar"
    assert planar.legs.radius == 0.01
    assert isinstance(load_any_robot("ur5"), Robot)
    with pytest.raises(SpecError, match="robot is wanted, got 'planar_3rrr'"):
        load_robot("rrr_planar")


def test_units_are_converted() -> None:
    found = planar_of(read_text(TEXT))
    assert found.base.radius == 0.4
    assert found.drives.position == pytest.approx((-1.5707963, 1.5707963))
    assert found.base.corners[2] == pytest.approx((0.0, 0.4))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("330 deg, 90 deg]}\nplat", "-150 deg, 90 deg]}\nplat", "corners 1 and 2 stand at the same angle, 210 deg"),
        ("distal: 0.25", "distal: -0.25", "legs.distal: must be > 0"),
        ("distal: 0.25", "distal: 3 kg", "'3 kg' is a mass; a length is wanted"),
        ("-90 deg, 90 deg]", "90 deg, -90 deg]", "the lower limit must be below the upper one"),
        ("legs:", "leg:", "unknown key; did you mean 'legs'?"),
        ("radius: 100 mm", "radius: 0", "platform.radius: must be > 0"),
    ],
)
def test_mistakes_are_placed(old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(SpecError) as caught:
        planar_of(read_text(TEXT.replace(old, new), "bad.yaml"))
    assert message in str(caught.value)
    assert str(caught.value).startswith("bad.yaml:")
