"""Settings of the experiments: every option of the command line, every key of a case file, the same names.

SI units. What is wrong in a single value or between two of them is refused here, before any work. What depends on the
machine or the grains' material is refused by the experiment's `check`.
"""

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Field, ModelWrapValidatorHandler, model_validator

from experiments.grains.advice import costs, times_as_long
from experiments.grains.lammps import ON_GRAINS, RANKS, lammps_fault
from experiments.runs.strict import NotNegative, Positive, SeedNumber, StrictSettings, Threads
from rigid.ground_file import is_ground_file
from rigid.platform.rig import STANDARD_GRAVITY
from vis.page.sentences import Sentences

if TYPE_CHECKING:
    from dem.grains.graded import Graded

__all__ = ["STANDARD_GRAVITY", "PenetrateSettings"]

say = Sentences(__package__)

_MATERIALS = "sand, sand-weak, jsc-1a-loose-cut, another that ships (docs/materials.md), or a material.toml"
_SOFTENED = "Young's modulus of the grains [Pa]; if not given, as soft as max_overlap allows."
_STEP = "Time step of the grains [s]; a share of the contact time if not given."
_TIPS = {"sphere": "ball tip", "cone": "cone tip", "flat": "flat foot"}
GrainMaterial = Annotated[str, Field(description=f"Grain material: {_MATERIALS}.")]
Grain = Annotated[Positive, Field(description="Mean grain diameter [m].")]
Spread = Annotated[
    float, Field(ge=0, le=0.5, description="Relative half width of the uniform distribution of grain diameters [1].")
]
BedSize = Annotated[
    tuple[Positive, Positive, Positive], Field(description="Size of the bed: both widths (periodic) and depth [m].")
]
Seeds = Annotated[tuple[SeedNumber, ...], Field(min_length=1, description="Seeds; each prepares one bed.")]
MaxOverlap = Annotated[float, Field(gt=0, le=0.1, description="Largest overlap of two grains [of a diameter].")]
Young = Annotated[Positive | None, Field(description=_SOFTENED)]
TimeStep = Annotated[Positive | None, Field(description=_STEP)]
Precision = Annotated[Literal["float64", "float32"], Field(description="Floating-point precision of the bed.")]
Arch = Annotated[Literal["cpu", "cuda"], Field(description="Processor that computes the bed.")]


