"""A spike pushed into the race's bed, by us and by LAMMPS: the force on it, mean over equal parts of the way.

The spike is a cylinder with a flat end, of the grains' material. It starts above the surface of a bed that has settled
for as many steps in both. LAMMPS has it as a moving region, and samples its force now and then; ours is the mean over
all steps. LIGGGHTS could have it as a mesh only, and the LIGGGHTS of Debian 12 ends with a segmentation fault at any
mesh. YADE is ten times slower in the race.
"""

import os
import re
import shutil
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.race.entrants import LAMMPS, TIME_STEP, PeerError
from benchmarks.race.grains import BENCH, DIAMETER, Grains, write_data
from dem import Bed, Cylinder
from dem.engine.values import Sleep
from experiments.validate.base.peers import run_deck

__all__ = ["SAMPLES", "Push", "Pushed", "push_lammps", "push_ours", "read_push"]

SAMPLES = 10  # of a peer's force in a mean
_HERE = Path(__file__).resolve().parent
_SLOWEST, _START = 1e5, 120.0  # a peer below this is ended: grain steps per second and rank; for reading the bed [s]
_LOOP = re.compile(r"^Loop time of (\S+) on \d+ procs for (\d+) steps", re.MULTILINE)
_SKIN = 2e-4  # of the peers' lists [m]
_GAP = 1e-4  # between the spike's end and the highest grain below it, at the start [m]


@dataclass(frozen=True)
class Push:
    """What is done: ``radius`` and ``depth`` of the spike, below the height at which it starts [m]; ``speed`` [m/s].

    ``settle``: steps before. ``points``: of the force over the whole depth.
    """

    radius: float
    depth: float
    speed: float
    settle: int
    points: int

    @property
    def every(self) -> int:
        """Steps of one mean of the force; a multiple of ``SAMPLES``."""
        steps = self.depth / self.speed / TIME_STEP / self.points
        return SAMPLES * max(1, round(steps / SAMPLES))

    @property
    def settling(self) -> int:
        """Steps before the push, at least ``settle``: a multiple of ``every``, at which LAMMPS begins a mean."""
        return self.every * -(-self.settle // self.every)

    @property
    def steps(self) -> int:
        """Steps of the whole push."""
        return self.every * self.points

    def start(self, grains: Grains) -> tuple[float, float, float]:
        """Where the end's middle begins: in the middle of the bed, above all grains under it [m]."""
        x, y = (0.5 * length for length in grains.period)
        apart = np.hypot(grains.positions[:, 0] - x, grains.positions[:, 1] - y)
        below = apart < self.radius + grains.radii
        heights = (grains.positions[:, 2] + grains.radii)[below] if below.any() else grains.positions[:, 2]
        return x, y, float(heights.max()) + _GAP


@dataclass(frozen=True)
class Pushed:
    """What came out: upward force on the spike, mean over each part [N]; wall time of these parts [s]."""

    force: np.ndarray
    wall: float
    grain_steps: int
    command: str = ""

    def __len__(self) -> int:
        return len(self.force)


def push_ours(grains: Grains, push: Push, *, points: int, threads: int, sleep: Sleep | None) -> Pushed:
    """The first ``points`` parts of the push in our bed. ``sleep``: the rules, None: all grains stay awake."""
    bed = Bed.from_grains(
        BENCH, positions=grains.positions, radii=grains.radii, gravity=9.81, time_step=TIME_STEP,
        size=(*grains.period, float(grains.positions[:, 2].max())), tensile=True, threads=threads,
    )  # fmt: skip
    bed.advance(push.settling)
    where = push.start(grains)
    spike = Cylinder(bottom=0.0, top=10 * push.depth, radius=push.radius)
    body = bed.add_body(spike, position=where, young=BENCH.young, poisson=BENCH.poisson)
    # Compile what the push needs, of sleep until the first are asleep, with the spike at rest; then begin anew: the
    # peer is compiled, too.
    state = bed.state()
    if sleep is not None:  # by rules under which they do so in twelve looks
        bed.let_sleep(replace(sleep, settling=1.0, calm=1e-3, still=sleep.speed))
    bed.advance(2 * SAMPLES if sleep is None else 12 * sleep.every)
    bed.reaction(body)
    bed.restore(state)
    if sleep is not None:
        bed.let_sleep(sleep)
    bed.move_body(body, velocity=(0.0, 0.0, -push.speed))
    before, force, began = bed.grain_steps, [], time.perf_counter()
    for _ in range(points):
        bed.advance(push.every)
        force.append(float(bed.reaction(body)[0][2]))
    wall = time.perf_counter() - began
    return Pushed(np.array(force), wall, bed.grain_steps - before)


def push_lammps(grains: Grains, push: Push, *, points: int, ranks: int, folder: Path) -> Pushed:
    """The same by LAMMPS, in ``folder``. Raises PeerError where it failed or says something else."""
    x, y, tip = push.start(grains)
    top = tip + push.depth + 2 * DIAMETER
    write_data(folder / "bed.data", grains, above=top - float(grains.positions[:, 2].max()))
    steps = points * push.every
    numbers = {"skin": _SKIN, "speed": push.speed, "settle": push.settling, "steps": steps, "every": push.every}
    numbers |= {"samples": SAMPLES, "sampled": push.every // SAMPLES}
    numbers |= {"x": x, "y": y, "radius": push.radius, "tip": tip, "top": top}
    variables = {"in": "bed.data"} | {name: f"{value:.12g}" for name, value in numbers.items()}
    deck, forces = "answer.lammps", folder / "force.txt"
    shutil.copyfile(_HERE / deck, folder / deck)
    forces.unlink(missing_ok=True)
    launcher = ["mpirun", *(["--allow-run-as-root"] if os.geteuid() == 0 else []), "-np", str(ranks)]
    limit = _START + grains.count * (push.settling + steps) / (_SLOWEST * ranks)
    log, command = run_deck(LAMMPS, folder, deck, limit=limit, launcher=launcher, variables=variables)
    wall = read_push(log, steps)
    if not forces.is_file():
        raise PeerError("LAMMPS wrote no forces")
    rows = np.loadtxt(forces, ndmin=2)
    force = rows[rows[:, 0] > push.settling, 1]
    if len(force) != points or not np.isfinite(force).all():
        raise PeerError(f"LAMMPS wrote {len(force)} forces, {points} were wanted, all of them numbers")
    # It sums the force on the grains.
    return Pushed(-force, wall, grains.count * steps, " ".join(command))


def read_push(log: str, steps: int) -> float:
    """Wall time of the push [s] from a log. Raises PeerError where it holds none of so many steps."""
    loops = _LOOP.findall(log)
    if len(loops) != 2 or int(loops[1][1]) != steps:
        raise PeerError(f"the log of LAMMPS holds no push of {steps} steps")
    return float(loops[1][0])
