"""Settings of `hedgebed tumble spatial`: a platform in six degrees of freedom on a surface, options with units."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from experiments.grains.settings import GrainsSettings
from experiments.platform.settings import NotNegative, Positive
from vis.page.sentences import Sentences

__all__ = ["ON_ANY_GROUND", "SpatialSettings"]

say = Sentences(__package__)

Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]
ZERO = (0.0, 0.0, 0.0)
ON_ANY_GROUND = (
    "lowering_speed", "substeps", "body_steps", "extrapolation", "iterations", "frame_count", "checkpoint_interval",
)  # fmt: skip
"""Of `GrainsSettings`, those that the spring-damper takes too."""


class SpatialSettings(GrainsSettings):
    """A platform in space, driven by its wheels or thrown, on a bed of grains or on the spring-damper."""

    # The surface
    surface: str | None = None
    """Material: steel, brick, sand, sand-weak or jsc1a; brick if not given."""
    ground: Literal["spring-damper", "bed"] = "spring-damper"
    """What computes the surface's force: the spring-damper, or a bed of grains."""
    stiffness: Positive | None = None
    """K of one spike [N/m]; half of the surface's, which are of a row of two, if not given."""
    damping: NotNegative | None = None
    """C of one spike, while going in [N s/m]; half of the surface's if not given."""
    mu_s: NotNegative | None = Field(None, description="Static friction [1]; the surface's if not given (brick: 0.5).")
    mu_d: NotNegative | None = None
    """Sliding friction [1]; the surface's if not given (brick: 0.25), half of mu_s where that is."""

    # The platform, and what carries part of it
    platform: str = Field("hedgehog", description="The platform: one that ships, or its TOML file.")
    rig: Positive | None = None
    """g_sim of the offloading rig [9.80665 m/s2]; 0.0085 if neither it nor gravity is given."""
    rig_reading: Literal["pair", "weight"] = "pair"
    """What rig means: free-fall acceleration of platform and counterweight (pair), or the weight left per mass of the
    platform (weight)."""
    gravity: Positive | None = Field(None, description="Gravity of a free platform, without a rig [m/s2].")

    # What drives it
    torque: Vector | None = None
    """Torque on the platform about its own x, y and z, while a spike touches [N m]; 0.22 about y, or the motor's most,
    if neither it nor a motion at the start is given."""
    torque_until: Positive | None = Field(None, description="End of the torques [s]; they do not end if not given.")
    torque_in_flight: bool = Field(False, description="Whether the wheels are driven while nothing touches, too.")
    actuator: Literal["motor", "brake"] = "motor"
    """What makes the torques: motors that speed wheels up, or brakes that slow them to rest."""
    wheel_speed_0: tuple[NotNegative, NotNegative, NotNegative] = ZERO
    """Speeds of the wheels about x, y and z at the start [rad/s]; a brake must be given its own."""

    # How it starts
    turn: Vector = ZERO
    """How it is turned at the start: about this vector, by its length, from level [rad]."""
    velocity: Vector = Field(ZERO, description="Velocity of the centre of mass at the start [m/s].")
    angular_velocity: Vector = Field(ZERO, description="Angular velocity at the start, axes of the ground [rad/s].")
    height: NotNegative | None = None
    """Height of the lowest tip over the surface at the start [m]: it is let fall. If not given it is put just clear of
    the ground, and set down by a hand where it has no motion."""
    duration: Positive = Field(1.0, le=3600, description="How long it is followed [s].")

    @property
    def placed(self) -> bool:
        """Whether it is set down on the ground before time begins."""
        return self.height is None and not any(self.velocity) and not any(self.angular_velocity)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for finding in (self._friction(), self._gravity(), self._actuation(), self._placement(), self._of_a_bed()):
            if finding:
                raise ValueError(finding)
        return self

    def _friction(self) -> str | None:
        above = self.mu_s is not None and self.mu_d is not None and self.mu_d > self.mu_s
        return say("mu_d_above_mu_s", s=self) if above else None

    def _gravity(self) -> str | None:
        if self.gravity is None:
            return None
        if self.rig is not None:
            return say("gravity_and_rig", s=self)
        return say("reading_of_a_rig", s=self) if self.rig_reading != "pair" else None

    def _actuation(self) -> str | None:
        if self.actuator != "brake":
            return None
        for axis, torque, speed in zip("xyz", self.torque or ZERO, self.wheel_speed_0, strict=True):
            if torque and not speed:
                return say("brake_without_speed", axis=axis)
        return None if any(self.torque or ZERO) else say("brake_without_torque")

    def _placement(self) -> str | None:
        return say("lowered_in_motion", s=self) if self.lowering_speed is not None and not self.placed else None

    def _of_a_bed(self) -> str | None:
        if fault := self.stepping_fault():
            return fault
        if self.ground == "bed":
            return self.sleep_fault()
        for name, field in GrainsSettings.model_fields.items():
            if name not in ON_ANY_GROUND and getattr(self, name) != field.default:
                return say("of_a_bed", name=name, value=getattr(self, name))
        return None
