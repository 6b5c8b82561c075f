"""Trials of a spike that goes straight down, as the statistics of diagnose see them (`problem.Problem`).

Driven trials are scored on their force along the smoothed depth. The error of that depth is one smooth curve, not white
noise, so the likelihood takes its covariance in full: force noise plus (dF/dz, dF/dv) times the error of depth and
speed; `chi_square` has the sum of docs/diagnose.md, std_force^2 + (dF/dz s)^2. Drops are integrated from their exact
start and scored on depth and acceleration.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.campaign import Campaign, EffectTable, PenetrationCampaign, PenetrationModel, write_model
from experiments.diagnose.fit.own import PENETRATION_HOOKS, OwnEffect
from experiments.diagnose.fit.problem import Array, Finding, Form, Parameter, Samples, TrialInfo, Values
from experiments.diagnose.fit.slopes import acceleration
from experiments.diagnose.noise.jitter import Shaken

from .data import Prepared, prepare, stds
from .depth import SmoothDepth
from .forms import Library, Scales, make_library, physical, unit_of
from .law import PHASES, SLOTS, fall, push, slot_places, slot_table
from .remarks import Push, remarks
from .zeros import find_force_zeros

__all__ = ["PenetrationProblem", "make_problem"]

_SLOT = {name: place for place, name in enumerate(SLOTS)}
_FAILED = 1e3
_SHALLOW = 0.02
"""Share of D that counts as just below the surface."""
_BESIDE = 5
"""Rows before and after a turn that tell the force there."""
_AT_TURN = 6
"""Rows that a turn may last; where a spike is slow for longer it is held, or eased, and its direction is what it is."""
_ZERO_DEPTH = 0.1
"""How far a depth's zero may differ between pushes while it is asked whether it does, over D."""
_LEAST_ZERO = 0.2
"""Zeros that differ by less than this share of the noise say nothing."""
_BED_STD = 0.5
"""How far the bed may differ between replicates while it is asked whether it does [1]."""


def make_problem(campaign: Campaign, *, own: Sequence[OwnEffect] = ()) -> PenetrationProblem:
    """The problem of a campaign of kind "penetration", `own` among its candidates.

    Raises ValueError where none of its trials can be used, or an effect acts where a single spike has nothing.
    """
    return PenetrationProblem(campaign, own=own)


