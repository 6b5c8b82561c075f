"""The angle to which a cut bed slumps, against LAMMPS: the same grains in the same places, let go.

A bed of sand is rained in, and its grains are put as they lie on a rough floor with nothing beside them: a block with
two vertical faces, as wide as the bed and long in y by its period. Both codes let it slump, and the two slopes of each
heap are fitted as ``dem.measure.repose`` fits them. The way to it is chaotic, so that heaps are compared and not
grains.

Grains neither slide nor roll on the floor. LAMMPS' rolling spring is of one stiffness (``friction_angle``).
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dem import Bed, Facing
from dem.grains.materials import SAND_WEAK, Material
from dem.measure.repose import measure_flanks, thickness_profile
from experiments.bed.tests import stiff_enough
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, tracked, within
from experiments.validate.base.peers import PEERS, box_of, data_file, deck_of, run_peer, spheres

from . import say
from .friction_angle import lammps_law

__all__ = ["CASES", "Heap", "in_lammps", "slumped"]

GRAIN, SPREAD, GRAVITY, SEED = 0.004, 0.15, 9.80665, 1
BLOCK, LENGTH = (28.0, 6.0, 10.0), 72.0  # of the block, and of the box along x [mean diameters]
ROLLING = (0.0, 0.356)  # friction is 0.5; the second is that of sand
TIME = 15.0  # of the slump [times in which a grain falls the block's height]
BAND, CREST_BAND = 2.0, 0.1  # [degrees], [1]: slopes of one heap differ by 1 to 2 degrees
ROUGH = 10.0  # friction and rolling friction of the floor [1], as in ``dem.measure.shearing``
LIMIT = 900.0  # for LAMMPS [s]


@dataclass(frozen=True)
class Heap:
    """What is left of the block."""

    angle: float  # mean of the two slopes [degrees]
    error: float  # half their difference [degrees]
    crest: float  # its height [m]
    distance: np.ndarray  # of the profile [m], shape [n]
    thickness: np.ndarray  # of the profile [m], shape [n]
    energy: float  # kinetic, of a grain over m g d [1]


def _block(stuff: Material) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Places [m], shape [grain_count, 3], and radii [m] of the grains, their softened modulus [Pa], their packing."""
    length, width, depth = size = tuple(side * GRAIN for side in BLOCK)
    like = {"grain": GRAIN, "spread": SPREAD, "gravity": GRAVITY}
    young = stiff_enough(stuff, depth=depth, bearing=2.0, **like)
    bed = Bed.prepare(stuff, size=size, seed=SEED, young=young, threads=1, **like)
    grains = bed.grains()
    places = grains.position.copy()
    places[:, 0] = np.mod(places[:, 0], length) + 0.5 * (LENGTH * GRAIN - length)
    places[:, 1] = np.mod(places[:, 1], width)
    return places, grains.radius, young, bed.packing_fraction


def _bed(stuff: Material, places: np.ndarray, radii: np.ndarray, young: float) -> Bed:
    """These grains in the long box, on the rough floor."""
    return Bed.from_grains(
        stuff.with_rolling(), positions=places, radii=radii, size=(LENGTH * GRAIN, BLOCK[1] * GRAIN, BLOCK[2] * GRAIN),
        gravity=GRAVITY, young=young, floor=Facing(friction=ROUGH, rolling_friction=ROUGH), threads=1,
    )  # fmt: skip


def _heap(bed: Bed, packing: float, energy: float) -> Heap:
    # The profile's origin lies where the flanks begin: far from the heap, which sits in the box's middle.
    distance, thickness = thickness_profile(bed, packing=packing, width=0.5 * GRAIN)
    period = bed.size[0]
    flanks = measure_flanks(distance, thickness, start=0.0, end=0.5 * period, period=period, grain=GRAIN)
    if flanks is None:
        raise RuntimeError("the heap has no slopes")
    angles = [flank.angle for flank in flanks]
    three = (thickness + np.roll(thickness, 1) + np.roll(thickness, -1)) / 3
    order = np.argsort(np.mod(distance, period))
    return Heap(
        0.5 * sum(angles), 0.5 * abs(angles[0] - angles[1]), float(three.max()),
        np.mod(distance, period)[order] - 0.5 * period, thickness[order], energy,
    )  # fmt: skip


