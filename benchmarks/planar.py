"""``hedgebed bench planar``: how many tumbles of 1 s the batch does a second, and how near it is to the accurate one.

Trials are drawn at random over platform, ground, gravity and torque; the step is 1 ms. Two sets of terms: the base
model, and every effect on at once. Several rounds, the median counts; compiling is timed on its own. Beside the figure
of the clock stands what the processor time would give on as many idle cores. For quick trials, in the environment:
HEDGEBED_BENCH_TRIALS (timed ones), HEDGEBED_BENCH_ROUNDS, HEDGEBED_BENCH_COMPARED (with the accurate integrator; a
third as many with all terms on). What agreement means is in ``benchmarks/planar_trials/agreement.py``.
"""

import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.planar_trials.agreement import CHANNELS, SHARE_WITHIN, TOLERANCE, compare, random_trial
from benchmarks.race.machine import begin_timing, column_table, environment_numbers, wide_console
from experiments.runs.types import Json
from rigid import EFFECTS, Effect, Trial, simulate_batch

__all__ = ["Settings", "drawn_trials", "run"]

DURATION, TIME_STEP = 1.0, 1e-3
GRAVITY = 9.80665
AMPLITUDES = {
    id: {parameter.name: parameter.visible for parameter in term.parameters if parameter.visible}
    for id, term in sorted(EFFECTS.items(), key=lambda item: "inner_mass" in item[1].hooks)
    if not term.sensor
}
"""Ranges of the effects' parameters, where all terms are on: those that the effects' files call visible. An effect with
a coordinate of its own comes last, so that drawn trials stay the same."""


class Settings:
    """Numbers of trials and rounds. Raises ValueError where the environment holds no positive whole number."""

    def __init__(self) -> None:
        (self.trials,) = environment_numbers("TRIALS", (20_000,))
        (self.rounds,) = environment_numbers("ROUNDS", (5,))
        (self.compared,) = environment_numbers("COMPARED", (1000,))


def drawn_trials(count: int, *, seed: int, all_terms: bool) -> tuple[Trial, dict[str, np.ndarray]]:
    """One trial in the rig and the numbers that vary over it, each of shape [count]."""
    rng = np.random.default_rng(seed)
    effects = tuple(Effect(id=id) for id in AMPLITUDES) if all_terms else ()
    level = rng.choice([0.0085, 0.015], count) * GRAVITY
    mass = rng.uniform(4.5, 6.5, count)
    base = Trial(gravity_sim=0.0085 * GRAVITY, counterweight=5.0, torque=0.2, effects=effects)
    vary = {
        "gravity_sim": level,
        "mass": mass,
        "counterweight": mass * (GRAVITY - level) / (GRAVITY + level),
        "inertia": rng.uniform(0.04, 0.09, count),
        "mu_s": rng.uniform(0.15, 0.8, count),
        "stiffness": 10 ** rng.uniform(3, 4.3, count),
        "damping": 10 ** rng.uniform(0.5, 2.2, count),
        "torque": rng.uniform(0.05, 0.4, count),
    }
    if all_terms:
        for id, ranges in AMPLITUDES.items():
            for name, bounds in ranges.items():
                vary[f"{id}.{name}"] = rng.uniform(*bounds, count)
    return base, vary


def _timed(base: Trial, vary: dict[str, np.ndarray], rounds: int) -> tuple[list[float], float, float]:
    """Trials a second of each round; the time of the first call, with compiling [s]; processor time a trial [s]."""
    few = {name: value[:64] for name, value in vary.items()}
    begin = time.perf_counter()
    simulate_batch(base, duration=DURATION, vary=few, time_step=TIME_STEP)
    compiling = time.perf_counter() - begin
    speeds, busy = [], []
    for _ in range(rounds):
        begin, worked = time.perf_counter(), time.process_time()
        batch = simulate_batch(base, duration=DURATION, vary=vary, time_step=TIME_STEP)
        speeds.append(batch.trial_count / (time.perf_counter() - begin))
        busy.append((time.process_time() - worked) / batch.trial_count)
    return speeds, compiling, statistics.median(busy)


