"""Settings of `hedgebed hop`."""

from typing import Literal, Self

from pydantic import Field, model_validator

from experiments.platform.settings import PlatformSettings, Positive
from experiments.runs.strict import StrictSettings
from rigid.ground_file import is_ground_file
from vis.page.sentences import Sentences

__all__ = ["DEFAULT_DISTANCE", "HopSettings"]

say = Sentences(__package__)

DEFAULT_DISTANCE = 5.0
"""Of a hop that is given neither distance nor wheel speed nor torque of a motor [m]."""


class _Question(StrictSettings):
    """What is asked of a hop: the means for a distance, or how far given means go."""

    gravity: Positive = Field(1e-3, description="Gravity at the surface [m/s2].")
    distance: Positive | None = None
    """How far to hop, along the ground [m]; 5 if neither it nor wheel_speed_0, nor a motor's torque, is given."""
    wheel_speed_0: Positive | None = None
    """In place of a distance: speed of the wheel before the brake [rad/s]; says how far that goes."""
    body_radius: Positive | None = None
    """Radius of the body [m]; a flat ground, and nothing said of escape, if not given."""
    actuator: Literal["brake", "motor"] = "brake"
    """A brake on a spinning wheel, or a motor from rest."""
    torque: Positive | None = None
    """Torque on the platform [N m]: of a brake its largest if not given; of a motor, given in place of a distance, says
    how far that goes."""


class HopSettings(PlatformSettings, _Question):
    """A hop: what the flywheel must do for a distance, or how far it goes; how the platform leaves and flies."""

    ground: str = "spring-damper"
    """Law under the spikes: spring-damper, with K and C of the surface, or a ground.toml of one spike."""

    @model_validator(mode="after")
    def _one_question(self) -> Self:
        if self.ground != "spring-damper":
            if not is_ground_file(self.ground):
                raise ValueError(say("no_ground", s=self))
            if key := next((key for key in ("stiffness", "damping") if getattr(self, key) is not None), None):
                raise ValueError(say("of_the_spring_damper", key=key, value=getattr(self, key), s=self))
        if self.wheel_speed_0 is not None and self.actuator == "motor":
            raise ValueError(say("wheel_of_a_motor", s=self))
        if self.wheel_speed_0 is not None and self.distance is not None:
            raise ValueError(say("speed_and_distance", s=self))
        if self.actuator == "motor" and self.torque is not None and self.distance is not None:
            raise ValueError(say("torque_and_distance", s=self))
        return self

    @property
    def asks_for(self) -> Literal["distance", "wheel_speed", "torque"]:
        """What was given: a distance to go, or the means to see how far they go."""
        if self.wheel_speed_0 is not None:
            return "wheel_speed"
        return "torque" if self.actuator == "motor" and self.torque is not None else "distance"
