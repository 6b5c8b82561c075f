"""Forms as they are fitted, made of what the files of effects declare (`rigid.terms.candidate`)."""

from collections.abc import Sequence
from dataclasses import replace

from rigid.terms import candidate as declared

from .own import parameters_of
from .problem import Form

__all__ = ["plain_form", "shapes_of"]


def plain_form(effect: str, form: declared.Form, bends: Sequence[declared.Bend]) -> Form:
    """A candidate; `bends`: of the effect's forms."""
    parameters = parameters_of(effect, form.numbers)
    names = [p.name for p in parameters]
    return Form(
        effect=effect, name=form.name, parameters=parameters, amplitude=names[0], numbers=form.numbers,
        starts=tuple(dict(zip(names, start, strict=True)) for start in form.starts), redefines=form.redefines,
        form_std=form.form_std, bends=tuple(bend for bend in bends if form.name in bend.of),
    )  # fmt: skip


def shapes_of(forms: Sequence[Form], *, again: bool = False) -> dict[str, tuple[Form, ...]]:
    """The forms that can be bent, with the numbers that bend them: id of the plain form -> the bent ones.

    A bent form is no candidate of its own. It is fitted only after the plain form has been, from there, with its
    numbers beginning at what changes nothing; so it costs little, and a name is found by the plain form. `again`: a
    bent form may be bent by what comes after its bend.
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
