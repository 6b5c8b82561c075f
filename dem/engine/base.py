"""The part of a bed that steps: its fields, clock, bodies, neighbour lists and sleeping grains.

``BedBase`` holds what one bed owns of an ``Engine``. Names without an underscore are public to the modules of dem:
state, checkpoints, stresses and energies read them (``dem.engine.core`` is what a user's ``dem.Bed`` adds to).
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from dem.contact.cohesion import COHESIONS, jkr_range
from dem.contact.law import effective_moduli, pair_row
from dem.grains.materials import Material
from dem.grains.packing import bulk_packing, surface_height
from dem.grains.sizes import Json
from hedgebed_taichi import ti

from . import runtime
from .checking import check_lists, check_step, debug_wanted, keep_histories
from .engine import take_engine
from .lists import FLOOR, MOST_BODIES
from .sleep import Sleeper
from .values import BedFailure, BedSettings, Sleep, State, refuse_sleep

__all__ = ["FLOOR", "BedBase", "check_array"]

# Skin over mean diameter: first guess and bounds. It adapts to how often lists are made.
_SKIN, _LEAST_SKIN, _LARGEST_SKIN = 0.06, 0.02, 0.15
# A rebuild costs about as much as this many steps, and a skin of one diameter would add about this share to a step.
_REBUILD_STEPS, _SKIN_COST = 6.0, 0.5
# Rows of the pair lists and the near lists a grain, to begin with; on a GPU both grains of a pair have one.
PAIR_ROWS, NEAR_ROWS, NEAR_ROWS_ON_GPU = 5.0, 0.25, 1.0


class BedBase:
    """Grains in an engine, the bodies among them, and the clock.

    Attributes, beside those of ``dem.Bed``:
        engine: fields and kernels. runtime: what Taichi runs on. settings: what the bed was made with.
        material, size, gravity, time_step, seed: in force now; SI units.
        mean_diameter: of the grains [m]. skin: of the neighbour lists [m].
        steps, list_count: time steps and neighbour lists so far. steps_since_lists: since the last lists.
        reaction_steps: of the last ``advance``. tallied: sums of the forces on bodies since, or None.
        sleeper: the rules of sleep at work, or None. has_floor: whether body 0 is a plane.
        debug: whether all lists are checked against brute force, at every step (``dem.engine.checking``); as
            HEDGEBED_DEBUG=1 in the environment says, or set it.
    """

    def __init__(self, settings: BedSettings, radii: np.ndarray, *, precision: str, arch: str, threads: int | None):
        """Fields without grains in them; ``from_grains`` and the like check what they pass, and fill them."""
        self.runtime = runtime.start(arch=arch, threads=threads, precision=precision)
        self._generation = runtime.generation()
        self.settings = settings
        self.material = stuff = settings.material
        self.size, self.gravity, self.seed = settings.size, settings.gravity, settings.seed
        self.time_step, self.overlap_limit = settings.time_step, settings.max_overlap
        self.grain_count = len(radii)
        # The same to the bit in whatever order the grains come, as a bed taken up again has them in another.
        self.mean_diameter = 2 * math.fsum(radii) / self.grain_count
        self.skin = _SKIN * self.mean_diameter
        self.steps = self.list_count = self.steps_since_lists = self.reaction_steps = self.grain_steps = 0
        self.tallied: np.ndarray | None = None
        self.sleeper: Sleeper | None = None
        self.has_floor = False
        self.debug = debug_wanted()
        self.recipe: Json = {}
        self.surface = self.packing_fraction = math.nan
        largest = float(radii.max())
        largest_skin = _LARGEST_SKIN * self.mean_diameter + _reach(stuff, largest / 2)
        pair_rows, near_rows = _rows_per_grain(radii, largest_skin, gpu=self.runtime.arch == "cuda")
        self.engine = take_engine(
            self,
            grain_count=self.grain_count,
            period=self.size[:2],
            bottom=-4 * largest,
            height=settings.height,
            largest_diameter=2 * largest,
            largest_skin=largest_skin,
            rolling=stuff.rolling_friction > 0,
            tensile=settings.tensile,
            rescaled=stuff.tangential == "rescaled",
            cohesion=COHESIONS[stuff.cohesion],
            real=ti.f64 if precision == "float64" else ti.f32,
            gpu=self.runtime.arch == "cuda",
            threads=self.runtime.threads,
            neighbours_per_grain=pair_rows,
            near_per_grain=near_rows,
        )
        self.engine.grain_pair[None] = pair_row(stuff, tensile=settings.tensile)
        self.engine.write("body_turn", np.tile([1.0, 0.0, 0.0, 0.0], (MOST_BODIES, 1)))

    if TYPE_CHECKING:

        def state(self) -> State:
            """``dem.engine.state`` has it."""

    def let_sleep(self, rules: Sleep | None = None) -> None:
        """Compute quiet grains every so many steps only, and those at rest not at all, by ``dem.engine.sleep``'s rules.

        What is read of the bed counts sleepers in, with no speed and no force. The floor's reaction has what they would
        have passed on to it. Raises ValueError: a bed on a GPU, without floor or gravity, or whose grains cohere by
        JKR.
        """
        self.check_valid()
        refuse_sleep(
            arch="cuda" if self.engine.gpu else "cpu", cohesion=self.material.cohesion, floor=self.has_floor,
            gravity=math.hypot(*self.gravity),
        )  # fmt: skip
        self.wake()
        self.engine.let_sleep()
        self.sleeper = Sleeper(self, rules or Sleep())

    def wake(self) -> None:
        """Wake all grains, which then stay awake."""
        self.check_valid()
        if self.sleeper is not None:
            self.make_lists()
            self.sleeper = None
            self.engine.wake_all()
            self.compute_forces()

    @property
    def awake_count(self) -> int:
        """Number of grains that are computed, be it every so many steps: all that do not sleep."""
        return self.grain_count if self.sleeper is None else self.sleeper.awake

    @property
    def asleep(self) -> np.ndarray:
        """Whether each grain sleeps, by id, bool, shape [grain_count]."""
        if self.sleeper is None:
            return np.zeros(self.grain_count, dtype=bool)
        return np.asarray(self.engine.rest.asleep.to_numpy()[: self.grain_count] == 1)

    def tally(self) -> tuple[np.ndarray, float]:
        """Sums over the chunks of what grains did to the bodies, shape [body, 6]; the largest overlap."""
        rows = np.zeros((MOST_BODIES + 1, 6))
        self.engine.tally(rows)
        return rows[:-1], float(rows[-1, 0])

    def awake_rows(self, *names: str) -> list[np.ndarray]:
        """Fields of the engine, of the grains awake, who come first in memory: the others have no speed, no force."""
        self.check_valid()
        awake = slice(0, self.awake_count)
        return [self.engine.read(name)[awake].astype(float) for name in names]

    def paces(self) -> np.ndarray:
        """Steps of the bed for one of each grain awake, in the order of memory: 1, but of the slow; shape [awake]."""
        return np.ones(self.grain_count) if self.sleeper is None else self.sleeper.of_slow(self.sleeper.pace)

    def heaviness(self) -> tuple[np.ndarray, np.ndarray]:
        """How many times its mass, and its moment of inertia, each grain awake moves with, likewise."""
        if self.sleeper is None:
            return np.ones(self.grain_count), np.ones(self.grain_count)
        return self.sleeper.of_slow(self.sleeper.heavy), self.sleeper.of_slow(self.sleeper.stout)

    def rates_now(
        self, position: np.ndarray, velocity: np.ndarray, spin: np.ndarray, force: np.ndarray, torque: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Velocity [m/s] and spin [rad/s] at the time of the positions, half a step after the engine's, of its rows:
        of all grains, or of those awake."""
        half = np.full((2, len(position)), 0.5 * self.time_step)
        for row, heavier in zip(half, self.heaviness(), strict=True):
            row[: self.awake_count] *= (self.paces() / heavier)[: len(row)]
        radius, mass = position[:, 3], velocity[:, 3]
        now = velocity[:, :3] + (half[0] / mass)[:, None] * force
        return now, spin[:, :3] + (half[1] * 2.5 / (mass * radius**2))[:, None] * torque

    @property
    def height(self) -> float:
        """Top of the box [m]: a grain above it is lost."""
        return float(self.settings.height)

    @property
    def time(self) -> float:
        """Time since the bed was made [s]."""
        return self.steps * self.time_step

    def advance(self, steps: int = 1, *, drag_time: float = math.inf) -> None:
        """Advance by a number of time steps.

        Args:
            drag_time: the grains settle as in a fluid that takes their speed away with this time constant [s]; a tool
                of preparation, off by default.

        Raises ValueError: steps that are no whole number, a drag time shorter than two steps. BedFailure: a grain left
        the box, a number is not a number, or an overlap went past its bound.
        """
        self.check_valid()
        e = self.engine
        if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)) or steps < 0:
            raise ValueError(
                f"steps = {steps!r} must be a whole number of time steps of {self.time_step:.3g} s, 0 or more; "
                f"round(time / bed.time_step) is that for a time"
            )
        if not drag_time >= 2 * self.time_step:
            raise ValueError(f"drag_time = {drag_time} s must be at least two time steps of {self.time_step:.3g} s")
        keep = 1 - self.time_step / drag_time
        e.clear_pushes()
        self.reaction_steps, self.tallied = steps, None
        sleeper = self.sleeper
        if sleeper is not None:
            e.rest.held.fill(0)
            sleeper.slept, sleeper.begun_ahead = 0.0, sleeper.floor_ahead()
        limit = 0.5 * self.skin
        done = 0
        while done < steps:
            most = steps - done
            if sleeper is not None:
                if sleeper.check():
                    self.make_lists(anew=False, stirred=True)
                    e = self.engine
                    limit = 0.5 * self.skin
                most = min(most, sleeper.rules.every - self.steps % sleeper.rules.every)
            most = 1 if self.debug else most
            advanced, halted = e.launch(most, self.steps, self.time_step, limit, self.gravity, keep, self.awake_count)
            done += advanced
            self._count(advanced)
            if halted:
                self.adapt_skin()
                self.make_lists(anew=False)
                e = self.engine
                self.compute_forces(self.time_step)
                limit = 0.5 * self.skin
                done += 1
                self._count(1)
            if self.debug:
                check_step(self)
        self.tallied, overlap = self.tally()
        if not overlap <= self.overlap_limit:
            raise BedFailure(
                f"an overlap of {100 * overlap:.3g} % of a diameter went past its bound of "
                f"{100 * self.overlap_limit:g} % at t = {self.time:.6g} s; make the grains stiffer (young = "
                f"{self.material.young:.3g} Pa now) or the bound larger"
            )

    def _count(self, steps: int) -> None:
        self.grain_steps += steps * self.grain_count if self.sleeper is None else self.sleeper.computed(steps)
        if self.sleeper is not None:
            self.sleeper.slept += steps * self.sleeper.mass
        self.steps += steps
        self.steps_since_lists += steps

    def adapt_skin(self) -> None:
        """Move the skin towards that at which lists cost as much to make as their extra pairs cost to check."""
        steps = max(1, self.steps_since_lists)
        ratio = math.sqrt(_REBUILD_STEPS / (_SKIN_COST * self.skin / self.mean_diameter * steps))
        skin = self.skin * min(1.4, max(0.7, ratio))
        self.skin = min(_LARGEST_SKIN * self.mean_diameter, max(_LEAST_SKIN * self.mean_diameter, skin))

    def make_lists(self, *, anew: bool = True, stirred: bool = False) -> None:
        """Sort the grains and list who is near whom, the contacts' history carried over. Raises BedFailure.

        ``anew``: wake all, for forces that are computed anew; else those to come stay what they are. ``stirred``: let
        grains become slow, fast, fall asleep and wake.
        """
        e, sleeper = self.engine, self.sleeper
        stirred = stirred or anew
        before = keep_histories(self) if self.debug else None
        e.keep_lists(e.rest, e.balance)
        awake = self.awake_count
        if sleeper is not None:
            if stirred:
                sleeper.rearrange(all_awake=anew)
            sleeper.recount()
        times = (0.0, 0.0) if sleeper is None else sleeper.times_ahead(between=stirred)
        e.sort(*self.gravity, awake, int(anew), *times, e.rest, e.balance)
        e.make_lists(self.skin, e.shapes, e.rest, e.balance)
        lost, pairs, near = (int(e.problem[k]) for k in range(3))
        if lost or pairs or near:
            e.problem.fill(0)
        if lost:
            raise BedFailure(self._explain(lost - 1))
        if pairs or near:  # as many as are needed are known by now, so that once more is enough
            self.make_room(pairs, near)
            self.engine.make_lists(self.skin, self.engine.shapes, self.engine.rest, self.engine.balance)
        self.list_count += 1
        self.steps_since_lists = 0
        if before is not None:
            check_lists(self, before)
        if sleeper is not None and stirred and not anew:
            sleeper.settle()

    def make_room(self, pairs: int, near: int) -> None:
        """Enlarge the lists where needed: so many rows of pairs, and of grains near bodies, in each chunk.

        ``engine`` may be another one then. Raises BedFailure: there is no memory for such lists.
        """
        try:
            self.engine = self.engine.with_room(self, pairs, near)
        except MemoryError as problem:
            e = self.engine
            raise BedFailure(
                f"the lists hold {e.chunk_room} pairs and {e.near_room} grains near bodies a chunk, {pairs} and {near} "
                f"are needed, and a larger engine {problem}; take fewer grains, or larger ones"
            ) from None

    def _explain(self, some: int) -> str:
        """Why there are no lists; ``some``: the id of a grain that has left the box."""
        e = self.engine
        position, ids = e.read("position"), e.read("id")
        bad = ~np.isfinite(position).all(axis=1)
        if bad.any():
            return f"the position of grain {int(ids[bad].min())} is not a number at t = {self.time:.6g} s"
        lost = (position[:, 2] > self.height) | (position[:, 2] < e.bottom)
        first = int(ids[lost].min()) if lost.any() else some
        x, y, z = position[ids == first][0, :3]
        return (
            f"grain {first} left the box ({int(lost.sum())} in all) at t = {self.time:.6g} s: it is at "
            f"({x:.4g}, {y:.4g}, {z:.4g}) m, the box reaches from {e.bottom:.4g} to {self.height:.4g} m"
        )

    def compute_forces(self, elapsed: float = 0.0) -> None:
        """Compute the forces where the grains are; ``elapsed``: the time by which contacts have slid since then."""
        self.tallied = None
        e = self.engine
        e.push_all(elapsed, self.steps, e.shapes, e.rest, e.balance)

    def shift_velocities(self, part: float) -> None:
        """Kick all grains by the present forces for this part of a time step, of either sign."""
        self.engine.shift_velocities(part * self.time_step)

    def measure_surface(self) -> None:
        """Measure ``surface`` and ``packing_fraction`` anew from where the grains are now."""
        position = self.engine.read("position").astype(float)
        area = self.size[0] * self.size[1]
        self.packing_fraction = bulk_packing(position[:, 2], position[:, 3], area)
        self.surface = surface_height(position[:, 2], position[:, 3], area, bulk=self.packing_fraction)

    @property
    def max_overlap(self) -> float:
        """Largest overlap over mean diameter of the pair [1] since the bed was made or this was set."""
        return float(self.engine.read("overlap").max())

    @max_overlap.setter
    def max_overlap(self, value: float) -> None:
        self.engine.overlap.fill(value)

    def fill(self, positions, velocities, spins, radii) -> None:
        """Put the grains into the fields, with ids in the order in which they come."""
        e, mass = self.engine, self.material.density * 4 / 3 * math.pi * radii**3
        e.write("position", np.column_stack([positions, radii]))
        e.write("velocity", np.column_stack([velocities, mass]))
        e.write("spin", np.column_stack([spins, np.zeros(self.grain_count)]))
        e.write("origin", positions)
        e.write("id", np.arange(self.grain_count))
        e.lay_near(np.zeros(0, dtype=np.int64), self.grain_count, e.chunk_count)

    def check_valid(self) -> None:
        """Raise RuntimeError where Taichi was started anew since the bed was made."""
        if self._generation != runtime.generation():
            raise RuntimeError(
                "this bed is no longer valid: Taichi was started anew with another precision, arch or number of threads"
            )

    def check_body(self, body: int) -> None:
        """Raise ValueError for a number that no body of the bed has."""
        self.check_valid()
        if not 0 <= body < int(self.engine.body_count[None]):
            raise ValueError(f"body = {body}: there is no such body in the bed")


