"""Finished tumbles as a campaign of measured trials: what camera, IMU and wheel would have recorded of them.

Each run folder is a trial; runs of one condition on beds of other seeds are its replicates. What is stated is what a
laboratory would know: the platform, the rig, and a surface of K and C per row, fitted to the same bed where a run of
penetrate is named (`fitted`, twice a spike's), else as the run has them. What is true is grains: nothing stands beside
it. The start is the run's own: on grains theta and x are near 0 at t = 0, not exactly 0.
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
from experiments.runs.types import Json
from experiments.runs.version import __version__
from rigid.sensors import Motion, SensorSet, measure, sensor_times

from . import say
from .campaign_settings import CampaignSettings
from .campaign_tables import sensor_set, shared_tables, trial_table

__all__ = ["TumbleRecording", "campaign_of_tumbles", "write_tumbles_campaign"]

SPIKES_PER_ROW = 2.0
SHARED = ("mass", "inertia", "spike_length", "wheel_inertia", "stiffness", "damping", "mu_s", "mu_d", "gravity")
"""Numbers that all trials of a campaign have in common."""
FEWEST = 0.1  # A shorter run has too few rows of the camera to be diagnosed [s]


class TumbleRecording(StrictSettings):
    """What goes into a campaign made of tumbles beside the first run, and how noisy it is."""

    also: tuple[str, ...] = Field((), description="Of tumbles: folders of further runs, each a trial of the campaign.")
    fitted: str | None = None
    """Of tumbles: folder of a run of penetrate in the same grains, whose K and C are stated."""
    noise: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0
    """Of tumbles: noise of the sensors over that of `hedgebed campaign` [1]."""


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

    Raises ValueError, naming the folder and what would do, for runs that are not finished, of something else, too
    short, or of another platform, rig or surface than the first.
    """
    recording = recording if recording is not None else TumbleRecording()
    folders = [Path(run), *map(Path, recording.also)]
    results = [_finished(folder) for folder in folders]
    first = results[0]
    for folder, result in zip(folders[1:], results[1:], strict=True):
        _check_alike(folder, result, folders[0], first)
    plain = CampaignSettings()
    sensors = sensor_set(plain, noise=recording.noise)
    recordings: dict[tuple[str, str], Recording] = {}
    trials = []
    for number, (folder, result) in enumerate(zip(folders, results, strict=True), 1):
        name = f"{number:03d}"
        trials.append(trial_table(name, _numbers(result), result["actuator"]))
        measured = _record(folder, result, sensors, seed=(seed, number))
        for sensor in ("pose", "imu", "wheel"):
            recordings[name, sensor] = Recording(getattr(measured, sensor))
    stiffness, damping, sigmas, said = _law(first, recording.fitted)
    trial = _numbers(first)
    tables = TumbleCampaign(
        **shared_tables(
            f"tumbles on {_ground(first)}", trial | {"stiffness": stiffness, "damping": damping}, sensors,
            spike_count=int(first["spike_count"]), kind=str(first["surface"]), granular=first["ground"] == "bed",
            rig=RigTable(gravity=trial["gravity"]) if trial["counterweight"] > 0 else None,
        ),
        uncertainty=TumbleUncertainty(
            mass=plain.sigma_mass, inertia=plain.sigma_inertia, mu_s=plain.sigma_mu_s, mu_d=plain.sigma_mu_d,
            gravity_sim=plain.sigma_gravity_sim, **sigmas,
        ),
        notes={
            "made_by": f"hedgebed {__version__} tumble on {_ground(first)}", "stiffness_and_damping": said,
            "code": str(first.get("code", "")), "noise_seed": seed,
            "grain_seeds": [result.get("grains", {}).get("seed", "none") for result in results],
        },
        trial=tuple(trials),
    )  # fmt: skip
    return Campaign(tables, recordings)


def _finished(folder: Path) -> Json:
    kept = RunFolder.open(folder)
    if kept.command != "tumble":
        raise ValueError(say("no_tumble", folder=str(folder), command=kept.command))
    if not (folder / "result.json").exists():
        raise ValueError(say("no_result", folder=str(folder)))
    require_files(kept, PATH_AND_MOTION, key="run")
    result = kept.read_result()
    if result["effects"]:
        named = ", ".join(effect["id"] for effect in result["effects"])
        raise ValueError(say("has_effects", folder=str(folder), named=named))
    return dict(result)


def _numbers(result: Mapping[str, Any]) -> dict[str, float]:
    found = {name: entry["value"] for name, entry in result["trial"].items()}
    until = found.get("torque_until")
    full = result.get("wheel_at_limit")
    found["torque_until"] = min(math.inf if until is None else until, math.inf if full is None else full)
    return found


def _check_alike(folder: Path, result: Mapping[str, Any], first_folder: Path, first: Mapping[str, Any]) -> None:
    one, other = _numbers(first), _numbers(result)
    pairs: dict[str, tuple[Any, Any]] = {name: (one.get(name), other.get(name)) for name in SHARED}
    pairs |= {name: (first[name], result[name]) for name in ("surface", "ground", "spike_count")}
    for name, (before, now) in pairs.items():
        if before != now:
            raise ValueError(
                say("not_alike", folder=str(folder), name=name, now=now, first=str(first_folder), before=before)
            )


def _record(folder: Path, result: Mapping[str, Any], sensors: SensorSet, *, seed: tuple[int, ...]) -> Any:
    """What the sensors make of a run's series; straight lines between its rows, a millisecond apart at most."""
    series, motion = read_series(folder / "trajectory.csv"), read_series(folder / "series" / "motion.csv")
    time = series["t_s"]
    if time[-1] < FEWEST:
        raise ValueError(say("too_brief", folder=str(folder), lasts=time[-1], least=FEWEST))
    at = sensor_times(sensors, float(time[-1]))

    def at_times(values: np.ndarray) -> np.ndarray:
        return np.interp(at, time, values)

    moved = Motion(
        time=at, x=at_times(series["x_m"] - series["x_m"][0]), y=at_times(series["y_m"]),
        theta=at_times(series["theta_rad"]), vx=at_times(series["vx_m_s"]), vy=at_times(series["vy_m_s"]),
        omega=at_times(series["omega_rad_s"]), wheel_speed=np.interp(at, motion["t_s"], motion["wheel_speed_rad_s"]),
    )  # fmt: skip
    numbers = _numbers(result)
    local = numbers["gravity"] if numbers["counterweight"] > 0 else numbers["gravity_sim"]
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
    if folder.settings.get("material") != first["surface"]:
        material = folder.settings.get("material")
        raise ValueError(say("other_grains", fitted=fitted, material=material, surface=first["surface"]))
    quantities = folder.read_result()["quantities"]
    values, sigmas = [], {}
    for name in ("stiffness", "damping"):
        value = float(quantities[name]["value"])
        error = float(quantities.get(f"{name}_error", {}).get("value") or 0.0)
        spread = float(quantities[name].get("std") or 0.0)
        values.append(SPIKES_PER_ROW * value)
        sigmas[name] = math.hypot(error, spread) / abs(value) if value else 1.0
    return values[0], values[1], sigmas, f"fitted to drives of one spike, twice: {folder.path.name}"


def _ground(result: Mapping[str, Any]) -> str:
    named = str(result["surface"])
    return f"a bed of {named}" if result["ground"] == "bed" else f"the {result['ground']} of {named}"
