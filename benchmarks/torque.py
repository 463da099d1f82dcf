"""A step of the UR5 flyer's dynamics, and what torque-level replays of Table 2 keep of its velocity-level runs.

Run by itself: python benchmarks/torque.py [trajectories].
"""

import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from rounds import Contestant, take_turns

import fzcli
from fzcli.loop.engine import CompiledEngine
from fzcli.model import RobotModel
from fzcli.model.free_motion import ATTITUDE, layout, momentum_motion
from fzcli.model.integrators import munthe_kaas, rk4
from fzcli.spec.robot import Robot

Array = NDArray[np.float64]
DT = 0.01
Q = np.array([0.3, -1.2, 1.0, -0.6, 0.8, 0.2])
QD = np.array([0.2, -0.3, 0.4, 0.5, -0.4, 0.3])
STEPS = 2000
FAR, ASKEW, LOST = 2e-3, 0.01, 1e-2  # m, rad; m: the tip's error beyond which a velocity-level run is lost


@dataclass(frozen=True)
class FreeMotion:
    """A loop of nothing but integration steps, from one state, torques zero."""

    initial: ca.Function
    step: ca.Function
    finish: ca.Function
    history_length: int = 0


def free_motion(model: RobotModel, method: Callable[[ca.Function, int], ca.Function]) -> FreeMotion:
    """The robot afloat; a parameter is its state."""
    size = layout(model).size
    state, none, history = ca.SX.sym("state", size), ca.SX.sym("constants", 0), ca.SX.sym("history", 0)
    following = method(momentum_motion(model), ATTITUDE)(state, ca.SX.zeros(model.n), DT)
    idle = [ca.SX(0, 1), ca.SX.zeros(1), ca.SX(0, 1)]
    names = ["state_next", "samples", "stop", "signals"]
    step = ca.Function("step", [state, none, history], [following, *idle], ["state", "constants", "history"], names)
    initial = ca.Function("initial", [state], [state, none], ["parameters"], ["state", "constants"])
    finish = ca.Function("finish", [state, none], [state], ["state", "constants"], ["metrics"])
    return FreeMotion(initial, step, finish)


def dynamics() -> None:
    """Steps of order 4 of the same free motion at 10 ms, one thread; all from one state."""
    robot = fzcli.load_robot("ur5_free_flyer")
    model = fzcli.build_model(robot)
    row = np.zeros(layout(model).size)
    row[layout(model).quat.start] = 1
    row[layout(model).q], row[layout(model).qd] = Q, QD
    contestants: dict[str, Contestant] = {}
    for name, method in (("Munthe-Kaas", munthe_kaas), ("RK4", rk4)):
        engine = CompiledEngine(free_motion(model, method))
        runs = 8 * engine.lanes
        rows, counts = np.tile(row, (runs, 1)), np.full(runs, STEPS - 1)
        work = _bound(engine, rows, counts)
        contestants[f"fzcli, compiled sweep, {engine.lanes} lanes, {name}"] = work, runs * STEPS
    contestants.update(_mujoco(robot))
    contestants.update(_pinocchio(robot))
    found = take_turns(contestants)
    print(f"\n{'UR5 flyer, ns a step of order 4':58} {'median':>10} {'best':>10} {'times RK4':>14}")
    ours = next(name for name in found if name.endswith("RK4") and "fzcli" in name)
    for name, times in found.items():
        ratio = statistics.median(a / b for a, b in zip(times, found[ours], strict=True))
        print(f"{name:58} {statistics.median(times):10,.1f} {min(times):10,.1f} {ratio:14,.2f}")


def _bound(engine: CompiledEngine, rows: Array, counts: NDArray[np.int64]) -> Callable[[], object]:
    return lambda: engine.run(rows, counts)


def _mujoco(robot: Robot) -> dict[str, Contestant]:
    try:
        import mujoco
    except ImportError:
        print("mujoco is not installed: measuring without it")
        return {}
    from tests.oracle.mujoco_oracle import MujocoOracle

    oracle = MujocoOracle(robot, DT)
    oracle.place(Q, [1, 0, 0, 0], QD, np.zeros(6))
    return {"MuJoCo, its own RK4, stepped in C": (lambda: mujoco.mj_step(oracle.model, oracle.data, STEPS), STEPS)}


def _pinocchio(robot: Robot) -> dict[str, Contestant]:
    try:
        import pinocchio as pin
    except ImportError:
        print("pin is not installed: measuring without it")
        return {}
    from tests.oracle.pinocchio_oracle import pin_model

    model = pin_model(robot)[0]
    model.gravity = pin.Motion.Zero()
    data, none = model.createData(), np.zeros(model.nv)

    def slope(place: Array, speed: Array) -> Array:
        return np.array(pin.aba(model, data, place, speed, none))

    def work() -> None:
        place, speed = pin.neutral(model), np.concatenate([np.zeros(6), QD])
        place[7:] = Q
        for _ in range(STEPS // 10):
            v1, a1 = speed, slope(place, speed)
            v2 = speed + 0.5 * DT * a1
            a2 = slope(pin.integrate(model, place, 0.5 * DT * v1), v2)
            v3 = speed + 0.5 * DT * a2
            a3 = slope(pin.integrate(model, place, 0.5 * DT * v2), v3)
            v4 = speed + DT * a3
            a4 = slope(pin.integrate(model, place, DT * v3), v4)
            place = pin.integrate(model, place, DT / 6 * (v1 + 2 * (v2 + v3) + v4))
            speed = speed + DT / 6 * (a1 + 2 * (a2 + a3) + a4)

    return {"Pinocchio's ABA, RK4 composed in Python": (work, STEPS // 10)}


def replays(count: int = 1000) -> None:
    """Share of the velocity-level runs, those not lost, that the torque level keeps to within 2 mm and .01 rad."""
    record = fzcli.sweep("table2_replay_sweep", sets=[f"trajectories.count={count}"])
    metrics = record.metrics
    good = metrics["tip_error_max"][:count] <= LOST
    print(f"\nTable 2, fuzzy column at 1000: {good.sum()} of {count} velocity-level runs not lost; medians of those")
    head = ("kept", "tip [m]", "yaw [rad]", "torque [N m]", "power [W]", "energy [J]")
    print(f"{'at torque level':46} " + " ".join(f"{word:>12}" for word in head))
    for config, changes in enumerate(record.configs[1:], start=1):
        runs = np.arange(count)[good] + config * count
        kept = (metrics["tip_deviation_max"][runs] <= FAR) & (metrics["yaw_deviation_max"][runs] <= ASKEW)
        kept &= metrics["status"][runs] != 2
        shown = ("tip_deviation_max", "yaw_deviation_max", "torque_max", "power_max", "motor_energy")
        cells = [f"{kept.mean():12.2%}", *(f"{np.median(metrics[name][runs]):12.3g}" for name in shown)]
        name = ", ".join(f"{path.rpartition('.')[2]} {value}" for path, value in changes.items())
        print(f"{name:46} " + " ".join(cells))


def torque_level(count: int = 1000) -> None:
    """Both."""
    dynamics()
    replays(count)


if __name__ == "__main__":
    torque_level(*(int(word) for word in sys.argv[1:]))
