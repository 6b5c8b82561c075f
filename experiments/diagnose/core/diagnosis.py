"""From a problem to a diagnosis: split, fit, gate, search, verdict. Independent of the kind of trials."""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from experiments.diagnose.fit.bounds import is_strained
from experiments.diagnose.fit.evidence import Hypothesis, excess, held_out_fit, signature_matrix
from experiments.diagnose.fit.fitting import Fit, Model, Whitener, by_beginnings, fit, settled
from experiments.diagnose.fit.gate import Verdict, held_out_gate, open_gate
from experiments.diagnose.fit.problem import Array, Finding, Problem, Values
from experiments.diagnose.noise.colour import Colour
from experiments.diagnose.noise.diverging import diverging_trials, most_diverging
from experiments.diagnose.noise.jitter import Jitter
from experiments.diagnose.noise.lone_beds import lone_finding
from experiments.diagnose.noise.replicates import Scatter, exchanged, groups_of, odd_trials, split_trials, trends
from experiments.diagnose.noise.wander import Wander

from . import deciding, matters, renoised, too_noisy
from .outcome import Diagnosis, Known, finish
from .pairs import FormsStart
from .search import Choice, Search
from .search_names import differ_words, named_search, new_in_course

__all__ = ["diagnose"]

Tell = Callable[[str, float], None]

_DRAWS, _REFITS = 600, 400  # synthetic campaigns of a null, and of a thorough one, each of them refitted
_MARGIN = 1.5  # standard deviations beyond the gate that something unknown must reach, as no effect supports it
_MOST_LEFT = 2.5  # chi-square a sample up to which an effect is near enough to the motion to weight rows by it
_ON = 1.0  # chi-square by which a fit must improve to be taken instead
_NO_MOTION = 0.5  # share of what the base model leaves, below which an effect describes the motion


def diagnose(
    problem: Problem, *, thorough: bool = False, seed: int = 0, tell: Tell | None = None, gates: Path | None = None
) -> Diagnosis:
    """Diagnose a campaign; the same campaign gives the same answer. `tell(what, share done)` reports progress.
    `thorough`: nulls by full refits, which takes long; they are kept in the folder `gates`, if given."""
    asked = _Asked(thorough, seed, tell or (lambda what, done: None), gates)
    other = deepcopy(problem) if problem.loose else None
    found = _Course(problem, asked).run()
    if found.verdict == "unknown" and other is not None:
        asked.tell(f"unknown: once more without {problem.loose}", 0.0)
        other.base = tuple(parameter for parameter in other.base if parameter.name != problem.loose)
        found = _Course(other, asked).run()
    return too_noisy.as_contract(found)


@dataclass(frozen=True)
class _Begun:
    """What is known of a campaign before any trial is set aside or held out in another's place."""

    base: Fit
    jitters: tuple[Jitter, ...]
    odd: list[Finding]


@dataclass(frozen=True)
class _Asked:
    """The options of a course."""

    thorough: bool
    seed: int
    tell: Tell
    gates: Path | None
    aside: Sequence[Finding] = ()  # fitted trials that are to take no part (`noise.diverging`)
    looked_at: Sequence[str] = ()  # trials that must not be held out, as the base model explains all but these
    with_wander: bool = False  # the wander of replicates counts as noise: a test beside something unknown
    begun: _Begun | None = None  # from an earlier course of the same campaign
    patient: bool = False  # search further effects before trials may diverge
    count: Iterator[int] = field(default_factory=itertools.count)  # of searches, through all courses


