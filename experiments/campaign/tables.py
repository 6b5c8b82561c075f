"""The tables of campaign.toml and model.toml, as frozen models with the format's own names.

The text of a field says its unit and is what an error quotes as expected. SI units. Which file says what, and what
rules where two could, is written down in docs/campaigns.md.
"""

import math
from collections.abc import Callable, Mapping, Sequence, Set
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from rigid.platform.rig import STANDARD_GRAVITY

__all__ = [
    "BASE_NOTE",
    "NOTE_WORDS",
    "OTHERS_NOTE",
    "RANGE_NOTE",
    "SCATTER_NOTE",
    "SURFACE",
    "SURFACE_NOTE",
    "FORMAT",
    "DepthSensor",
    "EffectTable",
    "ImuSensor",
    "PenetrationCampaign",
    "PEAKS_NOTE",
    "PenetrationModel",
    "PenetrationSensors",
    "PenetrationSurface",
    "PenetrationTrial",
    "PenetrationUncertainty",
    "PlatformTable",
    "PoseSensor",
    "RigTable",
    "SpikeTable",
    "Table",
    "TumbleCampaign",
    "TumbleModel",
    "TumbleSensors",
    "TumbleSurface",
    "TumbleTrial",
    "TumbleUncertainty",
    "WheelSensor",
    "WheelTable",
    "trial_faults",
]

FORMAT = "hedgehog-campaign/1"

BASE_NOTE = "fitted_without_effects"
"""Note of model.toml: K and C by diameter of the spring-damper that was fitted without the effects."""
RANGE_NOTE = "fitted_range"
"""A note of model.toml: the range of the trials that it was fitted to. `depth_m` and `speed_m_s` (slowest and fastest
loading) are those of the pushes. `withdrawal`: whether one of them was withdrawn. `frame_stiffness_N_m`: where the
bending of a frame was subtracted."""
ERRORS_NOTE = "fitted_errors"
"""A note of model.toml: `names` of the fitted numbers (``stiffness``, ``effect.parameter``), their standard errors
`std` and `correlation`, rows in the order of `names`; `undetermined`: names of those without a standard error;
`freedom`: name -> degrees of freedom of its standard error, of those that rest on the scatter of few beds."""
SURFACE = "surface_depth"
"""The fitted number of pushes and drops that is noted in `SURFACE_NOTE`."""
SURFACE_NOTE = "fitted_surface"
"""A note of model.toml: `depth_m`, how deep below the zero of the depth the bed begins to carry."""
SCATTER_NOTE = "fitted_scatter"
"""A note of model.toml of pushes: by what replicates differ beyond the sensors, standard deviations: `bed` relative, of
K and C, `bed damping` of C and `bed unloading` of the stiffness of the way back; channels and zeros in their unit.
`trials` and `freedom`: what it was found from. No note: the campaign does not show it."""
OTHERS_NOTE = "not_excluded"
"""A note of model.toml of pushes: `files` beside it, models of other forms that the trials do not exclude."""
PEAKS_NOTE = "measured_over_model"
"""A note of model.toml of pushes: the force where each was deepest, measured over modelled. `mean`, `std` and `trials`,
`lowest` and `highest`."""
NOTE_WORDS = {
    BASE_NOTE: "K [N/m] and C [N s/m] of the spring-damper alone, by diameter [m]",
    RANGE_NOTE: "the pushes that the model was fitted to",
    SURFACE_NOTE: "how deep below the zero of the depth the bed begins to carry: loose grains, errors of the touch",
    ERRORS_NOTE: "standard errors of the fitted numbers, in the order of `names`, and the correlations of each of "
    "these with all, a row for each",
    SCATTER_NOTE: "by what trials of one condition differ beyond the sensors, standard deviations: `bed` relative, of "
    "K and C, `bed damping` of C, `bed unloading` of the stiffness of the way back; others in their unit",
    PEAKS_NOTE: "force at the deepest reading of each push, measured over modelled",
    OTHERS_NOTE: "models of other forms that the trials do not exclude, beside this file: `penetrate --model` predicts "
    "with each",
}
"""What notes of model.toml mean, as comments above them."""

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Table(BaseModel):
    """A table of the format: closed, frozen, and true to kind (text is no number, 1 is not true)."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class EffectTable(Table):
    """A term beyond the base model, ``[[effect]]`` of model.toml."""

    id: str = Field(min_length=1, description="name of the effect")
    parameters: dict[str, Number] = Field(default_factory=dict, description="name = number")
    file: str | None = Field(None, description="path of a user's own term, relative to model.toml")


HEDGEHOG_ROWS = 8  # rows of spikes of a platform for which none are stated


class PlatformTable(Table):
    """``[platform]`` of tumbles."""

    mass: Positive = Field(description="kg")
    inertia: Positive = Field(description="kg m2, about the axis of rotation, without the wheel's own")
    spike_length: Positive = Field(description="m, centre to tip")
    spike_count: int | None = Field(None, ge=3, description="rows of spikes at equal angles; 8 if not given")

    @property
    def rows(self) -> int:
        """Rows of spikes; what a campaign does not say is the Hedgehog's."""
        return HEDGEHOG_ROWS if self.spike_count is None else self.spike_count


