"""What campaign.toml states of K and C as known, beside what the pushes give without it.

A fitted number has the stated one in it: both are joined by their weights. Beside a normal prior the two separate
again: the precision (1 / s²) of the joint number is the sum of the precisions.
"""

import math
from dataclasses import asdict, dataclass

from rigid.intervals import half_of, joint_freedom

from .outcome import Diagnosis, Estimated

__all__ = ["Beside", "beside_stated", "without_prior"]

_PRIOR = 0.9  # share of a joint number that the stated one has, from which on the trials do not determine it


@dataclass(frozen=True)
class Beside:
    """One number, stated and measured."""

    parameter: str
    stated: Estimated  # as campaign.toml states it
    alone: Estimated | None  # by the trials without that; None where they do not determine it
    difference: Estimated | None  # of the latter from the former

    @property
    def agrees(self) -> bool | None:
        """Whether the 95 % interval of the difference contains 0; None without a difference."""
        half = None if self.difference is None else half_of(self.difference)
        return None if self.difference is None or half is None else abs(self.difference["value"]) <= half

    def as_json(self) -> dict[str, object]:
        """An entry of ``stated`` of diagnosis.json."""
        return {**asdict(self), "agrees": self.agrees}


def beside_stated(found: Diagnosis) -> list[Beside]:
    """Of each shared number of the base model that campaign.toml states with an error, in pushes; none of others."""
    if found.problem.kind != "penetration":
        return []
    best, numbers = found.best, found.base_parameters(found.best)
    covariance = best.covariance()  # as the fit weighed the data: `numbers` have the noise that it found
    shown = []
    for place, p in enumerate(best.model.parameters):
        if p.name not in numbers or p.name == found.problem.loose or not 0 < p.std < math.inf:
            continue
        stated: Estimated = {"value": p.value, "std": p.std, "unit": p.unit}
        alone = without_prior(numbers[p.name], stated, share=float(covariance[place, place]) / p.std**2)
        shown.append(Beside(p.name, stated, alone, None if alone is None else _difference(alone, stated)))
    return shown


def without_prior(joint: Estimated, stated: Estimated, *, share: float) -> Estimated | None:
    """A number by the data alone: the `joint` one without the `stated` one, which is in it with this `share`.

    None where the data do not determine it. Where the error rests on few beds, its degrees of freedom are those of that
    part.
    """
    std, prior = joint["std"], stated["std"]
    if std is None or prior is None or share > _PRIOR or std**2 >= _PRIOR * prior**2:
        return None
    value = stated["value"] + (joint["value"] - stated["value"]) / (1 - share)
    own = 1 / math.sqrt(1 / std**2 - 1 / prior**2)
    alone: Estimated = {"value": value, "std": own, "unit": joint["unit"]}
    # d(own²) / d(std²) = (own / std)^4: what is uncertain of the one is so much of the other.
    return {**alone, "freedom": joint["freedom"] * (std / own) ** 4} if "freedom" in joint else alone


def _difference(alone: Estimated, stated: Estimated) -> Estimated:
    own, prior = alone["std"] or 0.0, stated["std"] or 0.0
    std = math.hypot(own, prior)
    found: Estimated = {"value": alone["value"] - stated["value"], "std": std, "unit": alone["unit"]}
    return {**found, "freedom": joint_freedom(std, own, alone["freedom"])} if "freedom" in alone else found
