"""The closed loop of Table 2 as a user would script it: Pinocchio, NumPy and pyfuzzylite.

Bulgarelli et al. 2011: a free-floating 4R arm draws a straight line with its tip while equation 1
holds the base's yaw in the null space and a fuzzy tuner sets the null-space gain. Nothing of fzcli
is used here, so this is a peer to measure against and an independent check of its results.

Run it: python benchmarks/scripted_loop.py [--steps N] [--samples N]
"""

import argparse
import time
from importlib.metadata import version
from typing import Any

import numpy as np
import pinocchio as pin

_ERROR_STATE = np.geterr()
import fuzzylite as fl  # noqa: E402

np.seterr(**_ERROR_STATE)  # pyfuzzylite 8 changes it when imported

DT = 0.01  # s
KP = 3.2  # 1/s
DAMPING = 1e-8  # lambda squared of the pseudo-inverse
AVERAGE, WINDOW, DEAD_BAND = 5, 8, 1e-3  # samples, steps, rad/s or m/s
SAMPLES = 1001  # of the centroid

RULES = (
    "if ( error is Z or error is PS ) and oscillating is OFF then increment is PS",
    "if ( error is P or error is PM ) and oscillating is OFF then increment is P",
    "if error is PL and oscillating is OFF then increment is PL",
    "if oscillating is ON then increment is NL",
)


def build_robot() -> pin.Model:
    """Table 1 on a free-flyer base, with the axes y y y x and links along z x z z of the reconstruction."""
    model = pin.Model()
    parent = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    model.appendBodyToJoint(parent, pin.Inertia(16.0, np.zeros(3), 0.576 * np.eye(3)), pin.SE3.Identity())
    links = (  # joint, offset from the parent's frame, centre of mass, principal inertia
        (pin.JointModelRY(), (0, 0, 0.15), (0, 0, 0.5), (0.3358, 0.3358, 0.0450)),
        (pin.JointModelRY(), (0, 0, 1), (0.5, 0, 0), (0.0450, 0.3358, 0.3358)),
        (pin.JointModelRY(), (1, 0, 0), (0, 0, 0.5), (0.3358, 0.3358, 0.0450)),
        (pin.JointModelRX(), (0, 0, 1), (0, 0, 0.25), (0.1892, 0.1892, 0.0450)),
    )
    for number, (joint, offset, com, inertia) in enumerate(links, 1):
        placement = pin.SE3(np.eye(3), np.array(offset, dtype=float))
        parent = model.addJoint(parent, joint, placement, f"q{number}")
        body = pin.Inertia(4.0, np.array(com, dtype=float), np.diag(inertia))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("hand", parent, 0, pin.SE3(np.eye(3), np.array([0, 0, 0.5])), pin.OP_FRAME))
    return model


def build_tuner(samples: int = SAMPLES) -> fl.Engine:
    """The rule base bulgarelli2011: |yaw error| / 0.1 and oscillating joints to the increment of the gain."""
    settings = getattr(fl, "settings", None) or fl.lib
    for name in ("abs_tolerance", "atol", "rtol"):  # else values closer than 1e-3 count as equal
        if hasattr(settings, name):
            setattr(settings, name, 0.0)
    error = fl.InputVariable(name="error", minimum=0, maximum=1, lock_range=True)
    error.terms = [
        fl.Triangle("Z", 0, 0, 0.1),
        fl.Triangle("PS", 0, 0.1, 0.4),
        fl.Triangle("P", 0.1, 0.4, 0.7),
        fl.Triangle("PM", 0.4, 0.7, 1),
        fl.Ramp("PL", 0.7, 1),
    ]
    oscillating = fl.InputVariable(name="oscillating", minimum=0, maximum=10, lock_range=True)
    oscillating.terms = [fl.Ramp("OFF", 1, 0), fl.Ramp("ON", 0, 1)]
    increment = fl.OutputVariable(
        name="increment",
        minimum=-1660,
        maximum=8.4,
        default_value=0.0,
        aggregation=fl.Maximum(),
        defuzzifier=fl.Centroid(samples),
    )
    increment.terms = [
        fl.Triangle("NL", -1660, -1660, -830),
        fl.Triangle("PS", 0, 1.26, 2.52),
        fl.Triangle("P", 1.68, 4.2, 6.72),
        fl.Triangle("PL", 5.04, 8.4, 8.4),
    ]
    engine = fl.Engine(input_variables=[error, oscillating], output_variables=[increment])
    block = fl.RuleBlock(
        conjunction=fl.Minimum(), disjunction=fl.Maximum(), implication=fl.Minimum(), activation=fl.General()
    )
    block.rules = [fl.Rule.create(rule, engine) for rule in RULES]
    engine.rule_blocks.append(block)
    return engine


class Oscillation:
    """Counts the joints whose velocity crossed its moving average twice within a window of steps."""

    def __init__(self, joints: int) -> None:
        self.history = np.zeros((AVERAGE, joints))
        self.side = np.zeros(joints)
        self.last = np.full(joints, -np.inf)
        self.second_last = np.full(joints, -np.inf)

    def update(self, step: int, velocity: np.ndarray) -> int:
        """Take in the velocities of a step and return the number of oscillating joints."""
        self.history[step % AVERAGE] = velocity
        deviation = velocity - self.history.mean(axis=0)
        sign = np.sign(deviation)
        changed = (np.abs(deviation) > DEAD_BAND) & (sign != self.side)
        crossed = changed & (self.side != 0.0)
        self.second_last[crossed] = self.last[crossed]
        self.last[crossed] = step
        self.side[changed] = sign[changed]
        return int(np.count_nonzero(step - self.second_last < WINDOW))


