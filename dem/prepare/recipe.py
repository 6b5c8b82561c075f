"""The stages of a preparation as in the laboratory: what each takes, how it is written, what cannot be is refused.

A stage is written as its name, with a number after a colon where it takes one: ``rain``, ``rain:dry``, ``rain:0.2``,
``stick``, ``level``, ``fluff``, ``compact:0.61``, ``compact:0.58@lid``, ``compact:densest``, ``packing:0.57``,
``cut:0.02``, ``tilt:20``.
"""

import difflib
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from dem.grains.sizes import Sizes, Uniform

__all__ = ["STAGES", "Stage", "check_packing", "check_stages", "parse_stage"]

STAGES = {
    "rain": "grains fall from a loose column; 'dry' without adhesion, or also with the friction given and no rolling "
    "friction, until 'stick'",
    "stick": "grains that were poured so touch as their material says: adhesion, friction, rolling friction come back",
    "level": "grains above a height are taken away: the bed's depth, or the height given [m]",
    "fluff": "the bed is lifted apart from below to 1.4 times its height, or as often as given, and sinks back slowly",
    "compact": "to a packing fraction, by tapping or (@lid) by a lid under servo control; or 'densest' that taps reach",
    "packing": "to a packing fraction from either side: fluffed where the bed is denser, then tapped",
    "cut": "a strip of this width [m] is dug out, all of it at once; two vertical faces are left",
    "tilt": "the bed is tilted to this angle [degrees], a degree at a time",
}
"""The stages by name, and what each does."""

LOOSEST, DENSEST_UNIFORM, DENSEST = 0.5, 0.64, 0.74
LOOSEST_STICKY = 0.1
FLUFF = 1.4  # How many times its height a fluffed bed has before it sinks back [1]
_FILLS = ("stick", "fluff", "level", "compact", "packing")


@dataclass(frozen=True)
class Stage:
    """One stage: ``value`` after the colon, or None; ``by``: "tap" or "lid" (compact), "dry" (rain)."""

    name: str
    value: float | None = None
    by: str = "tap"

    def __str__(self) -> str:
        without = {"compact": "compact:densest", "rain": "rain:dry" if self.dry else "rain"}.get(self.name, self.name)
        lid = "@lid" if self.name == "compact" and self.by == "lid" else ""
        return without if self.value is None else f"{self.name}:{self.value:.12g}{lid}"

    @property
    def dry(self) -> bool:
        """Whether grains are poured that do not stick, and may have less friction, until 'stick'."""
        return self.name == "rain" and self.by == "dry"


