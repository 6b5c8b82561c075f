"""Parameters that end where they cannot go on: at a bound, or far from what was stated.

A number that was stated as 5.3 +- 0.01 and is fitted as 5.36 has not been measured anew: something is missing from the
model, and it bends what it has. Such a model does not explain the data, however little it leaves.
"""

import math
import re
from dataclasses import dataclass

from vis.page.numbers import foldable, quote

from .fitting import Fit
from .problem import Parameter

__all__ = ["Bound", "bends_little_away", "bounds_met", "is_strained", "strained_parameters"]

_FAR = 5.0  # standard deviations from the stated value that no true number has (chance 6e-7)
_FAR_FOR_LITTLE, _LITTLE = 3.5, 0.5
"""The same (chance 5e-4) where the base model leaves very little beyond the noise per sample. Then a form that is not
quite nature's cannot distort the numbers. Of a reviewer's tumbles one such name was false and needed a mass 4.4
standard deviations off; right names that explained as little needed 2.5 at most."""


@dataclass(frozen=True)
class Bound:
    """One parameter that met its bound, or went all but there."""

    parameter: str
    value: float
    unit: str
    sigmas: float | None  # standard deviations from what was stated; None where nothing was (a parameter of an effect)
    at_bound: bool
    stated: float | None = None  # the value in campaign.toml, where there is one
    stated_std: float | None = None
    side: str = ""  # ``least`` or ``most``: which end of its range an effect's parameter met

    @property
    def strains(self) -> bool:
        """Whether the model needs a number that the campaign all but excludes."""
        return self.sigmas is not None

    @property
    def words(self) -> str:
        """As in: the mass went to ..."""
        if self.sigmas is not None:
            value = f"{self.parameter} {self.value:.4g}" + (f" {self.unit}" if self.unit != "1" else "")
            end = ", the end of its range" if self.at_bound else ""
            return f"{value} ({self.sigmas:+.1f} sigma{end})"
        value = f"{self.parameter} {foldable(quote(self.value, None, self.unit))}"
        may = {"least": "less", "most": "more"}[self.side]
        return f"{value} (the {self.side} that the library allows: it may be {may})"


def is_strained(found: Fit) -> bool:
    """Whether the model needs numbers that the campaign all but excludes, but for those that its forms redefine."""
    return bool(strained_parameters(found))


def strained_parameters(found: Fit) -> tuple[str, ...]:
    """Names of those numbers: they may absorb a structural difference between the model and what was measured."""
    return tuple(b.parameter for b in bounds_met(found) if b.strains and not _redefined(found, b.parameter))


def bends_little_away(found: Fit, base: Fit) -> bool:
    """Whether the model explains the little that the base model leaves by a shared number that is too far from what
    was stated: what is missing is then something else, which that number and the name take up between them."""
    if base.chi_square > (1 + _LITTLE) * base.count:
        return False
    shared = [p for p in found.model.problem.base if p.trial is None and math.isfinite(p.std)]
    return any(
        abs(found.values[p.name] - p.value) > _FAR_FOR_LITTLE * p.std for p in shared if not _redefined(found, p.name)
    )


def _redefined(found: Fit, parameter: str) -> bool:
    """Whether a base parameter, of whichever diameter or trial, means another thing beside the model's forms."""
    return re.split(r"[@\[]", parameter)[0] in {name for form in found.model.forms for name in form.redefines}


def bounds_met(found: Fit) -> tuple[Bound, ...]:
    """Base parameters 5 standard deviations and more from their stated values, and effects' parameters at a bound.

    An amplitude at zero is no bound, nor is a number that may be no less than zero and is zero.
    """
    base = {p.name for p in found.model.problem.base}
    shown = []
    for p in found.model.parameters:
        value = found.values[p.name]
        near = 1e-6 * max(abs(p.scale), 1e-300)
        at = value <= p.lowest + near or value >= p.highest - near
        if p.name in base and math.isfinite(p.std):
            sigmas = (value - p.value) / p.std
            if abs(sigmas) >= _FAR:
                shown.append(Bound(p.name, value, p.unit, sigmas, at, p.value, p.std))
        elif p.name not in base and "." in p.name and at and abs(value) > near:
            shown.append(_of_effect(found, p))
    return tuple(shown)


def _of_effect(found: Fit, p: Parameter) -> Bound:
    """An effect's parameter at its bound, as it is reported: it may be fitted as a logarithm or a share."""
    form = next((form for form in found.model.forms if any(p.name == own.name for own in form.parameters)), None)
    ends = [p.value if math.isfinite(p.value) else 0.0, found.values[p.name]]
    name, unit = p.name, p.unit
    if form is not None and p.name in form.slots:
        number = form.slots[p.name].name.rpartition(".")[2]
        told = [found.model.problem.reported({**found.values, p.name: end}, form) for end in ends]
        if number in told[1]:
            name, unit, ends = f"{form.effect}.{number}", told[1][number][1], [one[number][0] for one in told]
    return Bound(name, ends[1], unit, None, True, side="least" if ends[1] < ends[0] else "most")
