"""From a problem to a diagnosis: split, fit, gate, search, verdict. Knows nothing of what kind of trials these are."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .astray import allowed, astray, astray_finding, astray_held_out
from .bounds import Bound, bounds_met, is_strained
from .colour import Colour, find_colours, find_loud, whitener_for
from .deciding import Gap, certain, closes, gap_of, smallest, unscattered, values_of_all, verdict_of
from .effect_words import confirmation
from .equivalence import Rival
from .evidence import SMALL, Hypothesis, excess, held_out_fit, inflation, score, signature_matrix
from .fitting import Fit, Model, Whitener, by_beginnings, fit, settled
from .gate import Verdict, held_out_gate, open_gate
from .jitter import Jitter, find_jitter, steepness
from .localise import Place, depends_on, latent_table, places, places_in
from .next_steps import after_unknown
from .prediction import Predicted
from .problem import Finding, Form, Problem
from .replicates import Scatter, exchanged, find_scatter, groups_of, odd_trials, split_trials, trends, with_scatter
from .scatter_gap import gap_with_scatter, weighed_residuals
from .search import Choice, choose
from .unrest import Unrest, find_unrest

__all__ = ["Diagnosis", "Gap", "diagnose"]

Tell = Callable[[str, float], None]

_MOST_FOR_COLOUR = 2.5
"""Chi-square per sample above which motion, not noise, fills the fast modes too."""
_OTHER = 0.1
"""Change of a noise's persistence, and relative change of its size, from which on it is another one."""
_MUCH = 3.0
"""Standard deviations of chi-square that a fit must leave for another one to be looked for."""
_REFITS = 400
"""Made-up campaigns of a thorough null."""
_MARGIN = 1.5
"""Standard deviations beyond the gate that something without a name must reach: no effect speaks for it."""
_OUT_OF_THE_WAY = 0.5
"""Share of what the base model leaves from which on a name has not taken the motion out of the way."""
_ASKED = 3
"""Hypotheses that are asked whether a trial of its own way is all that speaks against them."""
_NAMES = 2
"""Names beside which a trial may go its own way: more and a trial set aside would explain nearly anything."""
_SEEN_ELSEWHERE = 3.0
"""Nats by which a name must be better than none on the other trials, where one trial goes its own way."""


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

    def latent(self) -> dict[str, Any]:
        """Columns of latent.csv."""
        return latent_table(self.problem, self.best_values, self.forms)

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


