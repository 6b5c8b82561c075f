"""What the model of a tumble lacks, as a force and a torque over time: `latent_columns`.

At every row of the IMU, measured less modelled specific force, turned into the surface's axes by the measured attitude,
times the inertia that resists (m along the surface, m + m_b along the normal in the rig); and J times the difference
in angular acceleration, the slope of the gyro's difference over a few rows. Beside them stand the modelled motion, its
state and the wheel, for whoever looks for what it depends on. Where model and measurement have gone apart, their states
differ, and it is the sum of what is missing and of what follows from it; the first seconds tell most.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .tumble_data import CHANNELS, TrialData
from .tumble_forward import Prediction

__all__ = ["latent_columns"]

Array = NDArray[np.float64]
_ROWS = 5  # over which the slope of the gyro is taken


def latent_columns(data: TrialData, prediction: Prediction, *, mass: float, inertia: float) -> dict[str, Array]:
    """Columns of latent.csv for one trial, one row an IMU's row with all three readings; empty without an IMU.

    Args:
        data: the trial.
        prediction: of one set of parameters, with its motion.
        mass: of the platform [kg].
        inertia: of the platform [kg m2].
    """
    value, state, motion = prediction.value[0], prediction.state[0], prediction.motion[0]
    rows = {name: np.flatnonzero(data.channel == CHANNELS.index(name)) for name in ("gyro", "ax", "ay")}
    shared = np.intersect1d(np.intersect1d(data.time[rows["gyro"]], data.time[rows["ax"]]), data.time[rows["ay"]])
    at = {name: own[np.searchsorted(data.time[own], shared)] for name, own in rows.items()}
    gap = {name: data.value[own] - value[own] for name, own in at.items()}
    moved = motion[at["gyro"]]
    sine, cosine = np.sin(moved[:, 2]), np.cos(moved[:, 2])
    # Body x in the world is (cos, -sin), body y (sin, cos).
    along = gap["ax"] * cosine + gap["ay"] * sine
    normal = gap["ay"] * cosine - gap["ax"] * sine
    names = ("x_m", "y_m", "theta_rad", "vx_m_s", "vy_m_s", "omega_rad_s", "wheel_rad_s")
    return {
        "t_s": shared,
        "latent_force_x_N": mass * along,
        "latent_force_y_N": (mass + data.counterweight) * normal,
        "latent_torque_N_m": inertia * _slope(shared, gap["gyro"]),
        **{name: moved[:, k] for k, name in enumerate(names)},
        "state": state[at["gyro"]].astype(float),
    }


def _slope(time: Array, values: Array) -> Array:
    """Slope of a straight line through each `_ROWS` neighbouring rows."""
    if len(time) < 2:
        return np.zeros(len(time))
    half = _ROWS // 2
    slopes = np.empty(len(time))
    for k in range(len(time)):
        own = slice(max(0, k - half), k + half + 1)
        t = time[own] - time[own].mean()
        slopes[k] = float(t @ values[own]) / max(float(t @ t), 1e-12)
    return slopes
