"""The recordings of a tumble campaign as the fit wants them: one flat list of samples a trial, and when to simulate.

Contract: a trial's samples are ordered camera x, y, theta, then gyro, ax, ay, then wheel; gaps (NaN) are left out.
A specific force read at the very instant at which the torque sets in or ends is left out, too: it jumps there.
Nothing is averaged or resampled. Whitening divides by the std that campaign.toml states.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from experiments.campaign import Campaign, TumbleCampaign
from experiments.diagnose.fit.problem import Array
from experiments.diagnose.fit.trials import TrialInfo
from experiments.diagnose.noise.replicates import parted

__all__ = ["CHANNELS", "LOST", "ZERO_STD", "TrialData", "TumbleData", "thinned", "trial_infos", "tumble_data", "whiten"]

CHANNELS = ("x", "y", "theta", "gyro", "ax", "ay", "wheel")
"""Channels of a diagnosis, in the order of a trial's samples."""
ZERO_STD = 3.0 / np.sqrt(3.0)
"""Std of the camera's zero over the sensor's: it may be off by up to 3 of them, evenly (docs/diagnose.md)."""
LOST = 1e3  # residual where the model cannot stand or run [1]

_LATEST = 1e3  # seconds after the torque by which a trial must have begun: unix time would be simulated for years
_FELT = ("ax", "ay")
_SWITCH = 1e-3  # how far from the moment at which the torque sets in or ends a force read at an instant must be [s]
_COLUMNS = {
    "x": ("pose", "x_m", 0), "y": ("pose", "y_m", 1), "theta": ("pose", "theta_rad", 2),
    "gyro": ("imu", "gyro_rad_s", 0), "ax": ("imu", "ax_m_s2", 1), "ay": ("imu", "ay_m_s2", 2),
    "wheel": ("wheel", "omega_rad_s", 0),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class TrialData:
    """One trial: its conditions and its samples, shape [sample_count] each."""

    id: str
    gravity_sim: float  # as stated [m/s2]
    counterweight: float  # [kg], 0 without a rig
    local_gravity: float | None  # [m/s2]; None for a free platform, whose local gravity is gravity_sim
    torque: float
    torque_until: float
    actuator: str
    wheel_speed_0: float
    time: Array = field(repr=False)  # on the sensor's own clock [s]
    value: Array = field(repr=False)  # as measured, in the format's units
    std: Array = field(repr=False)  # as stated
    channel: NDArray[np.int8] = field(repr=False)  # number into CHANNELS

    @property
    def end(self) -> float:
        """The last sample's time [s]."""
        return float(self.time.max())

    def of(self, name: str) -> NDArray[np.bool_]:
        """Which samples belong to the channel `name`."""
        return self.channel == CHANNELS.index(name)

    @property
    def condition(self) -> tuple[object, ...]:
        """What replicates share: stated gravity [m/s2], torque [N m], actuator and its end [s] (within the part of the
        trial that is used), the wheel's first speed [rad/s] and the counterweight [kg]."""
        until = self.torque_until if self.torque_until < self.end else math.inf
        return (self.gravity_sim, self.torque, self.actuator, until, self.wheel_speed_0, self.counterweight)


@dataclass(frozen=True, kw_only=True)
class TumbleData:
    """A campaign of tumbles: its tables and its trials."""

    tables: TumbleCampaign
    trials: tuple[TrialData, ...]

    @property
    def window(self) -> float:
        """Over which each specific force is a mean [s]."""
        imu = self.tables.sensors.imu
        return 0.0 if imu is None else imu.window


def tumble_data(campaign: Campaign) -> TumbleData:
    """The samples of `campaign`. Raises ValueError for one of another kind, a sensor with a std of 0, no sample,
    a clock that does not begin with the torque."""
    tables = campaign.tables
    if not isinstance(tables, TumbleCampaign):
        raise ValueError(f"kind = {tables.kind!r}: 'tumble' was expected")
    trials = []
    for trial in tables.trial:
        parts: list[tuple[Array, Array, Array, NDArray[np.int8]]] = []
        for number, name in enumerate(CHANNELS):
            sensor, column, index = _COLUMNS[name]
            recording = campaign.recording(trial.id, sensor)
            if recording is None:
                continue
            std = getattr(tables.sensors, sensor).std[index]
            if std == 0:
                raise ValueError(
                    f"[sensors.{sensor}] std = {list(getattr(tables.sensors, sensor).std)}: numbers above 0 were "
                    f"expected, without noise no residual can be weighed"
                )
            good = np.isfinite(recording[column])
            if name in _FELT and tables.sensors.imu is not None and tables.sensors.imu.window == 0:
                for moment in (0.0, trial.torque_until):  # the force jumps there: neither side is wrong
                    good &= np.abs(recording.time - moment) > _SWITCH
            time, value = recording.time[good], recording[column][good]
            parts.append((time, value, np.full(len(time), std), np.full(len(time), number, dtype=np.int8)))
        if not parts or not sum(len(part[0]) for part in parts):
            raise ValueError(f"trial {trial.id!r} holds no sample: numbers of at least one sensor were expected")
        time, value, std, channel = (np.concatenate(column) for column in zip(*parts, strict=True))
        if time.min() > _LATEST:
            raise ValueError(f"trial {trial.id!r} begins at t_s = {time.min():.10g}: t = 0 is when the torque starts")
        trials.append(TrialData(
            id=trial.id, gravity_sim=trial.gravity_sim, counterweight=tables.counterweight_of(trial),
            local_gravity=None if tables.rig is None else tables.rig.gravity, torque=trial.torque,
            torque_until=trial.torque_until, actuator=trial.actuator, wheel_speed_0=trial.wheel_speed_0,
            time=time, value=value, std=std, channel=channel,
        ))  # fmt: skip
    return TumbleData(tables=tables, trials=tuple(trials))


def trial_infos(data: TumbleData) -> tuple[TrialInfo, ...]:
    """The trials with their conditions and settings; of one condition those that last half as long are none of its."""
    settings = [{"torque_N_m": trial.torque, "gravity_m_s2": trial.gravity_sim} for trial in data.trials]
    infos = [TrialInfo(id=t.id, condition=t.condition, settings=s) for t, s in zip(data.trials, settings, strict=True)]
    return parted(infos, {trial.id: (max(trial.end, 1e-9),) for trial in data.trials})


def thinned(data: TumbleData, channel: str, every: int) -> TumbleData:
    """Every so many-th reading of one channel alone, and all of the others."""
    trials = []
    for trial in data.trials:
        keep = ~trial.of(channel)
        keep[np.flatnonzero(~keep)[::every]] = True
        kept = {name: getattr(trial, name)[keep] for name in ("time", "value", "std", "channel")}
        trials.append(replace(trial, **kept))
    return replace(data, trials=tuple(trials))


def whiten(trial: TrialData, value: Array, *, until: float = np.inf) -> Array:
    """(measured - value) / std with the camera's zero marginalised, shape [set_count, sample_count].

    With the zero's covariance s^2 1 1' beside unit noise, C^(-1/2) takes the share 1 - 1 / sqrt(1 + n s^2) of the mean.
    Samples after `until` [s] count for nothing: 0.
    """
    residual = (trial.value - value) / trial.std
    lost = ~np.isfinite(residual).all(axis=1)
    seen = trial.time <= until
    for name in ("x", "y", "theta"):
        mine = np.flatnonzero(trial.of(name))
        count = int(seen[mine].sum())
        if count:
            share = 1 - 1 / np.sqrt(1 + count * ZERO_STD**2)
            own = slice(mine[0], mine[0] + count)  # a channel's samples lie in the order of their times
            residual[:, own] -= share * residual[:, own].mean(axis=1, keepdims=True)
    residual[lost] = LOST
    residual[:, ~seen] = 0.0
    return residual
