"""Base attitude as the angles people read."""

import numpy as np
from numpy.typing import NDArray


def roll_pitch_yaw(quat: NDArray[np.float64]) -> NDArray[np.float64]:
    """Roll, pitch and yaw (ZYX), (T, 3) rad, of quaternions (T, 4) w x y z, body to world.

    Roll and yaw are unwrapped along time.
    """
    w, x, y, z = np.asarray(quat, dtype=np.float64).T
    norm = w * w + x * x + y * y + z * z
    roll = np.arctan2(2 * (w * x + y * z), w * w - x * x - y * y + z * z)
    pitch = np.arcsin(np.clip(2 * (w * y - x * z) / norm, -1.0, 1.0))
    yaw = np.arctan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return np.column_stack([np.unwrap(roll), pitch, np.unwrap(yaw)])
