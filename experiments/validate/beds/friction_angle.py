"""The friction angle of a sheared sample against LAMMPS: other boundaries, another code, the same grains.

Ours is ``dem.measure.element``: between rough planes, the lid servoed to its pressure. Theirs has no walls: a box
periodic in all directions, sheared by its tilt (Lees & Edwards). Its volume is that to which our sample came at large
strain, so that both are at the critical state of one packing fraction. The largest overlaps aside, angles do not depend
on what differs: the stress ratio of hard grains is a matter of friction, rolling friction and inertial number alone.

LAMMPS' rolling spring is of one stiffness, k = E d / 10, where ours follows the tangential one. Its bound, mu_r R* F_n,
is the same, and its twisting is Marshall's, as ours.

A friction angle can be read in three ways. The first is shear over normal stress on the plane of shear. The second is
that of triaxial compression at the same I1 I2 / I3. The third is Mohr and Coulomb's, from the circle through the
largest and the least principal stress of the whole tensor, sin(angle) = (s1 - s3) / (s1 + s3). It needs no plane.

Published simulations of simple shear give shear over the mean of the three normal stresses, tau / p, and the packing
fraction where slow flow settles: Chialvo, Sun & Sundaresan 2012, spheres of one size, linear springs, periodic (case
``friction-angle-published``). Where the normal stresses are alike the Mohr circle's angle is arcsin(tau / p). Those
samples are as nearly theirs as can be. Softer ones, whose overlaps are counted whole, lie denser (at friction 0.1 0.642
where the spheres are ten times as soft). Sizes within 15 % and an inertial number of 0.01 make tau / p 0.421 for 0.381
at friction 0.5.
"""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dem.contact.timestep import time_step_for
from dem.grains.materials import SAND, Material
from dem.grains.packing import draw_radii
from dem.grains.sizes import Uniform
from dem.measure.element import ElementShear, shear_element
from experiments.calibrate.tests import mohr_circle, summary_of, triaxial_angle
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, within
from experiments.validate.base.peers import (
    LAMMPS_TANGENTIAL,
    PEERS,
    box_of,
    data_file,
    deck_of,
    lammps_restitution,
    run_peer,
    spheres,
)

from . import say

__all__ = ["CASES", "Sheared", "in_lammps", "lammps_law", "mohr_angle"]

GRAIN, PRESSURE, SIZE = 0.004, 1000.0, (10.0, 8.0, 10.0)  # [m], [Pa], [mean diameters]
SPREAD, INERTIAL, STRAIN = 0.15, 0.01, 2.0
# One sample of LAMMPS scatters by 1.5 degrees on the plane of shear (0.8 of ours): three say too little.
SEEDS, SEEDS_AS_PUBLISHED = range(1, 13), (1, 2, 3)
ROLLING = (0.0, 0.356)  # friction is 0.5; the second is that of sand
BAND = 1.5  # [degrees]
PUBLISHED = {0.1: (0.268, 0.613), 0.5: (0.382, 0.587)}
"""Friction: tau / p and packing fraction of slow simple shear, without rolling friction [1]. The paper's table was not
read: the figures stand in the settings of its group's two-fluid solver (test case jetBedPU of
gudaxia/twoPhaseEulerPimpleFoamPU on GitHub: muFriction, yieldStressRatio, alphaCritical)."""
RATIO_BAND, PACKING_BAND = 0.025, 0.01  # [1]; the first is what 1.5 degrees are worth
AS_PUBLISHED = {"spread": 0.01, "inertial_number": 0.003, "max_overlap": 0.01}
"""How samples come near the published grains: hard, of one size, sheared slowly."""
LIMIT = 600.0  # for LAMMPS [s]
_EVERY, _PARTS = 20, 5


@dataclass(frozen=True)
class Sheared:
    """What a sheared sample shows at large strain."""

    angle: float  # on the plane of shear [degrees]
    triaxial: float  # of triaxial compression [degrees]
    mohr: float  # of Mohr's circle [degrees]
    error: float  # standard error of the first [degrees]
    over_mean: float  # shear over the mean normal stress [1]
    pressure: float  # normal stress [Pa]
    strain: np.ndarray  # shape [n]
    ratio: np.ndarray  # shear over normal stress, shape [n]


def lammps_law(stuff: Material, young: float, grain: float, *, friction: float | None = None) -> str:
    """LAMMPS' words for these grains, softened to ``young`` [Pa]; with a ``friction`` of its own, a wall as rough."""
    stiff = 0.1 * young * grain
    mass = stuff.density * math.pi / 6 * grain**3
    damping = 0.3 * 2 * math.sqrt(0.5 * stiff * mass)
    mu, spring = stuff.friction if friction is None else friction, LAMMPS_TANGENTIAL[stuff.tangential]
    return (
        f"hertz/material {young:g} {lammps_restitution(stuff.restitution):.16g} {stuff.poisson:g} "
        f"tangential {spring} NULL 1.0 {mu:g} "
        f"rolling sds {stiff:g} {damping:g} {stuff.rolling_friction if friction is None else friction:g} "
        "twisting marshall damping tsuji"
    )


