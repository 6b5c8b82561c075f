"""`hedgebed paper`: the trials of Reid, Roveda, Nesnas and Pavone (i-SAIRAS 2014) with our model.

Every gravity, torque and surface is computed with the stated friction and both ends of its band. The located integrator
and the paper's fixed step are used. Then come `variants`: a rising torque, rivals to it, and unstated numbers.
`experiments.paper.claims` compares them with what the paper's text states, `experiments.paper.evidence` weighs the
rivals.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from experiments.platform.ground_file import fitted_ground, range_warnings, with_kept_ground
from experiments.platform.numbers import PlatformNumbers, keep_platform, platform_numbers, torque_within_limit
from experiments.platform.settled import open_stiffness
from experiments.platform.surfaces import find_surface
from experiments.runs.folder import RunFolder
from experiments.runs.memory import cores_there
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantities_of
from experiments.runs.types import Json
from experiments.runs.whole_runs import computed_run
from experiments.tumble.result import trajectory_columns
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import SPIKES_PER_ROW, plan_tumble, turns_of
from rigid.ground.laws import find_law
from rigid.ground_file import GroundFile
from rigid.model.trial import Effect, Ground, Trial
from rigid.planar.simulate import simulate

from .claims import GRANULAR, Trials, claims, first_lasting
from .evidence import BRAKE_DURATION, DURATION, evidence, rival_trials
from .grains import angles_of_beds, kept_angles, packed_angles, spring_angles
from .settings import PaperSettings
from .transitions import HARD, say

__all__ = ["FACTORS", "Job", "SLIDING", "SWEPT", "Variant", "check", "plan_jobs", "resume", "run", "variants"]

SAMPLE_INTERVAL, SELDOM = 5e-3, 5e-2
"""Between the rows that are kept [s], and where none are; numbers come from the integration itself."""


@dataclass(frozen=True)
class Job:
    """One integration."""

    id: str
    rig: float  # g_sim [9.80665 m/s2]
    torque: float
    surface: str
    variant: str
    """"nominal", "low" or "high" friction, "paper" (the fixed step), or the name of one of `variants`."""
    trial: Trial
    duration: float
    trusted: float
    max_wheel_speed: float = math.inf
    """Where a motor's torque ends [rad/s]; not known of a wheel with another inertia than the platform's."""
    kind: str = ""
    varied: Mapping[str, Any] = field(default_factory=dict)  # as `variants` has them
    fitted: GroundFile | None = None  # where the law's range is to be kept
    tip_diameter: float = 0.0  # of the platform [m]

    @property
    def lean(self) -> float | None:
        """How far it starts leaning on its leading row [rad]; None: it stands."""
        return float(self.varied["value"]) if self.varied.get("rival") == "pivot-start" else None

    @property
    def method(self) -> Any:
        """Of the integrator."""
        return "paper" if self.variant == "paper" else "located"


def check(settings: PaperSettings) -> None:
    """Raise ValueError, naming key, value and what is allowed, for what the settings class cannot see."""
    for job in plan_jobs(settings):
        if job.variant == "paper":  # a step too long for the ground
            simulate(job.trial, duration=1e-3, method="paper")
        elif job.kind == "rivals":  # a platform that a rival does not let stand
            try:
                simulate(job.trial, duration=1e-6, lean=job.lean)
            except ValueError as error:
                raise ValueError(say("rival_falls", id=job.id, error=error)) from error


def plan_jobs(settings: PaperSettings, platform_file: Path | None = None) -> list[Job]:
    """Every integration, in order; `platform_file` stands in for ``settings.platform``, where that was copied."""
    platform = platform_numbers(settings.platform, file=platform_file)
    fitted = fitted_ground(settings.ground)
    if fitted is not None and fitted.material not in {find_surface(name).grains for name in settings.surfaces}:
        named = ", ".join(settings.surfaces)
        raise ValueError(
            f"ground = {settings.ground!r} was fitted in {fitted.material!r}, and none of surfaces = {named} is made "
            f"of it: add such a surface"
        )
    turns = turns_of(settings.motor_torques, settings.brake_torques, settings.brake_wheel_speed)
    places = product(settings.rigs, turns, settings.surfaces)
    return [job for place in places for job in _case_jobs(settings, *place, platform)]


def _case_jobs(
    settings: PaperSettings, rig: float, turn: Json, surface: str, platform: PlatformNumbers
) -> Iterator[Job]:
    """The integrations of one gravity, torque and surface."""
    fitted = fitted_ground(settings.ground)
    on_file = fitted is not None and find_surface(surface).grains == fitted.material
    ground = {"ground": settings.ground} if on_file else {}
    plan = plan_tumble(
        TumbleSettings(
            rig=rig, surface=surface, platform=settings.platform, rig_reading=settings.rig_reading, **ground, **turn
        ),
        platform=platform,
    )  # fmt: skip
    trial, torque = plan.trial, turn["torque"]
    name = f"{surface}-{rig:g}g-{torque:g}Nm"
    brake = turn["actuator"] == "brake"
    duration = settings.brake_duration if brake else settings.duration
    short = min(duration, BRAKE_DURATION if brake else DURATION)

    def job(variant: str, changed: Trial, kind: str = "", varied: Mapping[str, Any] | None = None) -> Job:
        limit = plan.max_wheel_speed if changed.wheel_inertia == trial.wheel_inertia else math.inf
        return Job(
            f"{name}-{variant.replace(' ', '-')}", rig, torque, surface, variant, changed,
            short if kind == "rivals" else duration, settings.trusted, limit, kind, varied or {},
            plan.fitted if variant == "nominal" else None, platform.spike_diameter,
        )  # fmt: skip

    yield job("nominal", trial)
    for variant, factor in (("low", 1 - settings.friction_band), ("high", 1 + settings.friction_band)):
        yield job(variant, replace(trial, mu_s=factor * trial.mu_s, mu_d=factor * trial.sliding_friction))
    yield job("paper", trial)
    for other in variants(settings, trial, surface=surface, first_rig=rig == settings.rigs[0]):
        yield job(*other)


def _integrate(job: Job) -> Json:
    """The numbers of one job, and its rows where they are drawn."""
    trial, full = torque_within_limit(
        job.trial, max_wheel_speed=job.max_wheel_speed, duration=job.duration, method=job.method
    )
    every = SELDOM if job.kind == "rivals" else SAMPLE_INTERVAL
    trajectory = simulate(trial, duration=job.duration, method=job.method, sample_interval=every, lean=job.lean)
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
        "friction": [job.trial.mu_s, job.trial.sliding_friction],
        "launch": _launch(trajectory, states),
        "beyond_range": range_warnings(
            job.fitted, trajectory, gravity=job.trial.gravity, diameter=job.tip_diameter
        ),
        "rows": trajectory_columns(trajectory) if job.variant in ("nominal", "low", "high", "paper") else None,
    }  # fmt: skip


def _launch(trajectory: Any, states: Sequence[tuple[float, str, float]]) -> dict[str, float | bool] | None:
    """Position and velocity at the first hop, from a row in that flight, which is a parabola; None without one.

    `lasts` [s]: to the end of the trial where the hop has not `landed` by then; `height` [m]: of the peak above launch.
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


