"""Tables of a tumble's campaign.toml that are written alike for trials made up and for runs on grains."""

from __future__ import annotations

import math
from typing import Literal

from rigid.sensors import SensorSet

from .campaign.tables import (
    HEDGEHOG_ROWS,
    ImuSensor,
    PlatformTable,
    PoseSensor,
    TumbleSensors,
    TumbleTrial,
    WheelSensor,
)
from .campaign_settings import CampaignSettings

__all__ = ["platform_table", "sensor_set", "sensor_tables", "trial_table"]


def platform_table(*, mass: float, inertia: float, spike_length: float, spike_count: int) -> PlatformTable:
    """A platform [kg, kg m2, m]; the Hedgehog's number of rows goes without saying, as the format has it."""
    told = None if spike_count == HEDGEHOG_ROWS else spike_count
    return PlatformTable(mass=mass, inertia=inertia, spike_length=spike_length, spike_count=told)


def trial_table(
    name: str,
    *,
    gravity_sim: float,
    torque: float,
    actuator: Literal["motor", "brake"],
    torque_until: float = math.inf,
    wheel_speed_0: float = 0.0,
    counterweight: float = 0.0,
) -> TumbleTrial:
    """One trial [m/s2, N m, s, rad/s, kg], its recordings named after it; no counterweight is none, not 0."""
    return TumbleTrial(
        id=name, gravity_sim=gravity_sim, torque=torque, actuator=actuator, torque_until=torque_until,
        wheel_speed_0=wheel_speed_0, counterweight=counterweight if counterweight > 0 else None,
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
