"""The contact law of a bed in the words of LAMMPS' `pair_style granular` and `fix wall/gran granular`.

The map starts from a row of pair parameters (`dem.contact.law.pair_parameters`), so that grains, floor and bodies all
go through it. E* and G* are the effective moduli, a the contact radius, m* the reduced mass, S_n = 2 E* a.

| here | in LAMMPS |
|---|---|
| Hertz, DMT, JKR | `hertz/material`, `dmt`, `jkr` with E = 2 E* and Poisson's ratio 0, whose effective modulus is E* |
| surface energy gamma (pull-off 4 pi gamma R*, 3 pi gamma R*) | the same number |
| normal dashpot factor sqrt(m* S_n) | `damping tsuji` with the number whose polynomial is factor sqrt(3/2) |
| no pull by the dashpot | `limit_damping`, which LAMMPS has for Hertz alone: with DMT and JKR the dashpot may pull |
| tangential spring 8 G* a, `rescaled` or `displacement` | `mindlin_rescale/force` or `mindlin` with k_t = 8 G* |
| tangential dashpot | x_gammat = tangential over normal factor |
| rolling friction | `rolling sds`: its spring is 8 G* a by classes of load (`.rolling`); its bound is the same |
| rolling friction at floor and bodies | the spring is 8 G* a at `OVERLAP`, whatever the load |
| sliding and rolling: the bound holds the spring, the dashpot acts while it sticks | it holds the two together |
| twisting | `twisting marshall`: the same spring; its bound is 2/3 mu a F_n, ours 3 pi / 16 mu a F_n; another dashpot |

The polynomial of `damping tsuji` is in LAMMPS' manual (pair_style granular). LAMMPS of 2021, but not that of 2025, puts
the number of a wall through it at every setup, in place of what it was (`FixWallGran::init`): a second setup changes
the dashpot of floor and bodies. `LammpsBed` measures whether it does, and keeps the number of setups known.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from dem.contact.cohesion import jkr_contact
from dem.contact.law import PAIR_WIDTH
from dem.grains.materials import Material

from .words import digits

__all__ = [
    "OVERLAP",
    "TANGENTIAL",
    "WALL_TRIAL",
    "MeanContact",
    "contact_radius",
    "dashpot_input",
    "kinetic_energy",
    "law_words",
    "spring_energy",
    "spring_force",
]

Row = Sequence[float] | np.ndarray
TANGENTIAL = {"displacement": "mindlin", "rescaled": "mindlin_rescale/force"}
"""LAMMPS' names of our springs (`Material.tangential`)."""
OVERLAP = 0.004
"""Overlap of the contact whose rolling spring all contacts with floor and bodies have, over a diameter [1]."""
_TRIAL = "hertz/material 1 0.9 0 tangential linear_nohistory 0 0 damping tsuji"
WALL_TRIAL = (
    "region trial block 0 2 0 2 0 2 units box", "create_box 1 trial", "create_atoms 1 single 1 1 0.45 units box",
    "set group all diameter 1.0 density 1.0", "velocity all set 0 0 -1 units box", "timestep 1e-9",
    "pair_style granular", f"pair_coeff * * {_TRIAL}", "fix motion all nve/sphere",
    f"fix trial all wall/gran granular {_TRIAL} zplane 0 NULL",
)  # fmt: skip
"""A ball of 1 m that a floor brakes: where LAMMPS loses the dashpot's number, a second setup changes the force."""
_NORMAL = {"none": "hertz/material", "dmt": "dmt", "jkr": "jkr"}
_TSUJI = (4.8218, -18.022, 27.467, -22.348, 11.087, -4.2783, 1.2728)
_LEAST, _MOST = 0.05, 1.2  # Between which the polynomial falls


@dataclass(frozen=True)
class MeanContact:
    """The contact for which a constant spring of rolling is chosen: contact radius [m] and reduced mass [kg]."""

    radius: float
    mass: float

    @classmethod
    def of(cls, radii: np.ndarray, masses: np.ndarray) -> "MeanContact":
        """That of two mean grains that overlap by `OVERLAP`: a^2 = R* d (Hertz)."""
        mean = float(np.mean(radii))
        return cls(radius=mean * math.sqrt(OVERLAP), mass=0.5 * float(np.mean(masses)))


def dashpot_input(factor: float, *, setups: int = 1) -> float:
    """What to ask ``damping tsuji`` for, to have a dashpot alpha sqrt(m* 4/3 E* a) with alpha = ``factor`` [1].

    ``setups``: how often LAMMPS puts the number through its polynomial, each time in place of the number. Raises
    ValueError for a dashpot stronger than LAMMPS' polynomial can give.
    """
    for _ in range(setups - 1):
        factor = dashpot_input(factor)
    low, high = (float(np.polyval(_TSUJI, end)) for end in (_MOST, _LEAST))
    if not low <= factor <= high:
        raise ValueError(
            f"the normal dashpot has the factor {factor:.4g}: LAMMPS' `damping tsuji` gives {max(low, 0.0):.3g} to "
            f"{high:.4g}; use a larger restitution"
        )
    return float(brentq(lambda e: np.polyval(_TSUJI, e) - factor, _LEAST, _MOST, xtol=1e-15))


