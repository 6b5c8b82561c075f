"""Tables of a tumble's campaign.toml that are written alike for made-up trials and for runs on grains."""

from collections.abc import Mapping
from typing import Any, Literal

from experiments.campaign import tables
from experiments.runs.types import Json
from rigid.model.trial import Trial
from rigid.sensors import SensorSet

from .campaign_settings import CampaignSettings

__all__ = ["sensor_set", "shared_tables", "trial_table"]

Actuator = Literal["motor", "brake"]
NUMBERS = ("gravity_sim", "torque", "torque_until", "wheel_speed_0", "counterweight")
"""Of a trial [m/s2, N m, s, rad/s, kg]."""


def shared_tables(
    name: str,
    numbers: Mapping[str, float],
    sensors: SensorSet,
    *,
    spike_count: int,
    kind: str,
    granular: bool,
    rig: tables.RigTable | None,
) -> Json:
    """What a campaign of tumbles and its truth both have.

    `numbers` of platform, wheel and surface by the names of `Trial`; `kind` and `granular` of the surface. The
    Hedgehog's number of rows is left out, as the format has it.
    """
    return {
        "format": tables.FORMAT, "kind": "tumble", "name": name,
        "platform": tables.PlatformTable(
            mass=numbers["mass"], inertia=numbers["inertia"], spike_length=numbers["spike_length"],
            spike_count=None if spike_count == tables.HEDGEHOG_ROWS else spike_count,
        ),
        "wheel": tables.WheelTable(inertia=numbers["wheel_inertia"]),
        "rig": rig,
        "surface": tables.TumbleSurface(
            kind=kind, granular=granular, stiffness=numbers["stiffness"], damping=numbers["damping"],
            mu_s=numbers["mu_s"], mu_d=numbers["mu_d"],
        ),
        "sensors": tables.TumbleSensors(
            pose=tables.PoseSensor(std=sensors.pose_std), wheel=tables.WheelSensor(std=(sensors.wheel_std,)),
            imu=tables.ImuSensor(std=sensors.imu_std, window=sensors.imu_window),
        ),
    }  # fmt: skip


def trial_table(name: str, trial: Trial | Mapping[str, Any], actuator: Actuator = "motor") -> tables.TumbleTrial:
    """One trial, its recordings named after it; no counterweight is none, not 0. `actuator`: beside a mapping."""
    numbers = trial if isinstance(trial, Mapping) else {key: getattr(trial, key) for key in NUMBERS}
    given: Json = {key: numbers[key] for key in NUMBERS} | {"counterweight": numbers["counterweight"] or None}
    return tables.TumbleTrial(
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
