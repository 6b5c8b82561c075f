"""How far the machine goes: the race's bed in plain C (yardstick.c), compiled where there is a compiler.

It is no part of the product. It has our contact law and our order of a step, so that the distance to it is not one of
the physics. ``blocks`` computes touching pairs in blocks whose arithmetic is vector instructions.
"""

import os
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.race.entrants import GRAVITY, ROLLING_FRICTION, TIME_STEP, WARM_STEPS, Entrant, Heat
from benchmarks.race.grains import BENCH, Grains, coordination, packing, wrapped
from dem.contact.law import pair_row
from dem.grains.materials import Facing

__all__ = ["FLAGS", "Yardstick", "compile_yardstick", "yardsticks"]

FLAGS = ("-O3", "-march=native", "-fopenmp", "-fno-math-errno", "-fno-trapping-math")
"""Without the last two a compiler makes no vector instructions of roots and divisions that not every pair needs."""
TOLD = ("touching", "apart", "looked_at", "finding", "forces", "moving", "sorting", "listing", "waiting")
"""Touching pairs and other rows at the end, rows looked at a step that did not touch; then the phases [s]."""
_SOURCE = Path(__file__).resolve().parent / "yardstick.c"
_SLOWEST = 2e5  # grain steps per second and thread, below which it is ended
_START = 120.0  # for reading the bed, and for threads that wait for one another on a busy machine [s]


def compile_yardstick(folder: Path) -> tuple[Path | None, str]:
    """The program, compiled into ``folder``, and "" or, where there is none, why."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None, "there is no C compiler, so the yardstick in C is left out (apt install gcc)"
    program = folder / "yardstick"
    command = [compiler, *FLAGS, str(_SOURCE), "-lm", "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or ["it said nothing"]
        return None, f"the C compiler failed, so the yardstick in C is left out: {lines[0].rpartition('/')[2]}"
    return program, ""


class Yardstick(Entrant):
    """The C loop. ``blocks``: touching pairs in blocks; ``skin`` of its lists [m]. ``folder`` takes its files."""

    limit = True

    def __init__(
        self, grains: Grains, *, program: Path, folder: Path, threads: int, blocks: bool, skin: float,
        rolling: bool = False,
    ):  # fmt: skip
        how = "pairs in blocks" if blocks else "pair by pair"
        self.name = f"C loop, {how}" + (" with rolling" if rolling else "")
        self.threads, self.skin, self.rolling, self.blocks = threads, skin, rolling, blocks
        self.grain_count = grains.count
        self._grains, self._program, self._folder = grains, program, folder
        self._bed = folder / ("yardstick-rolling.bed" if rolling else "yardstick.bed")

    def heat(self, steps: int) -> Heat:
        return self.timed(steps)[0]

    def timed(self, steps: int) -> tuple[Heat, dict[str, float]]:
        """The same, with what the loop says of itself: seconds of all threads by phase, and counts of rows."""
        grains, place = self._grains, self._folder / "yardstick.out"
        if not self._bed.exists():
            write_bed(self._bed, grains, rolling=self.rolling)
        numbers = (self.threads, WARM_STEPS, steps, f"{self.skin:g}", int(self.rolling), int(self.blocks))
        command = [str(self._program), str(self._bed), str(place), *map(str, numbers)]
        limit = _START + grains.count * (WARM_STEPS + steps) / (_SLOWEST * self.threads)
        # Each thread has a core of its own where there are as many, as ours have.
        environment = {**os.environ, "OMP_PROC_BIND": "true"}
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, check=False, timeout=limit, env=environment
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise RuntimeError(f"{self.name} was ended after {limit:.0f} s") from None
        if done.returncode:
            raise RuntimeError(f"{self.name} failed (exit status {done.returncode}): {done.stderr.strip()}")
        wall, lists, energy, *more = map(float, done.stdout.split())
        positions = wrapped(np.fromfile(place).reshape(grains.count, 3), grains.period)
        after = Grains(positions, grains.radii, grains.period)
        share = packing(grains.solid_volume, grains.period, float(positions[:, 2].mean()))
        said = " ".join(["yardstick", "BED", "OUT", *command[3:]])
        heat = Heat(grains.count * steps / wall, int(lists), coordination(after), share, energy, "", said)
        return heat, dict(zip(TOLD, more, strict=True))


def yardsticks(
    grains: Grains, *, program: Path, folder: Path, threads: int, skins: tuple[float, ...]
) -> Iterator[Yardstick]:
    """Both kinds of the loop, each with every skin [m]."""
    for blocks in (True, False):
        for skin in skins:
            yield Yardstick(grains, program=program, folder=folder, threads=threads, blocks=blocks, skin=skin)


def write_bed(path: Path, grains: Grains, *, rolling: bool) -> None:
    """Write what the yardstick reads; yardstick.c says how."""
    stuff = replace(BENCH, rolling_friction=ROLLING_FRICTION) if rolling else BENCH
    rows = [*pair_row(stuff, tensile=True), *pair_row(stuff, Facing(), tensile=True)]
    head = np.array([grains.count, *grains.period, TIME_STEP, *GRAVITY, *rows])
    mass = BENCH.density * 4 / 3 * np.pi * grains.radii**3
    np.concatenate([head, np.column_stack([grains.positions, grains.radii, mass]).ravel()]).tofile(path)
