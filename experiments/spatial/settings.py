"""Settings of `hedgebed tumble spatial`: a platform in six degrees of freedom on a surface, options with units."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from experiments.grains.lammps import ON_GRAINS, RANKS, lammps_fault
from experiments.grains.settings import GrainsSettings
from experiments.platform.settings import NotNegative, Positive
from rigid.checks import nearest
from vis.page.sentences import Sentences

__all__ = ["ON_ANY_GROUND", "SpatialSettings"]

say = Sentences(__package__)

Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]
ZERO = (0.0, 0.0, 0.0)
GROUNDS = ("spring-damper", *ON_GRAINS)
ON_ANY_GROUND = (
    "lowering_speed", "substeps", "body_steps", "extrapolation", "iterations", "frame_count", "checkpoint_interval",
)  # fmt: skip
"""Of `GrainsSettings`, those that the spring-damper takes too."""


class SpatialSettings(GrainsSettings):
    """A platform in space, driven by its wheels or thrown, on a bed of grains or on the spring-damper."""

    # The surface
    surface: str | None = None
    """Surface: steel, brick, sand, sand-weak, jsc1a or jsc1a-heights; brick if not given."""
    ground: str = "spring-damper"
    """Law of the force of the ground: spring-damper, bed (of grains) or lammps (a bed whose grains are in LAMMPS)."""
    ranks: int | None = Field(None, ge=1, le=4096, description=RANKS)
    stiffness: Positive | None = None
    """Stiffness K under one spike [N/m]; if not given, half of the surface's, which is for a row of two."""
    damping: NotNegative | None = None
    """Damping C under one spike that moves into the ground [N s/m]; half of the surface's if not given."""
    mu_s: NotNegative | None = Field(
        None, description="Coefficient of static friction [1]; that of the surface if not given (brick: 0.5)."
    )
    mu_d: NotNegative | None = None
    """Coefficient of sliding friction [1]; if not given, half of a given mu_s, else that of the surface (brick:
    0.25)."""

    settle_gravity: Positive | None = None
    """Bed, without a rig: gravity in which it is prepared, lowered to `gravity` before the platform is set down, to
    save time [m/s2]; `gravity` if not given."""

    # The platform, and what carries part of it
    platform: str = Field(
        "hedgehog", description="Platform: hedgehog, cubli, mascot, minerva, cube, or a TOML file (docs/platform.md)."
    )
    rig: Positive | None = None
    """Simulated gravity g_sim of the offloading rig, in g [9.80665 m/s2]; 0.0085 if neither rig nor gravity is
    given."""
    rig_reading: Literal["pair", "weight"] = "pair"
    """Meaning of rig: free-fall acceleration of platform and counterweight (pair), or remaining weight over mass of the
    platform (weight)."""
    gravity: Positive | None = Field(None, description="Gravity of a free platform, without a rig [m/s2].")

    # What drives it
    torque: Vector | None = None
    """Torque on the platform about its own x, y and z, while a spike touches [N m]; 0.22 about y, or the motor's most,
    if neither it nor a motion at the start is given."""
    torque_until: Positive | None = Field(None, description="End of the torques [s]; they do not end if not given.")
    torque_in_flight: bool = Field(False, description="Drive the wheels also while nothing touches the ground.")
    actuator: Literal["motor", "brake"] = "motor"
    """Source of the torques: motors that accelerate the wheels, or brakes that stop them."""
    wheel_speed_0: tuple[NotNegative, NotNegative, NotNegative] = ZERO
    """Initial speeds of the wheels about x, y and z [rad/s]; each brake needs one."""

    # How it starts
    turn: Vector = ZERO
    """Initial attitude: rotation vector from level; its direction is the axis, its length the angle [rad]."""
    velocity: Vector = Field(ZERO, description="Initial velocity of the centre of mass [m/s].")
    angular_velocity: Vector = Field(ZERO, description="Initial angular velocity, in axes of the ground [rad/s].")
    height: NotNegative | None = Field(None, le=1e9)
    """Initial height of the lowest tip above the surface, from which the platform falls [m]. If not given, it starts
    just above the ground; without an initial motion it is first lowered slowly until it rests."""
    duration: Positive = Field(1.0, le=3600, description="Simulated time [s].")

    @property
    def on_grains(self) -> bool:
        """Whether the ground is made of grains."""
        return self.ground in ON_GRAINS

    @property
    def placed(self) -> bool:
        """Whether it is set down on the ground before time begins."""
        return self.height is None and not any(self.velocity) and not any(self.angular_velocity)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for finding in (
            self._known_ground(),
            self._friction(),
            self._gravity(),
            self._actuation(),
            self._placement(),
            self._of_a_bed(),
        ):
            if finding:
                raise ValueError(finding)
        return self

    def _known_ground(self) -> str | None:
        if self.ground in GROUNDS:
            return lammps_fault(self)
        return say("no_ground", s=self, known=nearest(self.ground, GROUNDS))

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
        if self.on_grains:
            return self.sleep_fault() or self._settled_under()
        if self.settle_gravity is not None:
            return say("of_a_bed", name="settle_gravity", value=self.settle_gravity)
        for name, field in GrainsSettings.model_fields.items():
            if name not in ON_ANY_GROUND and getattr(self, name) != field.default:
                return say("of_a_bed", name=name, value=getattr(self, name))
        return None

    def _settled_under(self) -> str | None:
        """Message if another gravity for the bed is not possible; else None."""
        if self.settle_gravity is None:
            return None
        if self.gravity is None:
            return say("settle_in_rig", s=self)
        return say("settle_below", s=self) if self.settle_gravity < self.gravity else None
