"""Force on a platform while it is set down, from the same grains in our bed and in LAMMPS.

    python docs/results/lammps-tumble/same.py OUT RUN.toml SEED...

Contacts begin without history in both, and the grains do not come to rest first. Ends 8 ms after the first touch.
Prints the mean force since then in both, and writes OUT/same-bed-SEED.csv and OUT/same-lammps-SEED.csv: time [s], force
along x, y and z [N], height of the centre [m].
"""

import sys
import tempfile
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

import experiments.grains.lammps as lammps
from coupling import CoupledTumble
from coupling.lammps import LammpsBed
from dem import Bed
from experiments import tumble
from experiments.tumble.on_grains import PlanarOnBed
from experiments.tumble.settings import TumbleSettings

TIME = 8e-3
ROWS: list[tuple[float, ...]] = []


class EnoughError(Exception):
    """The time is over."""


def fresh(bed: Any) -> Bed:
    """The bed without the history of its contacts, which LAMMPS cannot take over."""
    grains = bed.grains()
    made = Bed.from_grains(
        bed.material, positions=grains.position, radii=grains.radius, velocities=grains.velocity, spins=grains.spin,
        size=tuple(bed.size), gravity=bed.gravity, height=0.6, time_step=bed.time_step, threads=1,
    )  # fmt: skip
    made.overlap_limit = bed.overlap_limit
    return made


def follow(seed: int, kind: str, given: dict[str, Any]) -> np.ndarray:
    """The rows of one run."""
    ROWS.clear()
    own: dict[str, Any] = {"ground": kind, "seed": seed, "frame_count": 0, "threads": 1}
    known = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in given.items() if key in TumbleSettings.model_fields and key != "ranks"
    }  # fmt: skip
    ranks = {"ranks": 2} if kind == "lammps" else {}
    with suppress(EnoughError):
        tumble.run(TumbleSettings(**known | own | ranks), Path(tempfile.mkdtemp()) / "run")
    return np.array(ROWS)


def main(out: Path, given: dict[str, Any], seeds: list[int]) -> None:
    """Run both for each seed."""
    own_lower, own_ground = CoupledTumble._lower, PlanarOnBed.ground

    def lower(self: CoupledTumble, reaction: Any) -> None:
        ROWS.append((float(self.body.time), *map(float, reaction.force), float(self.body.pose.position[2])))
        touched = [row[0] for row in ROWS if row[3] > 0]
        if touched and ROWS[-1][0] > touched[0] + TIME:
            raise EnoughError
        own_lower(self, reaction)

    CoupledTumble._lower = lower
    PlanarOnBed.ground = lambda self, bed: own_ground(self, fresh(bed) if self.settings.ground == "bed" else bed)
    lammps.moved_to_lammps = lambda bed, settings, progress, *, begin=0.0: LammpsBed(fresh(bed), ranks=2)
    for seed in seeds:
        bed, other = (follow(seed, kind, given) for kind in ("bed", "lammps"))
        first, end = int(np.argmax(bed[:, 3] > 0)), min(len(bed), len(other))
        for kind, rows in (("bed", bed), ("lammps", other)):
            np.savetxt(out / f"same-{kind}-{seed}.csv", rows, delimiter=",")
        means = [np.cumsum(rows[first:end, 3]) / np.arange(1, end - first + 1) for rows in (bed, other)]
        for k in range(0, end - first, 2):
            since = 1e3 * (bed[first + k, 0] - bed[first - 1, 0])
            print(f"seed {seed}, {since:.2f} ms: {means[0][k]:.5f} N, {means[1][k]:.5f} N in LAMMPS, "
                  f"ratio {means[1][k] / means[0][k]:.4f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    read = tomllib.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))["settings"]
    main(Path(sys.argv[1]), read, [int(word) for word in sys.argv[3:]])