def _all(jobs: Sequence[Job], workers: int) -> Iterator[Json]:
    """The results of the jobs, in their order."""
    if workers == 1:
        yield from map(_integrate, jobs)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("fork")) as pool:
        yield from pool.map(_integrate, jobs, chunksize=4)


def _compute(settings: PaperSettings, folder: RunFolder, progress: Progress) -> Result:
    workers = settings.workers or cores_there()
    settings = with_kept_ground(settings, folder.path)
    jobs = plan_jobs(settings, keep_platform(settings.platform, folder.path, progress.message))
    progress.plan({"trials": float(len(jobs)), "report": 0.1 * len(jobs)})
    progress.stage("trials", total=float(len(jobs)))
    progress.message(f"{len(jobs)} integrations on {workers} process{'es' if workers > 1 else ''}")
    found = []
    for number, entry in enumerate(_all(jobs, workers), 1):
        found.append(entry)
        progress.update(number)
    for entry in found:
        rows = entry.pop("rows")
        if rows is not None and entry["surface"] in HARD:
            entry["series"] = folder.write_series(entry["id"], rows)
    return _result(settings, jobs, found)


def _result(settings: PaperSettings, jobs: Sequence[Job], found: list[Json]) -> Result:
    cases = [entry for entry in found if entry["variant"] in ("nominal", "low", "high", "paper")]

    def of_kind(kind: str) -> list[Json]:
        """Of these states only the first that lasts is kept, in place of all."""
        kept = [entry for entry in found if entry["kind"] == kind]
        return [
            {key: entry[key] for key in entry if key != "transitions"} | {"first_state": first_lasting(entry)}
            for entry in kept
        ]

    stated = claims(Trials.of(settings, found, jobs, kept_angles()))
    inside = {True: "yes", False: "no", None: "-"}
    rows = [[claim["quote"], claim["compared"], claim["ours"], inside[claim["met"]]] for claim in stated]
    weighed = evidence(settings, found)
    guesses = sorted({job.surface for job in jobs if find_surface(job.surface).guess})
    springs = sorted({job.surface for job in jobs if job.fitted is None})
    warnings = [f"the numbers of {name} are a guess until they are calibrated" for name in guesses]
    warnings += [said for name in springs for said in open_stiffness(find_surface(name))]
    warnings += [f"{entry['id']}: {said}" for entry in found for said in entry.pop("beyond_range")]
    fitted = next((job.fitted for job in jobs if job.fitted is not None), None)
    platform = jobs[0].trial
    return Result.make(
        "paper",
        title="The paper's Figures 5 to 8 with our model",
        quantities=_quantities(cases, stated, weighed),
        platform={key: getattr(platform, key) for key in ("mass", "inertia", "spike_length", "wheel_inertia")},
        brake_wheel_speed=settings.brake_wheel_speed,
        **({} if fitted is None else {"ground_file": fitted.model_dump()}),
        surfaces={name: asdict(find_surface(name)) for name in settings.surfaces},
        claims=stated,
        tables=[
            {"title": "What the paper's text states", "head": ["in its words", "compared", "ours", "met"], "rows": rows}
        ],
        evidence=weighed,
        integrations=len(jobs),
        kept_on_grains={
            "one_bed": [asdict(angle) for angle in kept_angles()],
            "beds": [asdict(angle) for angle in angles_of_beds()],
            "packed": [asdict(angle) for angle in packed_angles()],
            "springs": [asdict(angle) for angle in spring_angles()],
        },
        cases=cases,
        **{kind: of_kind(kind) for kind in ("sweep", "sliding", "grains")},
        warnings=warnings,
    )


