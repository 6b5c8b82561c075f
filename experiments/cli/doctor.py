"""``hedgebed doctor``: what this machine has, and what to install where something is missing."""

import json
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from rich.console import Console
from rich.table import Table

from experiments.cli import probes
from experiments.cli.probes import Answer
from experiments.runs.memory import cores_there, memory_there
from experiments.runs.version import __version__
from hedgebed_taichi import chosen, unknown_processor

__all__ = ["TRIES", "Finding", "cache_folder", "examine", "show"]

PYTHONS = ((3, 11), (3, 13))  # oldest and newest that Taichi has wheels for
GIB = 2**30
LIMIT = 90.0  # Time that a trial may take [s]
TRIES = f"Taichi and OpenGL are tried: some seconds, on a busy machine up to {3 * LIMIT / 60:.0f} minutes"


@dataclass(frozen=True)
class Finding:
    """One thing examined: whether it is there, whether nothing runs without it, and what to do if it is not."""

    name: str
    ok: bool
    detail: str
    remedy: str = ""
    required: bool = False


def cache_folder() -> Path:
    """Where prepared beds are kept: HEDGEBED_CACHE, or ~/.cache/hedgebed."""
    given = os.environ.get("HEDGEBED_CACHE")
    return Path(given).expanduser() if given else Path.home() / ".cache" / "hedgebed"


