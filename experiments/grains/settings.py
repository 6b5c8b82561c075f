"""Settings of runs on grains: the bed, how it is coupled; and of a tumble the spikes in it. They belong to
``ground = "bed"``."""

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field, JsonValue

from dem.engine.values import Sleep
from experiments.platform.settings import NotNegative, Positive
from experiments.runs.strict import StrictSettings

from . import say
from .lammps import RANKS

__all__ = ["HIDDEN", "OF_THE_MASTER", "GrainsSettings", "TumbleBedSettings"]


HIDDEN: dict[str, JsonValue] = {"hidden": True}
"""Of a setting that the help leaves out, since nothing but an older run.toml has it."""
OF_THE_MASTER = (
    "substeps", "body_steps", "extrapolation", "iterations", "tumbles", "tumble_turn", "drop_speed", "drop_along",
    "drop_spin", "drop_theta",
)  # fmt: skip
"""Settings that ``method = "coupled"`` also accepts on the spring-damper."""


_ONCE = {"spike_diameter": 0.012, "spike_clear": 0.04}
"""Defaults until 2026-11-23, which every older run.toml has, also on the spring-damper."""


class GrainsSettings(StrictSettings):
    """The bed of grains under any platform, and its coupling; SI units."""

    bed_size: tuple[Positive, Positive, Positive] = (0.7, 0.7, 0.05)
    """Bed: size along x and y (both periodic) and depth [m]."""
    grain: Positive = Field(0.003, description="Bed: mean grain diameter [m].")
    spread: float = Field(
        0.15, ge=0, le=0.5, description="Bed: relative half width of the uniform distribution of grain diameters [1]."
    )
    seed: int = Field(1, ge=0, lt=2**31, description="Bed: seed of its grains.")
    young: Positive | None = None
    """Bed: Young's modulus of the grains [Pa]; as soft as max_overlap allows if not given."""
    max_overlap: float = Field(0.05, gt=0, le=0.2)
    """Bed: expected largest overlap of two grains, over their diameter [1]. A run ends at twice this value, at most at
    0.2."""
    spike_friction: NotNegative = Field(0.5, description="Bed: friction coefficient between spike and grains [1].")
    spike_restitution: float = Field(
        0.5, ge=0.01, le=1, description="Bed: coefficient of restitution between spike and grains [1]."
    )
    lowering_speed: Positive | None = None
    """Bed: speed at which the platform is set down [m/s]; sqrt(g grain) if not given."""
    substeps: int = Field(10, ge=1, le=200)
    """Bed or method coupled: time steps of the ground between two exchanges of forces [1]."""
    body_steps: int = Field(1, ge=1, le=200)
    """Bed or method coupled: time steps of the platform between two exchanges of forces; a divisor of substeps [1]."""
    extrapolation: int = Field(0, ge=0, le=2)
    """Bed or method coupled: order of the extrapolation of the force [1]."""
    iterations: int = Field(1, ge=1, le=50)
    """Bed or method coupled: most iterations of a step; 1: explicit coupling."""
    sleep: bool = False
    """Bed: compute slow grains less often and grains at rest not at all (docs/bed.md, Sleep)."""
    sleep_pace: int = Field(Sleep.pace, ge=1, le=64)
    """Sleep: a slow grain is computed every so many steps [1]. Above 4 its mass is scaled by (sleep_pace / 4)^2, and
    sand supports too much load (docs/bed.md, Sleep). 1: no slow grains [1]."""
    sleep_force: Positive = Field(1.0, json_schema_extra=HIDDEN)
    """No longer used; accepted at its default so that older run.toml files can be read [1]."""
    sleep_share: Positive = Field(0.5, description="No longer used, as sleep_force [1].", json_schema_extra=HIDDEN)
    frame_count: int = Field(30, ge=0, le=1000, description="Bed: number of frames for ParaView; 0: none.")
    checkpoint_interval: Positive = Field(60.0, description="Bed: time between two checkpoints, in real time [s].")
    arch: Literal["cpu", "cuda"] = Field("cpu", description="Bed: processor that computes it.")
    threads: int | None = Field(None, ge=1, description="Bed: CPU threads; all cores if not given.")
    cache: bool = Field(True, description="Bed: keep prepared beds on disk and use them again.")

    def stepping(self) -> Mapping[str, Any]:
        """Options of the master."""
        return {name: getattr(self, name) for name in ("substeps", "body_steps", "extrapolation", "iterations")}

    def stepping_fault(self) -> str | None:
        """Message on steps of which one is no multiple of the other; None without a fault."""
        return say("uneven_steps", s=self) if self.substeps % self.body_steps else None

    def sleep_fault(self) -> str | None:
        """Message on a rule of sleep without sleep, or one that no longer exists; None without a fault."""
        fields = GrainsSettings.model_fields
        for key in ("sleep_force", "sleep_share"):
            if getattr(self, key) != fields[key].default:
                return say("sleep_once", key=key, value=getattr(self, key), default=fields[key].default)
        if not self.sleep and self.sleep_pace != fields["sleep_pace"].default:
            return say("of_sleep", key="sleep_pace", value=self.sleep_pace)
        return say("sleep_on_gpu", s=self) if self.sleep and self.arch != "cpu" else None

    @property
    def sleep_rules(self) -> Sleep:
        """The rules of sleep."""
        return Sleep(pace=self.sleep_pace, every=self.sleep_pace * max(1, round(Sleep.every / self.sleep_pace)))


