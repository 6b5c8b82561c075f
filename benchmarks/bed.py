"""``hedgebed bench bed``: the bed of grains against LIGGGHTS and LAMMPS, on the same grains, doing the same work.

The entrants run in turn, several rounds, in one go, because a machine drifts; medians are quoted. The first round has
every skin of the peers' neighbour lists; a peer goes on with its fastest, and with any that is nearly as fast. What is
only shown (other laws, rolling, one thread, float32) runs once. A peer whose bed ends up in another state than ours did
other work: it is said, and not counted.

For quick trials, in the environment: HEDGEBED_BENCH_SIZES (as in "20000 100000"), HEDGEBED_BENCH_ROUNDS,
HEDGEBED_BENCH_STEPS (timed ones), HEDGEBED_BENCH_SHOWN=0 (nothing that is only shown).
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks.race import table
from benchmarks.race.entrants import GRAVITY, TIME_STEP, WARM_STEPS, Entrant, Heat, Ours, Theirs
from benchmarks.race.grains import BENCH, DIAMETER, SPREAD, Grains, coordination, prepare_grains, write_data
from benchmarks.race.machine import count_cores, describe_machine
from benchmarks.race.peers import LAMMPS, LIGGGHTS, Peer, find_mpirun
from experiments.runs.version import __version__

__all__ = ["Lane", "Settings", "pick_best", "run"]

FORMAT = "hedgebed-bench/1"
SKINS = (1e-4, 2e-4, 4e-4)  # of the peers' lists [m]
_USUAL_SKIN = 2e-4  # for what is only shown [m]
COORDINATION_BOUND, PACKING_BOUND = 0.01, 0.002  # the same work: this much off ours, at most [1]
_CLOSE = 0.85  # a skin this near to the fastest stays in the race
_BUSY = 0.5  # load per core at the start from which the machine is called busy
# For the plan: grain-steps a second, and what settling takes.
_EXPECTED_SPEED, _SETTLING_STEPS = 1e7, 40_000


@dataclass(frozen=True)
class Settings:
    """What is raced: numbers of grains, rounds, timed steps (None: by the number of grains), what is only shown."""

    sizes: tuple[int, ...] = (20_000, 100_000)
    rounds: int = 5
    steps: int | None = None
    shown: bool = True

    @classmethod
    def from_environment(cls) -> Settings:
        """The defaults, or what HEDGEBED_BENCH_SIZES, _ROUNDS, _STEPS and _SHOWN say.

        Raises:
            ValueError: one of them is not a positive whole number (several for the sizes; 0 or 1 for the last).
        """
        sizes, rounds, steps = _numbers("SIZES"), _numbers("ROUNDS", most=1), _numbers("STEPS", most=1)
        shown = os.environ.get("HEDGEBED_BENCH_SHOWN", "1")
        if shown not in ("0", "1"):
            raise ValueError(f"HEDGEBED_BENCH_SHOWN = {shown!r} must be 0 or 1")
        return cls(
            sizes=sizes or cls.sizes,
            rounds=rounds[0] if rounds else cls.rounds,
            steps=steps[0] if steps else None,
            shown=shown == "1",
        )

    def steps_for(self, count: int) -> int:
        """Timed steps of a bed of ``count`` grains."""
        return self.steps or (2000 if count <= 50_000 else 1000)


def _numbers(name: str, *, most: int | None = None) -> tuple[int, ...]:
    key = f"HEDGEBED_BENCH_{name}"
    words = os.environ.get(key, "").replace(",", " ").split()
    if not all(word.isdigit() and int(word) > 0 for word in words) or len(words) > (most or len(words)):
        wanted = "one positive whole number" if most == 1 else "positive whole numbers"
        raise ValueError(f"{key} = {os.environ[key]!r} must be {wanted}")
    return tuple(int(word) for word in words)


@dataclass
class Lane:
    """One entrant and what it has done. ``other_work`` and ``failure`` say in words why it does not count."""

    entrant: Entrant
    heats: list[Heat] = field(default_factory=list)
    other_work: str = ""
    failure: str = ""

    @property
    def speed(self) -> float | None:
        """Median of the heats [grain steps/s]; None if there is none."""
        return statistics.median(heat.speed for heat in self.heats) if self.heats and not self.failure else None

    @property
    def label(self) -> str:
        """Its name, with what distinguishes it from others of that name."""
        entrant = self.entrant
        skin = "" if entrant.skin is None else f", skin {1e3 * entrant.skin:g} mm"
        threads = f"{entrant.threads} thread{'s' if entrant.threads > 1 else ''}"
        return f"{entrant.name}, {entrant.precision}, {threads}{skin}"

    def go(self, steps: int) -> None:
        """One heat. What goes wrong is kept, and the lane is out of the race."""
        try:
            self.heats.append(self.entrant.heat(steps))
        except RuntimeError as problem:
            self.failure = str(problem)

    def as_dict(self) -> dict[str, Any]:
        """What bench.json keeps of it."""
        entrant, last = self.entrant, self.heats[-1] if self.heats else None
        return {
            "label": self.label,
            "name": entrant.name,
            "ours": entrant.ours,
            "counted": entrant.counted,
            "rolling": entrant.rolling,
            "precision": entrant.precision,
            "threads": entrant.threads,
            "skin": entrant.skin,
            "speed": self.speed,
            "heats": [
                {key: value for key, value in asdict(heat).items() if key not in ("version", "command")}
                for heat in self.heats
            ],
            "other_work": self.other_work,
            "failure": self.failure,
            "command": last.command if last else "",
        }


def run(out: Path, *, progress: Any) -> dict[str, Any]:
    """Race, show the table on stdout, and return what goes into bench.json.

    Args:
        out: folder of bench.json; nothing else is written there.
        progress: an ``experiments.runs.progress.Progress``.

    Raises:
        ValueError: a variable of the environment is wrong.
        RuntimeError: our own bed failed.
    """
    settings = Settings.from_environment()
    cores, load = count_cores(), os.getloadavg()[0]
    peers, remarks = _find_peers()
    if load > _BUSY * cores:
        remarks.append(f"the machine was busy at the start (load {load:.1f} on {cores} cores): timings mean little")
    for remark in remarks:
        progress.message(remark)
    progress.plan(dict(_plan(settings, with_peers=bool(peers))))
    bench: dict[str, Any] = {
        "format": FORMAT,
        "what": "bed",
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "version": __version__,
        "command": _command(),
        "machine": describe_machine(cores, load),
        "peers": {peer.name: None for peer in (LIGGGHTS, LAMMPS)},
        "unit": "grain steps per second",
        "rounds": settings.rounds,
        "case": {
            "diameter": DIAMETER,
            "spread": SPREAD,
            "material": {key: value for key, value in asdict(BENCH).items() if key != "sources"},
            "gravity": GRAVITY,
            "time_step": TIME_STEP,
            "warm_steps": WARM_STEPS,
        },
        "ratios": {},
        "beds": [],
        "remarks": remarks,
    }
    for count in settings.sizes:
        bed, lanes = _race(count, settings, peers, cores, progress)
        best = pick_best(lanes)
        bed["best_peer"] = best.label if best else None
        bed["entrants"] = [lane.as_dict() for lane in lanes]
        bench["beds"].append(bed)
        bench["ratios"][str(count)] = _ratio(lanes[0], best)
        bench["peers"] |= {
            lane.entrant.peer.name: lane.heats[-1].version
            for lane in lanes
            if isinstance(lane.entrant, Theirs) and lane.heats
        }
        remarks += [f"{count:,} grains: {remark}" for lane in lanes for remark in _remarks(lane)]
    progress.close()
    table.show(bench, Console(width=None if sys.stdout.isatty() else 150, highlight=False))
    return bench


def _find_peers() -> tuple[list[Peer], list[str]]:
    """The peers that can race, and what is to be said of the others."""
    peers = [peer for peer in (LIGGGHTS, LAMMPS) if peer.find()]
    remarks = [
        f"{peer.name} is not installed and is left out (apt install {peer.package})"
        for peer in (LIGGGHTS, LAMMPS)
        if peer not in peers
    ]
    if peers and not find_mpirun():
        names = " and ".join(peer.name for peer in peers)
        remarks.append(f"mpirun is not installed, so {names} cannot use all cores: left out (apt install openmpi-bin)")
        peers = []
    return peers, remarks


def _plan(settings: Settings, *, with_peers: bool) -> Iterator[tuple[str, float]]:
    """Stages and what they are expected to take [s]."""
    for count in settings.sizes:
        heat = count * (WARM_STEPS + settings.steps_for(count)) / _EXPECTED_SPEED
        yield _preparing(count), count * _SETTLING_STEPS / _EXPECTED_SPEED
        for k in range(1, settings.rounds + 1):
            first = 6 + 4 * settings.shown
            yield _round(count, k), heat * (1 + with_peers * (first if k == 1 else 3))
        if settings.shown:
            yield _alone(count), 3 * heat


def _preparing(count: int) -> str:
    return f"{count:,} grains: bed"


def _round(count: int, k: int) -> str:
    return f"{count:,} grains: round {k}"


def _alone(count: int) -> str:
    return f"{count:,} grains: float32, one thread"


def _race(
    count: int, settings: Settings, peers: list[Peer], cores: int, progress: Any
) -> tuple[dict[str, Any], list[Lane]]:
    """Race on one bed: what is to be said of the bed, and the lanes, ours first."""
    steps = settings.steps_for(count)
    progress.stage(_preparing(count))
    began = time.perf_counter()
    grains = prepare_grains(count, threads=cores, progress=progress)
    preparation_time = time.perf_counter() - began
    progress.message(f"{count:,} grains: the bed took {preparation_time:.0f} s (next to nothing where it was cached)")
    bed = {
        "grain_count": count,
        "steps": steps,
        "period": grains.period,
        "preparation_time": preparation_time,
        "coordination_before": coordination(grains),
    }
    ours = Lane(Ours(grains, threads=cores))
    with tempfile.TemporaryDirectory(prefix="hedgebed-bench-") as name:
        folder = Path(name)
        write_data(folder / "bed.data", grains)
        racing = [Lane(entrant) for peer in peers for entrant in _counted(peer, grains, folder, cores)]
        rolling, shown = [], []
        if settings.shown:
            rolling = [Lane(Ours(grains, threads=cores, rolling=True))]
            shown = [Lane(entrant) for peer in peers for entrant in _shown(peer, grains, folder, cores)]
        staying = [ours, *racing, *rolling, *shown]
        for k in range(1, settings.rounds + 1):
            _heats(_round(count, k), staying, steps, progress)
            if ours.failure:
                raise RuntimeError(f"our own bed did not get through the race: {ours.failure}")
            staying = [ours, *_leaders(racing)]
    alone = []
    if settings.shown:
        # These start Taichi anew, which ends the beds of before.
        alone = [Lane(Ours(grains, threads=cores, precision="float32")), Lane(Ours(grains, threads=1))]
        _heats(_alone(count), alone, steps, progress)
    _check_work(ours, [*alone, *racing, *(lane for lane in shown if not lane.entrant.rolling)])
    for lane in rolling:
        _check_work(lane, [lane for lane in shown if lane.entrant.rolling])
    return bed, [ours, *alone, *rolling, *racing, *shown]


def _heats(stage: str, lanes: list[Lane], steps: int, progress: Any) -> None:
    """One heat of each lane."""
    progress.stage(stage, len(lanes))
    for done, lane in enumerate(lanes, start=1):
        lane.go(steps)
        progress.update(done)
        progress.message(f"{lane.label}: {_outcome(lane)}")


def _counted(peer: Peer, grains: Grains, folder: Path, ranks: int) -> Iterator[Theirs]:
    """A peer's entrants that can be the best."""
    law, variables = {
        LIGGGHTS: ("hertz/history", {"roll": ""}),
        LAMMPS: ("granular hertz/material", {"law": "material"}),
    }[peer]
    for skin in SKINS:
        yield Theirs(
            peer,
            f"{peer.name} {law}",
            grains,
            folder=folder,
            data="bed.data",
            ranks=ranks,
            skin=skin,
            counted=True,
            variables=variables,
        )


