"""Settings of `hedgebed tumble`: one trial of the platform, options by the names of the campaign format.

A number that is not given comes from `model` if there is one. Otherwise it comes from the surface or from the defaults
in `experiments.tumble.trial`, which every run prints.
"""

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from experiments.grains.lammps import ON_GRAINS as GRAINS
from experiments.grains.lammps import lammps_fault
from experiments.grains.settings import OF_THE_MASTER, TumbleBedSettings
from experiments.platform.settings import (
    BRAKE_TIME,
    Assignments,
    NotNegative,
    PlatformSettings,
    Positive,
    brake_time_fault,
)
from rigid.checks import nearest
from rigid.ground.laws import GROUNDS
from rigid.ground_file import is_ground_file
from rigid.terms import EFFECTS
from vis.page.sentences import Sentences

from .sweep_ranges import parse_sweep

__all__ = ["TrialSettings", "TumbleSettings"]

say = Sentences(__package__)

ON_GRAINS = 1.1
"""A tumble of the Hedgehog in the rig comes down on its next row by then; what lasts longer costs by the hour [s]."""


class TrialSettings(PlatformSettings):
    """What every trial of a platform on spikes shares: surface, platform, rig, terms."""

    # The surface
    surface: str | None = None
    """Surface: steel, brick, sand, sand-weak, jsc1a or jsc1a-heights; if not given, that of the model, else brick."""
    ground: str = Field(
        "spring-damper",
        description="Law of the force of the ground: "
        f"{' or '.join(', '.join(GROUNDS).rsplit(', ', 1))}, or a ground.toml of one spike; for tumble also bed (of "
        "grains) or lammps (a bed whose grains are in LAMMPS).",
    )
    ground_parameters: Assignments = ()
    """Parameters of a law other than the spring-damper, for one spike, as name=value in SI units."""

    # The rig
    rig_reading: Literal["pair", "weight"] = "pair"
    """Meaning of rig: free-fall acceleration of platform and counterweight (pair), or remaining weight over mass of the
    platform (weight)."""
    counterweight: Positive | None = None
    """Counterweight m_b of the rig [kg]; m (g - g_sim) / (g + g_sim) if not given. The weight always follows g_sim."""

    # Beyond the base model
    model: str | None = None
    """A model.toml: it gives the numbers that are not given here, and its effects are added."""
    effects: tuple[str, ...] = ()
    """Effects added to the base model, as id.parameter=value in SI units (pendulum.length=2.2); `hedgebed effects`
    lists them."""

    # How long
    torque_until: NotNegative | None = Field(
        None, description="Time at which the torque ends [s]; no end if not given."
    )
    duration: Positive = Field(
        3.0,
        le=3600,
        description=f"Duration of the trial [s]; if not given, {ON_GRAINS:g} for a tumble on a bed in the rig.",
    )

    @model_validator(mode="after")
    def _surface_fits_together(self) -> Self:
        finding = self._ground()
        if finding:
            raise ValueError(finding)
        return self

    @property
    def on_grains(self) -> bool:
        """Whether the ground is made of grains."""
        return self.ground in GRAINS

    def _ground(self) -> str | None:
        if self.ground == "spring-damper":
            given = " ".join(self.ground_parameters)
            return say("parameters_of_other_laws", given=given) if given else None
        if self.on_grains:
            return say("parameters_of_a_bed") if self.ground_parameters else None
        if is_ground_file(self.ground) and self.ground_parameters:
            return say("parameters_of_a_file", s=self, given=" ".join(self.ground_parameters))
        for key, value in (("stiffness", self.stiffness), ("damping", self.damping)):
            if value is not None:
                return say("of_the_spring_damper", key=key, value=value, s=self)
        return None


