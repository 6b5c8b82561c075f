"""How K and C of a surface follow gravity: by the map of `hedgebed ground` where it covers the robot's feet.

Forces in slow motion among rigid grains without cohesion are proportional to their weight. So K is proportional to
gravity g, and C, a force over a speed, to sqrt(g), as speeds in similar motions (`experiments.groundmap.maps`). The map
adds the ranges within which this is used, and the standard deviations.

Where grains stick, cohesion carries a part of K that is independent of gravity. This part is proportional to the
diameter of a foot instead of its area (`experiments.groundmap.cohesive`). There every foot has the K and C of the map
for a ball tip of its area.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from dem.grains.materials import material
from experiments.groundmap.answers import Answer, Number
from experiments.groundmap.cohesive import CohesiveMap
from experiments.groundmap.maps import POWERS, read_map
from experiments.platform.surfaces import Surface
from rigid.platform.rig import STANDARD_GRAVITY

from . import say
from .settings import RobotSettings

__all__ = ["NEAR", "GravityRule", "gravity_rule"]

SAME = 0.01
"""Relative difference of gravity from 1 g up to which K and C stay as they are [1]: MuJoCo's own 9.81 m/s2 is 1 g."""
NEAR = (0.5, 2.0)
"""Gravity over 1 g outside which K and C of 1 g get a warning [1]."""
SYMBOLS = {"stiffness": ("K", "N/m"), "damping": ("C", "N s/m")}


@dataclass(frozen=True, kw_only=True)
class GravityRule:
    """How K and C of one spike at 1 g become those of a run."""

    gravity: float  # Of the run [m/s2]
    follows: bool  # Whether K and C are scaled to it
    loose: bool  # Whether the surface is made of grains without cohesion
    answer: Answer | None = None  # Of the map for the surface's spike, where the map is used
    why_not: str = ""  # Why the map is not used, in words
    of_foot: Number | None = None  # K of the map for a ball tip as large as the largest foot [N/m]
    largest: float = 0.0  # Diameter of the circle of that foot's area [m]
    sticky: CohesiveMap | None = None  # The map of grains that stick, where it is used
    feet: Mapping[str, Answer] = field(default_factory=dict)  # Its answer for each part of the feet

    @property
    def share(self) -> float:
        """Gravity over 1 g [1]; 1 within `SAME` of it, unless scaling was asked for."""
        return self.gravity / STANDARD_GRAVITY

    def scale(self, name: str) -> float:
        """Factor on K (``stiffness``) or C (``damping``) of 1 g [1]."""
        if self.sticky is not None and self.answer is not None:
            earth = _of_spike(self.sticky, STANDARD_GRAVITY, self.sticky.reference["diameter"])
            return float(getattr(self.answer, name).value / getattr(earth, name).value)
        return float(self.share ** POWERS[name][0]) if self.follows else 1.0

    def origin(self, name: str) -> str:
        """The factor in words; empty without one."""
        if self.sticky is not None:
            return f", {self.scale(name):.3g} times for gravity" if abs(self.scale(name) - 1) > SAME else ""
        return f" times (g / {STANDARD_GRAVITY:g} m/s2)^{POWERS[name][0]:g}" if self.follows else ""

    def times(self, name: str, similar: float) -> float:
        """K or C of the largest foot over that of the surface's spike [1]; ``similar``: by similarity."""
        if self.answer is None or not self.feet:
            return similar
        return float(max(getattr(foot, name).value for foot in self.feet.values()) / getattr(self.answer, name).value)

    def of_part(self, part: str) -> dict[str, float]:
        """K and C of the map of grains that stick for a part of a foot; empty where it is not used."""
        return {name: getattr(self.feet[part], name).value for name in SYMBOLS} if part in self.feet else {}

    def stiffer(self, factor: float) -> "GravityRule":
        """The rule with K of each part of the feet times a factor [1]."""
        feet = {
            part: replace(found, stiffness=replace(found.stiffness, value=factor * found.stiffness.value))
            for part, found in self.feet.items()
        }
        return replace(self, feet=feet)

    def warning(self, surface: Surface, stiffness: float) -> list[str]:
        """That K and C are those of 1 g, where gravity is far from it; ``stiffness``: of one foot at 1 g [N/m]."""
        if self.follows or self.feet or NEAR[0] <= self.share <= NEAR[1]:
            return []
        key = "of_earth" if self.loose else "of_earth_cohesive"
        scaled = self.share * stiffness
        return [
            say(key, stiffness=stiffness, scaled=scaled, gravity=self.gravity, surface=surface.name, why=self.why_not)
        ]

    def errors(self, surface: Surface, names: list[str]) -> list[str]:
        """The map's K and C of the surface's spike with their standard deviations; none where the map is not used."""
        if self.answer is None or surface.spike is None:
            return []
        told = []
        for name in names:
            (symbol, unit), number = SYMBOLS[name], getattr(self.answer, name)
            told.append(_quoted(symbol, number, unit))
        real = say("real_grains") if self.share < NEAR[0] and self.sticky is None else ""
        numbers, grains = " and ".join(told), surface.name
        told = [
            say("of_map", grains=grains, gravity=self.gravity, spike=1e3 * surface.spike, numbers=numbers, real=real)
        ]
        if self.sticky is not None:
            held = self.sticky.if_cohesion_holds(self.answer, gravity=self.gravity, diameter=self.largest)
            return [*told, *held, *self.sticky.words(self.answer, gravity=self.gravity, diameter=self.largest)]
        similar = self.answer.stiffness.value * (self.largest / surface.spike) ** POWERS["stiffness"][1]
        if "stiffness" in names and self.of_foot is not None and abs(self.of_foot.value / similar - 1) > SAME:
            told.append(
                say(
                    "of_foot",
                    own=similar,
                    of_map=_quoted("K", self.of_foot, "N/m"),
                    largest=1e3 * self.largest,
                    grain=1e3 * self.answer.grain,
                )
            )
        return told


