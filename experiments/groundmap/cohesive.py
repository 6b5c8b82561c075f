"""The map of grains that stick: K, C and sinkage of a ball tip where weight and cohesion both carry it.

Rigid grains that stick have two stresses, rho g D of their weight and that of cohesion, c. Slow forces are then

    F = rho g D^3 f(z / D, d / D, c / (rho g D)),

and c does not depend on the size of the grains (`dem.grains.materials.Material.for_grain`). The map takes f to be the
sum of a part of weight and one of cohesion, with one dependence on d / D:

    K = exp(a + b d / D) [(1 - s) (g / g0) (D / D0)^2 + s D / D0].

So K stays where gravity vanishes. docs/results/penetrate-jsc-1a-push fits a, b and s to pushes and states by which
factor the map misses beds that it was not fitted to. Below the finest of these grains ln K goes straight to that of
real grains, which no push determines: its error grows to the whole range there.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from dem.grains.materials import MATERIALS
from experiments.grains.bearing import Cohesion, cohesion_in_95, footing_depths
from vis.page.numbers import between, foldable

from .answers import SLACK, Answer, Number, asked_of, check_depth, times
from .settings import say

__all__ = ["CohesiveMap", "Held"]


@dataclass(frozen=True)
class Held:
    """What the cohesion of the soil carries of an answer, and the sinkage at the least cohesion."""

    cohesion: Cohesion
    share: float  # of the load that cohesion carries [1]
    load: float  # [N]
    sinkage: tuple[float, float]  # at the least cohesion, by K of the map and by Terzaghi's formula, least first [m]

    @property
    def words(self) -> str:
        """That the answer holds only with the cohesion, and what is known of it."""
        low, high = self.sinkage
        least = f"with {self.cohesion.least:.2g} Pa" if self.cohesion.least > 0 else "without cohesion"
        sinks = foldable(between(low, high, "m"))
        return say("if_it_holds", percent=100 * self.share, held=self, least=least, sinks=sinks)


@dataclass(frozen=True)
class CohesiveMap:
    """A table of maps.toml with `cohesive`."""

    name: str
    source: str
    packing: float
    deepest: float  # depth to which the map holds [tip diameters]
    reference: Mapping[str, float]
    """diameter [m], gravity [m/s2], load [N], grain of the real soil [m], speed of the fastest drives [m/s], least of
    the depths from which K comes [diameters], most of gravity times diameter [m2/s2]."""
    ranges: Mapping[str, tuple[float, float]]
    law: Mapping[str, float]
    """a, b and share s; off, the factor by which K misses left-out beds; finest d / D; K of real grains [N/m] and the
    factor within which; C of them [N s/m] and its std; shape, the std of ln(F / K z) over depth."""

    @property
    def finest(self) -> float:
        """d / D of the finest bed [1]."""
        return self.law["finest"]

    def answer(
        self, *, gravity: float, diameter: float, grain: float | None, packing: float | None, load: float | None
    ) -> Answer:
        """The numbers of a spike; SI units. Raises ValueError for what is beyond the map, naming the key."""
        asked = asked_of(self, gravity=gravity, diameter=diameter, grain=grain, packing=packing, load=load)
        most = self.reference["most"]
        if gravity * diameter > most * (1 + SLACK):
            raise ValueError(say("beyond_weight", name=self.name, diameter=diameter, gravity=gravity,
                                 lightest=most / diameter, smallest=most / gravity))  # fmt: skip
        g, size, share = asked.gravities, asked.sizes, self.law["share"]
        logarithm, error = self._of_grains(asked.ratio)
        value = math.exp(logarithm) * ((1 - share) * g * size**2 + share * size)
        stiffness = Number(value, value * error)
        damping = Number(self.law["damping"] * size**2, self.law["damping_std"] * size**2)
        sinkage = asked.load / value
        check_depth(sinkage, asked, most=self.deepest)
        deep = sinkage >= self.reference["shallowest"] * diameter
        uncertain = times(Number(sinkage, sinkage * error), Number(1.0, self.law["shape"]))
        return Answer(
            stiffness, damping, uncertain, asked.load, asked.grain, asked.ratio, asked.packing,
            self.reference["speed"], deep,
        )  # fmt: skip

    def _of_grains(self, ratio: float) -> tuple[float, float]:
        """ln of K at the reference for d / D, and its standard deviation."""
        finest, real = self.law["finest"], self.reference["grain"] / self.reference["diameter"]
        off = math.log(self.law["off"])
        if ratio >= finest:
            return self.law["a"] + self.law["b"] * ratio, off
        way = min(1.0, (finest - ratio) / (finest - real))
        first, last = self.law["a"] + self.law["b"] * finest, math.log(self.law["stiffness"])
        return first + way * (last - first), math.hypot(off, way * math.log(self.law["within"]))

    def held(self, answer: Answer, *, load: float, gravity: float, diameter: float) -> Held | None:
        """What the answer owes to the cohesion of the soil; None where its error contains what the least leaves.

        The least cohesion is that at 95 %. What it leaves follows from K of the map, and from Terzaghi's formula for a
        flat foot as wide.

        The part of K that cohesion carries is taken in proportion to it. ``load``: Of the sinkage [N]. ``gravity``:
        [m/s2]. ``diameter``: Of the tip [m].
        """
        carried = self._carried(gravity, diameter)
        if carried is None:
            return None
        found, share, softer = carried
        pressure = load / (math.pi * diameter**2 / 4)
        depths = footing_depths(
            MATERIALS[self.name], pressure, gravity=gravity, diameter=diameter, cohesion=found.least
        )
        firm = load / answer.stiffness.value
        ends = (firm / softer, *depths)
        known = ends if firm <= self.deepest * diameter else ends[:1]  # beyond the map there is no sinkage to compare
        if max(known) <= firm * (1 + answer.sinkage.half / answer.sinkage.value):
            return None
        return Held(found, share, load, (min(ends), max(ends)))

    def _carried(self, gravity: float, diameter: float) -> tuple[Cohesion, float, float] | None:
        """The cohesion of the soil, its share of K [1], and K at the least cohesion over K [1]; None if not known."""
        found = cohesion_in_95(MATERIALS[self.name])
        if found is None:
            return None
        g, size = gravity / self.reference["gravity"], diameter / self.reference["diameter"]
        share = self.law["share"] * size / ((1 - self.law["share"]) * g * size**2 + self.law["share"] * size)
        return found, share, 1 - share + share * found.least / found.value

    def if_cohesion_holds(self, answer: Answer, *, gravity: float, diameter: float) -> list[str]:
        """That K needs the cohesion of the soil, where the least cohesion leaves less of K than its error says.

        ``gravity``: [m/s2]. ``diameter``: Of the tip [m].
        """
        carried, k = self._carried(gravity, diameter), answer.stiffness
        if carried is None or carried[2] * (1 + k.half / k.value) >= 1:
            return []
        cohesion, share, softer = carried
        return [say("if_it_holds_for_k", percent=100 * share, cohesion=cohesion, part=softer)]

    def words(self, answer: Answer, *, gravity: float, diameter: float) -> list[str]:
        """What a person must know of this map besides its numbers."""
        size = diameter / self.reference["diameter"]
        even = self.law["share"] / (1 - self.law["share"]) * self.reference["gravity"] / size  # [m/s2]
        told = [say("of_cohesion", even=even, gravity=gravity), say("of_coarse_beds", map=self, answer=answer)]
        if not math.isclose(size, 1.0, rel_tol=1e-6):
            told.append(say("of_similarity", map=self))
        return told
