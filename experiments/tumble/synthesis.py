"""`hedgebed campaign` and `hedgebed tumble --campaign`: synthetic trials, with their true numbers
beside the stated ones.

DIR/campaign is a campaign like that of a laboratory: stated numbers, uncertainties, noisy recordings. DIR/truth.toml
is the model behind it: the true numbers, the terms beyond the base model, each trial's true gravity. With `hedgebed
tumble` the campaign is written where `--campaign` says, and the truth into the run folder.
"""

import math
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from experiments.campaign import Campaign, EffectTable, Recording, TumbleCampaign, TumbleModel, tables
from experiments.campaign.files import check_target, place_campaign, write_campaign, write_model
from experiments.platform.numbers import torque_within_limit
from experiments.platform.surfaces import find_surface
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantity
from experiments.runs.types import Json
from experiments.runs.version import __version__
from experiments.runs.whole_runs import computed_run
from experiments.tumble.settings import TrialSettings, TumbleSettings
from experiments.tumble.trial import TumblePlan, plan_tumble, turns_of
from rigid.model.trial import Trial
from rigid.planar.simulate import simulate
from rigid.sensors import Measured, Motion, SensorSet, measure, sensor_times

from . import say
from .campaign_settings import CampaignSettings

__all__ = [
    "TRUTH", "check", "check_tumble_campaign", "record", "resume", "run", "sensor_set", "shared_tables", "trial_table",
    "write_tumble_campaign",
]  # fmt: skip

TRUTH = "truth.toml"  # What is true, in a run folder; never in the campaign's
MOST_ROWS = 24  # Trials that the terminal shows
MOTION = ("time", "x", "y", "theta", "vx", "vy", "omega", "wheel_speed", "ax", "ay")  # What sensors see of a trajectory
_DRAWN = ("mass", "inertia", "stiffness", "damping", "mu_s", "mu_d")
NUMBERS = ("gravity_sim", "torque", "torque_until", "wheel_speed_0", "counterweight")  # Of a trial, SI units


def shared_tables(
    name: str,
    numbers: Mapping[str, float],
    sensors: SensorSet,
    *,
    spike_count: int,
    kind: str,
    granular: bool,
    rig: tables.RigTable | None,
) -> Json:
    """The tables that a campaign of tumbles and its truth share.

    `numbers` of platform, wheel and surface by the names of `Trial`; `kind` and `granular` of the surface. The
    Hedgehog's number of rows is left out, as the format has it.
    """
    return {
        "format": tables.FORMAT, "kind": "tumble", "name": name,
        "platform": tables.PlatformTable(
            mass=numbers["mass"], inertia=numbers["inertia"], spike_length=numbers["spike_length"],
            spike_count=None if spike_count == tables.HEDGEHOG_ROWS else spike_count,
        ),
        "wheel": tables.WheelTable(inertia=numbers["wheel_inertia"]),
        "rig": rig,
        "surface": tables.TumbleSurface(
            kind=kind, granular=granular, stiffness=numbers["stiffness"], damping=numbers["damping"],
            mu_s=numbers["mu_s"], mu_d=numbers["mu_d"],
        ),
        "sensors": tables.TumbleSensors(
            pose=tables.PoseSensor(std=sensors.pose_std), wheel=tables.WheelSensor(std=(sensors.wheel_std,)),
            imu=tables.ImuSensor(std=sensors.imu_std, window=sensors.imu_window),
        ),
    }  # fmt: skip


def trial_table(
    name: str, trial: Trial | Mapping[str, Any], actuator: Literal["motor", "brake"] = "motor"
) -> tables.TumbleTrial:
    """The table of one trial; its recordings have its name. Without a counterweight the key is absent, not 0.

    `actuator`: that of a trial given as a mapping.
    """
    numbers = trial if isinstance(trial, Mapping) else {key: getattr(trial, key) for key in NUMBERS}
    given: Json = {key: numbers[key] for key in NUMBERS} | {"counterweight": numbers["counterweight"] or None}
    return tables.TumbleTrial(
        id=name, actuator=actuator if isinstance(trial, Mapping) else trial.actuator, **given,
        pose=f"{name}-pose.csv", imu=f"{name}-imu.csv", wheel=f"{name}-wheel.csv",
    )  # fmt: skip


