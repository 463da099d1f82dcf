"""Robot files in explicit frames: what they become, and every way in which one can be wrong."""

import contextlib
import copy
import math
from pathlib import Path

import numpy as np
import pytest

from fzcli.errors import SpecError
from fzcli.spec.document import document_of
from fzcli.spec.library import shipped_root
from fzcli.spec.load import load_robot, robot_of, rulebase_of
from fzcli.spec.physics import check_body, rotation_of, rpy_of
from fzcli.spec.reader import read, read_text
from fzcli.spec.robot import Robot

BASE = "base: {mass: 10, inertia: [1, 1, 1]}\n"
GOOD = f"""kind: robot
{BASE}links:
- name: one
  joint: {{name: q1}}
  mass: 2
  inertia: [0.1, 0.1, 0.1]
- name: two
  joint: {{name: q2, axis: y}}
  mass: 2
  inertia: [0.1, 0.1, 0.1]
tips: {{hand: {{link: two}}}}
"""


def robot(text: str) -> Robot:
    return robot_of(read_text(text, "x.yaml"))


def problems(text: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        robot(text)
    return [str(problem).split("\n")[0] for problem in caught.value.problems]


def with_link(lines: str) -> str:
    return f"kind: robot\n{BASE}links:\n{lines}\ntips: {{hand: {{link: one}}}}\n"


@pytest.mark.parametrize("name", ["bulgarelli4", "ur5_free_flyer", "planar3"])
def test_shipped_robots_load(name: str) -> None:
    loaded = load_robot(name)
    assert loaded.name == name
    assert loaded.base.floating
    assert loaded.about


def test_bulgarelli4_holds_table_1() -> None:
    loaded = load_robot("bulgarelli4")
    assert [link.name for link in loaded.links] == ["link7", "link8", "link9", "link10"]
    assert [link.joint.axis for link in loaded.links] == [(0, 1, 0), (0, 1, 0), (0, 1, 0), (1, 0, 0)]
    assert all(link.mass == 4 and link.joint.position is None for link in loaded.links)
    lengths = [np.linalg.norm(link.at.xyz) for link in loaded.links[1:]] + [
        np.linalg.norm(loaded.tips["hand"].xyz)
    ]
    assert lengths == [1, 1, 1, 0.5]
    for link in loaded.links:  # the small moment lies along the link
        assert np.argmax(np.abs(link.com)) == np.argmin(link.inertia[:3])


def test_defaults_and_units() -> None:
    loaded = robot(
        """
kind: robot
name: arm
base: {floating: false}
links:
- {name: a, at: {xyz: [100 mm, 0, 0], rpy: [90 deg, 0, 0]}, mass: 0}
- {name: b, joint: {name: j, type: prismatic, axis: [0, 3, -4], position: [-1 cm, 0.5], speed: 5 mm/s},
   mass: 500 g, com: [1 mm, 0, 0], inertia: [1, 2, 2, 0.1, 0.2, 0.3]}
tips: {t: {link: b, rpy: [0, 0, 180 deg]}}
"""
    )
    a, b = loaded.links
    assert (a.parent, b.parent) == ("base", "a")
    assert (a.joint.name, a.joint.type) == ("a_joint", "fixed")
    assert (a.at.xyz, a.at.rpy) == ((0.1, 0, 0), (math.pi / 2, 0, 0))
    assert b.joint.axis == (0, 0.6, -0.8)
    assert (b.joint.position, b.joint.speed) == ((-0.01, 0.5), 0.005)
    assert (b.mass, b.com) == (0.5, (0.001, 0, 0))
    assert b.inertia == (1, 2, 2, 0.1, 0.2, 0.3)
    assert loaded.tips["t"].rpy == (0, 0, math.pi)
    assert (loaded.base.floating, loaded.base.mass) == (False, 0.0)


def test_links_come_depth_first_with_children_in_file_order() -> None:
    lines = "".join(
        f"- {{name: {name}, parent: {parent}, mass: 0, joint: {{name: q_{name}}}}}\n"
        for name, parent in [("d", "b"), ("a", "base"), ("c", "base"), ("b", "a"), ("e", "a"), ("one", "d")]
    )
    assert [link.name for link in robot(with_link(lines)).links] == ["a", "b", "d", "one", "e", "c"]


LINK = "- {{name: one, mass: 1, inertia: [1, 1, 1], joint: {{name: q, {}}}}}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            GOOD.replace("mass: 2", "mas: 2", 1),
            "x.yaml:6:3: links.one.mas: unknown key; did you mean 'mass'?",
        ),
        (GOOD.replace("mass: 2", "mass: -2", 1), "x.yaml:6:9: links.one.mass: must be > 0, got -2 kg"),
        (
            GOOD.replace("mass: 2", "mass: 0", 1),
            "x.yaml:7:12: links.one.inertia: mass must be > 0, got 0 kg with an "
            "inertia (both 0: a massless frame)",
        ),
        (
            GOOD.replace("mass: 2", "mass: 2 m", 1),
            "x.yaml:6:9: links.one.mass: '2 m' is a length; a mass is wanted, e.g. '16 kg'",
        ),
        (
            GOOD.replace("mass: 2", "mass: .nan", 1),
            "x.yaml:6:9: links.one.mass: must be a finite number, got nan",
        ),
        (
            GOOD.replace("[0.1, 0.1, 0.1]", "[1, 2, 3.5]", 1),
            "x.yaml:7:12: links.one.inertia: no body has the principal "
            "moments 1, 2, 3.5 kg m2: 1 + 2 < 3.5 breaks the triangle inequality",
        ),
        (
            GOOD.replace("[0.1, 0.1, 0.1]", "[1, 1, 1, 2, 0, 0]", 1),
            "x.yaml:7:12: links.one.inertia: inertia must be "
            "positive definite, its principal moments are -1, 1, 3 kg m2",
        ),
        (
            GOOD.replace("[0.1, 0.1, 0.1]", "[1, 1]", 1),
            "x.yaml:7:12: links.one.inertia: needs 3 numbers (xx yy zz) or 6 (xx yy zz xy xz yz), has 2",
        ),
        (
            GOOD.replace("  inertia: [0.1, 0.1, 0.1]\n", "", 1),
            "x.yaml:4:3: links.one: inertia is missing: xx yy zz [xy xz yz] about the CoM, kg m2",
        ),
        (
            GOOD.replace("- name: two\n", "- name: two\n  parent: onne\n"),
            "x.yaml:9:11: links.two.parent: unknown parent 'onne'; did you mean 'one'?",
        ),
        (
            GOOD.replace("- name: one\n", "- name: one\n  parent: two\n"),
            "x.yaml:5:11: links.one.parent: links form a loop: "
            "one -> two -> one (each is carried by the next)",
        ),
        (GOOD.replace("name: two", "name: one"), "x.yaml:8:9: links.1.name: link 'one' stands twice"),
        (GOOD.replace("q2", "q1"), "x.yaml:9:17: links.two.joint.name: joint 'q1' stands twice"),
        (
            GOOD.replace("link: two", "link: tow"),
            "x.yaml:12:21: tips.hand.link: unknown link 'tow'; did you mean 'two'?",
        ),
        (
            GOOD.replace("name: one", "name: base"),
            "x.yaml:4:9: links.base.name: the name base belongs to the base body",
        ),
        (
            GOOD.replace("name: one", "name: a.b"),
            "x.yaml:4:9: links.0.name: a name holds letters, digits, _ and -, got 'a.b'",
        ),
        (GOOD.replace("kind: robot", "kind: sweep"), "x.yaml:1:7: kind: robot is wanted, got 'sweep'"),
        (GOOD.replace("kind: robot\n", ""), "x.yaml:1:1: kind is missing; robot is wanted"),
        (GOOD + "dh: {}\n", "x.yaml:1:1: needs one of links, dh and urdf, has links and dh"),
        (f"kind: robot\n{BASE}", "x.yaml:1:1: needs one of links, dh and urdf"),
        (
            GOOD.replace("mass: 10, ", ""),
            "x.yaml:2:17: base.inertia: mass must be > 0, got 0 kg with an inertia (both 0: a "
            "massless frame)",
        ),
        (
            GOOD.replace("{mass: 10, inertia: [1, 1, 1]}", "{}"),
            "x.yaml:2:7: base: a floating base needs mass > 0 and inertia; say floating: false to fix it",
        ),
        (with_link("- {name: one, joint: {name: q}}"), "x.yaml:4:3: links.one.mass: is missing"),
        (
            with_link("- {name: one, mass: 0}"),
            "x.yaml:4:1: links: no joint moves: at least one must not be fixed",
        ),
        (
            with_link("- {name: one, mass: 0, joint: {axis: z}}"),
            "x.yaml:4:31: links.one.joint: name is missing; a moving joint needs one",
        ),
        (
            with_link(LINK.format("type: revolut")),
            "x.yaml:4:67: links.one.joint.type: must be 'revolute', 'continuous', "
            "'prismatic' or 'fixed', got 'revolut'; did you mean 'revolute'?",
        ),
        (
            with_link(LINK.format("axis: [0, 0, 0]")),
            "x.yaml:4:67: links.one.joint.axis: must have a direction, got a zero vector",
        ),
        (
            with_link(LINK.format("axis: w")),
            "x.yaml:4:67: links.one.joint.axis: must be x, y, z, -x, -y, -z or three numbers, got 'w'",
        ),
        (
            with_link(LINK.format("position: [2, 1]")),
            "x.yaml:4:71: links.one.joint.position: lower limit must be below the upper one, got [2, 1]",
        ),
        (
            with_link(LINK.format("position: [1 m, 2]")),
            "x.yaml:4:71: links.one.joint.position: '1 m' is a length; an angle is wanted, e.g. '30 deg'",
        ),
        (
            with_link(LINK.format("type: prismatic, position: [1 deg, 2]")),
            "x.yaml:4:88: links.one.joint.position: '1 deg' is an angle; a length is wanted, e.g. '100 mm'",
        ),
        (
            with_link(LINK.format("type: continuous, position: [1, 2]")),
            "x.yaml:4:89: links.one.joint.position: a continuous "
            "joint has no position limits; make it revolute",
        ),
        (
            with_link(LINK.format("type: continuous, speed: 0")),
            "x.yaml:4:86: links.one.joint.speed: must be > 0, got 0",
        ),
    ],
)
def test_one_thing_wrong(text: str, message: str) -> None:
    assert problems(text) == [message]


