"""How much an answer changes with the uncertainty of a ground file's parameters, by sigma points.

Each parameter with a standard deviation s is moved alone, by +s and by -s, within what its law allows. The answer q
is taken to be linear between: its standard deviation is the root of the sum of (s dq/dp)^2. A ground file states no
covariance, so that the parameters count as independent. The error of the law itself is not in it.
"""

import math
from collections.abc import Callable, Mapping

from experiments.runs.types import Json
from rigid.ground_file import GroundFile

__all__ = ["Answer", "moved", "spread_of_law", "with_spread"]

Answer = Mapping[str, float | None]
"""Numbers by name; None where there is none."""


def moved(fitted: GroundFile) -> list[tuple[str, GroundFile, GroundFile]]:
    """For each uncertain parameter its name, and the file with it lower and higher by one standard deviation."""
    found = []
    for parameter in fitted.surface_law.parameters:
        estimate = fitted.parameters[parameter.name]
        if estimate.std == 0:
            continue
        low = max(estimate.value - estimate.std, parameter.lowest * (1 + 1e-9) or 1e-9 * estimate.std)
        high = min(estimate.value + estimate.std, parameter.highest)
        found.append((parameter.name, _with(fitted, parameter.name, low), _with(fitted, parameter.name, high)))
    return found


def _with(fitted: GroundFile, name: str, value: float) -> GroundFile:
    other = fitted.parameters[name].model_copy(update={"value": value, "interval": None})
    return fitted.model_copy(update={"parameters": {**fitted.parameters, name: other}})


def spread_of_law(fitted: GroundFile, answer: Callable[[GroundFile], Answer], best: Answer) -> dict[str, float | None]:
    """Standard deviation of each number of `best`, the answer of the unchanged file.

    None for a number that some of the moved files do not have, or that does not change although it has no value.
    """
    squares = dict.fromkeys(best, 0.0)
    missing = {name for name, value in best.items() if value is None}
    for name, lower, higher in moved(fitted):
        low, high = lower.values[name], higher.values[name]
        if low == high:
            continue
        below, above = answer(lower), answer(higher)
        for key in squares:
            first, last = below[key], above[key]
            if first is None or last is None:
                missing.add(key)
            else:
                squares[key] += ((last - first) / (high - low) * fitted.parameters[name].std) ** 2
    return {key: None if key in missing else math.sqrt(square) for key, square in squares.items()}


def with_spread(quantities: Mapping[str, Json], stds: Mapping[str, float | None]) -> dict[str, Json]:
    """`quantities` of a result with these standard deviations."""
    return {
        name: entry | {"std": stds[name]} if name in stds and entry["value"] is not None else entry
        for name, entry in quantities.items()
    }
