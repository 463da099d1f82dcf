"""Events and waits for which a run is over too early are refused, not left out without a word."""

import pytest

from fzcli.errors import SpecError
from fzcli.loop.run_file import runs_of
from fzcli.spec.reader import read_text
from fzcli.sweep.resolve import resolve

RUN = """\
kind: simulate
robot: bulgarelli4
start: {q: [0.928, -1.393, 0.303, 0.549]}
reference: {kind: line, direction: [1, 0.2, -0.5], length: 0.4, duration: 10 s}
controller: {kind: clik, gain: 10}
replay:
  controller: {kind: robust}
  grasp: {at: 6 s, mass: 0.5 kg, inertia: [0.002, 0.002, 0.002]}
  wrenches:
    - {on: base, force: [0.1, 0, 0], begin: 2 s, end: 30 s}
    - {on: tip, force: [0.1, 0, 0], begin: 10 s}
"""
LATE = RUN.replace("at: 6 s", "at: 10.01 s").replace("begin: 10 s", "begin: 60 s")
REACH = """\
kind: simulate
robot: ur5_free_flyer
start: {q: [0, -90 deg, 0, -90 deg, 0, 0]}
reference: {kind: target, position: [0.45, 0.45, 0.7]}
controller: {kind: dls, task: position, restart: {stall: 3 s}}
stop: {position: 5 mm, after: 2 s}
"""


def refused(text: str, *sets: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        runs_of(read_text(text, "run.yaml"), sets)
    assert caught.value.exit_code == 2
    return [str(problem).partition("\n")[0] for problem in caught.value.problems]


def test_events_after_the_end_are_named_with_their_places() -> None:
    assert refused(LATE) == [
        "run.yaml:8:15: replay.grasp.at: begins at 10.01 s, after the end of the run at 10 s",
        "run.yaml:11:44: replay.wrenches.1.begin: begins at 60 s, after the end of the run at 10 s",
    ]


@pytest.mark.parametrize(
    ("change", "end"),
    [
        ("duration=7.995 s", "8"),  # whole steps
        ("reference={kind: waypoints, points: [[0.1, 0, 0], [0, 0, 0]], durations: [4, 5], relative: true}", "9"),
    ],
)
def test_the_end_is_the_run_s_own(change: str, end: str) -> None:
    told = "run.yaml:11:44: replay.wrenches.1.begin: begins at 10 s, after the end of the run at"
    assert refused(RUN, change) == [f"{told} {end} s"]


def test_an_event_at_the_very_end_is_in_the_last_sample() -> None:
    runs_of(read_text(RUN, "run.yaml"))


def test_a_variant_is_refused_where_it_is_changed() -> None:
    assert refused(RUN + "compare: {late: {replay.grasp.at: 11 s}}\n") == [
        "run.yaml:12:18: compare.late.replay.grasp.at: begins at 11 s, after the end of the run at 10 s"
    ]


def test_a_stall_longer_than_the_run() -> None:
    text = "run.yaml:5:58: controller.restart.stall: 3 s without progress cannot pass in a run of 2 s"
    assert refused(REACH) == [text]
    runs_of(read_text(REACH.replace("{stall: 3 s}", "true").replace("after: 2 s", "after: 100 ms"), "run.yaml"))


def test_a_sweep_is_refused_unless_it_draws_how_long_its_runs_are() -> None:
    text = LATE.replace("kind: simulate", "kind: sweep")
    with pytest.raises(SpecError, match=r"sweep.yaml:8:15: replay.grasp.at: begins at 10.01 s, after the end"):
        resolve(read_text(text, "sweep.yaml"))
    drawn = "trajectories: {count: 2, draw: {reference.duration: {uniform: [10, 70]}}}\n"
    resolve(read_text(text + drawn, "sweep.yaml"))
