"""Tumbles as the statistics of `hedgebed diagnose` see them (`experiments.diagnose.fit.problem`).

A trial's own nuisance is its simulated gravity. The camera's zero is no parameter: it is marginalised in the whitening
(`data.whiten`) and, for the gap that a person reads, put at its most probable value.
"""

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from experiments.campaign import Campaign, EffectTable, TumbleModel, write_model
from experiments.diagnose.core.effect_texts import advice
from experiments.diagnose.fit.fitting import SCAN
from experiments.diagnose.fit.forms import OwnEffect, shapes_of
from experiments.diagnose.fit.problem import Array, Finding, Form, Parameter, Problem, Values
from experiments.diagnose.fit.together import each
from experiments.diagnose.fit.trials import Samples
from experiments.diagnose.noise.jitter import Shaken
from rigid.planar.trajectory import STATES
from rigid.terms import EFFECTS

from .data import CHANNELS, LOST, ZERO_STD, TumbleData, thinned, trial_infos, tumble_data, whiten
from .forms import physical_at, tumble_forms
from .forward import OWN_TO_A_TRIAL, SHARED, Forward, Prediction
from .guess import Guesser
from .latent import followed_until, latent_columns

__all__ = ["TumbleProblem", "make_problem"]

_UNITS = {"mass": "kg", "inertia": "kg m2", "stiffness": "N/m", "damping": "N s/m", "mu_s": "1", "mu_d": "1"}
_COARSE = 1e-3  # step of the integration of a search [s]; what follows is finer
_THIN = 5  # every fifth reading of the wheel, which is fast and shows little, is enough for a search
_STEP = 0.02  # of finite differences, in sigmas: contacts make smaller ones rough
_SWITCH = 5e-4
"""From the moment of a reading [s] within which a model that jumps leaves it in doubt: one step of the integration."""
_SEEN = 3.0  # standard deviations of the noise from which on a change of what the model reads is a jump
_IMU = tuple(CHANNELS.index(name) for name in ("gyro", "ax", "ay"))
_SCATTER_STD = 0.1  # how far replicates may differ, in each kind, while they are asked whether they do [1]


