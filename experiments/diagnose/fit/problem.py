"""What the statistics of `hedgebed diagnose` ask of a kind of trial: the interface between them and the physics.

The core (`fitting`, `gate`, `evidence`, `search`) knows nothing of spikes, platforms or sensors. A `Problem` holds the
measured data of one campaign and a model with named parameters, and answers with *whitened residuals*:
(measured - model) / std, one number per valid sample, unit variance and no correlation where the model is right. Data
enter a residual linearly, which the gate's bootstrap uses: synthetic data of the values v0 have the residuals
r(v) - r(v0) + noise.

Names of values: a base parameter by its own name (``stiffness``), a nuisance of a trial as ``gravity_sim[001]``, an
effect's as ``pendulum.curvature``. Units are SI. A parameter that is not among the values given has its `value`.

A kind of trial is a class that inherits `Problem`, in ``experiments/diagnose/<push or tumble>/problem.py``, made there
by ``make_problem(campaign, own=())``. A member that has a default here is one that not every kind of trial needs.

What is fitted is a `Model`. Its residuals are white or are made so (`Whitener`): each channel of each trial is turned
by a discrete cosine transform and every mode divided by the noise it has. In that domain the sum of squares is that of
white noise, and slow misfit stands in the first modes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from experiments.check.words import Finding
from rigid.terms.candidate import Bend, Number

from .together import each
from .trials import Planned, Samples, TrialInfo

__all__ = ["Array", "Contacts", "Finding", "Form", "Model", "Parameter", "Problem", "Values",
           "Whitener", "evaluate_all"]  # fmt: skip

_MANY = 2**15  # residuals from which threads are worth their while

Array = NDArray[np.float64]
Values = Mapping[str, float]  # name of a parameter -> value


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One number that a fit may change."""

    name: str  # as in `Values`; of a nuisance ``kind[trial]``, of an effect ``effect.name``
    unit: str
    value: float
    """Where fits begin, and the middle of the prior. Of an effect's amplitude: 0."""
    std: float = np.inf
    """Gaussian prior, one sigma; infinite for none. A parameter that is exact is no Parameter."""
    scale: float
    """A size typical of a change that can be seen (above 0): the step of finite differences is 1e-4 of it, unless
    `step` says otherwise, and fits work in units of it."""
    lowest: float = -np.inf
    highest: float = np.inf
    trial: str | None = None  # id of the one trial that it touches; None for a shared parameter
    kind: str = ""
    """Of a nuisance: what it is in every trial (``gravity_sim``). Nuisances of one kind are changed in all trials at
    once when a Jacobian is made, since none touches another's trial."""
    step: float | None = None
    """Step of finite differences, in units of the parameter; for models whose contacts make small steps rough."""
    bounded_by: str = ""  # name of the parameter above which it changes nothing (mu_d: mu_s)
    least: float | None = None
    """Of what may differ between replicates: the std below which it is negligible; None: the problem's own."""

    def in_each(self, trials: Iterable[str]) -> tuple[Parameter, ...]:
        """Nuisances of this name, one for each trial."""
        return tuple(replace(self, name=f"{self.name}[{id}]", kind=self.name, trial=id) for id in trials)


@dataclass(frozen=True, kw_only=True)
class Form:
    """One functional form of one effect. With its `amplitude` at 0 it changes nothing."""

    effect: str  # id of the effect, as in docs/diagnose.md: ``depth-hardening``
    name: str
    """Of the form: ``power``. Unique within the effect."""
    parameters: tuple[Parameter, ...]  # shared ones (``trial`` None) or a trial's own; names begin with ``<effect>.``
    amplitude: str  # name of the parameter that at 0 is the base model
    starts: tuple[Values, ...] = ()
    """Values of the form's parameters to begin fits from, amplitudes that can be seen, other signs and lengths among
    them; every one is tried. Empty: 1 and, where the bounds allow, -1 scale of the amplitude."""
    redefines: tuple[str, ...] = ()
    """Base parameters that mean another thing beside this form (a straight spring's slope is not that of a bent one
    at its beginning): what was stated of them is no measure of it."""
    stiffness: str = ""  # what K is beside this form, where it redefines it
    numbers: tuple[Number, ...] = ()  # of the term (tumbles) or of the law (pushes), as the effect's file declares them
    bends: tuple[Bend, ...] = ()  # what may bend it
    form_std: float = 0.0  # of the amplitude, relative: how far nature's law lets it be another number than the form's
    becomes: tuple[tuple[str, Callable[..., bool]], ...] = ()
    """Another effect, and whether the form is that one at these numbers (as `Problem.reported` has them, by name)."""

    @property
    def id(self) -> str:
        """``effect:name``"""
        return f"{self.effect}:{self.name}"

    @cached_property
    def slots(self) -> dict[str, Number]:
        """Name of a parameter -> the number that follows from it."""
        return {f"{self.effect}.{number.fitted}": number for number in self.numbers}


