"""The outcome of a diagnosis: gaps, places where the model fails, alternatives, the next experiment."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NotRequired, TypedDict

import numpy as np

from experiments.diagnose.fit.bounds import Bound, bounds_met
from experiments.diagnose.fit.evidence import SMALL, Hypothesis, held_out_fit, inflation
from experiments.diagnose.fit.fitting import Fit, fit, settled
from experiments.diagnose.fit.gate import Verdict
from experiments.diagnose.fit.localise import Place, depends_on, latent_table, places
from experiments.diagnose.fit.problem import Array, Finding, Form, Problem
from experiments.diagnose.fit.trials import Planned
from experiments.diagnose.noise.colour import Colour
from experiments.diagnose.noise.jitter import Jitter
from experiments.diagnose.noise.replicates import groups_of
from experiments.diagnose.noise.spectrum import Line, lines_of
from vis.page.numbers import fitted, foldable, quote
from vis.page.sentences import Sentences

from .deciding import Gap, certain, closes, gap_of, is_misfit_of_form, smallest, unscattered, values_of_all
from .effect_texts import confirmation
from .freedom import Freedoms
from .matters import is_small, little_left, undecided
from .next_steps import after_unknown
from .planned_pushes import chosen_push, no_push_words, separates
from .renoised import scatter_of, wander_of
from .rivals import LEAD, Predicted, Rival, marked
from .scatter_gap import ScatterGap, gap_with_scatter, weighed_residuals
from .search import Choice

__all__ = ["Diagnosis", "Estimated", "Known", "finish"]

say = Sentences(__package__)


@dataclass(frozen=True)
class Known:
    """What is known of a campaign beside the choice of effects."""

    problem: Problem
    held_out: tuple[str, ...]  # trials
    gate_before: Verdict  # the gate on the base model
    findings: tuple[Finding, ...]
    jitters: tuple[Jitter, ...]
    colours: Mapping[str, Colour]
    model_std: Mapping[str, float]  # the scatter of replicates beyond the sensors, by kind


class Estimated(TypedDict):
    """A parameter in diagnosis.json, in its unit."""

    value: float
    std: float | None  # Standard error; None: not determined
    unit: str
    freedom: NotRequired[float]  # Degrees of freedom of it, where the scatter of few beds is a part (`Freedoms`)


@dataclass(frozen=True)
class Diagnosis(Known):
    """All that was found; what follows from it is computed when it is asked for. `document` makes diagnosis.json."""

    verdict: str
    base: Fit
    best: Fit  # the base model's where nothing was added
    base_values: Mapping[str, float]  # with the held-out trials' own nuisances
    best_values: Mapping[str, float]
    effects: tuple[str, ...]
    before: Gap
    after: Gap
    gate_after: Verdict
    gate_held_out: Verdict | None  # the best model's on the trials held out; None without trials or without a choice
    choice: Choice | None

    @property
    def forms(self) -> tuple[Form, ...]:
        """Forms of the best model."""
        return self.best.model.forms

    @property
    def fitted(self) -> tuple[str, ...]:
        """Trials."""
        return self.base.model.trials

    @cached_property
    def own_values(self) -> Mapping[str, float]:
        """`best_values`, of an unknown with each trial's own factor on its bed or its friction where there is one."""
        if self.verdict != "unknown" or not self.best.model.scatter:
            return self.best_values
        return held_out_fit(self.best.model, self.held_out, self.best.values)

    @cached_property
    def rivals(self) -> tuple[Form, ...]:
        """The first form of each alternative."""
        shown = smallest(self.choice) if self.choice is not None and self.verdict == "ambiguous" else ()
        return tuple(next(form for form in one.forms if form.effect not in self.effects) for one in shown)

    @property
    def alternatives(self) -> tuple[str, ...]:
        """Effects that could replace the first one."""
        return tuple(form.effect for form in self.rivals)

    @cached_property
    def where(self) -> tuple[Place, ...]:
        """Where the base model fails."""
        if self.verdict == "none":
            return ()
        forms = self.base.model.forms
        (rest,) = self.problem.evaluate([self.base_values], forms, (*self.fitted, *self.held_out))
        return tuple(places(self.problem, self.base_values, forms, rest))

    @cached_property
    def left(self) -> tuple[Place, ...]:
        """Where the best model fails beyond the scatter of replicates, if the verdict is unknown."""
        if self.verdict != "unknown":
            return ()
        # A trial's own factor is in `own_values` already.
        factors = set(self.problem.scatter) - set(self.problem.known_std)
        others = {kind: std for kind, std in self.model_std.items() if kind not in factors}
        trials = (*self.fitted, *self.held_out)
        rest = weighed_residuals(self.problem, others, self.own_values, self.forms, trials)
        return tuple(places(self.problem, self.own_values, self.forms, rest))

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """Lines in the spectrum of what the best model leaves, if the verdict is unknown."""
        trials = (*self.fitted, *self.held_out) if self.verdict == "unknown" else ()
        return tuple(lines_of(self.problem, self.own_values, self.forms, trials))

    @cached_property
    def dependence(self) -> tuple[str, dict[str, float]]:
        """If the verdict is unknown, what the missing force correlates with: in words, and the share by column."""
        return depends_on(self.latent()) if self.verdict == "unknown" else ("", {})

    def latent(self) -> dict[str, Any]:
        """Columns of latent.csv."""
        return latent_table(self.problem, self.own_values, self.forms)

    @cached_property
    def gap_with_scatter(self) -> ScatterGap | None:
        """The gap against the scatter of replicates; None where they differ by the sensors' noise alone."""
        return gap_with_scatter(self.problem, self.model_std, self._stages, self.fitted, self.held_out)

    @property
    def allowed_by(self) -> str:
        """The first rule of docs/diagnose.md, "What matters", that lets the verdict pass; empty for `unknown`."""
        weighed, gates = self.gap_with_scatter, (self.gate_after, self.gate_held_out)
        small = self.after if weighed is None else Gap(*weighed.after)
        of_chance = "chance" if all(gate is None or gate.passed for gate in gates) else ""
        if self.verdict == "none":
            return "small_gap" if is_small(small, len(self.fitted), len(self.held_out)) else of_chance
        if self.choice is None or self.verdict == "unknown":
            return ""
        if known := little_left(self.before, self.after, small) or of_chance:
            return known
        late = "" if self.problem.contacts is None else "late"
        return "form" if is_misfit_of_form(self.choice, self.held_out) else late

    @cached_property
    def gap_with_fitted_scatter(self) -> ScatterGap | None:
        """The same with the scatter that replicates among the fitted trials show, held-out trials left out of it: then
        it is a prediction of these. None where no fitted trial repeats another, or none differs beyond the sensors."""
        if not self.model_std:
            return None
        factors = tuple(kind for kind in self.problem.scatter if kind in self.model_std)
        stds = dict(self.problem.known_std)  # what the readings themselves show
        if factors:
            stds |= scatter_of(self.best, (), kinds=factors).model_std
        stds |= wander_of(self.best, ()).model_std
        return gap_with_scatter(
            self.problem, stds, self._stages, self.fitted, self.held_out, scattered=self.fitted
        )  # fmt: skip

    @property
    def _stages(self) -> list[tuple[Mapping[str, float], tuple[Form, ...]]]:
        """Values and forms of the base model, and of the best one unless nothing is missing."""
        stages: list[tuple[Mapping[str, float], tuple[Form, ...]]] = [(self.base_values, ())]
        return stages if self.verdict == "none" else [*stages, (self.best_values, self.forms)]

    @property
    def equivalence(self) -> tuple[Rival, ...]:
        """The nearest other effects, and whether these trials can separate them from the first one."""
        return self.choice.rivals if self.choice is not None and self.effects else ()

    @property
    def predicted(self) -> Predicted | None:
        """The best model's cross-validation."""
        return self.choice.predicted if self.choice is not None and self.effects else None

    @property
    def bounds_before(self) -> tuple[Bound, ...]:
        """Parameters of the fitted base model at a bound or far from the stated value."""
        return bounds_met(self.base)

    @property
    def bounds_after(self) -> tuple[Bound, ...]:
        """The same of the best model."""
        return bounds_met(self.best)

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """Which of the best model's numbers are implausible, a sentence each."""
        return tuple(self.problem.remarks(self.best.values, self.forms))

    @cached_property
    def planned(self) -> Planned | None:
        """The further trial that would separate the first effect best from the likeliest alternative, or, where it is
        named, from the nearest rival."""
        if self.choice is None:
            return None
        near = smallest(self.choice)[0] if self.verdict == "ambiguous" else self._nearest_model
        if near is None:
            return None
        plan = self.problem.planned(self.best, near.fit, inflation=_inflations(self.best, near.fit))
        return None if plan is None else chosen_push(plan, self.known_scatter or {})

    @cached_property
    def known_scatter(self) -> dict[str, float] | None:
        """By what trials of one condition differ beyond the sensors, by kind. Beside it stand the number of `trials`
        and the degrees of `freedom` that it was found from. None where no trial repeats another and none was found
        without."""
        used = [trial for trial in self.problem.trials if trial.id in (*self.fitted, *self.held_out)]
        groups = [len(ids) for ids in groups_of(used).values() if len(ids) > 1]
        if not (groups or self.model_std):
            return None
        trials = sum(groups) or len(used)
        return {**self.model_std, "trials": trials, "freedom": trials - (len(groups) or 1)}

    def ordered(self, other: Hypothesis) -> tuple[str, ...]:
        """The effects of another answer, those it has in common with this one first."""
        return tuple(sorted(other.effects, key=lambda name: name not in self.effects))

    @property
    def _nearest_model(self) -> Hypothesis | None:
        """The nearest rival of the whole answer, of a verdict that names something."""
        near = self._nearest
        return self.nearest_answer or (None if near is None else near.hypothesis)

    @cached_property
    def nearest_answer(self) -> Hypothesis | None:
        """Where several effects are named, the likeliest other set of effects: one that has another effect than these,
        and is not these with a further one. None of other verdicts, and where no such set was fitted."""
        own = set(self.effects)
        if self.choice is None or self.verdict != "named" or len(own) < 2:
            return None
        fitted = (*self.choice.table, *(rival.hypothesis for rival in self.choice.rivals))
        others = [one for one in fitted if not set(one.effects) <= own and not set(one.effects) > own]
        return max(others, key=lambda one: one.score, default=None)

    @property
    def _nearest(self) -> Rival | None:
        """The rival that a named effect leads by least; None of other verdicts, and without rivals."""
        rivals = self.choice.rivals if self.choice is not None and self.verdict == "named" else ()
        return min(rivals, key=lambda rival: rival.lead, default=None)

    @cached_property
    def facts(self) -> tuple[str, ...]:
        """What the trials that took part show of the base model's numbers, a sentence each."""
        trials = (*self.fitted, *self.held_out)
        return tuple(self.problem.facts(self.best.values, self.forms, trials, is_open=bool(self.undetermined)))

    @cached_property
    def undetermined(self) -> tuple[str, ...]:
        """Base parameters that these trials leave open, although the fit may have a standard error for them."""
        errors = {name: told["std"] for name, told in self.base_parameters(self.best).items()}
        trials = (*self.fitted, *self.held_out)
        return tuple(self.problem.undetermined(self.best.values, self.forms, trials, errors))

    @cached_property
    def next_experiment(self) -> str:
        """The experiment that separates two effects, confirms one, or follows up what is unknown; and the one that
        determines what is `undetermined`."""
        return " ".join([self._next_for_effects, *([self.problem.how_to_determine] if self.undetermined else [])])

    @property
    def _next_for_effects(self) -> str:
        if self.verdict == "none":
            return "None is needed: the base model explains what these sensors can see."
        if self.choice is None:  # unknown for the readings' noise alone
            return say("measure_noise")
        if self.verdict == "named":
            near = self.nearest_answer
            doubted = [name for name in self.effects if near is not None and name not in near.effects]
            general = confirmation((*doubted, *self.choice.best.effects)[0], self.problem.kind)
            if none := self._no_push(self._nearest_model, general):
                return none
            return f"{expected} {say('otherwise')} {general}" if (expected := self._expected) else general
        if self.verdict == "ambiguous":
            told = self.problem.next_experiment(self.forms[0], self.rivals[0], self.best.values)
            if (plan := self.planned) is None:
                return told
            if none := self._no_push(smallest(self.choice)[0], told):
                return none
            times = math.ceil(LEAD / max(plan.nats, 1e-3))
            return f"{say('planned', plan=plan, times=f', so {times} of them do' if 1 < times < 100 else '')} {told}"
        weighed = self.gap_with_scatter
        return after_unknown(
            self.problem, self.own_values, self.forms, self.left, self.dependence[1], beside=self.choice.best.effects,
            is_scatter=bool(self.effects) and weighed is not None and max(v or 0.0 for v in weighed.after) <= SMALL,
        )  # fmt: skip

    def _no_push(self, near: Hypothesis | None, advice: str) -> str:
        """That no push separates this answer from another one by more than beds differ; empty where one does."""
        plan = self.planned
        if near is None or plan is None or plan.apart is None or separates(plan.apart):
            return ""
        return no_push_words(plan, " + ".join(self.effects), " + ".join(self.ordered(near)), advice)

    @property
    def _expected(self) -> str:
        """The best further push for a named effect, and what it and its nearest rival predict there; empty without."""
        near, plan = self._nearest_model, self.planned
        if near is None or plan is None or plan.apart is None:
            return ""
        several = len(self.effects) > 1 or len(near.effects) > 1
        first, apart = " + ".join(self.effects) if several else self.effects[0], plan.apart
        ways = {-1.0: "on the way back", 0.0: "in the hold", 1.0: "on the way in"}
        way = ways[float(np.sign(apart["speed_m_s"]))]
        errors = {key: _with_error(apart, key) for key in ("one", "other")}
        rival, depth_mm = " + ".join(self.ordered(near)), 1e3 * apart["depth_m"]
        beds = say("without_beds" if self.known_scatter is None else "with_beds")
        told = {"first": first, "rival": rival, "depth_mm": depth_mm, "way": way, "beds": beds}
        return say("confirming", plan=plan, **told, **errors) + self._peak_words(first, rival)

    def _peak_words(self, first: str, rival: str) -> str:
        """The peak force of the planned push by both models, and whether the campaign has read such a force."""
        apart = dict((self.planned and self.planned.apart) or {})
        peaks = {key: _with_error(apart, f"{key}_peak") for key in ("one", "other") if f"{key}_peak_N" in apart}
        if len(peaks) < 2:
            return ""
        read = [self.problem.compare(self.best_values, self.forms, trial).get("force") for trial in self.fitted]
        most = max(float(np.max(force["measured"])) for force in read if force is not None)
        larger = max(apart["one_peak_N"], apart["other_peak_N"]) > most
        return say("peak", first=first, rival=rival, most=most, check=say("load_cell") if larger else "", **peaks)

    def base_parameters(self, one: Fit) -> dict[str, Estimated]:
        """The base model's shared numbers in one of the fits: name -> value, std (standard error; None where data and
        priors do not determine it), unit."""
        covariance, between = one.covariance(inflation=inflation(one)), _between(one)
        places = {p.name: k for k, p in enumerate(one.model.parameters)}
        ways, freedoms = np.eye(len(places)), self._freedoms(one, covariance)
        found: dict[str, Estimated] = {}
        for p in self.problem.base:
            if p.trial is None and p.name in places:
                slope = ways[k := places[p.name]]
                std = _error(one, covariance, slope, between=float(between[k]))
                found[p.name] = _estimated(one.values[p.name], std, p.unit, freedoms.of(slope, std))
        return found

    def _freedoms(self, one: Fit, covariance: Array) -> Freedoms:
        """Of the numbers of one of the fits."""
        return Freedoms(one, covariance, (self.known_scatter or {}).get("freedom"))

    def parameters(self, effect: str) -> dict[str, Estimated]:
        """An effect in diagnosis.json: name -> value, std (None where data and priors do not determine it), unit."""
        found: dict[str, Estimated] = {}
        covariance = self.best.covariance(inflation=inflation(self.best))
        freedoms = self._freedoms(self.best, covariance)
        for form in (form for form in self.forms if form.effect == effect):
            loose = self.problem.form_std(form)
            for name, (value, unit, slope) in self._reported(form).items():
                std = _error(self.best, covariance, slope, loose.get(name, 0.0) * value)
                found[name] = _estimated(float(value), std, unit, freedoms.of(slope, std))
        return found

    def _reported(self, form: Form) -> dict[str, tuple[float, str, Array]]:
        """What is reported of a form of the best model: value, unit, and its derivatives by the parameters, shape
        [p]."""
        parameters = self.best.model.parameters
        here = self.problem.reported(self.best.values, form)
        slopes = {name: np.zeros(len(parameters)) for name in here}
        for k, p in enumerate(parameters):
            step = p.step if p.step is not None else 1e-4 * p.scale
            moved = self.problem.reported({**self.best.values, p.name: self.best.values[p.name] + step}, form)
            for name in here:
                slopes[name][k] = (moved[name][0] - here[name][0]) / step
        return {name: (value, unit, slopes[name]) for name, (value, unit) in here.items()}

    def joint_errors(self) -> dict[str, Any]:
        """Standard errors of the best model's shared numbers with their correlations, as model.toml notes them
        (`ERRORS_NOTE` of `experiments.campaign.tables`)."""
        covariance = self.best.covariance(inflation=inflation(self.best))
        places = {p.name: k for k, p in enumerate(self.best.model.parameters)}
        ways = np.eye(len(places))
        slopes = {p.name: ways[places[p.name]] for p in self.problem.base if p.trial is None and p.name in places}
        own = dict.fromkeys(slopes, 0.0)  # what a number is uncertain by beside the fit
        apart = _between(self.best)
        between = {name: float(apart[places[name]]) for name in slopes}
        for form in self.forms:
            loose = self.problem.form_std(form)
            for name, (value, _, slope) in self._reported(form).items():
                slopes[f"{form.effect}.{name}"] = slope
                own[f"{form.effect}.{name}"] = abs(loose.get(name, 0.0) * value)
        stds = {
            name: _error(self.best, covariance, slope, own[name], between=between.get(name, 0.0))
            for name, slope in slopes.items()
        }
        known, freedoms = [name for name, std in stds.items() if std is not None], self._freedoms(self.best, covariance)
        freedom = {name: freedoms.of(slopes[name], stds[name]) for name in known}
        jointly = np.array([slopes[name] for name in known]).reshape(len(known), len(places))
        shared = jointly @ covariance @ jointly.T + np.diag([own[name] ** 2 for name in known])
        size = np.sqrt(np.maximum(np.diag(shared), 1e-300))
        return {
            "names": known,
            "std": [float(f"{stds[name]:.6g}") for name in known],
            "correlation": [[float(f"{x:.6g}") for x in row] for row in shared / np.outer(size, size)],
            "undetermined": [name for name, std in stds.items() if std is None],
            "freedom": {name: float(f"{value:.6g}") for name, value in freedom.items() if value is not None},
        }


