"""``hedgebed bench bed``: the bed of grains against LIGGGHTS, LAMMPS and YADE, on the same grains, with the same work.

The entrants run in turn, several rounds, in one go, because a machine drifts; medians are quoted. The first round has
every skin of the peers' neighbour lists. A peer continues with its fastest, and with any that is nearly as fast. A peer
that is slower than half the fastest ends there. There are two races in one: without rolling resistance and with it.
What is only shown (other laws, one thread, float32) runs once. A peer whose bed ends up in another state than ours did
other work: it is said, and not counted.

For quick trials, in the environment: HEDGEBED_BENCH_SIZES (as in "20000 100000"), HEDGEBED_BENCH_ROUNDS,
HEDGEBED_BENCH_STEPS (timed ones), HEDGEBED_BENCH_SHOWN=0 (nothing that is only shown, and no rolling).

``--limit``: a loop in plain C races as well, where there is a compiler, and shows how far the machine goes.
``--profile``: no race; where the time of a step goes (``benchmarks/race/profile.py``).
``--scale``: no race; speed and memory of 20,000 to 1,000,000 grains (``benchmarks/race/scale.py``), or of those in
HEDGEBED_BENCH_SIZES, each a multiple of the first.
"""

import os
import shutil
import statistics
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, Self

from benchmarks.race import entrants, table
from benchmarks.race.entrants import LAMMPS, LIGGGHTS, WARM_STEPS, YADE, Entrant, Heat, Ours, Peer, Theirs, Yade
from benchmarks.race.grains import BENCH, DIAMETER, SPREAD, Grains, coordination, prepare_grains, write_data
from benchmarks.race.machine import begin_timing, environment_numbers, wide_console
from benchmarks.race.profile import profile_bed
from benchmarks.race.scale import keep_bed, scale_of
from benchmarks.race.scratch import scratch
from benchmarks.race.yardstick import compile_yardstick, yardsticks
from experiments.runs.types import Json

__all__ = ["Lane", "Settings", "pick_best", "run"]

SKINS = (1e-4, 2e-4, 4e-4)  # of the peers' lists [m]
_USUAL_SKIN = 2e-4  # for what is only shown [m]
COORDINATION_BOUND, PACKING_BOUND = 0.01, 0.002  # the same work: this much off ours, at most [1]
SCALE_SIZES = (20_000, 100_000, 300_000, 1_000_000)
REPEATS = 30  # of each kernel of a profile
_CLOSE = 0.85  # a skin this near to the fastest stays in the race
_HOPELESS = 0.5  # a peer slower than this share of the fastest leaves it
# For the plan: grain-steps a second, and what settling takes.
_EXPECTED_SPEED, _SETTLING_STEPS = 1e7, 40_000


@dataclass(frozen=True)
class Settings:
    """What is raced: numbers of grains, rounds, timed steps (None: by their number), what is only shown, the C loop."""

    sizes: tuple[int, ...] = (20_000, 100_000)
    rounds: int = 5
    steps: int | None = None
    shown: bool = True
    limit: bool = False

    @classmethod
    def from_environment(cls, *, limit: bool = False) -> Self:
        """The defaults, or what HEDGEBED_BENCH_SIZES, _ROUNDS, _STEPS and _SHOWN say.

        Raises ValueError for one that is no positive whole number (several for the sizes; 0 or 1 for the last).
        """
        sizes = environment_numbers("SIZES", cls.sizes, most=100)
        (rounds,) = environment_numbers("ROUNDS", (cls.rounds,))
        steps = environment_numbers("STEPS", ())
        shown = os.environ.get("HEDGEBED_BENCH_SHOWN", "1")
        if shown not in ("0", "1"):
            raise ValueError(f"HEDGEBED_BENCH_SHOWN = {shown!r} must be 0 or 1")
        return cls(sizes, rounds, steps[0] if steps else None, shown == "1", limit)

    def steps_for(self, count: int) -> int:
        """Timed steps of a bed of ``count`` grains."""
        return self.steps or (2000 if count <= 50_000 else 1000)


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

    def as_dict(self) -> Json:
        """What bench.json keeps of it."""
        about = ("name", "ours", "counted", "limit", "rolling", "precision", "threads", "skin")
        heats = [{k: v for k, v in asdict(heat).items() if k not in ("version", "command")} for heat in self.heats]
        command = self.heats[-1].command if heats else ""
        return {"label": self.label} | {key: getattr(self.entrant, key) for key in about} | {
            "speed": self.speed, "heats": heats, "other_work": self.other_work, "failure": self.failure,
            "command": command,
        }  # fmt: skip