class Contacts(Protocol):
    """A search of its own for where fits begin: of trials that touch, slip and fall, whose likelihood jumps."""

    def guess(self, model: Model, values: Values) -> dict[str, float]:
        """Values near the best, from which a local fit may begin; parameters of forms that are not among `values` are
        looked for."""

    def refine(self, models: Sequence[Model], values: Sequence[Values]) -> list[dict[str, float]]:
        """The same for several models of the same trials at once, all of whose values are given."""

    def race(self, models: Sequence[Model], values: Sequence[Values], *, most: int) -> list[tuple[int, Values]]:
        """Which of many models follow the beginnings of all trials best, at most `most`, the best first: each one's
        place among `models`, and the values at which it does."""


class Estimate(Protocol):
    """A fitted model, as a plan of further trials sees it (`fitting.Fit`)."""

    @property
    def model(self) -> Model:
        """What was fitted."""

    @property
    def values(self) -> dict[str, float]:
        """Its numbers."""

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which of them no bound holds, shape [p]."""

    def covariance(self, *, inflation: float = 1.0, known: Collection[str] = ()) -> Array:
        """Of the numbers, in their units, shape [p, p]. Data are noisier by `inflation`, the names `known` exact."""


class Problem(Protocol):
    """One campaign as the statistics see it."""

    kind: str  # ``penetration`` or ``tumble``
    counted_as: str = ""  # ``pushes``, ``rig`` or ``tumbles``: which count of right verdicts is of such campaigns
    whole: str  # all that takes part in a trial, as in "what comes back is in ..."
    trials: tuple[TrialInfo, ...]  # the trials that can be used, in the campaign's order
    base: tuple[Parameter, ...]
    """Parameters of the base model: shared ones (from [uncertainty]) and each trial's nuisances."""
    forms: Sequence[Form]  # the library: every effect that this campaign could show, each in one or several forms
    shapes: Mapping[str, Sequence[Form]] = MappingProxyType({})
    """Forms of another shape, tried from where the plain one ends, by the id of that."""
    findings: tuple[Finding, ...]  # what was found wrong with the data when it was read
    design: str  # digest of what decides the gate: sampling, conditions, noise, priors; not of the measured numbers
    loose: str = ""  # name of a base parameter without which what is `unknown` is looked at once more
    granular: bool = True  # whether replicates differ because grains lie otherwise in each bed
    by_path: bool = False
    """Whether trials follow a measured path: its error depends on the model (`rewhiten`), and replicates are compared
    row by row (`calm`)."""
    contacts: Contacts | None = None  # of a motion with contacts; None where the likelihood is smooth
    rough: Sequence[str] = ()  # trials whose motion bounces: the likelihood is the rougher the longer they are
    clocks: Sequence[tuple[str, ...]] = ()  # channels whose times come from one clock, if these may jitter
    left_by_forms: float = 1.0
    """Share of what the base model leaves that a right name's form may leave, where the gate sees it."""
    scatter: Mapping[str, tuple[Parameter, ...]] = MappingProxyType({})
    """What may differ between replicates beyond the sensors: kind -> one nuisance a trial, mostly not fitted."""
    least_scatter: float = 0.005
    """Relative scatter below this is not the bed's: the smoothing of a depth column does as much."""
    hidden_scatter: tuple[str, ...] = ()  # kinds that are asked for only where something is left
    special_scatter: tuple[str, ...] = ()  # kinds that are not asked for with all others at once
    zero_scatter: tuple[str, ...] = ()  # kinds that are asked for by themselves where the others do not explain all
    force_scatter: tuple[str, ...] = ()  # and after these; they count where they explain all
    how_to_determine: str = ""  # one sentence: the trial that would determine what is `undetermined`
    typical_depth: float | None = None  # D of the equations of pushes and drops [m]; None of tumbles
    covered: Mapping[str, Any] = MappingProxyType({})
    """What pushes cover: greatest depth, speeds and whether one came out again; empty where there are none."""
    own_base: str = ""  # the setting each value of which has base parameters of its own
    lone_scatter: tuple[tuple[str, ...], ...] = ()
    """What is asked for, one after the other, where no trial repeats another (`lone_beds`)."""
    known_std: Mapping[str, float] = MappingProxyType({})
    """What differs from trial to trial as the readings themselves show: kind -> std, in its unit."""
    calmed: Mapping[str, Array] = MappingProxyType({})  # weights of modes as `calm` was given them last

    def prepare(self, tell: Callable[[str, float], None]) -> None:
        """Do once what takes long the first time; progress is reported by calls."""
        return

    def samples(self, trial: str) -> Samples:
        """The valid samples of a trial."""

    def evaluate(
        self, points: Sequence[Values], forms: Sequence[Form], trials: Sequence[str], share: float = 1.0
    ) -> list[dict[str, Array]]:
        """For each point the whitened residuals of each trial, shape [sample_count], for the base model plus `forms`.

        All points at once, so that a batched model can take them together. Always finite: where the model cannot be
        integrated, residuals are 1e3. The whitening must not depend on the values (between calls of `rewhiten`).
        `share`: of each trial's time, beyond which nothing need be simulated.
        """
        return self.evaluate_together([(points, forms)], trials, share)[0]

    def evaluate_together(
        self, asked: Sequence[tuple[Sequence[Values], Sequence[Form]]], trials: Sequence[str], share: float = 1.0
    ) -> list[list[dict[str, Array]]]:
        """The same for several sets of forms, each at points of its own. A kind of trial implements one of the two."""
        return [self.evaluate(points, forms, trials, share) for points, forms in asked]

    def rewhiten(self, values: Values, forms: Sequence[Form]) -> None:
        """Take the whitening at these values from now on. Does nothing where it does not depend on them."""

    def doubt(self, values: Values, forms: Sequence[Form]) -> bool:
        """Count readings next to which the model jumps as doubtful from now on; whether any has changed."""
        return False

    def follows(self, values: Values, forms: Sequence[Form], trial: str) -> float | None:
        """The moment [s] up to which the model follows a trial; None where that is no good part of it."""
        return None

    def centred(self, values: Values, forms: Sequence[Form]) -> dict[str, float]:
        """The same model, what trials' own numbers have in common moved into shared ones: a fit goes on from there."""
        return dict(values)

    def shake(self, along: Mapping[str, Array]) -> None:
        """Take times that jitter into the whitening from now on.

        `along`: what one standard deviation of jitter changes in each sample, over its stated noise, by trial; {} for
        times as they stand.
        """

    def calm(self, weights: Mapping[str, Array]) -> None:
        """Weigh modes so from now on (`Whitener.white`): what replicates differ by counts as noise; {}: as they are."""
        self.calmed = dict(weights)

    def chi_square(self, values: Values, forms: Sequence[Form], trial: str) -> tuple[float, int]:
        """Sum of squared residuals with the std that docs/diagnose.md states for `gap`; number of samples."""

    def sensor_std(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, Array]:
        """Noise of each reading as `gap` takes it, by channel: of a driven force with the error of its depth; endless
        where a tumble was read while a contact switched."""
        samples = self.samples(trial)
        return {name: samples.std[samples.channel == name] for name in dict.fromkeys(samples.channel.tolist())}

    def readings(self, values: Values, forms: Sequence[Form], trials: Sequence[str], late: float) -> dict[str, Array]:
        """What the model reads `late` seconds after each sample's time, over the stated noise, shape [sample_count]."""

    def phases(self, values: Values, forms: Sequence[Form], trial: str) -> NDArray[np.str_]:
        """The state at each sample: stand, pivot, slip, hop; for penetration free, in, rest, out."""

    def reported(self, values: Values, form: Form) -> dict[str, tuple[float, str]]:
        """What diagnosis.json reports of a form: name -> (value, unit), under the fixed names where there are such.

        A smooth function of the form's parameters: the core carries uncertainties through it by differences.
        """

    def form_std(self, form: Form) -> Mapping[str, float]:
        """Relative uncertainty of what is reported of a form, for nature's law is not the form's: name -> std."""
        return {}

    def explains(self, finding: Finding) -> bool:
        """Whether something odd about a recording is taken into account."""
        return False

    def remarks(self, values: Values, forms: Sequence[Form]) -> Sequence[str]:
        """What is hard to believe of the forms' numbers, a sentence each."""
        return ()

    def facts(self, values: Values, forms: Sequence[Form], trials: Sequence[str], *, is_open: bool) -> Sequence[str]:
        """What `trials` show of the base model's numbers, a sentence each; `is_open`: whether one is undetermined."""
        return ()

    def at_most(self, values: Values, forms: Sequence[Form], trials: Sequence[str]) -> Mapping[str, float]:
        """Upper bounds of base parameters that trials leave open: name -> bound, in its unit."""
        return {}

    def undetermined(
        self, values: Values, forms: Sequence[Form], trials: Sequence[str], errors: Mapping[str, float | None]
    ) -> Sequence[str]:
        """Base parameters that `trials` leave open, by name. `errors`: name -> standard error in the fit, or None."""
        return ()

    def latent(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, Array]:
        """Columns of latent.csv, all of one shape. ``t_s`` is first. Then come ``latent_...`` (the force, torque or
        error of a sensor that the model misses, by time), and what it might depend on (``depth_m``, ``velocity_m_s``,
        ...)."""

    def compare(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, dict[str, Array]]:
        """Channel -> {"t_s", "measured", "model"} for plots, at the samples; units those of the channel."""

    def write_model(
        self, path: str, values: Values, forms: Sequence[Form], base: Values | None = None,
        notes: Mapping[str, Mapping[str, object]] | None = None,
    ) -> None:  # fmt: skip
        """model.toml: the tables with the fitted values, and [[effect]] tables. `base`: values of the base model that
        was fitted without these effects, which a comparison needs. `notes`: further ones, by name, such as the errors
        of the values."""

    def next_experiment(self, first: Form, second: Form, values: Values) -> str:
        """One sentence: the trial or bench measurement that would distinguish the two."""

    def planned(self, one: Estimate, other: Estimate, *, inflation: tuple[float, float] = (1.0, 1.0)) -> Planned | None:
        """The further trial that would separate two fitted models best; None where none is searched. `inflation`:
        factors on the standard errors of each, for what it leaves beyond noise."""
        return None