def diagnose(
    problem: Problem,
    *,
    thorough: bool = False,
    seed: int = 0,
    tell: Tell | None = None,
    gates: Path | None = None,
    aside: Sequence[Finding] = (),
    looked_at: Sequence[str] = (),
    restless: bool = False,
    begun: _Begun | None = None,
    patient: bool = False,
) -> Diagnosis:
    """Diagnose a campaign. `tell(what, share done)` hears of progress; the same campaign gives the same answer.

    `thorough`: nulls by full refits, which takes as long as it takes; they are kept in the folder `gates`, if given,
    for the next campaign of the same design. `aside`: fitted trials that are to take no part (`astray`). `looked_at`:
    trials that must not be held out, others are in their place: the base model explains all but these.
    `restless`: what replicates differ by each in its own way (`unrest`) counts as noise; asked only whether a name that
    stands beside something unknown is there for certain. `begun`: what the same campaign's first fits have told.
    `patient`: look for further names before a trial is asked whether it goes its own way.
    """
    tell = tell or (lambda what, done: None)
    if hasattr(problem, "prepare"):
        problem.prepare(tell)
    tell("fitting the base model", 0.0)
    findings = list(problem.findings)
    fitted, held_out = split_trials(problem.trials)
    if hasattr(problem, "shake"):
        problem.shake({})
    if hasattr(problem, "calm"):
        problem.calm({})
    if begun is None or begun.jitters or not (aside or looked_at):  # or else all is fitted anew below
        base, jitters = _jittered(_whitened_fit(Model(problem, Whitener.white(problem), fitted)), held_out)
        odd = []
        if any(len(ids) > 2 for ids in groups_of(problem.trials).values()) or not hasattr(problem, "follows"):
            odd = odd_trials(_whitened_fit(base.model.on([t.id for t in problem.trials])))
        begun = _Begun(base, jitters, odd)
    base, jitters, odd = begun.base, begun.jitters, begun.odd
    if odd:
        findings += odd
        at_odds = {finding.trial for finding in odd}
        fitted, held_out = split_trials([t for t in problem.trials if t.id not in at_odds])
        base = _whitened_fit(base.model.on(fitted))
    if looked_at:
        fitted, held_out = exchanged(problem.trials, fitted, held_out, looked_at)
        base = _whitened_fit(base.model.on(fitted))
    if aside:
        findings += aside
        gone = {finding.trial for finding in aside}
        fitted = tuple(trial for trial in fitted if trial not in gone)
        base = _whitened_fit(base.model.on(fitted), beginnings=True)
    scatter = _scatter(base, held_out)
    findings += trends(scatter, problem.trials)
    base, model_std = _rescattered(base, scatter) if scatter.parameters else base, scatter.model_std
    unrest = _unrest(base, held_out) if restless else Unrest({})
    base = _doubted(_calmed(base, unrest), held_out)
    colours = _colours_of(base)
    base = _coloured(base, colours)
    tell("is anything left?", 0.0)
    columns, _ = signature_matrix(base, problem.forms)
    _, first = open_gate(
        base, signatures=columns, seed=seed, refit=thorough, draws=_REFITS if thorough else 600, folder=gates,
        tell=lambda done: tell("making the gate's null", done),
    )  # fmt: skip
    told = _Told(problem, first, findings, held_out, jitters)
    again = partial(diagnose, thorough=thorough, seed=seed, tell=tell, gates=gates, restless=restless, begun=begun)

    def nothing(last: Verdict | None = None) -> Diagnosis:
        """None is missing as far as the fitted trials tell; once more with others held out where these tell more."""
        if missed := () if looked_at else _missed(base, held_out, seed):
            tell("what is left shows in trials that were held out: others are held out", 0.0)
            return again(problem, aside=aside, looked_at=missed)
        findings.extend(_held_out_ways(base, held_out, seed))
        return told.finish(base, None, colours, {**model_std, **unrest.model_std}, "none", last=last)

    if first.passed:
        return nothing()
    recoloured = partial(_recoloured, colours=colours)
    own = None if aside or patient else partial(_all_astray, held_out=held_out, seed=seed, recoloured=recoloured)
    choice = choose(base, tell=tell, seed=seed, recoloured=recoloured, own_ways=own)
    if choice.astray:
        tell("a trial goes its own way: once more without it", 0.0)
        anew = again(problem, aside=choice.astray, looked_at=looked_at)
        return anew if anew.verdict != "unknown" else again(problem, looked_at=looked_at, patient=True)
    base = choice.base.fit
    if choice.best.effects and excess(choice.best.fit) < _OUT_OF_THE_WAY * excess(base):
        # With the motion out of the way replicates are compared once more.
        scatter = _scatter(choice.best.fit, held_out)
        wandering = _unrest(choice.best.fit, held_out) if restless else unrest
        if set(scatter.model_std) != set(model_std) or wandering.other_than(unrest):
            tell("replicates are found to differ otherwise: choosing again", 0.0)
            model_std, unrest = scatter.model_std, wandering
            base = _coloured(_calmed(_rescattered(base, scatter), unrest), colours)
            choice = choose(base, tell=tell, seed=seed, recoloured=partial(_recoloured, colours=colours))
            base = choice.base.fit
    for beside in () if restless else (choice.best.fit, choice.base.fit):
        scatter = _apart(beside, held_out) if not choice.left.passed else Scatter()
        if scatter.parameters and set(scatter.model_std) != set(model_std):
            tell("replicates are found to differ beside what is left: choosing again", 0.0)
            other = _coloured(_rescattered(_plain(base), scatter), colours)
            another = choose(other, tell=tell, seed=seed, recoloured=partial(_recoloured, colours=colours))
            if another.left.score < choice.left.score:
                choice, model_std = another, scatter.model_std
                base = choice.base.fit
    if choice.best.effects:  # times too: slopes are those of the motion as it is now known
        best, fresh_jitters = _jittered(choice.best.fit, held_out, jitters)
        if fresh_jitters:
            base = fit(base.model, base.values)
            if {j.channels for j in fresh_jitters} != {j.channels for j in jitters}:
                tell("times are found to jitter: choosing again", 0.0)
                choice = choose(base, tell=tell, seed=seed, recoloured=partial(_recoloured, colours=colours))
                base = choice.base.fit
            else:
                left = open_gate(best, seed=seed)[1]
                choice = replace(
                    choice, base=Hypothesis(base, score(base)), best=Hypothesis(best, score(best)), left=left
                )
            jitters = fresh_jitters
            told = replace(told, jitters=jitters)
    fresh = _colours_of(_plain(choice.best.fit))
    if _differ(fresh, colours):  # seen only now that the motion is out of the way: weigh once more
        best = _coloured(_plain(choice.best.fit), fresh)
        base, colours = _coloured(_plain(base), fresh), fresh
        left = open_gate(best, seed=seed)[1]
        choice = _moved(choice, base, best, left)
    if choice.best.effects:
        best = _doubted(choice.best.fit, held_out)
        if best is not choice.best.fit:
            left = open_gate(best, seed=seed)[1]
            base = fit(base.model, base.values)
            choice = _moved(choice, base, best, left)
    if thorough and choice.best.effects:
        left = open_gate(
            choice.best.fit, seed=seed, refit=True, draws=_REFITS, folder=gates,
            tell=lambda done: tell("making the null of what is left", done),
        )[1]  # fmt: skip
        choice = replace(choice, left=left)
    if not choice.best.effects and not is_strained(base) and choice.left.score < choice.left.threshold + _MARGIN:
        return nothing(choice.left)
    tell("verdict", 0.0)
    choice = replace(choice, best=replace(choice.best, fit=settled(choice.best.fit)))
    held = _held_out_verdict(choice.best.fit, held_out, seed) if held_out else None
    verdict = verdict_of(choice, held, held_out, seed, set_aside=bool(aside))
    asked = verdict == "unknown" and choice.left.passed and len(choice.best.effects) > 1  # before the second name
    if not (aside or asked) and (gone_astray := _own_ways(base, choice, verdict, held_out, seed, colours)):
        tell("a trial goes its own way: once more without it", 0.0)
        anew = again(problem, aside=gone_astray, looked_at=looked_at)
        if anew.verdict != "unknown":
            return anew
    sure: tuple[str, ...] = ()
    if verdict == "unknown" and not restless and choice.best.effects and (wander := _unrest(choice.best.fit, held_out)):
        tell("replicates differ each in its own way: once more, against that", 0.0)
        anew = again(deepcopy(problem), aside=aside, looked_at=looked_at, restless=True, begun=None)
        if anew.verdict == "named" and anew.choice is not None:
            # Fitted, and the gap taken, with the sensors' noise alone.
            sure = anew.effects
            best = settled(fit(base.model.with_forms(anew.forms), unscattered(anew.best)))
            # The table of candidates is of the likelihood in which they were weighed, its base model's with it.
            choice = replace(anew.choice, best=Hypothesis(best, score(best)), left=choice.left)
            held = _held_out_verdict(best, held_out, seed) if held_out else None
        model_std = {**model_std, **wander.model_std}
    if verdict in ("named", "ambiguous") and held is not None and not held.passed:
        findings += _held_out_ways(choice.best.fit, held_out, seed)
    model_std = {**model_std, **unrest.model_std}
    return told.finish(base, choice, colours, model_std, verdict, held=held, sure=sure)