class _Course:
    """One course of a diagnosis: what is known so far, and the steps in their order."""

    colours: dict[str, Colour]
    first: Verdict  # the gate on the base model

    def __init__(self, problem: Problem, asked: _Asked) -> None:
        self.problem, self.asked, self.tell = problem, asked, asked.tell
        self.wander = Wander({})
        self.model_std: Mapping[str, float] = {}
        self.alone: Fit | None = None  # the base model's fit as its own weights have it
        self.known: dict[str, Values] = {}  # where forms ended alone in the searches so far
        self.pairs: dict[frozenset[str], tuple[FormsStart, ...]] = {}  # and pairs, beside these kinds of scatter

    def run(self) -> Diagnosis:
        """All steps; some findings begin the course anew."""
        asked = self.asked
        self._fit_base()
        self._find_noise()
        self._ask_gate()
        if self.first.passed:
            return self._nothing()
        begun = self.base
        new = new_in_course(aside=asked.aside, looked_at=asked.looked_at, with_wander=asked.with_wander)
        choice = self._chosen(new, may_diverge=not (asked.aside or asked.patient))
        if choice.diverging:
            self.tell("a trial goes its own way: once more without it", 0.0)
            if self._stands(anew := self._again(aside=choice.diverging, looked_at=asked.looked_at), choice.diverging):
                return anew
            return self._again(looked_at=asked.looked_at, patient=True)
        if self.base.objective < begun.objective - _ON:
            self.first = self._gate_of_base()  # what it left was a branch that the search has found
            if self.first.passed:
                return self._nothing()
        for step in (
            self._reweighed, self._scattered, self._scattered_beside, self._scattered_alone, self._reweighed,
            self._timed, self._recoloured_choice, self._doubted,
        ):  # fmt: skip
            choice = step(choice)
        if asked.thorough and choice.best.effects:
            choice = replace(choice, left=self._gate(choice.best.fit, "making the null of what is left"))
        strained, least = is_strained(self.base), choice.left.threshold + _MARGIN
        if not choice.best.effects and not strained and choice.left.score < least:
            return self._nothing(choice.left)
        return self._decided(choice)

    def _fit_base(self) -> None:
        """Split the trials and fit the base model, without trials at odds with their replicates and those set aside."""
        problem, asked = self.problem, self.asked
        problem.prepare(self.tell)
        self.tell("fitting the base model", 0.0)
        self.findings = list(problem.findings)
        fitted, self.held_out = split_trials(problem.trials)
        problem.shake({})
        problem.calm({})
        begun = asked.begun
        if begun is None or begun.jitters or not (asked.aside or asked.looked_at):  # or else all is fitted anew below
            plain = renoised.whitened_fit(Model(problem, Whitener.white(problem), fitted))
            base, jitters = renoised.jittered(plain, self.held_out)
            odd = []
            if any(len(ids) > 2 for ids in groups_of(problem.trials).values()) or problem.contacts is None:
                odd = odd_trials(renoised.whitened_fit(base.model.on([t.id for t in problem.trials])))
            begun = _Begun(base, jitters, odd)
        self.begun, self.jitters, base = begun, begun.jitters, begun.base
        if begun.odd:
            self.findings += begun.odd
            at_odds = {finding.trial for finding in begun.odd}
            fitted, self.held_out = split_trials([t for t in problem.trials if t.id not in at_odds])
            base = renoised.whitened_fit(base.model.on(fitted))
        if asked.looked_at:
            fitted, self.held_out = exchanged(problem.trials, fitted, self.held_out, asked.looked_at)
            base = renoised.whitened_fit(base.model.on(fitted))
        if asked.aside:
            self.findings += asked.aside
            gone = {finding.trial for finding in asked.aside}
            fitted = tuple(trial for trial in fitted if trial not in gone)
            base = renoised.whitened_fit(base.model.on(fitted), beginnings=True)
        self.base = base

    def _find_noise(self) -> None:
        """The scatter of replicates, readings in doubt, and the noise's colour."""
        scatter = renoised.scatter_of(self.base, self.held_out)
        self.findings += trends(scatter, self.problem.trials)
        self.model_std = scatter.model_std
        base = renoised.rescattered(self.base, scatter) if scatter.parameters else self.base
        if self.asked.with_wander:
            self.wander = renoised.wander_of(base, self.held_out)
        base = renoised.doubted(renoised.calmed(base, self.wander), self.held_out)
        self.colours = renoised.colours_of(base)
        self.base = renoised.coloured(base, self.colours)

    def _ask_gate(self) -> None:
        """Whether the base model leaves anything; where it is rough and leaves little, also from the beginnings."""
        self.tell("is anything left?", 0.0)
        self.first = self._gate_of_base()
        if self.first.passed or self.problem.contacts is None or renoised.leaves_much(self.base):
            return
        other = by_beginnings(self.base)
        if other is not self.base:
            self.base = other
            self.first = self._gate_of_base()

    def _gate_of_base(self) -> Verdict:
        return self._gate(self.base, "making the gate's null", signature_matrix(self.base, self.problem.forms)[0])

    def _gate(self, found: Fit, what: str, signatures: Array | None = None) -> Verdict:
        """The gate on a fit, by full refits where these were asked for."""
        asked = self.asked
        return open_gate(
            found, signatures=signatures, seed=asked.seed, refit=asked.thorough, folder=asked.gates,
            draws=_REFITS if asked.thorough else _DRAWS, tell=lambda done: self.tell(what, done),
        )[1]  # fmt: skip

    def _recoloured(self, found: Fit) -> Fit:
        return renoised.recoloured(found, self.colours)

    def _diverging(self, found: Fit) -> tuple[Finding, ...]:
        """Trials that diverge from a fit."""
        return diverging_trials(found, self.held_out, seed=self.asked.seed, recoloured=self._recoloured)

    def _chosen(self, new: str, *, may_diverge: bool = False) -> Choice:
        """A search, with this `new` in it, which may find a better base model or stop where trials diverge from it."""

        def diverging(base: Fit, best: Fit) -> tuple[Finding, ...]:
            return self._diverging(base) or (self._diverging(best) if best.model.forms else ())

        kinds = frozenset(p.kind for p in self.base.model.scatter)
        find, pairs = diverging if may_diverge else None, self.pairs.get(kinds, ())
        tell = named_search(self.tell, next(self.asked.count), new)
        search = Search(self.base, tell=tell, seed=self.asked.seed, recoloured=self._recoloured, known=self.known,
                        known_pairs=pairs, find_diverging=find)  # fmt: skip
        choice = search.choose()
        self.known, self.pairs[kinds] = self.known | search.alone, search.pairs
        if not choice.diverging:
            self.base = choice.base.fit
        return choice

    def _reweighed(self, choice: Choice) -> Choice:
        """With rows weighted by the best model, once one is near enough: what a path's error does depends on it."""
        best = choice.best
        if self.alone is not None or self.asked.with_wander or not (best.effects and self.problem.by_path):
            return choice
        if best.fit.chi_square > _MOST_LEFT * best.fit.count or not self._describes_motion(best):
            return choice
        self.alone = fit(replace(self.base.model, scatter=()), deciding.unscattered(self.base))
        self.problem.rewhiten(best.fit.values, best.fit.model.forms)
        self.base = fit(self.base.model, self.base.values)
        found = fit(best.fit.model, best.fit.values)
        choice = self._moved(choice, found)
        if not choice.left.passed and (other := self._recoloured(found)) is not found:
            choice = replace(choice, left=open_gate(other, seed=self.asked.seed)[1])
        if choice.left.passed and len(best.effects) == 1 and not choice.alternatives:
            return choice
        return self._chosen("readings weighed by what was found")

    def _describes_motion(self, best: Hypothesis) -> bool:
        """Whether the best model has effects that leave noise rather than motion."""
        return bool(best.effects) and excess(best.fit) < _NO_MOTION * excess(self.base)

    def _scattered(self, choice: Choice) -> Choice:
        """Replicates compared once more, beside effects that describe the motion."""
        best = choice.best
        if not self._describes_motion(best):
            return choice
        scatter = renoised.scatter_of(best.fit, self.held_out)
        wander = renoised.wander_of(best.fit, self.held_out) if self.asked.with_wander else self.wander
        if set(scatter.model_std) == set(self.model_std) and not wander.other_than(self.wander):
            return choice
        self.model_std, self.wander = scatter.model_std, wander
        self.base = renoised.coloured(renoised.calmed(renoised.rescattered(self.base, scatter), wander), self.colours)
        return self._chosen(differ_words(scatter.model_std) if scatter.model_std else "replicates wander")

    def _scattered_beside(self, choice: Choice) -> Choice:
        """Where something is left, replicates are compared by what each has of its own."""
        if not self._compares(choice):
            return choice
        fits, named = (choice.best.fit, choice.base.fit), choice.left.passed
        later = [kinds for kinds in (self.problem.zero_scatter, self.problem.force_scatter) if kinds]
        for kinds, beside in itertools.product(((), *later), fits[1:] if named else fits):
            if choice.left.passed and not named:
                break
            scatter = renoised.scatter_of(beside, self.held_out, apart=True, kinds=kinds)
            if not scatter.parameters or set(scatter.model_std) == set(self.model_std):
                continue
            if named:
                if other := self._without_name(scatter, choice):
                    return other
                continue
            than = None if kinds == self.problem.force_scatter else choice
            choice = self._reweighed(self._chosen_with(scatter, than=than) or choice)
        return choice

    def _scattered_alone(self, choice: Choice) -> Choice:
        """Where no trial repeats another, and something is left: whether beds, or zeros, differ without a rule."""
        if not self._compares(choice):
            return choice
        found: list[tuple[Scatter, Fit]] = []
        fits, asked = (choice.best.fit, choice.base.fit), self.problem.lone_scatter
        for beside, kinds in itertools.product(fits[1:] if choice.left.passed else fits, asked):
            scatter, findings = renoised.lone_scatter_of(beside, self.held_out, kinds=kinds)
            self.findings += [finding for finding in findings if finding not in self.findings]
            if scatter.parameters and all(scatter.model_std != other.model_std for other, _ in found):
                found.append((scatter, renoised.rescattered(renoised.plain(self.base), scatter)))
        # Zeros of depth and force are next to the same in a stiff bed: the likeliest is asked first.
        for scatter, beside in sorted(found, key=lambda one: one[1].objective):
            if choice.left.passed:
                other = self._without_name(scatter, choice, beside)
            else:
                other = self._chosen_with(scatter, beside, what="trials")
            if other:
                self.findings.append(lone_finding(scatter))
                return other
        return choice

    def _chosen_with(self, scatter: Scatter, base: Fit | None = None, *, than: Choice | None = None,
                     what: str = "replicates") -> Choice | None:  # fmt: skip
        """A choice anew beside `scatter`, kept where it explains all, or leaves less `than` another; else None, and all
        is as before. `base`: the base model's fit with it, the noise white, where that is known."""
        before = self._beside(scatter, base)
        other = self._chosen(differ_words(scatter.model_std, what))
        if other.left.passed if than is None else other.left.score < than.left.score:
            self.model_std = scatter.model_std
            return other
        self.base, self.colours = before
        return None

    def _without_name(self, scatter: Scatter, choice: Choice, base: Fit | None = None) -> Choice | None:
        """In place of an effect that explains the fitted trials and not those held out: none, where the base model
        beside `scatter` explains both; else None, and all is as before."""
        before = self._beside(scatter, base)
        left, held = self._gate_of_base(), self._held_out_gate(self.base)
        if left.passed and (held is None or held.passed):
            self.model_std = scatter.model_std
            nothing = Hypothesis.of(self.base)
            return Choice(nothing, nothing, (), choice.table, left)
        self.base, self.colours = before
        return None

    def _beside(self, scatter: Scatter, base: Fit | None) -> tuple[Fit, dict[str, Colour]]:
        """Take `scatter` into the base model, and the colour that shows then; fit and colours as they were."""
        before = self.base, self.colours
        base = base or renoised.rescattered(renoised.plain(self.base), scatter)
        self.colours = {**self.colours, **renoised.colours_of(base)}
        self.base = renoised.coloured(base, self.colours)
        return before

    def _compares(self, choice: Choice) -> bool:
        """Whether trials are to be compared with one another once more (pushes and drops only)."""
        return not self.asked.with_wander and self.problem.by_path and not self._settled(choice)

    def _settled(self, choice: Choice) -> bool:
        """Whether the best leaves nothing of trials that were fitted and, with effects, of those held out."""
        if not choice.left.passed or not choice.best.effects:
            return choice.left.passed
        held = self._held_out_gate(choice.best.fit)
        return held is None or held.passed

    def _timed(self, choice: Choice) -> Choice:
        """The error of jittering times, from the slopes of the motion in the present fit."""
        if not choice.best.effects:
            return choice
        best, jitters = renoised.jittered(choice.best.fit, self.held_out, self.jitters)
        if not jitters:
            return choice
        known = {jitter.channels for jitter in self.jitters}
        self.jitters, self.base = jitters, fit(self.base.model, self.base.values)
        if {jitter.channels for jitter in jitters} != known:
            return self._chosen("times jitter")
        left = open_gate(best, seed=self.asked.seed)[1]
        base = Hypothesis.of(self.base)
        return replace(choice, base=base, best=Hypothesis.of(best), left=left)

    def _recoloured_choice(self, choice: Choice) -> Choice:
        """With a colour that shows only beside effects that describe the motion."""
        white = renoised.plain(choice.best.fit)
        fresh = renoised.colours_of(white)
        if not renoised.differ(fresh, self.colours):
            return choice
        best = renoised.coloured(white, fresh)
        self.base, self.colours = renoised.coloured(renoised.plain(self.base), fresh), fresh
        return self._moved(choice, best)

    def _doubted(self, choice: Choice) -> Choice:
        """With readings in doubt that the best model makes so."""
        if not choice.best.effects:
            return choice
        best = renoised.doubted(choice.best.fit, self.held_out)
        if best is choice.best.fit:
            return choice
        self.base = fit(self.base.model, self.base.values)
        return self._moved(choice, best)

    def _moved(self, choice: Choice, best: Fit) -> Choice:
        """The base model's fit and the best one as they are now; scores stay those by which all were compared."""
        left = open_gate(best, seed=self.asked.seed)[1]
        base = replace(choice.base, fit=self.base)
        return replace(choice, base=base, best=replace(choice.best, fit=best), left=left)

    def _decided(self, choice: Choice) -> Diagnosis:
        """Named, ambiguous or unknown, after trials that diverge and replicates that wander have been considered."""
        asked, held_out = self.asked, self.held_out
        self.tell("verdict", 0.0)
        choice = self._ended(choice)
        if choice.best.effects and self.problem.contacts is not None and deciding.explains_nothing(choice, held_out):
            return self._nothing(choice.left)
        held = self._held_out_gate(choice.best.fit)
        verdict = deciding.verdict_of(choice, held, held_out, asked.seed, set_aside=bool(asked.aside))
        everything = verdict in ("named", "ambiguous") and choice.left.passed and (held is None or held.passed)
        left = matters.left_by(self.base, held_out, self._scatter)
        if not (everything and matters.takes_below(left, choice.best.fit, held_out, self._scatter)):
            if (enough := self._base_suffices(left, choice, verdict)) is not None:
                return enough
            of_size, verdict = self._by_size(choice, verdict)
            if of_size is not choice:
                choice, held = of_size, self._held_out_gate(of_size.best.fit)
        # Where a second effect was called for, diverging trials were considered before it.
        before = verdict == "unknown" and choice.left.passed and len(choice.best.effects) > 1
        if not (asked.aside or before):
            gone = deciding.diverging_beside(self.base, choice, verdict, self._diverging)
            if gone:
                self.tell("a trial goes its own way: once more without it", 0.0)
                if self._stands(anew := self._again(aside=gone, looked_at=asked.looked_at), gone):
                    return anew
        explains = verdict == "unknown" and bool(choice.best.effects) and choice.left.passed
        if explains and not (asked.looked_at or asked.aside):
            # What no fitted trial shows of a form may show in these: an effect then has to explain all of them.
            others = deciding.missed(choice.best.fit, held_out, asked.seed)
            if others:
                anew = self._looking_at(others)
                if anew.verdict != "unknown":
                    return anew
        sure: tuple[str, ...] = ()
        model_std = self.model_std
        if verdict == "unknown" and not asked.with_wander and choice.best.effects:
            wander = renoised.wander_of(choice.best.fit, held_out)
            if wander:
                self.tell("replicates differ each in its own way: once more, against that", 0.0)
                anew = self._again(
                    deepcopy(self.problem), aside=asked.aside, looked_at=asked.looked_at, with_wander=True, begun=None
                )
                if anew.verdict == "named" and anew.choice is not None:
                    # Fitted, and the gap taken, with the sensors' noise alone.
                    sure = anew.effects
                    best = settled(fit(self.base.model.with_forms(anew.forms), deciding.unscattered(anew.best)))
                    # The table of candidates, its base model with it, is of the likelihood in which it was made.
                    choice = replace(anew.choice, best=Hypothesis.of(best), left=choice.left)
                    held = self._held_out_gate(best)
                model_std = {**model_std, **wander.model_std}
                if sure and matters.explains(choice, held_out, {**self._scatter, **model_std}):
                    verdict = "named"  # as near as another replicate comes
        if verdict in ("named", "ambiguous") and held is not None and not held.passed:
            self.findings += deciding.held_out_divergences(choice.best.fit, held_out, asked.seed)
        return finish(self._known(model_std), self.base, choice, verdict, alone=self.alone, held=held, sure=sure)

    @property
    def _scatter(self) -> dict[str, float]:
        """All that replicates differ by, as known so far."""
        return {**self.problem.known_std, **self.model_std, **self.wander.model_std}

    def _base_suffices(self, left: deciding.Gap, choice: Choice, verdict: str) -> Diagnosis | None:
        """That nothing is missing, where what the base model leaves is too small to matter; with other trials held out
        where only those show more, unless these diverge late. None where it leaves more."""
        small = matters.is_small(left, len(self.base.model.trials), len(self.held_out))
        if not small and left.fit > matters.MOST:
            return None
        others = () if small else deciding.missed(self.base, self.held_out, self.asked.seed)
        if not others:
            return self._nothing(choice.left) if matters.is_as_stated(self.base, self._scatter) else None
        if verdict != "unknown" or self.asked.looked_at:
            return None
        anew = self._looking_at(others)
        return None if anew.verdict == "unknown" else anew

    def _by_size(self, choice: Choice, verdict: str) -> tuple[Choice, str]:
        """The fewest names that explain what matters, and the verdict that follows."""
        fewest = matters.fewest(choice, self.held_out, self._scatter)
        bends = deciding.bends_to_anything(fewest, set_aside=bool(self.asked.aside))
        if bends or (fewest is choice and not matters.explains(choice, self.held_out, self._scatter)):
            return fewest, verdict
        return fewest, "ambiguous" if fewest.alternatives else "named"

    def _stands(self, anew: Diagnosis, gone: Sequence[Finding]) -> bool:
        """Whether a diagnosis without the trials `gone` is kept; a whole condition is set aside for an effect only."""
        few = len(gone) <= most_diverging(len(self.base.model.trials))
        return anew.verdict != "unknown" and (few or anew.verdict != "none")

    def _ended(self, choice: Choice) -> Choice:
        """The best fit once more from where it is: one that had stopped at a bend of the model may go on."""
        best = choice.best.fit
        again = fit(best.model, best.values)
        if again.objective < best.objective - _ON:
            choice = self._moved(choice, again)
        return replace(choice, best=replace(choice.best, fit=settled(choice.best.fit)))

    def _nothing(self, last: Verdict | None = None) -> Diagnosis:
        """No effect is missing by the fitted trials; once more with others held out where these show more."""
        if others := () if self.asked.looked_at else deciding.missed(self.base, self.held_out, self.asked.seed):
            return self._looking_at(others)
        self.findings += deciding.held_out_divergences(self.base, self.held_out, self.asked.seed)
        return finish(self._known(self.model_std), self.base, None, "none", alone=self.alone, last=last)

    def _known(self, model_std: Mapping[str, float]) -> Known:
        findings = (*self.findings, *(jitter.finding for jitter in self.jitters))
        model_std = {**self._scatter, **model_std}
        return Known(self.problem, self.held_out, self.first, findings, self.jitters, self.colours, model_std)

    def _held_out_gate(self, found: Fit) -> Verdict | None:
        """The gate on trials that took no part, with the scatter of replicates where it was found."""
        if not self.held_out:
            return None
        values = held_out_fit(found.model, self.held_out, found.values)
        return held_out_gate(found, self.held_out, values, seed=self.asked.seed)

    def _looking_at(self, others: tuple[str, ...]) -> Diagnosis:
        """The whole course once more with the held-out trials `others` fitted, and other ones held out."""
        self.tell("what is left shows in trials that were held out: others are held out", 0.0)
        return self._again(aside=self.asked.aside, looked_at=others)

    def _again(self, problem: Problem | None = None, **changes: Any) -> Diagnosis:
        """The whole course once more, with other trials aside or held out."""
        usual: dict[str, Any] = {"aside": (), "looked_at": (), "patient": False, "begun": self.begun}
        return _Course(problem or self.problem, replace(self.asked, **{**usual, **changes})).run()
