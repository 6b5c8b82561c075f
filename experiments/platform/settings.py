"""Settings that every command about a platform on a surface shares: `hedgebed tumble`, `campaign` and `hop`.

Numbers that are not given come from the surface or the platform (`experiments.platform.settled`); a run prints them.
"""

from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import BeforeValidator, Field, model_validator

from experiments.runs.strict import NotNegative, Positive, StrictSettings

from . import say

__all__ = ["BRAKE_TIME", "Assignments", "NotNegative", "PlatformSettings", "Positive", "brake_time_fault"]

BRAKE_TIME = """Time in which the brake stops the wheel [s], instead of torque, which is then wheel_inertia times the \
speed of the wheel over it; that of the platform's file if it has one."""


def _as_assignments(given: object) -> object:
    """A table of numbers as name=value texts; anything else as it is."""
    return tuple(f"{name}={value}" for name, value in given.items()) if isinstance(given, Mapping) else given


Assignments = Annotated[tuple[str, ...], BeforeValidator(_as_assignments)]
"""Parameters as name=value texts; a table of names and numbers is accepted too."""


class PlatformSettings(StrictSettings):
    """What gives way under the spikes, and the platform above them."""

    # The surface
    surface: str | None = None
    """Surface: steel, brick, sand, sand-weak, jsc1a or jsc1a-heights; brick if not given."""
    stiffness: Positive | None = None
    """Stiffness K under a row of spikes [N/m]; that of the surface if not given (brick: 1.5e4)."""
    damping: NotNegative | None = None
    """Damping C under a row of spikes that moves into the ground [N s/m]; that of the surface if not given
    (brick: 60)."""
    mu_s: NotNegative | None = Field(
        None, description="Coefficient of static friction [1]; that of the surface if not given (brick: 0.5)."
    )
    mu_d: NotNegative | None = None
    """Coefficient of sliding friction [1]; if not given, half of a given mu_s, else that of the surface (brick:
    0.25)."""

    # The platform
    platform: str = "hedgehog"
    """Platform: hedgehog, cubli, mascot, minerva, cube, or a TOML file (docs/platform.md). It gives the numbers below
    that are not given."""
    mass: Positive | None = Field(
        None, description="Mass of the platform [kg]; from its file if not given (hedgehog: 5.3)."
    )
    inertia: Positive | None = None
    """Moment of inertia about the axis of rotation, without that of the wheel [kg m2]; from the platform's file if not
    given (hedgehog: 0.06)."""
    spike_length: Positive | None = None
    """Distance from the centre to the tip of a spike [m]; from the platform's file if not given (hedgehog: 0.2)."""
    wheel_inertia: Positive | None = None
    """Moment of inertia of the flywheel [kg m2]; from the platform's file if not given (hedgehog: 1.2e-3)."""
    max_wheel_speed: Annotated[float, Field(gt=0)] | None = None
    """Largest speed of the wheel [rad/s], at which a motor's torque ends; from the platform's file if not given
    (hedgehog: 1050). Unknown if wheel_inertia or a model is given."""
    max_motor_torque: Annotated[float, Field(gt=0)] | None = None
    """Largest torque of the motor [N m]; from the platform's file if not given (hedgehog: 0.22). Unknown if
    wheel_inertia or a model is given."""

    @model_validator(mode="after")
    def _friction_fits_together(self) -> Self:
        if self.mu_s is not None and self.mu_d is not None and self.mu_d > self.mu_s:
            raise ValueError(say("mu_d_above_mu_s", s=self))
        return self


def brake_time_fault(brake_time: float | None, torque: float | None, actuator: str) -> str | None:
    """Message if a brake's time [s] is given with a torque [N m] or for a motor; else None."""
    if brake_time is None:
        return None
    if torque is not None:
        return say("brake_time_and_torque", brake_time=brake_time, torque=torque)
    return None if actuator == "brake" else say("brake_time_of_a_motor", brake_time=brake_time)
