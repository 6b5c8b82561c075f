"""How the last step of a diagnosis makes it of a choice: gaps, places, alternatives, the next experiment."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from experiments.diagnose.fit.evidence import SMALL, held_out_fit
from experiments.diagnose.fit.fitting import Fit, fit, settled
from experiments.diagnose.fit.gate import Verdict
from experiments.diagnose.fit.localise import Place, depends_on, latent_table, places, places_in
from experiments.diagnose.fit.problem import Finding, Problem
from experiments.diagnose.noise.colour import Colour
from experiments.diagnose.noise.jitter import Jitter
from experiments.diagnose.noise.spectrum import Line, lines_of

from .deciding import Gap, certain, closes, gap_of, smallest, unscattered, values_of_all
from .effect_words import confirmation
from .next_steps import after_unknown
from .outcome import Diagnosis
from .scatter_gap import gap_with_scatter, weighed_residuals
from .search import Choice

__all__ = ["Told"]


@dataclass(frozen=True)
class Told:
    """What is known beside the choice."""

    problem: Problem
    first: Verdict  # the gate on the base model
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
            asked_of_all = set(problem.scatter) - set(problem.known_std)
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
