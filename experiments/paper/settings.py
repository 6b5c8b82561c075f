"""Settings of `hedgebed paper`: the paper's trials again, with what the paper does not give stated."""

from typing import Literal, Self

from pydantic import Field, model_validator

from experiments.platform.settings import NotNegative, Positive
from experiments.runs.strict import StrictSettings
from rigid.ground_file import is_ground_file

from .transitions import HARD, measured_angles

__all__ = ["PaperSettings"]


class PaperSettings(StrictSettings):
    """Figures 5 to 8 of Reid, Roveda, Nesnas and Pavone (i-SAIRAS 2014) with our model, beside what the text states."""

    # The trials
    rigs: tuple[Positive, ...] = Field((0.0085, 0.015), min_length=1)
    """Simulated gravities g_sim of the rig, in g [9.80665 m/s2]; Figures 5 and 6 use the first."""
    motor_torques: tuple[Positive, ...] = Field(
        (0.125, 0.22), min_length=1, description="Torques of trials with the motor [N m]."
    )
    brake_torques: tuple[Positive, ...] = Field((6.0,), description="Torques of trials with the brake [N m].")
    surfaces: tuple[str, ...] = Field(("steel", "brick", "sand", "jsc1a"), min_length=1)
    """Surfaces; Figures 5 to 7 use steel and brick."""
    ground: str | None = None
    """A ground.toml of one spike: its law replaces K and C on surfaces of its grains."""
    friction_band: float = Field(0.1, gt=0, lt=1, description="Relative variation of friction, up and down [1].")
    measured_angles: tuple[str, ...] = ()
    """Transition angles that you read from Figure 6, compared with the computed ones: SURFACE-TORQUE-STATE=DEGREES,
    with slip or hop as state (steel-0.125-hop=18). The paper states none as a number."""
    rig_reading: Literal["pair", "weight"] = Field("pair", description="Meaning of rig; see hedgebed tumble --help.")

    # What the paper does not give
    torque_rise: NotNegative = 0.25
    """Time constant of a motor's torque in a second set of trials [s]; 0: no second set."""
    evidence: bool = True
    """Compare explanations for the statements about hard surfaces: a torque that rises slowly, and others. It needs
    steel and brick, two rigs and two torques of the motor."""
    platform: str = Field(
        "hedgehog", description="Platform: hedgehog, cubli, mascot, minerva, cube, or a TOML file (docs/platform.md)."
    )
    brake_wheel_speed: Positive = 300.0
    """Initial speed of the wheel in trials with the brake [rad/s]. The paper states none; the default is ours."""
    sweep: bool = True
    """Also vary the numbers that the paper does not state (half, double; mu_d / mu_s), and the law of the ground in
    trials with the brake on sand."""

    # How it is computed
    duration: Positive = Field(5.0, le=60, description="Duration of a trial with the motor [s].")
    brake_duration: Positive = Field(2.0, le=60, description="Duration of a trial with the brake [s].")
    trusted: Positive = 0.04
    """Speeds are the largest within this displacement of the centre [m]; the paper uses 40 mm."""
    workers: int | None = Field(None, ge=1, le=256, description="Number of processes; all cores if not given.")

    @property
    def weighs(self) -> bool:
        """Whether there are the trials that the rivals are weighed by, and they are to be."""
        several = min(len(self.rigs), len(self.motor_torques)) >= 2
        return self.evidence and several and set(HARD) <= set(self.surfaces)

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        for key in ("rigs", "motor_torques", "brake_torques", "surfaces"):
            values = getattr(self, key)
            if len(set(values)) < len(values):
                raise ValueError(f"{key} = {list(values)} holds a value twice: give each once")
        if set(self.motor_torques) & set(self.brake_torques):
            raise ValueError(f"brake_torques = {list(self.brake_torques)} holds a torque of motor_torques too")
        torques = (*self.motor_torques, *self.brake_torques)
        if self.ground is not None and not is_ground_file(self.ground):
            raise ValueError(f"ground = {self.ground!r} is no file: the path of a ground.toml was expected")
        hard = [surface for surface in HARD if surface in self.surfaces]
        measured_angles(self.measured_angles, surfaces=hard, torques=torques)
        return self
