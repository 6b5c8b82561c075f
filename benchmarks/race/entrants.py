"""Who races: our bed and the peers' decks, each under one interface.

An entrant does the same thing however often it is asked: the same grains, at rest and without history, ``warm`` steps
that are not timed, then the timed ones.
"""

import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.race.grains import BENCH, Grains, coordination, packing, wrapped
from benchmarks.race.peers import Peer, run_peer
from dem import Bed
from experiments.runs.types import Json

__all__ = ["TIME_STEP", "WARM_STEPS", "Entrant", "Heat", "Ours", "Theirs"]

TIME_STEP = 1e-5  # [s]
WARM_STEPS = 1000
# 9.81 m/s2, tilted by 20 degrees so that contacts live; digit for digit as in the decks.
GRAVITY = tuple(9.81 * part for part in (0.34202014, 0.0, -0.93969262))
ROLLING_FRICTION = 0.1
# Peers that are slower than this are ended: grain steps per second and rank.
_SLOWEST = 1e5
_START = 60.0  # for a peer to read its bed [s]


@dataclass(frozen=True)
class Heat:
    """One timed run of one entrant.

    Attributes:
        speed: grains times steps over wall time [1/s].
        list_count: neighbour lists made in the timed steps.
        coordination: between grains, at the end [1].
        packing: as ``grains.packing``, at the end [1].
        kinetic_energy: translation and rotation, at the end [J].
        version: of a peer; "" for ours.
        command: of a peer; "" for ours.
        missed: lists that came too late, by the peer's own word.
    """

    speed: float
    list_count: int
    coordination: float
    packing: float
    kinetic_energy: float
    version: str = ""
    command: str = ""
    missed: int = 0


class Entrant(ABC):
    """What races: ``name`` for tables, ``counted`` if it can be the best peer, ``skin`` [m] where it is chosen.

    ``rolling`` says that contacts resist rolling: other work, to be compared with its like.
    """

    name: str
    ours = False
    precision = "float64"
    counted = False
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
        bed = self._bed or self._warmed()
        bed.restore(self._state)
        lists = bed.list_count
        began = time.perf_counter()
        bed.advance(steps)
        wall = time.perf_counter() - began
        now = bed.grains()
        period = self._grains.period
        after = Grains(wrapped(now.position, period), now.radius, period)
        return Heat(
            speed=after.count * steps / wall,
            list_count=bed.list_count - lists,
            coordination=coordination(after),
            packing=packing(self._grains.solid_volume, period, float(after.positions[:, 2].mean())),
            kinetic_energy=bed.kinetic_energy,
        )

    def _warmed(self) -> Bed:
        """The bed after its warm-up, with everything compiled."""
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
        self._variables = {"in": data, "skin": f"{skin:g}", **variables}

    def heat(self, steps: int) -> Heat:
        work = self._grains.count * (WARM_STEPS + steps)
        variables = {**self._variables, "warm": str(WARM_STEPS), "steps": str(steps)}
        limit = _START + work / (_SLOWEST * self.threads)
        outcome, command = run_peer(self.peer, self._folder, ranks=self.threads, variables=variables, limit=limit)
        if outcome.grain_count != self._grains.count or outcome.steps != steps:
            raise RuntimeError(
                f"{self.name} ran {outcome.steps} steps of {outcome.grain_count} grains; "
                f"{steps} of {self._grains.count} were wanted"
            )
        return Heat(
            speed=outcome.grain_count * outcome.steps / outcome.time,
            list_count=outcome.list_count,
            coordination=outcome.coordination,
            packing=packing(self._grains.solid_volume, outcome.period, outcome.mean_height),
            kinetic_energy=outcome.kinetic_energy,
            version=outcome.version,
            command=" ".join(word or "''" for word in command),
            missed=outcome.missed,
        )