def sensor_set(settings: CampaignSettings, *, noise: float = 1.0) -> SensorSet:
    """The sensors that `settings` describe, their standard deviations `noise` times as large."""
    x, y, theta = (noise * std for std in settings.pose_std)
    gyro, ax, ay = (noise * std for std in settings.imu_std)
    return SensorSet(
        camera_rate=settings.camera_rate, imu_rate=settings.imu_rate, wheel_rate=settings.wheel_rate,
        pose_std=(x, y, theta), imu_std=(gyro, ax, ay), wheel_std=noise * settings.wheel_std,
        imu_window=settings.imu_window, lead=settings.lead,
    )  # fmt: skip


def check(settings: CampaignSettings) -> None:
    """Raise ValueError, naming key, value and what is accepted, for faults that the settings class cannot detect."""
    made = _MadeUp(settings, _plans(settings))
    for number, plan in enumerate(made.plans.values(), 1):
        for trial in (plan.trial, made.true_trial(number, plan)):
            simulate(trial, duration=1e-3)  # that it can stand


def record(
    trial: Trial, *, duration: float, sensors: SensorSet, seed: int | tuple[int, ...] | None
) -> tuple[Measured, Any]:
    """Integrate `trial` and record it; returns the recordings and the trajectory.

    The trial's effects on sensors and its slope alter the sensors; g_loc is the rig's gravity in the rig, gravity_sim
    without one.
    """
    slope = trial.effect_values("slope")
    sensors = replace(sensors, effects={effect.id: effect.values for effect in trial.effects if effect.term.sensor})
    lean = slope["angle"] if slope else 0.0
    trajectory = simulate(trial, duration=duration, times=sensor_times(sensors, duration))
    motion = Motion(**{name: getattr(trajectory, name) for name in MOTION})
    local = trial.gravity if trial.counterweight > 0 else trial.gravity_sim
    measured = measure(motion, sensors, gravity_local=local, up=(math.sin(lean), math.cos(lean)), seed=seed)
    return measured, trajectory


def _plans(settings: CampaignSettings) -> list[TumblePlan]:
    """One plan for each condition, with the stated numbers."""
    shared = {name: getattr(settings, name) for name in TrialSettings.model_fields}
    gravities = [{"gravity": value} for value in settings.gravity]
    where = gravities or [{"rig": value} for value in settings.rig]
    turns = turns_of(settings.motor_torques, settings.brake_torques, settings.brake_wheel_speed)
    return [plan_tumble(TumbleSettings(**shared, **place, **turn)) for place in where for turn in turns]