def _quantities(cases: list[Json], stated: list[Json], weighed: Json) -> Json:
    """The numbers that a person would quote."""
    judged = [claim for claim in stated if claim["met"] is not None]
    risen = [claim["risen"] for claim in judged if claim.get("risen")]

    nominal = {entry["id"].removesuffix("-nominal"): entry for entry in cases if entry["variant"] == "nominal"}
    fixed = {entry["id"].removesuffix("-paper"): entry for entry in cases if entry["variant"] == "paper"}

    def apart(key: str) -> float:
        pairs = [(nominal[name][key], fixed[name][key]) for name in nominal if name in fixed]
        return max((abs(a - b) for a, b in pairs if a is not None and b is not None), default=0.0)

    gap = "by the paper's fixed step"
    residual = max(entry["energy_residual"] for entry in nominal.values())
    return quantities_of(
        {
            "claims_met": (
                sum(bool(claim["met"]) for claim in judged),
                "1",
                f"of {len(judged)} statements of the text that can be compared",
            ),
            "claims_compared": (len(judged), "1", f"{len(stated) - len(judged)} more cannot be, or are not judged"),
            **_of_a_rise(risen, weighed),
            "case_count": (len(nominal), "1", "gravities x torques x surfaces"),
            "step_angle_gap": (apart("trajectory_angle"), "rad", f"largest change of a trajectory angle {gap}"),
            "step_speed_gap": (apart("max_speed"), "m/s", f"largest change of a largest speed {gap}"),
            "energy_residual": (residual, "1", "largest of the located integrations"),
        }
    )


def _of_a_rise(risen: Sequence[Json], weighed: Json) -> Json:
    """What a torque that rises does to the claims, and what there is for it; {} where that was not asked for."""
    found: Json = {}
    if risen:
        count = sum(bool(claim["met"]) for claim in risen)
        found["claims_met_risen"] = (count, "1", "of the same, the motors' torque rising")
    if weighed:
        step = weighed["rivals"][0]["nats"]
        told = {row["id"]: row for row in weighed["rivals"]}
        rise, others = told["torque-rise"], [row for id, row in told.items() if id != "torque-rise"]
        found["rise_evidence"] = (rise["nats"] - step, "1", "ln of the odds of a torque that rises against a step")
        lead, apart = (rise[key] - max(row[key] for row in others) for key in ("nats", "apart"))
        found["rise_lead"] = (lead, "1", "the same against the best of its rivals")
        found["rise_lead_apart"] = (
            apart,
            "1",
            "the same where the platform's friction need not be what the paper states",
        )
        found["rise_best"] = (rise["best"]["value"], "s", "time constant that is likeliest, of those tried")
    return found


