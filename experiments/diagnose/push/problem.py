"""Trials of a spike that goes straight down, as the statistics of diagnose see them (`problem.Problem`).

Driven trials are scored on their force along the smoothed depth. The error of that depth is one smooth curve, not white
noise, so the likelihood takes its covariance in full: force noise plus (dF/dz, dF/dv) times the error of depth and
speed; `chi_square` has the sum of docs/diagnose.md, std_force^2 + (dF/dz s)^2. Drops are integrated from their exact
start and scored on depth and acceleration.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.campaign import Campaign, EffectTable, PenetrationCampaign, write_model
from experiments.campaign.tables import SURFACE
from experiments.diagnose.core.effect_texts import push_advice
from experiments.diagnose.fit.forms import PENETRATION_HOOKS, OwnEffect, shapes_of
from experiments.diagnose.fit.localise import acceleration
from experiments.diagnose.fit.problem import Array, Estimate, Finding, Form, Problem, Values
from experiments.diagnose.fit.trials import Planned, Samples, TrialInfo
from experiments.diagnose.noise.jitter import Shaken

from .beds import OWN, centred, in_one_bed, own_numbers, scatter_parameters
from .data import Prepared, of_drop, prepare, stds, tip_depth
from .depth import SmoothDepth
from .design import best_push
from .doubt import bounded, jumping, path_error, turning, with_jumps
from .forms import physical, push_forms, unit_of
from .law import PHASES, fall, push_each
from .model_file import Pairs, model_of, range_of
from .parameters import base_parameters, comes_back, diameters_of, find_scales, loose_surface, named, speeds_of
from .remarks import SURE, Push, at_one_speed, contradict, facts, highest_dampings, how_to_determine
from .slots import PLACES, slot_places, slot_table
from .stops import doubts_of_damping
from .zeros import find_force_zeros

__all__ = ["PenetrationProblem", "make_problem"]

Asked = Sequence[tuple[Sequence[Values], Sequence[Form]]]  # points, and the forms that they are points of
_SHALLOW = 0.02  # share of D that counts as just below the surface


def make_problem(
    campaign: Campaign, *, own: Sequence[OwnEffect] = (), frame: float | None = None
) -> PenetrationProblem:  # fmt: skip
    """The problem of a campaign of kind "penetration", `own` among its candidates. `frame`: stiffness [N/m] that was
    subtracted from its depths (`at_the_tip`), noted in `covered`. Raises ValueError where none of its trials can be
    used, or an effect acts where a single spike has nothing."""
    return PenetrationProblem(campaign, own=own, frame=frame)


class PenetrationProblem(Problem):
    """One campaign of penetration."""

    kind = "penetration"
    counted_as = "pushes"
    whole = "the bed or the tip"
    clocks = (("force",), ("depth", "accel"))
    by_path = True
    loose = SURFACE
    hidden_scatter = ("bed damping", "bed unloading")  # near to what a speed does, and to what a depth does
    zero_scatter = ("bed", "depth zero")  # at one speed a damper and a depth's zero are the same
    force_scatter = ("force zero",)  # of pushes that begin at the surface, where no row reads it
    lone_scatter = (("bed", "depth zero"), ("bed", "bed damping"), ("force zero",))  # K may differ, and not C
    own_base = "diameter_m"
    special_scatter = ("depth zero", "force zero")

    def __init__(self, campaign: Campaign, *, own: Sequence[OwnEffect] = (), frame: float | None = None) -> None:
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
        self.granular = tables.surface.granular
        prepared, findings = prepare(campaign)
        self.prepared: dict[str, Prepared] = {trial.info.id: trial for trial in prepared}
        self.findings: tuple[Finding, ...] = tuple(findings)
        self.trials: tuple[TrialInfo, ...] = tuple(trial.info for trial in prepared)
        self._diameters = diameters_of(prepared)
        self._middle = self._diameters[len(self._diameters) // 2]
        driven = any(trial.driven for trial in prepared)
        self._zeros = find_force_zeros(prepared, stds(tables, True)[1]) if driven else None
        if self._zeros is not None:
            self.findings = (*self.findings, self._zeros.finding)
            self.known_std = {"force zero": self._zeros.std}
        base = base_parameters(tables, prepared)
        self._scales = find_scales(tables, prepared, base)
        self.base = (*base, loose_surface(self._scales.depth))
        self.rough = tuple(trial.info.id for trial in prepared if not trial.driven)
        self.scatter = scatter_parameters(tables, prepared, self._scales)
        parts: list[object] = [repr(tables.uncertainty), repr(tables.sensors), repr(tables.surface)]
        parts += [(t.info.condition, len(t.time), round(float(t.time[-1]), 3)) for t in prepared]
        self.design = hashlib.sha256(repr(parts).encode()).hexdigest()[:16]
        self.covered, self.typical_depth = range_of(prepared, frame), self._scales.depth
        self.how_to_determine = how_to_determine(self.covered.get("speed_m_s", ()))
        speeds = [float(speed) for trial in prepared for speed in speeds_of(trial)]
        self.forms = push_forms(
            retreats=comes_back(prepared), drops=bool(self.rough), own=own,
            speeds_differ=max(speeds) > 1.05 * max(min(speeds), 1e-12),
        )  # fmt: skip
        self.shapes = shapes_of(self.forms, again=True)
        self._places = slot_places(own)
        self._whitening: dict[str, tuple[Array, Array, Array]] = {}
        self._shaken: dict[str, Shaken] = {}
        self._along: Mapping[str, Array] = {}
        self.rewhiten({}, ())

    def explains(self, finding: Finding) -> bool:
        """Whether something odd about a recording is one of the zeros that are taken into account."""
        read = finding.channel == "force" and "above the surface" in finding.what
        return read and self._zeros is not None and self._zeros.usual(finding.trial)

    def _fill(self, trials: Sequence[Prepared], asked: Asked, into: Array) -> None:
        """Fill the slots of lanes, shape [trials, points, slot_count]; points in the order of `asked`."""
        for trial, lanes in zip(trials, into, strict=True):
            lanes[:, PLACES["mass"]] = self.tables.spike.mass or 1.0
            lanes[:, PLACES["gravity"]] = trial.table.gravity
            lanes[:, PLACES["radius_depth"]] = tip_depth(self.tables.spike, trial.diameter)
            if trial.smooth is not None:
                lanes[:, PLACES["speed_scale"]] = trial.smooth.slow
        into[..., PLACES["reference"]] = self._scales.depth
        every = [values for points, _ in asked for values in points]
        given = set[str]().union(*every)
        bed, damper, unloading, zero = (own_numbers(every, kind, trials, given) for kind in OWN)
        k, c = (self._of_each(every, which, trials) for which in ("stiffness", "damping"))
        into[..., PLACES["stiffness"]] = stiffness = k * (1.0 + bed)
        into[..., PLACES["damping"]] = c * (1.0 + bed) * (1.0 + damper)
        into[..., PLACES["unload_change"]] = unloading
        into[..., PLACES["given_way"]] = [values.get(SURFACE, 0.0) for values in every]
        if trials[0].driven:
            into[..., PLACES["shift_depth"]] = -zero
        sizes, start = np.array([[trial.diameter / self._middle] for trial in trials]), 0
        for points, forms in asked:
            rows = slice(start, start := start + len(points))
            for parameter, slot in [(p, form.slots[p.name]) for form in forms for p in form.parameters]:
                value = np.array([values.get(parameter.name, parameter.value) for values in points])
                found = physical(slot, value, self._scales, stiffness=stiffness[:, rows], size=sizes)
                into[:, rows, self._places[slot.name]] = found

    def _of_each(self, points: Sequence[Values], which: str, trials: Sequence[Prepared]) -> Array:
        """K or C of each trial at each point, without its bed, shape [trials, points]."""
        found: dict[float, Array] = {}
        for diameter in {trial.diameter for trial in trials}:
            name, stated = self._stated(which, diameter)
            found[diameter] = np.array([values.get(name, stated) for values in points])
        return np.stack([found[trial.diameter] for trial in trials])

    def _file(self, form: Form) -> str | None:
        """Name of the file that an effect is from; None for the library's."""
        return next((effect.file.name for effect in self.own if effect.id == form.effect), None)

    def _hasown_numbers(self, forms: Sequence[Form]) -> bool:
        """Whether one of the effects is from a file."""
        return bool(self.own) and any(self._file(form) for form in forms)

    def _number(self, values: Values, which: str, diameter: float) -> float:
        """K or C, ``stiffness`` or ``damping``, of a diameter."""
        return values.get(*self._stated(which, diameter))

    def _stated(self, which: str, diameter: float) -> tuple[str, float]:
        """The parameter that is K or C of a diameter, and its value where none is given."""
        name, surface = named(which, diameter, self._diameters), self.tables.surface
        stated = surface.stiffness if which == "stiffness" else surface.damping
        return name, next((parameter.value for parameter in self.base if parameter.name == name), stated)

    def _run(self, points: Sequence[Values], forms: Sequence[Form], trials: Sequence[Prepared],
             shifts: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> list[Array]:  # fmt: skip
        """Forces [points, n] of driven trials, or motions [points, n, 4] of drops; all trials of one mode."""
        return self._run_each([(points, forms)], trials, shifts)

    def _run_each(self, asked: Asked, trials: Sequence[Prepared],
                  shifts: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> list[Array]:  # fmt: skip
        """The same of points that have forms of their own, all or none of them from files; one after another."""
        count = sum(len(points) for points, _ in asked)
        # Effects from files are compiled in where one of them is on: another kernel.
        own = self.own if self._hasown_numbers(asked[0][1]) else ()
        numbers = slot_table(count * len(trials), own)
        self._fill(trials, asked, numbers.reshape(len(trials), count, -1))
        numbers[:, PLACES["shift_depth"]] += shifts[0]
        numbers[:, PLACES["shift_speed"]], numbers[:, PLACES["shift_row"]] = shifts[1:]
        starts = np.cumsum([0, *(len(trial.time) for trial in trials)]).astype(np.int32)
        if trials[0].driven:
            depth, speed = (np.concatenate([getattr(t.path, name) for t in trials]) for name in ("depth", "speed"))
            forces = push_each(numbers, starts, depth, speed, own, np.concatenate([trial.time for trial in trials]))
            every = [values for points, _ in asked for values in points]
            zeros = own_numbers(every, "force zero", trials, set[str]().union(*every))
            return [one + zero[:, None] if zero.any() else one for one, zero in zip(forces, zeros, strict=True)]
        lanes = np.repeat(np.arange(len(trials), dtype=np.int32), count)
        speeds = np.array([trial.table.speed or 0.0 for trial in trials])
        out = fall(numbers, lanes, starts, np.concatenate([trial.time for trial in trials]), speeds, own)
        return [out[p * count : (p + 1) * count, : len(trial.time)] for p, trial in enumerate(trials)]

    def evaluate_together(
        self, asked: Asked, trials: Sequence[str], share: float = 1.0
    ) -> list[list[dict[str, Array]]]:
        """Whitened residuals, of all of their time."""
        found: list[list[dict[str, Array]]] = [[] for _ in asked]
        for own in (False, True):
            mine = [k for k, (points, forms) in enumerate(asked) if points and self._hasown_numbers(forms) == own]
            residuals: dict[str, Array] = {}
            for driven in (True, False):
                chosen = [self.prepared[id] for id in trials if self.prepared[id].driven == driven]
                if chosen and mine:
                    made = self._run_each([asked[k] for k in mine], chosen)
                    residuals |= {t.info.id: self._residuals(t, one) for t, one in zip(chosen, made, strict=True)}
            rest = iter([dict(zip(residuals, rows, strict=True)) for rows in zip(*residuals.values(), strict=True)])
            for k in mine:
                found[k] = [next(rest) for _ in asked[k][0]]
        return found

    def _residuals(self, trial: Prepared, model: Array) -> Array:
        """Of a trial at all points, shape [points, sample_count]; `model`: as `_run` has it."""
        if not trial.driven:
            shaken = self._shaken.get(trial.info.id)
            missed = [self._missed(trial, one) for one in model]
            return np.stack(missed if shaken is None else [shaken.whitened(rest) for rest in missed])
        directions, shrunk, noise = self._whitening[trial.info.id]
        rest = trial.other - model if trial.has_other.all() else (trial.other - model)[:, trial.has_other]
        rest /= noise
        if len(directions.T):
            rest -= np.stack([(one @ directions) @ shrunk for one in rest])  # each alone: the same bits beside others
        return bounded(rest)

    def _missed(self, trial: Prepared, model: Array) -> Array:
        """Measured less modelled over the stated noise, of a drop."""
        return bounded(of_drop(trial, trial.depth - model[:, 0], trial.other - model[:, 2], self.tables))

    def readings(self, values: Values, forms: Sequence[Form], trials: Sequence[str], late: float) -> dict[str, Array]:
        """What the model reads `late` seconds after each sample's time, over the stated noise, shape [sample_count]."""
        moved = [self.prepared[id] for id in trials]
        found = {}
        for drops in (False, True):
            chosen = [replace(t, time=t.time + late) if drops else t for t in moved if t.driven != drops]
            for trial, out in zip(chosen, self._run([values], forms, chosen) if chosen else (), strict=True):
                if drops:
                    found[trial.info.id] = of_drop(trial, out[0][:, 0], out[0][:, 2], self.tables)
                else:  # along the path as it was smoothed
                    force = np.interp(trial.time[trial.has_other] + late, trial.time, out[0])
                    found[trial.info.id] = force / stds(self.tables, True)[1]
        return found

    def centred(self, values: Values, forms: Sequence[Form]) -> dict[str, float]:
        """See `Problem`: of beds."""
        return centred(values, list(self.prepared.values()), forms)

    def shake(self, along: Mapping[str, Array]) -> None:
        """See `Problem`; of driven trials from the next `rewhiten` on."""
        self._along = dict(along)
        self._shaken = {}
        for id, own in along.items():
            trial = self.prepared[id]
            if not trial.driven and own.any():
                row = np.concatenate([np.flatnonzero(trial.has_depth), np.flatnonzero(trial.has_other)])
                self._shaken[id] = Shaken.of(own, row, np.zeros((len(own), 0)))

    def rewhiten(self, values: Values, forms: Sequence[Form]) -> None:
        """Take the error of the smoothed depth into the whitening, at these values."""
        driven = [trial for trial in self.prepared.values() if trial.driven]
        std_force = stds(self.tables, True)[1] if driven else 0.0
        for trial, by_depth, by_row, by_speed in self._slopes(values, forms, driven) if driven else ():
            smooth = trial.path
            factor = path_error(smooth, by_depth, by_row) + by_speed[:, None] * smooth.speed_error
            if self._zeros is not None:
                factor = np.column_stack([factor, np.full(len(factor), self._zeros.std)])
            jumps = jumping(trial, by_depth, by_speed, _SHALLOW * self._scales.depth)
            rows = trial.has_other
            turn, held = turning(smooth.speed[rows], smooth.speed_std[rows], trial.other[rows], std_force)
            shaken = self._along.get(trial.info.id, 0.0)
            doubtful = np.sqrt(1 + (jumps[rows] + turn**2) / std_force**2 + shaken**2)
            factor = np.column_stack([factor[rows], held]) / std_force / doubtful[:, None]
            left, sizes, _ = np.linalg.svd(factor, full_matrices=False)
            kept = sizes > 1e-3
            left, shrink = left[:, kept], 1 - 1 / np.sqrt(1 + sizes[kept] ** 2)
            self._whitening[trial.info.id] = (left, shrink[:, None] * left.T, std_force * doubtful)

    def _slopes(
        self, values: Values, forms: Sequence[Form], driven: list[Prepared]
    ) -> list[tuple[Prepared, Array, Array, Array]]:
        """By central differences: dF/dz [N/m] of the whole path moved, of each row moved alone, and dF/dv [N s/m]."""
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
        this = self.prepared[trial]
        model = self._run([values], forms, [this])[0][0]
        if this.driven:
            rest = (this.other - model)[this.has_other] / self.gap_std(values, forms, trial)
        else:
            rest = self._missed(this, model)
        return float(rest @ rest), len(rest)

    def sensor_std(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, Array]:
        """As stated; of a driven force with the error of its depth."""
        found = super().sensor_std(values, forms, trial)
        return found | {"force": self.gap_std(values, forms, trial)} if "force" in found else found

    def gap_std(self, values: Values, forms: Sequence[Form], trial: str) -> Array:
        """Of each reading of a driven trial's force, as docs/diagnose.md has it for the gap [N], shape [n]."""
        this = self.prepared[trial]
        ((_, by_depth, by_row, _),) = self._slopes(values, forms, [this])
        doubt = np.linalg.norm(path_error(this.path, by_depth, by_row), axis=1) / this.path.inflation
        doubt = with_jumps(this, doubt, lambda shift: self._run([values], forms, [this], shift)[0][0])
        return np.hypot(stds(self.tables, True)[1], doubt[this.has_other])

    def samples(self, trial: str) -> Samples:
        """See `Problem`."""
        this = self.prepared[trial]
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

    def _state(self, values: Values, forms: Sequence[Form], trial: str) -> tuple[Array, Array, NDArray[np.str_], Array]:
        """Depth, speed, phase, and model's force or motion at every row."""
        this = self.prepared[trial]
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
        this = self.prepared[trial]
        names = self._state(values, forms, trial)[2]
        force = names[this.has_other]
        return force if this.driven else np.concatenate([names[this.has_depth], force])

    def reported(self, values: Values, form: Form) -> dict[str, tuple[float, str]]:
        """Forces and lengths of the campaign's middle diameter in SI units; exponents and shares as they are."""
        stiffness = self._number(values, "stiffness", self._middle)
        found = {}
        for p in form.parameters:
            slot = form.slots[p.name]
            value = physical(slot, values.get(p.name, p.value), self._scales, stiffness=stiffness, size=1.0)
            found[slot.name.rpartition(".")[2]] = (float(value), unit_of(slot))
        return found

    def latent(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, Array]:
        """The force [N] that the model misses; of a drop m (g - a) over the model's, at the accelerometer's rows, or
        from its depth where it has none."""
        this = self.prepared[trial]
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
        this = self.prepared[trial]
        model = self._state(values, forms, trial)[3]
        if this.smooth is not None:
            columns = {"t_s": this.time, "measured": this.other, "model": model, "depth_m": this.smooth.depth}
            return {"force": {name: column[this.has_other] for name, column in columns.items()}}
        return {
            name: {"t_s": this.time[rows], "measured": measured[rows], "model": model[rows, column]}
            for name, measured, rows, column in (
                ("depth", this.depth, this.has_depth, 0), ("accel", this.other, this.has_other, 2),
            )
            if rows.any()  # a sensor without readings here is none of its channels
        }  # fmt: skip

    def write_model(
        self, path: str, values: Values, forms: Sequence[Form], base: Values | None = None,
        notes: Mapping[str, Mapping[str, object]] | None = None,
    ) -> None:  # fmt: skip
        """See `Problem`. Of several diameters the middle one stands in [surface] and [spike], all in [notes]. A trial
        without a diameter gets that of the campaign's [spike]."""
        effects = tuple(
            EffectTable(id=form.effect, parameters={
                **({} if self._file(form) else {"reference": self._scales.depth}),
                **{name: value for name, (value, _) in self.reported(values, form).items()},
            }, file=self._file(form))
            for form in forms
        )  # fmt: skip
        pairs = (self._pairs(values), self._pairs(base) if forms and base is not None else {})
        surface, more = float(values.get(SURFACE, 0.0)), notes or {}
        write_model(Path(path), model_of(self.tables, self._middle, *pairs, effects, self.covered, surface, more))

    def _pairs(self, values: Values) -> Pairs:
        """Diameter [m] as text -> K [N/m] and C [N s/m]."""
        return {
            f"{diameter:g}": {name: float(self._number(values, name, diameter)) for name in ("stiffness", "damping")}
            for diameter in self._diameters
        }

    def remarks(self, values: Values, forms: Sequence[Form]) -> list[str]:
        """See `Problem`: of C, by the stops of the drive. Friction of a shaft at rest is not known: then none."""
        if any(form.effect == "shaft-friction" for form in forms):
            return []
        dampings = {diameter: self._number(values, "damping", diameter) for diameter in self._diameters}
        return doubts_of_damping(self._pushes(values, forms, list(self.prepared)), dampings)

    def facts(self, values: Values, forms: Sequence[Form], trials: Sequence[str], *, is_open: bool) -> list[str]:
        """Sentences on K, its spread, and whether C can be determined, where it was not known; none with drops."""
        added = tuple(dict.fromkeys(form.effect for form in forms))
        return facts(self._pushes(values, forms, trials), added, is_open=is_open)

    def at_most(self, values: Values, forms: Sequence[Form], trials: Sequence[str]) -> dict[str, float]:
        """See `Problem`: C of each diameter, by its fastest pushes."""
        bounds = highest_dampings(self._pushes(values, forms, trials))
        return {named("damping", diameter, self._diameters): bound for diameter, bound in bounds.items()}

    def undetermined(
        self, values: Values, forms: Sequence[Form], trials: Sequence[str], errors: Mapping[str, float | None]
    ) -> tuple[str, ...]:
        """C of each diameter that is less than `SURE` errors above 0, or of all where pushes contradict one another or
        have one speed."""
        pushes = self._pushes(values, forms, trials)
        names = [named("damping", diameter, self._diameters) for diameter in self._diameters]
        if pushes and (at_one_speed(pushes) or contradict(pushes, [form.effect for form in forms])):
            return tuple(names)
        found = [(name, values.get(name, 0.0), errors.get(name)) for name in names if pushes]
        return tuple(name for name, damping, error in found if error is None or damping < SURE * error)

    def _pushes(self, values: Values, forms: Sequence[Form], trials: Sequence[str]) -> list[Push]:
        """The pushes among `trials`; none where C was known beforehand, or drops show it."""
        if self.tables.uncertainty.damping < 1 or not all(trial.driven for trial in self.prepared.values()):
            return []
        still = {**values, **{named("damping", diameter, self._diameters): 0.0 for diameter in self._diameters}}
        found = []
        for trial in (self.prepared[id] for id in trials):
            spring, whole = (self._run([point], forms, [trial])[0][0] for point in (still, values))
            columns = (trial.path.depth, trial.path.speed, trial.other, spring, whole - spring)
            found.append(Push(trial.diameter, *(column[trial.has_other] for column in columns)))
        return found

    def next_experiment(self, first: Form, second: Form, values: Values) -> str:
        """See `Problem`."""
        return push_advice(first.effect, second.effect)

    def planned(self, one: Estimate, other: Estimate, *, inflation: tuple[float, float] = (1.0, 1.0)) -> Planned | None:
        """See `Problem`; None where no push was driven."""
        driven = [trial for trial in self.prepared.values() if trial.driven]
        if not driven:
            return None

        def predict(
            points: Sequence[tuple[Values, Sequence[Form]]], diameter: float, time: Array, z: Array, v: Array
        ) -> Array:
            none = np.zeros((len(time), 0))
            like = next(trial for trial in driven if trial.diameter == diameter)
            like = replace(like, time=time, smooth=SmoothDepth(z, v, none, none))
            return self._run_each([([in_one_bed(values, like.info.id)], forms) for values, forms in points], [like])[0]

        return best_push(
            one, other, predict, inflation=inflation, diameters=sorted({trial.diameter for trial in driven}),
            speeds=[max(float(speeds_of(trial)[1]), 1e-6) for trial in driven], std=stds(self.tables, True)[1],
            depth=max(float(trial.path.depth.max()) for trial in driven),
            rows=int(np.median([trial.has_other.sum() for trial in driven])),
        )  # fmt: skip