def run(
    out: Path, *, progress: Any, limit: bool = False, profile: bool = False, scale: bool = False
) -> Json:  # fmt: skip
    """Race, show the table on stdout, and return what goes into bench.json. Nothing is written to `out`.

    `progress`: an ``experiments.runs.progress.Progress``. `limit`: the C loop races too. Instead of the race:
    `profile`, where the time of a step goes; `scale`, speed and memory of large beds. Raises ValueError for a wrong
    variable of the environment, or both of them; RuntimeError where our own bed failed.
    """
    if profile and scale:
        raise ValueError("profile and scale are two benchmarks: give one of them")
    settings = Settings.from_environment(limit=limit)
    bench, remarks = begin_timing("bed")
    said = [f"{key}={value!r}" for key, value in sorted(os.environ.items()) if key.startswith("HEDGEBED_BENCH_")]
    options = [f"--{name}" for name, given in (("limit", limit), ("profile", profile), ("scale", scale)) if given]
    bench |= {
        "command": " ".join([*said, "hedgebed bench bed", *options]),
        "case": {
            "diameter": DIAMETER, "spread": SPREAD,
            "material": {key: value for key, value in asdict(BENCH).items() if key != "sources"},
            "gravity": entrants.GRAVITY, "time_step": entrants.TIME_STEP, "warm_steps": WARM_STEPS,
        },
        "remarks": remarks,
    }  # fmt: skip
    cores = bench["machine"]["cores"]
    if profile:
        _profile(bench, settings, cores, progress)
    elif scale:
        _scale(bench, settings, cores, progress)
    else:
        _race_all(bench, settings, cores, progress)
    progress.close()
    table.show(bench, wide_console())
    return bench


def _race_all(bench: Json, settings: Settings, cores: int, progress: Any) -> None:
    """Race on beds of all sizes; what came out goes into `bench`."""
    peers, missing = _find_peers()
    remarks = bench["remarks"]
    remarks += missing
    for remark in remarks:
        progress.message(remark)
    progress.plan(dict(_plan(settings, with_peers=bool(peers))))
    bench |= {
        "peers": {peer.name: None for peer in PEERS}, "unit": "grain steps per second", "rounds": settings.rounds,
        "ratios": {}, "rolling_ratios": {}, "limits": {}, "beds": [],
    }  # fmt: skip
    for count in settings.sizes:
        bed, lanes = _race(count, settings, peers, cores, progress, remarks)
        best = {rolling: pick_best(lanes, rolling=rolling) for rolling in (False, True)}
        labels = [lane.label if lane else None for lane in best.values()]
        ran = {"best_peer": labels[0], "best_rolling_peer": labels[1], "entrants": [lane.as_dict() for lane in lanes]}
        bench["beds"].append(bed | ran)
        bench["ratios"][str(count)] = _ratio(lanes[0], best[False])
        rolling = [lane for lane in lanes if lane.entrant.ours and lane.entrant.rolling]
        if rolling:
            bench["rolling_ratios"][str(count)] = _ratio(rolling[0], best[True])
        if settings.limit:
            bench["limits"][str(count)] = _ratio(lanes[0], pick_best(lanes, of="limit"))
        for lane in lanes:
            if lane.heats and isinstance(lane.entrant, Theirs):
                bench["peers"][lane.entrant.peer.name] = lane.heats[-1].version
        remarks += [f"{count:,} grains: {remark}" for lane in lanes for remark in _remarks(lane)]


def _profile(bench: Json, settings: Settings, cores: int, progress: Any) -> None:
    """Where the time of a step goes, in beds of all sizes; what came out goes into `bench`."""
    bench |= {"unit": "ns of thread time per grain and step", "repeats": REPEATS, "profile": []}
    progress.plan({f"{count:,} grains": count * _SETTLING_STEPS / _EXPECTED_SPEED for count in settings.sizes})
    for count in settings.sizes:
        progress.stage(f"{count:,} grains")
        grains = prepare_grains(count, threads=cores, progress=progress)
        with scratch() as folder:
            bed, said = profile_bed(
                grains, steps=settings.steps_for(count), repeats=REPEATS, threads=cores, folder=folder
            )  # fmt: skip
        bench["profile"].append(bed)
        bench["remarks"] += [remark for remark in said if remark not in bench["remarks"]]