class _MadeUp:
    """Synthetic trials, `settings.trials` of each plan, with their stated and their true numbers."""

    campaign: Campaign
    model: TumbleModel  # What is true
    rows: list[Json]  # Of result.json, one for each trial

    def __init__(self, settings: CampaignSettings, plans: Sequence[TumblePlan]) -> None:
        self.settings, self.sensors, self.first = settings, sensor_set(settings), plans[0]
        # The format knows no limit of a wheel: the torque ends where the wheel comes to it.
        trials = [
            torque_within_limit(plan.trial, max_wheel_speed=plan.max_wheel_speed, duration=settings.duration)[0]
            for plan in plans
        ]
        within = [replace(plan, trial=trial) for plan, trial in zip(plans, trials, strict=True)]
        repeated = [plan for plan in within for _ in range(settings.trials)]
        width = max(3, len(str(len(repeated))))
        self.plans = {f"{number:0{width}d}": plan for number, plan in enumerate(repeated, 1)}
        self.stated: Json = {name: getattr(trials[0], name) for name in _DRAWN} | {"mu_d": trials[0].sliding_friction}
        self.true = self._drawn()

    def _drawn(self) -> Json:
        """True values of the numbers that all trials share, drawn within the stated uncertainties."""
        if self.settings.exact:
            return self.stated
        values, stream = dict(self.stated), np.random.default_rng([self.settings.seed, 0])
        for name in _DRAWN:
            # Within three sigma, so that nothing that cannot be is drawn.
            sigma = getattr(self.settings, f"sigma_{name}")
            values[name] *= 1 + sigma * float(np.clip(stream.standard_normal(), -3, 3))
        values["mu_d"] = min(values["mu_d"], values["mu_s"])
        return values

    def true_trial(self, number: int, plan: TumblePlan) -> Trial:
        """The trial with its true numbers; its gravity is drawn anew."""
        gravity = plan.trial.gravity_sim
        if not self.settings.exact:
            stream = np.random.default_rng([self.settings.seed, 1, number])
            gravity *= 1 + self.settings.sigma_gravity_sim * float(np.clip(stream.standard_normal(), -3, 3))
        return replace(plan.trial, gravity_sim=gravity, **self.true)

    def record(self, progress: Progress) -> None:
        """Integrate and record every trial; keeps the campaign, its truth, and a table row for each trial."""
        recordings: dict[tuple[str, str], Recording] = {}
        true_trials, self.rows = [], []
        progress.stage("trials", total=float(len(self.plans)))
        for number, (name, plan) in enumerate(self.plans.items(), 1):
            trial, seed = self.true_trial(number, plan), (self.settings.seed, 2, number)
            measured, trajectory = record(trial, duration=self.settings.duration, sensors=self.sensors, seed=seed)
            for sensor in ("pose", "imu", "wheel"):
                recordings[name, sensor] = Recording(getattr(measured, sensor))
            true_trials.append(trial_table(name, trial))
            self.rows.append({
                "id": name, "gravity_sim": plan.trial.gravity_sim, "true_gravity_sim": trial.gravity_sim,
                "torque": trial.torque, "actuator": trial.actuator, "camera_zero": list(measured.camera_zero),
                "trajectory_angle": trajectory.trajectory_angle, "max_speed": trajectory.max_speed,
                "max_angular_velocity": trajectory.max_angular_velocity,
                "states": [state for _, state, _ in trajectory.transitions],
            })  # fmt: skip
            progress.update(number)
        sigmas = {name: getattr(self.settings, f"sigma_{name}") for name in (*_DRAWN, "gravity_sim")}
        stated = TumbleCampaign(
            **self._tables(self.stated),
            uncertainty=tables.TumbleUncertainty(**sigmas),
            notes={"made_by": f"hedgebed {__version__} campaign", "seed": self.settings.seed},
            trial=tuple(trial_table(name, plan.trial) for name, plan in self.plans.items()),
        )
        self.campaign = Campaign(stated, recordings)
        effects = []
        for effect in self.first.trial.effects:
            file = str(Path(effect.file).resolve()) if effect.file is not None else None
            effects.append(EffectTable(id=effect.id, parameters=dict(effect.values), file=file))
        self.model = TumbleModel(**self._tables(self.true), trial=tuple(true_trials), effect=tuple(effects))

    def _tables(self, values: Json) -> Json:
        """Tables of the campaign and of the truth, each with its own numbers."""
        settings, trial = self.settings, self.first.trial
        numbers = values | {"spike_length": trial.spike_length, "wheel_inertia": trial.wheel_inertia}
        rig = tables.RigTable(wire_length=settings.wire_length, gravity=trial.gravity)
        return shared_tables(
            settings.name, numbers, self.sensors, spike_count=trial.spike_count, kind=self.first.surface,
            granular=find_surface(settings.surface).granular if settings.surface is not None else False,
            rig=rig if trial.counterweight > 0 else None,
        )  # fmt: skip


def _compute(settings: CampaignSettings, folder: RunFolder, progress: Progress) -> Result:
    made = _MadeUp(settings, _plans(settings))
    for sentence in made.first.sentences():
        progress.message(sentence)
    made.record(progress)
    target = folder.path / "campaign"
    if target.exists():  # of a run that was stopped
        shutil.rmtree(target)
    write_campaign(target, made.campaign)
    write_model(folder.path / TRUTH, made.model)
    return _result(made, folder.path)