def _inflations(one: Fit, other: Fit) -> tuple[float, float]:
    """Factors on the errors of two models for what each leaves beyond noise."""
    return inflation(one), inflation(other)


def _with_error(apart: Mapping[str, float], key: str) -> str:
    """A force of a planned push: 0.112 ± 0.016 N, half of a 95 % interval; of one that the model gives exactly, why it
    has no error."""
    force, std, freedom = (apart.get(f"{key}_{name}") for name in ("N", "std_N", "freedom"))
    if not std:
        return say("exact_force", force=foldable(quote(force, None, "N")))
    return foldable(fitted({"value": force, "std": std, "freedom": freedom, "unit": "N"}))


def _between(one: Fit) -> Array:
    """Least standard error of each parameter from how trials differ, shape [p]: of pushes fitted together with drops,
    whose K and C are not the same where a frame gives way (a drop has none); else 0."""
    modes = {info.condition[0] for info in one.model.infos}
    if one.model.problem.kind != "penetration" or len(modes) < 2:
        return np.zeros(len(one.model.parameters))
    return np.sqrt(np.maximum(np.diag(one.covariance_by_trial()), 0.0))


def _estimated(value: float, std: float | None, unit: str, freedom: float | None) -> Estimated:
    """A number with its freedom where it has one."""
    number: Estimated = {"value": value, "std": std, "unit": unit}
    return number if freedom is None else {**number, "freedom": freedom}


