"""A platform on a bed of grains: the common part of runs in the plane and in space.

A variant of `PlatformOnBed` defines the members that stand on the bed, how far they go and how they are stepped. From
that follow the size of the bed, the stiffness of its grains, the prepared bed, the run and its result. The same trial
on the spring-damper is computed first: its `Forecast` says how far and how deep the bed must reach.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, TypeVar

from coupling import BedGround
from coupling.lowered_gravity import pace_under
from coupling.members import Member
from coupling.platform_run import PLACING_WAY, REST_TIME
from dem import Bed, Graded
from dem.contact.timestep import time_step_for
from dem.engine.runtime import usable_cores
from dem.engine.values import refuse_sleep
from dem.grains.materials import Material
from dem.grains.materials import material as find_material
from experiments.platform.surfaces import find_surface, surface_names
from experiments.runs.folder import RunFolder
from experiments.runs.pace import known_pace, runtime_name
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.stopping import held_back
from experiments.runs.types import Json
from rigid.checks.unfit import failed_as
from rigid.platform.rig import STANDARD_GRAVITY

from . import say
from .bearing import STICKING, resistance_of
from .bed_progress import BedProgress, Stages
from .following import CHECKPOINT, Followed, Run
from .lammps import in_lammps
from .recipes import recipe_of
from .settings import GrainsSettings
from .sizes import carried_height, expected_grain_count
from .softening import Softening, check_young, run_limit, soften_material
from .staged import RAIN, lower_gravity, lowering_time, preparation_time, staged_bed
from .where import check_where

__all__ = ["MARGIN", "PACE", "Forecast", "OnLoweredBed", "PlatformOnBed"]

MARGIN = 3.0  # Sand beyond the outermost footprint, over a spike's diameter [1]
TOUCH = 1e-3  # Force on a row, or in space on all spikes, that counts as touching for the torque, over the weight [1]
PACE = 3.0
"""Grain-steps in a second of processor time [1e6]: the leg for 1 s on 3,921 grains, 1.2e8 grain-steps, took 62 s with
its bed on one core (docs/notes/mujoco.md). Sleep makes it less."""
MOST_GRAINS = 3e6  # More are refused: the run would take days

Settings = TypeVar("Settings", bound=GrainsSettings)


@dataclass(frozen=True, kw_only=True)
class Forecast:
    """The demands on the bed of the same trial on the spring-damper."""

    deepest: float  # Depth of the deepest tip [m]
    fastest: float  # Largest speed of a tip in the ground [m/s]
    rise: float  # Of the centre above its start, at most [m]
    margin: float = 1.5  # Depth and speed on grains for which their modulus is chosen, over those here [1]
    on: str = "on the spring-damper"  # What the forecast is computed on, for refusals


Expected = TypeVar("Expected", bound=Forecast)


class PlatformOnBed(Followed[Run], Generic[Settings, Run, Expected]):
    """One run of a platform on a bed of grains; the abstract members are what differs in the plane and in space."""

    settings: Settings
    duration: float  # How long the run lasts [s]
    surface: str  # Name of the surface whose grains the bed is made of
    gravity: float  # Gravity of the platform [m/s2]
    counterweight: float  # Of the rig [kg]; 0 in flight
    weight: float  # On the surface [N]
    progress: Progress  # Set by `announce`
    turns_freely = False  # Whether it turns about any axis, not about y alone
    copies = 1.0  # Members side by side in the platform for one on the bed [1]
    spike_diameter: float  # [m]
    reach: float  # From the centre to the farthest tip [m]
    repeats = 1  # How often the prepared bed is laid end to end [1]
    given_stages: tuple[str, ...] | None = None  # Stages of the bed that are set; None: those of its material
    bed_stage = "bed"  # What the progress calls the preparation
    report_seconds = 10.0  # Expected duration of its report [s]
    plans = True  # Whether it reports the stages to come; one of several beds does not

    # What differs

    @property
    @abstractmethod
    def forecast(self) -> Expected:
        """The same trial on the spring-damper, computed when first asked for."""

    @property
    @abstractmethod
    def pressure(self) -> float:
        """Pressure of the load alone under a tip [Pa]."""

    @property
    @abstractmethod
    def lowering_speed(self) -> float | None:
        """Speed at which the platform is set down [m/s]; None without a placement."""

    @abstractmethod
    def members(self) -> list[Member]:
        """Spikes and hull in contact with grains. Raises ValueError for a platform that is not possible on a bed."""

    @abstractmethod
    def check_extent(self) -> None:
        """Raise ValueError for a bed too short or too narrow for the forecast."""

    @abstractmethod
    def layout(self, bed: Bed) -> Mapping[str, Any]:
        """Options of `BedGround`: where the platform starts, so that the expected footprints lie in the middle."""

    @abstractmethod
    def run_on(self, ground: BedGround) -> Run:
        """The run, ready to be stepped."""

    @abstractmethod
    def announce(self, progress: Progress) -> None:
        """State settings, defaults and warnings before the bed is made."""

    @property
    def graded(self) -> Graded | None:
        """Sizes by place; None: one size throughout."""
        return None

    def check_layout(self) -> None:
        """Raise ValueError for a layout that the platform cannot use."""

    def thrown(self) -> float:
        """Height over the surface up to which thrown grains are computed [m]."""
        return 0.0

    # What follows

    @cached_property
    def material(self) -> Material:
        """The grains of the surface; a surface energy given for one grain size is scaled when the bed is made."""
        grains = find_surface(self.surface).grains if self.surface in surface_names() else None
        if grains is None:
            known = ", ".join(name for name in surface_names() if find_surface(name).grains)
            raise ValueError(say("no_grains", surface=self.surface, known=known))
        return find_material(grains)

    @property
    def stages(self) -> tuple[str, ...] | None:
        """How the bed is prepared: as set, else by the recipe of its material; None: rained and levelled."""
        return self.given_stages or recipe_of(self.material).stages

    @property
    def grain_gravity(self) -> float:
        """Gravity of the grains [m/s2]: the true one in the rig."""
        return STANDARD_GRAVITY if self.counterweight > 0 else self.gravity

    @property
    def first_gravity(self) -> float:
        """Gravity of the grains when their bed is made and the platform is set down [m/s2]."""
        return self.grain_gravity

    def check(self) -> None:
        """Raise ValueError, naming key, value and what is needed, for a bed that is unsuitable for this trial."""
        self.material, self.members()
        if self.settings.sleep:
            refuse_sleep(arch=self.settings.arch, cohesion=self.material.cohesion)
        check_where(arch=self.settings.arch, threads=self.settings.threads)
        self.check_bed()

    @property
    def depth_expected(self) -> tuple[float, str]:
        """Depth for which the bed must be deep [m], and on what it is expected, in words."""
        return self.forecast.deepest, self.forecast.on

    def check_bed(self) -> None:
        """Raise ValueError for a bed too small for the forecast, or of too many or too large grains, or too soft."""
        s, spike = self.settings, self.spike_diameter
        self.check_extent()
        deepest, on = self.depth_expected
        if s.bed_size[2] < (least := deepest + 2 * spike):
            words = {"depth": s.bed_size[2], "on": on, "deepest": deepest, "least": math.ceil(1e3 * least) / 1e3}
            raise ValueError(say("too_shallow", **words))
        self.check_layout()
        if s.grain > spike:
            raise ValueError(say("larger_than_spike", grain=s.grain, spike=spike))
        count = self.grain_count()
        if count > MOST_GRAINS:
            larger = s.grain * (count / MOST_GRAINS) ** (1 / 3)
            raise ValueError(say("too_many_grains", grain=s.grain, count=count, larger=larger))
        check_young(s.young, chosen=self.softening(chosen=True).young, max_overlap=s.max_overlap)

    def grain_count(self) -> float:
        """About how many grains the whole bed will have."""
        s = self.settings
        return self.repeats * expected_grain_count(s.bed_size, s.grain, s.spread)

    def softening(self, *, chosen: bool = False) -> Softening:
        """The modulus of the grains for this run: the setting, unless `chosen`; otherwise that of `softening`."""
        s, forecast = self.settings, self.forecast
        return soften_material(
            self.material, young=None if chosen else s.young, max_overlap=s.max_overlap, grain=s.grain,
            spread=s.spread, gravity=self.first_gravity, bed_height=s.bed_size[2],
            depth=forecast.margin * forecast.deepest,
            speed=max(forecast.margin * forecast.fastest, self.lowering_speed or 0.0), pressure=self.pressure,
            fall=RAIN * s.bed_size[2], fastest="the fastest tip's speed",
            resistance=STICKING * resistance_of(self.material, s.grain),
        )  # fmt: skip

    def bed(self, softening: Softening, progress: Progress) -> Bed:
        """The bed, laid out for the run. Raises RuntimeError if it cannot be prepared."""
        try:
            return self.laid_out(self.prepare(softening, progress))
        except RuntimeError as error:
            raise failed_as(error, say("not_prepared", error=error)) from error

    def prepare(self, softening: Softening, progress: Progress) -> Bed:
        """The prepared bed, from the cache if it is there."""
        s, graded = self.settings, self.graded
        options: Json = {
            "size": s.bed_size, "grain": s.grain if graded is None else graded,
            "spread": s.spread if graded is None else None, "gravity": self.first_gravity, "seed": s.seed,
            "young": softening.young, "max_overlap": s.max_overlap, "arch": s.arch, "threads": s.threads,
            "cache": s.cache,
        }  # fmt: skip
        with held_back() as asked_to_stop:
            if self.stages is None:
                packing = None if graded is None else recipe_of(self.material).rained
                shown = BedProgress(progress, self.bed_stage, asked_to_stop, tapped=packing is not None)
                return Bed.prepare(self.material, packing=packing, **options, progress=shown)
            return staged_bed(self.material, self.stages, **options, progress=progress, asked_to_stop=asked_to_stop)

    def laid_out(self, bed: Bed) -> Bed:
        """All copies of the bed, in a box as high as its grains may be thrown or carried."""
        rise = self.forecast.rise
        carried = carried_height(self.material, reach=self.reach, rise=rise, grain=self.settings.grain)
        top = bed.surface + max(self.thrown(), carried)
        return bed.repeated(self.repeats, height=top) if self.repeats > 1 or top > bed.height else bed

    def ground(self, bed: Bed) -> BedGround:
        """The platform on the prepared bed; its grains are in LAMMPS if the settings say so."""
        s: Any = self.settings
        copies = self.copies
        options: Json = {
            "copies": copies, "touch": TOUCH * self.weight / copies, "friction": s.spike_friction,
            "restitution": s.spike_restitution, **self.layout(bed),
        }  # fmt: skip
        if s.ground != "lammps":
            return BedGround(bed, self.members(), **options)
        bed.overlap_limit = run_limit(s.max_overlap)
        return in_lammps(bed, self.members(), s, self.progress, free=self.turns_freely, kept=self.kept, **options)

    def stepper(self, bed: Bed) -> Run:
        """The run on the prepared bed, with its bound on overlaps and, with `sleep`, its rules of sleep."""
        s = self.settings
        ground = self.ground(bed)
        bed = ground.bed  # in LAMMPS another one than was prepared
        bed.max_overlap, bed.overlap_limit = 0.0, run_limit(s.max_overlap)
        bed.mark_origin()
        if s.sleep:
            bed.let_sleep(s.sleep_rules)
        return self.run_on(ground)

    def stepping(self) -> Mapping[str, Any]:
        """Options of stepping, as every stepper accepts them."""
        return {"duration": self.duration, "lowering_speed": self.lowering_speed, **self.settings.stepping()}

    @property
    def placement_time(self) -> float:
        """About how long the platform is placed, on the bed's clock [s]; 0 without a placement."""
        speed = self.lowering_speed
        return 0.0 if speed is None else pace_under(self.first_gravity) * REST_TIME + PLACING_WAY / speed

    @property
    def costs(self) -> dict[str, float]:
        """Stage -> about how long it is [s] of simulated time.

        Times of a preparation go with the root of 1 / g: dry rigid grains fall and come to rest in similar motions.
        """
        recipe = recipe_of(self.material)
        tapped = (self.graded is not None and recipe.rained is not None) if self.stages is None else any(
            "compact" in stage for stage in self.stages
        )  # fmt: skip
        prepared = preparation_time(self.settings.bed_size[2], self.first_gravity, tapped=tapped) / self.repeats
        return {self.bed_stage: prepared, self.stage: self.duration + self.placement_time}

    def time_step(self) -> float:
        """Of the grains [s]."""
        s = self.settings
        soft = self.material.softened(self.softening().young)
        return time_step_for(soft, diameter=s.grain * (1 - s.spread), max_overlap=s.max_overlap)

    @cached_property
    def pace(self) -> float | None:
        """Grain-steps a second that this machine made in earlier runs of about as many grains; None: not known."""
        s: Any = self.settings
        if s.ground == "lammps":
            return None
        threads = (s.threads or len(usable_cores())) if s.arch == "cpu" else 1  # as `dem.engine.runtime.start`
        runtime = runtime_name(arch=s.arch, threads=threads)
        return known_pace(runtime, grains=self.grain_count())

    @property
    def seconds_per_second(self) -> float | None:
        """What a second of simulated time takes with all grains awake [s]; None: not known."""
        return self.grain_count() / self.time_step() / self.pace if self.pace else None

    def carry_out(self, folder: RunFolder, progress: Progress) -> Result:
        """Prepare the bed and step the run in `folder`, from its checkpoint if there is one; returns the result."""
        self.announce(progress)
        if self.given_stages is None and self.stages is not None:
            progress.message(say("by_recipe", material=self.material, stages=" ".join(self.stages)))
        if self.plans:
            unit = None if self.settings.sleep else self.seconds_per_second
            progress.plan(self.costs, seconds={"report": self.report_seconds}, unit=unit)
        self.kept = folder.load_checkpoint(CHECKPOINT)
        return self.finish(self.stepper(self.bed(self.softening(), progress)), folder, progress)


