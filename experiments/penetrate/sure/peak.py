"""The error of a peak force that a model.toml predicts: of its fit, and the scatter of the beds it was fitted to."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupling import Penetration
from experiments.campaign.model_errors import SHARE, ModelErrors
from experiments.campaign.tables import SURFACE
from experiments.diagnose.fit.forms import OwnEffect
from experiments.diagnose.push.law import push
from experiments.diagnose.push.slots import SLOTS, slot_places
from experiments.runs.types import Json
from rigid.intervals import joint_freedom
from vis.page.sentences import Sentences

__all__ = ["Law", "PeakError", "peak_error", "peak_of", "returned_std", "with_fit_errors"]

Array = NDArray[np.float64]
say = Sentences(__package__)
_SLOT = {name: place for place, name in enumerate(SLOTS)}
_PLACES = {SURFACE: "given_way"}  # fitted numbers whose place in the law has another name


class Law(Protocol):
    """What is asked of `AmendedLaw`."""

    @property
    def own(self) -> tuple[OwnEffect, ...]:
        """Effects from files."""

    @property
    def factors(self) -> Mapping[str, float]:
        """Of the law's numbers over the file's."""

    @property
    def springs(self) -> tuple[str, ...]:
        """Numbers that scale with K."""

    @property
    def scatter(self) -> Mapping[str, float] | None:
        """By what beds differ."""

    @property
    def own_errors(self) -> ModelErrors | None:
        """Errors of the fitted numbers."""

    def numbers(self, *, speed: float = 1.0, creep: float = 0.02) -> Array:
        """One lane of the law, shape [1, slot_count]."""


@dataclass(frozen=True)
class PeakError:
    """Of one push; standard deviations [N]."""

    fit: float | None  # of the fitted numbers; None where they have no errors, or one is not determined
    scatter: float | None  # of one bed against another; None where the campaign does not show it
    of: Mapping[str, float]  # what the scatter was found from: `trials`, `freedom`; empty where it is not known

    @property
    def whole(self) -> float | None:
        """Both together."""
        return None if self.fit is None else math.hypot(self.fit, self.scatter or 0.0)

    @property
    def freedom(self) -> float | None:
        """Degrees of freedom of the whole by Welch and Satterthwaite (JCGM 100:2008, G.4.1), those of the fit counted
        as endless; None where there are no fewer."""
        found = self.of.get("freedom")
        if self.fit is None or not self.scatter or not found:
            return None
        return joint_freedom(math.hypot(self.fit, self.scatter), self.scatter, float(found))

    @property
    def words(self) -> str:
        """What is in it, for the note of a quantity."""
        if self.scatter is None:
            return say("no_bed_scatter")
        return say("bed_scatter", scatter=self.scatter, trials=self.of.get("trials", 0))


def peak_error(law: Law, like: Penetration) -> PeakError:
    """The error of the peak force on the law along the path of `like`, a driven run."""
    return PeakError(_fit_std(law, like), _scatter_std(law, like), law.scatter or {})


def peak_of(law: Law, like: Penetration) -> float:
    """Peak force [N] on the law along the path of `like`, a driven run."""
    return float(_peaks(law, _lanes(law, like, 1), like)[0])


def returned_std(law: Law, likes: Sequence[Penetration]) -> float | None:
    """Standard error of the share of the work of loading that unloading returns, by the errors of the fit.

    The share is a mean over `likes`, driven runs. None as `PeakError.fit`. A stiffer bed raises both works alike."""
    if not likes:
        return None
    tables = [_moved(law, like) for like in likes]
    shares = [
        _returned(_forces(law, table, like), like)
        for table, like in zip(tables, likes, strict=True)
        if table is not None
    ]
    errors = law.own_errors
    if errors is None or not shares:
        return None
    mean = np.mean(shares, axis=0)
    return errors.propagated(mean[0::2], mean[1::2])


def _returned(forces: Array, like: Penetration) -> Array:
    """Work of unloading over work of loading of each lane, `forces` of shape [lane_count, n], along a path."""
    ways = np.diff(like.depth)
    works = 0.5 * (forces[:, 1:] + forces[:, :-1]) * ways
    loading = works[:, ways > 0].sum(axis=1)
    return -works[:, ways < 0].sum(axis=1) / np.maximum(loading, 1e-300)


def _forces(law: Law, table: Array, like: Penetration) -> Array:
    """Force [N] of each lane of the law along the path, shape [lane_count, n]."""
    lanes, path = np.zeros(len(table), np.int32), np.array([0, len(like.time)], dtype=np.int32)
    return push(table, lanes, path, like.depth, like.velocity, law.own, like.time)


def _peaks(law: Law, table: Array, like: Penetration) -> Array:
    """Peak force [N] of each lane of the law, shape [lane_count]."""
    return _forces(law, table, like).max(axis=1)


def _lanes(law: Law, like: Penetration, count: int) -> Array:
    return np.repeat(law.numbers(speed=float(np.abs(like.velocity).max())), count, axis=0)


def _moved(law: Law, like: Penetration) -> Array | None:
    """Lanes of the law with each fitted number moved up and down by `SHARE` of its standard error, one after the other;
    None where the numbers have no errors, or one is not determined."""
    errors, places = law.own_errors, slot_places(law.own)
    if errors is None or errors.undetermined:
        return None
    table = _lanes(law, like, 2 * len(errors.names))
    for k, (name, std) in enumerate(zip(errors.names, errors.std, strict=True)):
        slot = _PLACES.get(name) or (name if name in places else name.rpartition(".")[2])  # without the file's effect
        if slot in places:  # K and C of other diameters are in none
            step = SHARE * std * law.factors.get(slot, 1.0)
            table[2 * k : 2 * k + 2, places[slot]] += step, -step
    return table


def _fit_std(law: Law, like: Penetration) -> float | None:
    table, errors = _moved(law, like), law.own_errors
    if table is None or errors is None:
        return None
    peaks = _peaks(law, table, like)
    return errors.propagated(peaks[0::2], peaks[1::2])


def _scatter_std(law: Law, like: Penetration) -> float | None:
    """By a bed that is one standard deviation stiffer and softer: K, C and what is added to the spring are scaled, as
    the fit scales them; and what replicates differ by in force, each in its own way."""
    if law.scatter is None:
        return None
    bed, damper = (float(law.scatter.get(kind, 0.0)) for kind in ("bed", "bed damping"))
    table = _lanes(law, like, 4)
    for lane, sign in ((0, 1.0), (1, -1.0)):
        for name in ("stiffness", "damping", *law.springs):
            table[lane, _SLOT[name]] *= 1.0 + sign * bed
        table[2 + lane, _SLOT["damping"]] *= 1.0 + sign * damper
    peaks = _peaks(law, table, like)
    changes = (0.5 * float(peaks[0] - peaks[1]), 0.5 * float(peaks[2] - peaks[3]))
    return math.hypot(*changes, float(law.scatter.get("force", 0.0)))


def with_fit_errors(
    numbers: Mapping[str, Json], errors: ModelErrors | None, peaks: Mapping[str, PeakError],
    returned: float | None = None,
) -> dict[str, Json]:  # fmt: skip
    """Quantities of a model with their errors: K and C with those of the fit, peak forces as `peaks` has them, and
    `returned`: that of the work that unloading returns. Where the fit leaves a number open, a note names it."""
    found = dict(numbers)
    if errors is None:
        return found
    for name in ("stiffness", "damping"):
        if (std := errors.of(name)) is not None:
            found[name] = {**found[name], "std": std, "note": f"{found[name]['note']}; {say('fit_error')}"}
            if name in errors.freedom:
                found[name]["freedom"] = errors.freedom[name]
    open_ones = ", ".join(errors.undetermined)
    for name, error in peaks.items():
        words = say("no_fit_error", names=open_ones)
        if error.fit is not None:
            words = say("fit_error") if error.scatter is None else say("peak_fit_error", fit=error.fit)
            words = f"{words}; {error.words}"
        found[name] = {**found[name], "std": error.whole, "note": f"{found[name]['note']}; {words}"}
        if error.freedom is not None:
            found[name]["freedom"] = error.freedom
    if (entry := found.get("work_returned_amended")) is not None and entry["value"] is not None:
        words = (
            say("fit_error")
            if returned is not None
            else say("no_fit_error" if open_ones else "no_way_out", names=open_ones)
        )
        found["work_returned_amended"] = {**entry, "std": returned, "note": f"{entry['note']}; {words}"}
    return found
