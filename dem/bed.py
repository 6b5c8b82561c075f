"""The bed: grains, the bodies among them, and the clock. The one class a user meets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import holding, runtime, state
from .cohesion import COHESIONS, jkr_range
from .contact import effective_moduli, pair_parameters
from .engine import MOST_PRIMITIVES, take_engine
from .holding import Held
from .ledger import PARTS, TURNED
from .lists import MOST_BODIES
from .materials import Facing, Material
from .materials import material as find_material
from .measure import bulk_packing, surface_height
from .shapes import Plane
from .sleep import Sleep, Sleeper
from .solids import AnyShape
from .stress import find_contacts
from .timestep import time_step_for

__all__ = ["Bed", "BedFailure"]

# Skin over mean diameter: first guess and bounds. It adapts to how often lists are made.
_SKIN, _LEAST_SKIN, _LARGEST_SKIN = 0.06, 0.02, 0.15
# A rebuild costs about as much as this many steps, and a skin of one diameter would add about this share to a step.
_REBUILD_STEPS, _SKIN_COST = 4.0, 1.2
FLOOR = 0


class BedFailure(RuntimeError):  # noqa: N818 - the name in the architecture
    """The bed cannot go on: a number is not a number, a grain was lost, or an overlap went past its bound.

    ``reason`` says which; the bed keeps the state in which it was found, so that it can be saved and looked at.
    """

    def __init__(self, reason: str):
        super().__init__(reason)
        self.reason = reason


class Bed:
    """Spherical grains on a floor at z = 0, periodic in x and y, open above.

    Make one with ``Bed.prepare`` (rained, levelled, settled), ``Bed.from_grains`` (positions of one's own) or
    ``Bed.load``. Lengths in m, times in s, z up. Positions and the like come in the order of grain ids.

    Attributes:
        max_overlap: largest overlap over mean diameter of the pair since the bed was made; set it to 0 to start anew.
        grain_steps: grains computed, summed over the steps since the bed was made in this process.
        recipe: what it was prepared from, as ``prepare_bed`` was asked; empty where it was made otherwise.
        overlap_limit: the bound on it; ``advance`` raises BedFailure past it.
    """

    @classmethod
    def prepare(cls, material: str | Material, **options: Any) -> Bed:
        """A bed rained in, levelled and settled; see ``dem.prepare.prepare_bed`` for the options."""
        from .prepare import prepare_bed

        return prepare_bed(material, **options)

    @classmethod
    def from_grains(
        cls,
        material: str | Material,
        *,
        positions: np.ndarray,
        radii: np.ndarray,
        size: Sequence[float],
        velocities: np.ndarray | None = None,
        spins: np.ndarray | None = None,
        height: float | None = None,
        gravity: float | Sequence[float] = 9.81,
        young: float | None = None,
        max_overlap: float = 0.05,
        time_step: float | None = None,
        floor: bool | Facing = True,
        tensile: bool = False,
        seed: int | None = None,
        precision: str = "float64",
        arch: str = "cpu",
        threads: int | None = None,
    ) -> Bed:
        """A bed of given grains.

        Args:
            material: a name or a Material.
            positions: centres [m], shape [grain_count, 3].
            radii: [m], shape [grain_count].
            size: lateral periods and nominal depth (x, y, z) [m].
            velocities: [m/s], shape [grain_count, 3]; at rest when None.
            spins: angular velocities [rad/s], shape [grain_count, 3].
            height: top of the box [m]; a grain above it is lost. Twice the highest grain when None.
            gravity: downwards [m/s2], or a vector.
            young: Young's modulus of the (softened) grains [Pa]; the material's own when None.
            max_overlap: bound on overlap over diameter, from the start on; the time step is chosen for it.
            time_step: [s]; at most ``dem.timestep.longest_step``. When None an eighth of the contact time, or for
                strongly damped grains the longest that is stable where that is shorter.
            floor: whether there is a floor at z = 0; a Facing where grains touch it otherwise than one another.
            tensile: whether the damping may pull at the end of a contact (as LIGGGHTS does by default).
            precision, arch, threads: see ``dem.runtime.start``.

        Raises:
            ValueError: arrays of wrong shape, numbers that are not finite, a negative size, a step too long, a bed
                narrower than three grains, grains that overlap one another or the floor by more than ``max_overlap``,
                grains outside the box.
        """
        stuff = find_material(material)
        if young is not None:
            stuff = stuff.softened(float(young))
        positions = np.asarray(positions, dtype=float)
        radii = np.asarray(radii, dtype=float)
        n = len(radii)
        _check_array("radii", radii, (n,))
        if n == 0 or not (radii > 0).all():
            raise ValueError("radii must be positive and there must be at least one grain")
        _check_array("positions", positions, (n, 3))
        velocities = np.zeros((n, 3)) if velocities is None else np.asarray(velocities, dtype=float)
        spins = np.zeros((n, 3)) if spins is None else np.asarray(spins, dtype=float)
        _check_array("velocities", velocities, (n, 3))
        _check_array("spins", spins, (n, 3))
        if len(size) != 3 or not all(math.isfinite(s) and s > 0 for s in size):
            raise ValueError(f"size = {tuple(size)} must be three positive lengths [m]")
        if not 0 < max_overlap <= 0.2:
            raise ValueError(f"max_overlap = {max_overlap} must be above 0 and at most 0.2 of a diameter")
        dt = time_step_for(stuff, diameter=2 * float(radii.min()), max_overlap=max_overlap, wanted=time_step)
        top, lowest = float((positions[:, 2] + radii).max()), int(positions[:, 2].argmin())
        if positions[lowest, 2] < (bottom := -4 * float(radii.max())):
            raise ValueError(
                f"positions: grain {lowest} begins at z = {positions[lowest, 2]:.4g} m, below the box, which reaches "
                f"down to {bottom:.4g} m (the floor is at 0); put it higher"
            )
        settings = {
            "material": stuff,
            "size": tuple(float(s) for s in size),
            "gravity": _vector(gravity),
            "time_step": dt,
            "max_overlap": float(max_overlap),
            "height": float(height) if height is not None else 2 * top + 20 * float(radii.max()),
            "tensile": bool(tensile),
            "seed": seed,
        }
        if not top <= settings["height"] < math.inf:
            raise ValueError(f"height = {height} m is no length, or below the highest grain's top at {top:.4g} m")
        bed = cls(settings, radii, precision=precision, arch=arch, threads=threads)
        mass = stuff.density * 4 / 3 * math.pi * radii**3
        bed._fill(positions, velocities, spins, radii, mass)
        if floor:
            bed._add([Plane()], (0.0, 0.0, 0.0), floor if isinstance(floor, Facing) else Facing())
        bed._make_lists()
        bed._push()
        bed._refuse_overlaps()
        bed._shift_velocities(-0.5)  # half a step behind the positions, where the leapfrog wants them
        bed.measure_surface()
        return bed

    def __init__(self, settings: dict[str, Any], radii: np.ndarray, *, precision: str, arch: str, threads: int | None):
        """Not for users: ``from_grains`` and the like check what they pass."""
        self._runtime = runtime.start(arch=arch, threads=threads, precision=precision)
        self._generation = runtime.generation()
        import taichi as ti

        self._ti = ti
        self._settings = settings
        stuff: Material = settings["material"]
        self.material = stuff
        self.size = settings["size"]
        self.gravity = settings["gravity"]
        self.time_step = settings["time_step"]
        self.overlap_limit = settings["max_overlap"]
        self.seed = settings["seed"]
        self.steps = 0
        self.list_count = 0
        self.grain_count = len(radii)
        # The same to the bit in whatever order the grains come, as a bed taken up again has them in another.
        self._diameter = 2 * math.fsum(radii) / self.grain_count
        self._skin = _SKIN * self._diameter
        self._since_lists = 0
        self._reaction_steps = 0
        self._tallied: np.ndarray | None = None
        self._sleeper: Sleeper | None = None
        self.grain_steps = 0
        self._has_floor = False
        self.recipe: dict[str, Any] = {}
        self.surface = math.nan
        self.packing_fraction = math.nan
        young, shear = effective_moduli(stuff.young, stuff.poisson, stuff.young, stuff.poisson)
        reach = _reach(stuff, float(radii.max()) / 2, young)
        self._engine = take_engine(
            self,
            grain_count=self.grain_count,
            period=self.size[:2],
            bottom=-4 * float(radii.max()),
            height=settings["height"],
            largest_diameter=2 * float(radii.max()),
            largest_skin=_LARGEST_SKIN * self._diameter + reach,
            rolling=stuff.rolling_friction > 0,
            tensile=settings["tensile"],
            cohesion=COHESIONS[stuff.cohesion],
            real=ti.f64 if precision == "float64" else ti.f32,
            gpu=arch == "cuda",
            threads=self._runtime.threads,
            neighbours_per_grain=_room(radii, _LARGEST_SKIN * self._diameter + reach, gpu=arch == "cuda"),
        )
        self._engine.grain_pair[None] = pair_parameters(
            effective_young=young,
            effective_shear=shear,
            restitution=stuff.restitution,
            friction=stuff.friction,
            rolling_friction=stuff.rolling_friction,
            surface_energy=stuff.surface_energy,
            tensile=settings["tensile"],
        )
        turn = np.zeros((MOST_BODIES, 4))
        turn[:, 0] = 1
        self._engine.write("body_turn", turn.astype(self._runtime.dtype))

    # ------------------------------------------------------------------ bodies

    def add_body(
        self,
        shape: AnyShape | Sequence[AnyShape],
        *,
        position: Sequence[float],
        friction: float | None = None,
        restitution: float | None = None,
        rolling_friction: float | None = None,
        young: float | None = None,
        poisson: float = 0.3,
        surface_energy: float | None = None,
    ) -> int:
        """Put a body among the grains and return its number. It moves as it is told; see ``move_body``.

        Args:
            shape: one or several of dem's Ball, Cylinder, Cone, Capsule, Box, Tube, Polyhedron, Mesh, Plane and Placed,
                in the body's frame; their union is the body, and touches a grain once. What lies farther sideways from
                the body's origin than half the bed's period touches nothing.
            position: of the body's origin [m].
            friction, restitution, rolling_friction: of a grain on the body; the grains' own when None.
            young, poisson: of the body; rigid when None. [Pa], [1].
            surface_energy: of a grain and the body [J/m2], see ``dem.Facing``; the grains' own when None.

        Raises:
            ValueError: no shape, a number that no pair can have, too many bodies, a grain already in contact by more
                than the overlap bound.
        """
        self._check_valid()
        facing = Facing(
            friction=friction,
            restitution=restitution,
            rolling_friction=rolling_friction,
            young=young,
            poisson=poisson,
            surface_energy=surface_energy,
        )
        body = self._add(shape, position, facing)
        kept = self.max_overlap
        self.max_overlap = 0.0
        self._make_lists()
        self._push()
        found = self.max_overlap
        if found > self.overlap_limit:
            self._engine.body_count[None] = body
            self._engine.drop_shapes(int(self._engine.body_primitives[body][0]))
            self._make_lists()
            self.max_overlap = kept
            self._push()
            raise ValueError(
                f"the body at {tuple(position)} m starts in overlap with a grain by {100 * found:.2g} % of its "
                f"diameter (the bound is {100 * self.overlap_limit:g} %); start it higher"
            )
        self.max_overlap = max(kept, found)
        return body

    def _add(self, shape: AnyShape | Sequence[AnyShape], position: Sequence[float], facing: Facing) -> int:
        e = self._engine
        parts: list[Any] = [shape] if isinstance(shape, AnyShape) else list(shape)
        body = int(e.body_count[None])
        used = int(e.body_primitives[body - 1][1]) if body else 0
        if not parts:
            raise ValueError("shape is empty; a body needs at least one primitive")
        for part in parts:
            if not isinstance(part, AnyShape):
                raise ValueError(
                    f"shape holds {part!r}, which is no shape; use Ball, Cylinder, Cone, Capsule, Box, Tube, "
                    f"Polyhedron, Mesh, Plane or Placed"
                )
        if len(position) != 3 or not all(math.isfinite(p) for p in position):
            raise ValueError(f"position = {tuple(position)} must be 3 finite numbers [m]")
        if body >= MOST_BODIES or used + len(parts) > MOST_PRIMITIVES:
            raise ValueError(f"a bed takes at most {MOST_BODIES} bodies of {MOST_PRIMITIVES} primitives in all")
        self._face(body, facing)
        e.put_shapes(used, parts)
        e.body_primitives[body] = [used, used + len(parts)]
        e.body_extent[body] = min(1e35, max(p.extent() for p in parts))
        e.body_position[body] = [float(p) for p in position]
        e.body_velocity[body] = [0.0, 0.0, 0.0]
        e.body_spin[body] = [0.0, 0.0, 0.0]
        e.body_turn[body] = [1.0, 0.0, 0.0, 0.0]
        e.body_count[None] = body + 1
        if body == FLOOR and any(isinstance(p, Plane) for p in parts):
            self._has_floor = True
        return body

    def _face(self, body: int, facing: Facing) -> None:
        """How grains touch a body, from now on. Raises ValueError as ``Facing.refuse_for`` does."""
        stuff = self.material
        facing.refuse_for(stuff)
        star, shear = effective_moduli(
            stuff.young,
            stuff.poisson,
            math.inf if facing.young is None else facing.young,
            stuff.poisson if facing.young is None else facing.poisson,
        )
        self._engine.body_pair[body] = pair_parameters(
            effective_young=star,
            effective_shear=shear,
            restitution=_or(facing.restitution, stuff.restitution),
            friction=_or(facing.friction, stuff.friction),
            rolling_friction=_or(facing.rolling_friction, stuff.rolling_friction),
            surface_energy=_or(facing.surface_energy, stuff.surface_energy),
            tensile=self._settings["tensile"],
        )

    def move_body(
        self,
        body: int,
        *,
        position: Sequence[float] | None = None,
        velocity: Sequence[float] | None = None,
        turn: Sequence[float] | None = None,
        spin: Sequence[float] | None = None,
    ) -> None:
        """Set a body's pose and the velocity that it holds while the bed advances.

        Args:
            position: of its origin [m]. velocity: [m/s].
            turn: unit quaternion, scalar first. spin: angular velocity [rad/s].

        Raises:
            ValueError: a body that is not there, numbers that are not finite, a turn that is not of length 1.
        """
        self._check_body(body)
        e = self._engine
        for name, value, width in (
            ("body_position", position, 3),
            ("body_velocity", velocity, 3),
            ("body_turn", turn, 4),
            ("body_spin", spin, 3),
        ):
            if value is not None:
                numbers = [float(v) for v in value]
                if len(numbers) != width or not all(map(math.isfinite, numbers)):
                    raise ValueError(f"{name[5:]} = {tuple(value)} must be {width} finite numbers")
                if name == "body_turn":
                    _refuse_turns("turn", np.array([numbers]))
                getattr(e, name)[body] = numbers

    def move_bodies(
        self,
        bodies: Sequence[int],
        *,
        positions: np.ndarray,
        velocities: np.ndarray,
        turns: np.ndarray,
        spins: np.ndarray,
    ) -> None:
        """Several bodies at once, as ``move_body`` does one: quicker, where a platform has many.

        Args:
            bodies: their numbers. positions, velocities, spins: [m], [m/s], [rad/s], each of shape [body, 3].
            turns: unit quaternions, scalar first, shape [body, 4].

        Raises:
            ValueError: a body that is not there, numbers that are not finite, a wrong shape, a turn not of length 1.
        """
        self._check_valid()
        count = int(self._engine.body_count[None])
        if not all(0 <= body < count for body in bodies):
            raise ValueError(f"bodies = {list(bodies)}: the bed has bodies 0 to {count - 1}")
        n = len(bodies)
        given = {"positions": positions, "velocities": velocities, "turns": turns, "spins": spins}
        for name, values in given.items():
            _check_array(name, np.asarray(values, dtype=float), (n, 4 if name == "turns" else 3))
        _refuse_turns("turns", np.asarray(turns, dtype=float))
        self._engine.place_bodies(np.array(bodies, dtype=np.int32), np.hstack(list(given.values())).astype(float))

    def body_position(self, body: int) -> np.ndarray:
        """Where a body's origin is [m], shape [3]."""
        self._check_body(body)
        return np.array(self._engine.body_position[body], dtype=float)

    def body_turn(self, body: int) -> np.ndarray:
        """How a body is turned: a unit quaternion, scalar first, shape [4]."""
        self._check_body(body)
        return np.array(self._engine.body_turn[body], dtype=float)

    def reaction(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        """Force [N] and torque about the body's origin [N m] from the grains, each of shape [3].

        The mean over the last ``advance``: the impulse divided by the time.
        """
        self._check_body(body)
        row = self.reactions()[body]
        return row[:3], row[3:]

    def reactions(self) -> np.ndarray:
        """What ``reaction`` gives, of every body there may be: force and torque in a row of six, shape [body, 6]."""
        if self._tallied is None:
            self._tallied = self._tally()[0]
        total = self._tallied
        if self._sleeper is not None:
            total = total.copy()
            total[FLOOR, :3] += self._sleeper.on_floor()
        return total / max(1, self._reaction_steps)

    # ------------------------------------------------------------------ sleep

    def let_sleep(self, rules: Sleep | None = None) -> None:
        """From here on grains at rest far from the bodies are not computed; ``dem.sleep`` has the rules.

        What is read of the bed counts sleepers in, with no speed and no force. The floor's reaction has what they
        would have passed on to it.

        Raises:
            ValueError: a bed on a GPU, without floor or gravity, or whose grains cohere by JKR.
        """
        self._check_valid()
        if self._engine.gpu:
            raise ValueError("arch = 'cuda': grains sleep on a CPU only so far")
        if not self._has_floor or not any(self.gravity):
            raise ValueError("grains sleep in a bed with a floor and gravity only: they must lie on something")
        if self.material.cohesion == "jkr":
            raise ValueError("cohesion = 'jkr': the force that wakes such grains is not measured; dmt or none would do")
        self.wake()
        self._engine.let_sleep()
        self._sleeper = Sleeper(self, rules or Sleep())

    def wake(self) -> None:
        """All grains are awake and stay so."""
        self._check_valid()
        if self._sleeper is not None:
            self._make_lists(all_awake=True)
            self._sleeper = None
            self._engine.wake_all()
            self._push()

    @property
    def awake_count(self) -> int:
        """Grains that are computed."""
        return self.grain_count if self._sleeper is None else self._sleeper.awake

    @property
    def asleep(self) -> np.ndarray:
        """Whether each grain sleeps, by id, bool, shape [grain_count]."""
        if self._sleeper is None:
            return np.zeros(self.grain_count, dtype=bool)
        return np.asarray(self._engine.rest.asleep.to_numpy()[: self.grain_count] == 1)

    def _tally(self) -> tuple[np.ndarray, float]:
        """Sums over the chunks of what grains did to the bodies, shape [body, 6]; the largest overlap."""
        rows = np.zeros((MOST_BODIES + 1, 6))
        self._engine.tally(rows)
        return rows[:-1], float(rows[-1, 0])

    # ------------------------------------------------------------------ the book of what is lost

    def keep_book(self) -> None:
        """From here on what contacts take is summed (``work_taken``), from 0; about a fifth more time a step.

        A drag (``advance``) is not in it.
        """
        self._check_valid()
        self._engine.open_ledger(self.gravity)

    @property
    def work_taken(self) -> dict[str, float]:
        """Work done against the contacts of grains, bodies and floor since ``keep_book`` [J], by ``dem.ledger``.

        damping: against normal dashpots, all of it lost. tangential, turning: against tangential forces, and against
        rolling and twisting torques; less what their springs hold more than then (``dem.energy.bed_energies``) it is
        lost too.

        Raises:
            ValueError: no book is kept.
        """
        if not self._engine.ledger.on:
            raise ValueError("this bed keeps no book of what contacts take: keep_book() opens it")
        return dict(zip(PARTS, self._engine.ledger.sums().tolist(), strict=True))

    def momentum(self) -> np.ndarray:
        """Of the grains [N s], shape [3], with the velocities half a step ahead, where the forces so far bring them."""
        v, f = self._of_those_awake("velocity", "force")
        return np.asarray((v[:, 3:] * v[:, :3] + self.time_step * f).sum(axis=0))

    def angular_momentum(self) -> dict[str, np.ndarray]:
        """Of the grains about the bed's origin, and what has changed it since ``keep_book`` [N m s], shape [3] each.

        Returns:
            grains: sum of x x m v and of their spins' with the velocities half a step ahead, to which the forces so far
            have brought them. outside: what came of gravity, across the periodic sides, of grains put back into the
            box, and to and from sleepers. first_body, bodies: what body 0, which is the floor where there is one, and
            the others took. grains = grains then + outside - first_body - bodies, to round-off; not with a drag, and
            not through ``set_gravity``, which shifts the velocities.

        Raises:
            ValueError: no book is kept.
        """
        if not self._engine.ledger.on:
            raise ValueError("this bed keeps no book of what contacts take: keep_book() opens it")
        x, v, w, f, t = self._of_those_awake("position", "velocity", "spin", "force", "torque")
        radius, mass = x[:, 3], v[:, 3]
        momentum = mass[:, None] * v[:, :3] + self.time_step * f
        own = (0.4 * mass * radius**2)[:, None] * w[:, :3] + self.time_step * t
        total = np.cross(x[:, :3], momentum).sum(axis=0) + own.sum(axis=0)
        return {"grains": total, **dict(zip(TURNED, self._engine.ledger.turns(), strict=True))}

    def _of_those_awake(self, *names: str) -> list[np.ndarray]:
        """Fields of the engine, of the grains awake, who come first in memory: the others have no speed, no force."""
        self._check_valid()
        awake = slice(0, self.awake_count)
        return [self._engine.read(name)[awake].astype(float) for name in names]

    def _rates_now(
        self, position: np.ndarray, velocity: np.ndarray, spin: np.ndarray, force: np.ndarray, torque: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Velocity [m/s] and spin [rad/s] at the time of the positions, half a step after the engine's, of its rows."""
        half = 0.5 * self.time_step
        radius, mass = position[:, 3], velocity[:, 3]
        now = velocity[:, :3] + half * force / mass[:, None]
        return now, spin[:, :3] + half * torque * (2.5 / (mass * radius**2))[:, None]

    # ------------------------------------------------------------------ time

    @property
    def height(self) -> float:
        """Top of the box [m]: a grain above it is lost."""
        return float(self._settings["height"])

    @property
    def time(self) -> float:
        """Time since the bed was made [s]."""
        return self.steps * self.time_step

    def advance(self, steps: int = 1, *, drag_time: float = math.inf) -> None:
        """Advance by a number of time steps.

        Args:
            drag_time: the grains settle as in a fluid that takes their speed away with this time constant [s]; a tool
                of preparation, off by default.

        Raises:
            ValueError: steps that are no whole number, a drag time shorter than two steps.
            BedFailure: a grain left the box, a number is not a number, or an overlap went past its bound.
        """
        self._check_valid()
        e = self._engine
        if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)) or steps < 0:
            raise ValueError(
                f"steps = {steps!r} must be a whole number of time steps of {self.time_step:.3g} s, 0 or more; "
                f"round(time / bed.time_step) is that for a time"
            )
        if not drag_time >= 2 * self.time_step:
            raise ValueError(f"drag_time = {drag_time} s must be at least two time steps of {self.time_step:.3g} s")
        keep = 1 - self.time_step / drag_time
        e.clear_pushes()
        self._reaction_steps, self._tallied = steps, None
        sleeper, forced = self._sleeper, False
        if sleeper is not None:
            e.rest.held.fill(0)
            sleeper.slept = 0.0
        limit = 0.5 * self._skin
        done = 0
        while done < steps:
            most = steps - done
            if sleeper is not None:
                forced = sleeper.look()
                if forced:  # new lists in the step to come, as if a grain had moved far
                    e.moved[None] = 1
                most = min(most, sleeper.steps_to_look())
            advanced, halted = e.launch(most, self.time_step, limit, self.gravity, keep)
            done += advanced
            self._count(advanced)
            if halted:
                if not forced:
                    self._adapt_skin()
                self._make_lists()
                self._push(self.time_step)
                limit = 0.5 * self._skin
                done += 1
                self._count(1)
        self._tallied, overlap = self._tally()
        if not overlap <= self.overlap_limit:
            raise BedFailure(
                f"an overlap of {100 * overlap:.3g} % of a diameter went past its bound of "
                f"{100 * self.overlap_limit:g} % at t = {self.time:.6g} s; make the grains stiffer (young = "
                f"{self.material.young:.3g} Pa now) or the bound larger"
            )

    def _count(self, steps: int) -> None:
        self.steps += steps
        self._since_lists += steps
        self.grain_steps += steps * self.awake_count
        if self._sleeper is not None:
            self._sleeper.slept += steps * self._sleeper.mass

    def _adapt_skin(self) -> None:
        """Towards the skin at which lists cost as much to make as their extra pairs cost to look at."""
        steps = max(1, self._since_lists)
        ratio = math.sqrt(_REBUILD_STEPS / (_SKIN_COST * self._skin / self._diameter * steps))
        skin = self._skin * min(1.4, max(0.7, ratio))
        self._skin = min(_LARGEST_SKIN * self._diameter, max(_LEAST_SKIN * self._diameter, skin))

    def _make_lists(self, *, all_awake: bool = False) -> None:
        e = self._engine
        e.keep_lists(e.rest, e.ledger)
        awake = self.awake_count
        if self._sleeper is not None:
            self._sleeper.rearrange(all_awake=all_awake)
        e.sort(*self.gravity, awake, e.rest, e.ledger)
        e.make_lists(self._skin, e.shapes, e.rest, e.ledger)
        self.list_count += 1
        self._since_lists = 0
        code, value = (int(v) for v in e.problem[None])
        if code:
            e.problem[None] = [0, 0]
            raise BedFailure(self._explain(code, value))

    def _explain(self, code: int, value: int) -> str:
        e = self._engine
        if code == 1:
            position = e.read("position")
            ids = e.read("id")
            bad = ~np.isfinite(position).all(axis=1)
            if bad.any():
                return f"the position of grain {int(ids[bad].min())} is not a number at t = {self.time:.6g} s"
            lost = (position[:, 2] > self._settings["height"]) | (position[:, 2] < e.bottom)
            first = int(ids[lost].min()) if lost.any() else value
            where = position[ids == first][0, :3]
            return (
                f"grain {first} left the box ({int(lost.sum())} in all) at t = {self.time:.6g} s: it is at "
                f"({where[0]:.4g}, {where[1]:.4g}, {where[2]:.4g}) m, the box reaches from {e.bottom:.4g} to "
                f"{self._settings['height']:.4g} m"
            )
        room = e.chunk_room if code == 2 else e.near_room
        what = "pairs" if code == 2 else "grains near bodies"
        return f"the lists have room for {room} {what} a chunk and {value} are needed; the grains overlap too much"

    def _push(self, elapsed: float = 0.0) -> None:
        """Forces where the grains are; ``elapsed`` is the time by which contacts have slid since they were computed."""
        self._tallied = None
        e = self._engine
        e.push_all(elapsed, e.shapes, e.rest, e.ledger)

    def _shift_velocities(self, part: float) -> None:
        self._engine.shift_velocities(part * self.time_step)

    # ------------------------------------------------------------------ what a user reads

    def grains(self, *, contacts: bool = True) -> dict[str, np.ndarray]:
        """What the grains are doing, in the order of ids.

        Args:
            contacts: whether to count them (coordination), which takes as long as the rest.

        Returns:
            id; position, velocity, spin, force (gravity included), displacement (since the bed was made or
            ``mark_origin``), each of shape [grain_count, 3]; radius, mass, coordination (contacts with grains and
            bodies), each of shape [grain_count]. SI units.
        """
        self._check_valid()
        e = self._engine
        order = np.argsort(e.read("id"))
        position = e.read("position")[order].astype(float)
        velocity = e.read("velocity")[order].astype(float)
        spin = e.read("spin")[order].astype(float)
        force = e.read("force")[order].astype(float)
        torque = e.read("torque")[order].astype(float)
        origin = e.read("origin")[order].astype(float)
        rates = self._rates_now(position, velocity, spin, force, torque)
        counted = {"coordination": self.contact_counts()} if contacts else {}
        return {
            "id": np.arange(self.grain_count),
            "position": position[:, :3],
            "radius": position[:, 3],
            "mass": velocity[:, 3],
            "velocity": rates[0],
            "spin": rates[1],
            "force": force,
            "displacement": position[:, :3] - origin,
            **counted,
        }

    def contact_counts(self) -> np.ndarray:
        """Contacts of each grain with grains and bodies, by id, shape [grain_count]."""
        counts = np.zeros(self.grain_count, dtype=np.int32)
        self._engine.count_contacts(counts, self._engine.shapes)
        if self._sleeper is not None:
            counts += self._sleeper.contact_counts()
        return counts

    @property
    def coordination_number(self) -> float:
        """Mean number of contacts of a grain [1], those with bodies and the floor included."""
        return float(self.contact_counts().mean())

    @property
    def kinetic_energy(self) -> float:
        """Translation and rotation [J]."""
        g = self.grains(contacts=False)
        moving = 0.5 * g["mass"] @ (g["velocity"] ** 2).sum(axis=1)
        turning = 0.2 * (g["mass"] * g["radius"] ** 2) @ (g["spin"] ** 2).sum(axis=1)
        return float(moving + turning)

    @property
    def weight(self) -> float:
        """Weight of all grains [N]."""
        return float(self._engine.read("velocity")[:, 3].sum() * math.hypot(*self.gravity))

    @property
    def floor_force(self) -> float:
        """What the grains press the floor with [N], mean over the last ``advance``."""
        if not self._has_floor:
            return 0.0
        return float(-self.reaction(FLOOR)[0][2])

    @property
    def max_overlap(self) -> float:
        """Largest overlap over mean diameter of the pair [1] since the bed was made or this was set."""
        return float(self._engine.read("overlap").max())

    @max_overlap.setter
    def max_overlap(self, value: float) -> None:
        self._engine.overlap.fill(value)

    def mark_origin(self) -> None:
        """Count displacements from here."""
        self._engine.mark_origin()

    def measure_surface(self) -> None:
        """Take ``surface`` and ``packing_fraction`` anew from where the grains are now."""
        position = self._engine.read("position").astype(float)
        area = self.size[0] * self.size[1]
        self.packing_fraction = bulk_packing(position[:, 2], position[:, 3], area)
        self.surface = surface_height(position[:, 2], position[:, 3], area, bulk=self.packing_fraction)

    def set_gravity(self, gravity: float | Sequence[float]) -> None:
        """Change gravity [m/s2]: downwards, or a vector."""
        self.wake()
        self._shift_velocities(0.5)
        self.gravity = _vector(gravity)
        if self._engine.ledger.on:
            self._engine.ledger.pull[None] = self.gravity
        self._make_lists()
        self._push()
        self._shift_velocities(-0.5)

    # ------------------------------------------------------------------ state

    def state(self) -> dict[str, np.ndarray]:
        """Everything that the next step depends on, to the bit: a flat dict of numpy arrays."""
        self._check_valid()
        return state.take(self)

    def restore(self, values: dict[str, np.ndarray]) -> None:
        """Go back to a state of this bed, or of one that was made with the same settings.

        Raises:
            ValueError: a state of another number of grains, of another layout or precision.
        """
        self._check_valid()
        state.put_back(self, values)

    def hold(self) -> Held:
        """Keep what the next steps depend on for ``take_back``, where the bed lies: on a GPU nothing is read.

        One state is held at a time; the first one takes as much memory again as grains and lists do.
        """
        self._check_valid()
        return holding.hold(self)

    def take_back(self, held: Held) -> None:
        """Go back to the state that was held last, to the bit; as often as one likes.

        Raises:
            ValueError: another has been held since, or sleep or the book of losses has begun or ended.
        """
        self._check_valid()
        holding.take_back(self, held)

    def save(self, path: str | Path) -> Path:
        """Write the bed to one file (.npz), whole or not at all. Returns the path."""
        path = Path(path)
        self._check_valid()
        state.write_file(self, path)
        return path

    @classmethod
    def load(cls, path: str | Path, *, arch: str = "cpu", threads: int | None = None) -> Bed:
        """Read a bed that ``save`` wrote; it goes on to the same bits on the same kind of processor.

        Raises:
            ValueError: the file is missing or is not a bed.
        """
        settings, values, precision = state.read_file(Path(path))
        bed = cls(settings, values["position"][:, 3].astype(float), precision=precision, arch=arch, threads=threads)
        if len(values["near_count"]) == bed._engine.chunk_count:
            bed.restore(values)
        else:
            state.adopt(bed, values)
        return bed

    def without(self, remove: np.ndarray) -> Bed:
        """A bed with some grains taken out; the others keep their contacts. Ids are counted anew, in order.

        Args:
            remove: by id, bool, shape [grain_count].
        """
        self._check_valid()
        self.wake()
        ids = self._engine.read("id")
        order = np.argsort(ids)
        keep = ~np.asarray(remove, dtype=bool)
        if not keep.any():
            raise ValueError("no grain would be left")
        values = self.state()
        radii = values["position"][order, 3][keep].astype(float)
        bed = Bed(
            self._settings | {"gravity": self.gravity},
            radii,
            precision=self._runtime.precision,
            arch=self._runtime.arch,
            threads=self._runtime.threads,
        )
        state.adopt(bed, values, keep=keep)
        return bed

    def repeated(self, times: int, *, height: float | None = None) -> Bed:
        """A bed `times` as long: this one laid end to end along x, where it is periodic, with its contacts' history.

        So it is as much at rest as this one, and has the same surface and packing fraction. Copy k of grain i has id
        i + k grain_count. Its clock begins at 0; sleepers wake, and books of losses are not gone on with.

        Args:
            times: how often [1]; with 1 it is a copy.
            height: top of the box [m], above which a grain is lost; this bed's where that is higher, or when None.

        Raises:
            ValueError: `times` that is no whole number of 1 or more; a height that is no length; a bed with bodies
                beside its floor.
        """
        self._check_valid()
        if isinstance(times, bool) or int(times) != times or times < 1:
            raise ValueError(f"times = {times} must be a whole number, 1 or more")
        if height is not None and not 0 < height < math.inf:
            raise ValueError(f"height = {height} must be a length [m]")
        bodies = int(self._engine.body_count[None]) - int(self._has_floor)
        if bodies:
            raise ValueError(f"{bodies} bodies beside the floor: a bed is repeated without them, each is in one place")
        self.wake()
        times = int(times)
        values = state.laid_end_to_end(self.state(), times, period=self.size[0])
        own = {
            "size": (times * self.size[0], *self.size[1:]), "gravity": self.gravity, "time_step": self.time_step,
            "max_overlap": self.overlap_limit, "height": max(self.height, height or 0.0),
        }  # fmt: skip
        bed = Bed(
            self._settings | own,
            values["position"][:, 3].astype(float),
            precision=self._runtime.precision,
            arch=self._runtime.arch,
            threads=self._runtime.threads,
        )
        state.adopt(bed, values)
        bed.steps = 0
        bed.material = self.material
        bed.recipe = self.recipe | {"repeats": times} if self.recipe else {}
        bed.surface, bed.packing_fraction = self.surface, self.packing_fraction
        return bed

    def _fill(self, positions, velocities, spins, radii, mass) -> None:
        e = self._engine
        dtype = self._runtime.dtype
        n = self.grain_count
        e.write("position", np.column_stack([positions, radii]).astype(dtype))
        e.write("velocity", np.column_stack([velocities, mass]).astype(dtype))
        e.write("spin", np.column_stack([spins, np.zeros(n)]).astype(dtype))
        e.write("origin", positions.astype(dtype))
        e.write("id", np.arange(n, dtype=np.int32))
        e.write("near_end", (np.arange(e.chunk_count) * e.near_room).astype(np.int32))

    def _refuse_overlaps(self) -> None:
        """Raise ValueError, naming the worst pair, where grains begin beyond the bound that ``advance`` holds."""
        # Two centres in one place have no direction: their force is no number, and their overlap is not taken.
        if self.max_overlap <= self.overlap_limit and np.isfinite(self._engine.read("force")).all():
            return
        with np.errstate(invalid="ignore"):
            contacts = find_contacts(self)
        radius = self.grains()["radius"]
        other = np.where(contacts.second < 0, contacts.first, contacts.second)
        share = contacts.overlap / (radius[contacts.first] + radius[other])
        worst = int(share.argmax())
        j, i = sorted((int(contacts.first[worst]), int(contacts.second[worst])))
        raise ValueError(
            f"positions: grain {i} begins in overlap with {'the floor' if j < 0 else f'grain {j}'} by "
            f"{100 * share[worst]:.3g} % of a diameter, max_overlap = {self.overlap_limit:g} allows "
            f"{100 * self.overlap_limit:g} %; move it away, or take a larger max_overlap (0.2 at most)"
        )

    def _check_valid(self) -> None:
        if self._generation != runtime.generation():
            raise RuntimeError(
                "this bed is no longer valid: Taichi was started anew with another precision, arch or number of threads"
            )

    def _check_body(self, body: int) -> None:
        self._check_valid()
        if not 0 <= body < int(self._engine.body_count[None]):
            raise ValueError(f"body = {body}: there is no such body in the bed")


def _vector(gravity: float | Sequence[float]) -> tuple[float, float, float]:
    if isinstance(gravity, (int, float)):
        down = float(gravity)
        if not (math.isfinite(down) and down >= 0):
            raise ValueError(f"gravity = {gravity} must be 0 or more, downwards [m/s2], or a vector")
        return (0.0, 0.0, -down)
    vector = tuple(float(g) for g in gravity)
    if len(vector) != 3 or not all(map(math.isfinite, vector)):
        raise ValueError(f"gravity = {gravity} must be a number, downwards [m/s2], or three of them")
    return vector


def _refuse_turns(name: str, turns: np.ndarray) -> None:
    """Raise ValueError where a quaternion of shape [n, 4] is not of length 1, which would stretch the body."""
    for turn in turns[~(np.abs((turns**2).sum(axis=1) - 1) < 1e-3)]:
        raise ValueError(f"{name} = {tuple(map(float, turn))} must be of length 1 (a unit quaternion, scalar first)")


def _check_array(name: str, array: np.ndarray, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}, {shape} was expected")
    if not np.isfinite(array).all():
        raise ValueError(
            f"{name} holds a number that is not finite, in row {int(np.argwhere(~np.isfinite(array))[0][0])}"
        )


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


def _reach(material: Material, radius: float, effective_young: float) -> float:
    """How far two grains of this effective radius [m] feel one another before they touch [m]; 0 but with JKR."""
    if material.cohesion != "jkr":
        return 0.0
    return jkr_range(surface_energy=material.surface_energy, radius=radius, effective_young=effective_young)


def _room(radii: np.ndarray, skin: float, *, gpu: bool) -> int:
    """Rows of the pair lists for a grain: the most that fit around it (on a GPU) or around a mean one, with spare."""
    small, large = float(radii.min()), float(radii.max())
    # Caps of neighbours on a sphere: each takes a cone of half angle asin(r_s / (r_l + r_s + skin)).
    half = math.asin(small / (large + small + skin))
    most = math.ceil(2 / (1 - math.cos(half)))
    return most + 4 if gpu else min(most + 4, 20)
