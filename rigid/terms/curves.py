"""Curves that several effects share: functions that their hooks may call, and how these effects are declared."""

from math import exp

from .candidate import Bend, bent, shape
from .term import Parameter

__all__ = ["STRIBECK", "mobilised", "over_linear", "raised", "stribeck", "stribeck_bends", "stribeck_parameters"]

STRIBECK = (
    "more near rest by Stribeck's curve (as Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30:1083, "
    "tell it)"
)


def mobilised(share, sharpness):
    """Share of a bound at `share` of its distance x: 1 - exp(-x), or x / (1 + x^p)^(1/p) of a sharpness p."""
    part = 1.0 - exp(-share)
    if sharpness > 0.0:
        part = share / (1.0 + max(share, 1e-12) ** sharpness) ** (1.0 / sharpness)
    return part


def over_linear(value, power):
    """x^(power - 1) of a `value` x of 0 or more: what makes of a linear law one of that power; 1 where it is 1."""
    factor = 1.0 + 0.0 * value
    if power != 1.0:
        factor = max(value, 1e-12) ** (power - 1.0)
    return factor


def raised(value, power):
    """`value` of 0 or more to the power `power`, to the bit where that is 1."""
    out = value
    if power != 1.0:
        out = max(value, 1e-12) ** power
    return out


def stribeck(level, excess, share):
    """F (1 + a exp(-x^2)): a dry friction of `level` F with `excess` a at rest, at `share` x of the Stribeck speed."""
    bound = level + 0.0 * share
    if excess != 0.0:
        bound = level * (1.0 + excess * exp(-share * share))
    return bound


def stribeck_parameters(unit: str, speed: float, symbols: str, fast: str) -> tuple[Parameter, Parameter]:
    """`excess` and `speed` of `stribeck`; `symbols`: of the speed and its scale, `fast`: of what, in words."""
    v, v_0 = symbols.split()
    return (
        Parameter("excess", "1", 0.0, f"a: what friction at rest has more, over that of fast {fast}", lowest=0.0),
        Parameter("speed", unit, speed, f"{v_0} of exp(-({v} / {v_0})^2), by which the excess falls", lowest=0.0,
                  above_lowest=True),
    )  # fmt: skip


def stribeck_bends(speed: float) -> tuple[Bend, ...]:
    """How the form `dry` of such a friction is bent: by its excess and by its speed, about the default."""
    excess = shape("excess", 0.0, 0.5, 0.0, 4.0, sides=(0.7,))
    return (bent("more near rest", "dry", excess, shape("speed", speed, 1.0, -4.0, 4.0, log=True)),)
