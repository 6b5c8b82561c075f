"""A surface law under every point of every foot of a robot: `LawFeet`."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from coupling.law_ground import LawPoints
from coupling.poses import Pose, Twist, Vector, chord_share, matrices
from rigid.ground.grounds import SpringDamper, SurfaceGround
from rigid.ground.laws import find_law
from rigid.ground.reaction import Contact, Facts, Reaction, Turned

from .feet import Foot
from .soles import refuse_defaults

__all__ = ["LawFeet"]


class LawFeet(LawPoints):
    """A law of `rigid.ground.laws` under the feet of a robot, its friction as a Coulomb bound.

    Parameters
    ----------
    feet : those of the robot. A part has the law's numbers as a whole where it stands on its own points (`Part.share`).
    law, parameters : as `rigid.SurfaceGround` has them, of one part.
    mu_s, mu_d : friction [1]; None: half of mu_s.
    time_step : [s], of which a macro step has `substeps`.
    scales : name of a part -> how many times the law it has, such as its area over that the law is of [1].
    under : name of a part -> its own parameters, in place of `parameters`.
    depths, speeds : name of a part -> largest depth of its parameters [m], and largest speed at which its law was
        compared with grains [m/s]. Reports of a run use it. All five are those of `law_under_feet` and `law_of_run`.

    Parameters that are of one foot or of one gravity, such as K, a radius or a gravity, have no defaults here. Raises
    ValueError for one of them that is not given, and for a law or parameter there is not.
    """

    lag = 0.0
    gives_friction = False
    repeatable = True
    surface, centre, clearance, depth_limit = 0.0, (0.0, 0.0), 0.0, math.inf

    def __init__(
        self,
        feet: Sequence[Foot],
        *,
        law: str = "spring-damper",
        parameters: Mapping[str, float] | None = None,
        mu_s: float = 0.5,
        mu_d: float | None = None,
        time_step: float = 1e-4,
        scales: Mapping[str, float] | None = None,
        under: Mapping[str, Mapping[str, float]] | None = None,
        depths: Mapping[str, float] | None = None,
        speeds: Mapping[str, float] | None = None,
    ) -> None:
        self.depths, self.speeds = dict(depths or {}), dict(speeds or {})
        self.feet, scales, under = list(feet), scales or {}, under or {}
        refuse_defaults(self.feet, law, parameters or {}, under)
        self.grounds: list[list[SurfaceGround]] = []
        for foot in feet:
            own = []
            for part in foot.parts:
                count, numbers = part.share * scales.get(part.name, 1.0), under.get(part.name, parameters or {})
                own += [
                    SurfaceGround(law=law, parameters=numbers, mu_s=mu_s, mu_d=mu_d, count=count, time_step=time_step)
                    for _ in part.centres
                ]
            self.grounds.append(own)
        self._first = np.cumsum([0, *(len(own) for own in self.grounds)])
        self._depths = np.full(int(self._first[-1]), -math.inf)

    def __repr__(self) -> str:
        return f"LawFeet({self.name} under {len(self._depths)} points of {len(self.feet)} feet)"

    @property
    def name(self) -> str:
        """Name of the surface law."""
        return self.grounds[0][0].name

    @property
    def has_memory(self) -> bool:
        """Whether the law remembers the deepest depth, so that it takes up most of the energy of a swing."""
        return find_law(self.name).has_memory

    @property
    def time_step(self) -> float:
        """The step that it is driven at [s]."""
        return self.grounds[0][0].time_step

    def describe(self) -> Facts:
        """What it is, in plain numbers, for run.toml."""
        return self.grounds[0][0].describe()

    def place(self, pose: Pose) -> None:
        """The robot is to start with its feet at `pose`. Raises ValueError, naming the foot, for one in the ground."""
        for foot, at, turn in self._poses(pose):
            still = Twist(np.zeros(3), np.zeros(3))
            points = foot.lowest(matrices(Pose(at, turn), still, self.time_step)[0])
            depth = -float(at[2] + points[:, 2].min())
            if depth > 1e-9:
                raise ValueError(
                    f"feet: {foot.name!r} starts {depth:.3g} m below the surface: raise the robot by as much, or give "
                    f"a height"
                )

    def _poses(self, pose: Pose) -> list[tuple[Foot, Vector, Vector]]:
        places, turns = pose.position.reshape(-1, 3), pose.turn.reshape(-1, 4)
        return list(zip(self.feet, places, turns, strict=True))

    def step(
        self, position: ArrayLike, velocity: ArrayLike, dt: float, turn: Turned = None, spin: Turned = None
    ) -> Reaction:
        """See `Ground.step`, of all feet: each point goes along its chord, and its law is exact over that path.

        Positions, velocities and spins have shape (3 foot,), turns (4 foot,), forces and torques (3 foot,).
        """
        assert turn is not None
        velocities, spins = np.reshape(velocity, (-1, 3)), np.reshape(np.asarray(spin), (-1, 3))
        rows = np.zeros((len(self.feet), 6))
        contacts: list[Contact] = []
        all_poses = self._poses(Pose.of(position, turn))
        for k, (foot, at, turned) in enumerate(all_poses):
            place = slice(self._first[k], self._first[k + 1])
            if at[2] - foot.reach > np.linalg.norm(velocities[k]) * dt and (self._depths[place] <= 0).all():
                self._depths[place] = -math.inf  # far above
                continue
            twist = Twist(velocities[k], spins[k])
            first, middle, last = matrices(Pose(at, turned), twist, dt)
            starts, ends = at + foot.lowest(first), at + twist.velocity * dt + foot.lowest(last)
            arms = chord_share(twist, dt) * foot.lowest(middle)
            centre = at + 0.5 * dt * twist.velocity
            was = self._depths[place]
            for j in np.flatnonzero((np.minimum(starts[:, 2], ends[:, 2]) < 0) | (was > 0)):
                given = self.grounds[k][j].step(starts[j], (ends[j] - starts[j]) / dt, dt)
                for held in given.contacts:
                    point = int(self._first[k] + j)
                    contacts.append(
                        Contact(centre + arms[j], held.normal_force, mu_s=held.mu_s, mu_d=held.mu_d, member=point)
                    )
                    x, y, push = arms[j, 0], arms[j, 1], held.normal_force  # upwards: its moment is arm x push
                    rows[k] += (0.0, 0.0, push, y * push, -x * push, 0.0)
            self._depths[place] = -ends[:, 2]
        sinkage = {int(point): float(self._depths[point]) for point in np.flatnonzero(self._depths > 0)}
        return Reaction(rows[:, :3].ravel(), rows[:, 3:].ravel(), tuple(contacts), sinkage)

    def _laws(self) -> dict[str, SpringDamper | SurfaceGround]:
        return {f"{k}-{j}": ground for k, own in enumerate(self.grounds) for j, ground in enumerate(own)}
