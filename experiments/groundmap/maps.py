"""The map of a material: numbers of one spike at one gravity in beds of several grain sizes, scaled to any other spike.

Grains that are rigid and do not stick have no length but their own and no stress but their weight. Slow forces are then

    F = rho g D^3 f(z / D, d / D, packing),

with bulk density rho, tip diameter D, depth z, grain diameter d. K at a given z / D is in proportion to g D^2, C (of
inertia) to sqrt(g) D^2.5, and the sinkage under the load w rho g D^3 to D. So the map needs runs over d / D and packing
only; two runs check the scaling (docs/calibrate.md). Over d / D each number is a straight line, fitted by `hedgebed
converge`; over packing its logarithm is.
"""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from dem.grains.materials import MATERIALS
from rigid.intervals import NORMAL

from .answers import Answer, Number, asked_of, check_depth, times
from .cohesive import CohesiveMap
from .settings import say

__all__ = ["DATA", "GroundMap", "Line", "read_map"]

DATA = Path(__file__).with_name("maps.toml")
NAMES = ("stiffness", "damping", "sinkage")
POWERS = {"stiffness": (1.0, 2.0), "damping": (0.5, 2.5), "sinkage": (0.0, 1.0)}
"""Powers of gravity and of the tip's diameter of each number. A speed has 0.5 and 0.5 (Froude number)."""
ON_EARTH = 9.7
"""Gravity from which on sand is poured and tested in laboratories as grains that do not stick [m/s2]."""


@dataclass(frozen=True)
class Line:
    """A number over d / D at the reference: values on a line with 95 % half-widths of three kinds."""

    ratios: tuple[float, ...]  # d / D, rising
    values: tuple[float, ...]
    chance: tuple[float, ...]  # of the beds
    grain: float  # of the line itself, at the first of ratios; falls to 0 at the finest bed
    finest: float  # d / D of the finest bed
    rest: float  # of what else was varied: speed, softness, depth and width of the bed

    def at(self, ratio: float) -> Number:
        """The number at d / D = ratio. Below the first of `ratios` the line goes on and its errors grow on."""
        first, second = self.ratios[:2]
        value, chance = (float(np.interp(ratio, self.ratios, each)) for each in (self.values, self.chance))
        if ratio < first:
            share = (ratio - first) / (second - first)
            value = self.values[0] + share * (self.values[1] - self.values[0])
            chance = self.chance[0] + share * (self.chance[1] - self.chance[0])
        grain = self.grain * max(0.0, (self.finest - ratio) / (self.finest - first))
        return Number(value, (chance + grain + self.rest) / NORMAL)


