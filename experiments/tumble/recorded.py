"""Finished tumbles as a campaign of measured trials: simulated recordings of camera, IMU and wheel.

Each run folder is a trial; runs of one condition on beds of other seeds are its replicates. The campaign states what a
laboratory knows: the platform, the rig, and a surface of K and C per row. These are fitted to the same bed if a run of
penetrate is named (`fitted`, twice a spike's), else those of the run. No file has true numbers, because the ground is
grains. The start is that of the run: on grains theta and x are near 0 at t = 0, not exactly 0.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from experiments.campaign import Campaign, Recording, TumbleCampaign, write_campaign
from experiments.campaign.files import check_target
from experiments.campaign.tables import RigTable, TumbleUncertainty
from experiments.runs.folder import RunFolder, read_series
from experiments.runs.kept_results import PATH_AND_MOTION, require_files
from experiments.runs.strict import StrictSettings
from experiments.runs.version import __version__
from hedgebed_renamed import material_of_today
from rigid.sensors import Measured, Motion, SensorSet, measure, sensor_times

from . import say
from .campaign_settings import CampaignSettings
from .synthesis import sensor_set, shared_tables, trial_table

__all__ = ["TumbleRecording", "campaign_of_tumbles", "write_tumbles_campaign"]

SPIKES_PER_ROW = 2.0
SHARED = ("mass", "inertia", "spike_length", "wheel_inertia", "stiffness", "damping", "mu_s", "mu_d", "gravity")
"""Numbers that all trials of a campaign have in common."""
FEWEST = 0.1  # A shorter run has too few rows of the camera to be diagnosed [s]


class TumbleRecording(StrictSettings):
    """Further runs and noise of a campaign made of tumbles."""

    also: tuple[str, ...] = Field((), description="Tumbles: folders of further runs; each becomes a trial.")
    fitted: str | None = None
    """Tumbles: folder of a penetrate run in the same grains, whose K and C are stated in the campaign."""
    noise: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0
    """Tumbles: noise of the sensors, relative to that of `hedgebed campaign` [1]."""


def write_tumbles_campaign(
    run: str | Path, target: str | Path, *, recording: TumbleRecording | None = None, seed: int = 1
) -> Campaign:
    """Write the tumble in the folder `run`, and those of ``recording.also``, as a campaign into `target`.

    Raises ValueError as `campaign_of_tumbles` and `check_target` do.
    """
    check_target(target)
    campaign = campaign_of_tumbles(run, recording=recording, seed=seed)
    write_campaign(target, campaign)
    return campaign


def campaign_of_tumbles(run: str | Path, *, recording: TumbleRecording | None = None, seed: int = 1) -> Campaign:
    """The finished tumble in the folder `run`, with those of ``recording.also``, as a campaign; `seed` fixes the noise.

    Raises ValueError, naming the folder and what is accepted, for runs that are unfinished, too short or of another
    experiment. The platform, rig and surface must be those of the first run.
    """
    recording = recording if recording is not None else TumbleRecording()
    first, *others = tumbles = [_Tumble(Path(folder)) for folder in (run, *recording.also)]
    for tumble in others:
        tumble.check_alike(first)
    plain = CampaignSettings()
    sensors = sensor_set(plain, noise=recording.noise)
    recordings: dict[tuple[str, str], Recording] = {}
    trials = []
    for number, tumble in enumerate(tumbles, 1):
        name = f"{number:03d}"
        trials.append(trial_table(name, tumble.numbers, tumble.result["actuator"]))
        measured = tumble.record(sensors, seed=(seed, number))
        for sensor in ("pose", "imu", "wheel"):
            recordings[name, sensor] = Recording(getattr(measured, sensor))
    stiffness, damping, sigmas, said = _law(first.result, recording.fitted)
    result, trial, ground = first.result, first.numbers, first.ground
    tables = TumbleCampaign(
        **shared_tables(
            f"tumbles on {ground}", trial | {"stiffness": stiffness, "damping": damping}, sensors,
            spike_count=int(result["spike_count"]), kind=str(result["surface"]), granular=result["ground"] == "bed",
            rig=RigTable(gravity=trial["gravity"]) if trial["counterweight"] > 0 else None,
        ),
        uncertainty=TumbleUncertainty(
            mass=plain.sigma_mass, inertia=plain.sigma_inertia, mu_s=plain.sigma_mu_s, mu_d=plain.sigma_mu_d,
            gravity_sim=plain.sigma_gravity_sim, **sigmas,
        ),
        notes={
            "made_by": f"hedgebed {__version__} tumble on {ground}", "stiffness_and_damping": said,
            "code": str(result.get("code", "")), "noise_seed": seed,
            "grain_seeds": [tumble.result.get("grains", {}).get("seed", "none") for tumble in tumbles],
        },
        trial=tuple(trials),
    )  # fmt: skip
    return Campaign(tables, recordings)


class _Tumble:
    """A finished tumble in its folder. Raises ValueError, naming the folder, for other runs and runs with effects."""

    def __init__(self, folder: Path) -> None:
        kept = RunFolder.open(folder)
        if kept.command != "tumble":
            raise ValueError(say("no_tumble", folder=str(folder), command=kept.command))
        if not (folder / "result.json").exists():
            raise ValueError(say("no_result", folder=str(folder)))
        require_files(kept, PATH_AND_MOTION, key="run")
        self.folder, self.result = folder, kept.read_result()
        if self.result["effects"]:
            named = ", ".join(effect["id"] for effect in self.result["effects"])
            raise ValueError(say("has_effects", folder=str(folder), named=named))
        self.numbers: dict[str, float] = {name: entry["value"] for name, entry in self.result["trial"].items()}
        ends = (self.numbers.get("torque_until"), self.result.get("wheel_at_limit"))
        self.numbers["torque_until"] = min((end for end in ends if end is not None), default=math.inf)

    @property
    def ground(self) -> str:
        """The ground, as text."""
        named = str(self.result["surface"])
        return f"a bed of {named}" if self.result["ground"] == "bed" else f"the {self.result['ground']} of {named}"

    def check_alike(self, first: "_Tumble") -> None:
        """Raise ValueError if platform, rig or surface differ from those of the first."""
        pairs: dict[str, tuple[Any, Any]] = {name: (first.numbers.get(name), self.numbers.get(name)) for name in SHARED}
        pairs |= {name: (first.result[name], self.result[name]) for name in ("surface", "ground", "spike_count")}
        for name, (before, now) in pairs.items():
            if before != now:
                folders = {"folder": str(self.folder), "first": str(first.folder)}
                raise ValueError(say("not_alike", **folders, name=name, now=now, before=before))

    def record(self, sensors: SensorSet, *, seed: tuple[int, ...]) -> Measured:
        """Simulated readings of its series, interpolated linearly between rows at most a millisecond apart."""
        series = read_series(self.folder / "trajectory.csv")
        motion = read_series(self.folder / "series" / "motion.csv")
        time = series["t_s"]
        if time[-1] < FEWEST:
            raise ValueError(say("too_brief", folder=str(self.folder), lasts=time[-1], least=FEWEST))
        at = sensor_times(sensors, float(time[-1]))

        def at_times(values: np.ndarray) -> np.ndarray:
            return np.interp(at, time, values)

        moved = Motion(
            time=at, x=at_times(series["x_m"] - series["x_m"][0]), y=at_times(series["y_m"]),
            theta=at_times(series["theta_rad"]), vx=at_times(series["vx_m_s"]), vy=at_times(series["vy_m_s"]),
            omega=at_times(series["omega_rad_s"]),
            wheel_speed=np.interp(at, motion["t_s"], motion["wheel_speed_rad_s"]),
        )  # fmt: skip
        local = self.numbers["gravity"] if self.numbers["counterweight"] > 0 else self.numbers["gravity_sim"]
        return measure(moved, sensors, gravity_local=local, seed=seed)


def _law(first: Mapping[str, Any], fitted: str | None) -> tuple[float, float, dict[str, float], str]:
    """K and C of a row, their relative uncertainties, and where they come from."""
    if fitted is None:
        trial, plain = first["trial"], CampaignSettings()
        values = [float(trial[name]["value"]) for name in ("stiffness", "damping")]
        sigmas = {"stiffness": plain.sigma_stiffness, "damping": plain.sigma_damping}
        return values[0], values[1], sigmas, f"of the run: {trial['stiffness']['origin']}"
    folder = RunFolder.open(Path(fitted))
    if folder.command != "penetrate" or not (folder.path / "result.json").exists():
        raise ValueError(f"fitted = {fitted!r} is no finished run of penetrate")
    if (material := material_of_today(str(folder.settings.get("material")))) != first["surface"]:
        raise ValueError(say("other_grains", fitted=fitted, material=material, surface=first["surface"]))
    result = folder.read_result()
    if result.get("status") == "stopped":  # of the beds that were whole when it was stopped
        raise ValueError(f"fitted = {fitted!r} is no finished run of penetrate")
    quantities = result["quantities"]
    values, sigmas = [], {}
    for name in ("stiffness", "damping"):
        value = float(quantities[name]["value"])
        error = float(quantities.get(f"{name}_error", {}).get("value") or 0.0)
        spread = float(quantities[name].get("std") or 0.0)
        values.append(SPIKES_PER_ROW * value)
        sigmas[name] = math.hypot(error, spread) / abs(value) if value else 1.0
    return values[0], values[1], sigmas, f"fitted to drives of one spike, twice: {folder.path.name}"
