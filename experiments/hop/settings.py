"""Settings of `hedgebed hop`."""

from typing import Literal, Self

from pydantic import Field, model_validator

from experiments.platform.settings import BRAKE_TIME, PlatformSettings, Positive, brake_time_fault
from experiments.runs.strict import StrictSettings
from rigid.ground_file import is_ground_file
from vis.page.sentences import Sentences

__all__ = ["DEFAULT_DISTANCE", "HopSettings"]

say = Sentences(__package__)

DEFAULT_DISTANCE = 5.0
"""Of a hop that is given neither distance nor wheel speed nor torque of a motor [m]."""


class _Question(StrictSettings):
    """The question: the effort for a distance, or the distance of a given effort."""

    gravity: Positive = Field(1e-3, description="Gravity at the surface [m/s2].")
    distance: Positive | None = None
    """Distance of the hop along the ground [m]; 5 if neither distance, wheel_speed_0 nor the torque of a motor is
    given."""
    wheel_speed_0: Positive | None = None
    """Speed of the wheel before braking [rad/s], instead of a distance; the distance is computed."""
    body_radius: float | None = Field(None, gt=0, le=1e9)
    """Radius of the asteroid [m]; if not given, the ground is flat and escape is not examined."""
    actuator: Literal["brake", "motor"] = "brake"
    """Source of the torque: a brake on a spinning wheel, or a motor that starts at rest."""
    torque: Positive | None = None
    """Torque on the platform [N m]. Of a brake: its largest if not given. Of a motor: instead of a distance, which is
    then computed."""
    brake_time: Positive | None = Field(None, description=BRAKE_TIME)


class HopSettings(PlatformSettings, _Question):
    """A hop: what the flywheel must do for a distance, or how far it goes; how the platform leaves and flies."""

    ground: str = "spring-damper"
    """Law under the spikes: spring-damper, with K and C of the surface, or a ground.toml of one spike."""
    threads: int | None = Field(None, ge=1, description="CPU threads; a hop uses one.")

    @model_validator(mode="after")
    def _one_question(self) -> Self:
        if self.ground != "spring-damper":
            if not is_ground_file(self.ground):
                raise ValueError(say("no_ground", s=self))
            if key := next((key for key in ("stiffness", "damping") if getattr(self, key) is not None), None):
                raise ValueError(say("of_the_spring_damper", key=key, value=getattr(self, key), s=self))
        if fault := brake_time_fault(self.brake_time, self.torque, self.actuator):
            raise ValueError(fault)
        if self.wheel_speed_0 is not None and self.actuator == "motor":
            raise ValueError(say("wheel_of_a_motor", s=self))
        if self.wheel_speed_0 is not None and self.distance is not None:
            raise ValueError(say("speed_and_distance", s=self))
        if self.actuator == "motor" and self.torque is not None and self.distance is not None:
            raise ValueError(say("torque_and_distance", s=self))
        return self

    @property
    def asks_for(self) -> Literal["distance", "wheel_speed", "torque"]:
        """What was given: a distance, or an effort."""
        if self.wheel_speed_0 is not None:
            return "wheel_speed"
        return "torque" if self.actuator == "motor" and self.torque is not None else "distance"