@dataclass(frozen=True)
class GroundMap:
    """A table of maps.toml."""

    name: str
    source: str
    packings: tuple[float, ...]  # rising; the first is that of the reference
    factors: tuple[float, ...]  # of K, at each of them
    factor_stds: tuple[float, ...]  # of the beds
    packed: tuple[float, float]  # d / D [1] of these beds, and K [N/m] of those at the first packing
    reference: Mapping[str, float]
    """diameter [m], gravity [m/s2], load [N], speed of the fastest drives [m/s], exponent of force over depth and its
    standard deviation between beds, shallowest of the depths from which it comes [diameters], real grain [m]."""
    ranges: Mapping[str, tuple[float, float]]
    lines: Mapping[str, Line]
    deepest: float = 1.0  # depth to which the map holds [tip diameters]

    @property
    def packing(self) -> float:
        """That of the rained bed [1]."""
        return self.packings[0]

    @property
    def finest(self) -> float:
        """d / D of the finest bed [1]."""
        return self.lines["stiffness"].finest

    def answer(
        self, *, gravity: float, diameter: float, grain: float | None, packing: float | None, load: float | None
    ) -> Answer:
        """The numbers of a spike; SI units. Raises ValueError for what is beyond the map, naming the key."""
        asked = asked_of(self, gravity=gravity, diameter=diameter, grain=grain, packing=packing, load=load)
        g, size, ratio = asked.gravities, asked.sizes, asked.ratio
        scaled = {}
        for name in NAMES:
            power_g, power_d = POWERS[name]
            found, scale = self.lines[name].at(ratio), g**power_g * size**power_d
            scaled[name] = Number(scale * found.value, scale * found.std)
        factor = self._factor(asked.packing, ratio)
        exponent, scatter = self.reference["exponent"], self.reference["exponent_std"]
        stiffness = times(scaled["stiffness"], factor)
        share = asked.load / asked.own_load / factor.value
        more = share ** (1 / exponent)
        of_factor, of_exponent = factor.std / factor.value / exponent, math.log(share) * scatter / exponent**2
        sinkage = times(scaled["sinkage"], Number(more, more * math.hypot(of_factor, of_exponent)))
        check_depth(sinkage.value, asked, most=self.deepest)
        speed = self.reference["speed"] * (g * size) ** 0.5
        deep = share == 1.0 or sinkage.value >= self.reference["shallowest"] * diameter
        return Answer(
            stiffness, scaled["damping"], sinkage, asked.load, asked.grain, ratio, asked.packing, speed, deep
        )  # fmt: skip

    def held(self, answer: Answer, *, load: float, gravity: float, diameter: float) -> None:
        """These grains have no cohesion that could fail."""

    def words(self, answer: Answer, *, gravity: float, diameter: float) -> list[str]:
        """What a person must know of this map besides its numbers; gravity [m/s2] and diameter [m] change nothing."""
        told = [say("of_real_grains")] if gravity < ON_EARTH else []
        if answer.packing != self.packing:
            told.append(say("of_packing", answer=answer, measured=self.packed[0]))
        return told

    def _factor(self, packing: float, ratio: float) -> Number:
        """K at this packing over that at the first: straight in its logarithm between the measured ones.

        Whether packing multiplies K at another d / D or adds as much as where it was measured is not known: the
        difference counts as a half-width of 95 %.
        """
        value = math.exp(float(np.interp(packing, self.packings, np.log(self.factors))))
        added = (value - 1) * self.packed[1] / self.lines["stiffness"].at(ratio).value
        chance = float(np.interp(packing, self.packings, self.factor_stds))
        return Number(value, chance + abs(1 + added - value) / NORMAL)


def _line(table: Mapping[str, Any]) -> Line:
    ratios, values, chance = (tuple(table[key]) for key in ("ratios", "values", "chance"))
    return Line(ratios, values, chance, table["grain"], table["finest"], table["rest"])


def _tables() -> Mapping[str, Any]:
    found = tomllib.loads(DATA.read_text(encoding="utf-8"))
    return {name: table for name, table in found.items() if isinstance(table, dict)}


def _to_calibrate(name: str) -> str:
    """The JSC-1A to compute: of the packing asked for, with the right cohesion (docs/materials.md); else the loose."""
    cut = name.removesuffix("-cut").removesuffix("-heights") + "-cut"
    return cut if cut in MATERIALS else "jsc-1a-loose-cut"


def read_map(material: str) -> GroundMap | CohesiveMap:
    """The map of a material. Raises ValueError for one that has none."""
    tables = _tables()
    if material not in tables:
        why = say("no_map_of_jsc", proposed=_to_calibrate(material)) if material.startswith(("jsc", "JSC")) else ""
        if material not in MATERIALS and (near := get_close_matches(material.lower(), tables, n=1)):
            why = f"; did you mean {near[0]!r}?"
        raise ValueError(say("no_map", material=material, known=" and ".join(tables), why=why))
    table = tables[material]
    ranges = {key: (low, high) for key, (low, high) in table["range"].items()}
    if "cohesive" in table:
        return CohesiveMap(
            name=material, source=table["source"], packing=table["packing"], deepest=table["deepest"],
            reference=table["reference"], ranges=ranges, law=table["cohesive"],
        )  # fmt: skip
    lines = {name: _line(table[name]) for name in NAMES}
    return GroundMap(
        name=material, source=table["source"], packings=tuple(table["packing"]["fractions"]),
        factors=tuple(table["packing"]["factors"]), factor_stds=tuple(table["packing"]["stds"]),
        packed=(table["packing"]["ratio"], table["packing"]["stiffness"]), reference=table["reference"],
        ranges=ranges, lines=lines,
    )  # fmt: skip
