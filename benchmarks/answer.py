"""``hedgebed bench answer``: how much sooner our bed has the force on a spike that is pushed into it than a peer.

The race's bed and material, gravity straight down, float64, the same step. Ours lets grains sleep, and makes the whole
push. LAMMPS makes the first part of it (``part``), and its time for the whole is that times the steps. Over that part
our bed runs once more with all grains awake. This separates a difference of the two codes from one of sleep. Settling,
and making the bed, count in none.

Options: --grains, --radius, --depth [m], --speed [m/s], --part (share of the depth), --settle (steps), --points (means
of the force over the depth), --threads (0: all cores).

Beside it stand the grain-steps of the tumbles at 0.22 N m and 0.0085 g whose results are kept in docs/results.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.race import table
from benchmarks.race.entrants import TIME_STEP, PeerError
from benchmarks.race.grains import DIAMETER, Grains, prepare_grains
from benchmarks.race.machine import begin_timing, wide_console
from benchmarks.race.pushing import Push, Pushed, push_lammps, push_ours
from benchmarks.race.scratch import scratch
from dem import Sleep
from experiments.runs.types import Json

__all__ = ["answer_of", "run", "tumble_of"]

TUMBLES = tuple(f"grains1-{kind}sand-0.0085-0.22" for kind in ("", "overlap3-", "timed-"))
_RESULTS = Path(__file__).resolve().parents[1] / "docs" / "results"
_EXPECTED_SPEED = 1e7  # grain-steps a second, for the plan


def run(
    out: Path, *, progress: Any, grains: int = 100_000, radius: str = "0.008", depth: str = "0.02",
    speed: str = "0.02", part: str = "0.2", settle: int = 5000, points: int = 100, threads: int = 0,
) -> Json:  # fmt: skip
    """Push, show the table on stdout, and return what goes into bench.json. Nothing is written to `out`.

    The module says what the options are. Raises ValueError for one that cannot be, RuntimeError where our bed failed.
    """
    length = {
        name: _positive(name, text)
        for name, text in {"radius": radius, "depth": depth, "speed": speed, "part": part}.items()
    }  # fmt: skip
    share = length.pop("part")
    if share > 1 or points < 1 or not round(share * points) >= 1:
        raise ValueError(f"part = {share:g} of {points} points must be one of them at least, and all at most")
    push = Push(**length, settle=settle, points=points)
    bench, remarks = begin_timing("answer")
    cores = threads or bench["machine"]["cores"]
    options = {"grains": grains, "radius": radius, "depth": depth, "speed": speed, "part": part, "settle": settle,
               "points": points}  # fmt: skip
    bench |= {
        "command": " ".join(["hedgebed bench answer", *(f"--{name} {value}" for name, value in options.items())]),
        "peers": {"LAMMPS": None}, "threads": cores, "remarks": remarks,
    }  # fmt: skip
    whole, some = push.steps * grains / _EXPECTED_SPEED, share * push.steps * grains / _EXPECTED_SPEED
    progress.plan({"bed": grains * 40_000 / _EXPECTED_SPEED, "ours": whole / 5, "ours awake": some, "LAMMPS": some})
    progress.stage("bed")
    bed = prepare_grains(grains, threads=cores, progress=progress)
    _refuse_outside(bed, push)
    few = round(share * points)
    progress.stage("ours")
    ours = push_ours(bed, push, points=points, threads=cores, sleep=Sleep())
    progress.stage("ours awake")
    awake = push_ours(bed, push, points=few, threads=cores, sleep=None)
    progress.stage("LAMMPS")
    peer = None
    try:
        with scratch() as folder:
            peer = push_lammps(bed, push, points=few, ranks=cores, folder=folder)
    except PeerError as problem:
        remarks.append(str(problem))
    bench["answer"] = answer_of(bed, push, ours, awake, peer)
    bench["tumbles"] = [found for name in TUMBLES if (found := tumble_of(_RESULTS / name))]
    progress.close()
    table.show(bench, wide_console())
    return bench


def answer_of(grains: Grains, push: Push, ours: Pushed, awake: Pushed, peer: Pushed | None) -> Json:
    """What bench.json has of it: times of the whole push [s], how the forces differ, and the forces [N].

    ``force_difference``: the mean of ours less the peer's, over the peer's mean, where both have run. Null without a
    peer.
    """
    few = len(awake)
    peer_s = None if peer is None else peer.wall * push.points / len(peer)
    depth = push.depth * (np.arange(push.points) + 0.5) / push.points
    return {
        "grain_count": grains.count, "radius": push.radius, "depth": push.depth, "speed": push.speed,
        "time_step": TIME_STEP, "steps": push.steps, "settle": push.settling, "gravity": 9.81,
        "ours_s": ours.wall, "awake_s": awake.wall * push.points / few,
        "peer_s": peer_s, "ratio": None if peer_s is None else peer_s / ours.wall,
        "peer": None if peer is None else "LAMMPS granular hertz/material",
        "command": "" if peer is None else peer.command,
        "part": few / push.points, "extrapolated": few < push.points,
        "force_difference": None if peer is None else _gap(ours.force, peer.force),
        "awake_force_difference": None if peer is None else _gap(awake.force, peer.force),
        "sleep_force_difference": _gap(ours.force, awake.force),
        "force_scatter": None if peer is None else _scatter(ours.force, peer.force),
        "grain_steps": ours.grain_steps, "all_awake": grains.count * push.steps,
        "curve": {
            "depth": depth.tolist(), "ours": ours.force.tolist(), "awake": awake.force.tolist(),
            "peer": None if peer is None else peer.force.tolist(),
        },
    }  # fmt: skip


def tumble_of(folder: Path) -> Json | None:
    """Grain-steps of a kept tumble after setting down, and of all grains awake; None where there is no such result."""
    path = folder / "result.json"
    grains = json.loads(path.read_text(encoding="utf-8")).get("grains", {}) if path.is_file() else {}
    if "grain_steps" not in grains:
        return None
    done, whole = grains["grain_steps"], grains["grain_steps_all_awake"]
    return {"case": folder.name, "grain_steps": done, "all_awake": whole, "times_fewer": whole / done}


def _gap(ours: np.ndarray, other: np.ndarray) -> float:
    """Mean of ours over the other's mean, less one, over what the other has."""
    return float(ours[: len(other)].mean() / other.mean() - 1)


def _scatter(ours: np.ndarray, other: np.ndarray) -> float:
    """Root mean square of the difference over the other's mean."""
    return float(np.sqrt(((ours[: len(other)] - other) ** 2).mean()) / other.mean())


def _positive(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise ValueError(f"{name} = {text!r} must be a number above 0")
    return value


def _refuse_outside(grains: Grains, push: Push) -> None:
    """Raise ValueError for a spike that comes near to the floor or to its own image."""
    end = push.start(grains)[2] - push.depth
    if end < 2 * DIAMETER:
        raise ValueError(f"depth = {push.depth:g} m: the spike would end {end:g} m above the floor; push it less deep")
    if 2 * push.radius > 0.5 * min(grains.period):
        raise ValueError(
            f"radius = {push.radius:g} m: the spike is wider than half the bed of {min(grains.period):g} m"
        )
