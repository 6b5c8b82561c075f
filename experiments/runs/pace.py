"""How many grain-steps a second this machine makes, measured by its runs and kept for the estimates of later ones.

The cache has `pace.json`: the latest runs with the number of grains that they computed in a step. An estimate takes the
fastest of the last runs of about as many grains. Runs on a busy machine are not kept.
"""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median_low

from .types import Json

__all__ = ["KEPT", "PaceMeter", "keep_pace", "known_pace", "runtime_name"]

KEPT = 40  # Runs that the file has
LATEST = 5  # Of those of about as many grains so many count
ALIKE = 4.0  # Numbers of grains that are about the same, the larger over the smaller [1]
SPELL = 1.0  # A reading is of so long [s]
BUSY = 1.25  # Processes that want to run, over processors, above which a machine is busy; one more is allowed [1]
LEAST = 5  # Readings of a run, below which it is not kept


def runtime_name(*, arch: str, threads: int) -> str:
    """What computes, as the file has it."""
    return f"{arch}-{threads}"


def _file() -> Path:
    from dem.prepare.code import cache_folder  # loads Taichi

    return cache_folder() / "pace.json"


@dataclass
class _Spell:
    """One reading under way."""

    began: float
    first: float
    awake: float = 0.0
    count: int = 0


class PaceMeter:
    """Readings of the grain-steps of one run, of `SPELL` each. Their median leaves out what waits for compilers."""

    def __init__(self) -> None:
        self._spell: _Spell | None = None
        self._runtime = ""
        self.rates: list[float] = []  # [1/s]
        self.awake: list[float] = []

    def leave(self) -> None:
        """Another stage begins: what comes between is no work of the grains."""
        self._spell = None

    def read(self, now: float, *, grain_steps: float, awake: float, runtime: str) -> None:
        """The bed has made so many grain-steps by `now` [s]; ``awake``: grains that it computes."""
        spell = self._spell
        if spell is None or grain_steps < spell.first or runtime != self._runtime:
            self._spell, self._runtime = _Spell(now, grain_steps), runtime
            return
        spell.awake, spell.count = spell.awake + awake, spell.count + 1
        if now - spell.began >= SPELL and grain_steps > spell.first:
            self.rates.append((grain_steps - spell.first) / (now - spell.began))
            self.awake.append(spell.awake / spell.count)
            self._spell = _Spell(now, grain_steps)

    def keep(self) -> None:
        """Keep the run's pace for later ones, if it has enough readings and the machine is not busy."""
        if self._runtime and len(self.rates) >= LEAST and not _busy():
            keep_pace(self._runtime, grains=median_low(self.awake), rate=median_low(self.rates))


def _busy() -> bool:
    """Whether more is to be computed than there are processors for; False where the system does not say."""
    try:
        return os.getloadavg()[0] > BUSY * (os.cpu_count() or 1) + 1
    except (AttributeError, OSError):
        return False


def _kept() -> list[Json]:
    """The runs of the file, oldest first; none where there is no such file, or it is damaged."""
    try:
        rows = json.loads(_file().read_text(encoding="utf-8"))["runs"]
        return [row for row in rows if isinstance(row["runtime"], str) and row["grains"] > 0 and row["rate"] > 0]
    except (OSError, ValueError, KeyError, TypeError):
        return []


def keep_pace(runtime: str, *, grains: float, rate: float) -> None:
    """Add a run to the file: grains that it computed in a step, and grain-steps a second."""
    rows = [*_kept(), {"runtime": runtime, "grains": round(grains), "rate": round(rate)}][-KEPT:]
    path = _file()
    unfinished = path.with_suffix(f".{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.write_text(json.dumps({"format": "hedgebed-pace/1", "runs": rows}, indent=1), encoding="utf-8")
        unfinished.replace(path)
    except OSError:
        pass  # The cache cannot be written: estimates stay those of the machine on which they were made.


def known_pace(runtime: str, *, grains: float) -> float | None:
    """Grain-steps a second that this machine makes with about so many grains; None: not measured yet."""
    alike = [row["rate"] for row in _kept() if row["runtime"] == runtime and _alike(row["grains"], grains)]
    return max(_latest(alike), default=None)


def _alike(one: float, other: float) -> bool:
    return max(one, other) <= ALIKE * min(one, other)


def _latest(rates: Sequence[float]) -> Sequence[float]:
    return rates[-LATEST:]