def _shown(peer: Peer, grains: Grains, folder: Path, ranks: int) -> Iterator[Theirs]:
    """A peer's entrants that are shown beside."""
    for law, rolling, variables in {
        LIGGGHTS: [("hertz/history with rolling (epsd2)", True, {"roll": "rolling_friction epsd2"})],
        LAMMPS: [
            ("gran/hertz/history", False, {"law": "history"}),
            ("granular hertz/material with rolling (sds)", True, {"law": "rolling"}),
        ],
    }[peer]:
        yield Theirs(
            peer,
            f"{peer.name} {law}",
            grains,
            folder=folder,
            data="bed.data",
            ranks=ranks,
            skin=_USUAL_SKIN,
            counted=False,
            rolling=rolling,
            variables=variables,
        )


def _leaders(racing: list[Lane]) -> list[Lane]:
    """Of each peer the fastest skin, and those close to it."""
    leaders = []
    for name in dict.fromkeys(lane.entrant.name for lane in racing):
        fit = [(lane.speed, lane) for lane in racing if lane.entrant.name == name and lane.speed is not None]
        fastest = max((speed for speed, _ in fit), default=0.0)
        leaders += [lane for speed, lane in fit if speed >= _CLOSE * fastest]
    return leaders


def _check_work(ours: Lane, lanes: list[Lane]) -> None:
    """Say of each lane whether its bed ended up in another state than ours."""
    for lane in lanes:
        if ours.failure or lane.failure:
            continue
        last, reference = lane.heats[-1], ours.heats[-1]
        found = []
        for what, bound in (("coordination", COORDINATION_BOUND), ("packing", PACKING_BOUND)):
            gap = getattr(last, what) / getattr(reference, what) - 1
            # Written so that a NaN counts as other work.
            if not abs(gap) <= bound:
                found.append(f"{what} {100 * gap:+.2g} %")
        if last.missed:
            found.append(f"{last.missed} lists came too late")
        lane.other_work = ", ".join(found)


def pick_best(lanes: list[Lane]) -> Lane | None:
    """The fastest of the peers that count and did the same work; None if there is none."""
    fit = [
        (lane.speed, k)
        for k, lane in enumerate(lanes)
        if lane.entrant.counted and lane.speed is not None and not lane.other_work
    ]
    return lanes[max(fit)[1]] if fit else None


def _ratio(ours: Lane, best: Lane | None) -> float | None:
    """Our speed over the best peer's."""
    if best is None or best.speed is None or ours.speed is None:
        return None
    return ours.speed / best.speed


def _outcome(lane: Lane) -> str:
    return f"failed: {lane.failure}" if lane.failure else f"{1e-6 * lane.heats[-1].speed:.2f} million grain-steps/s"


def _remarks(lane: Lane) -> Iterator[str]:
    if lane.failure:
        yield f"{lane.label}: {lane.failure}"
    elif lane.other_work and not lane.entrant.rolling:
        yield f"{lane.label} did other work than ours ({lane.other_work}) and is not counted"


def _command() -> str:
    """How this was called, with what the environment said."""
    said = [f"{key}={value!r}" for key, value in sorted(os.environ.items()) if key.startswith("HEDGEBED_BENCH_")]
    return " ".join([*said, "hedgebed bench bed"])