class WheelTable(Table):
    """``[wheel]``"""

    inertia: Positive = Field(description="kg m2")


class RigTable(Table):
    """``[rig]``; left out for a free platform."""

    counterweight: Positive | None = Field(None, description="kg, unless a trial has its own")
    wire_length: Positive | None = Field(None, description="m, information for the pendulum effect")
    gravity: Positive = Field(STANDARD_GRAVITY, description="m/s2, local")


class TumbleSurface(Table):
    """``[surface]`` of tumbles, K and C per row of spikes."""

    kind: str = Field(min_length=1, description="name of the material")
    granular: bool = Field(False, description="true or false")
    stiffness: Positive = Field(description="N/m, per row of spikes")
    damping: NotNegative = Field(description="N s/m, per row of spikes, while going in")
    mu_s: NotNegative = Field(description="coefficient of static friction")
    mu_d: NotNegative | None = Field(None, description="coefficient of sliding friction; half of mu_s if left out")

    @model_validator(mode="after")
    def _slides_easier(self) -> Self:
        if self.mu_d is not None and self.mu_d > self.mu_s:
            raise ValueError(f"mu_d = {self.mu_d:g} is above mu_s = {self.mu_s:g}: at most that was expected")
        return self

    @property
    def sliding_friction(self) -> float:
        """mu_d, half of mu_s where nothing else is measured [1]."""
        return 0.5 * self.mu_s if self.mu_d is None else self.mu_d


class TumbleUncertainty(Table):
    """``[uncertainty]`` of tumbles: one sigma, relative; what is not listed is exact."""

    mass: NotNegative = Field(0.0, description="one sigma, relative")
    inertia: NotNegative = Field(0.0, description="one sigma, relative")
    stiffness: NotNegative = Field(0.0, description="one sigma, relative")
    damping: NotNegative = Field(0.0, description="one sigma, relative")
    mu_s: NotNegative = Field(0.0, description="one sigma, relative")
    mu_d: NotNegative = Field(0.0, description="one sigma, relative")
    gravity_sim: NotNegative = Field(0.0, description="one sigma, relative, of each trial's simulated gravity")


class PoseSensor(Table):
    """``[sensors.pose]``"""

    std: tuple[NotNegative, NotNegative, NotNegative] = Field(description="three numbers, in m, m, rad")


class ImuSensor(Table):
    """``[sensors.imu]``"""

    std: tuple[NotNegative, NotNegative, NotNegative] = Field(description="three numbers, in rad/s, m/s2, m/s2")
    window: NotNegative = Field(0.0, description="s, each specific force is the mean over this window")


class WheelSensor(Table):
    """``[sensors.wheel]``"""

    std: tuple[NotNegative] = Field(description="one number in brackets, in rad/s")


class TumbleSensors(Table):
    """``[sensors]`` of tumbles."""

    pose: PoseSensor | None = Field(None, description="table with std")
    imu: ImuSensor | None = Field(None, description="table with std and window")
    wheel: WheelSensor | None = Field(None, description="table with std")


def _relative_path(value: str) -> str:
    if not value or value.startswith(("/", "\\")) or value[1:2] == ":":
        raise ValueError("a path relative to the campaign's folder was expected")
    return value


def _names_a_file(value: str) -> str:
    if "/" in value or "\\" in value or value in (".", "..") or not value.isprintable():
        raise ValueError("a name without / and \\ was expected: files are named after it")
    return value


FileName = Annotated[str, AfterValidator(_relative_path)]