def probe(*arguments: str, timeout: float = LIMIT) -> Answer:
    """What `experiments.cli.probes` says to `arguments`, asked in a process of its own.

    A crash, a hang past `timeout` [s] or an exception comes back as ``{"ok": False, "reason": ...}``.
    """
    command = [sys.executable, "-P", str(Path(probes.__file__)), *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        return {"ok": False, "reason": f"no answer within {timeout:.0f} s"}
    if done.returncode < 0:
        return {"ok": False, "reason": f"crashed with signal {-done.returncode}"}
    lines = [line for line in (done.stderr if done.returncode else done.stdout).splitlines() if line.strip()]
    if done.returncode:
        return {"ok": False, "reason": lines[-1] if lines else f"ended with status {done.returncode}"}
    try:
        found: Answer = json.loads(lines[-1])
        return found
    except (IndexError, json.JSONDecodeError):
        return {"ok": False, "reason": "gave no answer"}


def _python() -> Finding:
    between = " to ".join(".".join(map(str, version)) for version in PYTHONS)
    fits = PYTHONS[0] <= sys.version_info[:2] <= PYTHONS[1]
    detail = f"{platform.python_version()} (Taichi has wheels for {between})"
    return Finding("Python", fits, detail, f"use Python {between}", required=True)


def _taichi(arch: str, answer: Answer) -> Finding:
    remedies = {
        "cpu": "pip install taichi",
        "cuda": "not needed: the bed runs on the CPU. It needs an NVIDIA card and its driver",
        "vulkan": "not needed: no command needs it",
    }
    version = answer.get("version", "Taichi")
    detail = f"{version} runs a kernel" if answer["ok"] else f"does not run here ({answer['reason']})"
    return Finding(f"backend {arch}", answer["ok"], detail, remedies[arch], required=arch == "cpu")


def _processor() -> Finding:
    known, taken = not unknown_processor(), chosen()
    detail = f"{'known' if known else 'not known'} to Taichi's compiler; computed by {taken}"
    return Finding(
        "processor",
        known or taken == "quadrants",
        detail,
        "not needed: beds run without it. pip install quadrants makes them faster here",
    )


def _memory() -> Finding:
    memory = memory_there()
    limited = f", limited to {memory.limit / GIB:.1f} GiB" if memory.limit is not None else ""
    detail = f"{memory.free / GIB:.1f} GiB available of {memory.total / GIB:.1f} GiB{limited}"
    remedy = "close something, or take a smaller bed_size or a larger grain"
    return Finding("memory", memory.free >= GIB, detail, remedy)


def _cache() -> Finding:
    folder = cache_folder()
    beds = [path for path in folder.rglob("*") if path.is_file()] if folder.is_dir() else []
    size = sum(path.stat().st_size for path in beds)
    there = next(path for path in [folder, *folder.parents] if path.exists())
    writable = there.is_dir() and os.access(there, os.W_OK)
    free = shutil.disk_usage(there).free
    detail = f"{folder}: {len(beds)} files, {size / 2**20:.1f} MiB; {free / GIB:.1f} GiB free"
    if not writable:
        detail += "; cannot be written"
    return Finding("cache of beds", writable and free >= GIB // 4, detail, "set HEDGEBED_CACHE to an emptier disk")


def _opengl(answer: Answer) -> Finding:
    drawn = f"a picture off screen ({answer.get('renderer') or 'renderer unknown'})"
    detail = drawn if answer["ok"] else answer["reason"]
    remedy = "not needed for results, only for pictures: apt install libegl1 libgl1-mesa-dri, or try again later"
    return Finding("OpenGL", answer["ok"], detail, remedy)


def _peer(name: str, commands: Sequence[str], package: str) -> Finding:
    found = next((path for path in map(shutil.which, commands) if path), None)
    return Finding(
        name, found is not None, found or "not found", f"not needed, except for `hedgebed bench`: apt install {package}"
    )


def _lammps() -> Finding:
    """LAMMPS and mpiexec, for ``--ground lammps`` and for the race of beds."""
    from coupling.lammps.process import LammpsMissingError, find_lammps  # loads Taichi

    try:
        launcher, program = find_lammps()
    except LammpsMissingError as error:
        return Finding("LAMMPS", False, str(error), "not needed, except for --ground lammps and `hedgebed bench`")
    return Finding("LAMMPS", True, f"{program}, started by {launcher}")


def _extra(name: str, package: str, use: str) -> Finding:
    """A package of the extra `name`, which only `use` needs."""
    try:
        return Finding(package, True, version(package))
    except PackageNotFoundError:
        return Finding(package, False, "not found", f"not needed, except for {use}: pip install '.[{name}]'")


def examine() -> list[Finding]:
    """Look at everything. Takes a few seconds: Taichi and OpenGL are tried in processes of their own."""
    with ThreadPoolExecutor(max_workers=2) as pool:
        opengl = pool.submit(probe, "opengl")
        backends = {arch: pool.submit(probe, "taichi", arch) for arch in ("cpu", "cuda", "vulkan")}
        taichi = [_taichi(arch, answer.result()) for arch, answer in backends.items()]
        return [
            Finding("hedgebed", True, __version__),
            _python(),
            *taichi,
            _processor(),
            Finding("threads", True, f"{cores_there()} usable of {os.cpu_count()}"),
            _memory(),
            _cache(),
            _opengl(opengl.result()),
            _peer("LIGGGHTS", ["liggghts"], "liggghts"),
            _lammps(),
            _extra("mujoco", "mujoco", "`hedgebed mujoco`"),
            _extra("sweep", "distributed", "sweeps on a cluster"),
            _peer("YADE", ["yade"], "yade"),
            _peer("MPI", ["mpirun"], "openmpi-bin"),
            _peer("C compiler", ["cc"], "gcc"),
        ]


def show(findings: Sequence[Finding], *, as_json: bool = False) -> None:
    """Print the findings on stdout: a table, or JSON."""
    if as_json:
        ok, entries = all(finding.ok for finding in findings if finding.required), [asdict(f) for f in findings]
        print(json.dumps({"format": "hedgebed-doctor/1", "ok": ok, "findings": entries}, indent=2))
        return
    table = Table(box=None, pad_edge=False, show_header=False)
    for finding in findings:
        word = "ok" if finding.ok else "MISSING" if finding.required else "no"
        table.add_row(word, finding.name, finding.detail if finding.ok else f"{finding.detail}: {finding.remedy}")
    Console(highlight=False, markup=False).print(table)