@dataclass(frozen=True)
class Whitener:
    """Turns residuals into modes of unit variance, trial by trial."""

    blocks: Mapping[str, tuple[NDArray[np.intp], ...]]  # rows of each channel in each trial, in the order of time
    weights: Mapping[str, Array]  # one over the noise of each mode, in the order of the blocks, shape [sample_count]
    kept: Mapping[str, Array] = field(default_factory=dict)
    """Of trials that are fitted in part only: factors 0 or 1 on the residuals, shape [sample_count]."""

    @staticmethod
    def white(problem: Problem) -> Whitener:
        """For noise that is white, beside what replicates are known to differ by (`noise.wander`)."""
        bare = Whitener.bare(problem)
        return replace(bare, weights={**bare.weights, **problem.calmed})

    @staticmethod
    def none(problem: Problem) -> Whitener:
        """That leaves residuals as they are, in the order of the samples."""
        return replace(Whitener.bare(problem), blocks={})

    @staticmethod
    def bare(problem: Problem) -> Whitener:
        """A whitener for white noise: residuals stay unchanged."""
        blocks, weights = {}, {}
        for trial in problem.trials:
            samples = problem.samples(trial.id)
            names = list(dict.fromkeys(samples.channel.tolist()))
            blocks[trial.id] = tuple(np.flatnonzero(samples.channel == name) for name in names)
            weights[trial.id] = np.ones(len(samples.time))
        return Whitener(blocks, weights)

    def modes(self, trial: str, residuals: Array) -> Array:
        """Modes of the residuals of a trial, shape [sample_count], or [point_count, sample_count]."""
        if trial in self.kept:
            residuals = residuals * self.kept[trial]
        return self.turned(trial, residuals) * self.weights[trial]

    def turned(self, trial: str, residuals: Array) -> Array:
        """Residuals of a trial by mode, not weighed; shapes as of `modes`."""
        if not self.blocks:
            return residuals
        if len(self.blocks[trial]) == 1:  # whose rows are those of the trial, in their order
            return dct(residuals, norm="ortho", axis=-1)
        parts = [dct(np.take(residuals, rows, axis=-1), norm="ortho", axis=-1) for rows in self.blocks[trial]]
        return np.concatenate(parts, axis=-1)

    @cached_property
    def unturned(self) -> Whitener:
        """One that turns nothing, where each channel of a trial is weighed by one number: products of modes over a
        trial are then those of residuals so weighed. Else this one."""
        weights = {}
        for trial, blocks in self.blocks.items():
            weights[trial], start = np.ones(len(self.weights[trial])), 0
            for rows in blocks:
                own = self.weights[trial][start : (start := start + len(rows))]
                if np.ptp(own) > 0:
                    return self
                weights[trial][rows] = own
        return replace(self, blocks={}, weights=weights) if weights else self

    def channel_blocks(self, problem: Problem, trial: str) -> list[tuple[str, slice]]:
        """Each channel of a trial, and where its modes stand."""
        edges = np.cumsum([0, *(len(rows) for rows in self.blocks[trial])]).tolist()
        channels = dict.fromkeys(problem.samples(trial).channel.tolist())
        return list(zip(channels, map(slice, edges[:-1], edges[1:]), strict=True))