def _quoted(symbol: str, number: Number, unit: str) -> str:
    """A number of a map with half of its 95 % interval in two digits: 390, not 3.9e+02."""
    return f"{symbol} = {number.value:.3g} ± {float(f'{number.half:.2g}'):g} {unit}"


def gravity_rule(
    settings: RobotSettings, surface: Surface, gravity: float, diameters: Mapping[str, float]
) -> GravityRule:
    """The rule of a run on `surface` under `gravity` [m/s2].

    ``diameters``: name of each part of the feet -> diameter of the circle of its area from above [m]. Raises ValueError
    where scaling is asked for and K of the surface is not in proportion to gravity.
    """
    loose = surface.grains is not None and material(surface.grains).cohesion == "none"
    asked = settings.scale_with_gravity
    if asked and not loose:
        what = "made of grains with cohesion" if surface.granular else "hard ground"
        raise ValueError(say("scaled_surface", surface=surface.name, what=what))
    near = abs(gravity / STANDARD_GRAVITY - 1) <= SAME
    at, largest = STANDARD_GRAVITY if near else gravity, max(diameters.values())
    if not loose:
        return _of_sticky(surface, gravity, at, diameters, used=asked is not False)
    answer, why_not = _of_map(surface, at, diameters)
    follows = bool(asked) or (asked is None and answer is not None and not near)
    used = answer if follows or near else None
    of_foot = None if used is None or surface.grains is None else _of_tip(surface.grains, at, largest)
    return GravityRule(
        gravity=gravity, follows=follows, loose=loose, answer=used, why_not=why_not if asked is None else "",
        of_foot=of_foot, largest=largest,
    )  # fmt: skip


def _of_sticky(
    surface: Surface, gravity: float, at: float, diameters: Mapping[str, float], *, used: bool
) -> GravityRule:
    """The rule where grains stick, or on hard ground: that of the map of every foot, where it covers them all.

    ``at``: gravity that the map is asked for [m/s2]. ``used``: Whether K and C may follow it.
    """
    none = GravityRule(gravity=gravity, follows=False, loose=False)
    if not used or surface.grains is None or surface.spike is None:
        return none
    try:
        found = read_map(surface.grains)
    except ValueError:
        return none
    assert isinstance(found, CohesiveMap)
    try:
        feet = {name: _of_spike(found, at, diameter) for name, diameter in diameters.items()}
        answer = _of_spike(found, at, surface.spike)
    except ValueError as error:
        return replace(none, why_not=say("beyond_gravity", error=error))
    return replace(none, answer=answer, feet=feet, sticky=found, largest=max(diameters.values()))


def _of_spike(found: CohesiveMap, gravity: float, diameter: float) -> Answer:
    """The map's answer for a ball tip of this diameter [m] in real grains. Raises ValueError beyond the map."""
    return found.answer(gravity=gravity, diameter=diameter, grain=None, packing=None, load=None)


def _of_tip(grains: str, gravity: float, diameter: float) -> Number | None:
    """K of the map for a ball tip of this diameter [m] in its real grains [N/m]; None where they are too coarse."""
    try:
        return read_map(grains).answer(
            gravity=gravity, diameter=diameter, grain=None, packing=None, load=None
        ).stiffness  # fmt: skip
    except ValueError:
        return None


def _of_map(surface: Surface, gravity: float, diameters: Mapping[str, float]) -> tuple[Answer | None, str]:
    """The map's answer for the surface's spike; None where the map does not cover gravity or feet, and why."""
    if surface.grains is None or surface.spike is None:
        return None, ""
    try:
        found = read_map(surface.grains)
    except ValueError:
        return None, say("no_map", grains=surface.grains)
    low, high = found.ranges["tip_diameter"]
    for name, diameter in diameters.items():
        if not low <= diameter <= high:
            return None, say("beyond_map", name=name, diameter=1e3 * diameter, low=1e3 * low, high=1e3 * high)
    try:  # K and C of the surface are those of the map's real grains
        answer = found.answer(gravity=gravity, diameter=surface.spike, grain=None, packing=None, load=None)
    except ValueError as error:
        return None, say("beyond_gravity", error=error)
    return answer, ""
