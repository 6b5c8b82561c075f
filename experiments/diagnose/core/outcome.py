"""All that a diagnosis has found, and how the last step makes it of a choice."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from experiments.diagnose.fit.bounds import Bound, bounds_met
from experiments.diagnose.fit.evidence import SMALL, held_out_fit, inflation
from experiments.diagnose.fit.fitting import Fit, fit, settled
from experiments.diagnose.fit.gate import Verdict
from experiments.diagnose.fit.localise import Place, depends_on, latent_table, places, places_in
from experiments.diagnose.fit.problem import Finding, Form, Problem
from experiments.diagnose.noise.colour import Colour
from experiments.diagnose.noise.jitter import Jitter
from experiments.diagnose.noise.spectrum import Line, lines_of

from .deciding import Gap, certain, closes, gap_of, smallest, unscattered, values_of_all
from .effect_words import confirmation
from .equivalence import Rival
from .next_steps import after_unknown
from .prediction import Predicted
from .scatter_gap import gap_with_scatter, weighed_residuals
from .search import Choice

__all__ = ["Diagnosis", "Told"]


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
    own_values: Mapping[str, float]
    """The same with each trial's own factor on its bed or its friction, where there are such: what is asked for what is
    missing."""
    effects: tuple[str, ...]
    alternatives: tuple[str, ...]
    rivals: tuple[Form, ...]
    """First form of each alternative."""
    where: tuple[Place, ...]
    """Where the base model fails."""
    before: Gap
    after: Gap
    fitted: tuple[str, ...]
    held_out: tuple[str, ...]
    gate_before: Verdict
    gate_after: Verdict
    gate_held_out: Verdict | None
    """The best model's on the trials held out; None where there are none, or where no model was chosen."""
    choice: Choice | None
    colours: Mapping[str, Colour]
    jitters: tuple[Jitter, ...]
    model_std: Mapping[str, float]
    findings: tuple[Finding, ...]
    next_experiment: str
    depends_on: str = ""
    shares: Mapping[str, float] = field(default_factory=dict)
    lines: tuple[Line, ...] = ()
    """In the spectrum of what the best model leaves, if the verdict is unknown."""
    left: tuple[Place, ...] = ()
    """Where the best model fails beyond what replicates differ by, if the verdict is unknown."""

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

    @property
    def bounds_before(self) -> tuple[Bound, ...]:
        """Parameters of the fitted base model that ended at a bound or far from what was stated."""
        return bounds_met(self.base)

    @property
    def bounds_after(self) -> tuple[Bound, ...]:
        """The same of the best model."""
        return bounds_met(self.best)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What of the best model's numbers is hard to believe, a sentence each."""
        of_forms: Callable[..., tuple[str, ...]] = getattr(self.problem, "remarks", lambda values, forms: ())
        return of_forms(self.best.values, self.forms)

    def latent(self) -> dict[str, Any]:
        """Columns of latent.csv."""
        return latent_table(self.problem, self.own_values, self.forms)

    def parameters(self, effect: str) -> dict[str, dict[str, Any]]:
        """What diagnosis.json says of an effect: name -> value, std, unit."""
        found: dict[str, dict[str, Any]] = {}
        names = [p.name for p in self.best.model.parameters]
        covariance = self.best.covariance(inflation=inflation(self.best))
        of_form: Callable[[Form], Mapping[str, float]] = getattr(self.problem, "form_std", lambda form: {})
        for form in self.forms:
            if form.effect != effect:
                continue
            loose = of_form(form)
            here = self.problem.reported(self.best.values, form)
            slopes: dict[str, np.ndarray] = {name: np.zeros(len(names)) for name in here}
            for k, p in enumerate(self.best.model.parameters):
                step = p.step if p.step is not None else 1e-4 * p.scale
                moved = self.problem.reported({**self.best.values, p.name: self.best.values[p.name] + step}, form)
                for name in here:
                    slopes[name][k] = (moved[name][0] - here[name][0]) / step
            for name, (value, unit) in here.items():
                variance = float(slopes[name] @ covariance @ slopes[name]) + (loose.get(name, 0.0) * value) ** 2
                std = math.sqrt(max(variance, 0.0))
                found[name] = {"value": float(value), "std": std if math.isfinite(std) else 0.0, "unit": unit}
        return found