@dataclass(frozen=True)
class Model:
    """What is fitted: the problem, the effects added, the trials, and which scatter is let free."""

    problem: Problem
    whitener: Whitener
    trials: tuple[str, ...]
    forms: tuple[Form, ...] = ()
    scatter: tuple[Parameter, ...] = ()  # nuisances of trials that describe what differs between replicates
    held: Mapping[str, float] | None = None  # values at which all shared parameters are held; None: they are fitted
    share: float = 1.0  # of their time, up to which trials are looked at (`until`)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All that a fit changes."""
        extra = tuple(p for form in self.forms for p in form.parameters)
        every = (*self.problem.base, *self.scatter, *extra)
        shared = self.held is None
        return tuple(p for p in every if (shared if p.trial is None else p.trial in self.trials))

    @property
    def infos(self) -> list[TrialInfo]:
        """What is known of its trials, in the campaign's order."""
        return [trial for trial in self.problem.trials if trial.id in self.trials]

    def with_forms(self, forms: Sequence[Form]) -> Model:
        """The same with other effects."""
        return replace(self, forms=tuple(forms))

    def on(self, trials: Sequence[str]) -> Model:
        """The same on other trials."""
        return replace(self, trials=tuple(trials))

    def holding(self, values: Values) -> Model:
        """The same with all shared parameters held at these values."""
        return replace(self, held=dict(values))

    def until(self, share: float, trials: Sequence[str] | None = None) -> Model:
        """The same model with only the first share of the time of these trials (None: the problem's `rough` ones).

        A motion with bounces depends on its parameters the more roughly the longer it lasts. Fits converge that start
        with its beginning.
        """
        kept = {}
        for trial in self.problem.rough if trials is None else trials:
            time = self.problem.samples(trial).time
            kept[trial] = (time <= time.min() + share * np.ptp(time)).astype(float)
        return replace(self, whitener=replace(self.whitener, kept=kept), share=share)

    @property
    def simulated(self) -> float:
        """Share of the trials' time that must be simulated: the rest is not used."""
        kept = self.whitener.kept
        return self.share if not self.whitener.blocks or all(trial in kept for trial in self.trials) else 1.0

    def evaluate(self, points: Sequence[Values]) -> list[Array]:
        """Modes of all trials, one after another, at each point."""
        return evaluate_all([(self, points)])[0]

    def modes(self, residuals: Sequence[Mapping[str, Array]]) -> list[Array]:
        """The same of residuals by trial, as the problem has them at each point."""

        if not self.whitener.blocks:
            found = np.empty((len(residuals), sum(len(self.whitener.weights[id]) for id in self.trials)))
            for trial, rows in self.rows().items():
                found[:, rows] = self.whitener.modes(trial, np.stack([one[trial] for one in residuals]))
            return list(found)

        def modes(trial: str) -> Array:
            return self.whitener.modes(trial, np.stack([one[trial] for one in residuals]))

        many = len(residuals) * sum(len(self.whitener.weights[id]) for id in self.trials) >= _MANY
        parts = each(modes, self.trials, threads=None if many else 1)
        return list(np.concatenate(parts, axis=1))

    @property
    def unturned(self) -> Model:
        """The same with residuals for modes, where products of them are the same (`Whitener.unturned`); else this one.
        A search of contacts counts modes: it needs them."""
        if self.problem.contacts is not None or self.whitener.unturned is self.whitener:
            return self
        return replace(self, whitener=self.whitener.unturned)

    def turned(self, unturned: Array) -> Array:
        """Modes, from what `unturned` has for them; shape [n] or [count, n]."""
        parts = [self.whitener.turned(trial, unturned[..., rows]) for trial, rows in self.rows().items()]
        return np.concatenate(parts, axis=-1)

    def rows(self) -> dict[str, slice]:
        """Where each trial's modes stand."""
        edges = np.cumsum([0, *(len(self.whitener.weights[id]) for id in self.trials)]).tolist()
        return {id: slice(edges[k], edges[k + 1]) for k, id in enumerate(self.trials)}

    def channel_rows(self) -> Iterator[tuple[str, str, slice]]:
        """Trial, channel and where its modes stand, of all trials that are fitted."""
        for trial, rows in self.rows().items():
            for channel, block in self.whitener.channel_blocks(self.problem, trial):
                yield trial, channel, slice(rows.start + block.start, rows.start + block.stop)