@dataclass(frozen=True)
class _Begun:
    """What is known of a campaign before any trial is set aside or held out in another's place."""

    base: Fit
    jitters: tuple[Jitter, ...]
    odd: list[Finding]


def _whitened_fit(model: Model, *, beginnings: bool = False) -> Fit:
    """Fitted, with the whitening taken at the fit; where it leaves something, or in any case (`beginnings`), looked for
    from the beginnings, too."""
    found = fit(model)
    model.problem.rewhiten(found.values, ())
    found = fit(model, found.values)
    left = found.chi_square > found.count + _MUCH * math.sqrt(2 * found.count)
    if beginnings or (left and hasattr(model.problem, "follows")):
        return by_beginnings(found)
    return found


def _jittered(found: Fit, held_out: tuple[str, ...], known: tuple[Jitter, ...] = ()) -> tuple[Fit, tuple[Jitter, ...]]:
    """With times that jitter taken into account, at the slopes of this fit; and the clocks found here or `known`."""
    jitters = tuple({jitter.channels: jitter for jitter in (*known, *find_jitter(found))}.values())
    if not jitters:
        return found, ()
    problem: Any = found.model.problem
    problem.shake(steepness(problem, jitters, values_of_all(found, held_out), found.model.forms))
    problem.rewhiten(found.values, found.model.forms)
    return fit(found.model, found.values), jitters


