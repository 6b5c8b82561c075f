"""Settings of runs on grains: the bed, how it is coupled; and of a tumble the spikes in it. They belong to
``ground = "bed"``."""

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field

from dem.engine.values import Sleep
from experiments.platform.settings import NotNegative, Positive
from experiments.runs.strict import StrictSettings

from . import say

__all__ = ["OF_THE_MASTER", "GrainsSettings", "TumbleBedSettings"]


OF_THE_MASTER = (
    "substeps", "body_steps", "extrapolation", "iterations", "tumbles", "tumble_turn", "drop_speed", "drop_along",
    "drop_spin", "drop_theta",
)  # fmt: skip
"""Those that ``method = "coupled"`` takes on the spring-damper too."""


_ONCE = {"spike_diameter": 0.012, "spike_clear": 0.04}
"""Defaults until 2026-11-23, which every run.toml of before has, on the spring-damper too."""


class GrainsSettings(StrictSettings):
    """What a bed of grains under any platform is made of, and how it is coupled; SI units."""

    bed_size: tuple[Positive, Positive, Positive] = (0.7, 0.7, 0.05)
    """On a bed: its size along x and y (both periodic) and its depth [m]."""
    grain: Positive = Field(0.003, description="On a bed: mean grain diameter [m].")
    spread: float = Field(0.15, ge=0, le=0.5, description="On a bed: grain diameters are uniform within 1 +- this [1].")
    seed: int = Field(1, ge=0, lt=2**31, description="On a bed: seed of its grains.")
    young: Positive | None = None
    """On a bed: Young's modulus of the softened grains [Pa]; from max_overlap if not given."""
    max_overlap: float = Field(0.05, gt=0, le=0.2)
    """On a bed: overlap over diameter that the step is made for [1]; past twice it, or 0.2, a run ends."""
    spike_friction: NotNegative = Field(0.5, description="On a bed: friction of spike and grains [1].")
    spike_restitution: float = Field(0.5, ge=0.01, le=1, description="On a bed: restitution of spike and grains [1].")
    lowering_speed: Positive | None = None
    """On a bed: speed at which the platform is set down [m/s]; sqrt(g grain) if not given."""
    substeps: int = Field(10, ge=1, le=200)
    """On a bed, or coupled: steps of the ground from one exchange of forces to the next [1]."""
    body_steps: int = Field(1, ge=1, le=200)
    """On a bed, or coupled: steps of the platform from one exchange of forces to the next; it divides substeps [1]."""
    extrapolation: int = Field(0, ge=0, le=2)
    """On a bed, or coupled: order of the guess at the next force [1]."""
    iterations: int = Field(1, ge=1, le=50)
    """On a bed, or coupled: how often a step is computed at most; 1: explicit."""
    sleep: bool = False
    """On a bed: whether quiet grains are computed every so many steps only, and those at rest not at all
    (docs/bed.md)."""
    sleep_pace: int = Field(Sleep.pace, ge=1, le=64)
    """Of sleep: steps of the bed for one of a quiet grain; above 4 its mass counts (pace / 4)^2 times, and sand bears
    too much (docs/bed.md); 1: there are no such grains [1]."""
    sleep_force: Positive = 1.0
    """Of the rules of sleep before 2026-11-26; no longer used [1]."""
    sleep_share: Positive = Field(0.5, description="Likewise [1].")
    frame_count: int = Field(30, ge=0, le=1000, description="On a bed: frames for ParaView; 0: none.")
    checkpoint_interval: Positive = Field(60.0, description="On a bed: time between checkpoints [s].")
    arch: Literal["cpu", "cuda"] = Field("cpu", description="On a bed: where it is computed.")
    threads: int | None = Field(None, ge=1, description="On a bed: threads; all cores if not given.")
    cache: bool = Field(True, description="On a bed: whether prepared beds are kept and used again.")

    def stepping(self) -> Mapping[str, Any]:
        """How the master steps the run."""
        return {name: getattr(self, name) for name in ("substeps", "body_steps", "extrapolation", "iterations")}

    def stepping_fault(self) -> str | None:
        """Steps that do not go into one another, in words."""
        return say("uneven_steps", s=self) if self.substeps % self.body_steps else None

    def sleep_fault(self) -> str | None:
        """A rule of sleep that is given where nothing sleeps, or that there is no more, in words."""
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
    """On a bed: its length along the motion, its width for one spike (both periodic) and its depth [m]."""
    bed_repeats: int = Field(1, ge=1, le=100)
    """On a bed: how often the prepared bed is laid end to end along the motion [1]."""
    coarse: Positive | None = None
    """On a bed: graded: `grain` is the mean diameter under the expected footprints, this the largest away from them
    [m]; one size throughout if not given."""
    fine_radius: Positive | None = None
    """Of a graded bed: how far beside where the axis of a tip is expected grains are fine [m]; 1.5 spike diameters if
    not given."""
    fine_depth: Positive | None = None
    """Of a graded bed: how far down from the surface grains are fine [m]; two spike diameters below the deepest tip
    expected, or to the floor, if not given."""
    bed_stages: tuple[str, ...] | None = None
    """On a bed: how it is prepared, as `hedgebed bed make --stages` has it (rain:dry compact:0.57 stick level, for
    grains that stick); rained and levelled if not given."""
    place: float = Field(0.0, allow_inf_nan=False)
    """On a bed: how far along it from its middle the platform is set down [m]; the bed goes on periodically, so other
    grains lie there."""
    spike_diameter: Positive | None = None
    """On a bed: diameter of shaft and ball tip of a spike [m]; the platform's if not given (hedgehog: 0.012)."""
    spike_clear: Positive | None = None
    """On a bed: how far a spike stands out of the hull [m]; the platform's if not given (hedgehog: 0.04)."""
    settle_gravity: Positive | None = None
    """On a bed, in flight: gravity under which the bed is rained and the platform set down, lowered to `gravity` before
    the torque begins [m/s2]: the same sooner; `gravity` itself if not given."""
    tumbles: int = Field(1, ge=1, le=20)
    """On a bed, or coupled: tumbles in a row; a torque begins when the platform lies [1]."""
    tumble_turn: Positive = Field(1.0, le=4)
    """On a bed, or coupled: where each torque of a row of tumbles ends, over pi / rows [1]."""
    drop_speed: Positive | None = None
    """On a bed, or coupled: a landing in place of a tumble, at this speed downwards [m/s]."""
    drop_along: float = Field(0.0, allow_inf_nan=False, description="Of a landing: speed along the surface [m/s].")
    drop_spin: float = Field(0.0, allow_inf_nan=False, description="Of a landing: spin, clockwise [rad/s].")
    drop_theta: float = Field(0.0, allow_inf_nan=False, description="Of a landing: theta at the first touch [rad].")

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
