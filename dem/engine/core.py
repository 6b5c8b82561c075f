"""The core of a bed: everything that a user's ``dem.Bed`` can do but prepare itself.

The modules of dem.engine, dem.measure and dem.prepare are written against ``BedCore``.
"""

import math
from collections.abc import Sequence
from typing import Self

import numpy as np

from dem.contact.timestep import time_step_for
from dem.grains.materials import Facing, Material
from dem.grains.materials import material as find_material
from dem.shapes.basic import Plane

from .base import FLOOR, check_array
from .dissipation import FRICTION, PARTS, TURNED, Balance
from .state import BedState, laid_end_to_end
from .stress import find_contacts
from .values import BedSettings, Grains, State

__all__ = ["BedCore"]


class BedCore(BedState):
    """Spherical grains on a floor at z = 0, periodic in x and y, open above; ``dem.Bed`` documents it for users."""

    def __repr__(self) -> str:
        size = " x ".join(f"{length:g}" for length in self.size)
        g = math.hypot(*self.gravity)
        return (
            f"{type(self).__name__}({self.grain_count} grains of {self.material.name!r}, {size} m, packing fraction "
            f"{self.packing_fraction:.3f}, gravity {g:g} m/s2, time {self.time:g} s)"
        )

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
    ) -> Self:
        """A bed of given grains.

        Args:
            material: a name or a Material.
            positions: centres [m], shape [grain_count, 3]. radii: [m], shape [grain_count].
            size: lateral periods and nominal depth (x, y, z) [m].
            velocities [m/s], spins [rad/s]: angular velocities; shape [grain_count, 3], at rest when None.
            height: top of the box [m]; a grain above it is lost. Twice the highest grain when None.
            gravity: downwards [m/s2], or a vector.
            young: Young's modulus of the (softened) grains [Pa]; the material's own when None.
            max_overlap: bound on overlap over diameter, from the start on; the time step is chosen for it.
            time_step: [s]; at most ``dem.contact.timestep.longest_step``. When None an eighth of the contact time, or
                the longest stable one where that is shorter, as for strongly damped grains.
            floor: whether there is a floor at z = 0; a Facing where grains touch it otherwise than one another.
            tensile: whether the damping may pull at the end of a contact (as LIGGGHTS does by default).
            precision: "float64" or "float32". arch: "cpu" or "cuda". threads: of the CPU; all when None.

        Raises ValueError: arrays of wrong shape; numbers that are not finite; a negative size; a step too long; a bed
        narrower than three grains. Grains must be inside the box, and none may overlap another or the floor by more
        than ``max_overlap``.
        """
        stuff = find_material(material)
        if young is not None:
            stuff = stuff.softened(float(young))
        radii = np.asarray(radii, dtype=float)
        positions, velocities, spins = (
            np.zeros((len(radii), 3)) if values is None else np.asarray(values, dtype=float)
            for values in (positions, velocities, spins)
        )
        check_array("radii", radii, (len(radii),))
        if not len(radii) or not (radii > 0).all():
            raise ValueError("radii must be positive and there must be at least one grain")
        for name, values in (("positions", positions), ("velocities", velocities), ("spins", spins)):
            check_array(name, values, (len(radii), 3))
        if len(size) != 3 or not all(math.isfinite(s) and s > 0 for s in size):
            raise ValueError(f"size = {tuple(size)} must be three positive lengths [m]")
        if not 0 < max_overlap <= 0.2:
            raise ValueError(f"max_overlap = {max_overlap} must be above 0 and at most 0.2 of a diameter")
        x, y, z = map(float, size)
        settings = BedSettings(
            material=stuff,
            size=(x, y, z),
            gravity=_vector(gravity),
            time_step=time_step_for(stuff, diameter=2 * float(radii.min()), max_overlap=max_overlap, wanted=time_step),
            max_overlap=float(max_overlap),
            height=_height(height, positions, radii),
            tensile=bool(tensile),
            seed=seed,
        )
        bed = cls(settings, radii, precision=precision, arch=arch, threads=threads)
        bed.fill(positions, velocities, spins, radii)
        if floor:
            bed.place_body([Plane()], (0.0, 0.0, 0.0), floor if isinstance(floor, Facing) else Facing())
        bed.make_lists()
        bed.compute_forces()
        bed._refuse_overlaps()
        bed.shift_velocities(-0.5)  # half a step behind the positions, where the leapfrog wants them
        bed.measure_surface()
        return bed

    def grains(self, *, contacts: bool = True) -> Grains:
        """The grains now, in the order of ids; with ``contacts`` their ``coordination`` too, which doubles the time."""
        self.check_valid()
        e = self.engine
        order = np.argsort(e.read("id"))
        names = ("position", "velocity", "spin", "force", "torque", "origin")
        x, v, w, force, torque, origin = (e.read(name).astype(float) for name in names)
        velocity, spin = (rates[order] for rates in self.rates_now(x, v, w, force, torque))
        x, v, force, origin = (values[order] for values in (x, v, force, origin))
        counts = self.contact_counts() if contacts else np.zeros(0, dtype=np.int32)
        ids = np.arange(self.grain_count)
        return Grains(ids, x[:, :3], x[:, 3], v[:, 3], velocity, spin, force, x[:, :3] - origin, counts)

    def contact_counts(self) -> np.ndarray:
        """Contacts of each grain with grains and bodies, by id, shape [grain_count]."""
        counts = np.zeros(self.grain_count, dtype=np.int32)
        self.engine.count_contacts(counts, self.engine.shapes)
        if self.sleeper is not None:
            counts += self.sleeper.contact_counts()
        return counts

    @property
    def coordination_number(self) -> float:
        """Mean number of contacts of a grain [1], those with bodies and the floor included."""
        return float(self.contact_counts().mean())

    @property
    def kinetic_energy(self) -> float:
        """Kinetic energy of the grains [J], of translation and rotation."""
        g = self.grains(contacts=False)
        moving = 0.5 * g.mass @ (g.velocity**2).sum(axis=1)
        return float(moving + 0.2 * (g.mass * g.radius**2) @ (g.spin**2).sum(axis=1))

    @property
    def weight(self) -> float:
        """Weight of all grains [N]."""
        return float(self.engine.read("velocity")[:, 3].sum() * math.hypot(*self.gravity))

    @property
    def floor_force(self) -> float:
        """Force of the grains on the floor [N], mean over the last ``advance``."""
        if not self.has_floor:
            return 0.0
        return float(-self.reaction(FLOOR)[0][2])

    def mark_origin(self) -> None:
        """Count the displacements of the grains from here on."""
        self.engine.mark_origin()

    def set_gravity(self, gravity: float | Sequence[float]) -> None:
        """Change gravity [m/s2]: downwards, or a vector. Raises ValueError: not finite, or upwards as a number."""
        self.wake()
        self.shift_velocities(0.5)
        self.gravity = _vector(gravity)
        if self.engine.balance.on:
            self.engine.balance.pull[None] = self.gravity
        self.make_lists()
        self.compute_forces()
        self.shift_velocities(-0.5)

    def without(self, remove: np.ndarray) -> Self:
        """A bed without some grains; the others keep their contacts. Ids are counted anew, in order.

        ``remove``: by id, bool, shape [grain_count]. Raises ValueError where no grain would be left.
        """
        self.wake()
        keep = ~np.asarray(remove, dtype=bool)
        if not keep.any():
            raise ValueError("no grain would be left")
        return self.successor(self.state(), keep=keep)

    def repeated(self, times: int, *, height: float | None = None) -> Self:
        """A bed `times` as long: this one laid end to end along x, where it is periodic, with its contacts' history.

        So it is as much at rest as this one, and has the same surface and packing fraction. Copy k of grain i has id
        i + k grain_count. Its clock begins at 0; sleepers wake, and sums of losses start anew.

        Args:
            times: how often [1]; with 1 it is a copy.
            height: top of the box [m], above which a grain is lost; this bed's where that is higher, or when None.

        Raises ValueError: `times` that is no whole number of 1 or more; a height that is no length; a bed with bodies
        beside its floor.
        """
        self.check_valid()
        if isinstance(times, bool) or int(times) != times or times < 1:
            raise ValueError(f"times = {times} must be a whole number, 1 or more")
        times = int(times)
        if height is not None and not 0 < height < math.inf:
            raise ValueError(f"height = {height} must be a length [m]")
        bodies = int(self.engine.body_count[None]) - int(self.has_floor)
        if bodies:
            raise ValueError(f"{bodies} bodies beside the floor: a bed is repeated without them, each is in one place")
        self.wake()
        bed = self.successor(
            laid_end_to_end(self.state(), times, period=self.size[0]),
            size=(times * self.size[0], *self.size[1:]),
            time_step=self.time_step,
            max_overlap=self.overlap_limit,
            height=max(self.height, height or 0.0),
        )
        bed.steps = 0
        bed.material = self.material
        bed.recipe = self.recipe | {"repeats": times} if self.recipe else {}
        bed.surface, bed.packing_fraction = self.surface, self.packing_fraction
        return bed

    def _refuse_overlaps(self) -> None:
        """Raise ValueError, naming the worst pair, where grains begin beyond the bound that ``advance`` holds."""
        # Two centres in one place have no direction: their force is no number, and their overlap is not taken.
        if self.max_overlap <= self.overlap_limit and np.isfinite(self.engine.read("force")).all():
            return
        with np.errstate(invalid="ignore"):
            contacts = find_contacts(self)
        radius = self.grains().radius
        other = np.where(contacts.second < 0, contacts.first, contacts.second)
        share = contacts.overlap / (radius[contacts.first] + radius[other])
        worst = int(share.argmax())
        j, i = sorted((int(contacts.first[worst]), int(contacts.second[worst])))
        raise ValueError(
            f"positions: grain {i} begins in overlap with {'the floor' if j < 0 else f'grain {j}'} by "
            f"{100 * share[worst]:.3g} % of a diameter, max_overlap = {self.overlap_limit:g} allows "
            f"{100 * self.overlap_limit:g} %; move it away, or take a larger max_overlap (0.2 at most)"
        )

    def track_contact_work(self) -> None:
        """Sum from now on what contacts take (``contact_work``), without a drag's part; a fifth more time a step."""
        self.check_valid()
        self.engine.open_balance(self.gravity)

    @property
    def contact_work(self) -> dict[str, float]:
        """Work done against the contacts of grains, bodies and floor since ``track_contact_work`` [J].

        ``dem.engine.dissipation`` sums it. damping: against normal dashpots, all of it lost. tangential, turning:
        against tangential forces, and against rolling and twisting torques; it is lost but for what their springs hold
        more than at the start (``dem.engine.energy.bed_energies``). Raises ValueError: it is not tracked.
        """
        sums = self._balance().sums()
        return {part: float(sums[part]) for part in PARTS}

    @property
    def friction_work(self) -> dict[str, float]:
        """What friction, rolling and twisting took since ``track_contact_work``, contact by contact and step by step.

        Of each contact the work done against its tangential force, or its torques, over a step, less what its spring
        came to hold [J]. tangential_lost, turning_lost: the sums of what is positive. tangential_made, turning_made:
        of what is negative, energy that the law makes. Raises ValueError: it is not tracked.
        """
        sums = self._balance().sums()
        return {part: float(sums[part]) for part in FRICTION}

    def _balance(self) -> Balance:
        if not self.engine.balance.on:
            raise ValueError("this bed tracks no contact work: track_contact_work() starts it")
        return self.engine.balance

    def momentum(self) -> np.ndarray:
        """Momentum of the grains [N s], shape [3], with the velocities half a step ahead, as the forces bring them.

        Slow grains (``dem.engine.sleep``) count with the mass that they move with, and with the impulse of the fast
        grains. The impulse of gravity, floor and sleepers that they received ahead of time is left out.
        """
        v, f = self.awake_rows("velocity", "force")
        many, heavy = self.paces()[:, None], self.heaviness()[0][:, None]
        found = (heavy * v[:, 3:] * v[:, :3] + self.time_step * many * f).sum(axis=0)
        if self.sleeper is not None:
            found += self.time_step * (self.sleeper.pushes()[0] - self.sleeper.impulse_ahead())
        return np.asarray(found)

    def angular_momentum(self) -> State:
        """Angular momentum about the bed's origin, and changes since ``track_contact_work`` [N m s], shape [3] each.

        Returns:
            grains: sum of x x m v and of their spins. The velocities are those half a step ahead, which the forces so
            far have reached. outside: what came of gravity, across the periodic sides, of grains put back into the box,
            and to and from sleepers. first_body, bodies: what body 0, which is the floor where there is one, and the
            others took. grains = grains then + outside - first_body - bodies, to round-off; not with a drag, and not
            through ``set_gravity``, which shifts the velocities.

        Raises ValueError: it is not tracked.
        """
        sums = self._balance().sums()
        x, v, w, f, t = self.awake_rows("position", "velocity", "spin", "force", "torque")
        radius, mass = x[:, 3], v[:, 3]
        many, (heavy, stout) = self.paces()[:, None], (each[:, None] for each in self.heaviness())
        momentum = heavy * mass[:, None] * v[:, :3] + self.time_step * many * f
        own = stout * (0.4 * mass * radius**2)[:, None] * w[:, :3] + self.time_step * many * t
        total = np.cross(x[:, :3], momentum).sum(axis=0) + own.sum(axis=0)
        if self.sleeper is not None:
            total += self.time_step * self.sleeper.pushes()[1]
        return {"grains": total, **{part: sums[part] for part in TURNED}}


def _height(height: float | None, positions: np.ndarray, radii: np.ndarray) -> float:
    """Top of the box [m], chosen where it is None. Raises ValueError where a grain lies outside the box."""
    top, lowest = float((positions[:, 2] + radii).max()), int(positions[:, 2].argmin())
    if positions[lowest, 2] < (bottom := -4 * float(radii.max())):
        raise ValueError(
            f"positions: grain {lowest} begins at z = {positions[lowest, 2]:.4g} m, below the box, which reaches "
            f"down to {bottom:.4g} m (the floor is at 0); put it higher"
        )
    found = float(height) if height is not None else 2 * top + 20 * float(radii.max())
    if not top <= found < math.inf:
        raise ValueError(f"height = {height} m is no length, or below the highest grain's top at {top:.4g} m")
    return found


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
