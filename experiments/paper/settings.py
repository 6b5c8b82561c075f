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
    """g_sim of the rig [9.80665 m/s2]; the first is that of Figures 5 and 6."""
    motor_torques: tuple[Positive, ...] = Field((0.125, 0.22), min_length=1, description="Torques of motors [N m].")
    brake_torques: tuple[Positive, ...] = Field((6.0,), description="Torques of brakes [N m].")
    surfaces: tuple[str, ...] = Field(("steel", "brick", "sand", "jsc1a"), min_length=1)
    """Materials; Figures 5 to 7 take steel and brick."""
    ground: str | None = None
    """A ground.toml of one spike, whose law stands under the trials on surfaces of its grains; K and C of each surface
    if not given."""
    friction_band: float = Field(0.1, gt=0, lt=1, description="Friction is varied by this, relative, up and down [1].")
    measured_angles: tuple[str, ...] = ()
    """Transition angles read off Figure 6, SURFACE-TORQUE-STATE=DEGREES with slip or hop for the state
    (steel-0.125-hop=18), to be compared with ours; the paper prints none as a number."""
    rig_reading: Literal["pair", "weight"] = Field("pair", description="What rig means; see tumble.")

    # What the paper does not give
    torque_rise: NotNegative = 0.25
    """Time constant [s] of a motor's torque in a second column beside every statement; 0: no such column."""
    evidence: bool = True
    """Weigh what may explain what the text states of hard surfaces: a torque that rises, and its rivals; where there
    are both surfaces, two rigs and two motors."""
    platform: str = Field("hedgehog", description="Platform: one that ships, or its TOML file.")
    brake_wheel_speed: Positive = 300.0
    """Speed of the wheel at the start of a brake trial [rad/s]; ours, the paper gives none."""
    sweep: bool = True
    """Halve and double the numbers that the paper does not give, one at a time, vary mu_d / mu_s too, and put other
    grounds under the brake trials on grains."""

    # How it is computed
    duration: Positive = Field(5.0, le=60, description="How long a motor trial lasts [s].")
    brake_duration: Positive = Field(2.0, le=60, description="How long a brake trial lasts [s].")
    trusted: Positive = 0.04
    """Speeds are the largest before the centre is this far away [m]; the paper trusts 40 mm."""
    workers: int | None = Field(None, ge=1, le=256, description="Processes; as many as there are cores if not given.")

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
                raise ValueError(f"{key} = {list(values)} holds a value twice: each once would do")
        if set(self.motor_torques) & set(self.brake_torques):
            raise ValueError(f"brake_torques = {list(self.brake_torques)} holds a torque of motor_torques too")
        torques = (*self.motor_torques, *self.brake_torques)
        if self.ground is not None and not is_ground_file(self.ground):
            raise ValueError(f"ground = {self.ground!r} is no file: the path of a ground.toml was expected")
        hard = [surface for surface in HARD if surface in self.surfaces]
        measured_angles(self.measured_angles, surfaces=hard, torques=torques)
        return self