def parse_stage(words: str) -> Stage:
    """The stage that is written so. Raises ValueError with what is allowed."""
    text = words.strip()
    name, colon, rest = text.partition(":")
    if name not in STAGES:
        near = difflib.get_close_matches(name, STAGES, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"there is {', '.join(STAGES)}"
        raise ValueError(f"stages: {words!r} is no stage; {hint}")
    by = "tap"
    if name == "compact" and "@" in rest:
        rest, _, by = rest.partition("@")
        if by not in ("tap", "lid"):
            raise ValueError(f"stages: {words!r}: a bed is compacted by 'tap' or 'lid', not by {by!r}")
    if name == "rain" and rest == "dry":
        return Stage(name, by="dry")
    if name == "stick" and colon:
        raise ValueError(f"stages: {words!r}: 'stick' takes no number")
    example = {"compact": "compact:0.6", "packing": "packing:0.58", "cut": "cut:0.02", "tilt": "tilt:20"}.get(name)
    if example and not rest:
        raise ValueError(f"stages: {words!r} needs a number, for example {example} ({STAGES[name]})")
    if name == "compact" and rest == "densest":
        if by == "lid":
            raise ValueError(f"stages: {words!r}: the densest bed is tapped; a lid takes a packing fraction")
        return Stage(name)
    if not colon:
        return Stage(name)
    try:
        value = float(rest)
    except ValueError:
        hint = "; 'dry', or a friction," if name == "rain" else ""
        raise ValueError(f"stages: {words!r}: {rest!r} is no number{hint} ({STAGES[name]})") from None
    if not math.isfinite(value) or value <= 0:
        raise ValueError(f"stages: {words!r}: {rest} must be positive ({STAGES[name]})")
    return Stage(name, value, "dry" if name == "rain" else by)


def check_packing(packing: float, sizes: Sizes, *, cohesive: bool, key: str = "packing") -> None:
    """Refuse a packing fraction that no bed of such grains has, whatever is done. Raises ValueError."""
    low = LOOSEST_STICKY if cohesive else LOOSEST
    high = DENSEST_UNIFORM if isinstance(sizes, Uniform) and sizes.spread <= 0.2 else DENSEST
    if low < packing <= high:
        return
    why = "" if cohesive else "; grains that stick (cohesion) make looser beds"
    raise ValueError(
        f"{key} = {packing:g} is no packing fraction of {'such ' if cohesive else ''}spheres at rest: give more than "
        f"{low:g} and at most {high:g}{why if packing <= low else ''}"
    )


def check_stages(stages: Sequence[Stage], *, size: Sequence[float], grain: float, sizes: Sizes, cohesive: bool) -> None:
    """Raise ValueError for an order or a number that cannot be; ``size`` of the bed, ``grain`` mean diameter [m]."""
    if not stages:
        raise ValueError("stages is empty: give 'rain' at least")
    if stages[0].name != "rain":
        raise ValueError(f"stages begins with {str(stages[0])!r}: a bed begins with 'rain'")
    _check_sticking(stages, cohesive=cohesive)
    for before, stage in itertools.pairwise(stages):
        if stage.name == "rain":
            raise ValueError("stages: 'rain' comes once, at the beginning")
        if before.name in ("cut", "tilt") and stage.name in _FILLS:
            raise ValueError(
                f"stages: {str(stage)!r} after {str(before)!r} would undo it; put {before.name!r} behind it"
            )
    for stage in stages:
        value, key = stage.value, f"stages: {str(stage)!r}: packing"
        if stage.name in ("compact", "packing") and value is not None:
            check_packing(value, sizes, cohesive=cohesive, key=key)
        elif stage.name == "level" and value is not None and not _within(value, 4 * grain, size[2]):
            raise ValueError(
                f"stages: {str(stage)!r} [m]: give a height from {4 * grain:.4g} m, four grains, to the bed's depth "
                f"{size[2]:g} m"
            )
        elif stage.name == "fluff" and value is not None and not 1.02 <= value <= 2.0:
            raise ValueError(f"stages: {str(stage)!r}: give 1.02 to 2 times the height of the bed")
        elif stage.name == "cut" and value is not None and not _within(value, 2 * grain, size[0] - 6 * grain):
            raise ValueError(
                f"stages: {str(stage)!r} [m]: give at least two grains, {2 * grain:.4g} m, and at most the bed's "
                f"width less six grains, {size[0] - 6 * grain:.4g} m"
            )
        elif stage.name == "tilt" and value is not None and not value < 90:
            raise ValueError(f"stages: {str(stage)!r} [degrees]: give less than 90")


def _within(value: float, low: float, high: float) -> bool:
    """Whether a length lies there, rounding forgiven: 6 * 0.006 is more than 0.036 to a computer."""
    return low * (1 - 1e-9) <= value <= high * (1 + 1e-9)


def _check_sticking(stages: Sequence[Stage], *, cohesive: bool) -> None:
    """Raise ValueError unless 'stick' comes once after grains poured without adhesion or with less friction."""
    rain, times = stages[0], [stage.name for stage in stages].count("stick")
    if rain.dry and rain.value is None and not cohesive:
        raise ValueError(f"stages: {str(rain)!r}: these grains do not stick anyway; give 'rain'")
    if rain.dry and times != 1:
        raise ValueError(
            f"stages: {str(rain)!r} needs 'stick' once behind it ({times} found), where the grains get back what "
            f"their material has"
        )
    if times and not rain.dry:
        raise ValueError("stages: 'stick' is for what was poured without: give 'rain:dry' at the beginning")
