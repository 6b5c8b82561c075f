"""Settings that every command about a platform on a surface shares: `hedgebed tumble`, `campaign` and `hop`.

Numbers that are not given come from the surface or the platform (`experiments.platform.settled`); a run prints them.
"""

from typing import Annotated, Self

from pydantic import Field, model_validator

from experiments.runs.strict import NotNegative, Positive, StrictSettings

from . import say

__all__ = ["NotNegative", "PlatformSettings", "Positive"]


class PlatformSettings(StrictSettings):
    """What gives way under the spikes, and the platform above them."""

    # The surface
    surface: str | None = None
    """Material: steel, brick, sand, sand-weak or jsc1a; brick if not given."""
    stiffness: Positive | None = None
    """K of a row of spikes [N/m]; the surface's if not given (brick: 1.5e4)."""
    damping: NotNegative | None = None
    """C of a row of spikes, while going in [N s/m]; the surface's if not given (brick: 60)."""
    mu_s: NotNegative | None = Field(None, description="Static friction [1]; the surface's if not given (brick: 0.5).")
    mu_d: NotNegative | None = None
    """Sliding friction [1]; the surface's if not given (brick: 0.25), half of mu_s where that is."""

    # The platform
    platform: str = "hedgehog"
    """Platform that gives what is not given here: one that ships, or its TOML file."""
    mass: Positive | None = Field(None, description="Mass [kg]; the platform's if not given (hedgehog: 5.3).")
    inertia: Positive | None = None
    """Inertia about the axis of rotation, without the wheel's own [kg m2]; the platform's if not given (hedgehog:
    0.06)."""
    spike_length: Positive | None = None
    """Centre to tip of a spike [m]; the platform's if not given (hedgehog: 0.2)."""
    wheel_inertia: Positive | None = None
    """Inertia of the flywheel [kg m2]; the platform's if not given (hedgehog: 1.2e-3)."""
    max_wheel_speed: Annotated[float, Field(gt=0)] | None = None
    """Largest speed of the wheel [rad/s]: a motor's torque ends there; the platform's if not given (hedgehog: 1050),
    unknown for another wheel_inertia and for a model."""
    max_motor_torque: Annotated[float, Field(gt=0)] | None = None
    """Largest torque of the motor [N m]; the platform's if not given (hedgehog: 0.22), unknown for another
    wheel_inertia and for a model."""

    @model_validator(mode="after")
    def _friction_fits_together(self) -> Self:
        if self.mu_s is not None and self.mu_d is not None and self.mu_d > self.mu_s:
            raise ValueError(say("mu_d_above_mu_s", s=self))
        return self