class _Trial(Table):
    """What trials of both kinds share."""

    sensor_names: ClassVar[tuple[str, ...]]

    id: Annotated[str, Field(min_length=1), AfterValidator(_names_a_file)] = Field(description="text, each once")

    @property
    def files(self) -> dict[str, str]:
        """Sensor -> file, of the sensors that this trial has."""
        return {name: getattr(self, name) for name in self.sensor_names if getattr(self, name) is not None}


class TumbleTrial(_Trial):
    """``[[trial]]`` of tumbles."""

    sensor_names = ("pose", "imu", "wheel")

    gravity_sim: Positive = Field(description="m/s2")
    torque: NotNegative = Field(description="N m")
    actuator: Literal["motor", "brake"] = Field(description="'motor' or 'brake'")
    torque_until: Annotated[float, Field(ge=0)] = Field(math.inf, description="s")
    wheel_speed_0: NotNegative = Field(0.0, description="rad/s, 0 or more")
    counterweight: Positive | None = Field(None, description="kg, where it differs from [rig]")
    pose: FileName | None = Field(None, description="file with t_s,x_m,y_m,theta_rad")
    imu: FileName | None = Field(None, description="file with t_s,gyro_rad_s,ax_m_s2,ay_m_s2")
    wheel: FileName | None = Field(None, description="file with t_s,omega_rad_s")

    @model_validator(mode="after")
    def _can_brake(self) -> Self:
        if self.actuator == "brake" and self.wheel_speed_0 == 0:
            raise ValueError("wheel_speed_0 = 0 leaves nothing to brake: the wheel's speed in rad/s was expected")
        return self

    def columns(self, sensor: str) -> tuple[tuple[str, str], ...]:
        """What the file of a sensor must hold: (quantity, unit), the time first."""
        return {
            "pose": (("t", "s"), ("x", "m"), ("y", "m"), ("theta", "rad")),
            "imu": (("t", "s"), ("gyro", "rad_s"), ("ax", "m_s2"), ("ay", "m_s2")),
            "wheel": (("t", "s"), ("omega", "rad_s")),
        }[sensor]

    @property
    def needed(self) -> dict[str, str]:
        """Key of ``[sensors]`` whose noise the files ask for -> the key of the trial that asks."""
        return {name: name for name in self.files}


def _check_trials(tables: Any) -> Any:
    """Raise ValueError for the trials that do not fit the tables of their campaign."""
    sensors = {name for name, sensor in tables.sensors if sensor is not None}
    faults = trial_faults(list(enumerate(tables.trial, 1)), sensors, tables._odd_trial)
    if faults:
        raise ValueError("\n".join(faults))
    return tables


def trial_faults(
    trials: Sequence[tuple[int, Any]], sensors: Set[str], odd: Callable[[Any], str | None] = lambda trial: None
) -> list[str]:
    """What is wrong with trials (number in the file, trial): an id twice, no file, a sensor without its noise.
    `sensors`: those that [sensors] has; `odd` states what else is wrong with a trial, None where nothing is."""
    seen: dict[str, int] = {}
    without: dict[tuple[str, str], list[tuple[int, str]]] = {}
    faults = []
    for number, trial in trials:
        where = f"[[trial]] {number} (id {trial.id!r}): "
        first = seen.setdefault(trial.id, number)
        if first != number:
            faults.append(f"{where}id = {trial.id!r} is that of [[trial]] {first} too: each id once was expected")
        if not trial.files:
            faults.append(f"{where}it names no file: at least one of {', '.join(trial.sensor_names)} was expected")
        for sensor, key in trial.needed.items():
            if sensor not in sensors:
                without.setdefault((sensor, key), []).append((number, trial.id))
        if fault := odd(trial):
            faults.append(where + fault)
    return faults + [_without_noise(sensor, key, found) for (sensor, key), found in without.items()]


def _without_noise(sensor: str, key: str, trials: Sequence[tuple[int, str]]) -> str:
    """That trials (number in the file, id) name a file of a sensor without a stated noise, once for all of them."""
    (number, id), *others = trials
    where = f"[[trial]] {number} (id {id!r})" + (f" and {len(others)} more [[trial]]" if others else "")
    return (
        f"{where}: {key} is given, but [sensors.{sensor}] is missing: its std was expected; if it is not known, give "
        f"the scatter of readings at rest, or the step of the display divided by 3.5"
    )


