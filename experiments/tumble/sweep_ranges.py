"""Ranges to sweep a number over, as they are typed: KEY=FROM:TO:STEP."""

import math
from dataclasses import dataclass

from experiments.runs.reading import nearest
from rigid.terms import EFFECTS

__all__ = ["MOST_TRIALS", "SWEEPABLE", "SweepRange", "parse_sweep", "unit_of"]

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
        """Whether it is a parameter of an effect."""
        return "." in self.key


def parse_sweep(texts: tuple[str, ...]) -> tuple[SweepRange, ...]:
    """The ranges of one key or two.

    Raises ValueError for what is no range, a key there is not, one key twice, more than two keys, and more trials than
    2,500.
    """
    ranges = tuple(_one(text) for text in texts)
    keys = [each.key for each in ranges]
    if len(set(keys)) < len(keys):
        raise ValueError(f"sweep = {' '.join(texts)} has {keys[0]} twice: each key once would do")
    if len(ranges) > 2:
        raise ValueError(f"sweep = {' '.join(texts)} has {len(ranges)} keys: one or two would do")
    count = math.prod(len(each.values) for each in ranges)
    if count > MOST_TRIALS:
        raise ValueError(f"sweep = {' '.join(texts)} makes {count} trials: at most {MOST_TRIALS} would do")
    return ranges


def unit_of(key: str) -> str:
    """The unit of a key."""
    if key in SWEEPABLE:
        return SWEEPABLE[key]
    effect, _, name = key.partition(".")
    return next(parameter.unit for parameter in EFFECTS[effect].parameters if parameter.name == name)


def _one(text: str) -> SweepRange:
    key, equals, span = text.partition("=")
    key = key.strip().replace("-", "_") if "." not in key else key.strip()
    try:
        low, high, step = (float(word) for word in span.split(":"))
    except ValueError:
        raise ValueError(f"sweep = {text!r} is no range: {_TYPED} would do") from None
    if not (equals and all(math.isfinite(value) for value in (low, high, step))):
        raise ValueError(f"sweep = {text!r} is no range: {_TYPED} would do")
    if step <= 0 or high < low:
        raise ValueError(f"sweep = {text!r} goes nowhere: FROM below TO and a STEP above 0 would do")
    _check_key(key, text)
    count = math.floor((high - low) / step * (1 + 1e-12) + 1e-9) + 1
    if count > MOST_TRIALS:
        raise ValueError(f"sweep = {text!r} makes {count} trials: at most {MOST_TRIALS} would do")
    return SweepRange(key, tuple(float(f"{low + k * step:.12g}") for k in range(count)))


def _check_key(key: str, text: str) -> None:
    effect, dot, name = key.partition(".")
    if not dot:
        if key not in SWEEPABLE:
            known = f"{nearest(key, SWEEPABLE)}, or effect.parameter such as pendulum.length"
            raise ValueError(f"sweep = {text!r}: {key} is no number that can be swept; {known}")
        return
    if effect not in EFFECTS:
        raise ValueError(f"sweep = {text!r}: effect {effect!r} is unknown; {nearest(effect, EFFECTS)}")
    names = [parameter.name for parameter in EFFECTS[effect].parameters]
    if name not in names:
        raise ValueError(f"sweep = {text!r}: {name} is no parameter of {effect}; {nearest(name, names)}")
    if EFFECTS[effect].sensor:
        raise ValueError(f"sweep = {text!r}: {effect} alters a sensor, not the tumble")