def check_array(name: str, array: np.ndarray, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}, {shape} was expected")
    if not np.isfinite(array).all():
        row = int(np.argwhere(~np.isfinite(array))[0][0])
        raise ValueError(f"{name} holds a number that is not finite, in row {row}")


def _reach(material: Material, radius: float) -> float:
    """How far two grains of this effective radius [m] feel one another before they touch [m]; 0 but with JKR."""
    if material.cohesion != "jkr":
        return 0.0
    young, _ = effective_moduli(material.young, material.poisson, material.young, material.poisson)
    return jkr_range(surface_energy=material.surface_energy, radius=radius, effective_young=young)


def _rows_per_grain(radii: np.ndarray, skin: float, *, gpu: bool) -> tuple[float, float]:
    """Rows of the pair lists and near lists for a mean grain, to begin with; on a GPU a pair has two.

    Settled beds of sand have up to 3.8 in their fullest chunk, 4.7 with the largest skin; lists grow where it is more.
    """
    if not gpu:
        return PAIR_ROWS, NEAR_ROWS
    small, large = float(radii.min()), float(radii.max())
    # Caps of neighbours on a sphere: each takes a cone of half angle asin(r_s / (r_l + r_s + skin)).
    half = math.asin(small / (large + small + skin))
    return float(min(math.ceil(2 / (1 - math.cos(half))) * 9 // 16, 24)), NEAR_ROWS_ON_GPU