class _Tables(Table):
    """What campaign.toml and model.toml share."""

    format: Literal["hedgehog-campaign/1"] = Field(description=repr(FORMAT))
    name: str = Field(description="text")
    notes: Mapping[str, Any] = Field(default_factory=dict, description="anything")


class _TumbleTables(_Tables):
    kind: Literal["tumble"] = Field(description="'tumble' or 'penetration'")
    platform: PlatformTable = Field(description="table with mass, inertia, spike_length and, if not 8, spike_count")
    wheel: WheelTable = Field(description="table with inertia")
    rig: RigTable | None = Field(None, description="table with counterweight, wire_length and gravity")
    surface: TumbleSurface = Field(description="table with kind, stiffness, damping, mu_s and mu_d")
    uncertainty: TumbleUncertainty = Field(default_factory=TumbleUncertainty, description="table")
    sensors: TumbleSensors = Field(default_factory=TumbleSensors, description="table")

    def counterweight_of(self, trial: TumbleTrial) -> float:
        """The counterweight of a trial [kg]: its own, else the rig's; 0 without a rig."""
        if self.rig is None:
            return 0.0
        own = trial.counterweight if trial.counterweight is not None else self.rig.counterweight
        return 0.0 if own is None else own

    def weight_of(self, trial: TumbleTrial) -> float:
        """What stands on the surface [N]: of platform and counterweight, under the simulated gravity."""
        return (self.platform.mass + self.counterweight_of(trial)) * trial.gravity_sim

    def local_gravity_of(self, trial: TumbleTrial) -> float:
        """The true gravity where a trial was made [m/s2]: the rig's, or without one the simulated one."""
        return trial.gravity_sim if self.rig is None else self.rig.gravity

    def _odd_trial(self, trial: TumbleTrial) -> str | None:
        """What of a trial does not fit the tables; None if all does."""
        if self.rig is None and trial.counterweight is not None:
            return f"counterweight = {trial.counterweight:g} without a [rig]: none, or that table, was expected"
        if self.rig is not None:
            m_b = self.counterweight_of(trial)
            if m_b == 0:
                return "counterweight is given neither here nor in [rig]: kg was expected, or no [rig]"
            if m_b >= self.platform.mass:
                return (
                    f"counterweight = {m_b:g} is not below [platform] mass = {self.platform.mass:g}: the rig would "
                    f"lift the platform, less was expected"
                )
            if trial.gravity_sim >= self.rig.gravity:
                return (
                    f"gravity_sim = {trial.gravity_sim:g} is not below [rig] gravity = {self.rig.gravity:g}: less was "
                    f"expected, or no [rig]"
                )
        return None


class TumbleCampaign(_TumbleTables):
    """campaign.toml of tumbles."""

    trial: tuple[TumbleTrial, ...] = Field(min_length=1, description="at least one [[trial]]")

    @model_validator(mode="after")
    def _body_fits(self) -> Self:
        body, wheel = self.platform, self.wheel.inertia
        most = body.mass * body.spike_length**2
        if body.inertia > most:
            raise ValueError(
                f"[platform] inertia = {body.inertia:g} is above mass spike_length^2 = {most:g}, what a body has at "
                f"most: up to that was expected (kg m2)"
            )
        if wheel >= body.inertia:
            raise ValueError(
                f"[wheel] inertia = {wheel:g} is not below [platform] inertia = {body.inertia:g}, that of body and "
                f"wheels together: less was expected (kg m2)"
            )
        return self

    _trials_fit = model_validator(mode="after")(_check_trials)


class TumbleModel(_TumbleTables):
    """model.toml of tumbles: fitted values, and the terms that were added."""

    trial: tuple[TumbleTrial, ...] = Field((), description="[[trial]]")
    effect: tuple[EffectTable, ...] = Field((), description="[[effect]]")


class SpikeTable(Table):
    """``[spike]``"""

    mass: Positive | None = Field(None, description="kg, what falls in a drop")
    diameter: Positive | None = Field(None, description="m, unless each trial has its own")
    tip: Literal["sphere", "cone", "flat"] = Field("sphere", description="'sphere', 'cone' or 'flat'")
    cone_angle: float | None = Field(None, gt=0, lt=180, description="degrees, full, for a cone")

    @model_validator(mode="after")
    def _cone_has_an_angle(self) -> Self:
        if self.tip == "cone" and self.cone_angle is None:
            raise ValueError("cone_angle is missing: a cone's full angle in degrees was expected")
        return self