def _steps(bed: Bed) -> int:
    return round(TIME * math.sqrt(2 * BLOCK[2] * GRAIN / GRAVITY) / bed.time_step)


def slumped(stuff: Material, block: tuple[Any, ...], tell: Tell = lambda share: None) -> Heap:
    """What a block (places, radii, modulus, packing) of this material comes to here."""
    places, radii, young, packing = block
    bed = _bed(stuff, places, radii, young)
    for _ in tracked(range(10), tell):
        bed.advance(_steps(bed) // 10)
    return _heap(bed, packing, bed.kinetic_energy / bed.weight / GRAIN)


def in_lammps(stuff: Material, block: tuple[Any, ...]) -> Heap:
    """The same in LAMMPS. Raises RuntimeError with its last lines where it fails."""
    places, radii, young, packing = block
    bed = _bed(stuff, places, radii, young)
    steps, high = _steps(bed), 3 * BLOCK[2] * GRAIN
    data = data_file(box_of(*bed.size[:2], high), spheres(radii, places, stuff.density))
    law, floor = lammps_law(stuff, young, GRAIN), lammps_law(stuff, young, GRAIN, friction=ROUGH)
    lines = [
        "pair_style granular", f"pair_coeff * * {law}", f"timestep {bed.time_step:.17g}",
        f"fix floor all wall/gran granular {floor} zplane 0.0 NULL",
        f"fix weight all gravity {GRAVITY:.17g} vector 0.0 0.0 -1.0", "fix motion all nve/sphere", "thermo 10000",
        f"dump last all custom {steps} dump.txt id x y z vx vy vz",
        "dump_modify last sort id first no format float %.17g", f"run {steps}",
    ]  # fmt: skip
    deck = deck_of("lammps", lines, boundary="p p f", skin="4e-4")
    text = run_peer("lammps", data, deck, "dump.txt", limit=LIMIT)
    rows = np.array([line.split()[1:] for line in text.split("ITEM: ATOMS")[-1].splitlines()[1:]], dtype=float)
    mass = stuff.density * 4 / 3 * math.pi * radii**3
    energy = 0.5 * float(mass @ (rows[:, 3:] ** 2).sum(axis=1)) / float(mass.sum()) / (GRAVITY * GRAIN)
    ends = rows[:, :3].copy()
    ends[:, :2] = np.mod(ends[:, :2], bed.size[:2])
    return _heap(_bed(stuff, ends, radii, young), packing, energy)


def _compute(tell: Tell) -> Outcome:
    if PEERS["lammps"].find() is None:
        return PEERS["lammps"].skipped()
    block = _block(replace(SAND_WEAK, name="slump"))
    tell(0.3)
    rows, curves, words = [], [], []
    for k, rolling in enumerate(ROLLING):
        stuff = replace(SAND_WEAK, name="slump", friction=0.5, rolling_friction=rolling)
        begin = 0.3 + 0.35 * k
        here = slumped(stuff, block, within(tell, begin, begin + 0.2))
        there = in_lammps(stuff, block)
        tell(begin + 0.35)
        about = f"rolling friction {rolling:g}"
        rows.append(Comparison(f"{about}, angle", "degrees", there.angle, here.angle, BAND, False))
        rows.append(Comparison(f"{about}, crest", "mm", 1e3 * there.crest, 1e3 * here.crest, CREST_BAND))
        for label, one in (("LAMMPS", there), ("bed", here)):
            curves.append(Curve(f"{label}, {rolling:g}", 1e3 * one.distance, 1e3 * one.thickness, label == "bed"))
        words.append(say("slopes", about=about, here=here, there=there))
    remark = say(
        "block", count=len(block[1]), grain=1e3 * GRAIN, spread=100 * SPREAD,
        block=" x ".join(f"{side:g}" for side in BLOCK), words="; ".join(words),
    )  # fmt: skip
    plot = Plot("The heaps", "distance from the middle [mm]", "thickness [mm]", curves)
    return Outcome(rows, [plot], [remark])


CASES = {"repose": _compute}