def test_several_things_wrong_are_all_told() -> None:
    text = (
        GOOD.replace("mass: 2", "mass: -2", 1)
        .replace("axis: y", "axis: why")
        .replace("link: two", "lnk: two")
    )
    assert problems(text) == [
        "x.yaml:6:9: links.one.mass: must be > 0, got -2 kg",
        "x.yaml:9:27: links.two.joint.axis: must be x, y, z, -x, -y, -z or three numbers, got 'why'",
        "x.yaml:12:15: tips.hand.lnk: unknown key; did you mean 'link'?",
    ]


def test_a_loop_apart_from_the_base_is_found_once() -> None:
    lines = "".join(
        f"- {{name: {name}, parent: {parent}, mass: 0, joint: {{name: q_{name}}}}}\n"
        for name, parent in [("one", "base"), ("a", "b"), ("b", "c"), ("c", "a"), ("d", "a")]
    )
    assert problems(with_link(lines)) == [
        "x.yaml:5:21: links.a.parent: links form a loop: a -> b -> c -> a (each is carried by the next)"
    ]


def test_the_triangle_inequality_allows_thin_rods_and_printed_digits() -> None:
    check_body(1.0, (1e-12, 1.0, 1.0, 0, 0, 0))
    check_body(1.0, (0.5, 0.5, 1.0, 0, 0, 0))
    check_body(0.0, (0, 0, 0, 0, 0, 0))


