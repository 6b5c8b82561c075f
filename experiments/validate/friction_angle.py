"""The friction angle of a sheared sample against LAMMPS: other boundaries, another code, the same grains.

Ours is ``dem.element``: between rough planes, the lid servoed to its pressure. Theirs has no walls: a box periodic in
all directions, sheared by its tilt (Lees & Edwards) at the volume to which our sample came at large strain, so that
both are at the critical state of one packing fraction. The largest overlaps aside, angles do not depend on what
differs: the stress ratio of hard grains is a matter of friction, rolling friction and inertial number alone.

LAMMPS' rolling spring is of one stiffness, k = E d / 10, where ours follows the tangential one; its bound, mu_r R* F_n,
is the same, and its twisting is Marshall's, as ours.
"""

from __future__ import annotations

import math
import os
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dem.element import ElementShear, shear_element
from dem.materials import SAND, Material
from dem.packing import draw_radii
from dem.sizes import Uniform
from dem.timestep import time_step_for

from ..calibrate_tests import summary_of, triaxial_angle
from .case import Case, Comparison, Curve, Outcome, Plot
from .peers import PEERS, lammps_restitution

__all__ = ["CASES", "Sheared", "in_lammps"]

GRAIN, PRESSURE, SIZE = 0.004, 1000.0, (10.0, 8.0, 10.0)  # [m], [Pa], [mean diameters]
SPREAD, INERTIAL, STRAIN, SEED = 0.15, 0.01, 2.0, 1
ROLLING = (0.0, 0.356)  # friction is 0.5; the second is that of sand-calibrated
BAND = 1.5  # [degrees]; standard errors of samples as small as these are 0.3 to 0.8
LIMIT = 600.0  # for LAMMPS [s]
_EVERY, _PARTS = 20, 5


@dataclass(frozen=True)
class Sheared:
    """Angles on the plane of shear and of triaxial compression, standard error of the first [degrees].

    Attributes:
        strain, ratio: shear over normal stress, shape [n]. pressure: normal stress at large strain [Pa].
    """

    angle: float
    triaxial: float
    error: float
    pressure: float
    strain: np.ndarray
    ratio: np.ndarray


def _stuff(rolling: float) -> Material:
    return replace(SAND, name="sheared", friction=0.5, rolling_friction=rolling)


def _degrees(ratio: float) -> float:
    return math.degrees(math.atan(ratio))


def _here(stuff: Material, tell: Callable[[float], None]) -> tuple[Sheared, ElementShear]:
    run = shear_element(
        stuff, pressure=PRESSURE, grain=GRAIN, size=SIZE, spread=SPREAD, strain=STRAIN, inertial_number=INERTIAL,
        seed=SEED, threads=1, tell=tell,
    )  # fmt: skip
    said = summary_of(run, stuff.density)
    ratio = said["shear"] / said["normal"]
    error = _degrees(ratio + said["error"] / said["normal"]) - _degrees(ratio)
    found = Sheared(
        _degrees(ratio), triaxial_angle(np.array(said["tensor"])), error, said["normal"], run.strain,
        run.shear / run.normal,
    )  # fmt: skip
    return found, run


def in_lammps(stuff: Material, *, young: float, packing: float, seed: int = SEED) -> Sheared:
    """Shear grains of this material, softened to ``young`` [Pa], at a packing fraction [1].

    Raises RuntimeError with LAMMPS' last lines where it fails.
    """
    program = PEERS["lammps"].find()
    with tempfile.TemporaryDirectory(prefix="hedgebed-peer-") as name:
        folder = Path(name)
        for file, text in zip(("grains.data", "deck"), _input(stuff, young, packing, seed), strict=True):
            (folder / file).write_text(text, encoding="ascii")
        done = subprocess.run(
            [str(program), "-in", "deck", "-log", "log.txt", "-screen", "none"],
            cwd=folder,
            check=False,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=LIMIT,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )
        rows, log = folder / "stress.txt", folder / "log.txt"
        if done.returncode != 0 or not rows.is_file():
            said = (log.read_text(errors="replace") if log.exists() else "") + done.stdout + done.stderr
            raise RuntimeError(f"LAMMPS failed: {' | '.join(said.splitlines()[-4:])}")
        table = np.loadtxt(rows)
    strain, (xx, yy, zz, xy, xz, yz) = STRAIN * np.arange(1, len(table) + 1) / len(table), table[:, 1:].T
    late = strain > 0.5 * STRAIN
    parts = np.array([part.mean() for part in np.array_split((-xy / yy)[late], _PARTS)])
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[:, :, late].mean(axis=2)
    ratio = float(-xy[late].mean() / yy[late].mean())
    error = float(parts.std(ddof=1)) / math.sqrt(_PARTS)
    return Sheared(
        _degrees(ratio), triaxial_angle(tensor), _degrees(ratio + error) - _degrees(ratio), float(yy[late].mean()),
        strain, -xy / yy,
    )  # fmt: skip