def check_tumble_campaign(settings: TumbleSettings) -> None:
    """Raise ValueError for a tumble whose campaign cannot be written, before any work."""
    if settings.campaign is None:
        return
    if settings.ground != "spring-damper":
        raise ValueError(say("campaign_on_a_law", s=settings))
    check_target(settings.campaign)


def write_tumble_campaign(settings: TumbleSettings, plan: TumblePlan, folder: Path, progress: Progress) -> Json | None:
    """Write `campaign_trials` replicates of the tumble to ``settings.campaign``, and their true numbers to `folder`.

    The stated numbers are the tumble's; the true ones are drawn within the default uncertainties of `hedgebed
    campaign`, each trial's gravity anew. Effects are true and not stated. Returns the entry of result.json, or None
    without a campaign. Raises ValueError if the folder contains something else.
    """
    if settings.campaign is None:
        return None
    shared = {name: getattr(settings, name) for name in TrialSettings.model_fields}
    plain = CampaignSettings()
    noisy = sensor_set(plain, noise=settings.campaign_noise)
    own = CampaignSettings(
        **shared, name=f"a tumble on {plan.surface}", rig=() if settings.gravity is not None else plain.rig,
        gravity=(settings.gravity,) if settings.gravity is not None else (), seed=settings.campaign_seed,
        trials=settings.campaign_trials, pose_std=noisy.pose_std, imu_std=noisy.imu_std, wheel_std=noisy.wheel_std,
    )  # fmt: skip
    made = _MadeUp(own, [plan])
    made.record(progress)
    target = place_campaign(settings.campaign, made.campaign, keep_out=folder)
    write_model(folder / TRUTH, made.model)
    progress.message(f"campaign {target}: {len(made.rows)} trials; what is true of them is in {folder / TRUTH}")
    return {"folder": str(target), "truth": TRUTH, "trials": made.rows}


def _table(rows: Sequence[Json]) -> Json:
    """The trials as the terminal shows them."""
    head = ["trial", "g_sim [m/s2]", "torque [N m]", "angle [degrees]", "speed [m/s]", "states"]
    shown = [
        [
            row["id"],
            f"{row['true_gravity_sim']:.4g}",
            f"{row['torque']:g} {row['actuator']}",
            "-" if row["trajectory_angle"] is None else f"{math.degrees(row['trajectory_angle']):.1f}",
            f"{row['max_speed']:.3g}",
            " ".join(row["states"][:4]) + (" ..." if len(row["states"]) > 4 else ""),
        ]
        for row in rows[:MOST_ROWS]
    ]
    if len(rows) > MOST_ROWS:
        shown.append(["...", f"{len(rows) - MOST_ROWS} more, in result.json", "", "", "", ""])
    return {"title": "What truly happens in the trials", "head": head, "rows": shown}


def _result(made: _MadeUp, folder: Path) -> Result:
    count = sum(len(recording) for recording in made.campaign.recordings.values())
    plan, rows = made.first, made.rows
    return Result.make(
        "campaign",
        title=f"A simulated campaign on {plan.surface}: {len(rows)} trials",
        quantities={
            "trial_count": quantity(len(rows), "1"),
            "row_count": quantity(count, "1", "of all recordings together"),
            "duration": quantity(made.settings.duration, "s", "of each trial"),
        },
        campaign="campaign",
        truth=TRUTH,
        tables=[_table(rows)],
        departures={
            "sentences": [
                f"{folder / 'campaign'} is what a laboratory would hand over, for `hedgebed diagnose`; {TRUTH} beside "
                f"it is what made it."
            ]
        },
        effects=[{"id": effect.id, "parameters": dict(effect.values)} for effect in plan.trial.effects],
        trials=rows,
        warnings=list(plan.warnings),
    )


run, resume = computed_run("campaign", CampaignSettings, _compute, check=check)
