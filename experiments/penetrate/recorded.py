"""A finished penetration run as a campaign of measured trials: the bed's series through sensors with noise.

Every run of the folder is a trial, and beds of other seeds are replicates. Driven runs and set-downs, which have no
nominal speed, are ``driven``: the depth column says how the spike moved. A drop moves `mass` under the constant load W,
m z'' = W - F. So its gravity is W / m while the grains keep theirs; the format's drops begin at depth 0.

A sample is taken every whole number of the run's macro steps. Force and acceleration are means over the interval
between samples, as a sensor's filter gives them; the depth is that of the moment. White noise is added to each.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from experiments.campaign import Campaign, PenetrationCampaign, Recording, write_campaign
from experiments.campaign.files import check_target
from experiments.campaign.tables import (
    DepthSensor,
    PenetrationSensors,
    PenetrationSurface,
    PenetrationTrial,
    PenetrationUncertainty,
    SpikeTable,
)
from experiments.runs.folder import RunFolder, read_series
from experiments.runs.strict import Positive, SeedNumber, StrictSettings
from experiments.runs.types import Json
from experiments.runs.version import __version__

from .settings import PenetrateSettings, say

__all__ = ["SpikeSensors", "campaign_of", "campaign_of_run", "sensors_of", "write_run_campaign"]


UNKNOWN = 2.0
"""[uncertainty] of K and C: 1 or more is not known beforehand, so that a diagnosis fits them freely."""
_FEWEST = 12
"""Samples that a trial must have (as `experiments.diagnose` wants it)."""


class SpikeSensors(StrictSettings):
    """What records a spike: one rate, and the noise of each sensor (white, standard deviation)."""

    rate: Positive = Field(1000.0, description="Sampling rate [Hz]; at most one sample per exchange of forces.")
    depth_std: Positive = Field(5e-5, description="Noise of the depth [m].")
    force_std: Positive = Field(0.02, description="Noise of the force of pushes [N].")
    accel_std: Positive = Field(0.2, description="Noise of the acceleration of drops [m/s2].")
    seed: SeedNumber = Field(1, description="Seed of the noise.")


def sensors_of(settings: PenetrateSettings) -> SpikeSensors:
    """The sensors of a run's own campaign."""
    return SpikeSensors(**{name: getattr(settings, f"campaign_{name}") for name in SpikeSensors.model_fields})


def write_run_campaign(run: str | Path, target: str | Path, *, sensors: SpikeSensors | None = None) -> Campaign:
    """Write a run as a campaign into `target`, and return it. Raises ValueError as `campaign_of_run` does."""
    check_target(target)
    campaign = campaign_of_run(run, sensors=sensors)
    write_campaign(target, campaign)
    return campaign


def campaign_of_run(run: str | Path, *, sensors: SpikeSensors | None = None) -> Campaign:
    """The finished penetration run in the folder `run` as a campaign; K and C of [surface] are those that it fitted.

    Raises ValueError where `run` is no folder of `hedgebed penetrate`, is not finished, or is too short for the rate.
    """
    folder = RunFolder.open(Path(run))
    if folder.command != "penetrate":
        remedy = f": use `hedgebed tumble {run}/run.toml --campaign DIR`" if folder.command == "tumble" else ""
        raise ValueError(f"{str(run)!r} is a run of {folder.command!r}, 'penetrate' was expected{remedy}")
    if folder.status != "done" or not (folder.path / "result.json").exists():
        raise ValueError(f"{str(run)!r} is not finished ({folder.status}): `hedgebed resume {run}` first")
    result = folder.read_result()
    settings = PenetrateSettings(**folder.settings)
    if not settings.on_grains:
        raise ValueError(f"{str(run)!r} is a run on ground = {settings.ground!r}: one in a bed was expected")
    return campaign_of(settings, result, folder, sensors or SpikeSensors())


