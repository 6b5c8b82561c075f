"""How much an answer changes with the uncertainty of a law's parameters, by sigma points.

The law is that of a ground file, or the spring-damper of a surface. Each parameter with a standard deviation s is moved
alone, by +s and by -s, within what its law allows. The answer q is taken to be linear between: its standard deviation
is the root of the sum of (s dq/dp)^2. Neither file states a covariance, so that the parameters count as independent.
The error of the law itself is not in it. result.json has that standard deviation. Readers see 1.96 of it, half of a
95 % interval. Beyond the range of a law nothing is known of its error there: no number has one.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from experiments.runs.types import Json
from rigid.ground_file import GroundFile
from rigid.intervals import NORMAL
from vis.page.law_rows import cell_of
from vis.page.numbers import foldable

from . import say
from .settled import Number
from .surfaces import Surface

__all__ = [
    "Answer", "Seen", "Uncertain", "moved", "spread_entries", "spread_of_law", "spread_of_surface", "uncertain_of",
    "with_spread",
]  # fmt: skip

_SYMBOLS = {"stiffness": "K", "damping": "C"}
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
    moves = (
        (fitted.parameters[name].std / (high - low), answer(lower), answer(higher))
        for name, lower, higher in moved(fitted)
        if (low := lower.values[name]) != (high := higher.values[name])
    )
    return _spread(best, moves)


class Seen:
    """A function of moved parameters that remembers its answers."""

    def __init__(self, answer: Callable[..., Answer]) -> None:
        self._answer = answer
        self._answers: list[Answer] = []

    def __call__(self, *moved: Any) -> Answer:
        found = self._answer(*moved)
        self._answers.append(found)
        return found

    def absent(self, best: Answer) -> list[str]:
        """The numbers of `best` that there are, but not on some moved law, such as the angle of a first hop."""
        return [
            name
            for name, value in best.items()
            if value is not None and any(name in answer and answer[name] is None for answer in self._answers)
        ]


def _spread(best: Answer, moves: Iterable[tuple[float, Answer, Answer]]) -> dict[str, float | None]:
    """The spread of `best`; of each move its standard deviation over its length, and the answers at both ends."""
    squares = dict.fromkeys(best, 0.0)
    missing = {name for name, value in best.items() if value is None}
    for share, below, above in moves:
        for key in squares:
            first, last = below.get(key), above.get(key)
            if first is None or last is None:
                missing.add(key)
            else:
                squares[key] += ((last - first) * share) ** 2
    return {key: None if key in missing else math.sqrt(square) for key, square in squares.items()}


@dataclass(frozen=True, kw_only=True)
class Uncertain:
    """A number of a surface whose standard deviation is known."""

    name: str
    value: float
    std: float

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and higher by one standard deviation, and above 0."""
        return max(self.value - self.std, 1e-9 * self.std), self.value + self.std


def uncertain_of(numbers: Mapping[str, Number], surface: Surface) -> list[Uncertain]:
    """K and C as far as they are those of the surface, which are of a row, with their standard deviation."""
    found = []
    for name, std in (("stiffness", surface.stiffness_std), ("damping", surface.damping_std)):
        number = numbers.get(name)
        if std is not None and number is not None and number.origin.startswith(f"surface {surface.name}"):
            scale = number.value / getattr(surface, name)
            found.append(Uncertain(name=name, value=number.value, std=scale * std))
    return found


def spread_of_surface(
    uncertain: Iterable[Uncertain], answer: Callable[[str, float], Answer], best: Answer
) -> dict[str, float | None]:
    """As `spread_of_law`, of a surface; `answer` has the name and the new value of the number that is moved.

    None for every number where a platform cannot stand or move on the other surface.
    """

    def at(name: str, value: float) -> Answer:
        try:
            return answer(name, value)
        except (RuntimeError, ValueError):
            return {}

    moves = (
        (one.std / (high - low), at(one.name, low), at(one.name, high)) for one in uncertain for low, high in [one.ends]
    )
    return _spread(best, moves)


def spread_entries(
    quantities: Mapping[str, Json],
    names: Mapping[str, str],
    *,
    surface: str,
    law: str,
    parameters: Sequence[str],
    absent: Sequence[str] = (),
    beyond: bool = False,
) -> tuple[Json, str]:
    """``law_spread`` of result.json, and a sentence with the halves of 95 % intervals that a law's parameters give.

    `names`: number -> what it is called. `law`: "" for K and C of a row, "file" for that of a ground file, or a name.
    `parameters`: which of it were moved. `absent`: numbers that some moved law does not have (`Seen.absent`).
    `beyond`: whether the motion leaves the range of the law, so that no number has an interval.
    """
    of = say("of_file") if law == "file" else say("of_law", law=law)
    if not law:
        symbols = [_SYMBOLS[name] for name in parameters or _SYMBOLS]
        of = say("of_surface", names=" and ".join(symbols), surface=surface)
    entries: Json = {"parameters": list(parameters), "absent": list(absent)}
    if beyond:
        return entries | {"beyond": True}, say("beyond_spread", of=of)
    if not parameters:
        return entries, say("no_spread", of=of)
    told = [
        f"{words} {foldable(cell_of(entry['value'], NORMAL * entry['std'], entry['unit']))}"
        for name, words in names.items()
        if (entry := quantities.get(name)) is not None and entry["value"] is not None and entry["std"]
    ]
    return entries, say("spread", of=of, words=", ".join(told)) if told else say("no_change", of=of)


def with_spread(quantities: Mapping[str, Json], stds: Mapping[str, float | None]) -> dict[str, Json]:
    """`quantities` of a result with these standard deviations."""
    return {
        name: entry | {"std": stds[name]} if name in stds and entry["value"] is not None else entry
        for name, entry in quantities.items()
    }
