"""What campaigns of every kind of the second simulator have in common: what is drawn first, and what is handed over."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Made", "Numbers", "Secret", "Table", "at_strength", "draw_case", "draw_names", "softness_for"]

Array = NDArray[np.float64]
Numbers = dict[str, float]
Table = dict[str, Any]
_STRENGTHS = (0.7, 50.0)  # signatures that are drawn, over the noise
_STRUCTURE = (0.05, 0.45)  # and sizes of the structure
_FINER = 7  # amplitudes that are tried between the neighbours of the best


@dataclass(frozen=True)
class Secret:
    """What is true of a campaign; nothing of it stands in the campaign."""

    effects: tuple[str, ...]
    outside: str | None
    parameters: dict[str, float]  # those with a fixed name, "<effect>.<name>"
    signature: float
    """Root mean square of what the effect changes in the channel that it changes most, over the noise, after what the
    uncertain numbers and the camera's zeros explain is taken out; of a pair the lesser one's."""
    coloured: bool
    trials: int
    extra: Table = field(default_factory=dict)
    readings: dict[str, dict[str, Array]] = field(default_factory=dict)
    """Of pushes and drops, what the sensors read without noise: trial id -> columns."""


@dataclass(frozen=True)
class Made:
    """A campaign as plain tables, as in campaign.toml, and columns by trial and sensor."""

    tables: Table
    columns: dict[tuple[str, str], dict[str, Array]]


def draw_case(
    random: np.random.Generator, kind: str | None, strength: float | None, structure: float | None,
    *, effects: Sequence[str], outside: Sequence[str],
) -> tuple[str, float, float]:  # fmt: skip
    """Kind of what is hidden, its signature and the size of the structure: those given, else drawn.

    Raises ValueError for a kind that there is not.
    """
    kind = kind or str(random.choice(effects))
    if kind not in ("null", "pair", *effects, *outside):
        raise ValueError(f"kind = {kind!r}: null, pair, {', '.join((*effects, *outside))} was expected")
    strength = strength if strength is not None else math.exp(random.uniform(*map(math.log, _STRENGTHS)))
    return kind, strength, structure if structure is not None else math.exp(random.uniform(*np.log(_STRUCTURE)))


def draw_names(random: np.random.Generator, kind: str, effects: Sequence[str]) -> tuple[str, ...]:
    """What is hidden: two effects of a pair, drawn; else the one."""
    return tuple(str(e) for e in random.choice(effects, 2, replace=False)) if kind == "pair" else (kind,)


def softness_for(size: float, tried: Array, sizes: Sequence[float], *, least: float) -> float:
    """The one of what was `tried`, from stiff to soft, whose structure has the size; between them by their logarithms.

    `sizes`: of those, over the noise; below `least` they are taken for it.
    """
    logs = np.maximum.accumulate(np.log(np.maximum(sizes, least))) + 1e-6 * np.arange(len(sizes))
    return math.exp(float(np.interp(math.log(size), logs, np.log(tried))))


def at_strength(
    at: Callable[[float], Numbers], signatures: Callable[[list[Numbers]], Sequence[float]], strength: float,
    *, span: float, count: int,
) -> tuple[Numbers, float]:  # fmt: skip
    """The numbers of an effect whose signature comes nearest to `strength`, and that signature.

    `at`: the numbers at an amplitude. `count` amplitudes from 1 / `span` to 1 are tried, then some more between the
    neighbours of the best.
    """

    def nearest(sizes: Array) -> tuple[int, Numbers, float]:
        ladder = [at(float(size)) for size in sizes]
        seen = signatures(ladder)
        best = int(np.argmin(np.abs(np.log(np.maximum(seen, 1e-9) / strength))))
        return best, ladder[best], float(seen[best])

    sizes = np.geomspace(1.0 / span, 1.0, count)
    best, _, _ = nearest(sizes)
    return nearest(np.geomspace(sizes[max(best - 1, 0)], sizes[min(best + 1, count - 1)], _FINER))[1:]