class TumbleSettings(TumbleBedSettings, TrialSettings):
    """One trial of a platform on spikes that a flywheel turns over: pivot, slip, hop."""

    # The gravity
    rig: Positive | None = None
    """Simulated gravity g_sim of the offloading rig, in g [9.80665 m/s2]; 0.0085 if neither rig nor gravity is
    given."""
    gravity: Positive | None = Field(None, description="Gravity of a free platform, without a rig [m/s2].")

    # What turns it
    torque: NotNegative | None = None
    """Torque on the platform while a spike is in contact [N m]; 0.22 if not given."""
    actuator: Literal["motor", "brake"] = "motor"
    """Source of the torque: a motor that accelerates the wheel, or a brake that stops it."""
    brake_time: Positive | None = Field(None, description=BRAKE_TIME)
    wheel_speed_0: NotNegative | None = None
    """Initial speed of the wheel [rad/s]; 0 for a motor if not given; a brake needs one."""

    # Over a range
    sweep: tuple[str, ...] = ()
    """Repeat the trial over a range of one or two numbers: KEY=FROM:TO:STEP, such as mu_s=0.3:0.6:0.1 or
    pendulum.length=2:2.4:0.1."""

    # How it is computed
    method: Literal["located", "paper", "coupled"] = "located"
    """Integrator: contact transitions located in time; the fixed step of 1 ms of the paper; or the coupling that grains
    use."""
    sample_interval: float = Field(1e-3, gt=0, le=1e-3, description="Time between two rows of trajectory.csv [s].")

    # Trials made up from it
    campaign: str | None = Field(None, min_length=1)
    """Folder for simulated trials of this tumble with sensor noise, as a campaign. The true numbers and effects are
    written to truth.toml in the folder of the run."""
    campaign_trials: int = Field(8, ge=1, le=999, description="Campaign: number of trials [1].")
    campaign_seed: int = Field(1, ge=0, lt=2**31, description="Campaign: seed of true numbers and noise.")
    campaign_noise: Positive = Field(
        1.0, description="Campaign: noise of the sensors, relative to that of `hedgebed campaign` [1]."
    )

    @model_validator(mode="before")
    @classmethod
    def _as_long_as_grains_allow(cls, given: Any) -> Any:
        others = ("duration", "gravity", "drop_speed")
        if not isinstance(given, dict) or given.get("ground") not in GRAINS or given.get("tumbles", 1) != 1:
            return given
        return given if any(given.get(key) is not None for key in others) else given | {"duration": ON_GRAINS}

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for finding in (self._known_ground(), self._sweep(), self._gravity(), self._actuation(), self._on_grains()):
            if finding:
                raise ValueError(finding)
        return self

    def _known_ground(self) -> str | None:
        grounds = [*GROUNDS, *GRAINS]
        if self.ground in grounds or is_ground_file(self.ground):
            return None
        known = nearest(self.ground, grounds)
        return say("no_ground", s=self, known=known + ("" if known.endswith("?") else " (of grains)"))

    def _sweep(self) -> str | None:
        for key in self._swept():
            in_effects = next((text.partition("=")[2] for text in self.effects if text.startswith(f"{key}=")), None)
            given = in_effects if "." in key else getattr(self, key)
            if given is not None:
                return say("given_and_swept", key=key, given=given)
        return say("campaign_and_sweep", s=self) if self.sweep and self.campaign is not None else None

    def _swept(self) -> list[str]:
        return [each.key for each in parse_sweep(self.sweep)]

    def _gravity(self) -> str | None:
        if self.gravity is None:
            return None
        if self.rig is not None:
            return say("gravity_and_rig", s=self)
        if self.counterweight is not None:
            return say("of_a_rig", key="counterweight", value=self.counterweight, s=self)
        return (
            say("of_a_rig", key="rig_reading", value=self.rig_reading, s=self) if self.rig_reading != "pair" else None
        )

    def _on_grains(self) -> str | None:
        given, on_bed, coupled = self.bed_settings_given(), self.on_grains, self.method == "coupled"
        if (on_bed or coupled) and (fault := self._row_or_landing() or self.stepping_fault()):
            return fault
        if coupled and not on_bed:
            given = [name for name in given if name not in OF_THE_MASTER]
            if key := self._beyond_the_torque() or self._first_given("sweep", "campaign"):
                return say("not_coupled", key=key)
        if not on_bed:
            given = [name for name in given if name != "threads"]  # of no effect, and said to be so
            if not given:
                return None
            both = " or method = 'coupled'" if given[0] in OF_THE_MASTER else ""
            return say("of_a_bed", key=given[0], value=getattr(self, given[0]), both=both)
        if self.campaign is not None:
            return say("campaign_on_bed", s=self)
        if key := self._beyond_the_torque() or self._first_given("sweep", "model"):
            return say("not_on_bed", key=key)
        if fault := self.sleep_fault() or self._settled_under() or lammps_fault(self):
            return fault
        return say("method_on_bed", s=self) if self.method == "paper" else None

    def _beyond_the_torque(self) -> str | None:
        """The first effect that is not possible on grains and with the master."""
        ids = [text.partition("=")[0].partition(".")[0].strip() for text in self.effects]
        return next((f"effects = {id}" for id in ids if id not in EFFECTS or not EFFECTS[id].on_torque_alone), None)

    def _first_given(self, *keys: str) -> str | None:
        return next((key for key in keys if getattr(self, key)), None)

    def _settled_under(self) -> str | None:
        """Message if another gravity for settling is not possible; else None."""
        if self.settle_gravity is None:
            return None
        said = say("settle_gravity", s=self)
        if self.gravity is None:
            return said + say("settle_in_rig")
        if self.settle_gravity < self.gravity:
            return said + say("settle_below", s=self)
        if self.drop_speed is not None:
            return said + say("settle_landing")
        return said + say("settle_sleep") if self.sleep else None

    def _row_or_landing(self) -> str | None:
        if self.drop_speed is None:
            if key := self._first_given("drop_along", "drop_spin", "drop_theta"):
                return say("of_a_landing", key=key, value=getattr(self, key))
        else:
            if key := self._first_given("torque", "torque_until", "wheel_speed_0"):
                return say("not_of_a_landing", key=key, value=getattr(self, key))
            if self.actuator == "brake" or self.tumbles > 1:
                return say("a_landing", s=self)
        if self.tumbles > 1 and self.torque_until is not None:
            return say("torque_until_in_a_row", s=self)
        return say("brake_in_a_row", s=self) if self.tumbles > 1 and self.actuator == "brake" else None

    def _actuation(self) -> str | None:
        if fault := brake_time_fault(self.brake_time, self.torque, self.actuator):
            return fault
        if self.actuator != "brake" or (self.wheel_speed_0 or 0.0) > 0 or "wheel_speed_0" in self._swept():
            return None
        found = "is not given" if self.wheel_speed_0 is None else f"= {self.wheel_speed_0:g} rad/s"
        return say("brake_without_speed", found=found)
