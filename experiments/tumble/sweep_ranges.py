"""Ranges of a sweep, as typed: KEY=FROM:TO:STEP, or with a unit, KEY=1mg:9mg:2mg."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from experiments.runs.units import find_unit, has_unit, in_both
from rigid.checks import nearest
from rigid.terms import EFFECTS

__all__ = ["MOST_TRIALS", "SWEEPABLE", "SweepRange", "parse_sweep", "swept_gravities", "unit_of"]

SWEEPABLE = {
    "rig": "9.80665 m/s2", "gravity": "m/s2", "counterweight": "kg", "torque": "N m", "torque_until": "s",
    "wheel_speed_0": "rad/s", "mass": "kg", "inertia": "kg m2", "spike_length": "m", "wheel_inertia": "kg m2",
    "max_wheel_speed": "rad/s", "stiffness": "N/m", "damping": "N s/m", "mu_s": "1", "mu_d": "1",
}  # fmt: skip
"""The settings of a tumble that can be swept, with their units; parameters of effects can be too."""
MOST_TRIALS = 2500
_TYPED = "KEY=FROM:TO:STEP such as mu_s=0.3:0.6:0.1"


@dataclass(frozen=True)
class SweepRange:
    """One number and its values."""

    key: str  # A setting, or ``effect.parameter``
    values: tuple[float, ...]

    @property
    def is_effect(self) -> bool:
        """Whether the key is a parameter of an effect."""
        return "." in self.key


def parse_sweep(texts: tuple[str, ...]) -> tuple[SweepRange, ...]:
    """The ranges of one key or two, in the units of `unit_of`.

    Raises ValueError for text that is no range, an unknown key, and a unit of another kind or at only some of the three
    numbers. Also for one key twice, more than two keys, and more than 2,500 trials.
    """
    ranges = tuple(_one(text) for text in texts)
    keys = [each.key for each in ranges]
    if len(set(keys)) < len(keys):
        raise ValueError(f"sweep = {' '.join(texts)} has {keys[0]} twice: give each key once")
    if len(ranges) > 2:
        raise ValueError(f"sweep = {' '.join(texts)} has {len(ranges)} keys: one or two are accepted")
    count = math.prod(len(each.values) for each in ranges)
    if count > MOST_TRIALS:
        raise ValueError(f"sweep = {' '.join(texts)} makes {count} trials: at most {MOST_TRIALS} is accepted")
    return ranges


def unit_of(key: str) -> str:
    """The unit of a key."""
    if key in SWEEPABLE:
        return SWEEPABLE[key]
    effect, _, name = key.partition(".")
    return next(parameter.unit for parameter in EFFECTS[effect].parameters if parameter.name == name)


def swept_gravities(ranges: tuple[SweepRange, ...]) -> Iterator[str]:
    """One sentence for each end of a range of gravities, in m/s2 and in g."""
    for each in ranges:
        ends = list(dict.fromkeys((each.values[0], each.values[-1])))
        yield from in_both(each.key, ends, find_unit(f"[{unit_of(each.key)}]"))


def _one(text: str) -> SweepRange:
    key, equals, span = text.partition("=")
    key = key.strip().replace("-", "_") if "." not in key else key.strip()
    words = span.split(":")
    if not (equals and len(words) == 3 and all(has_unit(word) or _is_finite(word) for word in words)):
        raise ValueError(f"sweep = {text!r} is no range: {_TYPED} is accepted")
    _check_key(key, text)
    low, high, step = _numbers(key, words, text)
    if step <= 0 or high < low:
        raise ValueError(f"sweep = {text!r} goes nowhere: FROM below TO and a STEP above 0 are accepted")
    count = math.floor((high - low) / step * (1 + 1e-12) + 1e-9) + 1
    if count > MOST_TRIALS:
        raise ValueError(f"sweep = {text!r} makes {count} trials: at most {MOST_TRIALS} is accepted")
    return SweepRange(key, tuple(float(f"{low + k * step:.12g}") for k in range(count)))


def _is_finite(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _numbers(key: str, words: list[str], text: str) -> list[float]:
    """FROM, TO and STEP in the unit of the key."""
    with_unit = [word for word in words if has_unit(word)]
    if not with_unit:
        return [float(word) for word in words]
    stated = unit_of(key)
    unit = find_unit(f"[{stated}]")
    if unit is None:
        which = "has no unit" if stated == "1" else f"is in {stated}"
        raise ValueError(f"sweep = {text!r}: {key} {which}: numbers without one are accepted")
    if len(with_unit) < len(words):
        raise ValueError(f"sweep = {text!r} has a unit behind some of FROM, TO and STEP: give it behind all or none")
    try:
        return [unit.value_of(word) for word in words]
    except ValueError as error:
        raise ValueError(f"sweep = {text!r}: {error}") from None


def _check_key(key: str, text: str) -> None:
    effect, dot, name = key.partition(".")
    if not dot:
        if key not in SWEEPABLE:
            known = f"a parameter of an effect is accepted as pendulum.length is; {nearest(key, SWEEPABLE)}"
            raise ValueError(f"sweep = {text!r}: {key} is no number that can be swept; {known}")
        return
    if effect not in EFFECTS:
        raise ValueError(f"sweep = {text!r}: effect {effect!r} is unknown; {nearest(effect, EFFECTS)}")
    names = [parameter.name for parameter in EFFECTS[effect].parameters]
    if name not in names:
        raise ValueError(f"sweep = {text!r}: {name} is no parameter of {effect}; {nearest(name, names)}")
    if EFFECTS[effect].sensor:
        raise ValueError(f"sweep = {text!r}: {effect} alters a sensor, not the tumble")
