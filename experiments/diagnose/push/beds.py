"""What may differ from push to push beyond the sensors: strength, damping and way back of the bed, and the zeros."""

from collections.abc import Container, Sequence

import numpy as np

from experiments.campaign import PenetrationCampaign
from experiments.diagnose.fit.problem import Array, Form, Parameter, Values

from .data import Prepared, stds
from .forms import Scales
from .parameters import comes_back, diameters_of, named

__all__ = ["OWN", "centred", "in_one_bed", "own_numbers", "scatter_parameters"]

OWN = ("bed", "bed damping", "bed unloading", "depth zero")  # numbers of a push alone that its force follows from

_ZERO_DEPTH = 0.1  # how far a depth's zero may differ between pushes while it is asked whether it does, over D
_LEAST_ZERO = 0.2  # zeros that differ by less than this share of the noise are negligible
_BED_STD = 0.5  # how far the bed may differ between replicates while it is asked whether it does [1]


def scatter_parameters(
    tables: PenetrationCampaign, trials: Sequence[Prepared], scales: Scales
) -> dict[str, tuple[Parameter, ...]]:
    """What may differ between replicates beyond the sensors: kind -> one nuisance a trial, mostly not fitted.

    Of all trials a factor on K and C, one on C alone, and one on the stiffness of the way back. Of pushes also zeros.
    """
    ids, pushes = ([t.info.id for t in trials if t.driven or not driven] for driven in (False, True))
    found = {
        kind: Parameter(
            name=kind, unit="1", value=0.0, std=_BED_STD, scale=0.02, lowest=-0.95, highest=5.0, step=1e-4
        ).in_each(ids)
        for kind in ("bed", "bed damping", *(("bed unloading",) if comes_back(trials) else ()))
    }
    if not pushes:
        return found
    far = _ZERO_DEPTH * scales.depth
    force = far * scales.force / scales.depth
    for kind, unit, end, noise in zip(
        ("depth zero", "force zero"), ("m", "N"), (far, force), stds(tables, True), strict=True
    ):
        found[kind] = Parameter(
            name=kind, unit=unit, value=0.0, std=end, scale=0.1 * max(end, 1e-12), lowest=-2 * end, highest=2 * end,
            step=1e-3 * end, least=_LEAST_ZERO * noise,
        ).in_each(pushes)  # fmt: skip
    return found


def centred(values: Values, trials: Sequence[Prepared], forms: Sequence[Form]) -> dict[str, float]:
    """Values of the same forces, factors of beds about their mean: that is in K and C, and in the stiffness of the way
    back."""
    diameters, found = diameters_of(trials), dict(values)
    factors = [(size, kind, named(shared, size, diameters), 0.0) for size in diameters
               for kind, shared in (("bed", "stiffness"), ("bed", "damping"), ("bed damping", "damping"))]  # fmt: skip
    slots = {name: slot for form in forms for name, slot in form.slots.items()}
    backs = [(None, "bed unloading", name, 1.0) for name, slot in slots.items() if slot.name == "unload_stiffness"]
    for size, kind, shared, more in (*factors, *backs):  # the shared number plus `more` is multiplied
        own = [f"{kind}[{trial.info.id}]" for trial in trials if size is None or trial.diameter == size]
        own = [name for name in own if name in values]
        if own and shared in values:
            mean = float(np.mean([values[name] for name in own]))
            found[shared] = (found[shared] + more) * (1 + mean) - more
            found |= {name: (1 + values[name]) / (1 + mean) - 1 for name in own}
    return found


def in_one_bed(values: Values, trial: str) -> dict[str, float]:
    """Values for a push that was not made, in the lane of `trial`: without trials' own numbers, thus in the mean bed.
    Those of `OWN` that are in `values` by kind alone are the lane's."""
    own = {f"{kind}[{trial}]": values[kind] for kind in OWN if kind in values}
    return {name: value for name, value in values.items() if not name.endswith("]")} | own


def own_numbers(points: Sequence[Values], kind: str, trials: Sequence[Prepared], given: Container[str]) -> Array:
    """A number of each trial's own at each point, 0 where there is none, shape [trials, points]. `given`: the names
    that some point has."""
    found = np.zeros((len(trials), len(points)))
    for own, name in zip(found, (f"{kind}[{trial.info.id}]" for trial in trials), strict=True):
        if name in given:
            own[:] = [values.get(name, 0.0) for values in points]
    return found
