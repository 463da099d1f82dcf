"""URDF as a dialect: against Pinocchio's reading of the same file, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from fzcli.errors import SpecError
from fzcli.spec.load import load_robot
from fzcli.spec.physics import rotation_of, tensor

URDF = """<?xml version="1.0"?>
<robot name="twig">
  <!-- a branched tree with a mesh that does not exist -->
  <link name="body">
    <inertial><origin xyz="0.1 0 0"/><mass value="20"/>
      <inertia ixx="2" iyy="2" izz="3" ixy="0.1" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="package://none/mesh.stl"/></geometry></visual>
  </link>
  <link name="arm">
    <inertial><origin xyz="0 0 0.5" rpy="0.3 -0.2 1.1"/><mass value="4"/>
      <inertia ixx="0.3" iyy="0.35" izz="0.1" ixy="0.01" ixz="0.02" iyz="-0.03"/></inertial>
  </link>
  <link name="rail"><inertial><mass value="1"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="wheel"><inertial><mass value="1"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="base"/>
  <joint name="shoulder" type="revolute">
    <parent link="body"/><child link="arm"/><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 -0.6"/>
    <axis xyz="0 2 0"/><limit lower="-1" upper="2" velocity="3" effort="1"/>
  </joint>
  <joint name="slider" type="prismatic">
    <parent link="arm"/><child link="rail"/><origin xyz="0 0 1" rpy="0 1.5707963267948966 0"/>
    <limit lower="0" upper="0.5" velocity="0" effort="1"/>
  </joint>
  <joint name="spin" type="continuous">
    <parent link="body"/><child link="wheel"/><origin rpy="3.14159 0 0"/><axis xyz="0 0.6 0.8"/>
  </joint>
  <joint name="mark" type="fixed"><parent link="rail"/><child link="base"/><origin xyz="0 0 0.25"/></joint>
