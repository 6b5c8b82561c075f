"""Checks of numbers that several classes share: each raises ValueError with the key, its value and what is allowed.

Imports nothing of ours.
"""

import math

__all__ = ["check_above_zero", "check_friction", "check_not_negative"]


def check_above_zero(unit: str = "", **numbers: float) -> None:
    """Raise ValueError for a number that is not finite or not above 0; `unit` is shown where it is given."""
    for key, value in numbers.items():
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{key} is {value}: it must be above 0" + (f" ({unit})" if unit else ""))


def check_not_negative(unit: str = "", **numbers: float) -> None:
    """Raise ValueError for a number that is not finite or below 0; `unit` is shown where it is given."""
    for key, value in numbers.items():
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"{key} is {value}: it must be 0 or more" + (f" ({unit})" if unit else ""))


def check_friction(mu_s: float, mu_d: float | None, *, endless: bool = False) -> None:
    """Raise ValueError for coefficients that cannot be; mu_d None: by default; `endless`: mu_s may be infinite."""
    if not mu_s >= 0 or not (endless or math.isfinite(mu_s)):
        raise ValueError(f"mu_s is {mu_s}: it must be 0 or more")
    if mu_d is not None and not 0 <= mu_d <= mu_s:
        raise ValueError(f"mu_d is {mu_d}: it must be from 0 to mu_s, {mu_s}")
