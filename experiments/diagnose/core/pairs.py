"""Where fits of two effects at once should begin.

Where two effects are hidden, the best single name may be neither of them. A fit that begins from one alone stays in the
minimum of that one. So the search for pairs begins at the base model's fit, with its residual r. Every form makes a
change c at several amplitudes, without the part that the base parameters could take up. For every two of them the sizes
a, b are found for which |r + a c1 + b c2| is least. Fits begin from the best pairs, with the base parameters moved by
the projection. Changes add up only as far as the model is linear; of motions that bounce only the beginning is used
(`Model.until`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.diagnose.fit.fitting import Linear, Model
from experiments.diagnose.fit.problem import Array, Form, Values

__all__ = ["FormsStart", "next_starts", "pair_starts"]

_SIZES = (0.1, 0.4, 1.0, 3.0)  # amplitudes at which changes are taken, over those of a form's starts
_LEAST, _MOST = 0.3, 3.0
"""How far the change at one amplitude is scaled."""
_BEGINNING = 0.4  # share of a motion that bounces which is looked at


@dataclass(frozen=True)
class FormsStart:
    """Forms to add, one or two of as many effects, and where their fit may begin."""

    forms: tuple[Form, ...]
    values: Values


def pair_starts(
    model: Model, values: Values, forms: Sequence[Form], *, most: int, every_form: bool = False
) -> list[FormsStart]:
    """The likeliest start of each of the `most` likeliest pairs of effects, beside what `model` holds at `values`.
    `every_form`: of each form of these effects with its likeliest partner, instead of the likeliest two forms."""
    seen = _Projected(model, values, forms)
    whose = seen.whose
    if len(whose) < 2:
        return []
    left, sizes = _best_sizes(seen.gram, seen.along)
    effects = np.array([form.effect for form in whose])
    left[effects[:, None] == effects[None, :]] = np.inf
    left[np.tril_indices(len(left))] = np.inf
    found: list[FormsStart] = []
    taken: set[tuple[str, str]] = set()
    seen_with: set[tuple[str, str]] = set()  # a form, and the other effect
    for flat in np.argsort(left, axis=None):
        i, j = divmod(int(flat), len(whose))
        if not np.isfinite(left[i, j]):
            break
        pair = (str(effects[i]), str(effects[j]))
        sides = {(whose[i].id, pair[1]), (whose[j].id, pair[0])}
        if pair in taken and not (every_form and sides - seen_with):
            continue
        if pair not in taken and len(taken) >= most:
            continue
        taken.add(pair)
        seen_with |= sides
        found.append(FormsStart((whose[i], whose[j]), seen.start((i, j), (sizes[0][i, j], sizes[1][i, j]))))
    return found


def next_starts(model: Model, values: Values, forms: Sequence[Form], *, most: int) -> list[FormsStart]:
    """The likeliest start of each of the `most` likeliest single effects, beside what `model` holds at `values`."""
    seen = _Projected(model, values, forms)
    own = np.maximum(np.diag(seen.gram), 1e-300)
    sizes = np.clip(-seen.along / own, _LEAST, _MOST)
    left = sizes**2 * own + 2 * sizes * seen.along
    found: dict[str, FormsStart] = {}
    for k in np.argsort(left).tolist():
        form = seen.whose[k]
        if form.effect not in found and len(found) < most:
            found[form.effect] = FormsStart((form,), seen.start((k,), (sizes[k],)))
    return list(found.values())


class _Projected:
    """Changes that forms make at several amplitudes, with what the model's own parameters take up projected out."""

    def __init__(self, model: Model, values: Values, forms: Sequence[Form]) -> None:
        part = model.until(_BEGINNING)
        self.values, self.linear = values, Linear.of(part, values)
        self.whose, self.points, columns = _changes(part, values, self.linear.modes, forms)
        self.gram, self.along, self.cross = self.linear.projected(columns)

    def start(self, which: Sequence[int], sizes: Sequence[float]) -> dict[str, float]:
        """Values with these changes made, and the model's parameters moved as a refit would."""
        taken = self.linear.slope + sum(size * self.cross[:, k] for k, size in zip(which, sizes, strict=True))
        moved = {
            p.name: float(np.clip(now + p.scale * step, p.lowest, p.highest))
            for p, now, step in zip(self.linear.parameters, self.linear.x, -self.linear.inverse @ taken, strict=True)
        }
        start = {**self.values, **moved}
        for k, size in zip(which, sizes, strict=True):
            start |= _scaled(self.whose[k], self.points[k], size)
        return start


def _changes(
    model: Model, values: Values, modes: Array, forms: Sequence[Form]
) -> tuple[list[Form], list[dict[str, float]], Array]:
    """Forms, the values of their parameters, and what they change, shape [n, k]."""
    whose: list[Form] = []
    points: list[dict[str, float]] = []
    columns: list[Array] = []
    for form in forms:
        amplitude = next(p for p in form.parameters if p.name == form.amplitude)
        tried = []
        for start in form.starts or ({form.amplitude: amplitude.scale},):
            for size in _SIZES:
                value = float(np.clip(size * start[form.amplitude], amplitude.lowest, 0.95 * amplitude.highest))
                tried.append({**start, form.amplitude: value})
        unique = list({tuple(sorted(point.items())): point for point in tried}.values())
        made = model.with_forms((*model.forms, form)).evaluate([{**values, **point} for point in unique])
        for point, other in zip(unique, made, strict=True):
            change = other - modes
            if np.isfinite(change).all() and float(np.abs(change).max(initial=0.0)) < 1e4 and change @ change > 1e-6:
                whose.append(form)
                points.append(point)
                columns.append(change)
    return whose, points, np.stack(columns, axis=1) if columns else np.zeros((len(modes), 0))


def _best_sizes(gram: Array, along: Array) -> tuple[Array, tuple[Array, Array]]:
    """For each two changes what is left of chi-square, less what it is now, and their sizes; all of shape [k, k]."""
    own = np.diag(gram).copy()
    own[own <= 0] = 1e-300
    first, second = own[:, None], own[None, :]
    determinant = np.maximum(first * second - gram**2, 1e-9 * first * second)
    a = np.clip((-along[:, None] * second + along[None, :] * gram) / determinant, _LEAST, _MOST)
    for _ in range(2):  # held within bounds: one after the other
        b = np.clip((-along[None, :] - gram * a) / second, _LEAST, _MOST)
        a = np.clip((-along[:, None] - gram * b) / first, _LEAST, _MOST)
    left = a**2 * first + b**2 * second + 2 * a * b * gram + 2 * a * along[:, None] + 2 * b * along[None, :]
    return left, (a, b)


def _scaled(form: Form, point: dict[str, float], factor: float) -> dict[str, float]:
    amplitude = next(p for p in form.parameters if p.name == form.amplitude)
    value = float(np.clip(factor * point[form.amplitude], amplitude.lowest, amplitude.highest))
    return {**point, form.amplitude: value}