SWEPT = ("inertia", "wheel_inertia", "stiffness", "damping", "wheel_speed_0")
"""Numbers that the paper does not give, halved and doubled."""
FACTORS = (0.5, 2.0)
SLIDING = (0.6, 0.8, 1.0)
"""mu_d / mu_s [1] beside the half to which the paper fixed it: what hangs on that."""
MEMORY_LAW, LITTLE = "katsuragi-durian", 0.05
"""A law whose stiffness and rebound can be set apart, and its own rebound [1]: it returns next to nothing."""
HALF = 0.5
"""The most that `rebound` can be."""
OTHER_LAWS = ("bekker", "rft")
"""Laws of grains with a stiffness of their own, at the same rebound."""


Variant = tuple[str, Trial, str, Mapping[str, Any]]
"""A trial beside the nominal one: name; trial; what it is for, "risen" (claims), "rivals" (evidence), or its list in
result.json, "sweep", "sliding" or "grains"; what was varied: rise; rival and value; key and factor; ratio; or law,
stiffness (of a row, N/m) and rebound."""


def variants(settings: PaperSettings, trial: Trial, *, surface: str, first_rig: bool) -> Iterator[Variant]:
    """Those of one gravity, torque and surface. `first_rig`: whether the gravity is that of Figures 5 and 6."""
    brake = trial.actuator == "brake"
    if surface in GRANULAR and brake:
        yield from _grains(trial, whole=settings.sweep)
    if settings.torque_rise and not brake:
        rise = settings.torque_rise
        rising = replace(trial, effects=(Effect(id="torque-rise", parameters={"rise": rise}),))
        yield f"torque rise {rise:g} s", rising, "risen", {"rise": rise}
    if settings.weighs and surface in HARD:
        for name, other, of_rival in rival_trials(trial):
            yield f"rival {name}", other, "rivals", of_rival
    if not settings.sweep:
        return
    if surface in HARD and first_rig:
        for key in SWEPT:
            value = getattr(trial, key)
            for factor in FACTORS if value else ():
                varied = replace(trial, **{key: factor * value})
                yield f"{key} x{factor:g}", varied, "sweep", {"key": key, "factor": factor}
    if (surface in HARD and first_rig) or (surface in GRANULAR and brake):
        for ratio in SLIDING:
            yield f"mu_d {ratio:g} mu_s", replace(trial, mu_d=ratio * trial.mu_s), "sliding", {"ratio": ratio}


def _grains(trial: Trial, *, whole: bool) -> Iterator[Variant]:
    """Stiffness by rebound: the surface's own stiffness at little rebound first, the rest where `whole`."""
    law = find_law(MEMORY_LAW)
    default = SPIKES_PER_ROW * law.values({})["stiffness"]
    own = trial.stiffness

    def remembers(stiffness: float, rebound: float) -> Variant:
        parameters = {"stiffness": stiffness / SPIKES_PER_ROW, "rebound": rebound}
        ground = Ground(name=MEMORY_LAW, parameters=parameters, spikes_per_row=SPIKES_PER_ROW)
        varied = {"law": MEMORY_LAW, "stiffness": stiffness, "rebound": rebound}
        name = f"{MEMORY_LAW} {stiffness:.4g} N per m rebound {rebound:g}"
        return name, replace(trial, ground=ground), "grains", varied

    yield remembers(own, LITTLE)
    if not whole:
        return
    for stiffness in sorted({default, own, *(find_surface(name).stiffness for name in GRANULAR)}):
        # No damper: it gives back all that it took.
        spring = replace(trial, stiffness=stiffness, damping=0.0, ground=None)
        varied = {"law": "spring-damper", "stiffness": stiffness, "rebound": 1.0}
        yield f"spring {stiffness:.4g} N per m", spring, "grains", varied
        for rebound in (HALF, LITTLE):
            if (stiffness, rebound) != (own, LITTLE):
                yield remembers(stiffness, rebound)
    for name in OTHER_LAWS:
        ground = Ground(name=name, parameters={"rebound": LITTLE}, spikes_per_row=SPIKES_PER_ROW)
        varied = {"law": name, "stiffness": None, "rebound": LITTLE}
        yield name, replace(trial, ground=ground), "grains", varied


run, resume = computed_run("paper", PaperSettings, _compute, check=check)
