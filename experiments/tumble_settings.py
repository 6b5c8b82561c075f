"""Settings of `hedgebed tumble`: one trial of the platform, options by the names of the campaign format.

A number that is not given comes from `model` where there is one, else from the surface or from the defaults, which
`experiments.tumble_trial` holds and every run prints.
"""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from rigid.laws import GROUNDS

from .platform_settings import NotNegative, PlatformSettings, Positive
from .reading import nearest
from .sweep_ranges import parse_sweep
from .tumble_bed_settings import OF_THE_MASTER, TumbleBedSettings

__all__ = ["TrialSettings", "TumbleSettings"]

ON_GRAINS = 1.1
"""A tumble of the Hedgehog in the rig comes down on its next row by then; what lasts longer costs by the hour [s]."""


class TrialSettings(PlatformSettings):
    """What every trial of a platform on spikes shares: surface, platform, rig, terms."""

    # The surface
    surface: str | None = Field(
        None,
        description="Material: steel, brick, sand, sand-calibrated or jsc1a; of the model, else brick, if not given.",
    )
    ground: str = Field(
        "spring-damper",
        description="Law that computes the surface's force: spring-damper, hunt-crossley, power, katsuragi-durian, "
        "bekker or rft; for tumble also bed, a bed of grains.",
    )
    ground_parameters: tuple[str, ...] = Field(
        (), description="Parameters of another law than the spring-damper, of one spike, as name=value in SI."
    )

    # The rig
    rig_reading: Literal["pair", "weight"] = Field(
        "pair",
        description="What rig means: free-fall acceleration of platform and counterweight (pair), or the weight left "
        "per mass of the platform (weight).",
    )
    counterweight: Positive | None = Field(
        None, description="m_b of the rig [kg]; m (g - g_sim) / (g + g_sim) if not given; g_sim rules the weight."
    )

    # Beyond the base model
    model: str | None = Field(
        None, description="A model.toml: its tables stand under what is given here, its effects are added."
    )
    effects: tuple[str, ...] = Field(
        (),
        description="Terms beyond the base model, as id.parameter=value in SI (pendulum.length=2.2); `hedgebed "
        "effects` lists them.",
    )

    # How long
    torque_until: NotNegative | None = Field(None, description="End of the torque [s]; it does not end if not given.")
    duration: Positive = Field(
        3.0,
        le=3600,
        description=f"How long the trial lasts [s]; {ON_GRAINS:g} of a tumble on a bed in the rig, if not given.",
    )

    @model_validator(mode="after")
    def _surface_fits_together(self) -> Self:
        finding = self._ground()
        if finding:
            raise ValueError(finding)
        return self

    def _ground(self) -> str | None:
        if self.ground == "spring-damper":
            if self.ground_parameters:
                return (
                    f"ground_parameters = {' '.join(self.ground_parameters)} is for other laws: the spring-damper has "
                    f"stiffness and damping"
                )
            return None
        if self.ground == "bed":
            return "ground_parameters is given: a bed of grains has none" if self.ground_parameters else None
        for key in ("stiffness", "damping"):
            value = getattr(self, key)
            if value is not None:
                return (
                    f"{key} = {value:g} is the spring-damper's, of a row: with ground = {self.ground!r} say "
                    f"ground_parameters {key}=... of one spike"
                )
        return None


