"""Who races: our bed and the peers' decks, each under one interface, and what a peer's log says.

An entrant does the same thing however often it is asked: the same grains, at rest and without history, ``warm`` steps
that are not timed, then the timed ones.
"""

import json
import math
import os
import re
import shutil
import subprocess
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.race.grains import BENCH, Grains, coordination, packing, wrapped
from dem import Bed
from experiments.runs.types import Json
from experiments.validate.base.peers import PEERS, Peer, PeerError, run_deck

__all__ = [
    "LAMMPS", "LIGGGHTS", "TIME_STEP", "WARM_STEPS", "YADE", "Entrant", "Heat", "Ours", "Peer", "PeerError", "Theirs",
    "Yade", "read_log", "read_yade", "run_peer",
]  # fmt: skip

TIME_STEP = 1e-5  # [s]
WARM_STEPS = 1000
# 9.81 m/s2, tilted by 20 degrees so that contacts live; digit for digit as in the decks.
GRAVITY = tuple(9.81 * part for part in (0.34202014, 0.0, -0.93969262))
ROLLING_FRICTION = 0.1
# Peers that are slower than this are ended: grain steps per second and rank.
_SLOWEST = 1e5
_START = 60.0  # for a peer to read its bed [s]
_HERE = Path(__file__).resolve().parent
LIGGGHTS, LAMMPS = PEERS["liggghts"], PEERS["lammps"]
YADE = Peer("YADE", ("yade",), "yade")


@dataclass(frozen=True)
class Outcome:
    """What a log says of its last, timed run."""

    version: str  # as the code gives it
    time: float  # of the timed steps [s]
    steps: int  # timed
    grain_count: int
    list_count: int  # neighbour lists made in the timed steps
    missed: int  # lists that the code itself says came too late ("dangerous builds")
    kinetic_energy: float  # translation and rotation at the end [J]
    coordination: float  # contacts between grains, per grain, at the end [1]
    mean_height: float  # of the centres at the end [m]
    period: tuple[float, float]  # (x, y) [m]


_LOOP = re.compile(r"^Loop time of (\S+) on \d+ procs for (\d+) steps with (\d+) atoms", re.MULTILINE)
_LISTS = re.compile(r"^Neighbor list builds = (\d+)", re.MULTILINE)
_MISSED = re.compile(r"^Dangerous builds = (\d+)", re.MULTILINE)
_VERSION = re.compile(r"^(?:LIGGGHTS \(Version ([^,)]+)|LAMMPS \(([^)]+)\))", re.MULTILINE)


def read_log(text: str) -> Outcome:
    """What a log of either code says of its last run.

    Raises PeerError where there is no finished run in it, or a number is missing or is not a number.
    """
    loops = list(_LOOP.finditer(text))
    if len(loops) < 2:
        raise PeerError("the log holds no timed run")
    loop = loops[-1]
    # The line above "Loop time" is the thermo output of the last step.
    row = text[: loop.start()].rstrip().rpartition("\n")[2].split()
    after = text[loop.end() :]
    lists, missed, version = _LISTS.search(after), _MISSED.search(after), _VERSION.search(text)
    try:
        _, moving, turning, contacts, heights, lx, ly = (float(word) for word in row)
        time, steps, count = float(loop[1]), int(loop[2]), int(loop[3])
    except ValueError as problem:
        raise PeerError(f"the log cannot be read: its last numbers are {' '.join(row)!r} ({problem})") from None
    if lists is None or time <= 0:
        raise PeerError(f"the log cannot be read: its last numbers are {' '.join(row)!r}")
    return Outcome(
        version="unknown" if version is None else version[1] or version[2], time=time, steps=steps, grain_count=count,
        list_count=int(lists[1]), missed=0 if missed is None else int(missed[1]), kinetic_energy=moving + turning,
        coordination=contacts / count, mean_height=heights / count, period=(lx, ly),
    )  # fmt: skip


def run_peer(
    peer: Peer, folder: Path, *, ranks: int, variables: dict[str, str], limit: float
) -> tuple[Outcome, list[str]]:
    """Run a peer's deck in ``folder``, which holds the bed, and return what came out and the command.

    ``variables``: of the deck; ``in`` is a file in ``folder``. ``limit``: the run is ended after so long [s]. Raises
    PeerError as ``run_deck`` of the verification suite does, and where the log cannot be read.
    """
    deck = f"bench.{peer.name.lower()}"
    shutil.copyfile(_HERE / deck, folder / deck)
    launcher = ["mpirun", *(["--allow-run-as-root"] if os.geteuid() == 0 else []), "-np", str(ranks)]
    log, command = run_deck(peer, folder, deck, limit=limit, launcher=launcher, variables=variables)
    return read_log(log), command


@dataclass(frozen=True)
class Heat:
    """One timed run of one entrant."""

    speed: float  # grains times steps over wall time [1/s]
    list_count: int  # neighbour lists made in the timed steps
    coordination: float  # between grains, at the end [1]
    packing: float  # as ``grains.packing``, at the end [1]
    kinetic_energy: float  # translation and rotation, at the end [J]
    version: str = ""  # of a peer
    command: str = ""  # of a peer
    missed: int = 0  # lists that came too late, by the peer's own word


class Entrant(ABC):
    """What races: ``name`` for tables, ``counted`` if it can be the best peer, ``skin`` [m] where it is chosen.

    ``limit``: it only shows how far the machine goes.
    ``rolling`` says that contacts resist rolling: other work, to be compared with its like.
    """

    name: str
    ours = False
    precision = "float64"
    counted = False
    limit = False
    rolling = False
    skin: float | None = None
    threads: int

    @abstractmethod
    def heat(self, steps: int) -> Heat:
        """Do the work once, ``steps`` of it timed. Raises RuntimeError if it cannot."""


