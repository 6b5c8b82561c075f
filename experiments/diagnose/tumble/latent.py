"""The force and the torque over time that the model of a tumble misses; up to when it follows what was measured.

At every row of the IMU the force is measured less modelled specific force times the inertia that resists. It is turned
into the surface's axes by the measured attitude. The inertia is m along the surface, m + m_b along the normal in the
rig. The torque is J times the difference in angular acceleration, the slope of the gyro's difference over a few rows.
Beside them stand the modelled motion, its state and the wheel, for whoever looks for what it depends on. Where model
and measurement have diverged, their states differ, and it is the sum of what is missing and of what follows from it.
The first seconds show most. A trial without an IMU has it from the camera's rows: inertia times the second derivative
of measured less modelled place and angle.
"""

import numpy as np
from numpy.typing import NDArray

from experiments.diagnose.fit.localise import acceleration, slope
from experiments.diagnose.fit.problem import Array

from .data import CHANNELS, TrialData
from .forward import Prediction

__all__ = ["followed_until", "latent_columns"]

_PIECE = 24  # samples that are judged together
_FAR = 6.0  # standard deviations of a piece's sum of squares from which it is off; coloured noise makes 2 of 1.4
_BEFORE = 1.2  # mean square of all before, at most
_LEAST = 0.3  # share of a trial's time after the torque sets in, at least
_AFTER_EVENT = 0.3  # how long after a change of the model's state two ways may take to part visibly [s]
_ROWS = 5  # over which the slope of the gyro is taken


def latent_columns(data: TrialData, prediction: Prediction, *, mass: float, inertia: float) -> dict[str, Array]:
    """Columns of latent.csv for one trial, one row an IMU's row with all three readings, or the camera's where there is
    none; empty without either. `prediction`: of one set of parameters, with its motion. `mass` [kg], `inertia` [kg m2]:
    of the platform.
    """
    shared, gap, rows = _gaps(data, prediction.value[0], ("gyro", "ax", "ay"))
    felt = len(shared) > 0
    if not felt:
        shared, gap, rows = _gaps(data, prediction.value[0], ("x", "y", "theta"))
    state, moved = prediction.state[0][rows], prediction.motion[0][rows]
    if felt:
        sine, cosine = np.sin(moved[:, 2]), np.cos(moved[:, 2])
        # Body x in the world is (cos, -sin), body y (sin, cos).
        along = gap["ax"] * cosine + gap["ay"] * sine
        normal = gap["ay"] * cosine - gap["ax"] * sine
        turning = slope(shared, gap["gyro"], rows=_ROWS)
    else:
        along, normal, turning = (acceleration(shared, gap[name]) for name in ("x", "y", "theta"))
    names = ("x_m", "y_m", "theta_rad", "vx_m_s", "vy_m_s", "omega_rad_s", "wheel_rad_s")
    return {
        "t_s": shared,
        "latent_force_x_N": mass * along,
        "latent_force_y_N": (mass + data.counterweight) * normal,
        "latent_torque_N_m": inertia * turning,
        **{name: moved[:, k] for k, name in enumerate(names)},
        "state": state.astype(float),
    }


def _gaps(data: TrialData, value: Array, names: tuple[str, ...]) -> tuple[Array, dict[str, Array], NDArray[np.intp]]:
    """The times at which all of these channels were read, measured less modelled there, and the first one's rows."""
    rows = {name: np.flatnonzero(data.channel == CHANNELS.index(name)) for name in names}
    shared = data.time[rows[names[0]]]
    for name in names[1:]:
        shared = np.intersect1d(shared, data.time[rows[name]])
    at = {name: own[np.searchsorted(data.time[own], shared)] for name, own in rows.items()}
    return shared, {name: data.value[own] - value[own] for name, own in at.items()}, at[names[0]]


def followed_until(trial: TrialData, residual: Array, state: NDArray[np.int8]) -> float | None:
    """The moment [s] from which these residuals (in standard deviations) are off; None where that is too early.

    Only gyro and accelerometers are used: the camera's unknown zero spreads a late error over a whole recording. None
    too where nothing is off, or where little is right before. Also where no state of the model (`state`, at the same
    samples) ended shortly before: motions separate where something touches, catches or lets go.
    """
    seen = np.flatnonzero(trial.of("gyro") | trial.of("ax") | trial.of("ay"))
    order = seen[np.argsort(trial.time[seen], kind="stable")]
    if len(order) < 4 * _PIECE:
        return None
    time, square, at = trial.time[order], residual[order] ** 2, state[order]
    pieces = np.array_split(np.arange(len(order)), len(order) // _PIECE)
    for piece in pieces:
        count = len(piece)
        if square[piece].sum() - count <= _FAR * np.sqrt(2.0 * count):
            continue
        first = int(piece[0])
        moment = float(time[first])
        right = first > 0 and float(square[:first].mean()) <= _BEFORE
        changes = time[1:][(at[1:] != at[:-1]) & (time[1:] > 0)]
        parted = bool(((changes > moment - _AFTER_EVENT) & (changes <= float(time[piece[-1]]))).any())
        return moment if right and parted and moment >= _LEAST * trial.end else None
    return None
