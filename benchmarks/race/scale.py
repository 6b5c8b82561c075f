"""Whether a large bed costs as much a grain as a small one: grain-steps a second, and bytes a grain.

The race's bed after its warm-up is laid end to end (``Bed.repeated``), so that every size has the same grains in the
same state. Each size runs in a process of its own, which also says what memory it holds and held at most. Bytes a grain
are the growth from the smallest size to this one over the growth in grains. So they leave out Python and Taichi.

python -m benchmarks.race.scale BED.npz TIMES THREADS STEPS    # one size: a line of JSON
"""

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.race.entrants import Ours
from benchmarks.race.grains import Grains
from dem import Bed
from experiments.runs.types import Json
from hedgebed_taichi import ti

__all__ = ["field_bytes", "keep_bed", "measure", "scale_of"]

_ROOT = Path(__file__).resolve().parents[2]
_SIZES = {"f64": 8, "i64": 8, "f32": 4, "i32": 4}
_SLOWEST, _START = 2e5, 600.0  # grain-steps per second; for making the bed, and compiling [s]
_SHOWN_FIELDS = 12  # the largest


def keep_bed(path: Path, grains: Grains, threads: int) -> None:
    """Write the race's bed, warmed up."""
    Ours(grains, threads=threads).warmed().save(path)


def scale_of(path: Path, times: int, *, count: int, threads: int, steps: int) -> Json:
    """One size, in a process of its own: what ``measure`` says. Raises RuntimeError where it failed."""
    command = [sys.executable, "-m", "benchmarks.race.scale", str(path), str(times), str(threads), str(steps)]
    limit = _START + 3 * count * times * steps / _SLOWEST
    done = subprocess.run(command, cwd=_ROOT, capture_output=True, text=True, check=False, timeout=limit)
    if done.returncode:
        last = (done.stderr.strip() or "it said nothing").splitlines()[-1]
        raise RuntimeError(f"{count * times:,} grains failed (exit status {done.returncode}): {last}")
    found: Json = json.loads(done.stdout.strip().splitlines()[-1])
    return found


def measure(path: Path, times: int, threads: int, steps: int) -> Json:
    """Speed and memory of a bed laid end to end so often; ``steps`` are timed, after as many that are not."""
    bed = Bed.load(path, threads=threads)
    if times > 1:
        bed = bed.repeated(times)
    bed.advance(steps)
    lists, began = bed.list_count, time.perf_counter()
    bed.advance(steps)
    wall = time.perf_counter() - began
    fields = field_bytes(bed)
    most = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    largest = sorted(fields, key=lambda name: -fields[name])[:_SHOWN_FIELDS]
    return {
        "grain_count": bed.grain_count, "steps": steps, "speed": bed.grain_count * steps / wall,
        "list_count": bed.list_count - lists, "held": _held(), "most": most,
        "fields": sum(fields.values()), "capacity": bed.engine.id.shape[0], "rows": bed.engine.pair.shape[0],
        "largest_fields": {name: fields[name] for name in largest},
    }  # fmt: skip


def field_bytes(bed: Bed) -> dict[str, int]:
    """Bytes of each of the engine's fields, by name; of a list of fields all of them."""
    sizes: dict[str, int] = {}
    for name, value in vars(bed.engine).items():
        for field in value if isinstance(value, list) else [value]:
            if isinstance(field, ti.Field):
                wide = field.n * field.m if isinstance(field, ti.MatrixField) else 1
                rows = 1
                for length in field.shape:
                    rows *= length
                sizes[name] = sizes.get(name, 0) + rows * wide * _SIZES[str(field.dtype)]
    return sizes


def _held() -> int:
    """Memory of this process that lies in the machine now [bytes]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize()


if __name__ == "__main__":
    place, *numbers = sys.argv[1:]
    print(json.dumps(measure(Path(place), *map(int, numbers))))