def _doubted(found: Fit, held_out: tuple[str, ...]) -> Fit:
    """With readings that this model makes doubtful counted for little (`TumbleProblem.doubt`), where there are any."""
    problem: Any = found.model.problem
    if not hasattr(problem, "doubt"):
        return found
    values = held_out_fit(found.model, held_out, found.values) if held_out else found.values
    return fit(found.model, found.values) if problem.doubt(values, found.model.forms) else found


def _moved(choice: Choice, base: Fit, best: Fit, left: Verdict) -> Choice:
    """The choice with both fitted in another likelihood; scores stay those of the one in which all were weighed."""
    return replace(choice, base=replace(choice.base, fit=base), best=replace(choice.best, fit=best), left=left)


def _plain(found: Fit) -> Fit:
    """The same with noise taken as white."""
    return fit(replace(found.model, whitener=Whitener.white(found.model.problem)), found.values)


def _coloured(found: Fit, colours: Mapping[str, Colour]) -> Fit:
    """The same with noise of these colours; `found` has white noise."""
    if not colours:
        return found
    return fit(replace(found.model, whitener=whitener_for(found, dict(colours))), found.values)


def _recoloured(found: Fit, colours: Mapping[str, Colour]) -> Fit:
    """The same with the noise that it leaves, where that is another than `colours`."""
    if found.chi_square > _MOST_FOR_COLOUR * found.count:
        return found
    fresh = _colours_of(_plain(found))
    return _coloured(_plain(found), fresh) if _differ(fresh, colours) else found


def _colours_of(found: Fit) -> dict[str, Colour]:
    """Colours of the noise, where the misfit is small enough for the fast modes to hold nothing else; where it is not,
    how loud the noise is, if it is all the time."""
    loud: dict[str, Colour] = {}
    if found.chi_square > _MOST_FOR_COLOUR * found.count:
        loud = find_loud(found)
        rest = _coloured(found, loud)
        if not loud or rest.chi_square > _MOST_FOR_COLOUR * rest.count:
            return loud
    return loud | find_colours(found)


def _scatter(found: Fit, held_out: tuple[str, ...], *, apart: bool = False) -> Scatter:
    """Asked of all trials, and of the model without any scatter so far."""
    model = replace(found.model, scatter=())
    if all(len(ids) < 2 for ids in groups_of(model.problem.trials).values()):
        return Scatter()
    return find_scatter(fit(model.on((*model.trials, *held_out)), unscattered(found)), apart=apart)


def _apart(found: Fit, held_out: tuple[str, ...]) -> Scatter:
    """What replicates differ by where what is left hides it; none where they cannot be compared row by row."""
    return _scatter(found, held_out, apart=True) if hasattr(found.model.problem, "calm") else Scatter()


