"""The stepper for a tumble's settings: one tumble, several in a row, or a landing."""

from dataclasses import asdict
from typing import Any

import numpy as np

from coupling import CoupledTumble, Ground, Landing, Rest, TumblesInARow
from experiments.platform.numbers import tip_depth
from experiments.runs.result import quantity
from experiments.runs.types import Json
from rigid.model.trial import Trial

from . import say
from .footfalls import find_footfalls, footfall_quantities, footfall_table
from .settings import TumbleSettings

__all__ = ["is_plain", "own_quantities", "own_warning", "row_feet", "sinkage_start", "stepper_of", "words"]


def is_plain(settings: TumbleSettings) -> bool:
    """Whether it is one tumble from rest, for which the planar model has its own integrators."""
    return settings.tumbles == 1 and settings.drop_speed is None


def stepper_of(settings: TumbleSettings, trial: Trial, ground: Ground, **options: Any) -> CoupledTumble:
    """The stepper of `settings` on any ground; `options` as `CoupledTumble` has them."""
    if settings.drop_speed is not None:
        return Landing(
            trial, ground, speed=settings.drop_speed, along=settings.drop_along, spin=settings.drop_spin,
            theta=settings.drop_theta, **{key: value for key, value in options.items() if key != "lowering_speed"},
        )  # fmt: skip
    if settings.tumbles > 1:
        return TumblesInARow(trial, ground, tumbles=settings.tumbles, turn=settings.tumble_turn, **options)
    return CoupledTumble(trial, ground, **options)


def words(settings: TumbleSettings, title: str) -> str:
    """The title of a result that is not one plain tumble."""
    before, _, after = title.partition(":")
    if settings.drop_speed is not None:
        place = after.split(",")[-1].strip()
        return f"{before.replace('A tumble', 'A landing')}: {settings.drop_speed:g} m/s down, {place}"
    if settings.tumbles > 1:
        return f"{before.replace('A tumble', f'{settings.tumbles} tumbles in a row')}:{after}"
    return title


def row_feet(run: CoupledTumble) -> tuple[np.ndarray, np.ndarray]:
    """Depth of each row's tip [m], 0 above the surface, and its load [N], shape [step, row] both.

    The load is the mean over the previous step. On a law, at the start, it is the force of the spring at rest. The
    depth is the present one of the row's tip.
    """
    sinkage, load = run.feet[:, 3], run.feet[:, 0].copy()
    if not run.ground.gives_friction:
        rows, trial = run.columns, run.trial
        depth = tip_depth(rows["theta"], rows["y"], count=trial.spike_count, length=trial.spike_length)
        sinkage = np.maximum(0.0, depth)
        load[0] = trial.stiffness * sinkage[0]
    return sinkage, load


def sinkage_start(run: CoupledTumble) -> float:
    """Mean depth of the two rows that carry it when the torque begins [m]."""
    return float(row_feet(run)[0][0, [0, -1]].mean())


def own_quantities(run: CoupledTumble) -> tuple[dict[str, Json], Json]:
    """Additional entries of successive tumbles or a landing: quantities, and (of tumbles) tables and footfalls."""
    if isinstance(run, TumblesInARow):
        quantities, rests = _row(run)
        falls = find_footfalls(run.columns["time"], *row_feet(run))
        return quantities | footfall_quantities(falls), {
            "tables": [rests, footfall_table(falls)], "footfalls": [asdict(fall) for fall in falls],
        }  # fmt: skip
    if isinstance(run, Landing):
        return _landing(run), {}
    return {}, {}


def _row(run: TumblesInARow) -> tuple[dict[str, Json], Json]:
    rests = run.rests
    done = max(len(rests["time"]) - 1, 0)
    slope = error = None
    if done >= 2:  # the first rest is before any tumble: placed, not fallen
        number, sinkage = np.arange(1, done + 1), rests["sinkage"][1:]
        slope = float(np.polyfit(number, sinkage, 1)[0])
    if done >= 3:
        left = sinkage - np.polyval(np.polyfit(number, sinkage, 1), number)
        error = float(np.sqrt((left @ left) / (done - 2) / ((number - number.mean()) ** 2).sum()))
    noted = say("of_rest")
    added = {
        "tumbles_done": quantity(float(run.ended), "1", say("of_done")),
        "tumbles_at_rest": quantity(float(rests["at_rest"][1:].sum()), "1", say("of_at_rest")),
        "sinkage_per_tumble": quantity(slope, "m", say("of_slope", noted=noted)) | {"std": error},
        "sinkage_last": quantity(
            float(rests["sinkage"][-1]) if len(rests["sinkage"]) else None, "m",
            say("of_last", noted=noted),
        ),
    }  # fmt: skip
    head = ["after tumble", "time [s]", "rows", "x [mm]", "sinkage [mm]", "deepest [mm]", "at rest"]
    shown = [
        [
            str(k), f"{rests['time'][k]:.3f}", f"{rests['rows_turned'][k]:.0f}", f"{1e3 * rests['x'][k]:.1f}",
            f"{1e3 * rests['sinkage'][k]:.2f}", f"{1e3 * rests['deepest'][k]:.2f}",
            "yes" if rests["at_rest"][k] else "no",
        ]
        for k in range(len(rests["time"]))
    ]  # fmt: skip
    return added, {"title": "Where it was after each tumble", "head": head, "rows": shown}


def own_warning(run: CoupledTumble) -> str | None:
    """Warning of tumbles that ended before the platform was at rest; None if there are none."""
    if not isinstance(run, TumblesInARow):
        return None
    at_rest, ended, asked, rest = run.rests["at_rest"][1:].tolist(), run.ended, run.tumbles, run.rest
    moving = [str(k) for k, lay in enumerate(at_rest, start=1) if not lay]
    said = []
    if moving:
        which, numbers = "tumble" if len(moving) == 1 else "tumbles", ", ".join(moving)
        said.append(say("moving", which=which, numbers=numbers, rest=rest, speed=1e3 * rest.speed))
    if ended > len(at_rest):
        said.append(say("over_before", ended=ended))
    if ended < asked:
        said.append(say("of_asked", asked=asked, ended=ended))
    return "; ".join(said) or None


def _landing(run: Landing) -> dict[str, Json]:
    rows, states = run.columns, run.states
    touched = next((k for k, state in enumerate(states) if state != "hop"), None)
    left = None
    if touched is not None:
        # Going up: sand that was only grazed is let go of on the way down too.
        left = next((k for k in range(touched, len(states)) if states[k] == "hop" and rows["vy"][k] > 0), None)
    came = float(-rows["vy"][touched]) if touched is not None else None
    speed = np.maximum(np.hypot(rows["vx"], rows["vy"]), np.abs(rows["omega"]) * run.trial.spike_length)
    slow = Rest.of(run.trial).speed
    moving = np.flatnonzero(speed > slow)
    settled = None if not len(moving) or moving[-1] == len(speed) - 1 else float(rows["time"][moving[-1] + 1])
    share = None if left is None or not came else float(rows["vy"][left]) / came
    energy = rows["kinetic_energy"]
    kept = None if left is None or touched is None else float(energy[left] / energy[touched])
    return {
        "impact_speed": quantity(came, "m/s", say("of_impact")),
        "restitution": quantity(share, "1", say("of_restitution")),
        "energy_kept": quantity(kept, "1", say("of_kept")),
        "settling_time": quantity(settled, "s", say("of_settling", slow=1e3 * slow)),
    }
