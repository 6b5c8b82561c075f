"""Settings of `hedgebed hop`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

__all__ = ["HopSettings"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class HopSettings(BaseModel):
    """A hop over a wanted distance: what the flywheel must do, how the platform leaves and how it flies."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    gravity: Positive = Field(1e-3, description="Gravity at the surface [m/s2].")
    distance: Positive = Field(5.0, description="How far to hop, along the ground [m].")
    body_radius: Positive | None = Field(
        None, description="Radius of the body [m]; a flat ground, and nothing said of escape, if not given."
    )
    platform: str = Field("hedgehog", description="A platform that ships, or the path of a .toml file of one's own.")
    actuator: Literal["brake", "motor"] = Field(
        "brake", description="A brake on a spinning wheel, or a motor from rest."
    )
    torque: Positive | None = Field(
        None,
        description="Torque on the platform [N m]; if not given the brake's largest, or whatever the motor needs.",
    )
    surface: str = Field(
        "brick", description="Material: steel, brick, sand or jsc1a; its friction, and what gives way under the tips."
    )
    mu_s: NotNegative | None = Field(
        None, description="Static friction of tips and ground [1]; the surface's if not given (brick: 0.5)."
    )
    mu_d: NotNegative | None = Field(
        None,
        description="Sliding friction [1]; the surface's if not given (brick: 0.25), half of mu_s where that is.",
    )
    stiffness: Positive | None = Field(
        None, description="K of a row of tips [N/m]; the surface's if not given (brick: 1.5e4). Hop theory has none."
    )
    damping: NotNegative | None = Field(
        None, description="C of a row of tips, while going in [N s/m]; the surface's if not given (brick: 60)."
    )

    @model_validator(mode="after")
    def _fits_together(self) -> HopSettings:
        if self.mu_s is not None and self.mu_d is not None and self.mu_d > self.mu_s:
            raise ValueError(f"mu_d = {self.mu_d:g} is above mu_s = {self.mu_s:g}: at most that would do")
        if self.actuator == "motor" and self.torque is not None:
            raise ValueError(
                f"torque = {self.torque:g} N m with actuator = 'motor': the distance decides what the motor must give, "
                f"so leave one of the two out"
            )
        return self