def _error(found: Fit, covariance: Array, slope: Array, more: float = 0.0, *, between: float = 0.0) -> float | None:
    """Standard error of a number by its derivatives, shape [p], and by `more`, at least `between`; None where it is not
    determined."""
    std = max(math.hypot(math.sqrt(max(float(slope @ covariance @ slope), 0.0)), more), between)
    return std if math.isfinite(std) and not found.leaves_open(slope) else None


def finish(
    known: Known, base: Fit, choice: Choice | None, verdict: str, *, alone: Fit | None = None,
    last: Verdict | None = None, held: Verdict | None = None, sure: tuple[str, ...] = (),
) -> Diagnosis:  # fmt: skip
    """The diagnosis that a choice makes. `alone`: the base model's fit with rows weighted as it has them itself, where
    they are weighted otherwise now. `last`, `held`: the gate on the best model, and on trials held out. `sure`: effects
    that are certain beside something unknown. A name that does not lead its rivals by enough is one of several."""
    if choice is not None:
        choice = replace(choice, rivals=marked(choice.rivals, choice.best))
    if choice is not None and verdict == "named" and (rivals := undecided(choice)):
        choice, verdict = replace(choice, alternatives=rivals), "ambiguous"
    base, held_out = settled(base), known.held_out
    best, plain = choice.best.fit if choice is not None else base, base
    if alone is not None:
        plain = settled(alone)
    elif verdict != "none" and base.model.scatter:
        # With a factor for each trial the base model leaves to the factors what it misses: the gap is of one mean bed.
        plain = settled(fit(replace(base.model, scatter=()), unscattered(base)))
    base_values, best_values = values_of_all(plain, held_out), values_of_all(best, held_out)
    effects = choice.best.effects if choice is not None else ()
    before = gap_of(base, held_out, base_values)
    after = before if verdict == "none" else gap_of(best, held_out, best_values)
    if not effects:  # another noise alone makes no other model
        best_values, after = base_values, before
    if verdict == "unknown" and choice is not None and effects:
        if after.fit > before.fit and (after.held_out or 0.0) >= (before.held_out or 0.0):
            # A likelihood that knows more of the noise may prefer it; as a model of the motion it is none.
            without = replace(
                choice, best=choice.base, rivals=(), alternatives=(), predicted=None, left=known.gate_before
            )
            return finish(known, base, without, verdict, alone=alone)
        if not (certain(base, choice) and closes(base, best, held_out)):
            effects = tuple(effect for effect in effects if effect in sure)
    return Diagnosis(
        **vars(known), verdict=verdict, base=plain, best=best, base_values=base_values, best_values=best_values,
        effects=effects, before=before, after=after, choice=choice, gate_held_out=held,
        gate_after=last or (choice.left if choice is not None else known.gate_before),
    )  # fmt: skip
