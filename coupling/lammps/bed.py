"""A bed whose grains live in LAMMPS: what `BedGround` and the experiments use of `dem.Bed`, answered by LAMMPS.

The grains begin where those of a `dem.Bed` are, with velocities, spins and springs of contacts (`.springs`).
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from dem import Bed, BedFailure
from dem.contact.law import pair_row
from dem.engine.values import Grains
from dem.grains.materials import Facing, Material
from dem.grains.packing import bulk_packing, surface_height
from rigid.ground.reaction import State

from .law import WALL_TRIAL, MeanContact, kinetic_energy, law_words, spring_energy, spring_force
from .process import Lammps, cohesion_fault
from .regions import MovingBody, check_count, check_thickness, pieces_of
from .rolling import RollingClasses
from .springs import LayoutError, springs_of, with_springs
from .words import box_of, data_file, digits, spheres

__all__ = ["LammpsBed"]

Vector = np.ndarray
FLOOR = 0
STILL = 1e-5  # Mean kinetic energy of a bed at rest [m g d]
_SPELL, _MOST_SPELLS = 1.5, 60  # How long grains are left to come to rest at a time [sqrt(d / g)], how often at most
_FIRST = 0.5  # How long those are that kept their springs, at first [sqrt(d / g)]
_SKIN = 0.05  # Of the neighbour lists [d]
_SAME = 1e-9  # Relative difference of lengths that count as equal [1]
_COLUMNS = "id x y z xu yu zu vx vy vz omegax omegay omegaz fx fy fz"


class LammpsBed:
    """The grains of ``bed`` in LAMMPS on ``ranks`` processes, over the same floor, periodic in x and y.

    ``begin``: where LAMMPS' box begins along x [m]. A body does not reach across its ends.
    ``springs``: the number of contacts whose springs went over [1], and ``springs_fault`` why none did.

    Raises ValueError, naming it, for what has no counterpart: bodies that are already in the bed, a restitution below
    LAMMPS' dashpot, a cohesion that this LAMMPS refuses. Raises LammpsMissingError where LAMMPS cannot be started.
    """

    precision = "float64"
    more_loads = ""  # Loads of grains beside those by floor and bodies, in LAMMPS' words

    def __init__(self, bed: Bed, *, ranks: int, begin: float = 0.0) -> None:
        bodies = int(bed.state()["numbers"][1])
        if bodies != 1 or not bed.has_floor:
            raise ValueError(
                f"the bed has {bodies} bodies: for LAMMPS it needs its floor and no other body; prepare it anew"
            )
        refusal = cohesion_fault(bed.material.cohesion)
        if refusal is not None:
            raise ValueError(f"material {bed.material.name!r}: {refusal}")
        self.material: Material = bed.material
        self.size, self.height, self.gravity = bed.size, bed.height, bed.gravity
        self.time_step, self.grain_count, self.seed = bed.time_step, bed.grain_count, bed.seed
        self.recipe, self.surface, self.packing_fraction = bed.recipe, bed.surface, bed.packing_fraction
        self.mean_diameter, self.overlap_limit = bed.mean_diameter, bed.overlap_limit
        self.ranks, self.begin, self.tensile = ranks, float(begin), bed.settings.tensile
        self.runtime = bed.runtime  # What Taichi runs on: with the same it is not started anew, which ends `bed`
        self.steps = self.grain_steps = 0
        self._seen = 0.0  # Largest overlap that was seen, over the mean diameter of the pair [1]
        grains = bed.grains(contacts=False)
        self.radius, self.mass = grains.radius, grains.mass
        self.weight = float(self.mass.sum()) * math.hypot(*self.gravity)
        self._rows = [bed.state()["body_pair"][FLOOR].astype(float)]  # Pair parameters of floor and bodies
        self._grain_row = pair_row(self.material, tensile=self.tensile)
        self._mean = MeanContact.of(self.radius, self.mass)
        self._classes = RollingClasses(self._grain_row, self.material, self.radius, self.mass, more=self.more_loads)
        self._followed = 0  # Step from which on LAMMPS follows the loads of the grains
        self._bodies: list[MovingBody] = []
        self._sums, self._reactions = np.zeros(0), np.zeros((1, 6))
        self._set_up = False  # Whether LAMMPS is ready to go on without a setup
        self._worn = False  # Whether floor and bodies have had a setup
        self._lammps = Lammps(ranks)
        self._wears = self._wears_out()
        self._begin_anew(grains)
        self.springs, self.springs_fault = self._take_springs(bed)
        self._origin = self._dumped()[:, 4:7]

    def __repr__(self) -> str:
        grains = f"{self.grain_count} grains of {self.material.name!r}"
        return f"LammpsBed({grains} on {self.ranks} ranks, time {self.time:g} s)"

    # The box

    def _begin_anew(self, grains: Grains) -> None:
        """Read the grains, and give them law, floor and gravity."""
        deepest = 4 * float(self.radius.max())
        places = grains.position.copy()
        places[:, 0] = self.begin + (places[:, 0] - self.begin) % self.size[0]
        places[:, 1] %= self.size[1]
        box = box_of(*self.size[:2], self.height + deepest, low=(self.begin, 0.0, -deepest))
        atoms = spheres(self.radius, places, self.material.density, types=self._classes.of(self._loads(grains)))
        moving = [digits(row) for row in np.hstack([grains.velocity, grains.spin])]
        cells = np.floor(places / self.mean_diameter)  # neighbours lie near one another in memory, too
        text = data_file(box, atoms, moving, types=self._classes.count, order=np.lexsort(cells.T))
        (self._lammps.folder / "grains.data").write_text(text, encoding="ascii")
        self._lammps.tell([*self._head(), "read_data grains.data", *self._interactions()])

    def _take_springs(self, bed: Bed) -> tuple[int, str]:
        """Give the contacts in LAMMPS the springs of those in ``bed``; `springs` and `springs_fault`."""
        both = springs_of(bed, (self._grain_row, self._rows[FLOOR]))
        if not (stretched := sum(each.stretched for each in both)):
            return 0, ""
        self._prepare()  # LAMMPS finds its contacts
        raw, of_floor = self._lammps.kept(), self._mean.radius
        try:
            kept = with_springs(raw, *both, radii=self.radius, classes=self._classes, floor_radius=of_floor)
            self._begin_from(kept)
        except LayoutError as fault:
            return 0, str(fault)
        return stretched, ""

    def _wears_out(self) -> bool:
        """Whether a second setup changes the dashpots of walls (`coupling.lammps.law`)."""
        self._lammps.tell([*self._head(), *WALL_TRIAL, "run 0 post no"])
        before = self._lammps.ask("fcm(all,z)")
        self._lammps.tell(["run 0 post no"])
        after = self._lammps.ask("fcm(all,z)")
        self._lammps.tell(["clear"])
        return abs(after[0] - before[0]) > _SAME * abs(before[0])

    def _head(self) -> list[str]:
        # Where two grains change places in memory, LAMMPS turns the springs of rolling and twisting round, and they
        # push: what a contact has goes to the other grain with the sign of a force. So it does not sort them.
        return [
            "echo none", "units si", "atom_style sphere", "boundary p p f", "newton off", "comm_modify vel yes",
            "processors * * 1", "atom_modify sort 0 0.0",
        ]  # fmt: skip

    def _interactions(self) -> list[str]:
        """Commands for what a restart file does not hold reliably: law, floor, gravity, integrator, lists."""
        g = math.hypot(*self.gravity)
        floor = self._wall_words(self._rows[FLOOR], bodies=bool(self._bodies))
        return [
            f"neighbor {_SKIN * self.mean_diameter:.17g} bin", "neigh_modify delay 0 every 1 check yes",
            "pair_style granular", *self._classes.pairs(tensile=self.tensile),
            "fix motion all nve/sphere", f"fix pull all gravity {g:.17g} vector {digits(self.gravity)}",
            f"fix floor all wall/gran granular {floor} zplane 0.0 NULL contacts",
            "compute floor all reduce sum f_floor[2] f_floor[3] f_floor[4]",
            f"timestep {self.time_step:.17g}",
            "thermo_style custom step", "thermo_modify lost error norm no", *self._classes.watch(),
        ]  # fmt: skip

    def _wall_words(self, row: Sequence[float], *, bodies: bool) -> str:
        """The same of floor or body. With ``bodies`` in the bed `_prepare` makes two setups."""
        setups = 2 if bodies and self._wears else 1
        return law_words(row, self.material, tensile=self.tensile, mean=self._mean, setups=setups)

    # The bodies

    def add_body(self, shape: Any, *, position: Sequence[float], **facing: Any) -> int:
        """Put a body into the bed and return its number (`dem.Bed.add_body`).

        Raises ValueError for shapes that LAMMPS' regions cannot have, and for too many bodies.
        """
        pieces = pieces_of(shape)
        check_thickness(pieces, float(self.radius.max()))
        check_count([*pieces, *(piece for body in self._bodies for piece in body.pieces)])
        faced = Facing(**facing)
        faced.refuse_for(self.material)
        row = pair_row(self.material, faced, tensile=self.tensile)
        words = self._wall_words(row, bodies=True)
        number = len(self._bodies) + 1
        self._bodies.append(MovingBody(number, pieces, words, np.array(position, dtype=float)))
        self._rows.append(np.array(row))
        self._reactions = np.zeros((number + 1, 6))
        self._set_up = False
        return number

    def move_body(self, body: int, **changes: Any) -> None:
        """Set a body's pose and motion, of which what is not given stays (`dem.Bed.move_body`)."""
        moved = self._body(body)
        names = ("position", "velocity", "turn", "spin")
        moved.place(*(np.asarray(changes.get(name, getattr(moved, name)), dtype=float) for name in names))

    def move_bodies(
        self, bodies: Sequence[int], *, positions: Vector, velocities: Vector, turns: Vector, spins: Vector
    ) -> None:
        """Set the pose and motion of several bodies at once (`dem.Bed.move_bodies`)."""
        for body, *values in zip(bodies, positions, velocities, turns, spins, strict=True):
            self._body(body).place(*values)

    def _body(self, body: int) -> MovingBody:
        if not 1 <= body <= len(self._bodies):
            raise ValueError(f"body = {body}: there is no such body in the bed")
        return self._bodies[body - 1]

    def body_position(self, body: int) -> Vector:
        """Position of a body's origin [m], shape [3]."""
        return self._body(body).position.copy()

    def body_turn(self, body: int) -> Vector:
        """Rotation of a body: a unit quaternion, scalar first, shape [4]."""
        return self._body(body).turn.copy()

    def pair_of(self, body: int) -> Vector:
        """Pair parameters of a grain and this body (`dem.contact.law.pair_parameters`)."""
        return self._rows[body]

    # Time

    @property
    def time(self) -> float:
        """Time since the grains are in LAMMPS [s]."""
        return self.steps * self.time_step

    @property
    def awake_count(self) -> int:
        """Number of grains that are computed: all."""
        return self.grain_count

    def advance(self, steps: int = 1, *, drag_time: float = math.inf) -> None:
        """Advance by a number of time steps (`dem.Bed.advance`).

        Raises ValueError for a drag, which is not passed on to LAMMPS. Raises LammpsEndedError where LAMMPS ends, as
        when a rank is killed, a grain leaves the box or a number is not a number.
        """
        if math.isfinite(drag_time):
            raise ValueError(f"drag_time = {drag_time} s: a bed in LAMMPS has no drag")
        duration = steps * self.time_step
        self._prepare()
        commands = [line for body in self._bodies for line in body.motion(self.steps)]
        for body in self._bodies:
            self._check_inside(body, duration)
            commands += body.select(duration, self.mean_diameter)
        self._lammps.tell([*commands, *self._classes.runs(self.steps, steps, self._followed)])
        self.steps += steps
        self.grain_steps += steps * self.grain_count
        for body in self._bodies:
            body.go_on(duration)
        before, self._sums = self._sums, self._read_sums()
        mean = (self._sums - before) / max(1, steps)
        self._reactions = self._by_body(mean)

    def _prepare(self) -> None:
        """Make the bodies that are new, and have LAMMPS set up its lists and forces; nothing where that is done."""
        if self._set_up and all(body.made and not body.jumped for body in self._bodies):
            return
        for body in self._bodies:
            if not body.seats:  # it has not been moved yet
                body.place(body.position, body.velocity, body.turn, body.spin)
        if self._worn and self._wears:
            self.restore(self.state())  # floor and bodies are made anew, with the history of their contacts
        new = [line for body in self._bodies if not body.made for line in body.create()]
        late, now = ([line for body in self._bodies for line in body.motion(self.steps, late=k)] for k in (1, 0))
        names = [name for body in self._bodies for name in body.names]
        self._lammps.tell([*(["unfix sums"] if self._sums.size else []), *late, *new, *self._classes.walls(names)])
        if names:
            # LAMMPS takes a region's velocity from its place a step before. So a setup with the bodies there comes
            # first, in which they touch nothing, lest contacts end.
            chosen = [line for body in self._bodies for line in body.select(0.0, self.mean_diameter)]
            self._lammps.tell([*(f"group {name} clear" for name in names), "run 0 post no", *now, *chosen])
        counted = " ".join(f"c_{name}[*]" for name in ["floor", *names])
        self._lammps.tell([f"fix sums all ave/time 1 1 1 {counted} ave running", "run 0 post no"])
        for body in self._bodies:
            body.jumped = False
        self._sum_start = self.steps
        self._sums, self._set_up, self._worn = self._read_sums(), True, True

    def _read_sums(self) -> Vector:
        """Sums over the steps since `_prepare` of forces and moments on grains [N, N m]: the floor's, each piece's.

        LAMMPS gives means over all steps so far, the first one included.
        """
        count = 3 + 6 * sum(len(body.names) for body in self._bodies)
        means = self._lammps.ask(*(f"f_sums[{k}]" for k in range(1, count + 1)))
        return np.array(means) * (self.steps - self._sum_start + 1)

    def _by_body(self, mean: Vector) -> Vector:
        """Force and moment on floor and bodies [N, N m], shape [body, 6], of the means over their pieces."""
        found = np.zeros((len(self._bodies) + 1, 6))
        found[FLOOR, :3] = -mean[:3]
        at = 3
        for k, body in enumerate(self._bodies, 1):
            for _ in body.names:
                found[k] -= mean[at : at + 6]
                at += 6
        return found

    def _check_inside(self, body: MovingBody, duration: float) -> None:
        """Raise BedFailure where what may touch grains in the next ``duration`` [s] reaches across an end of the box.

        LAMMPS' regions are not periodic. A body of one section all along y may be as wide as the bed.
        """
        travel = body.travel(duration)
        low, high = body.extent(self.surface + self.mean_diameter + float(travel[2]))
        if body.spans and low[1] <= _SAME * self.size[1] and high[1] >= (1 - _SAME) * self.size[1]:
            low[1], high[1] = math.inf, -math.inf
        for axis, begin in ((0, self.begin), (1, 0.0)):
            margin = float(self.radius.max() + travel[axis])
            if low[axis] - margin < begin or high[axis] + margin > begin + self.size[axis]:
                raise BedFailure(
                    f"a body at {'xy'[axis]} = {body.position[axis]:.4g} m, from {low[axis]:.4g} to "
                    f"{high[axis]:.4g} m, reaches with a grain's radius across the end of the bed in LAMMPS, from "
                    f"{begin:.4g} to {begin + self.size[axis]:.4g} m: use a longer or wider bed"
                )

    def reactions(self) -> Vector:
        """Mean force [N] and torque about its origin [N m] of the last `advance` on each body, shape [body, 6]."""
        return self._reactions

    def reaction(self, body: int) -> tuple[Vector, Vector]:
        """The same of one body."""
        return self._reactions[body][:3], self._reactions[body][3:]

    def settle(self, tell: Callable[[float, float], None] | None = None) -> float:
        """Let the grains come to rest with all bodies fixed; return the time that it took [s], little with springs.

        Rest is that of a prepared bed: mean kinetic energy below 1e-5 m g d. ``tell``: called from time to time with
        the time so far [s] and the kinetic energy over that of rest [1]. Raises RuntimeError where they do not rest.
        """
        unit = math.sqrt(self.mean_diameter / math.hypot(*self.gravity))
        spell, began = math.ceil(_SPELL * unit / self.time_step), self.steps
        limit = STILL * self.weight * self.mean_diameter
        looks = [math.ceil(_FIRST * unit / self.time_step)] * (self.springs > 0) + [spell] * _MOST_SPELLS
        for steps in looks:
            self.advance(steps)
            energy = self.kinetic_energy
            if tell is not None:
                tell((self.steps - began) * self.time_step, energy / limit)
            if energy < limit:
                break
        else:
            raise RuntimeError(f"the bed in LAMMPS did not come to rest in {_MOST_SPELLS * _SPELL * unit:.3g} s")
        taken, grains = (self.steps - began) * self.time_step, self.grains(contacts=False)
        area = self.size[0] * self.size[1]
        self.packing_fraction = bulk_packing(grains.position[:, 2], self.radius, area)
        self.surface = surface_height(grains.position[:, 2], self.radius, area, bulk=self.packing_fraction)
        return taken

    def take_surface(self, state: State) -> None:
        """Take the surface and packing of a `state` that is restored later; its grains need not come to rest first."""
        self.surface, self.packing_fraction = (float(number) for number in np.asarray(state["numbers"])[2:])

    # What the grains do

    def _dumped(self) -> Vector:
        """Rows of _COLUMNS of all grains, by id, shape [grain_count, 16]."""
        self._prepare()
        found = self._lammps.dump("all", _COLUMNS)
        if len(found) != self.grain_count:
            raise BedFailure(f"LAMMPS has {len(found)} grains of {self.grain_count}: the others left the box")
        return found

    def grains(self, *, contacts: bool = True) -> Grains:
        """The grains now, in the order of ids (`dem.Bed.grains`); ``contacts``: with how many each has."""
        rows = self._dumped()
        position = rows[:, 1:4].copy()
        position[:, :2] %= np.array(self.size[:2])
        count = np.zeros(0, dtype=np.int32)
        if contacts:
            first, second, _ = self._look(position)
            count = np.bincount(np.concatenate([first, second]), minlength=self.grain_count).astype(np.int32)
            count += position[:, 2] < self.radius
        return Grains(
            np.arange(self.grain_count), position, self.radius, self.mass, rows[:, 7:10], rows[:, 10:13],
            rows[:, 13:16], rows[:, 4:7] - self._origin, count,
        )  # fmt: skip

    def _touching(self, position: Vector) -> tuple[Vector, Vector, Vector]:
        """Pairs of grains that overlap, and by how much [m], shape [pair] each."""
        inside = position.copy()
        period = np.array(self.size[:2])
        inside[:, :2] %= period
        inside[:, :2][inside[:, :2] >= period] = 0.0  # the remainder of a number just below 0 rounds to the period
        inside[:, 2] -= inside[:, 2].min()
        tree = cKDTree(inside, boxsize=(*period, 0.0))
        pairs = tree.query_pairs(2 * float(self.radius.max()), output_type="ndarray")
        apart = inside[pairs[:, 0]] - inside[pairs[:, 1]]
        apart[:, :2] -= period * np.round(apart[:, :2] / period)
        overlap = self.radius[pairs].sum(axis=1) - np.linalg.norm(apart, axis=1)
        touching = overlap > 0
        return pairs[touching, 0], pairs[touching, 1], overlap[touching]

    def _loads(self, grains: Grains) -> Vector:
        """Load of each grain as `.rolling` has it, by the springs of grains and floor [N m], shape [grain_count]."""
        first, second, overlap = self._touching(grains.position)
        r_1, r_2 = self.radius[first], self.radius[second]
        force = spring_force(self._grain_row, self.material.cohesion, overlap, r_1 * r_2 / (r_1 + r_2))
        half = 0.5 * (r_1 + r_2 - overlap) * force
        height = grains.position[:, 2]
        pressed = np.maximum(0.0, self.radius - height)
        floor = height * spring_force(self._rows[FLOOR], self.material.cohesion, pressed, self.radius) * (pressed > 0)
        return sum((np.bincount(side, half, self.grain_count) for side in (first, second)), floor)

    def _look(self, position: Vector) -> tuple[Vector, Vector, Vector]:
        """`_touching`, with the largest overlap kept. Raises BedFailure where an overlap is past the bound."""
        first, second, overlap = self._touching(position)
        largest = float((overlap / (self.radius[first] + self.radius[second])).max(initial=0.0))
        self._seen = max(self._seen, largest)
        if largest > self.overlap_limit:
            raise BedFailure(
                f"an overlap of {100 * largest:.3g} % of a diameter went past its bound of "
                f"{100 * self.overlap_limit:g} % before t = {self.time:.6g} s; make the grains stiffer (young = "
                f"{self.material.young:.3g} Pa now) or the bound larger"
            )
        return first, second, overlap

    @property
    def max_overlap(self) -> float:
        """Largest overlap over mean diameter of the pair [1] that was seen since this was set, now included."""
        self._look(self._dumped()[:, 1:4])
        return self._seen

    @max_overlap.setter
    def max_overlap(self, value: float) -> None:
        self._seen = float(value)

    def spring_energy(self, position: Vector) -> float:
        """What the normal springs of grains hold with their centres there [J] (`coupling.lammps.law.spring_energy`)."""
        first, second, overlap = self._look(position)
        r_1, r_2 = self.radius[first], self.radius[second]
        pressed = np.maximum(0.0, self.radius - position[:, 2])
        law = self.material.cohesion
        return spring_energy(self._grain_row, law, overlap, r_1 * r_2 / (r_1 + r_2)) + spring_energy(
            self._rows[FLOOR], law, pressed, self.radius
        )

    @property
    def kinetic_energy(self) -> float:
        """Kinetic energy of the grains [J], of translation and rotation."""
        rows = self._dumped()
        return kinetic_energy(self.mass, self.radius, rows[:, 7:10], rows[:, 10:13])

    def momentum(self) -> Vector:
        """Momentum of the grains [N s], shape [3], half a step ahead, as the forces bring it (`dem.Bed.momentum`)."""
        self._prepare()
        return np.array(self._lammps.ask(*(f"mass(all)*vcm(all,{axis})+0.5*dt*fcm(all,{axis})" for axis in "xyz")))

    def track_contact_work(self) -> None:
        """Nothing: LAMMPS does not sum the work of contacts (`LammpsGround.work_taken`)."""

    def mark_origin(self) -> None:
        """Count the displacements of the grains from here on."""
        self._origin = self._dumped()[:, 4:7]

    # What is kept

    def state(self) -> State:
        """LAMMPS' restart file, as bytes, and where the bodies are: what `restore` goes on from.

        The run goes on to the same motion but for rounding, since LAMMPS makes new lists in another order.
        """
        rows = [[*body.position, *body.velocity, *body.turn, *body.spin, body.angle, *body.base.ravel(), body.made]
                for body in self._bodies]  # fmt: skip
        return {
            "restart": np.frombuffer(self._lammps.kept(), dtype=np.uint8).copy(),
            "bodies": np.array(rows, dtype=float).reshape(-1, 24),
            "numbers": np.array([self.steps, self.grain_steps, self.surface, self.packing_fraction]),
            "origin": self._origin.copy(),
        }

    def restore(self, state: State) -> None:
        """Go on from what `state` gave. Raises ValueError for the state of other bodies, or of an earlier version."""
        rows = np.asarray(state["bodies"], dtype=float)
        if rows.size and rows.shape[1] != 24:
            raise ValueError("the checkpoint of this bed in LAMMPS is of an earlier version: run it anew")
        if len(rows) != len(self._bodies):
            raise ValueError(f"the state has {len(rows)} bodies, this bed has {len(self._bodies)}")
        steps, grain_steps, self.surface, self.packing_fraction = (float(x) for x in np.asarray(state["numbers"]))
        self.steps, self.grain_steps = int(steps), int(grain_steps)
        self._origin = np.array(state["origin"], dtype=float)
        commands: list[str] = []
        for body, row in zip(self._bodies, rows, strict=True):
            commands += body.take_up(row[:-1], self.steps)
            if row[-1]:
                commands += body.create()
        self._begin_from(np.asarray(state["restart"], dtype=np.uint8).tobytes(), commands)
        self._followed = self.steps

    def _begin_from(self, kept: bytes | bytearray, commands: Sequence[str] = ()) -> None:
        """Have LAMMPS begin from these bytes, and then carry out these commands."""
        head = (line for line in self._head() if not line.startswith(("units", "atom_style", "boundary")))
        self._lammps.begin_from(kept, before=["clear", *head], after=[*self._interactions(), *commands])
        self._sums, self._set_up, self._worn = np.zeros(0), False, False

    def close(self) -> None:
        """End LAMMPS."""
        self._lammps.close()

    @property
    def processes(self) -> list[int]:
        """Process ids of mpiexec and LAMMPS."""
        return self._lammps.processes
