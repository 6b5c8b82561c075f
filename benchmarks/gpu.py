"""``make gpu``: the bed on a GPU. The tests of beds there, then grain-steps per second of 20,000 to 20 million grains.

The bed is that of the race (``benchmarks.bed``), of 20,000 grains, settled once, its copies laid side by side: the same
work as the race's, so that a grain must touch as many others. Each size runs in a process of its own and ends at its
time. What a card has no memory for is left out, and said. All of it takes less than ten minutes.

python -m benchmarks.gpu [DIR] [--no-tests]      (or: hedgebed bench gpu, without the tests)
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.race.machine import begin_timing
from benchmarks.sweep import table
from experiments.runs.memory import cores_there
from experiments.runs.types import Json

__all__ = ["BEDS", "find_gpu", "main", "run", "run_tests"]

ROOT = Path(__file__).resolve().parents[1]
UNIT = 20_000
# Copies along x and y, timed steps, precision, rolling.
BEDS = (
    (1, 1, 2000, "float64", False),
    (5, 1, 1000, "float64", False),
    (10, 5, 1000, "float64", False),
    (10, 5, 1000, "float64", True),
    (10, 5, 1000, "float32", False),
    (25, 10, 1000, "float64", False),
    (40, 25, 1000, "float64", False),
)
BYTES_PER_GRAIN = 3000  # more than a grain takes, rolling and what Taichi keeps for itself included
PREPARE_LIMIT, BED_LIMIT, TESTS_LIMIT = 90.0, 90.0, 280.0  # [s]
MOST_WORKERS, BYTES_PER_WORKER = 12, 3e9


def find_gpu() -> Json:
    """Name, driver and free memory [bytes] of the GPU. Raises RuntimeError where none can be used."""
    query = ["nvidia-smi", "--query-gpu=name,driver_version,memory.free", "--format=csv,noheader,nounits"]
    try:
        said = subprocess.run(query, capture_output=True, text=True, check=True, timeout=30).stdout
        name, driver, free = (word.strip() for word in said.splitlines()[0].split(","))
    except (OSError, subprocess.SubprocessError, ValueError, IndexError) as problem:
        raise RuntimeError(f"arch = 'cuda': no NVIDIA GPU was found here (nvidia-smi: {problem})") from None
    return {"name": name, "driver": driver, "free_bytes": 2**20 * int(free)}


def run_tests(gpu: Json) -> Json:
    """The tests of beds on the GPU: how many passed, failed (with names) and were skipped, and the end of their log.

    They are counted as the log tells, also if their time ends first; "ended" is whether all of them ran.
    """
    workers = max(1, min(MOST_WORKERS, cores_there(), int(gpu["free_bytes"] / BYTES_PER_WORKER)))
    began = time.perf_counter()
    command = [sys.executable, "-m", "pytest", "-v", "-n", str(workers), "--dist", "worksteal", "-m", "not slow",
               "tests/dem", "tests/physics"]  # fmt: skip
    log = _run(command, TESTS_LIMIT, HEDGEBED_TEST_ARCH="cuda")
    return _counts(log) | {"wall_s": time.perf_counter() - began, "log": log.splitlines()[-40:]}


def _counts(log: str) -> Json:
    """What pytest's lines say, one for each test as it ends. A log without any is one failure: no test began."""
    said = re.findall(r"^\[gw\d+\] \[ *\d+%\] (PASSED|FAILED|SKIPPED|ERROR) (.+?) *$", log, re.MULTILINE)
    names = sorted({name for word, name in said if word in ("FAILED", "ERROR")})
    passed, skipped = (sum(word == wanted for word, _ in said) for wanted in ("PASSED", "SKIPPED"))
    ended = re.search(r"^=* ?.*\b(passed|failed|skipped|errors?)\b.* in [\d.]+s", log, re.MULTILINE) is not None
    return {
        "passed": passed,
        "failed": len(names) or int(not said),
        "skipped": skipped,
        "failures": names,
        "ended": ended,
    }