def _unrest(found: Fit, held_out: tuple[str, ...]) -> Unrest:
    """How replicates wander apart beyond what trials' own numbers say: asked of all trials."""
    problem = found.model.problem
    if not hasattr(problem, "calm"):
        return Unrest({})
    values = held_out_fit(found.model, held_out, found.values) if held_out else found.values
    return find_unrest(found, values, (*found.model.trials, *held_out))


def _calmed(found: Fit, unrest: Unrest) -> Fit:
    """The same with what replicates differ by taken for noise, which is white otherwise."""
    problem: Any = found.model.problem
    if not unrest and not getattr(problem, "calmed", {}):
        return found
    problem.calm(unrest.weights(problem) if unrest else {})
    return _plain(found)


def _rescattered(found: Fit, scatter: Scatter) -> Fit:
    """The same with this scatter and no other, from where it was asked for and, with none, from here."""
    model = replace(found.model, scatter=scatter.parameters)
    if not scatter.parameters:
        return fit(model, unscattered(found))
    return with_scatter(model, {**unscattered(found), **scatter.values})


def _differ(one: Mapping[str, Colour], other: Mapping[str, Colour]) -> bool:
    white = Colour("", 1.0, 0.0)
    pairs = [(one.get(name, white), other.get(name, white)) for name in set(one) | set(other)]
    return any(abs(a.persistence - b.persistence) > _OTHER or abs(a.std - b.std) > _OTHER * b.std for a, b in pairs)


def _held_out_verdict(found: Fit, held_out: tuple[str, ...], seed: int) -> Verdict:
    """The gate on trials that took no part, with the scatter of replicates where it was found."""
    return held_out_gate(found, held_out, held_out_fit(found.model, held_out, found.values), seed=seed)


def _missed(base: Fit, held_out: tuple[str, ...], seed: int) -> tuple[str, ...]:
    """Trials held out that the base model does not explain, although it does all that were fitted."""
    if not held_out:
        return ()
    found = settled(base)
    values = held_out_fit(found.model, held_out, found.values)
    if astray_held_out(found, held_out, values, allowed(len(held_out)), seed=seed) is not None:
        return ()
    after = gap_of(found.model.problem, found.model, values_of_all(found, held_out), found.model.trials, held_out)
    if (after.held_out or 0.0) <= SMALL:
        return ()
    return tuple(t for t in held_out if not held_out_gate(found, (t,), values, seed=seed).passed) or held_out


def _held_out_ways(found: Fit, held_out: tuple[str, ...], seed: int) -> list[Finding]:
    """Trials held out that go ways of their own: they stay in the gap, and it is said."""
    if not held_out:
        return []
    found = settled(found)
    values = held_out_fit(found.model, held_out, found.values)
    gone = astray_held_out(found, held_out, values, len(held_out), seed=seed, enough=SMALL) or ()
    return [own for trial in gone if (own := astray_finding(found, trial, values, set_aside=False)) is not None]


def _own_ways(
    base: Fit, choice: Choice, verdict: str, held_out: tuple[str, ...], seed: int, colours: Mapping[str, Colour]
) -> tuple[Finding, ...]:
    """Trials that go ways of their own, where the base model explains all others and a name nothing but them, or where
    a name explains all others and nothing has a name as it is."""
    ask = partial(astray, held_out=held_out, seed=seed, recoloured=partial(_recoloured, colours=colours))
    gone = ask(base)
    if verdict == "unknown":
        for other in () if gone else _likeliest(choice):
            gone = gone or ask(other.fit)
    elif gone:
        rest = tuple(t for t in base.model.trials if t not in {finding.trial for finding in gone})
        plain = score(fit(base.model.on(rest)))
        if score(fit(choice.best.fit.model.on(rest), choice.best.fit.values)) > plain + _SEEN_ELSEWHERE:
            return ()
    return gone


