"""One measurement of the sweep in a process of its own, which gives all its memory back; says what it found as JSON.

python -m benchmarks.sweep.worker prepare GRAINS FILE ARCH
    Writes the bed of the race into a file of numpy.
python -m benchmarks.sweep.worker measure FILE ARCH NX NY STEPS PRECISION ROLLING
    Places that bed NX by NY times side by side. WARM_STEPS steps are not timed, then STEPS are.
"""

import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.race.entrants import GRAVITY, ROLLING_FRICTION, TIME_STEP, WARM_STEPS
from benchmarks.race.grains import BENCH, Grains, coordination, packing, prepare_grains, wrapped
from dem import Bed
from experiments.runs.types import Json

__all__ = ["main", "measure", "side_by_side"]

MOST_COUNTED = 1_000_000  # grains whose contacts are counted by a tree over all of them


def side_by_side(grains: Grains, nx: int, ny: int) -> Grains:
    """A bed as long and as wide so many times: copies of one that is periodic."""
    length, width = grains.period
    i, j = (k.ravel() for k in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"))
    shift = np.column_stack([i * length, j * width, np.zeros(nx * ny)])
    positions = (grains.positions[None] + shift[:, None]).reshape(-1, 3)
    return Grains(positions, np.tile(grains.radii, nx * ny), (nx * length, ny * width))


def measure(grains: Grains, *, arch: str, steps: int, precision: str, rolling: bool, warm: int = WARM_STEPS) -> Json:
    """The work of the race (``benchmarks.race.entrants.Ours``) on these grains: how long it took, what came of it."""
    began = time.perf_counter()
    bed = Bed.from_grains(
        replace(BENCH, rolling_friction=ROLLING_FRICTION) if rolling else BENCH,
        positions=grains.positions, radii=grains.radii, size=(*grains.period, float(grains.positions[:, 2].max())),
        gravity=GRAVITY, time_step=TIME_STEP, tensile=True, precision=precision, arch=arch,
    )  # fmt: skip
    made = time.perf_counter()
    bed.advance(warm - 1)
    bed.advance(1)
    warmed = time.perf_counter()
    lists = bed.list_count
    bed.advance(steps)
    wall = time.perf_counter() - warmed
    now = bed.grains(contacts=False)
    found: Json = {
        "grains": grains.count, "precision": precision, "rolling": rolling, "steps": steps, "wall_s": wall,
        "speed": grains.count * steps / wall, "lists": bed.list_count - lists,
        "made_s": made - began, "warm_s": warmed - made, "touching": None,
        "packing": packing(grains.solid_volume, grains.period, float(now.position[:, 2].mean())),
        "kinetic_energy_per_grain": bed.kinetic_energy / grains.count, "bytes_per_grain": _bytes(bed) / grains.count,
    }  # fmt: skip
    if grains.count <= MOST_COUNTED:
        after = Grains(wrapped(now.position, grains.period), now.radius, grains.period)
        found["touching"] = coordination(after)
    return found


def _bytes(bed: Bed) -> float:
    """Memory of the engine's fields [bytes]."""
    from hedgebed_taichi import ti

    fields = [field for field in vars(bed.engine).values() if isinstance(field, ti.Field)]
    fields += [field for given in vars(bed.engine).values() if isinstance(given, list) for field in given]
    widths = [ti.lang.util.to_numpy_type(field.dtype)().itemsize * getattr(field, "n", 1) for field in fields]
    return float(sum(np.prod(field.shape) * width for field, width in zip(fields, widths, strict=True)))


def main(arguments: list[str]) -> None:
    """See above."""
    if arguments[0] == "prepare":
        count, path, arch = arguments[1:]
        grains = prepare_grains(int(count), arch=arch)
        np.savez(Path(path), positions=grains.positions, radii=grains.radii, period=np.array(grains.period))
        return
    path, arch, nx, ny, steps, precision, rolling = arguments[1:]
    with np.load(path) as file:
        unit = Grains(file["positions"], file["radii"], tuple(float(length) for length in file["period"]))
    grains = side_by_side(unit, int(nx), int(ny))
    print(json.dumps(measure(grains, arch=arch, steps=int(steps), precision=precision, rolling=rolling == "yes")))


if __name__ == "__main__":
    main(sys.argv[1:])
