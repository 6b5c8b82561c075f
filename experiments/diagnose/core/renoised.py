"""Fits repeated where the noise, or the scatter of replicates, turns out to be another."""

import math
from collections.abc import Mapping
from dataclasses import replace

from experiments.diagnose.fit.evidence import held_out_fit
from experiments.diagnose.fit.fitting import Fit, Model, Whitener, by_beginnings, fit
from experiments.diagnose.fit.problem import Finding
from experiments.diagnose.noise.colour import Colour, find_colours, find_white_noise, whitener_for
from experiments.diagnose.noise.jitter import Jitter, find_jitter, steepness
from experiments.diagnose.noise.lone_beds import find_lone_scatter
from experiments.diagnose.noise.replicates import Scatter, find_scatter, groups_of, with_scatter
from experiments.diagnose.noise.wander import Wander, find_wander

from .deciding import unscattered, values_of_all

__all__ = [
    "calmed", "coloured", "colours_of", "differ", "doubted", "jittered", "leaves_much", "lone_scatter_of", "plain",
    "recoloured", "rescattered", "scatter_of", "wander_of", "whitened_fit",
]  # fmt: skip

_MOST_FOR_COLOUR = 2.5  # chi-square per sample above which motion, not noise, fills the fast modes too
_OTHER = 0.1  # change of a noise's persistence, and relative change of its size, from which on it is another one
_MUCH = 3.0  # standard deviations of chi-square that a fit must leave for another fit to be tried


def whitened_fit(model: Model, *, beginnings: bool = False) -> Fit:
    """The fit, with the whitening taken at the fit; where it leaves something, or in any case (`beginnings`), also
    begun from the trials' beginnings."""
    found = fit(model)
    model.problem.rewhiten(found.values, ())
    found = fit(model, found.values)
    if beginnings or (leaves_much(found) and model.problem.contacts is not None):
        return by_beginnings(found)
    return found


def leaves_much(found: Fit) -> bool:
    """Whether more is left than a fit's rough landscape makes by itself."""
    return found.chi_square > found.count + _MUCH * math.sqrt(2 * found.count)


def jittered(found: Fit, held_out: tuple[str, ...], known: tuple[Jitter, ...] = ()) -> tuple[Fit, tuple[Jitter, ...]]:
    """With times that jitter taken into account, at the slopes of this fit; and the clocks found here or `known`."""
    jitters = tuple({jitter.channels: jitter for jitter in (*known, *find_jitter(found))}.values())
    if not jitters:
        return found, ()
    problem = found.model.problem
    problem.shake(steepness(problem, jitters, values_of_all(found, held_out), found.model.forms))
    problem.rewhiten(found.values, found.model.forms)
    return fit(found.model, found.values), jitters


def doubted(found: Fit, held_out: tuple[str, ...]) -> Fit:
    """With readings that this model makes doubtful counted for little (`Problem.doubt`), where there are any."""
    if found.model.problem.contacts is None:
        return found
    values = held_out_fit(found.model, held_out, found.values)
    return fit(found.model, found.values) if found.model.problem.doubt(values, found.model.forms) else found


def plain(found: Fit) -> Fit:
    """The same with noise taken as white."""
    return fit(replace(found.model, whitener=Whitener.white(found.model.problem)), found.values)


def coloured(found: Fit, colours: Mapping[str, Colour]) -> Fit:
    """The same with noise of these colours; `found` has white noise."""
    return fit(replace(found.model, whitener=whitener_for(found, colours)), found.values) if colours else found


def recoloured(found: Fit, colours: Mapping[str, Colour]) -> Fit:
    """The same with the noise that it leaves, where that is another than `colours`."""
    if found.chi_square > _MOST_FOR_COLOUR * found.count:
        return found
    fresh = colours_of(plain(found))
    return coloured(plain(found), fresh) if differ(fresh, colours) else found


def colours_of(found: Fit) -> dict[str, Colour]:
    """Colours of the noise, where the misfit is so small that the fast modes hold nothing else. Elsewhere the level of
    the noise, if it is there all the time."""
    white: dict[str, Colour] = {}
    if found.chi_square > _MOST_FOR_COLOUR * found.count:
        white = find_white_noise(found)
        rest = coloured(found, white)
        if not white or rest.chi_square > _MOST_FOR_COLOUR * rest.count:
            return white
    return white | find_colours(found)


def _on_all(found: Fit, held_out: tuple[str, ...]) -> Fit:
    """The model refitted to all trials, without any scatter."""
    model = replace(found.model, scatter=())
    return fit(model.on((*model.trials, *held_out)), unscattered(found))


def scatter_of(found: Fit, held_out: tuple[str, ...], *, apart: bool = False, kinds: tuple[str, ...] = ()) -> Scatter:
    """The scatter between replicates, of all trials; none where no trial repeats another."""
    if all(len(ids) < 2 for ids in groups_of(found.model.problem.trials).values()):
        return Scatter()
    return find_scatter(_on_all(found, held_out), apart=apart, kinds=kinds)


def lone_scatter_of(found: Fit, held_out: tuple[str, ...], *, kinds: tuple[str, ...]) -> tuple[Scatter, list[Finding]]:
    """The same, of these kinds, where no trial repeats another, and what contradicts it; none where one does."""
    if any(len(ids) > 1 for ids in groups_of(found.model.problem.trials).values()):
        return Scatter(), []
    return find_lone_scatter(_on_all(found, held_out), kinds)


def wander_of(found: Fit, held_out: tuple[str, ...]) -> Wander:
    """How replicates wander apart beyond what trials' own numbers describe, of all trials."""
    if not found.model.problem.by_path:
        return Wander({})
    return find_wander(found, held_out_fit(found.model, held_out, found.values), (*found.model.trials, *held_out))


def calmed(found: Fit, wander: Wander) -> Fit:
    """The same with the wander of replicates taken for noise, which is white otherwise."""
    problem = found.model.problem
    if not wander and not problem.calmed:
        return found
    problem.calm(wander.weights(problem) if wander else {})
    return plain(found)


def rescattered(found: Fit, scatter: Scatter) -> Fit:
    """The same with this scatter and no other, from where it was found and, with none, from here."""
    model = replace(found.model, scatter=scatter.parameters)
    if not scatter.parameters:
        return fit(model, unscattered(found))
    return with_scatter(model, {**unscattered(found), **scatter.values})


def differ(one: Mapping[str, Colour], other: Mapping[str, Colour]) -> bool:
    """Whether two sets of colours are not the same noise."""
    white = Colour("", 1.0, 0.0)
    pairs = [(one.get(name, white), other.get(name, white)) for name in set(one) | set(other)]
    return any(abs(a.persistence - b.persistence) > _OTHER or abs(a.std - b.std) > _OTHER * b.std for a, b in pairs)
