"""Pivot, slip or hop, read off the forces of grains by stated rules, so that it compares with the planar model's.

Of each row the normal force N, the horizontal force F and the horizontal velocity u of its lowest material point are
averaged over 5 ms: F and u have one component in the plane, where a row has spikes side by side. They have two in
space, where a row is a single spike. A row *touches* while N and F together are above 1 % of the weight. It *slides*
while |F| is at least mu_d N, F is against u (F . u < 0) and |u| is above 2 mm/s; what touches and does not slide
sticks.

Then as in the planar model: hop (none touches), slip (all that touch slide), pivot (one sticks), stand (more do). In
space it is a pivot while those that stick lie in one line. docs/coupling.md says why. Changes come late by 2.5 ms.

On surface laws, which give Coulomb bounds, `StickSlip` finds who sticks and who slides in a step.
"""

import math
from collections.abc import Iterable, Mapping, Set
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from rigid.ground.reaction import Contact, Reaction, State

from .poses import Twist, Vector

__all__ = [
    "CREEP", "LINE", "TOUCH_SHARE", "WINDOW", "ContactReader", "StickSlip", "changes_of", "feet_of", "in_a_line",
    "state_of",
]  # fmt: skip

WINDOW = 5e-3  # Over which forces and speeds are averaged [s]
TOUCH_SHARE = 0.01  # Force on a row that touches, over the weight [1]
CREEP = 2e-3  # Horizontal speed up to which a row counts as held [m/s]
LINE = 0.05  # Largest distance of spikes from their line, over that of any from the centre [1]

Array = NDArray[np.float64]


def state_of(touching: NDArray[np.bool_], sliding: NDArray[np.bool_], places: Array | None = None) -> str:
    """The planar model's state of these rows.

    `places` : of single spikes in space [m], shape [row, 3]; None: each row is a line across the motion.
    """
    if not touching.any():
        return "hop"
    held = touching & ~sliding
    if not held.any():
        return "slip"
    if places is None:
        return "pivot" if int(held.sum()) == 1 else "stand"
    return "pivot" if in_a_line(places[held], LINE * float(np.linalg.norm(places, axis=1).max())) else "stand"


def in_a_line(places: Array, within: float) -> bool:
    """Whether points [m], shape [n, 3], lie within this distance [m] of one line: a body held there can turn."""
    if len(places) < 3:
        return True
    away = places - places.mean(axis=0)
    axes = np.linalg.svd(away, full_matrices=False)[2]
    return bool(np.linalg.norm(away @ axes[1:].T, axis=1).max() <= within)


def feet_of(reaction: Reaction | None, centre: Vector, twist: Twist, count: int, *, hull: bool = False) -> Array:
    """What each of `count` rows feels: N [N], F along x and y [N], u along x and y [m/s], depth [m]; shape [6, row].

    `reaction` is of the step before, None before the first. `centre` is where the body's origin was in the step's
    middle [m], `twist` how it moves at its end. `hull`: whether one more row, the last, is what is no spike.
    """
    feet = np.zeros((6, count + hull))
    if reaction is None:
        return feet
    velocity, spin = twist.velocity, twist.spin
    for row, contact in reaction.by_member.items():
        if row < 0 and not hull:
            continue
        along = contact.tangential_force
        feet[0, row] = contact.normal_force
        if along is not None:
            feet[1:3, row] = along[:2]
        x, y, z = contact.point - centre
        feet[3:5, row] = velocity[0] + (spin[1] * z - spin[2] * y), velocity[1] + (spin[2] * x - spin[0] * z)
    for row, depth in reaction.sinkage.items():
        feet[5, row] = depth
    return feet


def changes_of(
    times: Iterable[float], states: Iterable[str], angles: Iterable[float]
) -> tuple[tuple[float, str, float], ...]:
    """(time [s], state entered, angle [rad]) where the state changes; the first is the one it begins with."""
    rows = zip(times, states, angles, strict=True)
    firsts = (next(group) for _, group in groupby(rows, key=lambda row: row[1]))
    return tuple((float(time), state, float(angle)) for time, state, angle in firsts)


