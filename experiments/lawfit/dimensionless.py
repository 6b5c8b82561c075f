"""Dimensionless laws, fitted to all tips and gravities together.

With rho the bulk density, D the diameter of the tip, x = z / D and Fr = v / sqrt(g D), the force of loading is

    F / (rho g D^3) = f(x, Fr, tip) .

A law is a static part and a part of the rate. Static parts: k_s x ("linear") and k_s x^n_s ("power"), with k and n of
each tip shape s. "area" is k (A / D^2) x^n, with the area A in the plane of the surface and one k and n for all. Parts
of the rate: c Fr ("damper"), b Fr^2 ("square"), b Fr^2 exp(-x / (T Fr)) ("early"), and the static part times a I
("inertial", I the inertial number of `experiments.grains.similarity`). With "area", b Fr^2 is times A / D^2.

"early" follows Roth, Han and Jaeger (arXiv 1910.10358): at a characteristic time after the impact the dependence on
speed becomes one on depth. So the force is not a sum of a depth term and a rate term. The form is ours, the simplest
with this property: the time since the impact, z / v, is compared with T sqrt(D / g). "one-pair" is the rival without
scaling: one K and C in N/m and N s/m for all tips and gravities.

Each cell is weighted by its rms force, so that all count the same.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from experiments.grains.similarity import inertial_number

from .data import Array, Data, Foundation, PushRun
from .fit import Estimated, LawFit, interval

__all__ = ["CROSSED", "CrossedData", "CrossedLaw", "Tangent", "cross", "crossed_laws", "shape_of", "tangent_at"]

_EXPONENT, _SETTLING = (0.0, 3.9), (1e-2, 50.0)
"""Bounds of exponents and of T [1]."""
_SAME = 1e-3
"""Froude numbers of drives within this of each other are one [1]."""
CROSSED = {
    "scaled-spring-damper": ("linear", "damper"), "scaled-katsuragi-durian": ("linear", "square"),
    "power-damper": ("power", "damper"), "power-square": ("power", "square"), "power-early": ("power", "early"),
    "power-inertial": ("power", "inertial"), "area-square": ("area", "square"), "area-early": ("area", "early"),
    "one-pair": ("si", "si"),
}  # fmt: skip
"""Name -> static part, part of the rate."""
_RATES = {"damper": "c", "square": "b", "early": "b", "inertial": "a", "si": "damping"}


def shape_of(foundation: Foundation) -> str:
    """The tip's shape, and the angle of a cone: what has a strength of its own."""
    return foundation.tip if foundation.tip != "cone" else f"cone{foundation.cone_angle:g}"


def unit_force(of: Foundation) -> float:
    """rho g D^3 [N]."""
    return of.bulk_density * of.gravity * of.diameter**3


def area(of: Foundation, x: Array) -> Array:
    """Area of the tip in the plane of the surface over D^2 at depth x D, shape of `x`."""
    if of.tip == "sphere":
        return np.where(x < 0.5, math.pi * (x - x * x), 0.25 * math.pi)
    if of.tip == "cone":
        return math.pi * np.minimum(x * math.tan(math.radians(0.5 * of.cone_angle)), 0.5) ** 2
    return np.full_like(x, 0.25 * math.pi)


@dataclass(frozen=True)
class ScaledRun(PushRun):
    """A run without dimensions: depth z / D, rate Fr, acceleration over g, force over rho g D^3, times `weight`."""

    of: Foundation
    weight: float  # 1 over the rms force of its cell
    cell: str


@dataclass(frozen=True)
class CrossedData(Data):
    """The runs of all cells, `ScaledRun`s."""

    @cached_property
    def scaled(self) -> list[ScaledRun]:
        """The runs."""
        return [run for run in self.runs if isinstance(run, ScaledRun)]

    @cached_property
    def shapes(self) -> list[str]:
        """The shapes, in the order of their first run."""
        return list(dict.fromkeys(shape_of(run.of) for run in self.scaled))

    @cached_property
    def shape_of_row(self) -> NDArray[np.str_]:
        """Shape of each row."""
        return np.concatenate([np.full(len(run.depth), shape_of(run.of)) for run in self.scaled])

    @cached_property
    def cell_of_row(self) -> NDArray[np.str_]:
        """Cell of each row."""
        return np.concatenate([np.full(len(run.depth), run.cell) for run in self.scaled])

    @cached_property
    def area(self) -> Array:
        """`area` of each row."""
        return np.concatenate([area(run.of, run.depth) for run in self.scaled])

    @cached_property
    def inertial(self) -> Array:
        """Inertial number over the Froude number, of each row."""
        return np.concatenate([np.full(len(run.depth), _inertial(run.of)) for run in self.scaled])

    @cached_property
    def weight(self) -> Array:
        """Weight of each row."""
        return np.concatenate([np.full(len(run.depth), run.weight) for run in self.scaled])

    @cached_property
    def si(self) -> tuple[Array, Array]:
        """Of each row what x and Fr are multiplied by for a force of 1 N/m and 1 N s/m, over rho g D^3."""
        of_depth = [run.of.diameter / unit_force(run.of) for run in self.scaled]
        of_rate = [math.sqrt(run.of.gravity * run.of.diameter) / unit_force(run.of) for run in self.scaled]
        lengths = [len(run.depth) for run in self.scaled]
        return np.repeat(of_depth, lengths), np.repeat(of_rate, lengths)