def _scale(bench: Json, settings: Settings, cores: int, progress: Any) -> None:
    """Speed and memory of the smallest bed laid end to end; what came out goes into `bench`."""
    sizes = environment_numbers("SIZES", SCALE_SIZES, most=100)
    first = sizes[0]
    if any(count % first for count in sizes):
        raise ValueError(
            f"HEDGEBED_BENCH_SIZES = {sizes}: each must be a multiple of the first, which is laid end to end"
        )
    bench |= {"unit": "grain steps per second; bytes", "scale": []}
    work = {count: 2 * _scale_steps(count, settings) * count / _EXPECTED_SPEED for count in sizes}
    progress.plan(
        {"bed": first * _SETTLING_STEPS / _EXPECTED_SPEED} | {f"{n:,} grains": 20 + t for n, t in work.items()}
    )
    progress.stage("bed")
    with scratch() as folder:
        path = folder / "bed.npz"
        keep_bed(path, prepare_grains(first, threads=cores, progress=progress), cores)
        for count in sizes:
            progress.stage(f"{count:,} grains")
            steps = _scale_steps(count, settings)
            found = scale_of(path, count // first, count=first, threads=cores, steps=steps)
            least = bench["scale"][0] if bench["scale"] else None
            for kind in ("held", "most"):
                grown = None if least is None else (found[kind] - least[kind]) / (count - first)
                found[f"{kind}_per_grain"] = grown
            bench["scale"].append(found)


def _scale_steps(count: int, settings: Settings) -> int:
    """Timed steps of a bed of that size, for some ten seconds, but no fewer than a list lasts."""
    return settings.steps or max(200, min(2000, int(10 * _EXPECTED_SPEED / count)))


def _ratio(ours: Lane, other: Lane | None) -> float | None:
    """Our speed over another's; None where one has none."""
    return ours.speed / other.speed if other and ours.speed and other.speed else None


def _find_peers() -> tuple[list[Peer], list[str]]:
    """The peers that can race, and what is to be said of the others."""
    peers = [peer for peer in PEERS if peer.find()]
    remarks = [
        f"{peer.name} is not installed and is left out (apt install {peer.package})"
        for peer in PEERS if peer not in peers
    ]  # fmt: skip
    by_mpi = [peer for peer in peers if peer is not YADE]
    if by_mpi and not shutil.which("mpirun"):
        names = " and ".join(peer.name for peer in by_mpi)
        remarks.append(f"mpirun is not installed, so {names} cannot use all cores: left out (apt install openmpi-bin)")
        peers = [peer for peer in peers if peer is YADE]
    return peers, remarks


def _plan(settings: Settings, *, with_peers: bool) -> Iterator[tuple[str, float]]:
    """Stages and what they are expected to take [s]."""
    for count in settings.sizes:
        heat = count * (WARM_STEPS + settings.steps_for(count)) / _EXPECTED_SPEED
        yield f"{count:,} grains: bed", count * _SETTLING_STEPS / _EXPECTED_SPEED
        for k in range(1, settings.rounds + 1):
            lanes = 6 + 8 * settings.shown if k == 1 else 3 + 3 * settings.shown
            yield f"{count:,} grains: round {k}", heat * (1 + with_peers * lanes)
        if settings.shown:
            yield f"{count:,} grains: float32, one thread", 3 * heat


def _race(
    count: int, settings: Settings, peers: list[Peer], cores: int, progress: Any, remarks: list[str]
) -> tuple[Json, list[Lane]]:
    """Race on one bed: what is to be said of the bed, and the lanes, ours first. ``remarks``: more are added."""
    steps, of = settings.steps_for(count), f"{count:,} grains: "
    progress.stage(f"{of}bed")
    began = time.perf_counter()
    grains = prepare_grains(count, threads=cores, progress=progress)
    preparation_time = time.perf_counter() - began
    progress.message(f"{of}the bed took {preparation_time:.0f} s (next to nothing where it was cached)")
    bed = {
        "grain_count": count, "steps": steps, "period": grains.period, "preparation_time": preparation_time,
        "coordination_before": coordination(grains),
    }  # fmt: skip
    ours = Lane(Ours(grains, threads=cores))
    rolling = [Lane(Ours(grains, threads=cores, rolling=True))] if settings.shown else []
    with scratch() as folder:
        write_data(folder / "bed.data", grains)
        theirs = [Lane(entrant) for peer in peers for entrant in _theirs(peer, grains, folder, cores)]
        racing = [lane for lane in theirs if lane.entrant.counted and not lane.entrant.rolling]
        against = [lane for lane in theirs if lane.entrant.counted and lane.entrant.rolling and rolling]
        shown = [lane for lane in theirs if not lane.entrant.counted and settings.shown]
        limits = _limits(grains, folder, cores, remarks) if settings.limit else []
        staying = [ours, *racing, *limits, *rolling, *against, *shown]
        for k in range(1, settings.rounds + 1):
            _heats(f"{of}round {k}", staying, steps, progress)
            if ours.failure:
                raise RuntimeError(f"our own bed did not get through the race: {ours.failure}")
            staying = [ours, *_leaders(racing), *_leaders(limits), *rolling, *_leaders(against)]
    alone = []
    if settings.shown:
        # These start Taichi anew, which ends the beds of before.
        alone = [Lane(Ours(grains, threads=cores, precision="float32")), Lane(Ours(grains, threads=1))]
        _heats(f"{of}float32, one thread", alone, steps, progress)
    _check_work(ours, [*alone, *racing, *limits, *shown])
    for lane in rolling:
        _check_work(lane, against)
    return bed, [ours, *alone, *racing, *shown, *limits, *rolling, *against]


def _limits(grains: Grains, folder: Path, threads: int, remarks: list[str]) -> list[Lane]:
    """The C loop; none where it cannot be compiled, which is said."""
    program, said = compile_yardstick(folder)
    if program is None:
        remarks += [said] if said not in remarks else []
        return []
    return [
        Lane(entrant)
        for entrant in yardsticks(grains, program=program, folder=folder, threads=threads, skins=SKINS)
    ]  # fmt: skip


def _heats(stage: str, lanes: list[Lane], steps: int, progress: Any) -> None:
    """One heat of each lane; one in which it goes wrong is out of the race."""
    progress.stage(stage, len(lanes))
    for done, lane in enumerate(lanes, start=1):
        try:
            lane.heats.append(lane.entrant.heat(steps))
            went = f"{1e-6 * lane.heats[-1].speed:.2f} million grain-steps/s"
        except RuntimeError as problem:
            lane.failure = str(problem)
            went = f"failed: {problem}"
        progress.update(done)
        progress.message(f"{lane.label}: {went}")


PEERS = (LIGGGHTS, LAMMPS, YADE)
_LAWS = {
    LIGGGHTS: (
        ("hertz/history", True, False, {"roll": ""}),
        ("hertz/history with rolling (epsd2)", True, True, {"roll": "rolling_friction epsd2"}),
    ),
    LAMMPS: (
        ("granular hertz/material", True, False, {"law": "material"}),
        ("gran/hertz/history", False, False, {"law": "history"}),
        ("granular hertz/material with rolling (sds)", True, True, {"law": "rolling"}),
    ),
    YADE: (("Hertz-Mindlin", True, False, {}),),
}
"""Each peer's laws, whether they can be the best, whether they resist rolling, and variables of its deck."""


def _theirs(peer: Peer, grains: Grains, folder: Path, ranks: int) -> Iterator[Theirs]:
    """A peer's entrants: those that can be the best with every skin, but for YADE, which is slow."""
    kind = Yade if peer is YADE else Theirs
    for law, counted, rolling, variables in _LAWS[peer]:
        for skin in SKINS if counted and peer is not YADE else (_USUAL_SKIN,):
            yield kind(
                peer, f"{peer.name} {law}", grains, folder=folder, data="bed.data", ranks=ranks, skin=skin,
                counted=counted, rolling=rolling, variables=variables,
            )  # fmt: skip


def _leaders(racing: list[Lane]) -> list[Lane]:
    """Of each peer the fastest skin, and those close to it; of one that has no chance none."""
    fastest: dict[str, float] = {}
    for lane in racing:
        fastest[lane.entrant.name] = max(fastest.get(lane.entrant.name, 0.0), lane.speed or 0.0)
    least = _HOPELESS * max(fastest.values(), default=0.0)
    return [
        lane for lane in racing
        if lane.speed is not None and lane.speed >= max(least, _CLOSE * fastest[lane.entrant.name])
    ]  # fmt: skip


def _check_work(ours: Lane, lanes: list[Lane]) -> None:
    """Say of each lane whether its bed ended up in another state than ours."""
    for lane in lanes if not ours.failure else ():
        if lane.failure:
            continue
        last, reference, found = lane.heats[-1], ours.heats[-1], []
        for what, bound in (("coordination", COORDINATION_BOUND), ("packing", PACKING_BOUND)):
            gap = getattr(last, what) / getattr(reference, what) - 1
            # Written so that a NaN counts as other work.
            if not abs(gap) <= bound:
                found.append(f"{what} {100 * gap:+.2g} %")
        if last.missed:
            found.append(f"{last.missed} lists came too late")
        lane.other_work = ", ".join(found)


def pick_best(
    lanes: list[Lane], *, of: Literal["counted", "limit"] = "counted", rolling: bool = False
) -> Lane | None:  # fmt: skip
    """The fastest of the peers that count, or of the C loop's, that did the same work; None if there is none."""
    chosen = (lane for lane in lanes if (lane.entrant.counted if of == "counted" else lane.entrant.limit))
    fit = [lane for lane in chosen if lane.entrant.rolling == rolling and lane.speed is not None]
    return max(
        reversed([lane for lane in fit if not lane.other_work]), key=lambda lane: lane.speed or 0.0, default=None
    )


def _remarks(lane: Lane) -> Iterator[str]:
    if lane.failure:
        yield f"{lane.label}: {lane.failure}"
    elif lane.other_work:
        yield f"{lane.label} did other work than ours ({lane.other_work}) and is not counted"