class PenetrationProblem:
    """One campaign; see `problem.Problem` for what the members mean."""

    kind = "penetration"
    whole = "the bed or the spike"
    clocks = (("force",), ("depth", "accel"))
    """Channels whose times come from one clock."""
    hidden_scatter = ("bed damping",)
    """Kinds of scatter that are asked for only where something is left: they come near to what a speed does."""
    zero_scatter = ("bed", "depth zero")
    """Kinds that are asked for by themselves where the others do not explain what is left: at one speed a damper and a
    depth's zero are the same."""
    force_scatter = ("force zero",)
    """And after these, of pushes that begin at the surface, where no row reads it: in a stiff bed the two are next to
    the same; it counts where it explains all."""
    lone_scatter = (("bed", "depth zero"), ("bed", "bed damping"), ("force zero",))
    """What is asked for, one after the other, where no trial repeats another (`lone_beds`). A bed may differ in K and
    not in C."""
    special_scatter = ("depth zero", "force zero")
    """Kinds that are not asked for with all others at once."""
    by_path = True
    """What the error of a path does to a reading goes with the model (`rewhiten`)."""
    own_base = "diameter_m"
    """The setting each value of which has base parameters of its own."""

    def __init__(self, campaign: Campaign, *, own: Sequence[OwnEffect] = ()) -> None:
        tables = campaign.tables
        for effect in own:
            other = [hook for hook in effect.term.hooks if hook not in PENETRATION_HOOKS]
            if other and effect.push is None:
                raise ValueError(
                    f"effect_file = {str(effect.file)!r}: the hook {other[0]!r} has no meaning for a spike that goes "
                    f"straight down; {', '.join(PENETRATION_HOOKS)} have"
                )
        self.own = tuple(own)
        if not isinstance(tables, PenetrationCampaign):
            raise ValueError(f"kind = {tables.kind!r}: 'penetration' was expected here")
        self.tables: PenetrationCampaign = tables
        prepared, findings = prepare(campaign)
        self._trials: dict[str, Prepared] = {trial.info.id: trial for trial in prepared}
        self.findings: tuple[Finding, ...] = tuple(findings)
        self.trials: tuple[TrialInfo, ...] = tuple(trial.info for trial in prepared)
        self._diameters = sorted({trial.diameter for trial in prepared})
        self._middle = self._diameters[len(self._diameters) // 2]
        driven = any(trial.driven for trial in prepared)
        self._zeros = find_force_zeros(prepared, stds(self.tables, True)[1]) if driven else None
        if self._zeros is not None:
            self.findings = (*self.findings, self._zeros.finding)
        self.base: tuple[Parameter, ...] = self._base_parameters()
        self._scales = self._find_scales()
        speeds = np.array([s for trial in prepared for s in _speeds(trial)])
        differ = speeds.max() > 1.05 * max(speeds.min(), 1e-12)
        retreats = self._retreats()
        self._library: Library = make_library(self._scales, retreats=retreats, speeds_differ=bool(differ), own=own)
        self.forms: tuple[Form, ...] = self._library.forms
        self.shapes: Mapping[str, tuple[Form, ...]] = self._library.shapes
        self._places = slot_places(own)
        self._whitening: dict[str, tuple[Array, Array, Array]] = {}
        self._shaken: dict[str, Shaken] = {}
        self._along: Mapping[str, Array] = {}
        self.rewhiten({}, ())

    # What is fitted ---------------------------------------------------------------------------------------------------

    def _base_parameters(self) -> tuple[Parameter, ...]:
        surface, doubt = self.tables.surface, self.tables.uncertainty
        guess_k, guess_c = max(surface.stiffness, 1e-9), max(surface.damping, 1e-9)
        found = []
        for diameter in self._diameters:
            for name, unit, value, relative, size in (
                ("stiffness", "N/m", surface.stiffness, doubt.stiffness, guess_k),
                ("damping", "N s/m", surface.damping, doubt.damping, guess_c),
            ):
                if relative == 0:
                    continue
                free = relative >= 1
                start = self._straight_stiffness(diameter) if free and name == "stiffness" else value
                if free and name == "damping":
                    size = max(size, 1e-3 * self._straight_stiffness(diameter))
                found.append(Parameter(
                    name=self._named(name, diameter), unit=unit, value=start,
                    std=math.inf if free else relative * value,
                    scale=max(0.02 * (start if name == "stiffness" else size), 1e-12), lowest=0.0,
                    step=1e-4 * max(start, size),
                ))  # fmt: skip
        return tuple(found)

    def _named(self, name: str, diameter: float) -> str:
        return name if len(self._diameters) == 1 else f"{name}@{diameter:g}"

    @property
    def scatter(self) -> dict[str, tuple[Parameter, ...]]:
        """What may differ between replicates beyond the sensors: kind -> one nuisance a trial, mostly not fitted.

        A factor on K and C, and one on C alone; of pushes where the depth is counted from, and what the force reads
        at none.
        """
        found = {kind: tuple(
            Parameter(name=f"{kind}[{id}]", unit="1", value=0.0, std=_BED_STD, scale=0.02, lowest=-0.95, highest=5.0,
                      trial=id, kind=kind, step=1e-4)
            for id in self._trials
        ) for kind in ("bed", "bed damping")}  # fmt: skip
        pushes = [id for id, trial in self._trials.items() if trial.driven]
        if not pushes:
            return found
        far = _ZERO_DEPTH * self._scales.depth
        noises = dict(zip(("depth zero", "force zero"), stds(self.tables, True), strict=True))
        ends = {"depth zero": far, "force zero": far * self._scales.force / self._scales.depth}
        return found | {kind: tuple(
            Parameter(name=f"{kind}[{id}]", unit=unit, value=0.0, std=ends[kind], scale=0.1 * max(ends[kind], 1e-12),
                      lowest=-2 * ends[kind], highest=2 * ends[kind], trial=id, kind=kind, step=1e-3 * ends[kind],
                      least=_LEAST_ZERO * noises[kind])
            for id in pushes
        ) for kind, unit in (("depth zero", "m"), ("force zero", "N"))}  # fmt: skip

    @property
    def known_std(self) -> dict[str, float]:
        """What differs from trial to trial as the readings themselves tell: kind -> std, in its unit."""
        return {"force zero": self._zeros.std} if self._zeros is not None else {}

    def explains(self, finding: Finding) -> bool:
        """Whether something odd about a recording is one of the zeros that are taken into account."""
        read = finding.channel == "force" and "above the surface" in finding.what
        return read and self._zeros is not None and self._zeros.usual(finding.trial)

    @property
    def rough(self) -> tuple[str, ...]:
        """Trials whose motion bounces: the likelihood is the rougher the longer they are."""
        return tuple(id for id, trial in self._trials.items() if not trial.driven)

    def _straight_stiffness(self, diameter: float) -> float:
        """F / z by least squares over the driven trials of this diameter; from the depth of drops where there is none.

        A drop from speed v to depth z without loss: K z^2 / 2 = m v^2 / 2 + m g z.
        """
        driven = [trial for trial in self._trials.values() if trial.driven and trial.diameter == diameter]
        below = [(t, t.has_other & (t.smooth.depth > 0)) for t in driven if t.smooth is not None]
        top = sum(float((t.smooth.depth * t.other)[rows].sum()) for t, rows in below if t.smooth is not None)
        down = sum(float((t.smooth.depth**2)[rows].sum()) for t, rows in below if t.smooth is not None)
        if down > 0 and top > 0:
            return top / down
        found = []
        for trial in self._trials.values():
            if not trial.driven and trial.diameter == diameter and trial.has_depth.any():
                z = max(float(trial.depth[trial.has_depth].max()), 1e-6)
                mass, speed = self.tables.spike.mass or 1.0, trial.table.speed or 0.0
                found.append(mass * (speed**2 + 2 * trial.table.gravity * z) / z**2)
        return float(np.median(found)) if found else max(self.tables.surface.stiffness, 1e-9)

    def _find_scales(self) -> Scales:
        depths = [float(_depths(trial).max()) for trial in self._trials.values()]
        depth = max(0.75 * max(depths), 1e-9)
        speed = max(max(_speeds(trial).max() for trial in self._trials.values()), 1e-9)
        stiffness = next((p.value for p in self.base if p.name == self._named("stiffness", self._middle)), None)
        stiffness = self.tables.surface.stiffness if stiffness is None else stiffness
        return Scales(depth=depth, speed=speed, force=max(stiffness, 1e-9) * depth)

    def _retreats(self) -> bool:
        for trial in self._trials.values():
            if not trial.driven:
                return True
            assert trial.smooth is not None
            back = np.maximum.accumulate(trial.smooth.depth) - trial.smooth.depth
            if back.max() > 0.02 * max(trial.smooth.depth.max(), 1e-12) + 5 * trial.smooth.depth_std.max():
                return True
        return False

    @property
    def design(self) -> str:
        """Digest of what decides the gate."""
        parts: list[Any] = [repr(self.tables.uncertainty), repr(self.tables.sensors), repr(self.tables.surface)]
        parts += [(t.info.condition, len(t.time), round(float(t.time[-1]), 3)) for t in self._trials.values()]
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]

    # The model --------------------------------------------------------------------------------------------------------

    def _numbers(self, values: Values, forms: Sequence[Form], trial: Prepared, into: Array) -> None:
        """Fill one lane's slots."""
        name_k, name_c = self._named("stiffness", trial.diameter), self._named("damping", trial.diameter)
        surface = self.tables.surface
        bed = 1.0 + values.get(f"bed[{trial.info.id}]", 0.0)
        stiffness = values.get(name_k, self._default(name_k, surface.stiffness)) * bed
        into[_SLOT["mass"]] = self.tables.spike.mass or 1.0
        into[_SLOT["gravity"]] = trial.table.gravity
        into[_SLOT["stiffness"]] = stiffness
        damper = 1.0 + values.get(f"bed damping[{trial.info.id}]", 0.0)
        into[_SLOT["damping"]] = values.get(name_c, self._default(name_c, surface.damping)) * bed * damper
        into[_SLOT["reference"]] = self._scales.depth
        into[_SLOT["radius_depth"]] = _tip_depth(self.tables.spike, trial.diameter)
        if trial.smooth is not None:
            into[_SLOT["shift_depth"]] = -values.get(f"depth zero[{trial.info.id}]", 0.0)
            fast = float(np.abs(trial.smooth.speed).max())
            into[_SLOT["speed_scale"]] = max(0.02 * fast, 2 * float(np.median(trial.smooth.speed_std)), 1e-12)
        size = trial.diameter / self._middle
        for form in forms:
            for parameter in form.parameters:
                value = values.get(parameter.name, parameter.value)
                slot = self._library.slots[form.id][parameter.name]
                into[self._places[slot.name]] = physical(slot, value, self._scales, stiffness=stiffness, size=size)

    def _file(self, form: Form) -> str | None:
        """Name of the file that an effect is from; None for the library's."""
        return next((effect.file.name for effect in self.own if effect.id == form.effect), None)

    def _default(self, name: str, stated: float) -> float:
        return next((parameter.value for parameter in self.base if parameter.name == name), stated)

    def _run(self, points: Sequence[Values], forms: Sequence[Form], trials: Sequence[Prepared],
             shifts: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> list[Array]:  # fmt: skip
        """Forces [points, n] of driven trials, or motions [points, n, 4] of drops; all trials of one mode."""
        count = len(points)
        # Effects from files are compiled in where one of them is on: another kernel.
        own = self.own if any(self._file(form) for form in forms) else ()
        numbers = slot_table(count * len(trials), own)
        lanes = np.repeat(np.arange(len(trials), dtype=np.int32), count)
        for place, trial in enumerate(trials):
            for k, values in enumerate(points):
                self._numbers(values, forms, trial, numbers[place * count + k])
        numbers[:, _SLOT["shift_depth"]] += shifts[0]
        numbers[:, _SLOT["shift_speed"]], numbers[:, _SLOT["shift_row"]] = shifts[1:]
        starts = np.cumsum([0, *(len(trial.time) for trial in trials)]).astype(np.int32)
        if trials[0].driven:
            depth = np.concatenate([trial.smooth.depth for trial in trials if trial.smooth is not None])
            speed = np.concatenate([trial.smooth.speed for trial in trials if trial.smooth is not None])
            out = push(numbers, lanes, starts, depth, speed, own)
            for place, trial in enumerate(trials):
                zeros = np.array([values.get(f"force zero[{trial.info.id}]", 0.0) for values in points])
                if zeros.any():
                    out[place * count : (place + 1) * count] += zeros[:, None]
        else:
            speeds = np.array([trial.table.speed or 0.0 for trial in trials])
            out = fall(numbers, lanes, starts, np.concatenate([trial.time for trial in trials]), speeds, own)
        return [out[p * count : (p + 1) * count, : len(trial.time)] for p, trial in enumerate(trials)]

    def _models(self, points: Sequence[Values], forms: Sequence[Form], ids: Sequence[str]) -> dict[str, Array]:
        found: dict[str, Array] = {}
        for driven in (True, False):
            chosen = [self._trials[id] for id in ids if self._trials[id].driven == driven]
            if chosen:
                for trial, out in zip(chosen, self._run(points, forms, chosen), strict=True):
                    found[trial.info.id] = out
        return found

    def evaluate(
        self, points: Sequence[Values], forms: Sequence[Form], trials: Sequence[str]
    ) -> list[dict[str, Array]]:
        """Whitened residuals; see `Problem`."""
        models = self._models(points, forms, trials)
        return [{id: self._residuals(self._trials[id], models[id][k]) for id in trials} for k in range(len(points))]

    def _residuals(self, trial: Prepared, model: Array) -> Array:
        if not trial.driven:
            rest, shaken = self._missed(trial, model), self._shaken.get(trial.info.id)
            return rest if shaken is None else shaken.whitened(rest)
        directions, shrink, doubtful = self._whitening[trial.info.id]
        rest = (trial.other - model)[trial.has_other] / stds(self.tables, True)[1] / doubtful
        rest = rest - directions @ (shrink * (directions.T @ rest)) if len(shrink) else rest
        return _bounded(rest)

    def _missed(self, trial: Prepared, model: Array) -> Array:
        """Measured less modelled over the stated noise, of a drop."""
        return _bounded(_of_drop(trial, trial.depth - model[:, 0], trial.other - model[:, 2], self.tables))

    def readings(self, values: Values, forms: Sequence[Form], trials: Sequence[str], late: float) -> dict[str, Array]:
        """What the model reads `late` seconds after each sample's time, over the stated noise, shape [sample_count]."""
        moved = [self._trials[id] for id in trials]
        found = {}
        for drops in (False, True):
            chosen = [replace(t, time=t.time + late) if drops else t for t in moved if t.driven != drops]
            for trial, out in zip(chosen, self._run([values], forms, chosen) if chosen else (), strict=True):
                if drops:
                    found[trial.info.id] = _of_drop(trial, out[0][:, 0], out[0][:, 2], self.tables)
                else:  # along the path as it was smoothed
                    force = np.interp(trial.time[trial.has_other] + late, trial.time, out[0])
                    found[trial.info.id] = force / stds(self.tables, True)[1]
        return found

    def shake(self, along: Mapping[str, Array]) -> None:
        """Take times that jitter into the whitening from now on (of driven trials: from the next `rewhiten` on).

        `along`: what one standard deviation of jitter changes in each sample, over its stated noise, by trial; {} for
        times as they stand.
        """
        self._along = dict(along)
        self._shaken = {}
        for id, own in along.items():
            trial = self._trials[id]
            if not trial.driven and own.any():
                row = np.concatenate([np.flatnonzero(trial.has_depth), np.flatnonzero(trial.has_other)])
                self._shaken[id] = Shaken.of(own, row, np.zeros((len(own), 0)))

    def calm(self, weights: Mapping[str, Array]) -> None:
        """Weigh modes so from now on (`Whitener.white`): what replicates differ by counts as noise; {}: as they are."""
        self.calmed = dict(weights)

    def rewhiten(self, values: Values, forms: Sequence[Form]) -> None:
        """Take the error of the smoothed depth into the whitening, at these values."""
        driven = [trial for trial in self._trials.values() if trial.driven]
        if not driven:
            return
        std_force = stds(self.tables, True)[1]
        for trial, by_depth, by_row, by_speed in self._slopes(values, forms, driven):
            assert trial.smooth is not None
            smooth = trial.smooth
            factor = _by_depth(smooth, by_depth, by_row) + by_speed[:, None] * smooth.speed_error
            if self._zeros is not None:
                factor = np.column_stack([factor, np.full(len(factor), self._zeros.std)])
            # Where the error may cross the surface or the turning point, the force is no linear function of it.
            bend = np.abs(by_speed).max() * smooth.speed_std * (np.abs(smooth.speed) < 3 * smooth.speed_std)
            jump = float(np.abs(by_speed).max() * np.abs(smooth.speed).max())
            # An effect may begin with a jump at the surface: as large as the force is measured to be just below it.
            depth_here = np.maximum(8 * smooth.depth_std, _SHALLOW * self._scales.depth)
            shallow = (smooth.depth > 0) & (smooth.depth < depth_here)
            shallow &= trial.has_other
            below = float(np.median(np.abs(trial.other[shallow]))) if shallow.any() else 0.0
            start = max(jump, below) + np.abs(by_depth).max() * smooth.depth_std
            touch = start * _touching(trial)
            rows = trial.has_other
            turn = _turning(smooth.speed[rows], smooth.speed_std[rows], trial.other[rows], std_force)
            shaken = self._along.get(trial.info.id, 0.0)
            doubtful = np.sqrt(1 + ((bend**2 + touch**2)[rows] + turn**2) / std_force**2 + shaken**2)
            left, sizes, _ = np.linalg.svd(factor[rows] / std_force / doubtful[:, None], full_matrices=False)
            kept = sizes > 1e-3
            self._whitening[trial.info.id] = (left[:, kept], 1 - 1 / np.sqrt(1 + sizes[kept] ** 2), doubtful)

    def _slopes(
        self, values: Values, forms: Sequence[Form], driven: list[Prepared]
    ) -> list[tuple[Prepared, Array, Array, Array]]:
        """By central differences along each path: dF/dz [N/m] where all of the path is moved, where each row is moved
        alone (what the bed remembers stays as deep as it was), and dF/dv [N s/m]."""
        dz, dv = 1e-4 * self._scales.depth, 1e-4 * self._scales.speed
        ways = [(dz, 0.0, 0.0), (0.0, dv, 0.0), *([(0.0, 0.0, dz)] if forms else [])]
        sides = [[self._run([values], forms, driven, (s * a, s * b, s * c)) for s in (1, -1)] for a, b, c in ways]
        found = []
        for place, trial in enumerate(driven):
            apart = [up[place][0] - down[place][0] for up, down in sides]
            whole, fast, alone = apart[0], apart[1], apart[-1] if forms else apart[0]
            # a shift of the path may cross the surface: the force there is no slope
            by_depth, by_row = (
                np.clip(one, -most, most) / (2 * dz)
                for one, most in ((one, 20 * np.median(np.abs(one)) + 1e-12) for one in (whole, alone))
            )
            found.append((trial, by_depth, by_row, fast / (2 * dv)))
        return found

    def chi_square(self, values: Values, forms: Sequence[Form], trial: str) -> tuple[float, int]:
        """The sum of docs/diagnose.md; see `Problem`."""
        this = self._trials[trial]
        if not this.driven:
            missed = self._missed(this, self._run([values], forms, [this])[0][0])
            return float(missed @ missed), len(missed)
        force = self._run([values], forms, [this])[0][0]
        rest = (this.other - force)[this.has_other] / self.gap_std(values, forms, trial)
        return float(rest @ rest), len(rest)

    def gap_std(self, values: Values, forms: Sequence[Form], trial: str) -> Array:
        """Of each reading of a driven trial's force, as docs/diagnose.md has it for the gap [N], shape [n]."""
        this = self._trials[trial]
        assert this.smooth is not None
        ((_, by_depth, by_row, _),) = self._slopes(values, forms, [this])
        doubt = np.linalg.norm(_by_depth(this.smooth, by_depth, by_row), axis=1) / this.smooth.inflation
        touch = _touching(this)
        if touch.any():  # the force begins with a jump: half of what it may be over what the depth leaves open
            most = float(_off_surface(this)[touch].max())
            deep, shallow = (self._run([values], forms, [this], (shift, 0.0, 0.0))[0][0] for shift in (most, -most))
            doubt = np.where(touch, np.maximum(doubt, 0.5 * np.abs(deep - shallow)), doubt)
        turn = _reversing(this)
        if turn.any():  # and so it does where the direction of motion is another, which friction goes with
            most = float(np.maximum(_off_rest(this), np.abs(this.smooth.speed))[turn].max())
            fast, slow = (self._run([values], forms, [this], (0.0, shift, 0.0))[0][0] for shift in (most, -most))
            doubt = np.where(turn, np.maximum(doubt, 0.5 * np.abs(fast - slow)), doubt)
        return np.hypot(stds(self.tables, True)[1], doubt[this.has_other])

    # What is seen -----------------------------------------------------------------------------------------------------

    def samples(self, trial: str) -> Samples:
        """See `Problem`."""
        this = self._trials[trial]
        std_depth, std_other = stds(self.tables, this.driven)
        if this.driven:
            time = this.time[this.has_other]
            return Samples(time=time, channel=np.full(len(time), "force"), std=np.full(len(time), std_other))
        first, second = this.time[this.has_depth], this.time[this.has_other]
        return Samples(
            time=np.concatenate([first, second]),
            channel=np.concatenate([np.full(len(first), "depth"), np.full(len(second), "accel")]),
            std=np.concatenate([np.full(len(first), std_depth), np.full(len(second), std_other)]),
        )

    def noise(self, random: np.random.Generator, trial: str) -> Array:
        """Standard normal: the whitening has taken the depth's error in."""
        this = self._trials[trial]
        return random.standard_normal(int(this.has_other.sum()) + (0 if this.driven else int(this.has_depth.sum())))

    def _state(self, values: Values, forms: Sequence[Form], trial: str) -> tuple[Array, Array, NDArray[np.str_], Array]:
        """Depth, speed, phase, and model's force or motion at every row."""
        this = self._trials[trial]
        model = self._run([values], forms, [this])[0][0]
        if this.smooth is None:
            names = np.array(PHASES)[np.clip(model[:, 3].astype(int), 0, 3)]
            return model[:, 0], model[:, 1], names, model
        depth, speed = this.smooth.depth, this.smooth.speed
        slow = max(0.02 * float(np.abs(speed).max()), 3 * float(np.median(this.smooth.speed_std)))
        names = np.where(speed > slow, "in", np.where(speed < -slow, "out", "rest"))
        return depth, speed, np.where(depth <= 0, "free", names), model

    def phases(self, values: Values, forms: Sequence[Form], trial: str) -> NDArray[np.str_]:
        """See `Problem`."""
        this = self._trials[trial]
        names = self._state(values, forms, trial)[2]
        force = names[this.has_other]
        return force if this.driven else np.concatenate([names[this.has_depth], force])

    def reported(self, values: Values, form: Form) -> dict[str, tuple[float, str]]:
        """Forces and lengths of the campaign's middle diameter in SI units; exponents and shares as they are."""
        name = self._named("stiffness", self._middle)
        stiffness = values.get(name, self._default(name, self.tables.surface.stiffness))
        found = {}
        for parameter in form.parameters:
            slot = self._library.slots[form.id][parameter.name]
            value = physical(
                slot, values.get(parameter.name, parameter.value), self._scales, stiffness=stiffness, size=1.0
            )
            found[_last(slot.name)] = (float(value), unit_of(slot))
        return found

    def latent(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, Array]:
        """The force [N] that the model lacks; of a drop m (g - a) over the model's, at the accelerometer's rows, or
        from its depth where it has none."""
        this = self._trials[trial]
        depth, speed, _, model = self._state(values, forms, trial)
        rows = this.has_other
        if this.driven:
            missing = this.other - model
        else:
            behind = this.other - model[:, 2]
            if not rows.any():
                rows, behind = this.has_depth, np.zeros(len(this.time))
                behind[rows] = acceleration(this.time[rows], (this.depth - model[:, 0])[rows])
            missing = -(self.tables.spike.mass or 1.0) * behind
        deepest = np.maximum.accumulate(np.maximum(depth, 0.0))
        columns = {"t_s": this.time, "latent_force_N": missing, "depth_m": depth, "velocity_m_s": speed,
                   "retreat_m": deepest - depth}  # fmt: skip
        return {name: np.asarray(column)[rows] for name, column in columns.items()}

    def compare(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, dict[str, Array]]:
        """See `Problem`."""
        this = self._trials[trial]
        _, _, _, model = self._state(values, forms, trial)
        if this.smooth is not None:
            columns = {"t_s": this.time, "measured": this.other, "model": model, "depth_m": this.smooth.depth}
            return {"force": {name: column[this.has_other] for name, column in columns.items()}}
        return {
            name: {"t_s": this.time[rows], "measured": measured[rows], "model": model[rows, column]}
            for name, measured, rows, column in (
                ("depth", this.depth, this.has_depth, 0), ("accel", this.other, this.has_other, 2),
            )
            if rows.any()  # a sensor that this trial lacks is none of its channels
        }  # fmt: skip

    # What is written --------------------------------------------------------------------------------------------------

    def write_model(self, path: str, values: Values, forms: Sequence[Form]) -> None:
        """model.toml. The slots of `penetration_law` are the parameters of an effect; where trials have several
        diameters the middle one's K and C stand in [surface], all of them in [notes]."""
        pairs = {
            f"{diameter:g}": {
                name: float(values.get(self._named(name, diameter), self._default(self._named(name, diameter), stated)))
                for name, stated in (
                    ("stiffness", self.tables.surface.stiffness), ("damping", self.tables.surface.damping),
                )
            }
            for diameter in self._diameters
        }  # fmt: skip
        own = pairs[f"{self._middle:g}"]
        notes: dict[str, Any] = dict(self.tables.notes)
        if len(pairs) > 1:
            notes["fitted_by_diameter"] = pairs
        effects = tuple(
            EffectTable(id=form.effect, parameters={
                **({} if self._file(form) else {"reference": self._scales.depth}),
                **{name: value for name, (value, _) in self.reported(values, form).items()},
            }, file=self._file(form))
            for form in forms
        )  # fmt: skip
        tables = {
            name: getattr(self.tables, name) for name in ("format", "kind", "name", "spike", "uncertainty", "sensors")
        }
        surface = self.tables.surface.model_copy(update=own)
        model = PenetrationModel(**tables, surface=surface, notes=notes, trial=self.tables.trial, effect=effects)
        write_model(Path(path), model)

    def remarks(self, values: Values, forms: Sequence[Form]) -> list[str]:
        """Sentences on K, its spread, and whether C can be told, where it was not known beforehand; none with drops."""
        if self.tables.uncertainty.damping < 1 or not all(trial.driven for trial in self._trials.values()):
            return []
        still = {**values, **{self._named("damping", diameter): 0.0 for diameter in self._diameters}}
        pushes = [
            Push(trial.diameter, *(column[trial.has_other] for column in (
                trial.smooth.depth, trial.smooth.speed, trial.other, self._run([still], forms, [trial])[0][0])))
            for trial in self._trials.values() if trial.smooth is not None
        ]  # fmt: skip
        return remarks(pushes, tuple(dict.fromkeys(form.effect for form in forms)))

    def next_experiment(self, first: Form, second: Form, values: Values) -> str:
        """See `Problem`."""
        pair = frozenset((first.effect, second.effect))
        for names, sentence in _TELLING.items():
            if pair == names:
                return sentence
        return (
            f"Drive the spike in and out at two speeds a factor of ten apart, to twice the depth reached here: "
            f"{first.effect} and {second.effect} part where speed, direction and depth change one at a time."
        )


def _by_depth(smooth: SmoothDepth, by_depth: Array, by_row: Array) -> Array:
    """What the error of a smoothed depth makes of the force [N], shape [n, error_count].

    A force on the way back goes with two depths, where the spike is and how deep it has been, whose errors are not one:
    a crater that is steep on the way out sees their difference.
    """
    deepest = np.maximum.accumulate(np.where(smooth.depth >= np.maximum.accumulate(smooth.depth),
                                             np.arange(len(smooth.depth)), 0))  # fmt: skip
    far = (by_depth - by_row)[:, None] * smooth.depth_error[deepest]
    return by_row[:, None] * smooth.depth_error + far


def _touching(trial: Prepared) -> NDArray[np.bool_]:
    """Rows of a driven trial that may lie on either side of the surface."""
    assert trial.smooth is not None
    return np.abs(trial.smooth.depth) < _off_surface(trial)


def _off_surface(trial: Prepared) -> Array:
    """How far from the surface [m] a row may be and yet lie on its other side: the depth's error, and the way of one
    row, since depth and force are not read at one and the same instant."""
    assert trial.smooth is not None
    smooth = trial.smooth
    return 3 * smooth.depth_std + np.abs(smooth.speed) * np.gradient(trial.time)


def _off_rest(trial: Prepared) -> Array:
    """How far from rest [m/s] a row may be and yet move the other way: the speed's error, and what it changes by within
    a row."""
    assert trial.smooth is not None
    return 3 * trial.smooth.speed_std + np.abs(np.gradient(trial.smooth.speed))


def _reversing(trial: Prepared) -> NDArray[np.bool_]:
    """The few rows at which a driven spike may already come back or still go on; none of those where it is held."""
    assert trial.smooth is not None
    speed, off = trial.smooth.speed, _off_rest(trial)
    found = np.zeros(len(speed), dtype=bool)
    unsure = np.concatenate([[0], (np.abs(speed) < off).astype(int), [0]])
    edges = np.flatnonzero(np.diff(unsure))
    for low, high in zip(edges[::2], edges[1::2], strict=True):
        low, high = max(0, int(low) - 1), min(len(speed) - 1, int(high))
        if high - low <= _AT_TURN and speed[low] * speed[high] < 0:
            found[low + 1 : high] = True
    for k in np.flatnonzero(speed[1:] * speed[:-1] < 0):  # between two rows, neither of which is in doubt
        found[k + int(abs(speed[k + 1]) < abs(speed[k]))] = True
    return found


def _turning(speed: Array, std: Array, force: Array, noise: float) -> Array:
    """How far the force is in doubt where the direction of motion is: by its jump from before to after [N].

    Dry friction changes sign where a spike turns; the smoothed depth tells when to within some rows only.
    """
    doubt = np.zeros(len(speed))
    unsure = np.concatenate([[0], (np.abs(speed) < 3 * std).astype(int), [0]])
    edges = np.flatnonzero(np.diff(unsure))
    for low, high in zip(edges[::2], edges[1::2], strict=True):
        before, after = force[max(0, low - _BESIDE) : low], force[high : high + _BESIDE]
        if len(before) < _BESIDE or len(after) < _BESIDE:
            continue
        jump = abs(float(np.median(after) - np.median(before)))
        if jump > 3 * noise:
            doubt[max(0, low - 1) : high + 1] = jump
    return doubt


def _last(name: str) -> str:
    return name.rpartition(".")[2]


_TELLING: Mapping[frozenset[str], str] = {
    frozenset(("depth-hardening", "layering")): "Push once, slowly, to twice the depth in this bed and once in a bed "
    "prepared anew: hardening goes on smoothly, a layer stays at its depth.",
    frozenset(
        ("inertial-drag", "shaft-friction")
    ): "Push to one depth at a tenth of the speed and at the full one: drag falls to a hundredth, friction stays.",
    frozenset(
        ("adhesion", "plastic-sinkage")
    ): "Retreat slowly and look at the force after it has passed zero: adhesion "
    "pulls (a negative force), a crater leaves exactly none.",
    frozenset(
        ("adhesion", "shaft-friction")
    ): "Stop half-way in for a second and go on: friction falls and comes back on "
    "the way in too, adhesion shows on the way out only.",
    frozenset(
        ("plastic-sinkage", "shaft-friction")
    ): "Retreat by a tenth of the depth and push in again: along a crater's "
    "curve the force returns the same way, friction changes sign at once.",
    frozenset(("depth-hardening", "shaft-friction")): "Push in and retreat slowly: friction changes sign, hardening "
    "does not.",
    frozenset(("depth-hardening", "inertial-drag")): "Push to one depth at a tenth of the speed: hardening stays.",
    frozenset(("inertial-drag", "layering")): "Push to one depth at a tenth of the speed: a layer stays.",
    frozenset(("inertial-drag", "plastic-sinkage")): "Push in slowly and retreat: a crater shows at any speed.",
}


def _tip_depth(spike: Any, diameter: float) -> float:
    """Depth at which the tip is wholly in [m]."""
    if spike.tip == "sphere":
        return 0.5 * diameter
    if spike.tip == "cone":
        return 0.5 * diameter / math.tan(math.radians(spike.cone_angle) / 2)
    return 1e-4 * diameter


def _depths(trial: Prepared) -> Array:
    return trial.smooth.depth if trial.smooth is not None else trial.depth[trial.has_depth]


def _speeds(trial: Prepared) -> Array:
    if trial.smooth is None:
        return np.array([0.0, trial.table.speed or 0.0])
    inside = trial.smooth.depth > 0
    fast = trial.smooth.speed[inside] if inside.any() else trial.smooth.speed
    return np.percentile(np.maximum(fast, 0.0), [20, 90])


def _of_drop(trial: Prepared, depth: Array, acceleration: Array, tables: PenetrationCampaign) -> Array:
    """Columns of all rows as samples, over the stated noise."""
    std_depth, std_other = stds(tables, False)
    return np.concatenate([depth[trial.has_depth] / std_depth, acceleration[trial.has_other] / std_other])


def _bounded(rest: Array) -> Array:
    return np.where(np.isfinite(rest), np.clip(rest, -1e5, 1e5), _FAILED)