class TumbleProblem(Problem):
    """One campaign of tumbles."""

    kind = "tumble"
    whole = "the platform, the rig or the surface"
    clocks = (("x", "y", "theta"), ("gyro", "ax", "ay"), ("wheel",))
    least_scatter = 0.01  # contact makes each trial's friction and bed uncertain by some tenths of a percent
    left_by_forms = 0.1  # of 70 right names in five counts none left more than 0.05 and more than 1.025 a sample

    def __init__(
        self, data: TumbleData, *, findings: Sequence[Finding] = (), threads: int | None = None,
        own: Sequence[OwnEffect] = (), coarse: bool = False,
    ) -> None:  # fmt: skip
        """`coarse`: with the time step of a search, and none of its own."""
        for effect in own:
            inner = [hook for hook in effect.term.hooks if hook.startswith("inner_")]
            if inner:
                raise ValueError(f"effect_file = {str(effect.file)!r}: the hook {inner[0]!r} cannot be fitted yet")
            _ = effect.tumble  # refused here where it has no forms
        self.data = data
        self.counted_as = "tumbles" if data.tables.rig is None else "rig"
        self.own = {effect.id: effect for effect in own}
        self.forward = Forward(data, **({"time_step": _COARSE} if coarse else {}), threads=threads, own=own)
        self.findings = tuple(findings)
        self.trials = trial_infos(data)
        self.base = self._base()
        self.scatter = {
            kind: Parameter(
                name=kind, unit="1", value=0.0, std=_SCATTER_STD, scale=0.02, lowest=-0.5, highest=1.0, step=1e-3
            ).in_each(trial.id for trial in data.trials)
            for kind in OWN_TO_A_TRIAL[1:]
        }
        self.forms: tuple[Form, ...] = self._forms()
        self.shapes = shapes_of(self.forms)
        self.design = self._design()
        self._index = {trial.id: k for k, trial in enumerate(data.trials)}
        self._data = {trial.id: trial for trial in data.trials}
        self._shaken: dict[str, Shaken] = {}
        self._along: Mapping[str, Array] = {}
        self._switches: dict[str, Array] = {}
        if not coarse:
            few = thinned(data, "wheel", _THIN)
            self.contacts = Guesser(TumbleProblem(few, threads=threads, own=own, coarse=True), self.forms)

    def _base(self) -> tuple[Parameter, ...]:
        """Shared numbers that are uncertain, and each trial's gravity."""
        stated = self.data.tables.uncertainty

        def uncertain(
            name: str, unit: str, value: float, sigma: float, *, trial: str | None = None, kind: str = ""
        ) -> Parameter:
            lowest, highest, size = value * max(1 - 6 * sigma, 0.05), value * (1 + 6 * sigma), sigma * value
            return Parameter(name=name, unit=unit, value=value, std=size, scale=size, step=_STEP * size, lowest=lowest,
                             highest=highest, trial=trial, kind=kind)  # fmt: skip

        shared = [(name, self.forward.nominal[name], getattr(stated, name)) for name in SHARED]
        found = [uncertain(name, _UNITS[name], value, s) for name, value, s in shared if s > 0 and value > 0]
        found = [replace(p, bounded_by="mu_s") if p.name == "mu_d" else p for p in found]
        if (sigma := stated.gravity_sim) > 0:
            found += [uncertain(f"gravity_sim[{t.id}]", "m/s2", t.gravity_sim, sigma, trial=t.id, kind="gravity_sim")
                      for t in self.data.trials]  # fmt: skip
        return tuple(found)

    def _forms(self) -> tuple[Form, ...]:
        """The library, scaled to this campaign."""
        trials, (mass, stiffness) = self.data.trials, (self.forward.nominal[name] for name in ("mass", "stiffness"))
        weight = float(np.mean([(mass + trial.counterweight) * trial.gravity_sim for trial in trials]))
        carried = mass + float(np.mean([trial.counterweight for trial in trials]))
        inertia = self.data.tables.wheel.inertia
        wheel = [
            t.wheel_speed_0 + (0 if t.actuator == "brake" else t.torque * min(t.torque_until, t.end) / inertia)
            for t in trials
        ]
        return tumble_forms(
            rig=self.forward.rig, sinkage=0.5 * weight / stiffness, weight=weight,
            lift_speed=0.5 * weight / math.sqrt(stiffness * carried),
            wheel_speed=max(10.0, 0.5 * float(np.mean(wheel))), own=tuple(self.own.values()),
        )  # fmt: skip

    def _design(self) -> str:
        tables = self.data.tables
        content = {
            "tables": tables.model_dump(mode="json", exclude={"name", "notes", "trial"}),
            "trials": [
                [*map(str, trial.condition), trial.end] + np.bincount(trial.channel, minlength=len(CHANNELS)).tolist()
                for trial in self.data.trials
            ],
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]

    def samples(self, trial: str) -> Samples:
        """Times, channels and std of a trial's samples."""
        data = self._data[trial]
        return Samples(time=data.time, channel=np.array(CHANNELS)[data.channel], std=data.std)

    def evaluate_together(
        self, asked: Sequence[tuple[Sequence[Values], Sequence[Form]]], trials: Sequence[str], share: float = 1.0
    ) -> list[list[dict[str, Array]]]:
        """Whitened residuals of the first share of each trial's time, which alone is simulated; 0 after it."""
        found = self._predict(asked, trials, states=False, horizon=share)

        def whitened(place: int) -> Array:
            data, value = self._data[trials[place]], found[place].value
            until = share * data.end if share < 1 else np.inf
            if (shaken := self._shaken.get(data.id)) is None:
                return whiten(data, value, until=until)
            rest = np.where(data.time <= until, (data.value - value) / data.std, 0.0)
            good = np.isfinite(rest).all(axis=1, keepdims=True)
            return np.where(good, shaken.whitened(np.where(good, rest, LOST)), LOST)

        residuals = each(whitened, range(len(trials)), threads=self.forward.threads)
        rows = iter([dict(zip(trials, own, strict=True)) for own in zip(*residuals, strict=True)])
        return [[next(rows) for _ in points] for points, _ in asked]

    def rewhiten(self, values: Values, forms: Sequence[Form]) -> None:
        """Take readings at a switch of the contact for doubtful, where this model switches."""
        self.doubt(values, forms)

    def doubt(self, values: Values, forms: Sequence[Form]) -> bool:
        """Count readings of the IMU next to which the model jumps, where a spike touches or a slip ends, with an error
        as large as the jump: on which side of it they were taken no fit can know. Returns whether any has changed."""
        before = self._switches
        self._switches = self.switches(values, forms, tuple(self._index))
        self._take_in()
        return any((self._switches[id] != before[id]).any() if id in before else self._switches[id].any()
                   for id in self._switches)  # fmt: skip

    def switches(self, values: Values, forms: Sequence[Form], trials: Sequence[str]) -> dict[str, Array]:
        """By how much the model jumps within `_SWITCH` of each reading of the IMU, over its noise, by trial, shape
        [sample_count]. It is 0 where it does not, and of the other channels."""
        late, now, early = (self.readings(values, forms, trials, shift) for shift in (_SWITCH, 0.0, -_SWITCH))
        found = {}
        for trial in trials:
            after, before = late[trial] - now[trial], now[trial] - early[trial]
            jumps = np.abs(after - before) > np.maximum(_SEEN, 0.5 * np.abs(after + before))
            imu = np.isin(self._data[trial].channel, _IMU)
            found[trial] = np.where(jumps & imu & np.isfinite(after + before), after + before, 0.0)
        return found

    def readings(self, values: Values, forms: Sequence[Form], trials: Sequence[str], late: float) -> dict[str, Array]:
        """See `Problem`."""
        moved = replace(self.data, trials=tuple(replace(trial, time=trial.time + late) for trial in self.data.trials))
        forward = Forward(moved, threads=self.forward.threads, own=self.forward.own) if late else self.forward
        found = self._predict([([values], forms)], trials, states=False, forward=forward)
        return {id: one.value[0] / self._data[id].std for id, one in zip(trials, found, strict=True)}

    def shake(self, along: Mapping[str, Array]) -> None:
        """See `Problem`; readings of one clock with one time share an error."""
        self._along = dict(along)
        self._take_in()

    def _take_in(self) -> None:
        """Times that jitter and readings at a switch into the whitening."""
        self._shaken = {}
        for id in self._index:
            data = self._data[id]
            own = self._along.get(id, np.zeros(len(data.time)))
            jump = self._switches.get(id, np.zeros(len(data.time)))
            own = np.where(np.abs(jump) > np.abs(own), jump, own)
            if own.any():
                clock = np.array([next(k for k, names in enumerate(self.clocks) if name in names) for name in CHANNELS])
                at = np.column_stack([clock[data.channel], data.time])
                row = np.unique(at, axis=0, return_inverse=True)[1].reshape(-1)
                zeros = [ZERO_STD * data.of(name) for name in ("x", "y", "theta")]
                self._shaken[id] = Shaken.of(own, row, np.column_stack(zeros))

    def sensor_std(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, Array]:
        """As stated; endless where a contact switches."""
        channel = np.array(CHANNELS)[self._data[trial].channel]
        doubtful = self.switches(values, forms, [trial])[trial] != 0
        found = super().sensor_std(values, forms, trial)
        return {name: np.where(doubtful[channel == name], np.inf, std) for name, std in found.items()}

    def chi_square(self, values: Values, forms: Sequence[Form], trial: str) -> tuple[float, int]:
        """With the camera's zero at its most probable value; readings at a switch of the contact do not count."""
        data = self._data[trial]
        residual = self._residual(values, forms, trial)
        valid = self.switches(values, forms, [trial])[trial] == 0
        residual = (residual - self._zero(data.channel, residual))[valid]
        return float(residual @ residual), len(residual)

    def phases(self, values: Values, forms: Sequence[Form], trial: str) -> NDArray[np.str_]:
        """stand, pivot, slip or hop at each sample."""
        return np.array(STATES)[self._predict([([values], forms)], [trial])[0].state[0]]

    def reported(self, values: Values, form: Form) -> dict[str, tuple[float, str]]:
        """The term's parameters under the fixed names of docs/diagnose.md."""
        term = self.own[form.effect].term if form.effect in self.own else EFFECTS[form.effect]
        units = {f"{form.effect}.{p.name}": p.unit for p in term.parameters}
        return {
            name.partition(".")[2]: (float(array[0]), units[name])
            for name, array in physical_at(form, [values]).items()
        }

    def form_std(self, form: Form) -> dict[str, float]:
        """Relative uncertainty of what is reported of a form, for nature's law is not the form's: name -> std."""
        return {form.amplitude.partition(".")[2]: form.form_std} if form.form_std else {}

    def remarks(self, values: Values, forms: Sequence[Form]) -> tuple[str, ...]:
        """What of the forms' numbers no rig and no platform has, a sentence each."""
        sentences = []
        for form in forms:
            if form.effect != "rig-friction" or form.effect in self.own:
                continue
            force = self.reported(values, form)["force"][0]
            trial = min(self.data.tables.trial, key=self.data.tables.weight_of)
            weight = self.data.tables.weight_of(trial)
            if force > weight:
                sentences.append(
                    f"rig-friction of {force:.3g} N is more than the {weight:.3g} N that stand on the surface (trial "
                    f"{trial.id}): a rig with it would hold the platform up wherever it is. So it is hardly the "
                    f"pulleys, but something that resists when the platform rises and falls"
                )
        return tuple(sentences)

    def prepare(self, tell: Callable[[str, float], None]) -> None:
        """Compile the kernels, which takes a while the first time, and report it."""
        tell("compiling the kernels (kept for the next time)", 0.0)
        self.forward.predict({}, trials=[0], horizon=0.01)
        self.forward.predict({"com-offset.x": np.zeros(1)}, trials=[0], horizon=0.01)

    def latent(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, Array]:
        """Force and torque that the model misses, and what they might depend on (`latent_columns`)."""
        data = self._data[trial]
        prediction = self._predict([([values], forms)], [trial], motion=True)[0]
        mass = values.get("mass", self.forward.nominal["mass"])
        inertia = values.get("inertia", self.forward.nominal["inertia"])
        return latent_columns(data, prediction, mass=mass, inertia=inertia)

    def compare(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, dict[str, Array]]:
        """Measured and modelled, by channel, the camera's zero put right in the model."""
        data = self._data[trial]
        value = self._predict([([values], forms)], [trial])[0].value[0]
        value = value + self._zero(data.channel, (data.value - value) / data.std) * data.std
        channels = {}
        for number, name in enumerate(CHANNELS):
            mine = data.channel == number
            if mine.any():
                channels[name] = {"t_s": data.time[mine], "measured": data.value[mine], "model": value[mine]}
        return channels

    def write_model(
        self, path: str, values: Values, forms: Sequence[Form], base: Values | None = None,
        notes: Mapping[str, Mapping[str, object]] | None = None,
    ) -> None:  # fmt: skip
        """model.toml, which `hedgebed tumble --model` runs."""
        tables = self.data.tables
        numbers = {name: float(values.get(name, self.forward.nominal[name])) for name in SHARED}
        numbers["mu_d"] = min(numbers["mu_d"], numbers["mu_s"])
        used = [trial for trial in tables.trial if trial.id in self._index]
        gravity = [float(values.get(f"gravity_sim[{trial.id}]", trial.gravity_sim)) for trial in used]
        effects: dict[str, dict[str, float]] = {}
        for form in forms:
            mine = effects.setdefault(form.effect, {})
            mine |= {name: value for name, (value, _) in self.reported(values, form).items() if math.isfinite(value)}
        model = TumbleModel(
            **tables.model_dump(include={"format", "kind", "name"}),
            notes={**tables.notes, **{name: dict(note) for name, note in (notes or {}).items()}},
            platform=tables.platform.model_copy(update={name: numbers[name] for name in ("mass", "inertia")}),
            surface=tables.surface.model_copy(update={name: numbers[name] for name in SHARED[2:]}),
            wheel=tables.wheel, rig=tables.rig, uncertainty=tables.uncertainty, sensors=tables.sensors,
            trial=tuple(t.model_copy(update={"gravity_sim": g}) for t, g in zip(used, gravity, strict=True)),
            effect=tuple(
                EffectTable(id=effect, file=self.own[effect].file.name if effect in self.own else None, parameters=mine)
                for effect, mine in effects.items()
            ),
        )  # fmt: skip
        write_model(path, model)

    def next_experiment(self, first: Form, second: Form, values: Values) -> str:
        """What would distinguish two effects."""
        return advice(first.effect, second.effect)

    def follows(self, values: Values, forms: Sequence[Form], trial: str) -> float | None:
        """The moment [s] up to which the model follows a trial, with the simulated gravity that takes it farthest. None
        where that is not a good part of it (`followed_until`)."""
        data, sigma = self._data[trial], self.data.tables.uncertainty.gravity_sim
        scan = 1 + sigma * SCAN if sigma > 0 else np.ones(1)
        points = [values, *({**values, f"gravity_sim[{trial}]": data.gravity_sim * float(g)} for g in scan)]
        found = self._predict([(points, forms)], [trial])[0]
        moments = [
            followed_until(data, np.where(np.isfinite(value), (data.value - value) / data.std, LOST), state)
            for value, state in zip(found.value, found.state, strict=True)
        ]
        return max((moment for moment in moments if moment is not None), default=None)

    def gravity(self, points: Sequence[Values]) -> Array:
        """Of each trial over its stated one, shape [point_count, trial_count]."""
        stated = [(f"gravity_sim[{trial.id}]", trial.gravity_sim) for trial in self.data.trials]
        return np.array([[values.get(name, own) / own for name, own in stated] for values in points])

    def _predict(
        self, asked: Sequence[tuple[Sequence[Values], Sequence[Form]]], trials: Sequence[str], *, states: bool = True,
        motion: bool = False, forward: Forward | None = None, horizon: float = 1.0,
    ) -> list[Prediction]:  # fmt: skip
        points, ids = [values for own, _ in asked for values in own], tuple(self._index)
        known = self.forward.nominal.items()
        columns = {name: np.array([values.get(name, value) for values in points]) for name, value in known}
        columns["gravity"] = self.gravity(points)
        for kind in OWN_TO_A_TRIAL[1:]:
            columns[kind] = np.array([[1 + values.get(f"{kind}[{id}]", 0.0) for id in ids] for values in points])
        at = 0
        for own, forms in asked:
            for name, array in [pair for form in forms for pair in physical_at(form, own).items()]:
                columns.setdefault(name, np.full(len(points), self.forward.neutral[name]))[at : at + len(own)] = array
            at += len(own)
        chosen = [self._index[trial] for trial in trials]
        return (forward or self.forward).predict(columns, trials=chosen, states=states, motion=motion, horizon=horizon)

    def _residual(self, values: Values, forms: Sequence[Form], trial: str) -> Array:
        data = self._data[trial]
        residual = (data.value - self._predict([([values], forms)], [trial])[0].value[0]) / data.std
        return np.where(np.isfinite(residual), residual, LOST)

    @staticmethod
    def _zero(channel: NDArray[np.int8], residual: Array) -> Array:
        """The most probable zero of the camera in units of its noise, at each sample."""
        zero = np.zeros(len(residual))
        for number, name in enumerate(CHANNELS):
            mine = np.flatnonzero(channel == number)
            if name in ("x", "y", "theta") and len(mine):
                most = len(mine) / (len(mine) + ZERO_STD**-2)
                zero[mine] = np.clip(most * residual[mine].mean(), -3.0, 3.0)
        return zero


def make_problem(campaign: Campaign, *, own: Sequence[OwnEffect] = ()) -> TumbleProblem:
    """The problem of one campaign, `own` among its candidates. Raises ValueError as `tumble_data` does."""
    from .checks import checked

    data, findings = checked(tumble_data(campaign))
    return TumbleProblem(data, findings=findings, own=own)