def _inertial(of: Foundation) -> float:
    unit = math.sqrt(of.gravity * of.diameter)
    return inertial_number(unit, gravity=of.gravity, diameter=of.diameter, grain=of.grain)


def cross(cells: Mapping[str, Data]) -> CrossedData:
    """The runs of all cells without dimensions. Beds of one seed are one bed in all cells.

    Speeds have a few digits, so a Froude number of the design differs a little between cells. Numbers that differ by
    less than `_SAME` are replaced by the smallest of them.
    """
    runs = []
    for name, data in cells.items():
        of = data.foundation
        force, speed = unit_force(of), math.sqrt(of.gravity * of.diameter)
        weight = force / float(np.sqrt(np.mean(data.force**2)))
        runs += [
            ScaledRun(
                f"{name}/{run.id}", run.bed, run.kind, run.speed / speed, run.depth / of.diameter, run.rate / speed,
                run.acceleration / of.gravity, run.force / force * weight, of, weight, name,
            )
            for run in data.runs
        ]  # fmt: skip
    same: dict[float, float] = {}
    for number in sorted({run.speed for run in runs}):
        last = next(reversed(same.values()), -math.inf)
        same[number] = last if number <= last * (1 + _SAME) else number
    merged = tuple(replace(run, speed=same[run.speed]) for run in runs)
    return CrossedData(next(iter(cells.values())).foundation, merged)


