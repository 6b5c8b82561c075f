"""Facts of driven trials: K and its spread, how it depends on the diameter, whether C can be determined."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.diagnose.fit.gaps import numeral
from experiments.diagnose.fit.problem import Array
from rigid.intervals import student

__all__ = [
    "Push", "SURE", "at_one_speed", "contradict", "facts", "highest_damping", "highest_dampings", "how_to_determine",
]  # fmt: skip

_FAST = 0.8  # of the largest speed from which on a push is one of the fastest
_ONE_SPEED = 1.1  # of two speeds that are one to a damper: C v is then as good as a constant force
SURE = 2.0  # standard errors from which on a C is sure
ONE_SIDED = 0.9  # two-sided: above each end are 5 %


@dataclass(frozen=True)
class Push:
    """One driven trial: where it was, what it felt, and what the model without a damper gives; shapes [n]."""

    diameter: float
    depth: Array
    speed: Array
    force: Array
    spring: Array  # force of the best model with C = 0 [N]
    damper: Array | float = 0.0  # force of its C [N]


def facts(pushes: Sequence[Push], added: Sequence[str], *, is_open: bool) -> list[str]:
    """Sentences. `added`: names of what the best model has beyond the base. `is_open`: whether C is not determined."""
    if not pushes:
        return []
    sentences = _stiffness(pushes, is_open=is_open)
    if not is_open:
        return sentences
    straight, bent = _each(pushes, added)
    sentences.append(
        "C cannot be determined from these pushes: fitted to each alone with a straight spring it is "
        + _range([c for _, c, _ in straight])
        + (f", and with {' and '.join(added)} {_range([c for _, c, _ in bent])}" if bent else "")
        + "."
    )
    return sentences


def contradict(pushes: Sequence[Push], added: Sequence[str]) -> bool:
    """Whether C, fitted to each push alone beside the best model's spring, is surely positive in one and surely
    negative in another. A straight spring in the place of a bent one would give C what the bend does."""
    straight, bent = _each(pushes, added)
    return len({c > 0 for _, c, s in bent or straight if abs(c) >= SURE * s}) > 1


def at_one_speed(pushes: Sequence[Push]) -> bool:
    """Whether nine of ten readings in the ground are at one speed, downwards: no hold, no withdrawal, no other pace."""
    speeds = np.concatenate([push.speed[push.depth > 0] for push in pushes])
    slowest, fastest = np.percentile(speeds, [5, 95]) if len(speeds) else (0.0, 0.0)
    return bool(slowest > 0 and fastest <= _ONE_SPEED * slowest)


def highest_damping(pushes: Sequence[Push]) -> float | None:
    """Upper bound of C [N s/m], one-sided 95 %, by the fastest pushes: C of each with the best model's spring, whose
    factor is free, is one measurement (Student's t of their mean). Of a single push its standard error counts. None
    where no push moves in."""
    fast = [float(np.percentile(np.maximum(push.speed, 0.0), 90)) for push in pushes]
    if not fast or max(fast) <= 0:
        return None
    own = [_two(push, lambda p: p.spring) for push, pace in zip(pushes, fast, strict=True) if pace > _FAST * max(fast)]
    found = np.array([c for _, c, _ in own])
    error, times = own[0][2], student(math.inf, ONE_SIDED)
    if len(own) > 1:
        error = max(float(np.std(found, ddof=1)), *(s for _, _, s in own)) / math.sqrt(len(own))
        times = student(len(own) - 1, ONE_SIDED)
    return max(float(found.mean()) + times * error, 0.0)


def highest_dampings(pushes: Sequence[Push]) -> dict[float, float]:
    """`highest_damping` by diameter [m]."""
    sizes = sorted({push.diameter for push in pushes})
    found = {size: highest_damping([push for push in pushes if push.diameter == size]) for size in sizes}
    return {size: bound for size, bound in found.items() if bound is not None}


def how_to_determine(speeds: Sequence[float]) -> str:
    """The trial that would determine C. `speeds`: slowest and fastest push of the campaign [m/s], none without one."""
    ways = "To determine C: drop the tip"
    if len(speeds) and min(speeds) > 0:
        slow, fast = numeral(100 * min(speeds), 2), numeral(1e4 * max(speeds), 2)
        ways += f", or push at {slow} and at {fast} mm/s (a tenth of the slowest and ten times the fastest speed)"
    return f"{ways}."


_Fitted = list[tuple[float, float, float]]


def _each(pushes: Sequence[Push], added: Sequence[str]) -> tuple[_Fitted, _Fitted]:
    """`_two` of each push with a straight spring, and with the best model's where that has more."""
    straight = [_two(push, lambda p: np.maximum(p.depth, 0.0)) for push in pushes]
    return straight, [_two(push, lambda p: p.spring) for push in pushes] if added else []


def _stiffness(pushes: Sequence[Push], *, is_open: bool) -> list[str]:
    """K of each push alone: F less the model's C v, where C is determined, over z by least squares."""
    by_size: dict[float, list[float]] = {}
    for push in pushes:
        z = np.maximum(push.depth, 0.0)
        force = push.force if is_open else push.force - push.damper
        by_size.setdefault(push.diameter, []).append(float(z @ force / max(float(z @ z), 1e-300)))
    parts = []
    for size, found in sorted(by_size.items()):
        several = f"{len(found)} push{'es' if len(found) > 1 else ''}"
        spread = f": {numeral(min(found), 3)} to {numeral(max(found), 3)}" if len(found) > 1 else ""
        parts.append(f"{numeral(float(np.mean(found)), 4)} N/m for {1e3 * size:g} mm of diameter ({several}{spread})")
    sentences = [
        f"K of a straight spring, fitted to each push alone{'' if is_open else ' with C of the model'} (means, and in "
        f"brackets all pushes): {', '.join(parts)}. Pushes to other depths differ in it where the ground is no "
        f"straight spring; where an effect is named, use the model's K."
    ]
    if len(by_size) > 2:
        sizes = np.log(sorted(by_size))
        means = np.log([max(float(np.mean(by_size[size])), 1e-300) for size in sorted(by_size)])
        sentences.append(f"It is proportional to the diameter to the power {np.polyfit(sizes, means, 1)[0]:.2f}.")
    return sentences


def _two(push: Push, spring: Callable[[Push], Array]) -> tuple[float, float, float]:
    """Factor on the spring, C [N s/m] and its standard error, by least squares; the error from what is left."""
    columns = np.column_stack([spring(push), np.maximum(push.speed, 0.0)])
    found, _, _, _ = np.linalg.lstsq(columns, push.force, rcond=None)
    rest = push.force - columns @ found
    covariance = np.linalg.pinv(columns.T @ columns) * float(rest @ rest) / max(len(rest) - 2, 1)
    return float(found[0]), float(found[1]), float(np.sqrt(max(covariance[1, 1], 0.0)))


def _range(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    signs = "negative in every one" if high < 0 else "positive in every one" if low > 0 else "of either sign"
    return f"{numeral(low)} to {numeral(high)} N s/m, {signs}"