def _input(stuff: Material, young: float, packing: float, seed: int) -> tuple[str, str]:
    """Data file and deck: grains of a jittered lattice are pressed together in y in a drag, then sheared in xy."""
    rng = np.random.default_rng(seed)
    width, depth, height = (side * GRAIN for side in (SIZE[0], SIZE[1], SIZE[2]))
    radii = draw_radii(rng, packing * width * depth * height, Uniform(GRAIN, SPREAD))
    site = 1.25 * 2 * float(radii.max())
    across, along = int(width / site), int(depth / site)
    k, rest = np.divmod(np.arange(len(radii)), across * along)
    cell = np.array([width / across, site, depth / along])
    places = (np.column_stack([rest % across, k, rest // across]) + 0.5) * cell
    places += rng.uniform(-0.49, 0.49, (len(radii), 3)) * (cell - 2 * radii[:, None])
    top = (k.max() + 1) * site
    lines = ["grains of hedgebed\n", f"{len(radii)} atoms", "1 atom types\n"]
    lines += [
        f"0 {width:.17g} xlo xhi",
        f"0 {top:.17g} ylo yhi",
        f"0 {depth:.17g} zlo zhi",
        "0 0 0 xy xz yz\n",
        "Atoms\n",
    ]
    lines += [
        f"{i} 1 {2 * r:.17g} {stuff.density:g} " + " ".join(f"{v:.17g}" for v in place)
        for i, (r, place) in enumerate(zip(radii, places, strict=True), 1)
    ]
    solid = 4 / 3 * math.pi * float((radii**3).sum())
    soft = stuff.softened(young)
    step = time_step_for(soft, diameter=GRAIN * (1 - SPREAD), max_overlap=0.05, wanted=None)
    unit = GRAIN * math.sqrt(stuff.density / PRESSURE)
    rate = INERTIAL / unit
    mass = stuff.density * math.pi / 6 * GRAIN**3
    law = (
        f"hertz/material {young:g} {lammps_restitution(stuff.restitution):.16g} {stuff.poisson:g} "
        f"tangential mindlin NULL 1.0 {stuff.friction:g} damping tsuji"
    )
    if stuff.rolling_friction:
        stiff = 0.1 * young * GRAIN
        law += f" rolling sds {stiff:g} {0.3 * 2 * math.sqrt(stiff * mass / 2):g} {stuff.rolling_friction:g}"
        law += " twisting marshall"
    squeezing = round(30 * unit / step)
    deck = [
        "units si", "atom_style sphere", "comm_modify vel yes", "boundary p p p", "newton off", "read_data grains.data",
        "neighbor 4e-4 bin", "neigh_modify delay 0 every 1 check yes", "pair_style granular", f"pair_coeff * * {law}",
        f"timestep {step:.17g}", "fix motion all nve/sphere", f"fix calm all viscous {mass / unit:.17g}",
        f"fix squeeze all deform 1 y final 0 {solid / (packing * width * depth):.17g} remap x", "thermo 10000",
        f"run {squeezing}", "unfix squeeze", "unfix calm", "compute stress all pressure NULL virial",
        f"fix turn all deform 1 xy erate {rate:.17g} remap v",
        f"fix mean all ave/time 1 {_EVERY} {_EVERY} {' '.join(f'c_stress[{i}]' for i in range(1, 7))} file stress.txt",
        f"run {round(STRAIN / rate / step / _EVERY) * _EVERY}",
    ]  # fmt: skip
    return "\n".join(lines) + "\n", "\n".join(deck) + "\n"


def _compute(tell: Callable[[float], None]) -> Outcome:
    if PEERS["lammps"].find() is None:
        return Outcome(skipped=f"LAMMPS is not installed (apt install {PEERS['lammps'].package})")
    rows, curves, words = [], [], []
    for k, rolling in enumerate(ROLLING):
        stuff = _stuff(rolling)
        here, run = _here(stuff, lambda share, k=k: tell((k + 0.7 * share) / len(ROLLING)))  # type: ignore[misc]
        packing = float(run.packing[run.inside_strain > 0.5 * STRAIN].mean())
        there = in_lammps(stuff, young=run.young, packing=packing)
        tell((k + 1) / len(ROLLING))
        about = f"rolling friction {rolling:g}"
        rows.append(Comparison(f"{about}, plane of shear", "degrees", there.angle, here.angle, BAND, False))
        rows.append(Comparison(f"{about}, triaxial", "degrees", there.triaxial, here.triaxial, BAND, False))
        for label, one in (("LAMMPS", there), ("bed", here)):
            kernel = np.ones(max(1, len(one.ratio) // 50))
            curves.append(
                Curve(
                    f"{label}, {rolling:g}",
                    np.convolve(one.strain, kernel / len(kernel), "valid"),
                    np.convolve(one.ratio, kernel / len(kernel), "valid"),
                    label == "bed",
                )
            )
        words.append(
            f"{about}: {run.grain_count} grains, critical packing {packing:.3f}, standard errors {here.error:.1f} and "
            f"{there.error:.1f} degrees (LAMMPS), where the pressure was {there.pressure:.0f} Pa for ours of "
            f"{here.pressure:.0f}"
        )
    remark = (
        f"{'; '.join(words)}. Spheres within {100 * SPREAD:g} %, friction 0.5, restitution 0.5, inertial number "
        f"{INERTIAL:g}, means over the strain from {0.5 * STRAIN:g} to {STRAIN:g}. Ours between rough planes 10 "
        "diameters apart, theirs without walls."
    )
    return Outcome(rows, [Plot("Stress ratio", "shear strain [1]", "shear over normal stress [1]", curves)], [remark])


CASES = [
    Case(
        "friction-angle",
        "The same assembly in other codes",
        "Friction angle at large strain: friction 0.5, rolling friction 0 and 0.356",
        "the other code's angles, on the plane of shear and of triaxial compression, at the same packing fraction",
        "LAMMPS of Debian, run here; the band is ours",
        _compute,
        slow=True,
        seconds=150,
    )
]