class TumbleSettings(TumbleBedSettings, TrialSettings):
    """One trial of a platform on spikes that a flywheel turns over: pivot, slip, hop."""

    # The gravity
    rig: Positive | None = Field(
        None, description="g_sim of the offloading rig [9.80665 m/s2]; 0.0085 if neither it nor gravity is given."
    )
    gravity: Positive | None = Field(None, description="Gravity of a free platform, without a rig [m/s2].")

    # What turns it
    torque: NotNegative | None = Field(
        None, description="Torque on the platform while a spike touches [N m]; 0.22 if not given."
    )
    actuator: Literal["motor", "brake"] = Field(
        "motor",
        description="What makes the torque: a motor that speeds the wheel up, or a brake that slows it to rest.",
    )
    wheel_speed_0: NotNegative | None = Field(
        None, description="Speed of the wheel at the start [rad/s]; 0 for a motor; a brake must be given one."
    )

    # Over a range
    sweep: tuple[str, ...] = Field(
        (),
        description="Do it over a range of one number, or of two: KEY=FROM:TO:STEP, such as mu_s=0.3:0.6:0.1 or "
        "pendulum.length=2:2.4:0.1.",
    )

    # How it is computed
    method: Literal["located", "paper", "coupled"] = Field(
        "located",
        description="Integrator: transitions located in time, the paper's fixed step of 1 ms, or the coupling's "
        "master, which steps the spring-damper as it does grains.",
    )
    sample_interval: float = Field(1e-3, gt=0, le=1e-3, description="Time between rows of trajectory.csv [s].")

    # Trials made up from it
    campaign: str | None = Field(
        None,
        min_length=1,
        description="Folder for made-up trials of this tumble, seen through noisy sensors, as a campaign; what is true "
        "of them, effects and all, stays in the run's folder (truth.toml).",
    )
    campaign_trials: int = Field(8, ge=1, le=999, description="Trials of the campaign [1].")
    campaign_seed: int = Field(1, ge=0, lt=2**31, description="Seed of what is true and of the noise.")
    campaign_noise: Positive = Field(1.0, description="Noise of the sensors over that of `hedgebed campaign` [1].")

    @model_validator(mode="before")
    @classmethod
    def _as_long_as_grains_allow(cls, given: Any) -> Any:
        others = ("duration", "gravity", "drop_speed")
        if not isinstance(given, dict) or given.get("ground") != "bed" or given.get("tumbles", 1) != 1:
            return given
        return given if any(given.get(key) is not None for key in others) else given | {"duration": ON_GRAINS}

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for finding in (self._known_ground(), self._sweep(), self._gravity(), self._actuation(), self._on_grains()):
            if finding:
                raise ValueError(finding)
        return self

    def _known_ground(self) -> str | None:
        grounds = [*GROUNDS, "bed"]
        if self.ground in grounds:
            return None
        known = nearest(self.ground, grounds)
        return f"ground = {self.ground!r} is no ground; {known}{'' if known.endswith('?') else ' (of grains)'}"

    def _sweep(self) -> str | None:
        for key in self._swept():
            in_effects = next((text.partition("=")[2] for text in self.effects if text.startswith(f"{key}=")), None)
            given = in_effects if "." in key else getattr(self, key)
            if given is not None:
                return f"{key} = {given} is given and swept: one of them would do"
        if self.sweep and self.campaign is not None:
            return f"campaign = {self.campaign!r} with a sweep: a campaign is of one tumble, so one of them would do"
        return None

    def _swept(self) -> list[str]:
        return [each.key for each in parse_sweep(self.sweep)]

    def _gravity(self) -> str | None:
        if self.rig is not None and self.gravity is not None:
            return (
                f"gravity = {self.gravity:g} m/s2 and rig = {self.rig:g} are both given: gravity is that of a free "
                f"platform, one of them would do"
            )
        if self.gravity is not None:
            for key, value, default in (
                ("counterweight", self.counterweight, None),
                ("rig_reading", self.rig_reading, "pair"),
            ):
                if value != default:
                    return f"{key} = {value} belongs to a rig, and gravity = {self.gravity:g} m/s2 is a free platform's"
        return None

    def _on_grains(self) -> str | None:
        given = self.bed_settings_given()
        if (self.ground == "bed" or self.method == "coupled") and (
            fault := self._row_or_landing() or self.stepping_fault()
        ):
            return fault
        if self.method == "coupled" and self.ground != "bed":
            given = [name for name in given if name not in OF_THE_MASTER]
            for key in ("effects", "sweep", "campaign"):
                if getattr(self, key):
                    return f"{key} is given with method = 'coupled': the master steps the base model alone, without it"
        if self.ground != "bed":
            if not given:
                return None
            of_both = " or method = 'coupled'" if given[0] in OF_THE_MASTER else ""
            return f"{given[0]} = {getattr(self, given[0])} belongs to ground = 'bed'{of_both}"
        if self.campaign is not None:
            return (
                f"campaign = {self.campaign!r} is given with ground = 'bed': `hedgebed campaign from-run` makes one of "
                f"finished runs, so without it"
            )
        for key in ("effects", "sweep", "model"):
            if getattr(self, key):
                return f"{key} is given with ground = 'bed': on grains there is the base model alone, without it"
        if fault := self.sleep_fault():
            return fault
        if self.settle_gravity is not None and (fault := self._settled_under()):
            return fault
        if self.method == "paper":
            return f"method = {self.method!r} is of the planar model: on grains there is the coupling's own step"
        return None

    def _settled_under(self) -> str | None:
        said = f"settle_gravity = {self.settle_gravity:g} m/s2"
        if self.gravity is None:
            return f"{said} is of flight: grains in a rig have their own 1 g; give gravity (in m/s2), or leave it out"
        assert self.settle_gravity is not None
        if self.settle_gravity < self.gravity:
            return f"{said} is below gravity = {self.gravity:g} m/s2: it is lowered to that, so more would do"
        if self.drop_speed is not None:
            return f"{said} with drop_speed: no hand sets a landing down, so without it"
        if self.sleep:
            return f"{said} with sleep: who sleeps would keep the springs of the larger gravity; without one of them"
        return None

    def _row_or_landing(self) -> str | None:
        if self.drop_speed is None:
            for key in ("drop_along", "drop_spin", "drop_theta"):
                if getattr(self, key):
                    return f"{key} = {getattr(self, key):g} is of a landing: give drop_speed (in m/s) as well"
        else:
            for key in ("torque", "torque_until", "wheel_speed_0"):
                if getattr(self, key):
                    return f"{key} = {getattr(self, key):g} with drop_speed: a landing has no torque, without it"
            if self.actuator == "brake" or self.tumbles > 1:
                return (
                    f"drop_speed = {self.drop_speed:g} m/s is a landing: without a brake, and without tumbles in a row"
                )
        if self.tumbles > 1 and self.torque_until is not None:
            return f"torque_until with tumbles = {self.tumbles}: tumble_turn says where each torque ends, so without it"
        if self.tumbles > 1 and self.actuator == "brake":
            return (
                f"actuator = 'brake' with tumbles = {self.tumbles}: it stops its wheel in the first; a motor would do"
            )
        return None

    def _actuation(self) -> str | None:
        if self.actuator == "brake" and not (self.wheel_speed_0 or 0.0) > 0 and "wheel_speed_0" not in self._swept():
            found = "is not given" if self.wheel_speed_0 is None else f"= {self.wheel_speed_0:g} rad/s"
            return (
                f"wheel_speed_0 {found}: a brake slows a wheel that turns, so the wheel's speed at the start must be "
                f"given in rad/s, such as 300"
            )
        return None