def line_345(t: float, duration: float) -> tuple[float, float]:
    """Share of the line done at time t and its rate in 1/s (3-4-5 polynomial, at rest beyond its ends)."""
    x = min(max(t / duration, 0.0), 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2), 30 * x**2 * (1 - x) ** 2 / duration


def rpy_rates(roll_pitch_yaw: np.ndarray, angular: np.ndarray) -> np.ndarray:
    """Rates of roll, pitch and yaw (ZYX) from columns of world angular velocity."""
    _, pitch, yaw = roll_pitch_yaw
    forward = np.cos(yaw) * angular[0] + np.sin(yaw) * angular[1]
    side = np.cos(yaw) * angular[1] - np.sin(yaw) * angular[0]
    return np.array([forward / np.cos(pitch), side, angular[2] + np.tan(pitch) * forward])


def run(
    q0: Any,
    direction: Any,
    length: float,
    duration: float,
    gain: float,
    fuzzy: bool = True,
    *,
    steps: int | None = None,
    samples: int = SAMPLES,
) -> dict[str, Any]:
    """Follow one line with equation 1 and explicit Euler steps of 10 ms.

    Args:
        q0: joint angles at the start (4), rad.
        direction: of the line in world axes (3), normalised here.
        length, duration: of the line, m and s.
        gain: Kc at the start; it stays there unless ``fuzzy``.
        steps: how many to take; by default until the end of the line.
        samples: midpoints of the tuner's centroid.

    Returns:
        tip_error (m), yaw (rad), gain, oscillating: one value a step, all at the step's beginning;
        qs (steps + 1, 4); base_quat at the end (w, x, y, z); seconds_per_step of the loop alone.
    """
    model = build_robot()
    data, hand = model.createData(), model.getFrameId("hand")
    tuner = build_tuner(samples) if fuzzy else None
    oscillation = Oscillation(10)
    direction = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    steps = int(np.ceil(duration / DT - 1e-9)) if steps is None else steps
    tip_error, yaw, gains = np.empty(steps), np.empty(steps), np.empty(steps)
    oscillating = np.empty(steps, dtype=int)
    qs = np.empty((steps + 1, 4))
    q = pin.neutral(model)
    q[7:] = q0
    pin.framesForwardKinematics(model, data, q)
    start = data.oMf[hand].translation.copy()
    com = pin.centerOfMass(model, data, q).copy()
    identity, damping = np.eye(4), DAMPING * np.eye(3)

    began = time.perf_counter()
    for step in range(steps):
        qs[step] = q[7:]
        # The base's position follows from the resting centre of mass; the attitude is integrated.
        pin.computeCentroidalMap(model, data, q)
        q[:3] += com - data.com[0]
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacement(model, data, hand)
        jacobian = pin.getFrameJacobian(model, data, hand, pin.LOCAL_WORLD_ALIGNED)[:3]
        rotation = data.oMi[1].rotation
        base_map = -np.linalg.solve(data.Ag[:, :6], data.Ag[:, 6:])  # zero momentum; base axes
        J = jacobian[:, :6] @ base_map + jacobian[:, 6:]
        linear, angular = rotation @ base_map[:3], rotation @ base_map[3:]
        rpy = pin.rpy.matrixToRpy(rotation)
        rates = rpy_rates(rpy, angular)

        share, rate = line_345(step * DT, duration)
        error = start + length * share * direction - data.oMf[hand].translation
        command = KP * error + length * rate * direction
        inverse = np.linalg.solve(J @ J.T + damping, J).T
        null_motion = rates[2] * (gain * -rpy[2])
        qd = inverse @ command + (identity - inverse @ J) @ null_motion

        velocity = np.concatenate([qd, linear @ qd, rates @ qd])
        count = oscillation.update(step, velocity)
        tip_error[step], yaw[step] = np.sqrt(error @ error), rpy[2]
        gains[step], oscillating[step] = gain, count
        if tuner is not None:
            tuner.input_variables[0].value = abs(rpy[2]) / 0.1
            tuner.input_variables[1].value = float(count)
            with np.errstate(all="ignore"):  # pyfuzzylite 8 divides by zero and masks it afterwards
                tuner.process()
            gain = max(0.0, gain + float(np.ravel(tuner.output_variables[0].value)[0]))
        q = pin.integrate(model, q, np.concatenate([base_map @ qd, qd]) * DT)
    elapsed = time.perf_counter() - began

    qs[steps] = q[7:]
    return {
        "tip_error": tip_error,
        "yaw": yaw,
        "gain": gains,
        "oscillating": oscillating,
        "qs": qs,
        "base_quat": q[[6, 3, 4, 5]],
        "seconds_per_step": elapsed / max(steps, 1),
    }


def main() -> None:
    """Time the loop with and without the tuner and print microseconds a step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--samples", type=int, default=SAMPLES)
    options = parser.parse_args()
    job = ((0.928, -1.393, 0.303, 0.549), (1.0, 0.2, -0.5), 0.5, 12.0, 10.0)
    print(f"pin {version('pin')}, numpy {version('numpy')}, pyfuzzylite {version('pyfuzzylite')}")
    for fuzzy in (False, True):
        best = min(
            run(*job, fuzzy=fuzzy, steps=options.steps, samples=options.samples)["seconds_per_step"]
            for _ in range(3)
        )
        name = f"with the tuner ({options.samples} samples)" if fuzzy else "fixed gain"
        print(f"scripted loop, {name}: {1e6 * best:.1f} us a step")


if __name__ == "__main__":
    main()
