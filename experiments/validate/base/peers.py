"""Contact by contact and along the trajectory against LIGGGHTS and LAMMPS, where they are installed.

The law that all three have: Hertz along the normal, Mindlin's no-slip spring with history sideways, dashpots of Tsuji
et al. 1992, which may pull at a contact's end. They differ where a contact slides with a dashpot (``laws`` says how,
``sliding`` has these cases) and in small terms (LAMMPS takes the whole radius as the arm of the spin, and keeps the
length of the spring as it turns it). So every assembly is run without friction; without dashpots; and with a friction
that slides only where the normal force changes its sign.

In time the peers are of first order: their dashpots see the velocity of half a step before, and their slip is taken
across the normal of the step's end. Where nothing else differs, the difference has to fall with the step.

LAMMPS' dashpot is a polynomial in the restitution that was fitted with the mass of a sphere, and is used with the
reduced one: with 0.5 it rebounds with 0.62. It is given the number whose dashpot is that of 0.5.
"""

import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from dem import Bed, Material

from . import cloud
from .case import Comparison, Curve, Outcome, Plot, Tell, near_zero, told

__all__ = ["CASES", "Assembly", "PEERS", "Peer", "compare", "dense", "lammps_restitution", "pairs", "run_peer"]

YOUNG, POISSON, DENSITY = 5e7, 0.3, 2600.0
LAWS = {  # restitution, friction
    "e = 0.5, no friction": (0.5, 0.0),
    "e = 1, friction 0.5": (1.0, 0.5),
    "e = 0.5, friction 50": (0.5, 50.0),
    "e = 0.5, friction 0.5": (0.5, 0.5),
}
STEP, LIMIT = 1e-6, 120.0  # [s], and for a peer's run [s]
COLUMNS = "id x y z vx vy vz omegax omegay omegaz fx fy fz"


@dataclass(frozen=True)
class Peer:
    """Another code: what its program may be called, its Debian package."""

    name: str
    programs: tuple[str, ...]
    package: str

    def find(self) -> str | None:
        """The program on the PATH, or None."""
        return next((name for name in self.programs if shutil.which(name)), None)

    def lacking(self) -> Outcome:
        """Of a case where it is not installed."""
        return Outcome(skipped=f"{self.name} is not installed (apt install {self.package})")


PEERS = {"liggghts": Peer("LIGGGHTS", ("liggghts",), "liggghts"), "lammps": Peer("LAMMPS", ("lmp", "lammps"), "lammps")}


@dataclass(frozen=True)
class Assembly:
    """Grains in a box periodic in x and y: shapes [grain_count, 3] or [grain_count], SI units."""

    positions: np.ndarray
    radii: np.ndarray
    velocities: np.ndarray
    spins: np.ndarray
    period: tuple[float, float]
    height: float
    gravity: float
    steps: int
    every: int
    step: float = STEP

    @property
    def samples(self) -> int:
        """How often it is looked at, the start included."""
        return self.steps // self.every + 1


