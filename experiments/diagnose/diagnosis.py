"""From a problem to a diagnosis: split, fit, gate, search, verdict. Knows nothing of what kind of trials these are."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from .colour import Colour, find_colours, whitener_for
from .equivalence import Rival
from .evidence import Hypothesis, excess, held_out_fit, inflation, score, signature_matrix
from .fitting import Fit, Model, Whitener, fit
from .gate import Verdict, open_gate
from .localise import Place, depends_on, latent_table, places
from .prediction import Predicted
from .problem import Finding, Form, Problem
from .replicates import find_scatter, odd_trials, split_trials
from .search import Choice, choose

__all__ = ["Diagnosis", "Gap", "diagnose"]

Tell = Callable[[str, float], None]

_RIGHT_FORM = 0.05
"""A model that leaves a twentieth of what the base model does has the right name, if not nature's exact form."""
_CLOSED = 0.15
"""And no more than this of the gap, as it is reported."""
_MOST_FOR_COLOUR = 2.5
"""Chi-square per sample above which motion, not noise, fills the fast modes too."""
_REFITS = 400
"""Made-up campaigns of a thorough null."""
_MARGIN = 1.5
"""Standard deviations beyond the gate that something without a name must reach: no effect speaks for it."""
_AS_LIKELY = 1.0
"""Nats within which a third name is said as well."""
_SMALL = 1.2
"""Chi-square per sample on held-out trials below which what is left is too small to be called unknown."""


@dataclass(frozen=True)
class Gap:
    """Chi-square per valid sample, as docs/diagnose.md has it."""

    fit: float
    held_out: float | None


@dataclass(frozen=True)
class Diagnosis:
    """All that was found; `document` makes diagnosis.json of it."""

    verdict: str
    problem: Problem
    base: Fit
    best: Fit
    """The base model's where nothing was added."""
    base_values: Mapping[str, float]
    """With the held-out trials' own nuisances."""
    best_values: Mapping[str, float]
    effects: tuple[str, ...]
    alternatives: tuple[str, ...]
    rivals: tuple[Form, ...]
    """First form of each alternative."""
    where: tuple[Place, ...]
    before: Gap
    after: Gap
    fitted: tuple[str, ...]
    held_out: tuple[str, ...]
    gate_before: Verdict
    gate_after: Verdict
    choice: Choice | None
    colours: Mapping[str, Colour]
    model_std: Mapping[str, float]
    findings: tuple[Finding, ...]
    next_experiment: str
    depends_on: str = ""
    shares: Mapping[str, float] = field(default_factory=dict)

    @property
    def forms(self) -> tuple[Form, ...]:
        """Forms of the best model."""
        return self.best.model.forms

    @property
    def equivalence(self) -> tuple[Rival, ...]:
        """The nearest other names, and whether these trials can tell them from the first effect."""
        return self.choice.rivals if self.choice is not None and self.effects else ()

    @property
    def predicted(self) -> Predicted | None:
        """What the best model leaves of conditions that were left out in turn."""
        return self.choice.predicted if self.choice is not None and self.effects else None

    def latent(self) -> dict[str, Any]:
        """Columns of latent.csv."""
        return latent_table(self.problem, self.best_values, self.forms)

    def parameters(self, effect: str) -> dict[str, dict[str, Any]]:
        """What diagnosis.json says of an effect: name -> value, std, unit."""
        found: dict[str, dict[str, Any]] = {}
        names = [p.name for p in self.best.model.parameters]
        covariance = self.best.covariance(inflation=inflation(self.best))
        for form in self.forms:
            if form.effect != effect:
                continue
            here = self.problem.reported(self.best.values, form)
            slopes: dict[str, np.ndarray] = {name: np.zeros(len(names)) for name in here}
            for k, p in enumerate(self.best.model.parameters):
                step = p.step if p.step is not None else 1e-4 * p.scale
                moved = self.problem.reported({**self.best.values, p.name: self.best.values[p.name] + step}, form)
                for name in here:
                    slopes[name][k] = (moved[name][0] - here[name][0]) / step
            for name, (value, unit) in here.items():
                variance = float(slopes[name] @ covariance @ slopes[name])
                std = math.sqrt(max(variance, 0.0))
                found[name] = {"value": float(value), "std": std if math.isfinite(std) else 0.0, "unit": unit}
        return found


