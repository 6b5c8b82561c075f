"""Lengths that no platform has, as a rule millimetres where metres are expected, refused by what it has itself."""

import math
from collections.abc import Mapping
from typing import Any

from . import say
from .settled import Number

__all__ = ["check_lengths", "check_spike_length"]

LONGEST_SPIKE = 100.0
"""From the centre to a tip, over the radius of gyration [1]: 1.9 of the Hedgehog, 17 of a ball whose spikes stand ten
of its radii out of it; millimetres for metres make a thousand times as much."""
LARGEST = {"spike_diameter": 1.0, "spike_clear": 2.0, "grain": 1.0, "coarse": 1.0, "bed_size": 100.0}
"""Of spikes, grains and their bed, over the distance from the centre to a tip [1]. What is too large by less than that,
as a grain larger than its spike, is refused elsewhere, by what would do."""


def check_spike_length(numbers: Mapping[str, Number]) -> None:
    """Raise ValueError for spikes out of proportion to the body that mass and inertia are of."""
    length = numbers["spike_length"]
    gyration = math.sqrt(numbers["inertia"].value / numbers["mass"].value)
    times, metres = length.value / gyration, _metres(length.value, LONGEST_SPIKE * gyration)
    if length.value > LONGEST_SPIKE * gyration:
        raise ValueError(
            say("long_spike", length=length, times=times, gyration=gyration, most=LONGEST_SPIKE, metres=metres)
        )


def check_lengths(settings: Any, spike_length: float, **own: float) -> None:
    """Raise ValueError for what of LARGEST is out of proportion to `spike_length` [m]; `own` stands for `settings`."""
    for name, share in LARGEST.items():
        value, most = own.get(name, getattr(settings, name, None)), share * spike_length
        for k, size in enumerate(value if isinstance(value, tuple) else (value,)):
            if size is not None and size > most:
                part = f"[{k}]" if isinstance(value, tuple) else ""
                metres = _metres(size, most)
                raise ValueError(
                    say("too_large", name=name, part=part, size=size, length=spike_length, most=most, metres=metres)
                )


def _metres(value: float, most: float) -> str:
    return f"metres are expected: {1e-3 * value:g}?" if 1e-3 * value <= most else "metres are expected"