class OnLoweredBed(PlatformOnBed[Settings, Run, Expected], Generic[Settings, Run, Expected]):
    """A run whose bed `settle_gravity` of its settings may prepare faster."""

    lowering_stage = "lower gravity"  # What the progress calls the rest in the gravity of the run

    @property
    def first_gravity(self) -> float:
        settings: Any = self.settings
        return settings.settle_gravity or self.grain_gravity

    @property
    def costs(self) -> dict[str, float]:
        """As of every bed, and the rest in the gravity of the run where the bed is prepared in more."""
        found = dict(super().costs)
        run = found.pop(self.stage)
        if self.first_gravity != self.grain_gravity:
            grain = self.settings.grain
            found[self.lowering_stage] = lowering_time(self.first_gravity, self.grain_gravity, grain=grain)
        return found | {self.stage: run}

    @property
    def minutes(self) -> dict[str, float]:
        """Stage -> about how long it takes [min], at this machine's pace, or `PACE` where that is not known."""
        count, step, pace = self.grain_count(), self.time_step(), self.pace or 1e6 * PACE
        return {name: count * time / step / (60 * pace) for name, time in self.costs.items()}

    def prepare(self, softening: Softening, progress: Progress) -> Bed:
        """The prepared bed in the gravity of the run.

        Rigid grains without cohesion pack alike in any gravity, and settle sqrt(g / g') times as fast in a larger one.
        """
        bed = super().prepare(softening, progress)
        if self.first_gravity != self.grain_gravity:
            unit = math.sqrt(self.settings.grain / self.first_gravity)
            with held_back() as asked_to_stop:
                shown = Stages(progress, asked_to_stop)
                shown.stage(self.lowering_stage, total=1.0)
                lower_gravity(bed, self.grain_gravity, unit=unit, progress=shown)
        return bed