def campaign_of(
    settings: PenetrateSettings, result: Mapping[str, Any], folder: RunFolder, sensors: SpikeSensors
) -> Campaign:
    """The runs of a bed in `folder`, whose result is `result`, as a campaign. Raises ValueError for too low a rate."""
    runs: Sequence[Json] = result["runs"]
    trials = tuple(_trial(settings, entry) for entry in runs)
    recordings = {
        (trial.id, "data"): _record(settings, entry, read_series(folder.path / entry["series"]), sensors, number)
        for number, (trial, entry) in enumerate(zip(trials, runs, strict=True))
    }
    kinds = {trial.mode for trial in trials}
    material = str(result["bed"]["material"])
    fitted = {name: float(result["quantities"][name]["value"]) for name in ("stiffness", "damping")}
    tables = PenetrationCampaign(
        format="hedgehog-campaign/1",
        kind="penetration",
        name=f"{1e3 * settings.tip_diameter:g} mm {settings.tip} in {material}, bed of grains",
        spike=SpikeTable(
            mass=settings.mass,
            diameter=settings.tip_diameter,
            tip=settings.tip,
            cone_angle=settings.cone_angle if settings.tip == "cone" else None,
        ),
        surface=PenetrationSurface(kind=material, granular=True, **fitted),
        uncertainty=PenetrationUncertainty(stiffness=UNKNOWN, damping=UNKNOWN),
        sensors=PenetrationSensors(
            depth=DepthSensor(std=(sensors.depth_std,)),
            force=DepthSensor(std=(sensors.force_std,)) if "driven" in kinds else None,
            accel=DepthSensor(std=(sensors.accel_std,)) if "drop" in kinds else None,
        ),
        notes={
            "made_by": f"hedgebed {__version__} penetrate, grains of {1e3 * settings.grain:g} mm",
            "code": str(result.get("code", "")),
            "noise_seed": sensors.seed,
            "averaged": "force and acceleration are means over the interval between samples",
        },
        trial=trials,
    )
    return Campaign(tables, recordings)


def _trial(settings: PenetrateSettings, entry: Json) -> PenetrationTrial:
    name, kind = str(entry["id"]), entry["kind"]
    if kind == "drop":
        return PenetrationTrial(
            id=name, mode="drop", gravity=settings.weight / settings.mass, grain_gravity=settings.gravity,
            speed=float(entry["speed"]), data=f"{name}.csv",
        )  # fmt: skip
    speed = float(entry["speed"]) if kind == "driven" else None  # a hand lowers what is set down
    return PenetrationTrial(id=name, mode="driven", gravity=settings.gravity, speed=speed, data=f"{name}.csv")


def _record(
    settings: PenetrateSettings, entry: Json, series: dict[str, np.ndarray], sensors: SpikeSensors, number: int
) -> Recording:
    """The samples of one run, the `number`-th; see the module's text."""
    random, dropped = np.random.default_rng([sensors.seed, number]), entry["kind"] == "drop"
    rows = series["t_s"] > 0 if dropped else np.ones(len(series["t_s"]), dtype=bool)
    time, depth, force = (series[name][rows] for name in ("t_s", "depth_m", "force_N"))
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    each = max(1, round(1 / (sensors.rate * step))) if step > 0 else 1
    count = len(time) // each
    if count < _FEWEST:
        raise ValueError(say("slow_rate", sensors=sensors, count=count, id=entry["id"], rows=len(time), fewest=_FEWEST))
    middle, push = (np.asarray(rows[: count * each].reshape(-1, each).mean(axis=1)) for rows in (time, force))
    depths = np.interp(middle, time, depth) + sensors.depth_std * random.standard_normal(count)
    columns = {"t_s": middle, "depth_m": depths}
    if dropped:
        freely = (settings.weight - push) / settings.mass
        columns["accel_m_s2"] = freely + sensors.accel_std * random.standard_normal(count)
    else:
        columns["force_N"] = push + sensors.force_std * random.standard_normal(count)
    return Recording(columns)