def run(out: Path, *, progress: Any) -> Json:
    """Time the batch and compare it; show the table; return what goes into bench.json. Nothing is written to `out`.

    `progress`: an ``experiments.runs.progress.Progress``. Raises ValueError for a wrong variable of the environment,
    RuntimeError where the batch failed.
    """
    settings = Settings()
    bench, remarks = begin_timing("planar")
    for remark in remarks:
        progress.message(remark)
    bench |= {
        "unit": "trials of 1 s at 1 ms a second",
        "trials": settings.trials,
        "rounds": settings.rounds,
        "time_step": TIME_STEP,
        "duration": DURATION,
        "precision": "float64",
        "sets": {},
    }
    progress.plan({"base": 1.0, "all terms": 3.0})
    for name, on, count in (
        ("base", (), settings.compared), ("all terms", tuple(AMPLITUDES), max(1, settings.compared // 3)),
    ):  # fmt: skip
        progress.stage(name, total=1.0)
        base, vary = drawn_trials(settings.trials, seed=1, all_terms=bool(on))
        speeds, compiling, processor = _timed(base, vary, settings.rounds)
        rng = np.random.default_rng(2026)
        trials = [random_trial(rng, on, AMPLITUDES) for _ in range(count)]
        bench["sets"][name] = {
            "trials_per_s": statistics.median(speeds),
            "rounds": speeds,
            "processor_s_per_trial": processor,
            "trials_per_s_idle_cores": bench["machine"]["cores"] / processor,
            "first_call_s": compiling,
            "effects": [effect.id for effect in base.effects],
            "agreement": compare(trials).summary(),
        }
    bench["trials_per_s"] = bench["sets"]["base"]["trials_per_s"]
    bench["trials_per_s_all_terms"] = bench["sets"]["all terms"]["trials_per_s"]
    progress.close()
    _show(bench)
    return bench


def _show(bench: Json) -> None:
    cores = bench["machine"]["cores"]
    table = column_table(
        ("terms", "trials/s", "slowest - fastest", "by processor time", "first call [s]", "accurate [ms]"),
        title=f"planar: trials of {DURATION:g} s at {1e3 * TIME_STEP:g} ms, {cores} cores",
    )
    near = column_table(
        ("terms", *CHANNELS), left=("terms",),
        title="difference to the accurate integrator within a trial: median, 99 %, largest",
    )  # fmt: skip
    why = column_table(
        ("terms", "within", "second order", "branch", "unexplained", "largest over tolerance, no branch"),
        title=f"random trials by agreement: {100 * SHARE_WITHIN:g} % or more are to be within the tolerance",
    )
    for name, part in bench["sets"].items():
        agreement, speeds = part["agreement"], part["rounds"]
        count = agreement["trials"]
        table.add_row(
            name, f"{part['trials_per_s']:,.0f}", f"{min(speeds):,.0f} - {max(speeds):,.0f}",
            f"{part['trials_per_s_idle_cores']:,.0f}", f"{part['first_call_s']:.1f}",
            f"{1e3 * agreement['seconds_per_accurate_trial']:.0f}",
        )  # fmt: skip
        differences = agreement["differences"].values()
        apart = (f"{one['median']:.0e} {one['quantile_99']:.0e} {one['largest']:.0e}" for one in differences)
        near.add_row(f"{name} ({count})", *apart)
        shares = (f"{kind} ({100 * kind / count:.1f} %)" for kind in agreement["counts"].values())
        why.add_row(name, *shares, f"{agreement['largest_over_tolerance_no_branch']:.1f}")
    near.add_section()
    near.add_row("tolerance", *(f"{limit:.1e}" for limit in TOLERANCE.values()))
    for one in (table, near, why):
        wide_console().print(one)
