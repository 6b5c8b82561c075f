"""LIGGGHTS and LAMMPS: what is installed, how a run is called, what its log says."""

import os
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from experiments.validate.base import peers as installed
from experiments.validate.base.peers import PeerError, run_deck

__all__ = ["LAMMPS", "LIGGGHTS", "Outcome", "Peer", "PeerError", "find_mpirun", "read_log", "run_peer"]

_HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Peer(installed.Peer):
    """The same with its deck in this folder."""

    deck: str


LIGGGHTS, LAMMPS = (Peer(**vars(peer), deck=f"bench.{key}") for key, peer in installed.PEERS.items())


def find_mpirun() -> str | None:
    """The program that starts ranks, or None."""
    return shutil.which("mpirun")


@dataclass(frozen=True)
class Outcome:
    """What a log says of its last, timed run.

    Attributes:
        version: as the code gives it.
        time: of the timed steps [s].
        steps, grain_count, list_count: timed steps, grains, neighbour lists made meanwhile.
        missed: lists that the code itself says came too late ("dangerous builds").
        kinetic_energy: translation and rotation at the end [J].
        coordination: contacts between grains, per grain, at the end [1].
        mean_height: of the centres at the end [m].
        period: (x, y) [m].
    """

    version: str
    time: float
    steps: int
    grain_count: int
    list_count: int
    missed: int
    kinetic_energy: float
    coordination: float
    mean_height: float
    period: tuple[float, float]


_LOOP = re.compile(r"^Loop time of (\S+) on \d+ procs for (\d+) steps with (\d+) atoms", re.MULTILINE)
_LISTS = re.compile(r"^Neighbor list builds = (\d+)", re.MULTILINE)
_MISSED = re.compile(r"^Dangerous builds = (\d+)", re.MULTILINE)
_VERSION = re.compile(r"^(?:LIGGGHTS \(Version ([^,)]+)|LAMMPS \(([^)]+)\))", re.MULTILINE)
_COLUMNS = 7


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
        numbers = [float(word) for word in row]
        time, steps, count = float(loop[1]), int(loop[2]), int(loop[3])
    except ValueError as problem:
        raise PeerError(f"the log cannot be read: {problem}") from None
    if len(numbers) != _COLUMNS or lists is None or time <= 0:
        raise PeerError(f"the log cannot be read: its last numbers are {' '.join(row)!r}")
    _, moving, turning, contacts, heights, lx, ly = numbers
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
    shutil.copyfile(_HERE / peer.deck, folder / peer.deck)
    launcher = ["mpirun", *(["--allow-run-as-root"] if os.geteuid() == 0 else []), "-np", str(ranks)]
    log, command = run_deck(peer, folder, peer.deck, limit=limit, launcher=launcher, variables=variables)
    return read_log(log), command
