"""The rolling spring of each pair of grains, which LAMMPS has as one constant for each pair of atom types.

Our law has the spring 8 G* a, which follows the contact radius a and so the load. In LAMMPS an atom type is a class of
load: a grain's mean contact radius, in steps of 26 %. The spring of two types is 8 G* a of a contact that both carry.

A grain's load W is its radius times the sum of the forces of its contacts: with grains its virial 1/2 sum r_ij . F_ij,
of `compute stress/atom`, with floor and bodies the arm times the force. The force between i and j follows from the
sums S = W / R of both as `SHARE` S_i S_j / (S_i + S_j). With Hertz' a^3 = 3 R* F / (4 E*) this is
a^3 = 2 c_i c_j / (c_i + c_j), where c = 3 `SHARE` W / (16 E*) for a grain.

Types change every `PERIOD` steps. They follow from the loads of the step before, extrapolated linearly to the middle of
the time in which they hold. What a rank knows of grains beyond its border, or beyond the box's, is renewed with its
neighbour lists alone. So `fix balance`, which never balances, makes these lists every `PERIOD` steps, and types change
just before: all ranks have the same spring for a contact.
"""

import math
from collections.abc import Sequence

import numpy as np

from dem.grains.materials import Material

from .law import MeanContact, law_words

__all__ = ["CLASSES", "PERIOD", "SHARE", "RollingClasses"]

SHARE = 0.59
"""Force of a contact over S_i S_j / (S_i + S_j), where forces count by their size [1].

In four rained beds of sand, in 9.81 and 0.0981 m/s2, it is 0.588 to 0.597 (docs/notes/scale.md). Where n equal forces
press each grain it is 2 / n.
"""
PERIOD = 10
"""Time steps between two looks at the loads [1]."""
CLASSES = 32
"""Number of classes [1]: overlaps of 1e-7 to 0.17 of a diameter."""
_LEAST = 1e-7  # Overlap of the first class [d]
_STEP = 2.0  # Cube of the ratio of the contact radii of a class and the next
_HOLD = 0.75  # A grain keeps its class within so many of its middle, lest it goes to and fro
_PULL = {"none": 0.0, "dmt": 1.0, "jkr": 3.0}  # Load by cohesion alone over pi w R: of Hertz' a at no force, R* = R / 2


class RollingClasses:
    """The classes of a bed: their springs, and the commands by which grains in LAMMPS change them.

    ``row``: pair parameters of two grains. ``radii``, ``masses`` [m, kg]: of the grains, shape [grain_count] both.
    ``more``: what else presses a grain, in LAMMPS' words.
    """

    def __init__(
        self, row: Sequence[float], material: Material, radii: np.ndarray, masses: np.ndarray, *, more: str = ""
    ) -> None:
        self.row, self.material, self.more = row, material, more
        self.two_e, pi_w = float(row[0]), float(row[-1])
        self.mass, radius = 0.5 * float(np.mean(masses)), float(np.mean(radii))
        # Cubes of contact radii [m3]: of the first class, by a^2 = R* d, and of cohesion's load.
        self._first = (radius**2 * _LEAST) ** 1.5
        self._pull = 0.75 / self.two_e * _PULL[material.cohesion] * pi_w * radius**2
        self.count = CLASSES if material.rolling_friction > 0 else 1

    def of(self, load: np.ndarray) -> np.ndarray:
        """Class of grains with these loads W [N m], from 1, shape [grain_count]."""
        cubes = np.maximum(self._pull + 0.375 * SHARE / self.two_e * load, self._first)
        found = np.rint(1 + np.log(cubes / self._first) / math.log(_STEP)).astype(int)
        return np.minimum(found, self.count)

    def contact(self, one: int, other: int) -> MeanContact:
        """The contact whose rolling spring the grains of two classes have."""
        return MeanContact(radius=float(self.radius(one, other)), mass=self.mass)

    def radius(self, one: np.ndarray | int, other: np.ndarray | int) -> np.ndarray:
        """The contact radius of this contact, or of several [m]."""
        cubes = [self._first * _STEP ** (np.asarray(number, dtype=float) - 1) for number in (one, other)]
        return np.asarray((2 * cubes[0] * cubes[1] / (cubes[0] + cubes[1])) ** (1 / 3))

    def pairs(self, *, tensile: bool) -> list[str]:
        """The commands that give each pair of classes its law. ``tensile``: as of `law_words`."""
        return [
            f"pair_coeff {one} {other} "
            + law_words(self.row, self.material, tensile=tensile, mean=self.contact(one, other))
            for one in range(1, self.count + 1)
            for other in range(one, self.count + 1)
        ]

    def watch(self) -> list[str]:
        """The commands by which LAMMPS follows the loads."""
        if self.count == 1:
            return []
        rate = 0.5 * (PERIOD + 1) / (PERIOD - 1)
        # A variable is evaluated anew wherever it stands, so each stands seldom: max(0, x) = (x + |x|) / 2.
        over = f"0.5*f_load+{rate:.17g}*(f_load-f_past)*(f_past!=0)"  # By how much the load to come is over half of it
        to_come = "0.5*(f_load+v_over+abs(v_over))"
        cube = f"({self._pull:.17g}+{0.375 * SHARE / self.two_e:.17g}*{to_come})/{self._first:.17g}-1"
        number = f"1+ln(1+0.5*(v_cube+abs(v_cube)))/{math.log(_STEP):.17g}"
        bounded = f"round({self.count}-0.5*(v_below+abs(v_below)))"
        return [
            "compute press all stress/atom NULL pair",
            *self.walls([]),
            "variable pressed atom v_walls-(c_press[1]+c_press[2]+c_press[3])",
            # Two samples, of which the second ends a mean that is not used: between them the values are the first.
            f"fix load all ave/atom 1 2 {PERIOD} v_pressed",
            f"fix past all ave/atom {PERIOD} 1 {PERIOD} v_pressed",
            f"fix lists all balance {PERIOD} 1e9 shift xy 1 1e9",
            f"variable over atom {over}",
            f"variable cube atom {cube}",
            f"variable number atom {number}",
            f"variable below atom {self.count}-v_number",
            f"variable class atom type+(abs(v_number-type)>{_HOLD})*({bounded}-type)",
        ]

    def walls(self, names: Sequence[str]) -> list[str]:
        """The command that has the forces of the floor and of these pieces of bodies count in the loads."""
        if self.count == 1:
            return []
        arms = ("x", 5), ("y", 6), ("z", 7)
        work = "+".join(f"({x}-f_{wall}[{k}])*f_{wall}[{k - 3}]" for wall in ["floor", *names] for x, k in arms)
        return [f"variable walls atom {work}{self.more}"]

    def runs(self, begin: int, steps: int, since: int) -> list[str]:
        """The commands of ``steps`` time steps from step ``begin``, with the changes of type among them.

        ``since``: the step from which on LAMMPS follows the loads.
        """
        if self.count == 1:
            return [f"run {steps} pre no post no"]
        found, at, end = list[str](), begin, begin + steps
        while at < end:
            if (at + 1) % PERIOD == 0 and at >= since + PERIOD - 1:
                found.append("set group all type v_class")
            until = min(end, (at + 1) // PERIOD * PERIOD + PERIOD - 1)
            found.append(f"run {until - at} pre no post no")
            at = until
        return found