@dataclass(frozen=True)
class CrossedLaw:
    """One law of `CROSSED` for these shapes."""

    name: str
    shapes: tuple[str, ...]
    with_rate: bool = True

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the free parameters."""
        static, rate = CROSSED[self.name]
        if static == "si":
            names = ["stiffness"]
        elif static == "area":
            names = ["k", "n"]
        else:
            names = [f"k_{shape}" for shape in self.shapes]
            names += [f"n_{shape}" for shape in self.shapes] if static == "power" else []
        if self.with_rate:
            names += [_RATES[rate], *(["T"] if rate == "early" else [])]
        return tuple(names)

    @property
    def rate_parameter(self) -> str | None:
        """The free parameter of the rate term; None if there is none."""
        return _RATES[CROSSED[self.name][1]] if self.with_rate else None

    def without_rate(self) -> "CrossedLaw":
        """The same law without its rate term."""
        return replace(self, with_rate=False)

    def bounds(self) -> tuple[Array, Array]:
        """Smallest and largest value of each free parameter, shapes [parameter_count]."""
        ends = []
        for name in self.free:
            if name.startswith("n"):
                ends.append(_EXPONENT)
            elif name == "T":
                ends.append(_SETTLING)
            else:
                ends.append((-np.inf if name == self.rate_parameter else 0.0, np.inf))
        low, high = zip(*ends, strict=True)
        return np.array(low), np.array(high)

    def start(self, data: Data) -> Array:
        """A first guess from straight lines in log force over log depth, shape [parameter_count]."""
        assert isinstance(data, CrossedData)
        force, guess = data.force / data.weight, dict.fromkeys(self.free, 0.0)
        good = (force > 0) & (data.depth > 0)
        exponents = {}
        for shape in self.shapes:
            rows = good & (data.shape_of_row == shape)
            slope = np.polyfit(np.log(data.depth[rows]), np.log(force[rows]), 1)[0] if rows.sum() > 2 else 1.0
            exponents[shape] = float(np.clip(slope, 0.5, 2.5))
        for name in self.free:
            if name.startswith("n"):
                own = exponents.get(name.removeprefix("n_"), min(exponents.values()) - 0.3)
                guess[name] = max(own, 0.3)
            elif name == "T":
                guess[name] = 1.0
        for name in self.free:
            if name.startswith("k") or name == "stiffness":
                rows = good if name in ("k", "stiffness") else good & (data.shape_of_row == name.removeprefix("k_"))
                one = self.predict(np.array([(guess | {name: 1.0})[key] for key in self.free]), data)[rows]
                guess[name] = float(one @ data.force[rows] / max(one @ one, 1e-300))
        return np.array([guess[name] for name in self.free])

    def predict(self, theta: Array, data: Data) -> Array:
        """Weighted force of every row of `data`, shape [row_count]."""
        assert isinstance(data, CrossedData)
        where = (data.depth, data.rate, data.area, data.inertial * data.rate, data.shape_of_row)
        if CROSSED[self.name][0] == "si":
            of_depth, of_rate = data.si
            values = dict(zip(self.free, theta.tolist(), strict=True))
            force = values["stiffness"] * of_depth * data.depth
            return data.weight * (force + values.get("damping", 0.0) * of_rate * data.rate)
        return data.weight * self._scaled(theta, *where)

    def _scaled(self, theta: Array, x: Array, fr: Array, over: Array, number: Array, shape: NDArray[np.str_]) -> Array:
        """F / (rho g D^3); `over`: A / D^2, `number`: the inertial number."""
        p = dict(zip(self.free, theta.tolist(), strict=True))
        static, rate = CROSSED[self.name]
        if static == "area":
            force = p["k"] * over * x ** p["n"]
        else:
            rows = [shape == one for one in self.shapes]
            k, n = (np.select(rows, [p.get(f"{name}_{one}", 1.0) for one in self.shapes]) for name in "kn")
            force = k * x**n
        if not self.with_rate:
            return np.asarray(force)
        if rate == "damper":
            return np.asarray(force + p["c"] * fr)
        if rate == "inertial":
            return np.asarray(force * (1 + p["a"] * number))
        push = p["b"] * fr**2 * (over if static == "area" else 1.0)
        if rate == "early":
            push = push * np.exp(-x / (p["T"] * np.maximum(fr, 1e-9)))
        return np.asarray(force + push)

    def force(self, theta: Array, of: Foundation, depth: float, rate: float) -> float:
        """Force [N] of a tip under a gravity at `depth` [m] and `rate` [m/s]."""
        unit, fr, x = unit_force(of), rate / math.sqrt(of.gravity * of.diameter), np.array([depth / of.diameter])
        if CROSSED[self.name][0] == "si":
            p = dict(zip(self.free, theta.tolist(), strict=True))
            return float(p["stiffness"] * depth + p.get("damping", 0.0) * rate)
        shape, speed = np.array([shape_of(of)]), np.array([fr])
        return float(unit * self._scaled(theta, x, speed, area(of, x), _inertial(of) * speed, shape)[0])


def crossed_laws(data: CrossedData) -> list[CrossedLaw]:
    """The laws that these runs can be fitted by: those that share the area only for more than one shape."""
    shapes = tuple(data.shapes)
    several = len(shapes) > 1
    return [CrossedLaw(name, shapes) for name, (static, _) in CROSSED.items() if several or static != "area"]


@dataclass(frozen=True)
class Tangent:
    """The spring-damper tangent to a law at a load and a speed."""

    load: float  # [N]
    speed: float  # [m/s]
    stiffness: Estimated  # dF/dz [N/m]
    damping: Estimated  # dF/d(dz/dt) [N s/m]
    depth: Estimated  # [m]


def tangent_at(fitted: LawFit[CrossedLaw], of: Foundation, load: float, speed: float) -> Tangent | None:
    """K and C of a crossed law at a load [N] and a speed [m/s], with 90 % intervals over beds.

    None if the law supports the load at the surface, or at no depth down to ten tip diameters.
    """
    found = [_tangent(fitted.candidate, theta, of, load, speed) for theta in (fitted.theta, *fitted.left_out)]
    if any(one is None for one in found):
        return None
    columns = np.array(found, dtype=float).T
    return Tangent(load, speed, *(interval(float(column[0]), column[1:]) for column in columns))


def _tangent(
    law: CrossedLaw, theta: Array, of: Foundation, load: float, speed: float
) -> tuple[float, float, float] | None:
    low, high = 1e-6 * of.diameter, 10 * of.diameter
    if law.force(theta, of, low, speed) >= load or law.force(theta, of, high, speed) < load:
        return None
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if law.force(theta, of, middle, speed) >= load else (middle, high)
    depth, by, fast = high, 1e-4 * high, 1e-4 * speed
    stiffness = (law.force(theta, of, depth + by, speed) - law.force(theta, of, depth - by, speed)) / (2 * by)
    damping = (law.force(theta, of, depth, speed + fast) - law.force(theta, of, depth, speed - fast)) / (2 * fast)
    return stiffness, damping, depth