def law_words(row: Sequence[float], material: Material, *, tensile: bool, mean: MeanContact, setups: int = 1) -> str:
    """The words of one kind of contact, for `pair_coeff` and for `fix wall/gran granular`.

    ``row``: its pair parameters, as `dem.contact.law.pair_row` gives them. ``material``: of the grains. ``tensile``:
    whether dashpots may pull. ``mean``: the contact for which the springs of rolling are chosen. ``setups``: as of
    `dashpot_input`. Raises ValueError for a restitution that LAMMPS' dashpot does not reach.
    """
    if len(row) != PAIR_WIDTH:
        raise ValueError(f"row has {len(row)} numbers: a row of pair parameters has {PAIR_WIDTH}")
    two_e, eight_g, damping, friction, rolling, tangential_damping, turning_damping, pi_w = map(float, row)
    words = [_NORMAL[material.cohesion], digits((two_e, dashpot_input(math.sqrt(1.5) * damping, setups=setups), 0.0))]
    if material.cohesion != "none":
        words.append(digits([pi_w / (2 * math.pi)]))
    ratio = tangential_damping / damping if damping else 0.0
    words += ["tangential", TANGENTIAL[material.tangential], digits((eight_g, ratio, friction))]
    if material.rolling_friction > 0:
        root = math.sqrt(mean.mass * two_e * mean.radius)
        words += ["rolling sds", digits((eight_g * mean.radius, turning_damping * root, rolling)), "twisting marshall"]
    words.append("damping tsuji")
    bounded = not tensile and material.cohesion == "none"
    return " ".join([*words, *(["limit_damping"] if bounded else [])])


def contact_radius(row: Row, cohesion: str, overlap: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Contact radius a of touching contacts [m], shape [contact]; parameters as of `spring_force`.

    With JKR the overlap may be negative. Raises ValueError where such a contact has parted.
    """
    two_e, pi_w = float(row[0]), float(row[-1])
    if cohesion == "jkr" and pi_w > 0:
        of_pair = {"surface_energy": pi_w / (2 * math.pi), "effective_young": 0.5 * two_e}
        pairs = zip(overlap, radius, strict=True)
        return np.array([jkr_contact(float(d), radius=float(r), **of_pair)[0] for d, r in pairs], dtype=float)
    return np.sqrt(radius * np.maximum(overlap, 0.0))


def spring_force(row: Row, cohesion: str, overlap: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Force of the normal springs of touching contacts, cohesion included [N] (`dem.contact.cohesion`).

    ``row``: pair parameters. ``overlap``: 0 or more [m], ``radius``: effective radius R* [m], shape [contact] both.
    """
    two_e, pi_w = float(row[0]), float(row[-1])
    if cohesion == "jkr" and pi_w > 0:
        of_pair = {"surface_energy": pi_w / (2 * math.pi), "effective_young": 0.5 * two_e}
        pairs = zip(overlap, radius, strict=True)
        return np.array([jkr_contact(float(d), radius=float(r), **of_pair)[1] for d, r in pairs], dtype=float)
    push = 2 / 3 * two_e * np.sqrt(radius) * overlap**1.5
    return push - 2 * pi_w * radius if cohesion == "dmt" else push


def kinetic_energy(mass: np.ndarray, radius: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> float:
    """Of balls, of translation and rotation [J]; shapes [grain_count] or [grain_count, 3], SI units."""
    moving = 0.5 * mass @ (velocity**2).sum(axis=1)
    return float(moving + 0.2 * (mass * radius**2) @ (spin**2).sum(axis=1))


def spring_energy(row: Row, cohesion: str, overlap: np.ndarray, radius: np.ndarray) -> float:
    """Energy of the normal springs of touching contacts [J]: 4/15 (2 E*) sqrt(R*) d^5/2, for DMT less 2 pi w R* d.

    Parameters as of `spring_force`. Raises ValueError for JKR, of which it does not know the stretched contacts.
    """
    two_e, pi_w = float(row[0]), float(row[-1])
    if cohesion == "jkr":
        raise ValueError("cohesion is 'jkr': LAMMPS does not report which stretched contacts still hold")
    pressed = 4 / 15 * two_e * float((np.sqrt(radius) * overlap**2.5).sum())
    return pressed - 2 * pi_w * float((radius * overlap).sum()) if cohesion == "dmt" else pressed