</robot>
"""


def written(folder: Path, text: str = URDF) -> Path:
    path = folder / "twig.urdf"
    path.write_text(text)
    return path


def test_it_becomes_the_same_spec(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path))
    assert robot.name == "twig"
    assert (robot.base.name, robot.base.floating, robot.base.mass) == ("body", True, 20)
    assert (robot.base.com, robot.base.inertia) == ((0.1, 0, 0), (2, 2, 3, 0.1, 0, 0))
    assert [(link.name, link.parent) for link in robot.links] == [
        ("arm", "base"),
        ("rail", "arm"),
        ("base_frame", "rail"),
        ("wheel", "base"),
    ]
    arm, rail, mark, wheel = robot.links
    assert (arm.joint.name, arm.joint.axis, arm.joint.position, arm.joint.speed) == (
        "shoulder",
        (0, 1, 0),
        (-1, 2),
        3,
    )
    assert (rail.joint.type, rail.joint.axis, rail.joint.speed) == ("prismatic", (1, 0, 0), None)
    assert (mark.mass, mark.joint.type) == (0, "fixed")
    assert (wheel.joint.position, wheel.joint.axis) == (None, (0, 0.6, 0.8))
    assert {name: tip.link for name, tip in robot.tips.items()} == {
        "base_frame": "base_frame",
        "wheel": "wheel",
    }


def test_pinocchio_reads_the_same_robot(tmp_path: Path) -> None:
    pin = pytest.importorskip("pinocchio")
    path = written(tmp_path)
    model = pin.buildModelFromUrdf(str(path))
    robot = load_robot(path)
    for link in robot.links:
        if link.joint.type == "fixed":
            continue
        index = model.getJointId(link.joint.name)
        place = model.jointPlacements[index]
        np.testing.assert_allclose(rotation_of(link.at.rpy), place.rotation, atol=1e-14)
        np.testing.assert_allclose(link.at.xyz, place.translation, atol=1e-14)
        body = model.inertias[index]
        assert body.mass == pytest.approx(link.mass)
        np.testing.assert_allclose(link.com, body.lever, atol=1e-14)
        np.testing.assert_allclose(tensor(link.inertia), body.inertia, atol=1e-14)


def test_a_yaml_file_may_name_it_and_replace_base_and_tips(tmp_path: Path) -> None:
    written(tmp_path)
    file = tmp_path / "mine.yaml"
    file.write_text(
        "kind: robot\nname: mine\nurdf: twig.urdf\nbase: {floating: false}\n"
        "tips: {t: {link: rail, xyz: [0, 0, 1]}}\n"
    )
    robot = load_robot(file)
    assert (robot.name, robot.base.floating, robot.base.mass) == ("mine", False, 20)
    assert {name: (tip.link, tip.xyz) for name, tip in robot.tips.items()} == {"t": ("rail", (0, 0, 1))}
    file.write_text("kind: robot\nurdf: twig.urdf\nbase: {mass: 7, inertia: [1, 1, 1]}\n")
    assert (load_robot(file).base.mass, load_robot(file).base.com) == (7, (0, 0, 0))
    file.write_text("kind: robot\nurdf: twg.urdf\n")
    with pytest.raises(SpecError, match=r"mine.yaml:2:7: urdf: no such file 'twg.urdf'"):
        load_robot(file)


ARM_INERTIAL = URDF[
    URDF.index('    <inertial><origin xyz="0 0 0.5"') : URDF.index('  </link>\n  <link name="rail"')
]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</robot>", "", "not XML: no element found"),
        ("<robot name", "<robt name", "not XML: mismatched tag"),
        (
            '<?xml version="1.0"?>',
            "<!DOCTYPE a [<!ENTITY b 'c'>]>",
            "a URDF needs no DOCTYPE or ENTITY; remove it",
        ),
        (
            'type="continuous"',
            'type="planar"',
            "joint 'spin': type 'planar' is not supported; known: revolute, continuous, prismatic, fixed",
        ),
        (
            '<axis xyz="0 2 0"/>',
            '<axis xyz="0 2 0"/><mimic joint="slider"/>',
            "joint 'shoulder': mimic joints are not supported",
        ),
        (
            '<axis xyz="0 2 0"/>',
            '<axis xyz="0 0 0"/>',
            "joint 'shoulder': axis must have a direction, got a zero vector",
        ),
        ('lower="-1"', 'lower="5"', "joint 'shoulder': lower limit must be below the upper one, got 5 and 2"),
        (
            '<parent link="arm"/>',
            '<parent link="arn"/>',
            "joint 'slider': unknown parent link 'arn'; did you mean 'arm'?",
        ),
        (
            '<child link="wheel"/>',
            '<child link="arm"/>',
            "link 'arm' is carried by two joints, 'shoulder' and 'spin'; a tree has no closed chains",
        ),
        (
            '<parent link="body"/><child link="arm"/>',
            '<parent link="rail"/><child link="arm"/>',
            "links form a loop: ",
        ),
        ('izz="0.1" ixy="0.01"', 'izz="9" ixy="0.01"', "link 'arm': no body has the principal moments"),
        ('<mass value="4"/>', '<mass value="-4"/>', "link 'arm': mass must be > 0, got -4 kg"),
        (
            '<mass value="4"/>',
            '<mass value="nan"/>',
            "link 'arm': <inertial> holds numbers that are not finite",
        ),
        ('<mass value="4"/>', "", "link 'arm': <inertial> needs <mass> and <inertia>"),
        ('<mass value="4"/>', '<mass value="heavy"/>', "not a URDF: "),
        (
            'izz="0.1" ixy="0.01"',
            'izz="inf" ixy="0.01"',
            "link 'arm': <inertial> holds numbers that are not finite",
        ),
        ('velocity="3"', 'velocity="inf"', "joint 'shoulder': <limit> holds numbers that are not finite"),
        (
            'xyz="0.1 0.2 0.3"',
            'xyz="0.1 0.2"',
            "joint 'shoulder': xyz of <origin> must be three numbers, got '0.1 0.2'",
        ),
        (
            'rpy="3.14159 0 0"',
            'rpy="a 0 0"',
            "joint 'spin': rpy of <origin> must be three numbers, got 'a 0 0'",
        ),
        ('<child link="wheel"/>', "", "joint 'spin' needs <child link=\"...\"/>"),
        ('joint name="spin"', "joint", "a <joint> without a name"),
    ],
)
def test_what_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in URDF
    with pytest.raises(SpecError) as caught:
        load_robot(written(tmp_path, URDF.replace(old, new)))
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "twig.urdf"))


def test_a_floating_base_without_inertia_is_named(tmp_path: Path) -> None:
    start = URDF.index('    <inertial><origin xyz="0.1')
    text = URDF[:start] + URDF[URDF.index("    <visual>") :]
    with pytest.raises(
        SpecError, match="base link 'body' floats but has no inertia; give it one, or name this URDF"
    ):
        load_robot(written(tmp_path, text))
    file = tmp_path / "fixed.yaml"
    file.write_text("kind: robot\nurdf: twig.urdf\nbase: {floating: false}\n")
    assert load_robot(file).base.mass == 0


def test_no_robot_inside(tmp_path: Path) -> None:
    for text, message in (
        ("<sdf/>", "not a URDF: the outermost element must be <robot>"),
        ("<robot name='r'/>", "needs exactly one root link, has none"),
        ("<robot name='r'><link name='a'/><link name='b'/></robot>", "needs exactly one root link, has a, b"),
        ("", "not XML: no element found"),
    ):
        with pytest.raises(SpecError) as caught:
            load_robot(written(tmp_path, text))
        assert message in str(caught.value)