def evaluate_all(asked: Sequence[tuple[Model, Sequence[Values]]]) -> list[list[Array]]:
    """Modes of each model at its points; models of one problem, on the same trials, are evaluated together."""
    alike: dict[tuple[int, tuple[str, ...], float], list[int]] = {}
    for k, (model, _) in enumerate(asked):
        alike.setdefault((id(model.problem), model.trials, model.simulated), []).append(k)
    found: dict[int, list[Array]] = {}
    for (_, trials, share), mine in alike.items():
        models, points = zip(*(asked[k] for k in mine), strict=True)
        whole = [
            ([{**(one.held or {}), **point} for point in own], one.forms)
            for one, own in zip(models, points, strict=True)
        ]
        residuals = models[0].problem.evaluate_together(whole, trials, share)
        for like in _turned_alike(models):
            modes = iter(models[like[0]].modes([one for k in like for one in residuals[k]]))
            found |= {mine[k]: [next(modes) for _ in residuals[k]] for k in like}
    return [found[k] for k in range(len(asked))]


def _turned_alike(models: Sequence[Model]) -> list[list[int]]:
    """The places of models whose modes are the same ones of a residual; alone where a model has modes of its own."""
    alike: dict[tuple[int, int], list[int]] = {}
    for k, model in enumerate(models):
        alike.setdefault((id(model.whitener), -1 if type(model) is Model else k), []).append(k)
    return list(alike.values())