def diagnose(
    problem: Problem, *, thorough: bool = False, seed: int = 0, tell: Tell | None = None, gates: Path | None = None
) -> Diagnosis:
    """Diagnose a campaign. `tell(what, share done)` hears of progress; the same campaign gives the same answer.

    `thorough`: nulls by full refits, which takes as long as it takes; they are kept in the folder `gates`, if given,
    for the next campaign of the same design.
    """
    tell = tell or (lambda what, done: None)
    tell("fitting the base model", 0.0)
    findings = list(problem.findings)
    fitted, held_out = split_trials(problem.trials)
    base = _whitened_fit(Model(problem, Whitener.white(problem), fitted))
    odd = odd_trials(_whitened_fit(replace(base.model, trials=tuple(t.id for t in problem.trials))))
    if odd:
        findings += odd
        aside = {finding.trial for finding in odd}
        fitted, held_out = split_trials([t for t in problem.trials if t.id not in aside])
        base = _whitened_fit(base.model.on(fitted))
    scatter, model_std = _scatter(base, held_out)
    base = fit(replace(base.model, scatter=scatter), base.values) if scatter else base
    colours = _colours_of(base)
    base = _coloured(base, colours)
    tell("is anything left?", 0.0)
    columns, _ = signature_matrix(base, problem.forms)
    _, first = open_gate(
        base, signatures=columns, seed=seed, refit=thorough, draws=_REFITS if thorough else 600, folder=gates,
        tell=lambda done: tell("making the gate's null", done),
    )  # fmt: skip
    if first.passed:
        return _finish(problem, base, None, first, first, colours, model_std, findings, held_out, "none", seed)
    choice = choose(base, tell=tell, seed=seed)
    fresh = _colours_of(_plain(choice.best.fit))
    if _differ(fresh, colours):  # seen only now that the motion is out of the way: weigh once more
        best = _coloured(_plain(choice.best.fit), fresh)
        base, colours = _coloured(_plain(base), fresh), fresh
        left = open_gate(best, seed=seed)[1]
        choice = replace(choice, best=Hypothesis(best, score(best)), left=left)
    if thorough and choice.best.effects:
        left = open_gate(
            choice.best.fit, seed=seed, refit=True, draws=_REFITS, folder=gates,
            tell=lambda done: tell("making the null of what is left", done),
        )[1]  # fmt: skip
        choice = replace(choice, left=left)
    if not choice.best.effects and choice.left.score < choice.left.threshold + _MARGIN:
        return _finish(problem, base, None, first, choice.left, colours, model_std, findings, held_out, "none", seed)
    tell("verdict", 0.0)
    verdict = _verdict(choice, base, held_out)
    return _finish(problem, base, choice, first, choice.left, colours, model_std, findings, held_out, verdict, seed)


def _whitened_fit(model: Model) -> Fit:
    """Fitted, with the whitening taken at the fit."""
    found = fit(model)
    model.problem.rewhiten(found.values, ())
    return fit(model, found.values)


def _plain(found: Fit) -> Fit:
    """The same with noise taken as white."""
    return fit(replace(found.model, whitener=Whitener.white(found.model.problem)), found.values)


def _coloured(found: Fit, colours: Mapping[str, Colour]) -> Fit:
    """The same with noise of these colours; `found` has white noise."""
    if not colours:
        return found
    return fit(replace(found.model, whitener=whitener_for(found, dict(colours))), found.values)


def _colours_of(found: Fit) -> dict[str, Colour]:
    """Colours of the noise, where the misfit is small enough for the fast modes to hold nothing else."""
    if found.chi_square > _MOST_FOR_COLOUR * found.count:
        return {}
    return find_colours(found)


def _scatter(base: Fit, held_out: tuple[str, ...]) -> tuple[Any, dict[str, float]]:
    whole = fit(base.model.on((*base.model.trials, *held_out)), base.values)
    return find_scatter(whole)


def _differ(one: Mapping[str, Colour], other: Mapping[str, Colour]) -> bool:
    names = set(one) | set(other)
    return any(
        abs((one[n].persistence if n in one else 0.0) - (other[n].persistence if n in other else 0.0)) > 0.1
        for n in names
    )


def _gap(problem: Problem, model: Model, values: Mapping[str, float], fitted: tuple[str, ...],
         held_out: tuple[str, ...]) -> Gap:  # fmt: skip
    def per_sample(trials: tuple[str, ...]) -> float:
        pairs = [problem.chi_square(values, model.forms, trial) for trial in trials]
        return sum(total for total, _ in pairs) / max(1, sum(count for _, count in pairs))

    return Gap(per_sample(fitted), per_sample(held_out) if held_out else None)


