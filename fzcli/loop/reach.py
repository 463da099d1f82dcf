"""Whether a target that stands still can be reached at all, told before anything runs."""

import numpy as np

from fzcli.errors import SpecError
from fzcli.loop.run_spec import SimulateRun
from fzcli.model import build_model


def out_of_reach(spec: SimulateRun) -> str:
    """What is wrong with a target beyond the arm's reach, with the distance that is missing; else nothing.

    The reach is that of ball joints, so that a target which passes may still be out of reach of the hinges.
    """
    reference = spec.reference
    if spec.stop is None or reference.kind != "target" or reference.moving or spec.start.drifting:
        return ""
    model, tip = build_model(spec.robot), getattr(spec.controller, "tip", None)
    try:
        near, far = model.chain(tip).reach
    except SpecError:  # nothing is known of the reach of an arm without chain points
        return ""
    if model.floating:
        centre = np.array(model.com(spec.start.q, spec.start.attitude)).ravel()
    else:
        root = np.array(model.function("chain", tip)(spec.start.q)[0])[:, 0]
        from scipy.spatial.transform import Rotation

        w, *xyz = spec.start.attitude
        centre = Rotation.from_quat([*xyz, w]).apply(root)
    away = np.array(reference.position) - np.array(spec.start.base_position) - centre
    distance = float(np.linalg.norm(away))
    whose = "the system's centre of mass" if model.floating else "the arm's first chain point"
    if distance > far:
        return f"lies {distance:.4g} m from {whose}; the tip's reach is {far:.4g} m: {distance - far:.4g} m missing"
    if distance < near:
        return f"lies {distance:.4g} m from {whose}; the tip stays {near:.4g} m away: {near - distance:.4g} m missing"
    return ""