class PenetrateSettings(StrictSettings):
    """A spike driven into, dropped on and set down on a bed of grains, beside the spring-damper fitted to it."""

    # The bed
    bed: str | None = Field(None, min_length=1)
    """A bed of `hedgebed bed make`: its file, the folder of its run, or its name. It sets material, bed_size, grain,
    spread, gravity, seeds and young. If not given, a bed is prepared."""
    material: GrainMaterial = "sand"
    bed_size: BedSize = (0.072, 0.072, 0.0508)
    grain: Grain = 0.0024
    spread: Spread = 0.15
    coarse: Positive | None = None
    """Graded bed: largest mean grain diameter, away from the spike, around which it is `grain` [m]; one size throughout
    if not given."""
    fine_radius: Positive | None = None
    """Graded bed: half width of the fine region along x, from the axis of the spike [m]; 1.5 tip diameters if not
    given."""
    fine_depth: Positive | None = None
    """Graded bed: depth of the fine region [m]; if not given, two tip diameters below `depth`, or the whole bed."""
    packing: float | None = Field(None, gt=0.5, le=0.64)
    """Packing fraction of the bed [1], of a graded bed around the spike. If not given: that after settling; of a graded
    bed that of a rained bed of one size, where it is known."""
    bed_stages: tuple[str, ...] | None = None
    """Stages of preparation, as for `hedgebed bed make --stages`, `level` last. If not given: rain and level; cohesive
    materials use a recipe of their own (rain without cohesion, compact, switch cohesion on)."""
    gravity: Positive = STANDARD_GRAVITY
    """Gravity of the grains [m/s2]; 1 g also in the rig. Speeds, times and modulus that are not given are scaled with
    it, and off Earth no rig is used unless it is given."""
    seeds: Seeds = (1, 2, 3)

    # The spike
    tip: Literal["sphere", "cone", "flat"] = Field("sphere", description="Shape of the tip.")
    tip_diameter: Positive = Field(
        0.012,
        description="Diameter of the tip [m]; --spike-diameter is the same.",
        json_schema_extra={"option_alias": "--spike-diameter"},
    )
    shaft_diameter: Positive | None = None
    """Diameter of the shaft [m], from one grain to tip_diameter; a flat tip needs tip_diameter itself, which is the
    default."""
    shaft_length: Positive = Field(0.06, description="Length of the shaft above the tip's widest point [m].")
    cone_angle: float = Field(60.0, ge=1, lt=180, description="Full angle of a conical tip [degrees].")
    spike_friction: NotNegative = Field(0.5, description="Friction coefficient between spike and grains [1].")
    spike_restitution: float = Field(
        0.5, ge=0.01, le=1, description="Coefficient of restitution between spike and grains [1]."
    )

    # What rests on it
    platform_mass: Positive = Field(5.3, description="Mass of the platform [kg]; one spike carries a quarter.")
    rig: NotNegative = Field(0.0085, lt=1)
    """Simulated gravity of the offloading rig, in g [9.80665 m/s2]; 0 means no rig: `gravity` sets the weight."""
    load: Positive | None = None
    """Weight on a spike that is set down or dropped [N]. If not given, a quarter of the platform's weight: m g / 4, or
    in the rig (m + m_b) g_sim / 4, by default (5.3 kg + 5.2 kg counterweight) x 0.0085 g / 4 = 0.219 N."""
    mass: Positive = 0.1
    """Mass that moves in a drop, under the weight `load` [kg]. The default stops within a shallow bed. A quarter of the
    platform in the rig, (m + m_b) / 4, is 2.63 kg. A free drop in a laboratory has load = mass x g."""

    # What is done with it
    speeds: tuple[Positive, ...] = Field((0.1, 0.2, 0.4), min_length=1)
    """Speeds of pushes [m/s]. The default is for a tip of 12 mm; for a similar push of another tip multiply it by the
    square root of tip_diameter / 12 mm."""
    depth: Positive = 0.012
    """Depth of pushes [m]. The default is for a tip of 12 mm; for a similar push of another tip multiply it by
    tip_diameter / 12 mm."""
    hold: NotNegative = Field(0.01, description="Time for which a pushed spike is held at depth [s].")
    retreat_speed: Positive = Field(0.4, description="Speed of withdrawal [m/s].")
    drop_speeds: tuple[Positive, ...] = (0.1, 0.15, 0.2)
    """Speeds of drops at the surface [m/s]; none: no drops on any bed, unless other_drop_speeds is given."""
    after_stop: Positive = Field(0.03, description="Time for which a drop is followed after its first stop [s].")
    drop_time: Positive = Field(0.8, description="Longest time of a drop [s].")
    set_down: bool = Field(True, description="Set the load down on each bed; without it no sinkage is computed.")
    lowering_speed: Positive = Field(0.1, description="Speed at which a spike is set down [m/s].")
    rest_time: Positive = Field(0.04, description="Time for which a spike must stand still to count as at rest [s].")
    other_speeds: tuple[Positive, ...] = (0.4,)
    """Speeds of pushes into the second and further beds [m/s]; if not given and nothing is dropped on them, the slowest
    and the fastest of `speeds`, which separate K from C."""
    other_drop_speeds: tuple[Positive, ...] = Field(
        (0.15,), description="Speeds of drops onto the second and further beds [m/s]."
    )

    # Beside it
    ground: str = "bed"
    """Ground of the spike: bed (of grains), lammps (a bed whose grains are in LAMMPS), spring-damper (that of `model`,
    without grains), or the law of a ground.toml."""
    ranks: int | None = Field(None, ge=1, le=4096, description=RANKS)
    model: str | None = Field(None, min_length=1)
    """A model.toml that `diagnose` wrote for pushes. Its law, with all effects, is compared with bed and spring-damper.
    With ground = spring-damper it also gives tip, mass and load that are not given here."""
    campaign: str | None = Field(None, min_length=1)
    """Folder in which the runs are also written as a campaign of measured trials, with sensor noise."""
    campaign_rate: Positive = Field(1000.0, description="Campaign: sampling rate [Hz].")
    campaign_depth_std: Positive = Field(5e-5, description="Campaign: noise of the depth, standard deviation [m].")
    campaign_force_std: Positive = Field(0.02, description="Campaign: noise of the force of pushes [N].")
    campaign_accel_std: Positive = Field(0.2, description="Campaign: noise of the acceleration of drops [m/s2].")
    campaign_seed: SeedNumber = Field(1, description="Campaign: seed of the noise.")

    # How it is computed
    max_overlap: MaxOverlap = 0.05
    young: Young = None
    time_step: TimeStep = None
    substeps: int = Field(10, ge=1, le=1000, description="Time steps of the grains for each step of the spike [1].")
    precision: Precision = "float64"
    arch: Arch = "cpu"
    threads: Threads = None
    sleep: bool = Field(
        False, description="Compute slow grains less often and grains at rest not at all (docs/bed.md, Sleep)."
    )
    allow_coarse: bool = Field(
        False, description="Accept a tip of less than five grains across, for a fast run of low resolution."
    )
    cache: bool = Field(True, description="Keep prepared beds on disk and use them again.")

    # What is kept
    frame_count: int = Field(30, ge=0, le=2000, description="Frames of each pictured run [1]; 0: none.")
    checkpoint_interval: Positive = Field(20.0, description="Time between two checkpoints, in real time [s].")
    reference: str | None = None
    """A result.json whose stiffness, damping and sinkage are compared with these, or 'shipped' for the kept result of
    the default case."""

    @model_validator(mode="before")
    @classmethod
    def _files_decide(cls, given: Any) -> Any:
        """Fill in what the file of a bed decides, or without a bed that of a model, then what follows gravity.

        No drops are none on every seed.
        """
        from .given import settings_of_bed, settings_of_gravity, settings_of_ground, settings_of_model

        if not isinstance(given, dict):
            return given
        if given.get("drop_speeds", True) in ((), []):
            given = {"other_drop_speeds": ()} | given
        if given.get("model") and not (given.get("ground") or given.get("bed")):
            raise ValueError(say("model_on_what", model=given["model"]))
        if given.get("ground") == "spring-damper" and given.get("model"):
            given = settings_of_model(given)
        if is_ground_file(str(given.get("ground", ""))):
            given = settings_of_ground(given)
        given = settings_of_bed(given) if isinstance(given.get("bed"), str) and given["bed"] else given
        return given if given.get("ground") == "spring-damper" else settings_of_gravity(given, cls.model_fields)

    @model_validator(mode="wrap")
    @classmethod
    def _speeds_of_further_beds(cls, given: Any, made_of: ModelWrapValidatorHandler[Self]) -> Self:
        """With `other_speeds` of beds on which nothing is dropped: by the settings, or as the load would sink away."""
        made = made_of(given)
        if not isinstance(given, dict) or "other_speeds" in given or not made.on_grains or len(made.seeds) == 1:
            return made
        if not cls.model_fields["other_speeds"].default:  # a command whose beds all have the same runs
            return made
        from .given import drops_nothing, further_speeds

        if not drops_nothing(made):
            return made
        return made_of(given | {"other_speeds": further_speeds(made.speeds)})

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for finding in (self._spike(), self._bed(), self._runs(), self._beside(), lammps_fault(self)):
            if finding:
                raise ValueError(finding + self._perhaps_millimetres())
        return self

    @property
    def on_grains(self) -> bool:
        """Whether the ground is made of grains."""
        return self.ground in ON_GRAINS

    def _perhaps_millimetres(self) -> str:
        """What to ask of a length above a metre; empty where there is none."""
        for key in ("tip_diameter", "shaft_diameter", "shaft_length", "grain", "depth", "bed_size"):
            value = getattr(self, key)
            for length in value if isinstance(value, tuple) else (value or 0.0,):
                if length > 1:
                    shown = _plain(value) if isinstance(value, tuple) else f"{value:g}"
                    return say("millimetres", key=key, value=shown, length=length, metres=1e-3 * length)
        return ""

    def _spike(self) -> str | None:
        on_grains, shaft, across = self.on_grains, self.shaft_diameter, self.tip_diameter / self.grain
        if on_grains and across < 1:
            return say("tip_thin", s=self, least=5 * self.grain, most=self.tip_diameter / 5)
        if on_grains and across < 4.999 and not self.allow_coarse:
            finer = self.tip_diameter / 5
            cost = costs(times_as_long(self.bed_size, self.grain, wanted=self.bed_size, wanted_grain=finer))
            return say("tip_coarse", s=self, across=across, least=5 * self.grain, most=finer, cost=cost)
        if shaft is not None and (shaft > self.tip_diameter or (self.tip == "flat" and shaft != self.tip_diameter)):
            bound = "equal" if self.tip == "flat" else "be at most"
            return f"shaft_diameter = {shaft:g} m must {bound} tip_diameter, {self.tip_diameter:g} m"
        if not on_grains:  # no grains, and no floor
            return None
        if shaft is not None and shaft < self.grain:
            return say("shaft_thin", shaft=shaft, s=self)
        if self.tip == "cone":
            there = 2 * self.depth * math.tan(math.radians(0.5 * self.cone_angle))
            if there < self.grain:
                least = 2 * math.degrees(math.atan(0.5 * self.grain / self.depth))
                return say("cone_thin", s=self, there=there, least=least)
        # A drop or a set-down is ended one tip's diameter above the floor.
        reach = max(self.depth, self.bed_size[2] - self.tip_diameter) if self.loaded else self.depth
        if self.foot < reach * (1 - 1e-9):
            least = reach - self.tip_height
            if not self.loaded:
                return say("shaft_short_of_depth", s=self, least=least)
            what = say("reached_by_drop" if self.dropped_speeds else "reached_by_set_down")
            return say("shaft_short", s=self, what=what, reach=reach, least=least)
        return None

    def _bed(self) -> str | None:
        if not self.on_grains:  # there is no bed then
            return say("sleep_without_bed") if self.sleep else None
        width, height = min(self.bed_size[:2]), self.bed_size[2]
        wide, deep = 4 * self.tip_diameter, self.depth + self.tip_diameter
        if width < wide * (1 - 1e-9):
            wanted = (*(max(width, wide) for width in self.bed_size[:2]), height)
            cost = costs(times_as_long(self.bed_size, self.grain, wanted=wanted, wanted_grain=self.grain))
            return say("bed_narrow", size=_plain(self.bed_size), s=self, wide=wide, cost=cost)
        if self.depth < self.grain:
            return say("depth_of_grain", s=self)
        if height < deep * (1 - 1e-9):
            return say("bed_shallow", size=_plain(self.bed_size), s=self, deep=deep)
        if self.bed_stages is not None and (self.bed is not None or self.packing is not None):
            other = "bed" if self.bed is not None else "packing"
            return say("stages_and", key=other, value=getattr(self, other), stages=" ".join(self.bed_stages))
        if min(self.bed_size) < 5 * self.grain:
            return say("bed_of_few_grains", size=_plain(self.bed_size), s=self, least=5 * self.grain)
        return self._grading()

    def _grading(self) -> str | None:
        for key in ("fine_radius", "fine_depth"):
            if self.coarse is None and getattr(self, key) is not None:
                return say("of_graded", key=key, value=getattr(self, key))
        if self.coarse is None:
            return None
        if self.bed is not None:
            return say("graded_and_bed", s=self)
        radius, size = self.fine_radius, self.bed_size
        if radius is not None and not 0.5 * self.tip_diameter <= radius <= 0.5 * size[0]:
            return say("fine_radius", s=self, least=0.5 * self.tip_diameter, most=0.5 * size[0])
        if self.fine_depth is not None and not self.depth <= self.fine_depth <= size[2]:
            return say("fine_depth", s=self, most=size[2])
        try:
            self.graded.check(size)  # type: ignore[union-attr]
        except ValueError as fault:
            return str(fault)
        return None

    @property
    def graded(self) -> "Graded | None":
        """Sizes by place: fine around the spike, which stands in the bed's middle; None: one size throughout.

        Raises ValueError: sizes that a bed cannot be graded by.
        """
        from dem.grains.graded import Graded

        if self.coarse is None:
            return None
        beside = self.fine_radius or min(1.5 * self.tip_diameter, 0.5 * self.bed_size[0])
        down = self.fine_depth or min(self.depth + 2 * self.tip_diameter, self.bed_size[2])
        middle = 0.5 * self.bed_size[0]
        return Graded(
            fine=self.grain, coarse=self.coarse, spread=self.spread, depth=down,
            footprints=((middle - beside, middle + beside),),
        )  # fmt: skip

    @property
    def grain_count(self) -> float:
        """About how many grains a bed will have."""
        from experiments.grains.sizes import expected_grain_count

        count = expected_grain_count(self.bed_size, self.grain, self.spread)
        return count if self.graded is None else count * self.graded.share(self.bed_size)

    def _runs(self) -> str | None:
        for key in ("speeds", "drop_speeds", "other_speeds", "other_drop_speeds", "seeds"):
            values = getattr(self, key)
            if len(set(values)) < len(values):
                return f"{key} = {_plain(values)} holds a value twice: give each once"
        return None

    def _beside(self) -> str | None:
        if not self.on_grains and self.ground != "spring-damper" and not is_ground_file(self.ground):
            return say("no_ground", s=self)
        if is_ground_file(self.ground) and self.model is not None:
            return say("model_and_file", s=self)
        if self.ground == "spring-damper" and self.model is None:
            return "ground = 'spring-damper' needs model, the model.toml whose K and C it has: none is given"
        if not self.on_grains and self.campaign is not None:
            return say("campaign_without_bed", s=self)
        return None

    def crossing(self, time_step: float, stiffest: float = math.inf) -> str | None:
        """What is wrong where a speed is too great for a step of the grains [s]; None if nothing is.

        Blames what was set: time_step, young (up to `stiffest` [Pa]), substeps; else the speed.
        """
        macro = self.substeps * time_step
        limit = 0.5 * self.grain / macro
        key, value = self.fastest
        if value <= limit:
            return None
        ratio = value / limit
        told = {"s": self, "time_step": time_step, "key": key, "value": value, "grains": 0.5 * ratio}
        if self.time_step is not None:
            return say("time_step_crossing", **told, most=time_step / ratio)
        if self.young is not None and self.young * ratio**2 <= stiffest:
            return say("young_crossing", **told, least=self.young * ratio**2)
        if self.substeps > 10 and self.substeps / ratio >= 1:
            return say("substeps_crossing", **told, most=math.floor(self.substeps / ratio + 1e-9))
        return say("speed_crossing", **told, limit=limit)

    @property
    def fastest(self) -> tuple[str, float]:
        """The key and the value of the largest speed of these runs [m/s]."""
        keys = ("speeds", "drop_speeds", "other_speeds", "other_drop_speeds")
        every = [(key, speed) for key in keys for speed in self.used(key)]
        every += [("retreat_speed", self.retreat_speed)]
        every += [("lowering_speed", self.lowering_speed)] if self.set_down else []
        return max(every, key=lambda pair: pair[1])

    def used(self, key: str) -> Any:
        """A setting as these runs have it: with one seed those of other seeds are none."""
        return () if key in ("other_speeds", "other_drop_speeds") and len(self.seeds) == 1 else getattr(self, key)

    @property
    def driven_speeds(self) -> tuple[float, ...]:
        """Speeds of all driven runs [m/s]."""
        return (*self.speeds, *self.used("other_speeds"))

    @property
    def dropped_speeds(self) -> tuple[float, ...]:
        """Speeds of all drops [m/s]."""
        return (*self.drop_speeds, *self.used("other_drop_speeds"))

    @property
    def loaded(self) -> bool:
        """Whether the load rests on the spike in any run: it is set down or dropped."""
        return self.set_down or bool(self.dropped_speeds)

    @property
    def body_words(self) -> str:
        """The body in words, as in titles: "12 mm ball tip", "12 mm cone tip" or "16 mm flat foot"."""
        return f"{1e3 * self.tip_diameter:g} mm {_TIPS[self.tip]}"

    @property
    def foot(self) -> float:
        """Length of the spike, tip and shaft [m]."""
        return self.tip_height + self.shaft_length

    @property
    def tip_height(self) -> float:
        """Height over which the tip widens to its full diameter [m]."""
        if self.tip == "sphere":
            return 0.5 * self.tip_diameter
        if self.tip == "cone":
            return 0.5 * self.tip_diameter / math.tan(math.radians(0.5 * self.cone_angle))
        return 0.0

    @property
    def weight(self) -> float:
        """What rests on the spike [N]: `load`, or (m + m_b) g_sim / 4."""
        if self.load is not None:
            return self.load
        return self.share * (self.rig * STANDARD_GRAVITY if self.rig else self.gravity)

    @property
    def share(self) -> float:
        """The mass that a spike's quarter of the platform moves [kg]: (m + m_b) / 4, without a rig m / 4.

        The counterweight that makes the pair fall at g_sim is m_b = m (g - g_sim) / (g + g_sim) (planar model, Atwood).
        """
        counterweight = self.platform_mass * (1 - self.rig) / (1 + self.rig) if self.rig else 0.0
        return (self.platform_mass + counterweight) / 4


def _plain(values: tuple[float, ...]) -> str:
    """The values as one would type them."""
    return "[" + ", ".join(f"{value:g}" for value in values) + "]"
