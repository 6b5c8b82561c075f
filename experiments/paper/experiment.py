"""`hedgebed paper`: the trials of Reid, Roveda, Nesnas and Pavone (i-SAIRAS 2014) with our model.

Every gravity, torque and surface, with friction as it is and at both ends of its band, by the located integrator and by
the paper's fixed step; then what the paper does not give, varied (`experiments.paper.variants`). What the paper's text
states is compared in `experiments.paper.claims`.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from experiments.platform.kept_platform import keep_platform
from experiments.platform.numbers import PlatformNumbers, platform_numbers, torque_within_limit
from experiments.platform.surfaces import find_surface
from experiments.runs.folder import RunFolder
from experiments.runs.memory import cores_there
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantity
from experiments.runs.types import Json
from experiments.runs.whole_runs import computed_run
from experiments.tumble.result import trajectory_columns
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import plan_tumble, turns_of
from rigid.model.trial import Trial
from rigid.planar.simulate import simulate

from .claims import claims, first_lasting
from .settings import PaperSettings
from .transitions import HARD
from .variants import variants

__all__ = ["Job", "check", "plan_jobs", "resume", "run"]

SAMPLE_INTERVAL = 5e-3
"""Between the rows that are kept [s]; numbers come from the integration itself."""


@dataclass(frozen=True)
class Job:
    """One integration."""

    id: str
    rig: float  # g_sim [9.80665 m/s2]
    torque: float
    surface: str
    variant: str
    """"nominal", "low" or "high" friction, "paper" (the fixed step), or the name of a `paper_variants.Variant`."""
    trial: Trial
    duration: float
    trusted: float
    max_wheel_speed: float = math.inf
    """Where a motor's torque ends [rad/s]; not known of a wheel with another inertia than the platform's."""
    kind: str = ""
    varied: Mapping[str, Any] = field(default_factory=dict)  # as `paper_variants.Variant` has them

    @property
    def method(self) -> Any:
        """Of the integrator."""
        return "paper" if self.variant == "paper" else "located"


def check(settings: PaperSettings) -> None:
    """Raise ValueError, naming key, value and what would do, for what the settings class cannot see."""
    jobs = plan_jobs(settings)
    for job in jobs:
        if job.variant == "paper":  # a step too long for the ground
            simulate(job.trial, duration=1e-3, method="paper")


def plan_jobs(settings: PaperSettings, platform_file: Path | None = None) -> list[Job]:
    """Every integration, in order; `platform_file` stands in for ``settings.platform``, where that was copied."""
    platform = platform_numbers(settings.platform, file=platform_file)
    jobs: list[Job] = []
    turns = turns_of(settings.motor_torques, settings.brake_torques, settings.brake_wheel_speed)
    for rig in settings.rigs:
        for turn in turns:
            for surface in settings.surfaces:
                jobs += _case_jobs(settings, rig, turn, surface, platform)
    return jobs


def _case_jobs(
    settings: PaperSettings, rig: float, turn: Json, surface: str, platform: PlatformNumbers
) -> Iterator[Job]:
    """The integrations of one gravity, torque and surface."""
    plan = plan_tumble(
        TumbleSettings(rig=rig, surface=surface, platform=settings.platform, rig_reading=settings.rig_reading, **turn),
        platform=platform,
    )
    trial, torque = plan.trial, turn["torque"]
    name = f"{surface}-{rig:g}g-{torque:g}Nm"
    duration = settings.duration if turn["actuator"] == "motor" else settings.brake_duration

    def job(variant: str, changed: Trial, kind: str = "", varied: Mapping[str, Any] | None = None) -> Job:
        limit = plan.max_wheel_speed if changed.wheel_inertia == trial.wheel_inertia else math.inf
        return Job(
            f"{name}-{variant.replace(' ', '-')}", rig, torque, surface, variant, changed, duration, settings.trusted,
            limit, kind, varied or {},
        )  # fmt: skip

    yield job("nominal", trial)
    for variant, factor in (("low", 1 - settings.friction_band), ("high", 1 + settings.friction_band)):
        yield job(variant, replace(trial, mu_s=factor * trial.mu_s, mu_d=factor * trial.sliding_friction))
    yield job("paper", trial)
    for other in variants(settings, trial, surface=surface, first_rig=rig == settings.rigs[0]):
        yield job(other.name, other.trial, other.kind, other.varied)


def _integrate(job: Job) -> Json:
    """The numbers of one job, and its rows where they are drawn."""
    trial, full = torque_within_limit(
        job.trial, max_wheel_speed=job.max_wheel_speed, duration=job.duration, method=job.method
    )
    trajectory = simulate(trial, duration=job.duration, method=job.method, sample_interval=SAMPLE_INTERVAL)
    away = np.hypot(trajectory.x - trajectory.x[0], trajectory.y - trajectory.y[0])
    beyond = np.flatnonzero(away >= job.trusted)
    end = int(beyond[0]) + 1 if len(beyond) else len(away)
    speed = np.hypot(trajectory.vx, trajectory.vy)[:end]
    states = [(float(time), state, float(theta)) for time, state, theta in trajectory.transitions]
    return {
        "id": job.id, "rig": job.rig, "torque": job.torque, "actuator": job.trial.actuator, "surface": job.surface,
        "variant": job.variant, "kind": job.kind, "varied": dict(job.varied),
        "trajectory_angle": trajectory.trajectory_angle, "max_speed": float(speed.max()),
        "max_angular_velocity": float(np.abs(trajectory.omega[:end]).max()), "until": float(trajectory.time[end - 1]),
        "transition_angle_slip": trajectory.transition_angle("slip"),
        "transition_angle_hop": trajectory.transition_angle("hop"), "energy_residual": trajectory.energy_residual,
        "wheel_at_limit": full, "transitions": states,
        "launch": _launch(trajectory, states),
        "rows": trajectory_columns(trajectory) if job.variant in ("nominal", "low", "high", "paper") else None,
    }  # fmt: skip


def _launch(trajectory: Any, states: Sequence[tuple[float, str, float]]) -> dict[str, float | bool] | None:
    """Position and velocity at the first hop, from a row in that flight, which is a parabola; None without one.

    `lasts` [s] goes to the end of the trial where the hop has not `landed` by then; `height` [m] is that of the
    parabola's peak above the launch.
    """
    start = next((time for time, state, _ in states if state == "hop"), None)
    if start is None:
        return None
    end = next((time for time, state, _ in states if time > start and state != "hop"), math.inf)
    inside = np.flatnonzero((trajectory.time >= start) & (trajectory.time <= end))
    if not len(inside):
        return None
    row = int(inside[0])
    back, g = float(trajectory.time[row]) - start, trajectory.trial.gravity_sim
    vx, vy = float(trajectory.vx[row]), float(trajectory.vy[row]) + g * back
    return {
        "time": start, "x": float(trajectory.x[row]) - vx * back,
        "y": float(trajectory.y[row]) - vy * back + 0.5 * g * back**2, "vx": vx, "vy": vy, "gravity": g,
        "lasts": float(min(end, trajectory.time[-1]) - start), "landed": math.isfinite(end),
        "height": max(vy, 0.0) ** 2 / (2 * g),
    }  # fmt: skip


def _all(jobs: Sequence[Job], workers: int, progress: Progress) -> list[Json]:
    """The results of the jobs, in their order."""
    found = []
    if workers == 1:
        for number, job in enumerate(jobs, 1):
            found.append(_integrate(job))
            progress.update(number)
        return found
    with ProcessPoolExecutor(workers, mp_context=get_context("fork")) as pool:
        for number, result in enumerate(pool.map(_integrate, jobs, chunksize=4), 1):
            found.append(result)
            progress.update(number)
    return found


def _compute(settings: PaperSettings, folder: RunFolder, progress: Progress) -> Result:
    workers = settings.workers or cores_there()
    jobs = plan_jobs(settings, keep_platform(settings.platform, folder.path, progress.message))
    progress.plan({"trials": float(len(jobs)), "report": 0.1 * len(jobs)})
    progress.stage("trials", total=float(len(jobs)))
    progress.message(f"{len(jobs)} integrations on {workers} process{'es' if workers > 1 else ''}")
    found = _all(jobs, workers, progress)
    for entry in found:
        rows = entry.pop("rows")
        if rows is not None and entry["surface"] in HARD:
            entry["series"] = folder.write_series(entry["id"], rows)
    return _result(settings, jobs, found)


def _result(settings: PaperSettings, jobs: Sequence[Job], found: list[Json]) -> Result:
    cases = [entry for entry in found if entry["variant"] in ("nominal", "low", "high", "paper")]

    def of_kind(kind: str) -> list[Json]:
        kept = [entry for entry in found if entry["kind"] == kind]
        return [
            {**{key: entry[key] for key in entry if key != "transitions"}, "first_state": first_lasting(entry)}
            for entry in kept
        ]

    stated = claims(settings, found, jobs)
    met = [claim for claim in stated if claim["met"] is not None]
    guesses = sorted({job.surface for job in jobs if find_surface(job.surface).guess})
    warnings = [f"the numbers of {name} are a guess until they are calibrated" for name in guesses]
    platform = jobs[0].trial
    return Result.make(
        "paper",
        title="The paper's Figures 5 to 8 with our model",
        quantities=_quantities(cases, stated, met),
        platform={key: getattr(platform, key) for key in ("mass", "inertia", "spike_length", "wheel_inertia")},
        brake_wheel_speed=settings.brake_wheel_speed,
        surfaces={name: asdict(find_surface(name)) for name in settings.surfaces},
        claims=stated,
        tables=[_table(stated)],
        integrations=len(jobs),
        cases=cases,
        **{kind: of_kind(kind) for kind in ("sweep", "sliding", "grains")},
        warnings=warnings,
    )


def _table(stated: list[Json]) -> Json:
    """What the text states beside what comes out, as the terminal shows it."""
    inside = {True: "yes", False: "no", None: "-"}
    rows = [[claim["statement"], claim["ours"], inside[claim["met"]]] for claim in stated]
    return {"title": "What the paper's text states", "head": ["statement", "ours", "inside"], "rows": rows}


def _quantities(cases: list[Json], stated: list[Json], met: list[Json]) -> Json:
    """The numbers that a person would quote."""

    nominal = {entry["id"].removesuffix("-nominal"): entry for entry in cases if entry["variant"] == "nominal"}
    fixed = {entry["id"].removesuffix("-paper"): entry for entry in cases if entry["variant"] == "paper"}

    def apart(key: str) -> float:
        pairs = [(nominal[name][key], fixed[name][key]) for name in nominal if name in fixed]
        return max((abs(a - b) for a, b in pairs if a is not None and b is not None), default=0.0)

    return {
        "claims_met": quantity(
            sum(1 for claim in met if claim["met"]), "1", f"of {len(met)} statements of the text that can be compared"
        ),
        "claims_compared": quantity(len(met), "1", f"{len(stated) - len(met)} more cannot be"),
        "case_count": quantity(len(nominal), "1", "gravities x torques x surfaces"),
        "step_angle_gap": quantity(
            apart("trajectory_angle"), "rad", "largest change of a trajectory angle by the paper's fixed step"
        ),
        "step_speed_gap": quantity(
            apart("max_speed"), "m/s", "largest change of a largest speed by the paper's fixed step"
        ),
        "energy_residual": quantity(
            max(entry["energy_residual"] for entry in nominal.values()), "1", "largest of the located integrations"
        ),
    }


run, resume = computed_run("paper", PaperSettings, _compute, check=check)
