"""All that a diagnosis has found."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from experiments.diagnose.fit.bounds import Bound, bounds_met
from experiments.diagnose.fit.evidence import inflation
from experiments.diagnose.fit.fitting import Fit
from experiments.diagnose.fit.gate import Verdict
from experiments.diagnose.fit.localise import Place, latent_table
from experiments.diagnose.fit.problem import Finding, Form, Problem
from experiments.diagnose.noise.colour import Colour
from experiments.diagnose.noise.jitter import Jitter
from experiments.diagnose.noise.spectrum import Line

from .deciding import Gap
from .equivalence import Rival
from .prediction import Predicted
from .search import Choice

__all__ = ["Diagnosis"]


@dataclass(frozen=True)
class Diagnosis:
    """All that was found; `document` makes diagnosis.json of it."""

    verdict: str
    problem: Problem
    base: Fit
    best: Fit  # the base model's where nothing was added
    base_values: Mapping[str, float]  # with the held-out trials' own nuisances
    best_values: Mapping[str, float]
    own_values: Mapping[str, float]
    """The same with each trial's own factor on its bed or its friction, where there are such: what is asked for what is
    missing."""
    effects: tuple[str, ...]
    alternatives: tuple[str, ...]
    rivals: tuple[Form, ...]  # first form of each alternative
    where: tuple[Place, ...]  # where the base model fails
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
    lines: tuple[Line, ...] = ()  # in the spectrum of what the best model leaves, if the verdict is unknown
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
        return tuple(self.problem.remarks(self.best.values, self.forms))

    def latent(self) -> dict[str, Any]:
        """Columns of latent.csv."""
        return latent_table(self.problem, self.own_values, self.forms)

    def parameters(self, effect: str) -> dict[str, dict[str, Any]]:
        """What diagnosis.json says of an effect: name -> value, std, unit."""
        found: dict[str, dict[str, Any]] = {}
        names = [p.name for p in self.best.model.parameters]
        covariance = self.best.covariance(inflation=inflation(self.best))
        for form in self.forms:
            if form.effect != effect:
                continue
            loose = self.problem.form_std(form)
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