def mohr_angle(tensor: np.ndarray) -> float:
    """Friction angle of Mohr's circle through the largest and least principal stress [degrees]; tensor [Pa], [3, 3].

    Raises ValueError for stresses of which the least is no pressure.
    """
    centre, radius = mohr_circle(tensor)
    if not radius < centre:
        raise ValueError(f"least principal stress = {centre - radius:.4g} Pa: pressures in all directions are needed")
    return math.degrees(math.asin(radius / centre))


def _stuff(rolling: float, friction: float = 0.5) -> Material:
    return replace(SAND, name="sheared", friction=friction, rolling_friction=rolling)


def _sheared(
    ratio: float, error: float, shear: float, tensor: np.ndarray, pressure: float, strain: np.ndarray,
    ratios: np.ndarray,
) -> Sheared:  # fmt: skip
    """From the shear over normal stress at large strain, its error, and the stress tensor [Pa] with its shear."""
    angle = math.degrees(math.atan(ratio))
    return Sheared(
        angle, triaxial_angle(tensor), mohr_angle(tensor), math.degrees(math.atan(ratio + error)) - angle,
        3 * abs(float(shear)) / float(np.trace(tensor)), pressure, strain, ratios,
    )  # fmt: skip


def _here(stuff: Material, seed: int, tell: Tell, **otherwise: float) -> tuple[Sheared, ElementShear]:
    """One sample, sheared; ``otherwise``: options of ``shear_element`` that are not those of the module."""
    options = {"spread": SPREAD, "inertial_number": INERTIAL} | otherwise
    run = shear_element(
        stuff, pressure=PRESSURE, grain=GRAIN, size=SIZE, strain=STRAIN, seed=seed, threads=1, tell=tell, **options
    )
    said = summary_of(run, stuff.density)
    tensor, normal = np.array(said["tensor"]), said["normal"]
    ratio, error = said["shear"] / normal, said["error"] / normal
    return _sheared(ratio, error, tensor[0, 2], tensor, normal, run.strain, run.shear / run.normal), run


def in_lammps(stuff: Material, *, young: float, packing: float, seed: int) -> Sheared:
    """Shear grains of this material, softened to ``young`` [Pa], at a packing fraction [1].

    Raises RuntimeError with LAMMPS' last lines where it fails.
    """
    table = np.loadtxt(io.StringIO(run_peer("lammps", *_input(stuff, young, packing, seed), "stress.txt", limit=LIMIT)))
    strain, (xx, yy, zz, xy, xz, yz) = STRAIN * np.arange(1, len(table) + 1) / len(table), table[:, 1:].T
    late = strain > 0.5 * STRAIN
    parts = np.array([part.mean() for part in np.array_split((-xy / yy)[late], _PARTS)])
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[:, :, late].mean(axis=2)
    ratio = float(-xy[late].mean() / yy[late].mean())
    error = float(parts.std(ddof=1)) / math.sqrt(_PARTS)
    return _sheared(ratio, error, tensor[0, 1], tensor, float(yy[late].mean()), strain, -xy / yy)


