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

TIME, RANKS = 8e-3, 2
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


def from_fresh_grains(ranks: int) -> None:
    """Let every tumble begin from grains without history, on our bed and in LAMMPS on `ranks` processes."""
    own_ground = PlanarOnBed.ground
    PlanarOnBed.ground = lambda self, bed: own_ground(self, fresh(bed) if self.settings.ground == "bed" else bed)
    lammps.moved_to_lammps = lambda bed, settings, progress, **_: LammpsBed(fresh(bed), ranks=ranks)


def settings_of(seed: int, kind: str, given: dict[str, Any], ranks: int) -> TumbleSettings:
    """The settings of a run on our bed ("bed") or in LAMMPS ("lammps")."""
    own: dict[str, Any] = {"ground": kind, "seed": seed, "frame_count": 0, "threads": 1}
    known = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in given.items() if key in TumbleSettings.model_fields and key != "ranks"
    }  # fmt: skip
    return TumbleSettings(**known | own | ({"ranks": ranks} if kind == "lammps" else {}))


def follow(seed: int, kind: str, given: dict[str, Any]) -> np.ndarray:
    """The rows of one run."""
    ROWS.clear()
    with suppress(EnoughError):
        tumble.run(settings_of(seed, kind, given, RANKS), Path(tempfile.mkdtemp()) / "run")
    return np.array(ROWS)


def main(out: Path, given: dict[str, Any], seeds: list[int]) -> None:
    """Run both for each seed."""
    own_lower = CoupledTumble._lower

    def lower(self: CoupledTumble, reaction: Any) -> None:
        ROWS.append((float(self.body.time), *map(float, reaction.force), float(self.body.pose.position[2])))
        touched = [row[0] for row in ROWS if row[3] > 0]
        if touched and ROWS[-1][0] > touched[0] + TIME:
            raise EnoughError
        own_lower(self, reaction)

    CoupledTumble._lower = lower
    from_fresh_grains(RANKS)
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
