"""`hedgebed tumble --sweep KEY=FROM:TO:STEP`: the same tumble over a range of one number, or over two.

All trials are integrated at once by the batched model (`rigid.simulate_batch`). The trial in the middle, or the one
nearest to it that can stand, is the run's own, integrated accurately. It and the corners show the error of the batch.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from experiments.platform.numbers import PlatformNumbers, torque_within_limit
from experiments.runs.folder import RunFolder, write_series
from experiments.runs.types import Json
from rigid.batch.simulate import BatchTrajectory, simulate_batch
from rigid.planar.dynamics import System
from rigid.planar.simulate import PAPER_STEP, longest_step, simulate
from rigid.planar.statics import standing
from vis.page.sentences import label_of

from . import say
from .settings import TumbleSettings
from .sweep_ranges import parse_sweep, unit_of
from .trial import TumblePlan, plan_tumble

__all__ = ["SWEEP_FILE", "Sweep"]

SWEEP_FILE = "sweep.csv"
MOST_ROWS = 24  # Rows that the terminal shows
_UNITS = {"trajectory_angle": "rad", "max_speed": "m/s", "max_angular_velocity": "rad/s"}
GAPS = tuple(_UNITS)  # What is compared with the accurate integrator
COLUMNS = _UNITS | {f"transition_angle_{state}": "rad" for state in ("slip", "hop")}  # Quantity -> unit
WHEEL_SAMPLES = 128  # Times at which the batch is sampled to find when the wheel reaches its limit
SUFFIXES = {"1": "", "9.80665 m/s2": "_g"}

Array = NDArray[np.float64]


class Sweep:
    """Every trial of a sweep, the last key running fastest.

    `model_file` replaces ``settings.model`` if that was copied, `platform` replaces ``settings.platform`` if that was
    read. Raises ValueError for another method than "located" and, naming the point, for an impossible trial.
    """

    def __init__(
        self, settings: TumbleSettings, *, model_file: Path | None = None, platform: PlatformNumbers | None = None
    ) -> None:
        if settings.method != "located":
            method = settings.method
            raise ValueError(f"method = {method!r} with a sweep, which the batched model does: 'located' is accepted")
        self.settings, self.ranges = settings, parse_sweep(settings.sweep)
        self.counts = [len(each.values) for each in self.ranges]
        self.values = list(itertools.product(*(each.values for each in self.ranges)))
        self.plans: list[TumblePlan] = []
        for place, values in enumerate(self.values):
            try:
                self.plans.append(plan_tumble(self.trial_settings(values), model_file=model_file, platform=platform))
            except ValueError as error:
                raise ValueError(f"sweep: at {self._where(place)}: {_plain(error)}") from None

    def trial_settings(self, values: Sequence[float]) -> TumbleSettings:
        """The settings of one trial."""
        changed: Json = self.settings.model_dump(exclude_unset=True) | {"sweep": ()}  # what was not given stays so
        for each, value in zip(self.ranges, values, strict=True):
            if each.is_effect:
                changed["effects"] = (*changed.get("effects", ()), f"{each.key}={value!r}")
            else:
                changed[each.key] = value
        return TumbleSettings(**changed)

    @property
    def middle(self) -> int:
        """Number of the trial in the middle."""
        return int(np.ravel_multi_index([(count - 1) // 2 for count in self.counts], self.counts))

    @property
    def corners(self) -> list[int]:
        """Numbers of the trials at the ends of every range."""
        ends = itertools.product(*({0, count - 1} for count in self.counts))
        return sorted(int(np.ravel_multi_index(end, self.counts)) for end in ends)

    @cached_property
    def shown(self) -> int:
        """Number of the middle trial, or of the nearest one (in steps of the ranges) that can stand.

        Raises ValueError if none can stand.
        """
        steps = np.stack(np.unravel_index(np.arange(len(self.plans)), self.counts), axis=1)
        far = np.sum((steps - steps[self.middle]) ** 2, axis=1)
        why: ValueError | None = None
        for place in np.argsort(far, kind="stable"):
            try:
                standing(System(self.plans[place].trial))
            except ValueError as error:
                why = why or error
            else:
                return int(place)
        raise ValueError(f"sweep: none of its {len(self.plans)} trials can stand; in the middle {why}")

    def run(self, folder: RunFolder) -> Json:
        """Integrate the sweep, write sweep.csv and return its entry of result.json."""
        time_step = min(PAPER_STEP, *(0.999 * longest_step(self.plans[place].trial) for place in self.corners))
        batch = self._batch(time_step)
        found: dict[str, Array] = {name: getattr(batch, name) for name in GAPS}
        found |= {f"transition_angle_{state}": batch.transition_angles[state] for state in ("slip", "hop")}
        units = {each.key: unit_of(each.key) for each in self.ranges}
        keys = {_column(*key): values for key, values in zip(units.items(), np.array(self.values).T, strict=True)}
        write_series(folder.path / SWEEP_FILE, keys | {_column(name, COLUMNS[name]): found[name] for name in found})
        fallen, gaps = int((~batch.stands).sum()), self.gaps(found, [*self.corners, self.shown])
        return {
            "sweep": {
                "file": SWEEP_FILE,
                "keys": [
                    {"key": each.key, "unit": units[each.key], "column": column, "values": list(each.values)}
                    for each, column in zip(self.ranges, keys, strict=True)
                ],
                "trials": len(self.plans), "cannot_stand": fallen, "time_step": time_step, "gaps": gaps,
                "sentences": self.sentences(fallen, gaps),
            },
            "tables": [self._table(found, units)],
        }  # fmt: skip

    def _where(self, place: int) -> str:
        values = zip(self.ranges, self.values[place], strict=True)
        return ", ".join(f"{each.key} = {value:g}" for each, value in values)

    def _batch(self, time_step: float) -> BatchTrajectory:
        """All trials by the batched model; a motor's torque ends when its wheel reaches its limit.

        The wheel of a motor only gains speed, so trials that end below the limit never reached it. For the others the
        batch searches the time, until it is known within one step; within a step the speed rises linearly.
        """
        trials, duration = [plan.trial for plan in self.plans], self.settings.duration
        batch = simulate_batch(trials, duration=duration, time_step=time_step)
        limit = np.array([plan.max_wheel_speed for plan in self.plans])
        beyond = np.flatnonzero(batch.final["wheel_speed"] > limit)
        if not len(beyond) or trials[0].actuator != "motor":
            return batch
        limit = limit[beyond, None]
        low, high = np.zeros(len(beyond)), np.full(len(beyond), duration)
        while True:
            times = np.clip(np.linspace(low, high, WHEEL_SAMPLES, axis=1), 0.0, duration)
            fast = simulate_batch([trials[k] for k in beyond], duration=duration, time_step=time_step, times=times)
            speed, rows = fast.channel("wheel_speed"), np.arange(len(beyond))
            after = np.clip(np.argmax(speed > limit, axis=1), 1, None)
            low, high = times[rows, after - 1], times[rows, after]
            if np.max(high - low) <= time_step:
                break
        slow, quick = speed[rows, after - 1], speed[rows, after]
        ends = low + (high - low) * np.clip((limit[:, 0] - slow) / (quick - slow), 0.0, 1.0)
        for k, end in zip(beyond, ends, strict=True):
            trials[k] = replace(trials[k], torque_until=float(end))
        return simulate_batch(trials, duration=duration, time_step=time_step)

    def gaps(self, found: dict[str, Array], places: Sequence[int]) -> Json:
        """Largest differences from the accurate integrator over the trials `places` that stand by both.

        `angles` counts those of them with a trajectory angle by both.
        `stand_by_one_only` and `away_by_one_only` count those that stand, or get 10 mm away, by one of the two alone.
        """
        most: dict[str, float] = dict.fromkeys(GAPS, 0.0)
        checked = angles = standing_apart = away_apart = 0
        duration = self.settings.duration
        for place in dict.fromkeys(places):
            plan, stands = self.plans[place], not math.isnan(found["max_speed"][place])
            try:
                standing(System(plan.trial))
            except ValueError:
                standing_apart += stands
                continue
            if not stands:
                standing_apart += 1
                continue
            trial, _ = torque_within_limit(plan.trial, max_wheel_speed=plan.max_wheel_speed, duration=duration)
            run = simulate(trial, duration=duration, sample_interval=min(1e-2, duration))
            checked += 1
            away_apart += (run.trajectory_angle is None) != math.isnan(found["trajectory_angle"][place])
            for name in GAPS:
                accurate, ours = getattr(run, name), float(found[name][place])
                if accurate is not None and not math.isnan(ours):
                    most[name] = max(most[name], abs(accurate - ours))
                    angles += name == "trajectory_angle"
        counts = {"stand_by_one_only": standing_apart, "away_by_one_only": away_apart}
        return {"checked": checked, "angles": angles} | counts | most

    def _table(self, found: dict[str, Array], units: dict[str, str]) -> Json:
        """Table of the trials for the terminal, evenly thinned out if there are many."""
        count = len(self.plans)
        shown = sorted({round(k) for k in np.linspace(0, count - 1, min(count, MOST_ROWS))})
        head = [key + ("" if unit == "1" else f" [{unit}]") for key, unit in units.items()]
        head += ["angle [degrees]", "speed [m/s]", "turning [rad/s]"]
        head += [f"{label_of(name)} [degrees]" for name in ("transition_angle_slip", "transition_angle_hop")]
        rows = [
            [
                *(f"{value:g}" for value in self.values[place]),
                *(_shown(float(found[name][place]), angle=COLUMNS[name] == "rad") for name in found),
            ]
            for place in shown
        ]
        some = f", {len(rows)} of {count} trials" if len(rows) < count else ""
        return {"title": f"The sweep{some}", "head": head, "rows": rows}

    def sentences(self, fallen: int, gaps: Json) -> list[str]:
        """Sentences on the trial of the result, the error of the batch, and the number of trials that cannot stand."""
        which = "in the middle" if self.shown == self.middle else "nearest the middle that can stand"
        where, count = self._where(self.shown), len(self.plans)
        said = [say("which_trial", which=which, where=where, count=count, file=SWEEP_FILE)]
        if gaps["checked"]:
            angle = say("angle_gap", angle=math.degrees(gaps["trajectory_angle"])) if gaps["angles"] else ""
            said.append(say("batch_gap", angle=angle, gaps=gaps))
        for key, one, more, away in (
            ("stand_by_one_only", "stands", "stand", ""), ("away_by_one_only", "gets", "get", " 10 mm away"),
        ):  # fmt: skip
            if gaps[key]:
                said.append(say("by_one_only", count=gaps[key], what=(one if gaps[key] == 1 else more) + away))
        keys = {each.key for each in self.ranges}
        if "mu_s" in keys and self.settings.mu_d is None and "mu_d" not in keys:
            said.append("mu_d is half of mu_s throughout.")
        return [*said, say("cannot_stand", count=fallen)] if fallen else said


def _plain(error: ValueError) -> str:
    """The message of an error; of pydantic's errors only the sentence."""
    if not isinstance(error, ValidationError):
        return str(error)
    return "; ".join(str(detail["msg"]).removeprefix("Value error, ") for detail in error.errors())


def _column(name: str, unit: str) -> str:
    suffix = SUFFIXES.get(unit, "_" + unit.replace(" ", "_").replace("/", "_"))
    return f"{name}{suffix}"


def _shown(value: float, *, angle: bool) -> str:
    if math.isnan(value):
        return "-"
    return f"{math.degrees(value):.1f}" if angle else f"{value:.4g}"