@dataclass(frozen=True)
class Told:
    """What is known beside the choice."""

    problem: Problem
    first: Verdict
    """The gate on the base model."""
    findings: Sequence[Finding]
    held_out: tuple[str, ...]
    jitters: tuple[Jitter, ...]
    colours: Mapping[str, Colour]
    model_std: Mapping[str, float]
    alone: Fit | None = None
    """The base model's fit with rows weighed as it has them itself, where they are weighed otherwise now."""

    def finish(
        self, base: Fit, choice: Choice | None, verdict: str, *, last: Verdict | None = None,
        held: Verdict | None = None, sure: tuple[str, ...] = (),
    ) -> Diagnosis:  # fmt: skip
        """The diagnosis, its gaps and places. `last`, `held`: the gate on the best model, and on trials held out.
        `sure`: names that stand beside something unknown."""
        base = settled(base)
        problem, held_out, fitted = self.problem, self.held_out, base.model.trials
        best = choice.best.fit if choice is not None else base
        # With a factor a trial the base model leaves to the factors what it lacks: that of one mean bed is another.
        plain = (
            fit(replace(base.model, scatter=()), unscattered(base))
            if verdict != "none" and base.model.scatter
            else base
        )
        plain = settled(self.alone) if self.alone is not None else base if plain is base else settled(plain)
        base_values, best_values = values_of_all(plain, held_out), values_of_all(best, held_out)
        effects = choice.best.effects if choice is not None else ()
        before = gap_of(problem, base.model, base_values, fitted, held_out)
        after = before if verdict == "none" else gap_of(problem, best.model, best_values, fitted, held_out)
        if not effects:  # what only the noise is taken for otherwise is no other model
            best_values, after = base_values, before
        if verdict == "unknown" and choice is not None and effects and _worse(before, after):
            # A likelihood that knows more of the noise may prefer it; as a model of the motion it is none.
            without = replace(choice, best=choice.base, rivals=(), alternatives=(), predicted=None, left=self.first)
            return self.finish(base, without, verdict)
        if verdict == "unknown" and choice is not None and effects:
            stays = effects if certain(base, choice) and closes(base, best, held_out) else sure
            effects = tuple(effect for effect in effects if effect in stays)
        where = [] if verdict == "none" else places(base.model, base_values, (*fitted, *held_out))
        rivals = smallest(choice) if choice is not None and verdict == "ambiguous" else ()
        alternatives = tuple(next(e for e in rival.effects if e not in effects) for rival in rivals)
        rival_forms = tuple(next(f for f in rival.forms if f.effect == e)
                            for rival, e in zip(rivals, alternatives, strict=True))  # fmt: skip
        told, shares, left, lines = "", dict[str, float](), list[Place](), list[Line]()
        own_values: Mapping[str, float] = best_values
        findings = (*self.findings, *(jitter.finding for jitter in self.jitters))
        if verdict == "unknown":
            # A trial's own factor is known: what is missing is asked of what that leaves.
            own_values = held_out_fit(best.model, held_out, best.values) if best.model.scatter else best_values
            asked_of_all = set(getattr(problem, "scatter", {})) - set(getattr(problem, "known_std", {}))
            others = {kind: std for kind, std in self.model_std.items() if kind not in asked_of_all}
            told, shares = depends_on(latent_table(problem, own_values, best.model.forms))
            rest = weighed_residuals(problem, others, own_values, best.model.forms, (*fitted, *held_out))
            left = places_in(problem, own_values, best.model.forms, rest)
            lines = lines_of(problem, own_values, best.model.forms, (*fitted, *held_out))
        found = Diagnosis(
            verdict=verdict, problem=problem, base=plain, best=best, base_values=base_values, best_values=best_values,
            own_values=own_values,
            effects=effects, alternatives=alternatives, rivals=rival_forms, where=tuple(where), before=before,
            after=after, fitted=fitted, held_out=held_out, gate_before=self.first,
            gate_after=last or (choice.left if choice is not None else self.first), gate_held_out=held, choice=choice,
            colours=self.colours, jitters=self.jitters, model_std=self.model_std, findings=findings, depends_on=told,
            shares=shares, lines=tuple(lines), left=tuple(left), next_experiment="",
        )  # fmt: skip
        return replace(found, next_experiment=_next(found))


def _worse(before: Gap, after: Gap) -> bool:
    """Whether the gap has grown, on the trials that were fitted and on those held out."""
    return after.fit > before.fit and (after.held_out or 0.0) >= (before.held_out or 0.0)


def _next(found: Diagnosis) -> str:
    """The next experiment: what tells two names apart, confirms one, or follows up what has no name."""
    problem, choice, best = found.problem, found.choice, found.best
    if found.verdict == "none" or choice is None:
        return "None is needed: the base model explains what these sensors can see."
    if found.verdict == "named":
        return confirmation(choice.best.effects[0])
    if found.verdict == "ambiguous":
        return problem.next_experiment(best.model.forms[0], found.rivals[0], best.values)
    weighed = gap_with_scatter(found)
    return after_unknown(
        problem, found.own_values, found.forms, found.left, found.shares, beside=choice.best.effects,
        is_scatter=bool(found.effects) and weighed is not None and max(v or 0.0 for v in weighed.after) <= SMALL,
    )  # fmt: skip
