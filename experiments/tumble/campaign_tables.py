"""Tables of a tumble's campaign.toml that are written alike for trials made up and for runs on grains."""

from collections.abc import Mapping
from typing import Any, Literal

from experiments.campaign.tables import (
    HEDGEHOG_ROWS,
    ImuSensor,
    PlatformTable,
    PoseSensor,
    TumbleSensors,
    TumbleTrial,
    WheelSensor,
)
from experiments.runs.types import Json
from rigid.model.trial import Trial
from rigid.sensors import SensorSet

from .campaign_settings import CampaignSettings

__all__ = ["platform_table", "sensor_set", "sensor_tables", "trial_table"]

Actuator = Literal["motor", "brake"]
NUMBERS = ("gravity_sim", "torque", "torque_until", "wheel_speed_0", "counterweight")
"""Of a trial [m/s2, N m, s, rad/s, kg]."""


def platform_table(*, mass: float, inertia: float, spike_length: float, spike_count: int) -> PlatformTable:
    """A platform [kg, kg m2, m]; the Hedgehog's number of rows goes without saying, as the format has it."""
    told = None if spike_count == HEDGEHOG_ROWS else spike_count
    return PlatformTable(mass=mass, inertia=inertia, spike_length=spike_length, spike_count=told)


def trial_table(name: str, trial: Trial | Mapping[str, Any], actuator: Actuator = "motor") -> TumbleTrial:
    """One trial, its recordings named after it; no counterweight is none, not 0. `actuator`: beside a mapping."""
    numbers = trial if isinstance(trial, Mapping) else {key: getattr(trial, key) for key in NUMBERS}
    given: Json = {key: numbers[key] for key in NUMBERS} | {"counterweight": numbers["counterweight"] or None}
    return TumbleTrial(
        id=name, actuator=actuator if isinstance(trial, Mapping) else trial.actuator, **given,
        pose=f"{name}-pose.csv", imu=f"{name}-imu.csv", wheel=f"{name}-wheel.csv",
    )  # fmt: skip


def sensor_set(settings: CampaignSettings, *, noise: float = 1.0) -> SensorSet:
    """The sensors that `settings` describe, their standard deviations `noise` times as large."""
    x, y, theta = (noise * std for std in settings.pose_std)
    gyro, ax, ay = (noise * std for std in settings.imu_std)
    return SensorSet(
        camera_rate=settings.camera_rate, imu_rate=settings.imu_rate, wheel_rate=settings.wheel_rate,
        pose_std=(x, y, theta), imu_std=(gyro, ax, ay), wheel_std=noise * settings.wheel_std,
        imu_window=settings.imu_window, lead=settings.lead,
    )  # fmt: skip


def sensor_tables(sensors: SensorSet) -> TumbleSensors:
    """What campaign.toml says of these sensors."""
    return TumbleSensors(
        pose=PoseSensor(std=sensors.pose_std),
        imu=ImuSensor(std=sensors.imu_std, window=sensors.imu_window),
        wheel=WheelSensor(std=(sensors.wheel_std,)),
    )