def test_rpy_of_inverts_rotation_of() -> None:
    rng = np.random.default_rng(1)
    angles = [*rng.uniform(-3, 3, (50, 3)), *(np.pi / 2 * rng.integers(-2, 3, (50, 3)))]
    for rpy in angles:
        rotation = rotation_of(rpy)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
        np.testing.assert_allclose(rotation_of(rpy_of(rotation)), rotation, atol=1e-15)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"none.yaml: no such file"):
        load_robot(tmp_path / "none.yaml")


ODD = (
    None,
    True,
    -1,
    0,
    1e308,
    math.nan,
    "x",
    "5 kg",
    "30 deg",
    [],
    [1],
    [[1], {}],
    {},
    {"name": "q"},
    "base",
    10**30,
)


@pytest.mark.parametrize("name", ["robots/planar3", "robots/ur5_free_flyer", "rulebases/bulgarelli2011"])
def test_one_odd_value_anywhere_is_accepted_or_a_spec_error(name: str) -> None:
    document = read(shipped_root() / f"{name}.yaml")
    load = rulebase_of if name.startswith("rulebases") else robot_of
    rng = np.random.default_rng(7)
    for _ in range(400):
        value = copy.deepcopy(document.value)
        holder = value
        while True:
            key = rng.choice(list(holder)) if isinstance(holder, dict) else int(rng.integers(len(holder)))
            if not isinstance(holder[key], dict | list) or not holder[key] or rng.random() < 0.2:
                holder[key] = ODD[rng.integers(len(ODD))]
                break
            holder = holder[key]
        with contextlib.suppress(SpecError):
            load(document_of(value))