def _run(command: list[str], limit: float, **environment: str) -> str:
    """What a command said on both streams; it is ended after so many seconds, and that is said."""
    try:
        done = subprocess.run(
            command, cwd=ROOT, env=os.environ | environment, text=True, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, timeout=limit,
        )  # fmt: skip
    except subprocess.TimeoutExpired as late:
        said = late.stdout.decode(errors="replace") if isinstance(late.stdout, bytes) else late.stdout or ""
        return f"{said}\nended after {limit:.0f} s"
    return done.stdout if done.returncode == 0 else f"{done.stdout}\nexit code {done.returncode}"


def _sweep(gpu: Json, remarks: list[str]) -> list[Json]:
    """A row for each bed of ``BEDS``; why one is missing goes into ``remarks``."""
    rows: list[Json] = []
    worker = [sys.executable, "-m", "benchmarks.sweep.worker"]
    with tempfile.TemporaryDirectory() as folder:
        unit = str(Path(folder) / "unit.npz")
        said = _run([*worker, "prepare", str(UNIT), unit, "cuda"], PREPARE_LIMIT)
        if not Path(unit).exists():
            raise RuntimeError(f"the bed of {UNIT:,} grains could not be made: {said[-600:]}")
        for nx, ny, steps, precision, rolling in BEDS:
            count = UNIT * nx * ny
            label = f"{count:,} grains, {precision}{', rolling' if rolling else ''}"
            if count * BYTES_PER_GRAIN > gpu["free_bytes"]:
                remarks.append(f"{label}: left out, {gpu['free_bytes'] / 1e9:.0f} GB are free")
                continue
            numbers = (nx, ny, steps, precision, "yes" if rolling else "no")
            said = _run([*worker, "measure", unit, "cuda", *map(str, numbers)], BED_LIMIT)
            last = said.strip().rpartition("\n")[2]
            if last.startswith("{"):
                rows.append(json.loads(last))
                print(f"{label}: {1e-6 * rows[-1]['speed']:.0f} million grain-steps/s", file=sys.stderr, flush=True)
            else:
                remarks.append(f"{label}: failed: {' '.join(said.split())[-300:]}")
    return rows


def _commit() -> str:
    """That of the checkout; "unknown" where git does not say."""
    said = _run(["git", "rev-parse", "--short", "HEAD"], 10.0).strip()
    return said if said.isalnum() else "unknown"


def run(out: Path, *, progress: Any, tests: bool = False) -> Json:
    """Test and measure, print the tables, and return what goes into bench.json. Nothing is written to `out`.

    Raises RuntimeError: no GPU, or the bed could not be made on it.
    """
    gpu = find_gpu()
    bench, remarks = begin_timing("gpu")
    bench |= {"gpu": gpu, "commit": _commit(), "command": "make gpu", "unit": "grain steps per second"}
    if tests:
        bench["tests"] = run_tests(gpu)
    bench["rows"] = _sweep(gpu, remarks)
    bench["remarks"] = remarks
    print(table.markdown(bench))
    return bench


def main(arguments: list[str]) -> int:
    """Everything, into bench.json in a folder; 1 where a test failed, 2 where there is no GPU."""
    folders = [word for word in arguments if not word.startswith("-")]
    if len(folders) > 1 or {word for word in arguments if word.startswith("-")} - {"--no-tests"}:
        print(__doc__, file=sys.stderr)
        return 2
    out = Path(folders[0] if folders else f"runs/gpu-{time.strftime('%Y%m%d-%H%M%S')}")
    try:
        bench = run(out, progress=None, tests="--no-tests" not in arguments)
    except RuntimeError as problem:
        print(problem, file=sys.stderr)
        return 2
    out.mkdir(parents=True, exist_ok=True)
    (out / "bench.json").write_text(json.dumps(bench, indent=1) + "\n", encoding="utf-8")
    print(f"bench: {out / 'bench.json'}")
    tests = bench.get("tests", {"failed": 0, "ended": True})
    return 1 if tests["failed"] or not tests["ended"] or not bench["rows"] else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
