"""Settings of `hedgebed campaign`: synthetic trials over gravities and torques, seen through noisy sensors."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from experiments.platform.settings import NotNegative, Positive

from .settings import TrialSettings, say

__all__ = ["CampaignSettings"]

Relative = Annotated[float, Field(ge=0, lt=1, allow_inf_nan=False)]
SeedNumber = Annotated[int, Field(ge=0, lt=2**31)]
MOST_ROWS = 1e6
"""Of one recording; more are refused."""
Triple = tuple[NotNegative, NotNegative, NotNegative]


class CampaignSettings(TrialSettings):
    """Trials of the planar model over every gravity and torque, recorded with noise, written as a campaign."""

    name: str = Field("made up", min_length=1, description="Name of the campaign.")

    # The conditions
    rig: tuple[Positive, ...] = (0.0085, 0.015)
    """Simulated gravities g_sim of the offloading rig, in g [9.80665 m/s2]; ignored if gravity is given."""
    gravity: tuple[Positive, ...] = ()
    """Gravities of a free platform, without a rig [m/s2]."""
    motor_torques: tuple[Positive, ...] = Field((0.125, 0.22), description="Torques of trials with the motor [N m].")
    brake_torques: tuple[Positive, ...] = Field((6.0,), description="Torques of trials with the brake [N m].")
    brake_wheel_speed: Positive = Field(
        300.0, description="Initial speed of the wheel in trials with the brake [rad/s]."
    )
    trials: int = Field(1, ge=1, le=1000, description="Trials of each condition [1].")

    # What is true
    seed: SeedNumber = Field(1, description="Seed of true numbers and noise.")
    exact: bool = False
    """Use the stated numbers as the true ones. Otherwise the true ones are drawn within the uncertainties."""
    sigma_mass: Relative = Field(0.002, description="One sigma of the mass, relative [1].")
    sigma_inertia: Relative = Field(0.03, description="One sigma of the inertia, relative [1].")
    sigma_stiffness: Relative = Field(0.1, description="One sigma of the stiffness, relative [1].")
    sigma_damping: Relative = Field(0.2, description="One sigma of the damping, relative [1].")
    sigma_mu_s: Relative = Field(0.05, description="One sigma of static friction, relative [1].")
    sigma_mu_d: Relative = Field(0.05, description="One sigma of sliding friction, relative [1].")
    sigma_gravity_sim: Relative = 0.02
    """One sigma of the simulated gravity, relative, drawn for each trial [1]."""

    # The sensors
    pose_std: Triple = Field((0.0005, 0.0005, 0.003), description="Noise of the camera's x, y, theta [m, m, rad].")
    imu_std: Triple = Field(
        (0.01, 0.02, 0.02), description="Noise of gyro and both accelerometers [rad/s, m/s2, m/s2]."
    )
    wheel_std: NotNegative = Field(0.5, description="Noise of the wheel's speed [rad/s].")
    imu_window: NotNegative = Field(0.004, description="Averaging time of the IMU's specific forces [s].")
    camera_rate: Positive = Field(120.0, description="Rate of the camera [Hz].")
    imu_rate: Positive = Field(100.0, description="Rate of the IMU [Hz].")
    wheel_rate: Positive = Field(600.0, description="Rate of the wheel's sensor [Hz].")
    lead: NotNegative = Field(0.2, description="Time recorded before the torque starts [s].")
    wire_length: Positive | None = Field(
        None, description="Length of the wires of the rig, as stated in the campaign [m]."
    )

    @model_validator(mode="after")
    def _conditions_fit_together(self) -> Self:
        if not self.motor_torques and not self.brake_torques:
            raise ValueError("motor_torques and brake_torques are both empty: at least one torque is needed")
        if not self.rig and not self.gravity:
            raise ValueError("rig and gravity are both empty: at least one gravity is needed")
        if self.gravity and self.counterweight is not None:
            raise ValueError(say("counterweight_of_a_rig", s=self))
        if self.ground != "spring-damper":
            raise ValueError(say("ground_of_a_campaign", s=self))
        for key in ("camera_rate", "imu_rate", "wheel_rate"):
            if (rows := getattr(self, key) * (self.lead + self.duration)) > MOST_ROWS:
                raise ValueError(say("rows", key=key, rows=rows, most=MOST_ROWS, s=self, rate=getattr(self, key)))
        for key in ("rig", "gravity", "motor_torques", "brake_torques"):
            values = getattr(self, key)
            if len(set(values)) < len(values):
                raise ValueError(say("twice", key=key, values=list(values)))
        return self