def pairs(count: int = 32) -> Assembly:
    """Pairs of unlike grains, each far from the others, that meet obliquely and spinning: a contact for each force."""
    rng = np.random.default_rng(11)
    pitch, side = 0.012, 8
    i = np.arange(count)
    centers = np.column_stack([pitch * (0.5 + i % side), pitch * (0.5 + i // side), np.full(count, 0.01)])
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    radii = 0.002 * (1 + 0.3 * rng.uniform(-1, 1, (2, count)))
    gap = 1e-6 * rng.uniform(0.1, 1.0, count)
    half = 0.5 * (radii.sum(axis=0) + gap)[:, None] * normal
    closing = rng.uniform(0.3, 1.5, count)[:, None] * normal
    slip = rng.normal(0, 0.5, (count, 3))
    velocities = np.concatenate([-0.5 * closing + slip, 0.5 * closing])
    return Assembly(
        np.concatenate([centers + half, centers - half]), radii.ravel(), velocities, rng.normal(0, 100, (2 * count, 3)),
        (pitch * side, pitch * (count // side)), 0.02, 0.0, 300, 5,
    )  # fmt: skip


def dense() -> Assembly:
    """The cloud of 64 grains, in touch across every boundary, that falls."""
    positions, radii, velocities, spins = cloud.initial()
    positions[:, :2] %= cloud.PERIOD
    return Assembly(positions + [0.0, 0.0, 5e-3], radii, velocities, spins, cloud.PERIOD, 0.03, 9.81, 400, 20)


def refined(assembly: Assembly, times: int) -> Assembly:
    """The same with steps this many times finer, looked at when it was."""
    return replace(assembly, step=assembly.step / times, steps=assembly.steps * times, every=assembly.every * times)


def ours(assembly: Assembly, restitution: float, friction: float) -> np.ndarray:
    """Position, velocity, spin and force of each grain at each sample, shape [samples, grain_count, 12]."""
    bed = Bed.from_grains(
        Material("peers", DENSITY, YOUNG, POISSON, friction, restitution), positions=assembly.positions,
        radii=assembly.radii, velocities=assembly.velocities, spins=assembly.spins,
        size=(*assembly.period, assembly.height), height=3 * assembly.height, gravity=assembly.gravity, floor=False,
        tensile=True, time_step=assembly.step, max_overlap=0.2,
    )  # fmt: skip
    found = []
    for sample in range(assembly.samples):
        if sample:
            bed.advance(assembly.every)
        grains = bed.grains().as_dict()
        found.append(np.hstack([grains[name] for name in ("position", "velocity", "spin", "force")]))
    return np.array(found)


def theirs(peer: str, assembly: Assembly, restitution: float, friction: float) -> np.ndarray:
    """The same by a peer, in one process. Raises RuntimeError with its last lines where it fails."""
    atoms = spheres(assembly.radii, assembly.positions, DENSITY)
    moving = [digits(row) for row in np.hstack([assembly.velocities, assembly.spins])]
    data = data_file(box_of(*assembly.period, assembly.height), atoms, moving)
    text = run_peer(peer, data, _deck(peer, assembly, restitution, friction), "dump.txt", limit=LIMIT)
    return _read_dump(text, assembly)


def run_peer(peer: str, data: str, deck: str, wanted: str, *, limit: float) -> str:
    """Run a peer, in one process, on a deck that reads ``grains.data``: the text of the file ``wanted`` that it writes.

    Raises RuntimeError with its last lines where it fails, TimeoutExpired after ``limit`` [s].
    """
    with tempfile.TemporaryDirectory(prefix="hedgebed-peer-") as name:
        folder = Path(name)
        (folder / "grains.data").write_text(data, encoding="ascii")
        (folder / "deck").write_text(deck, encoding="ascii")
        done = subprocess.run(
            [str(PEERS[peer].find()), "-in", "deck", "-log", "log.txt", "-screen", "none"], cwd=folder, check=False,
            capture_output=True, text=True, errors="replace", timeout=limit, env={**os.environ, "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        log = folder / "log.txt"
        if done.returncode != 0 or not (folder / wanted).is_file():
            said = (log.read_text(errors="replace") if log.exists() else "") + done.stdout + done.stderr
            raise RuntimeError(f"{PEERS[peer].name} failed: {' | '.join(said.splitlines()[-4:])}")
        return (folder / wanted).read_text(encoding="ascii")


def data_file(box: Sequence[str], atoms: Sequence[str], velocities: Sequence[str] = (), *, types: int = 1) -> str:
    """The data file that both read: a row of ``spheres`` for each grain; then velocity and spin."""
    lines = ["grains of hedgebed\n", f"{len(atoms)} atoms", f"{types} atom types\n", *box, "\nAtoms\n"]
    lines += [f"{k} {row}" for k, row in enumerate(atoms, 1)]
    lines += ["\nVelocities\n", *(f"{k} {row}" for k, row in enumerate(velocities, 1))] if velocities else []
    return "\n".join(lines) + "\n"


def spheres(radii: np.ndarray, places: np.ndarray, density: float) -> list[str]:
    """Type, diameter, density and position of each."""
    return [f"1 {2 * r:.17g} {density:.17g} {digits(place)}" for r, place in zip(radii, places, strict=True)]


def digits(values: Iterable[float]) -> str:
    """Numbers, all their digits."""
    return " ".join(f"{value:.17g}" for value in values)


def box_of(*sides: float) -> list[str]:
    """The lines of a box from 0 on."""
    return [f"0 {side:.17g} {axis}lo {axis}hi" for axis, side in zip("xyz", sides, strict=True)]


def lammps_restitution(restitution: float) -> float:
    """What to ask LAMMPS' ``damping tsuji`` for, to have the dashpot of a restitution [1].

    Its dashpot is alpha(e) sqrt(m* 4/3 E* a), alpha the polynomial of its manual (pair_style granular); that of Tsuji
    et al. in closed form is 2 sqrt(5/6) |beta| sqrt(m* 2 E* a), beta = ln e / sqrt(ln^2 e + pi^2).
    """
    log = math.log(restitution)
    wanted = math.sqrt(5) * -log / math.hypot(log, math.pi)
    return float(brentq(lambda e: np.polyval(_LAMMPS_TSUJI, e) - wanted, 0.05, 1.2, xtol=1e-15))


_LAMMPS_TSUJI = (4.8218, -18.022, 27.467, -22.348, 11.087, -4.2783, 1.2728)


def _deck(peer: str, assembly: Assembly, restitution: float, friction: float) -> str:
    asked = f"{lammps_restitution(restitution):.16g}"
    law = f"hertz/material {YOUNG:g} {asked} {POISSON:g} tangential mindlin NULL 1.0 {friction:g} damping tsuji"
    if peer == "liggghts":
        head = ["atom_style granular", "atom_modify map array", "communicate single vel yes"]
        contact = [
            f"fix young all property/global youngsModulus peratomtype {YOUNG:g}",
            f"fix poisson all property/global poissonsRatio peratomtype {POISSON:g}",
            f"fix rebound all property/global coefficientRestitution peratomtypepair 1 {restitution:g}",
            f"fix friction all property/global coefficientFriction peratomtypepair 1 {friction:g}",
            "pair_style gran model hertz tangential history",
            "pair_coeff * *",
        ]
        exact = 'dump_modify now sort id format "%d' + 12 * " %.17g" + '"'
    else:
        head = ["atom_style sphere", "comm_modify vel yes"]
        contact = ["pair_style granular", f"pair_coeff * * {law}"]
        exact = "dump_modify now sort id format float %.17g"
    lines = ["units si", *head, "boundary p p f", "newton off", "read_data grains.data", "neighbor 2e-4 bin"]
    lines += ["neigh_modify delay 0 every 1 check yes", *contact]
    if assembly.gravity:
        lines.append(f"fix weight all gravity {assembly.gravity:g} vector 0.0 0.0 -1.0")
    lines += [
        "fix motion all nve/sphere",
        f"timestep {assembly.step:.17g}",
        f"dump now all custom {assembly.every} dump.txt {COLUMNS}",
    ]
    return "\n".join([*lines, exact, "thermo 100", f"run {assembly.steps}"]) + "\n"


def _read_dump(text: str, assembly: Assembly) -> np.ndarray:
    blocks = text.split("ITEM: ATOMS")[1:]
    if len(blocks) != assembly.samples:
        raise RuntimeError(f"the dump holds {len(blocks)} samples, {assembly.samples} were wanted")
    rows = [[line.split() for line in block.splitlines()[1:] if not line.startswith("ITEM")] for block in blocks]
    found = np.array([[[float(v) for v in row[:13]] for row in block[: len(assembly.radii)]] for block in rows])
    return found[:, :, 1:]


def compare(peer: str, assembly: Assembly, restitution: float, friction: float) -> dict[str, np.ndarray]:
    """Largest differences at each sample: force over the largest, velocity over the largest, way over a diameter.

    Our forces hold gravity, theirs as well.
    """
    here, there = ours(assembly, restitution, friction), theirs(peer, assembly, restitution, friction)
    d = here[..., :3] - there[..., :3]
    d[..., :2] -= np.array(assembly.period) * np.round(d[..., :2] / np.array(assembly.period))
    force, speed = np.abs(there[..., 9:]).max(), np.abs(there[..., 3:6]).max()
    return {
        "force": np.abs(here[..., 9:] - there[..., 9:]).max(axis=(1, 2)) / force,
        "velocity": np.abs(here[..., 3:6] - there[..., 3:6]).max(axis=(1, 2)) / speed,
        "way": np.abs(d).max(axis=(1, 2)) / (2 * assembly.radii.mean()),
    }


_WHAT = {
    "force": "force on a grain over the largest",
    "velocity": "velocity over the largest",
    "way": "place over a diameter",
}


def _compute(peer: str, make: Callable[[], Assembly], bands: dict[str, float], tell: Tell) -> Outcome:
    if PEERS[peer].find() is None:
        return PEERS[peer].lacking()
    assembly = make()
    rows: list[Comparison] = []
    curves: list[Curve] = []
    time = 1e6 * assembly.step * assembly.every * np.arange(assembly.samples)
    for label, band in told(bands.items(), tell):
        found = compare(peer, assembly, *LAWS[label])
        rows += [near_zero(f"{label}: difference of the {what}", found[key].max(), band) for key, what in _WHAT.items()]
        if label in ONE_LAW[peer]:
            finer = compare(peer, refined(assembly, _FINER), *LAWS[label])["velocity"].max()
            order = math.log(found["velocity"].max() / finer) / math.log(_FINER)
            quantity = f"{label}: order at which the velocities' difference falls"
            rows.append(Comparison(quantity, "1", 1.0, order, 0.1, False))
        curves.append(Curve(label, time, np.maximum(found["force"], 1e-17)))
    return Outcome(rows, [Plot(*LARGEST_FORCE, curves, "y")])


LARGEST_FORCE = ("Largest difference of a force, over the largest force", "time [us]", "difference [1]")
"""Title and axes of the plots."""
_UNDAMPED, _SMOOTH, _STICKING = "e = 1, friction 0.5", "e = 0.5, no friction", "e = 0.5, friction 50"
ONE_LAW = {"liggghts": (_SMOOTH, _UNDAMPED), "lammps": (_SMOOTH,)}
"""The laws in which a peer differs from the bed in nothing but its order in time."""
_FINER = 8
# Where the normal force changes its sign friction slides for a moment, even at 50. LAMMPS' small terms are of the order
# of overlap over radius, 5 % here.
# Without a dashpot the step's first order is some 1e-4.
_SIGN, _SMALL_TERMS, _FIRST_ORDER = 0.03, 0.05, 1e-3
_CASES = (
    ("liggghts-contacts", pairs, {_SMOOTH: _SIGN, _UNDAMPED: _FIRST_ORDER, _STICKING: _SIGN}),
    ("liggghts-cloud", dense, {_UNDAMPED: _FIRST_ORDER}),
    ("lammps-contacts", pairs, {_SMOOTH: _SIGN} | dict.fromkeys((_UNDAMPED, _STICKING), _SMALL_TERMS)),
    ("lammps-cloud", dense, {_SMOOTH: _SIGN, _UNDAMPED: _SMALL_TERMS}),
)
CASES = {name: partial(_compute, name.partition("-")[0], make, bands) for name, make, bands in _CASES}