class Ours(Entrant):
    """Our bed. It is warmed up once; every heat starts from the state of then."""

    ours = True

    def __init__(self, grains: Grains, *, threads: int, precision: str = "float64", rolling: bool = False):
        self.name = "hedgebed with rolling" if rolling else "hedgebed"
        self.precision, self.rolling, self.threads, self._grains = precision, rolling, threads, grains
        self._material = replace(BENCH, rolling_friction=ROLLING_FRICTION) if rolling else BENCH
        self._bed: Bed | None = None
        self._state: Json = {}

    def heat(self, steps: int) -> Heat:
        bed = self.warmed()
        lists = bed.list_count
        began = time.perf_counter()
        bed.advance(steps)
        wall = time.perf_counter() - began
        now = bed.grains()
        period = self._grains.period
        after = Grains(wrapped(now.position, period), now.radius, period)
        share = packing(self._grains.solid_volume, period, float(after.positions[:, 2].mean()))
        return Heat(after.count * steps / wall, bed.list_count - lists, coordination(after), share, bed.kinetic_energy)

    def warmed(self) -> Bed:
        """The bed in its state after the warm-up, with everything compiled."""
        if self._bed is not None:
            self._bed.restore(self._state)
            return self._bed
        grains = self._grains
        bed = Bed.from_grains(
            self._material, positions=grains.positions, radii=grains.radii, gravity=GRAVITY, time_step=TIME_STEP,
            size=(*grains.period, float(grains.positions[:, 2].max())), tensile=True, precision=self.precision,
            threads=self.threads,
        )  # fmt: skip
        # Single steps and several at once are kernels of their own.
        bed.advance(WARM_STEPS - 1)
        bed.advance(1)
        self._state = bed.state()
        self._bed = bed
        return bed


class Theirs(Entrant):
    """A peer with one law and one skin [m]. ``folder`` holds the bed, in the file ``data``."""

    def __init__(
        self, peer: Peer, name: str, grains: Grains, *, folder: Path, data: str, ranks: int, skin: float, counted: bool,
        rolling: bool = False, variables: dict[str, str],
    ):  # fmt: skip
        self.peer, self.name, self.counted, self.rolling = peer, name, counted, rolling
        self.skin, self.threads, self._grains, self._folder = skin, ranks, grains, folder
        self._data, self._variables = data, variables

    def heat(self, steps: int) -> Heat:
        grains = self._grains
        limit = _START + grains.count * (WARM_STEPS + steps) / (_SLOWEST * self.threads)
        outcome, command = self._run(steps, limit)
        if outcome.grain_count != grains.count or outcome.steps != steps:
            raise RuntimeError(
                f"{self.name} ran {outcome.steps} steps of {outcome.grain_count} grains; "
                f"{steps} of {grains.count} were wanted"
            )
        share = packing(grains.solid_volume, outcome.period, outcome.mean_height)
        return Heat(
            outcome.grain_count * outcome.steps / outcome.time, outcome.list_count, outcome.coordination, share,
            outcome.kinetic_energy, outcome.version, " ".join(word or "''" for word in command), outcome.missed,
        )  # fmt: skip

    def _run(self, steps: int, limit: float) -> tuple[Outcome, list[str]]:
        variables = {"in": self._data, "skin": f"{self.skin:g}", **self._variables}
        variables |= {"warm": str(WARM_STEPS), "steps": str(steps)}
        return run_peer(self.peer, self._folder, ranks=self.threads, variables=variables, limit=limit)


class Yade(Theirs):
    """YADE: one process with threads, and a script of its Python."""

    def _run(self, steps: int, limit: float) -> tuple[Outcome, list[str]]:
        out, program = self._folder / "yade.json", self.peer.find()
        if program is None:
            raise PeerError(self.peer.missing)
        out.unlink(missing_ok=True)
        shutil.copyfile(_HERE / "bench_yade.py", self._folder / "bench_yade.py")
        numbers = (f"{self.skin:g}", str(WARM_STEPS), str(steps))
        command = [program, f"-j{self.threads}", "-x", "-n", "bench_yade.py", self._data, out.name, *numbers]
        try:
            done = subprocess.run(
                command, cwd=self._folder, capture_output=True, text=True, errors="replace", stdin=subprocess.DEVNULL,
                timeout=limit, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise PeerError(f"{self.name} was ended after {limit:.0f} s") from None
        if done.returncode or not out.is_file():
            last = (done.stderr.strip() or done.stdout.strip() or "it said nothing").splitlines()[-1]
            raise PeerError(f"{self.name} failed (exit status {done.returncode}): {last}")
        return read_yade(out.read_text(encoding="utf-8")), command


def read_yade(text: str) -> Outcome:
    """What YADE's script wrote of its timed run. Raises PeerError where a number is missing or is not a number."""
    try:
        found = json.loads(text)
        lx, ly = map(float, found.pop("period"))
        outcome = Outcome(**found, period=(lx, ly))
        if not (outcome.time > 0 and all(map(math.isfinite, (outcome.coordination, outcome.mean_height, lx, ly)))):
            raise ValueError("a time or a length is no number")
    except (ValueError, TypeError, KeyError) as problem:
        raise PeerError(f"what YADE wrote cannot be read: {problem}") from None
    return outcome
