"""By what replicates differ beyond the sensors, in words."""

from collections.abc import Mapping

from .sentences import say

__all__ = ["spread_sentences"]

_SPREAD_UNITS = {
    "force": "N, each in its own way", "depth": "m, each in its own way", "accel": "m/s2, each in its own way",
    "depth zero": "m", "force zero": "N",
}  # fmt: skip
"""Of channels and zeros in `model_std`, which holds relative numbers otherwise."""


def spread_sentences(model_std: Mapping[str, float], *, granular: bool) -> list[str]:
    """By what replicates differ beyond the sensors, in a sentence; of several kinds the sizes are guesses.
    `model_std`: kind -> standard deviation; `granular`: whether the ground is a bed of grains."""
    if len(model_std) > 1:
        sizes = {k: (s, _SPREAD_UNITS[k]) if k in _SPREAD_UNITS else (100 * s, "%") for k, s in model_std.items()}
        return [say("spreads", kinds=" and ".join(f"{k} by {s:.2g} {unit}" for k, (s, unit) in sizes.items()))]
    whose = "the bed" if granular else "the surface, the rig or the start"
    return [
        say("spread", kind=kind, std=std, unit=_SPREAD_UNITS.get(kind, "(relative)"),
            of=say("spread_zero") if kind.endswith(" zero") else whose)
        for kind, std in model_std.items()
    ]  # fmt: skip