class TumbleBedSettings(GrainsSettings):
    """The same of a tumble in the plane, whose bed is a slice as wide as one spike has for itself."""

    bed_size: tuple[Positive, Positive, Positive] = (0.5, 0.06, 0.046)
    """Bed: length along the motion, width for one spike (both periodic) and depth [m]."""
    ranks: int | None = Field(None, ge=1, le=4096, description=RANKS)
    bed_repeats: int = Field(1, ge=1, le=100)
    """Bed: number of copies of the prepared bed, end to end along the motion [1]."""
    coarse: Positive | None = None
    """Graded bed: largest mean grain diameter, away from the expected footprints, under which it is `grain` [m]; one
    size throughout if not given."""
    fine_radius: Positive | None = None
    """Graded bed: half width of a fine region, from the expected axis of a tip [m]; 1.5 spike diameters if not
    given."""
    fine_depth: Positive | None = None
    """Graded bed: depth of the fine region [m]; if not given, two spike diameters below the deepest expected tip, or
    the whole bed."""
    bed_stages: tuple[str, ...] | None = None
    """Bed: stages of preparation, as for `hedgebed bed make --stages`. If not given: rain and level; cohesive materials
    use a recipe of their own (jsc1a: rain:dry compact:0.56 stick level)."""
    place: float = Field(0.0, allow_inf_nan=False)
    """Bed: place where the platform is set down, along the bed from its middle [m]. The bed is periodic; another place
    has other grains."""
    spike_diameter: Positive | None = None
    """Bed: diameter of shaft and spherical tip of a spike [m]; the platform's if not given (hedgehog: 0.012)."""
    spike_clear: Positive | None = None
    """Bed: length by which a spike extends beyond the hull [m]; the platform's if not given (hedgehog: 0.04)."""
    settle_gravity: Positive | None = None
    """Bed, without a rig: gravity in which bed and platform settle, lowered to `gravity` before the torque begins, to
    save time [m/s2]; `gravity` if not given."""
    tumbles: int = Field(1, ge=1, le=20)
    """Bed or method coupled: number of successive tumbles; the next torque begins when the platform is at rest [1]."""
    tumble_turn: Positive = Field(1.0, le=4)
    """Bed or method coupled: rotation at which each torque of successive tumbles ends, over pi / rows [1]."""
    drop_speed: Positive | None = None
    """Bed or method coupled: simulate a landing instead of a tumble, with this downward speed [m/s]."""
    drop_along: float = Field(0.0, allow_inf_nan=False, description="Landing: speed along the surface [m/s].")
    drop_spin: float = Field(0.0, allow_inf_nan=False, description="Landing: angular velocity, clockwise [rad/s].")
    drop_theta: float = Field(0.0, allow_inf_nan=False, description="Landing: angle theta at the first touch [rad].")

    @property
    def bed_length(self) -> float:
        """Of the whole bed along the motion [m]; bed_size is that of the piece which is prepared."""
        return self.bed_repeats * self.bed_size[0]

    def bed_settings_given(self) -> list[str]:
        """Names of those of these settings that are not at their defaults, and not at those that run.toml once had."""
        fields = TumbleBedSettings.model_fields
        return [
            name
            for name, field in fields.items()
            if getattr(self, name) != field.default and getattr(self, name) != _ONCE.get(name)
        ]
