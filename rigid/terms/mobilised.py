"""How a bound is taken up over a distance; the one function that the hooks of a push's law may call."""

from math import exp

__all__ = ["mobilised"]


def mobilised(share, sharpness):
    """Share of a bound at `share` of its distance x: 1 - exp(-x), or x / (1 + x^p)^(1/p) of a sharpness p."""
    part = 1.0 - exp(-share)
    if sharpness > 0.0:
        part = share / (1.0 + max(share, 1e-12) ** sharpness) ** (1.0 / sharpness)
    return part