def _all_astray(
    base: Fit, best: Fit, *, held_out: tuple[str, ...], seed: int, recoloured: Callable[[Fit], Fit]
) -> tuple[Finding, ...]:
    """Trials whose ways of their own are all that speaks against the base model, or else against the best name."""
    ask = partial(astray, held_out=held_out, seed=seed, recoloured=recoloured)
    return ask(base) or (ask(best) if best.model.forms else ())


def _likeliest(choice: Choice) -> list[Hypothesis]:
    """The best, where that is no more than two names, and the likeliest single ones."""
    found = {choice.best.effects: choice.best} if 0 < len(choice.best.effects) <= _NAMES else {}
    for _, tried in sorted(choice.table, key=lambda row: -row[1].score):
        if len(tried.effects) == 1 and len(found) < _ASKED:
            found.setdefault(tried.effects, tried)
    return list(found.values())


@dataclass(frozen=True)
class _Told:
    """What is known before anything is chosen."""

    problem: Problem
    first: Verdict
    findings: list[Finding]
    held_out: tuple[str, ...]
    jitters: tuple[Jitter, ...]

    def finish(
        self, base: Fit, choice: Choice | None, colours: Mapping[str, Colour], model_std: Mapping[str, float],
        verdict: str, *, last: Verdict | None = None, held: Verdict | None = None,
        sure: tuple[str, ...] = (),
    ) -> Diagnosis:  # fmt: skip
        """The diagnosis, its gaps and places."""
        base = settled(base)
        problem, held_out, fitted = self.problem, self.held_out, base.model.trials
        best = choice.best.fit if choice is not None else base
        # With a factor a trial the base model leaves to the factors what it lacks: that of one mean bed is another.
        plain = (
            fit(replace(base.model, scatter=()), unscattered(base))
            if verdict != "none" and base.model.scatter
            else base
        )
        base_values, best_values = values_of_all(plain, held_out), values_of_all(best, held_out)
        effects = choice.best.effects if choice is not None else ()
        before = gap_of(problem, base.model, base_values, fitted, held_out)
        after = before if verdict == "none" else gap_of(problem, best.model, best_values, fitted, held_out)
        if verdict == "unknown" and choice is not None and effects:
            stays = effects if certain(base, choice) and closes(base, best, held_out) else sure
            effects = tuple(effect for effect in effects if effect in stays)
        where = [] if verdict == "none" else places(base.model, base_values, (*fitted, *held_out))
        rivals = smallest(choice) if choice is not None and verdict == "ambiguous" else ()
        alternatives = tuple(next(e for e in rival.effects if e not in effects) for rival in rivals)
        rival_forms = tuple(next(f for f in rival.forms if f.effect == e)
                            for rival, e in zip(rivals, alternatives, strict=True))  # fmt: skip
        told, shares, left = "", dict[str, float](), list[Place]()
        findings = (*self.findings, *(jitter.finding for jitter in self.jitters))
        if verdict == "unknown":
            told, shares = depends_on(latent_table(problem, best_values, best.model.forms))
            rest = weighed_residuals(problem, model_std, best_values, best.model.forms, (*fitted, *held_out))
            left = places_in(problem, best_values, best.model.forms, rest)
        found = Diagnosis(
            verdict=verdict, problem=problem, base=base, best=best, base_values=base_values, best_values=best_values,
            effects=effects, alternatives=alternatives, rivals=rival_forms, where=tuple(where), before=before,
            after=after, fitted=fitted, held_out=held_out, gate_before=self.first,
            gate_after=last or (choice.left if choice is not None else self.first), gate_held_out=held, choice=choice,
            colours=colours, jitters=self.jitters, model_std=model_std, findings=findings, depends_on=told,
            shares=shares, left=tuple(left), next_experiment="",
        )  # fmt: skip
        return replace(found, next_experiment=_next(found))


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
        problem, found.best_values, found.forms, found.left, found.shares, beside=choice.best.effects,
        is_scatter=bool(found.effects) and weighed is not None and max(v or 0.0 for v in weighed.after) <= SMALL,
    )  # fmt: skip
