"""Standard errors of what a model.toml gives, from those of its numbers and their correlations.

A quantity q(p) of fitted numbers p with the covariance S has the variance g S g^T, g = dq/dp (propagation of errors of
first order; JCGM 100:2008, 5.2). Derivatives are central differences over half a standard error to either side. These
are the random errors of the fit, right if its model is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigid.intervals import half_width

from .tables import ERRORS_NOTE, PenetrationModel, TumbleModel

__all__ = ["ModelErrors", "bias_words", "errors_of"]

Array = NDArray[np.float64]
SHARE = 0.5
"""Part of a standard error by which a number is moved to either side."""


_MATTERS = 0.01  # of a peak force: a bias below it is not reported


def bias_words(peaks: Any) -> dict[str, str] | None:
    """By how much a model is off at the deepest point of its pushes, as sentences have it: `side` (the model is too low
    or too high), `mean`, `low` and `high` in per cent, `trials`.

    ``peaks``: a note `PEAKS_NOTE`. None for anything else, and for a bias below 1 % or within chance: Student's 95 %
    interval of the mean over the pushes.
    """
    keys = ("mean", "lowest", "highest", "std", "trials")
    if not isinstance(peaks, Mapping) or any(not isinstance(peaks.get(key), int | float) for key in keys):
        return None
    chance = half_width(float(peaks["std"]), int(peaks["trials"])) or 0.0
    if abs(float(peaks["mean"]) - 1.0) <= max(_MATTERS, chance):
        return None
    mean, low, high = (f"{100 * (peaks[key] - 1):+.2g}" for key in keys[:3])
    side = "low" if peaks["mean"] > 1 else "high"
    return {"side": side, "mean": mean, "low": low, "high": high, "trials": str(peaks["trials"])}


@dataclass(frozen=True)
class ModelErrors:
    """Standard errors of the numbers of a model, as its file notes them."""

    names: tuple[str, ...]  # `stiffness`, `damping`, `effect.parameter`
    std: Array  # in the numbers' units, shape [name_count]
    correlation: Array  # shape [name_count, name_count]
    undetermined: tuple[str, ...]  # names of the numbers that the fit leaves open
    freedom: Mapping[str, float] = field(default_factory=dict)  # of a standard error that rests on few beds, by name

    def at(self, size: str) -> "ModelErrors":
        """The same for a spike of one diameter [m] as the file writes it: `stiffness` for `stiffness@0.012`."""
        names = tuple(name.removesuffix(f"@{size}") for name in self.names)
        freedom = {name.removesuffix(f"@{size}"): value for name, value in self.freedom.items()}
        return replace(self, names=names, freedom=freedom)

    def of(self, name: str) -> float | None:
        """Standard error of a number of the model; None where the file has none."""
        return float(self.std[self.names.index(name)]) if name in self.names else None

    def propagated(self, above: Array, below: Array) -> float:
        """Standard error of a quantity. `above`, `below`: its values with each number moved up and down by `SHARE` of
        its standard error, shape [name_count]."""
        slopes = (above - below) / (2 * SHARE)  # a standard error each
        return float(np.sqrt(max(float(slopes @ self.correlation @ slopes), 0.0)))


def errors_of(path: str, model: PenetrationModel | TumbleModel) -> ModelErrors | None:
    """The note of a model's errors; None for a file that has none.

    Raises ValueError, naming `path` and key, where its parts are no numbers or not of one length.
    """
    note = model.notes.get(ERRORS_NOTE)
    if note is None:
        return None
    parts = ("names", "std", "correlation", "undetermined")
    if not isinstance(note, Mapping) or any(not isinstance(note.get(key), Sequence) for key in parts):
        raise ValueError(f"{path}: [notes] {ERRORS_NOTE}: lists {', '.join(parts)} were expected")
    names = tuple(str(name) for name in note["names"])
    try:
        std = np.array(note["std"], dtype=float).reshape(-1)
        correlation = np.array(note["correlation"], dtype=float).reshape(len(names), -1)
    except (TypeError, ValueError):
        raise ValueError(f"{path}: [notes] {ERRORS_NOTE}: std and correlation hold no plain numbers") from None
    if std.shape != (len(names),) or correlation.shape != (len(names), len(names)) or not (std >= 0).all():
        raise ValueError(
            f"{path}: [notes] {ERRORS_NOTE}: {len(names)} names, {len(std)} std and {correlation.size} correlations: "
            f"one std of 0 or more for each name and a square of correlations were expected"
        )
    freedom = note.get("freedom", {})  # a file of an older hedgebed has none
    if not isinstance(freedom, Mapping) or not all(isinstance(n, int | float) and n > 0 for n in freedom.values()):
        raise ValueError(f"{path}: [notes] {ERRORS_NOTE}: freedom: name = number above 0 was expected")
    return ModelErrors(names, std, correlation, tuple(str(name) for name in note["undetermined"]), dict(freedom))
