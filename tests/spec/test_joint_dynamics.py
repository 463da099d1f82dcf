"""Torque limits and friction of joints, in every dialect of a robot."""

from pathlib import Path

import pytest

from fzcli.errors import SpecError
from fzcli.spec.load import load_robot, robot_of
from fzcli.spec.reader import read_text
from fzcli.spec.robot import Friction, Joint

FRAMES = """kind: robot
base: {{mass: 10, inertia: [1, 1, 1]}}
links:
- name: one
  joint: {{name: q1, {}}}
  mass: 2
  inertia: [0.1, 0.1, 0.1]
tips: {{hand: {{link: one}}}}
"""
TABLE = """kind: robot
base: {{mass: 10, inertia: [1, 1, 1]}}
dh:
  convention: standard
  rows:
  - {{name: q1, theta: 0, d: 0, a: 1, alpha: 0, mass: 2, inertia: [0.1, 0.1, 0.1], {}}}
"""
URDF = """<robot name="twig">
  <link name="body"><inertial><mass value="20"/>
    <inertia ixx="2" iyy="2" izz="3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="arm"><inertial><mass value="4"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="q1" type="revolute"><parent link="body"/><child link="arm"/><axis xyz="0 0 1"/>{}</joint>
</robot>
"""


def _joint(text: str) -> Joint:
    return robot_of(read_text(text, "x.yaml")).links[0].joint


def _problem(text: str) -> str:
    with pytest.raises(SpecError) as caught:
        _joint(text)
    (problem,) = caught.value.problems
    return str(problem).split("\n")[0]


@pytest.mark.parametrize("dialect", [FRAMES, TABLE])
def test_effort_and_friction_are_read(dialect: str) -> None:
    text = "effort: 150 N m, friction: {viscous: 0.5 N m s/rad, coulomb: 2, smoothing: 3 deg/s}"
    joint = _joint(dialect.format(text))
    assert joint.effort == 150
    assert joint.friction is not None
    assert (joint.friction.viscous, joint.friction.coulomb) == (0.5, 2)
    assert joint.friction.smoothing == pytest.approx(0.0523598775598)
    bare = _joint(dialect.format("type: revolute"))
    assert bare.effort is None
    assert bare.friction is None


def test_a_sliding_joint_has_forces() -> None:
    joint = _joint(FRAMES.format("type: prismatic, effort: 20 N, friction: {viscous: 5 N s/m, smoothing: 1 mm/s}"))
    assert joint.effort == 20
    assert joint.friction == Friction(viscous=5, coulomb=0, smoothing=0.001)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("effort: -5", "links.one.joint.effort: must be > 0, got -5"),
        ("effort: 0", "links.one.joint.effort: must be > 0, got 0"),
        ("effort: 5 N", "'5 N' is a force; a torque is wanted, e.g. '2 N m'"),
        ("type: fixed, effort: 5", "links.one.joint.effort: a fixed joint has no torque limit"),
        ("type: fixed, friction: {viscous: 1}", "links.one.joint.friction: a fixed joint has no friction"),
        ("friction: {viscous: -1}", "links.one.joint.friction.viscous: "),
        ("friction: {coulomb: -1}", "links.one.joint.friction.coulomb: "),
        ("friction: {coulomb: 1, smoothing: 0}", "links.one.joint.friction.smoothing: "),
        ("friction: {viscous: 1 N m}", "'1 N m' is a torque; a rotational damping or a damping is wanted"),
        ("friction: {static: 1}", "static"),
    ],
)
def test_what_cannot_be_is_refused(text: str, expected: str) -> None:
    assert expected in _problem(FRAMES.format(text))


def _urdf(tmp_path: Path, lines: str) -> Joint:
    file = tmp_path / "twig.urdf"
    file.write_text(URDF.format(lines))
    return load_robot(file).links[0].joint


def test_urdf_limits_and_dynamics_are_read(tmp_path: Path) -> None:
    lines = '<limit lower="-1" upper="1" velocity="1" effort="{}"/>'
    joint = _urdf(tmp_path, lines.format(30) + '<dynamics damping="0.4" friction="1.5"/>')
    assert joint.effort == 30
    assert joint.friction == Friction(viscous=0.4, coulomb=1.5)
    unsaid = _urdf(tmp_path, lines.format(0) + '<dynamics damping="0" friction="0"/>')
    assert unsaid.effort is None
    assert unsaid.friction is None


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (
            '<limit lower="-1" upper="1" velocity="1" effort="-3"/>',
            "joint 'q1': effort limit must be > 0 and finite, got -3",
        ),
        (
            '<limit lower="-1" upper="1" velocity="1" effort="1"/><dynamics damping="-0.1"/>',
            "joint 'q1': damping and friction must be >= 0 and finite, got -0.1 and 0",
        ),
    ],
)
def test_urdf_limits_that_cannot_be_are_refused(tmp_path: Path, lines: str, expected: str) -> None:
    with pytest.raises(SpecError) as caught:
        _urdf(tmp_path, lines)
    assert expected in str(caught.value)
