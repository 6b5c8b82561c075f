"""Forms as they are fitted, made of what the files of effects declare; effects from files of a user's own.

Such a file has the shape of those in `rigid.terms`. TERM is a term as `rigid.terms` has them; the first parameter is
the amplitude. What a diagnosis must know of it is either CANDIDATE, as the shipped effects have it
(`rigid.terms.candidate`), or, shorter, FIT. FIT has for each parameter `typical`, a size that can be seen, from which
fits begin. Of the amplitude it has also `off`, the value that changes nothing (the default if left out). With FIT,
tumbles take every hook but those of a coordinate of its own. Penetration takes `stiffen`, `rate_force` and `hold`, with
depth, rate and deepest depth of the spike, and of `s` what a spike that goes straight down has: mass, gravity, weight,
y = -depth and vy.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rigid.terms import LOADED, Candidate, Term, load_effect
from rigid.terms import candidate as declared
from rigid.terms.candidate import Number, Push, Tumble

from .problem import Form, Parameter, Values

__all__ = ["PENETRATION_HOOKS", "OwnEffect", "load_own", "own_starts", "parameters_of", "plain_form", "shapes_of"]

PENETRATION_HOOKS = ("stiffen", "rate_force", "hold")
_FINE = 0.2  # scale of a change that can be seen, over the typical size


def parameters_of(effect: str, numbers: Sequence[Number]) -> tuple[Parameter, ...]:
    """What is fitted of the numbers of a form."""
    return tuple(
        Parameter(name=f"{effect}.{n.fitted}", unit=n.unit, value=n.value, std=n.std, scale=n.scale, lowest=n.lowest,
                  highest=n.highest, step=n.step)
        for n in numbers if n.how != "fixed"
    )  # fmt: skip


def plain_form(effect: str, form: declared.Form, bends: Sequence[declared.Bend]) -> Form:
    """A candidate; `bends`: of the effect's forms."""
    parameters = parameters_of(effect, form.numbers)
    names = [p.name for p in parameters]
    return Form(
        effect=effect, name=form.name, parameters=parameters, amplitude=names[0], numbers=form.numbers,
        starts=tuple(dict(zip(names, start, strict=True)) for start in form.starts), redefines=form.redefines,
        stiffness=form.stiffness, form_std=form.form_std, becomes=form.becomes,
        bends=tuple(bend for bend in bends if form.name in bend.of),
    )  # fmt: skip


def shapes_of(forms: Sequence[Form], *, again: bool = False) -> dict[str, tuple[Form, ...]]:
    """The forms that can be bent, with the numbers that bend them: id of the plain form -> the bent ones.

    A bent form is no candidate of its own. It is fitted only after the plain form, from there, and its own numbers
    begin at what changes nothing. So it costs little, and a name is found by the plain form. `again`: a bent form may
    be bent by what comes after its bend.
    """
    found = {form.id: tuple(_bent(form, place) for place in range(len(form.bends))) for form in forms if form.bends}
    for bent in list(found.values()) if again else ():
        found |= shapes_of(bent, again=True)
    return found