class PenetrationSurface(Table):
    """``[surface]`` of penetration."""

    kind: str = Field(min_length=1, description="name of the material")
    granular: bool = Field(True, description="true or false")
    stiffness: NotNegative = Field(description="N/m, the model's K")
    damping: NotNegative = Field(description="N s/m, the model's C")


class PenetrationUncertainty(Table):
    """``[uncertainty]`` of penetration: one sigma, relative; 1 or more is not known beforehand."""

    stiffness: NotNegative = Field(0.0, description="one sigma, relative")
    damping: NotNegative = Field(0.0, description="one sigma, relative")


class DepthSensor(Table):
    """``[sensors.depth]``, ``[sensors.force]`` and ``[sensors.accel]``"""

    std: tuple[NotNegative] = Field(description="one number in brackets, in m, N or m/s2")


class PenetrationSensors(Table):
    """``[sensors]`` of penetration."""

    depth: DepthSensor | None = Field(None, description="table with std in m")
    force: DepthSensor | None = Field(None, description="table with std in N")
    accel: DepthSensor | None = Field(None, description="table with std in m/s2")


class PenetrationTrial(_Trial):
    """``[[trial]]`` of penetration."""

    sensor_names = ("data",)

    mode: Literal["driven", "drop"] = Field(description="'driven' or 'drop'")
    gravity: Positive = Field(STANDARD_GRAVITY, description="m/s2")
    grain_gravity: Positive | None = Field(None, description="m/s2, the grains' own where it differs")
    speed: NotNegative | None = Field(None, description="m/s, driven: nominal; drop: at the surface")
    diameter: Positive | None = Field(None, description="m, where it differs from [spike]")
    data: FileName = Field(description="file with t_s,depth_m,force_N (driven) or t_s,depth_m,accel_m_s2 (drop)")

    @model_validator(mode="after")
    def _drop_has_a_speed(self) -> Self:
        if self.mode == "drop" and self.speed is None:
            raise ValueError("speed is missing: a drop's speed at the surface in m/s was expected")
        return self

    def columns(self, sensor: str) -> tuple[tuple[str, str], ...]:
        """What the file must hold: (quantity, unit), the time first."""
        third = ("force", "N") if self.mode == "driven" else ("accel", "m_s2")
        return (("t", "s"), ("depth", "m"), third)

    @property
    def needed(self) -> dict[str, str]:
        """Key of ``[sensors]`` whose noise the file asks for -> the key of the trial that asks."""
        return dict.fromkeys(("depth", "force" if self.mode == "driven" else "accel"), "data")


class _PenetrationTables(_Tables):
    kind: Literal["penetration"] = Field(description="'tumble' or 'penetration'")
    spike: SpikeTable = Field(description="table with mass, diameter and tip")
    surface: PenetrationSurface = Field(description="table with kind, stiffness and damping")
    uncertainty: PenetrationUncertainty = Field(default_factory=PenetrationUncertainty, description="table")
    sensors: PenetrationSensors = Field(default_factory=PenetrationSensors, description="table")

    def diameter_of(self, trial: PenetrationTrial) -> float:
        """The diameter in a trial [m]: its own, else the spike's. Raises ValueError where there is none."""
        found = trial.diameter if trial.diameter is not None else self.spike.diameter
        if found is None:
            raise ValueError("diameter is given neither here nor in [spike]: m was expected")
        return found

    def _odd_trial(self, trial: PenetrationTrial) -> str | None:
        """What of a trial does not fit the tables; None if all does."""
        if trial.diameter is None and self.spike.diameter is None:
            return "diameter is given neither here nor in [spike]: m was expected"
        if trial.mode == "drop" and self.spike.mass is None:
            return "mode = 'drop' needs [spike] mass, which is missing: kg was expected"
        return None


class PenetrationCampaign(_PenetrationTables):
    """campaign.toml of penetration."""

    trial: tuple[PenetrationTrial, ...] = Field(min_length=1, description="at least one [[trial]]")

    _trials_fit = model_validator(mode="after")(_check_trials)


class PenetrationModel(_PenetrationTables):
    """model.toml of penetration."""

    trial: tuple[PenetrationTrial, ...] = Field((), description="[[trial]]")
    effect: tuple[EffectTable, ...] = Field((), description="[[effect]]")
