"""LIGGGHTS and LAMMPS: what is installed, how a run is called, what its log says."""

import os
import re
import shutil
import signal
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.validate.base import peers as installed

__all__ = ["LAMMPS", "LIGGGHTS", "Outcome", "Peer", "PeerError", "find_mpirun", "read_log", "run_peer"]

_HERE = Path(__file__).resolve().parent
_LAST_LINES = 6
_GRACE = 10.0  # for mpirun to end its ranks [s]
# Quiet, and one thread a rank.
_ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OMPI_MCA_btl_base_warn_component_unused": "0", "PMIX_MCA_gds": "hash"}


class PeerError(RuntimeError):
    """A peer did not finish, or its log does not say what it should."""


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


def command_of(peer: Peer, program: str, *, ranks: int, variables: dict[str, str]) -> list[str]:
    """How a run is called, in a folder that holds the deck and the bed."""
    command = ["mpirun", *(["--allow-run-as-root"] if os.geteuid() == 0 else []), "-np", str(ranks), program]
    command += ["-in", peer.deck]
    for name, value in variables.items():
        command += ["-var", name, value]
    return [*command, "-log", "log.txt", "-screen", "none"]


def run_peer(
    peer: Peer, folder: Path, *, ranks: int, variables: dict[str, str], limit: float
) -> tuple[Outcome, list[str]]:
    """Run a peer's deck in ``folder``, which holds the bed, and return what came out and the command.

    ``variables``: of the deck; ``in`` is a file in ``folder``. ``limit``: the run is ended after so long [s]. Raises
    PeerError where the peer is not there, was ended, failed (with its last lines), or its log cannot be read.
    """
    program = peer.find()
    if program is None:
        raise PeerError(f"{peer.name} is not installed (apt install {peer.package})")
    shutil.copyfile(_HERE / peer.deck, folder / peer.deck)
    log = folder / "log.txt"
    log.unlink(missing_ok=True)
    command = command_of(peer, program, ranks=ranks, variables=variables)
    output, status = _call(command, folder, limit)
    text = log.read_text(encoding="utf-8", errors="replace") if log.exists() else ""
    if status != 0:
        why = f"was ended after {limit:.0f} s" if status is None else f"exit status {status}"
        raise PeerError(f"{peer.name} failed ({why}): {_last_lines(text, output)}")
    return read_log(text), command


def _call(command: Sequence[str], folder: Path, limit: float) -> tuple[str, int | None]:
    """Run a command; its output, and its status or None if it took too long. Whatever happens, it has ended after."""
    process = subprocess.Popen(
        command, cwd=folder, env={**os.environ, **_ENVIRONMENT}, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True,
    )  # fmt: skip
    try:
        return process.communicate(timeout=limit)[0], process.returncode
    except BaseException as stop:
        output = _end(process)
        if isinstance(stop, subprocess.TimeoutExpired):
            return output, None
        raise


def _end(process: subprocess.Popen[str]) -> str:
    """End a run; what it had said. mpirun is asked first, since it alone knows its ranks."""
    process.terminate()
    try:
        return process.communicate(timeout=_GRACE)[0]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return process.communicate()[0]


def _last_lines(*texts: str) -> str:
    """The last lines of each text, in one line."""
    lines = [line.strip() for text in texts for line in text.splitlines()[-_LAST_LINES:] if line.strip(" -\n")]
    return " | ".join(lines) or "it said nothing"