def _bent(form: Form, place: int) -> Form:
    bend = form.bends[place]
    more = parameters_of(form.effect, bend.numbers)
    places = [dict(zip((p.name for p in more), start, strict=True)) for start in bend.starts]
    return replace(
        form, name=bend.name.format(form.name), parameters=(*form.parameters, *more),
        numbers=(*form.numbers, *bend.numbers), bends=form.bends[place + 1 :],
        starts=tuple({**start, **bend} for bend in places for start in form.starts or ({},)),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class OwnEffect:
    """A term from a file, and how it is fitted."""

    term: Term
    file: Path
    off: float  # of the amplitude: the value that changes nothing
    typical: Mapping[str, float]  # parameter -> a size that can be seen; empty without FIT
    candidate: Candidate | None = None

    @property
    def id(self) -> str:
        """Its name."""
        return self.term.id

    @property
    def amplitude(self) -> str:
        """Its first parameter."""
        return self.term.parameters[0].name

    @property
    def push(self) -> Push | None:
        """What it adds to the law of a push; None where its term's hooks do."""
        return self.candidate.push if self.candidate is not None else None

    @property
    def tumble(self) -> Tumble:
        """Its forms as a candidate of tumbles. Raises ValueError, naming the file, where it has none."""
        if self.candidate is not None and self.candidate.tumble is not None:
            return self.candidate.tumble
        form = self.form
        return Tumble(forms=lambda typical: (form,), equation="")

    @property
    def form(self) -> declared.Form:
        """The one form of an effect with a FIT. Raises ValueError, naming the file, where there is none."""
        if not self.typical:
            raise ValueError(f"effect_file = {str(self.file)!r}: CANDIDATE has no forms for trials of this kind")
        numbers = tuple(self._number(p.name) for p in self.term.parameters)
        parameters = parameters_of(self.id, numbers)
        starts = tuple(tuple(start[p.name] for p in parameters) for start in own_starts(self, parameters))
        return declared.Form("own", numbers, starts)

    def neutral(self, name: str) -> float:
        """The value of a parameter where the effect is off."""
        if name == self.amplitude:
            return self.off
        return self.typical[name] if self.typical else self.term.values({})[name]

    def _number(self, name: str) -> Number:
        """An amplitude is fitted from 0, another number about its typical size, to within that size."""
        p = next(p for p in self.term.parameters if p.name == name)
        first, size = name == self.amplitude, abs(self.typical[name])
        lowest = p.lowest - (self.off if first else 0.0)
        if p.above_lowest and not first:
            lowest += 1e-3 * size
        elif p.above_lowest:
            lowest = max(lowest, 0.0) if self.off > p.lowest else lowest
        return Number(
            name=name, fitted=name, how="change" if first else "same", typical=self.off, unit=p.unit,
            value=0.0 if first else self.typical[name], std=math.inf if first else size, scale=_FINE * size,
            step=0.02 * _FINE * size, lowest=lowest, highest=p.highest - (self.off if first else 0.0),
        )  # fmt: skip


def load_own(file: str | Path) -> OwnEffect:
    """The effect in `file`. Raises ValueError, naming the file and the key, for what cannot be fitted."""
    term = load_effect(file)
    where = f"effect_file = {str(file)!r}"
    candidate, fit = LOADED[term.id]
    if not term.parameters or not (term.hooks or (candidate is not None and candidate.push is not None)):
        raise ValueError(f"{where}: TERM has no {'hooks' if not term.hooks else 'parameters'}: there is nothing to fit")
    first = term.parameters[0]
    if fit is None and candidate is not None:
        return OwnEffect(term=term, file=Path(file).resolve(), off=first.default, typical={}, candidate=candidate)
    names = [p.name for p in term.parameters]
    if not isinstance(fit, dict) or set(fit) != set(names):
        found = "none" if not isinstance(fit, dict) else f"one of {', '.join(map(str, fit)) or 'nothing'}"
        wanted = f"FIT = {{name: {{'typical': number}}}} of {', '.join(names)}"
        raise ValueError(f"{where}: {wanted} was expected, found {found}")
    typical = {}
    for name in names:
        size = fit[name].get("typical")
        number = isinstance(size, int | float) and not isinstance(size, bool) and math.isfinite(size) and size != 0
        if set(fit[name]) - {"typical", "off"} or not number:
            raise ValueError(f"{where}: FIT[{name!r}] = {fit[name]!r}: 'typical', a number other than 0, was expected")
        typical[name] = float(size)
    off = fit[first.name].get("off", first.default)
    if not isinstance(off, int | float) or not math.isfinite(off):
        raise ValueError(f"{where}: FIT[{first.name!r}]: off = {off!r}: the value that changes nothing was expected")
    path = Path(file).resolve()
    return OwnEffect(term=term, file=path, off=float(off), typical=typical, candidate=candidate)


def own_starts(own: OwnEffect, parameters: Sequence[Parameter]) -> tuple[Values, ...]:
    """Amplitudes of a quarter of the typical size, of it and of four times it, either sign where the bounds allow."""
    first, *others = parameters
    rest = {p.name: p.value for p in others}
    sizes = [sign * size * own.typical[own.amplitude] for sign in (1, -1) for size in (0.25, 1.0, 4.0)]
    return tuple({first.name: size, **rest} for size in sizes if first.lowest < size < first.highest)