def _input(stuff: Material, young: float, packing: float, seed: int) -> tuple[str, str]:
    """Data file and deck: grains of a jittered lattice are pressed together in y in a drag, then sheared in xy."""
    rng = np.random.default_rng(seed)
    width, depth, height = (side * GRAIN for side in SIZE)
    radii = draw_radii(rng, packing * width * depth * height, Uniform(GRAIN, SPREAD))
    site = 1.25 * 2 * float(radii.max())
    across, along = int(width / site), int(depth / site)
    k, rest = np.divmod(np.arange(len(radii)), across * along)
    cell = np.array([width / across, site, depth / along])
    places = (np.column_stack([rest % across, k, rest // across]) + 0.5) * cell
    places += rng.uniform(-0.49, 0.49, (len(radii), 3)) * (cell - 2 * radii[:, None])
    box = [*box_of(width, (k.max() + 1) * site, depth), "0 0 0 xy xz yz"]
    solid = 4 / 3 * math.pi * float((radii**3).sum())
    soft = stuff.softened(young)
    step = time_step_for(soft, diameter=GRAIN * (1 - SPREAD), max_overlap=0.05, wanted=None)
    unit = GRAIN * math.sqrt(stuff.density / PRESSURE)
    rate = INERTIAL / unit
    mass = stuff.density * math.pi / 6 * GRAIN**3
    squeezing = round(30 * unit / step)
    deck = [
        "pair_style granular", f"pair_coeff * * {lammps_law(stuff, young, GRAIN)}",
        f"timestep {step:.17g}", "fix motion all nve/sphere", f"fix calm all viscous {mass / unit:.17g}",
        f"fix squeeze all deform 1 y final 0 {solid / (packing * width * depth):.17g} remap x", "thermo 10000",
        f"run {squeezing}", "unfix squeeze", "unfix calm", "compute stress all pressure NULL virial",
        f"fix turn all deform 1 xy erate {rate:.17g} remap v",
        f"fix mean all ave/time 1 {_EVERY} {_EVERY} {' '.join(f'c_stress[{i}]' for i in range(1, 7))} file stress.txt",
        f"run {round(STRAIN / rate / step / _EVERY) * _EVERY}",
    ]  # fmt: skip
    data = data_file(box, spheres(radii, places, stuff.density))
    return data, deck_of("lammps", deck, boundary="p p p", skin="4e-4")


def _smooth(strain: np.ndarray, ratio: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The ratio averaged over a fiftieth of the strain, at these strains."""
    kernel = np.ones(max(1, len(ratio) // 50))
    return np.interp(at, strain, np.convolve(ratio, kernel / len(kernel), "same"))


def _each(found: Sequence[Sheared], key: str = "angle", form: str = ".1f") -> str:
    return ", ".join(format(getattr(one, key), form) for one in found)


def _mean(found: Sequence[Sheared], key: str) -> float:
    return float(np.mean([getattr(one, key) for one in found]))


def _samples(
    stuff: Material, seeds: Sequence[int], tell: Tell, **otherwise: float
) -> tuple[list[Sheared], list[ElementShear], float]:
    """One of each seed here, sheared, and their packing fraction at large strain [1]."""
    count = len(seeds)
    pairs = [_here(stuff, seed, within(tell, k / count, (k + 1) / count), **otherwise) for k, seed in enumerate(seeds)]
    late = [run.packing[run.inside_strain > 0.5 * STRAIN].mean() for _, run in pairs]
    return [one for one, _ in pairs], [run for _, run in pairs], float(np.mean(late))


def _compute(tell: Tell) -> Outcome:
    if PEERS["lammps"].find() is None:
        return PEERS["lammps"].skipped()
    rows, curves, words = [], [], []
    for k, rolling in enumerate(ROLLING):
        stuff = _stuff(rolling)
        here, runs, packing = _samples(stuff, SEEDS, within(tell, k / len(ROLLING), (k + 0.97) / len(ROLLING)))
        there = [in_lammps(stuff, young=runs[0].young, packing=packing, seed=seed) for seed in SEEDS]
        about = f"rolling friction {rolling:g}"
        for name, words_of in (("angle", "plane of shear"), ("triaxial", "triaxial"), ("mohr", "Mohr's circle")):
            means = _mean(there, name), _mean(here, name)
            rows.append(Comparison(f"{about}, {words_of}", "degrees", *means, BAND, False))
        for label, found in (("LAMMPS", there), ("bed", here)):
            strain = np.linspace(0.05, 0.98 * STRAIN, 60)
            ratio = np.mean([_smooth(one.strain, one.ratio, strain) for one in found], axis=0)
            curves.append(Curve(f"{label}, {rolling:g}", strain, ratio, label == "bed"))
        words.append(say(
            "sheared", about=about, grain_count=runs[0].grain_count, packing=packing, here=_each(here),
            there=_each(there), pressure=_mean(there, "pressure"), ours=PRESSURE,
        ))  # fmt: skip
    remark = say(
        "samples", words="; ".join(words), spread=100 * SPREAD, inertial=INERTIAL, count=len(SEEDS),
        from_strain=0.5 * STRAIN, to_strain=STRAIN,
    )  # fmt: skip
    return Outcome(rows, [Plot("Stress ratio", "shear strain [1]", "shear over normal stress [1]", curves)], [remark])


def _published(tell: Tell) -> Outcome:
    rows, words = [], []
    everything: list[ElementShear] = []
    for k, (friction, (wanted, dense)) in enumerate(PUBLISHED.items()):
        part = within(tell, k / len(PUBLISHED), (k + 1) / len(PUBLISHED))
        found, runs, packing = _samples(_stuff(0.0, friction), SEEDS_AS_PUBLISHED, part, **AS_PUBLISHED)
        everything += runs
        ratio, circle = _mean(found, "over_mean"), _mean(found, "mohr")
        about = f"friction {friction:g}"
        rows += [
            Comparison(f"{about}, Mohr's circle", "degrees", math.degrees(math.asin(wanted)), circle, BAND, False),
            Comparison(f"{about}, shear over mean normal stress", "1", wanted, ratio, RATIO_BAND, False),
            Comparison(f"{about}, packing fraction", "1", dense, packing, PACKING_BAND, False),
        ]
        late = [run.inside_strain > 0.5 * STRAIN for run in runs]
        tensor = np.mean([run.stress[at].mean(axis=0) for run, at in zip(runs, late, strict=True)], axis=0)
        words.append(say(
            "circles", about=about, found=_each(found, "mohr"), found_2=_each(found, "over_mean", ".3f"),
            found_3=_each(found), along=tensor[0, 0] / tensor[2, 2], across=tensor[1, 1] / tensor[2, 2],
        ))  # fmt: skip
    remark = say(
        "as_published", words="; ".join(words), spread=100 * AS_PUBLISHED["spread"],
        overlap=100 * max(run.max_overlap for run in everything), inertial_number=AS_PUBLISHED["inertial_number"],
    )  # fmt: skip
    return Outcome(rows, (), [remark])


CASES = {"friction-angle": _compute, "friction-angle-published": _published}