class ContactReader:
    """Follows the rows' forces in steps of `macro_step` [s]; `weight` [N] on the surface, `mu_d` [1].

    In space `places` says where its spikes are about the centre of mass, in body axes [m], shape [row, 3].
    """

    def __init__(
        self, rows: int, *, weight: float, mu_d: float, macro_step: float, places: Array | None = None
    ) -> None:
        self.weight, self.mu_d, self.places = weight, mu_d, places
        self._axes = 1 if places is None else 2
        self._ring = np.zeros((max(1, round(WINDOW / macro_step)), 1 + 2 * self._axes, rows))
        self._filled = 0

    def see(self, normal: Array, along: Array, slip: Array) -> str:
        """The state after one more step of normal and horizontal forces [N] and slip velocities [m/s] of the rows.

        Horizontal ones of shape [row] in the plane, [2, row] in space.
        """
        axes = self._axes
        self._ring = np.roll(self._ring, 1, axis=0)
        self._ring[0] = np.vstack([normal, along, slip])
        self._filled = min(self._filled + 1, len(self._ring))
        mean = self._ring[: self._filled].mean(axis=0)
        n, f, u = mean[0], mean[1 : 1 + axes], mean[1 + axes :]
        force, speed = np.abs(np.hypot.reduce(f)), np.abs(np.hypot.reduce(u))
        touching = np.hypot(n, force) > TOUCH_SHARE * self.weight
        sliding = (force >= self.mu_d * n) & ((f * u).sum(axis=0) < 0) & (speed > CREEP)
        return state_of(touching, sliding, self.places)

    def state(self) -> State:
        """What the next answers depend on."""
        return {"ring": self._ring.copy(), "filled": np.array(self._filled)}

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        self._ring, self._filled = np.array(state["ring"], dtype=float), int(state["filled"])


class StickSlip:
    """The modes of points in contact; how forces move the points is what a subclass states.

    `points` are the members of the contacts. `sticking` holds those that stick, `sliding` the others with the
    direction in which they slide, shape (2,). A point that sticks has at most mu_s times its load. A point that slides
    has mu_d times its load, against its direction, until its slip turns back.
    """

    def __init__(self, contacts: Iterable[Contact]) -> None:
        held = list(contacts)
        self.points = [contact.member for contact in held]
        self.loads = np.array([contact.normal_force for contact in held])
        self.mu_s = np.array([float(contact.mu_s or 0.0) for contact in held])
        self.mu_d = np.array([float(contact.mu_d or 0.0) for contact in held])
        self.sticking: set[int] = set()
        self.sliding: dict[int, Vector] = {}

    def begin(self, slips: Vector, sticking: Set[int], sliding: Mapping[int, Vector]) -> None:
        """Start from the modes of the step before and the slips before this step [m/s], shape (point, 2)."""
        self.sticking = {point for point in self.points if point in sticking}
        for point, slip in zip(self.points, slips, strict=True):
            if point in self.sticking:
                continue
            size = float(np.linalg.norm(slip))
            if size == 0 or (point in sliding and float(slip @ sliding[point]) <= 0):
                self.sticking.add(point)  # it has turned back, and sticks where its bound allows it
            else:
                self.sliding[point] = slip / size

    def settle(self) -> Vector:
        """Change modes until each agrees with its force and slip; the forces of friction [N], shape (point, 2)."""
        force = np.zeros((len(self.points), 2))
        for _ in range(6 * len(self.points) + 6):
            force = np.zeros_like(force)
            for k, point in enumerate(self.points):
                if point in self.sliding:
                    force[k] = -self.mu_d[k] * self.loads[k] * self.sliding[point]
            force = self._held(force)
            slips = self._slips(force)
            over = [
                k for k, point in enumerate(self.points)
                if point in self.sticking and math.hypot(*force[k]) > self.mu_s[k] * self.loads[k] * (1 + 1e-12)
            ]  # fmt: skip
            back = [
                k for k, point in enumerate(self.points) if point in self.sliding and slips[k] @ self.sliding[point] < 0
            ]
            if not over and not back:
                return force
            for k in over:
                self.sticking.discard(self.points[k])
                self.sliding[self.points[k]] = -force[k] / math.hypot(*force[k])
            for k in back:
                del self.sliding[self.points[k]]
                self.sticking.add(self.points[k])
        # Not settled who sticks: nobody is held by more than the bound.
        size = np.maximum(np.hypot(force[:, 0], force[:, 1]), 1e-300)
        return np.asarray(force * np.minimum(1.0, self.mu_s * self.loads / size)[:, None])

    def _held(self, force: Vector) -> Vector:
        """`force` of the points that slide [N] with the forces that hold those that stick, shape (point, 2)."""
        raise NotImplementedError

    def _slips(self, force: Vector) -> Vector:
        """Horizontal velocity of each point at the step's end under `force` [m/s], shape (point, 2)."""
        raise NotImplementedError
