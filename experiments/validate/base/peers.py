"""LIGGGHTS and LAMMPS, where they are installed: how they are run, and the data files and words that they read.

LAMMPS' dashpot is a polynomial in the restitution that was fitted with the mass of a sphere, and is used with the
reduced one: with 0.5 it rebounds with 0.62. `lammps_restitution` is the number whose dashpot is that of 0.5.
"""

import math
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from coupling.lammps.law import TANGENTIAL, dashpot_input
from coupling.lammps.words import box_of, data_file, digits, spheres

from .case import Outcome

__all__ = [
    "LAMMPS_TANGENTIAL", "PEERS", "Peer", "PeerError", "box_of", "data_file", "deck_of", "digits",
    "lammps_restitution", "run_deck", "run_peer", "spheres",
]  # fmt: skip

LAMMPS_TANGENTIAL = TANGENTIAL
_LAST_LINES = 6
_GRACE = 10.0  # for mpirun to end its ranks [s]
# Quiet, and one thread a rank.
_ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OMPI_MCA_btl_base_warn_component_unused": "0", "PMIX_MCA_gds": "hash"}


class PeerError(RuntimeError):
    """A peer did not finish, or its log does not say what it should."""


@dataclass(frozen=True)
class Peer:
    """Another code: what its program may be called, its Debian package."""

    name: str
    programs: tuple[str, ...]
    package: str

    def find(self) -> str | None:
        """The program on the PATH, or None."""
        return next((name for name in self.programs if shutil.which(name)), None)

    @property
    def missing(self) -> str:
        """That it is not installed, in words."""
        return f"{self.name} is not installed (apt install {self.package})"

    def skipped(self) -> Outcome:
        """Of a case where it is not installed."""
        return Outcome(skipped=self.missing)


PEERS = {"liggghts": Peer("LIGGGHTS", ("liggghts",), "liggghts"), "lammps": Peer("LAMMPS", ("lmp", "lammps"), "lammps")}


def run_deck(
    peer: Peer, folder: Path, deck: str, *, limit: float, launcher: Sequence[str] = (),
    variables: Mapping[str, str] | None = None,
) -> tuple[str, list[str]]:  # fmt: skip
    """Run a peer on the file ``deck`` of a folder, which holds what it reads: its log, and the command.

    ``launcher``: what starts it, such as mpirun. ``variables``: of the deck. Raises PeerError where the peer is not
    installed, was ended after ``limit`` [s] or failed, with its last lines.
    """
    program = peer.find()
    if program is None:
        raise PeerError(peer.missing)
    log = folder / "log.txt"
    log.unlink(missing_ok=True)
    chosen = [word for name, value in (variables or {}).items() for word in ("-var", name, value)]
    command = [*launcher, program, "-in", deck, *chosen, "-log", "log.txt", "-screen", "none"]
    output, status = _call(command, folder, limit)
    text = log.read_text(encoding="utf-8", errors="replace") if log.exists() else ""
    if status != 0:
        why = f"was ended after {limit:.0f} s" if status is None else f"exit status {status}"
        raise PeerError(f"{peer.name} failed ({why}): {_last_lines(text, output)}")
    return text, command


def _call(command: Sequence[str], folder: Path, limit: float) -> tuple[str, int | None]:
    """Run a command; its output, and its status or None if it took too long. Whatever happens, it has ended after."""
    process = subprocess.Popen(
        command, cwd=folder, env={**os.environ, **_ENVIRONMENT}, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True,
    )  # fmt: skip
    try:
        return process.communicate(timeout=limit)[0], process.returncode
    except BaseException as stop:
        process.terminate()  # mpirun is asked first, since it alone knows its ranks
        try:
            output = process.communicate(timeout=_GRACE)[0]
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            output = process.communicate()[0]
        if isinstance(stop, subprocess.TimeoutExpired):
            return output, None
        raise


def _last_lines(*texts: str) -> str:
    """The last lines of each text, in one line."""
    lines = [line.strip() for text in texts for line in text.splitlines()[-_LAST_LINES:] if line.strip(" -\n")]
    return " | ".join(lines) or "it said nothing"


def run_peer(peer: str, data: str, deck: str, wanted: str, *, limit: float) -> str:
    """Run a peer, in one process, on a deck that reads ``grains.data``: the text of the file ``wanted`` that it writes.

    Raises PeerError as `run_deck` does, and where there is no such file.
    """
    with tempfile.TemporaryDirectory(prefix="hedgebed-peer-") as name:
        folder = Path(name)
        (folder / "grains.data").write_text(data, encoding="ascii")
        (folder / "deck").write_text(deck, encoding="ascii")
        log, _ = run_deck(PEERS[peer], folder, "deck", limit=limit)
        if not (folder / wanted).is_file():
            raise PeerError(f"{PEERS[peer].name} wrote no {wanted}: {_last_lines(log)}")
        return (folder / wanted).read_text(encoding="ascii")


def deck_of(peer: str, lines: Sequence[str], *, boundary: str, skin: str = "2e-4") -> str:
    """A deck that reads ``grains.data`` and then has these lines; ``skin``: of neighbour lists [m]."""
    sort = "atom_style sphere|comm_modify vel yes"
    if peer == "liggghts":
        sort = "atom_style granular|atom_modify map array|communicate single vel yes"
    head = ["units si", *sort.split("|"), f"boundary {boundary}", "newton off", "read_data grains.data"]
    head += [f"neighbor {skin} bin", "neigh_modify delay 0 every 1 check yes"]
    return "\n".join([*head, *lines]) + "\n"


def lammps_restitution(restitution: float) -> float:
    """What to ask LAMMPS' ``damping tsuji`` for, to have the dashpot of a restitution [1].

    That of Tsuji et al. in closed form is sqrt(5) |beta| in LAMMPS' measure, beta = ln e / sqrt(ln^2 e + pi^2).
    """
    log = math.log(restitution)
    return dashpot_input(math.sqrt(5) * -log / math.hypot(log, math.pi))