def _with_held_out(found: Fit, held_out: tuple[str, ...]) -> dict[str, float]:
    """Values for all trials. The gap is that of one mean bed: how replicates differ is the gate's affair."""
    if found.model.scatter:
        scatter = {parameter.name for parameter in found.model.scatter}
        start = {name: value for name, value in found.values.items() if name not in scatter}
        found = fit(replace(found.model, scatter=()), start)
    return held_out_fit(found.model, held_out, found.values)


def _verdict(choice: Choice, base: Fit, held_out: tuple[str, ...]) -> str:
    best = choice.best
    if not best.effects:
        return "unknown"
    problem = base.model.problem
    named = "ambiguous" if choice.alternatives else "named"
    if choice.left.passed:
        return named
    fitted = best.fit.model.trials
    after = _gap(problem, best.fit.model, _with_held_out(best.fit, held_out), fitted, held_out)
    worst = max(after.fit, after.held_out or 0.0)
    if worst <= _SMALL:
        return named
    # Noise that is taken for coloured may hide what is left: the gap, whose noise is as stated, has to close as well.
    before = _gap(problem, base.model, _with_held_out(base, held_out), fitted, held_out)
    closed = after.fit - 1 < _CLOSED * (before.fit - 1)
    return named if closed and excess(best.fit) < _RIGHT_FORM * excess(base) else "unknown"


def _finish(
    problem: Problem, base: Fit, choice: Choice | None, first: Verdict, last: Verdict, colours: Mapping[str, Colour],
    model_std: Mapping[str, float], findings: list[Finding], held_out: tuple[str, ...], verdict: str, seed: int,
) -> Diagnosis:  # fmt: skip
    del seed
    best = choice.best.fit if choice is not None else base
    fitted = base.model.trials
    base_values, best_values = _with_held_out(base, held_out), _with_held_out(best, held_out)
    effects = choice.best.effects if choice is not None else ()
    if verdict == "unknown" and choice is not None and effects:
        # Only what takes away most of the excess is certain when something else is there that has no name.
        certain = excess(best) < 0.5 * excess(base)
        effects = effects if certain else ()
    before = _gap(problem, base.model, base_values, fitted, held_out)
    after = before if verdict == "none" else _gap(problem, best.model, best_values, fitted, held_out)
    where = [] if verdict == "none" else places(base.model, base_values, (*fitted, *held_out))
    rivals = _smallest(choice) if choice is not None and verdict == "ambiguous" else ()
    alternatives = tuple(next(e for e in rival.effects if e not in effects) for rival in rivals)
    rival_forms = tuple(next(f for f in rival.forms if f.effect == e)
                        for rival, e in zip(rivals, alternatives, strict=True))  # fmt: skip
    told, shares = "", dict[str, float]()
    if verdict == "unknown":
        told, shares = depends_on(latent_table(problem, best_values, best.model.forms))
    return Diagnosis(
        verdict=verdict, problem=problem, base=base, best=best, base_values=base_values, best_values=best_values,
        effects=effects, alternatives=alternatives, rivals=rival_forms, where=tuple(where), before=before, after=after,
        fitted=fitted, held_out=held_out, gate_before=first, gate_after=last, choice=choice, colours=colours,
        model_std=model_std, findings=tuple(findings), depends_on=told, shares=shares,
        next_experiment=_next(problem, best, choice, rival_forms, verdict),
    )  # fmt: skip


def _smallest(choice: Choice) -> tuple[Hypothesis, ...]:
    """The alternatives that are said: the likeliest, and a second one where it is about as likely as the first name."""
    first, *others = choice.alternatives
    return (first, *(h for h in others[:1] if h.score > choice.best.score - _AS_LIKELY))


def _next(problem: Problem, best: Fit, choice: Choice | None, rivals: tuple[Form, ...], verdict: str) -> str:
    if verdict == "none":
        return "None is needed: the base model explains what these sensors can see."
    if verdict == "unknown":
        return (
            "Repeat the trial with the largest gap twice without changing anything: what comes back is in the bed or "
            "the spike, what does not is in the room."
        )
    assert choice is not None
    if rivals:
        return problem.next_experiment(best.model.forms[0], rivals[0], best.values)
    others = [h for what, h in choice.table if len(h.forms) == 1 and h.effects[0] not in choice.best.effects]
    if not others:
        return "None is needed: no rival comes near."
    second = max(others, key=lambda h: h.score)
    return problem.next_experiment(best.model.forms[0], second.forms[0], best.values)
