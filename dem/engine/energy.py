"""What a bed holds: kinetic energy, height, and the springs of its contacts, read from its state.

The springs are those of ``dem.contact.law``: Hertz's 4/15 (2 E*) a d^2 (which is 2/5 F d), and half the stiffness of
now times the square of the stretch for the tangential, rolling and twisting ones. Cohesion is counted with the normal
ones, from where the pair has parted: DMT's -2 pi w R* d, and JKR's force integrated over the overlap,
    U = 8 E* a^5 / (15 R*^2) - 4/3 sqrt(2 pi w E*) a^(7/2) / R* + pi w a^2 - (the same where the pair parts).
What dashpots and sliding take is ``dem.engine.dissipation``'s.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dem.contact.cohesion import COHESIONS, DMT, JKR

from .rows import chunk_starts, layout_of
from .state import BedState, touching_pairs
from .values import State

__all__ = ["bed_energies", "body_pushes"]

Array = np.ndarray
Gap = Callable[[Array], tuple[Array, Array, Array]]
_TWO_E, _EIGHT_G, _PI_W = 0, 1, 7  # of a row of pair parameters


def bed_energies(bed: BedState, *, bodies: Mapping[int, Gap]) -> dict[str, float]:
    """Energies of the grains [J].

    Args:
        bodies: number of a body -> its surface as a function of points [m], shape [n, 3], in the bed: distance [m],
            shape [n]; outward normal, shape [n, 3]; curvature [1/m], shape [n]. The floor is known; a body that is not
            named counts as having no springs.

    Returns:
        kinetic (translation and rotation, at the time of the positions), potential (of gravity, from z = 0), normal,
        tangential, turning (springs of all contacts, bodies and floor included).
    """
    position, kept = (bed.engine.read(name).astype(float) for name in ("position", "velocity"))
    awake = slice(0, bed.awake_count)
    radius, (heavy, stout) = position[awake, 3], bed.heaviness()
    mass = kept[awake, 3]
    velocity, rates = bed.rates_now(position[awake], kept[awake], *bed.awake_rows("spin", "force", "torque"))
    moving = 0.5 * (heavy * mass) @ (velocity**2).sum(axis=1)
    turning = 0.2 * (stout * mass * radius**2) @ (rates**2).sum(axis=1)
    height = -(kept[:, 3] @ (position[:, :3] @ np.array(bed.gravity, dtype=float)))
    state = bed.state()
    surfaces: dict[int, Gap] = {}
    if bed.has_floor:
        surfaces[0] = lambda x: (x[:, 2], np.broadcast_to([0.0, 0.0, 1.0], x.shape), np.zeros(len(x)))
    law = COHESIONS[bed.material.cohesion]
    springs = _pairs(bed, state, law) + _near(state, surfaces | dict(bodies), law)
    names = ("normal", "tangential", "turning")
    found = {"kinetic": float(moving + turning), "potential": float(height)}
    return found | {name: float(value) for name, value in zip(names, springs, strict=True)}


def body_pushes(bed: BedState, *, bodies: Mapping[int, Gap]) -> tuple[Array, Array]:
    """Where grains touch bodies, and the forces of the normal springs on the bodies, cohesion included.

    Forces are those of ``dem.contact.law`` at rest: Hertz's 2/3 (2 E*) a d, DMT's less 2 pi w R*, or JKR's, which also
    pulls grains within its range of the surface (``dem.contact.cohesion``).

    ``bodies``: as for ``bed_energies``. Returns points on the bodies' surfaces [m] and forces [N], shape [contact, 3]
    both; without damping and friction.
    """
    state, law = bed.state(), COHESIONS[bed.material.cohesion]
    points, forces = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for body, surface in bodies.items():
        centres = state["position"][state["near_grain"][state["near_body"] == body]].astype(float)
        distance, normal, curvature = surface(centres[:, :3])
        radius = centres[:, 3] / (1 + centres[:, 3] * curvature)
        row = state["body_pair"][body].astype(float)
        a, push, _ = _normal_spring(law, row, centres[:, 3] - distance, radius)
        touching = a > 0
        points.append(centres[touching, :3] - distance[touching, None] * normal[touching])
        forces.append(-push[touching, None] * normal[touching])
    return np.concatenate(points), np.concatenate(forces)


def _springs(
    law: int, row: Array, overlap: Array, radius: Array, stretch: Array, turned: Array, normal: Array, share: Any
) -> Array:
    """Normal, tangential and turning springs of contacts [J], shape (3,); ``row`` their pairs' parameters."""
    a, _, pressed = _normal_spring(law, row, overlap, radius)
    k_t = row[..., _EIGHT_G] * a
    twist = (turned * normal).sum(axis=1)
    roll = (turned**2).sum(axis=1) - twist**2
    held = (pressed, 0.5 * k_t * (stretch**2).sum(axis=1), 0.5 * k_t * (radius**2 * roll + 0.5 * a**2 * twist**2))
    return np.array([float((share * part).sum()) for part in held])


def _normal_spring(law: int, row: Array, overlap: Array, radius: Array) -> tuple[Array, Array, Array]:
    """Contact radius [m], force [N] and energy [J] at an overlap, all 0 where the pair has parted."""
    two_e, pi_w = row[..., _TWO_E], row[..., _PI_W]
    if law == JKR and pi_w > 0:
        unit = (4 * pi_w * radius**2 / two_e) ** (1 / 3)
        d = overlap * radius / unit**2
        least = 0.25 ** (1 / 3)
        touching = d > -0.75 * least
        d = np.maximum(d, -0.75 * least)
        # The contact radius over ``unit`` is s^2, s the larger root of s^4 - s = d (``dem.contact.cohesion``).
        u = np.cbrt(1 / 16 + np.sqrt(np.maximum(0.0, 1 / 256 + d**3 / 27)))
        m = u - d / (3 * u)
        m = np.where(d > 0, 0.125 / (m * m + np.maximum(d, 0.0)), m)
        s = 0.5 * (np.sqrt(2 * m) + np.sqrt(np.maximum(0.0, 2 / np.sqrt(2 * m) - 2 * m)))

        def curve(s: Any) -> Any:
            return 16 / 15 * s**10 - 8 / 3 * s**7 + s**4

        force = pi_w * radius * (8 / 3 * s**6 - 4 * s**3)
        # With 2 pi w = E* unit^3 / R^2 every term has pi w unit^2 for a factor.
        energy = pi_w * unit**2 * (curve(s) - curve(least))
        return np.where(touching, unit * s**2, 0.0), np.where(touching, force, 0.0), np.where(touching, energy, 0.0)
    pressed = np.maximum(0.0, overlap)
    a = np.sqrt(radius * pressed)
    force, energy = 2 / 3 * two_e * a * pressed, 4 / 15 * two_e * a * pressed**2
    if law != DMT:
        return a, force, energy
    return a, force - 2 * pi_w * radius * (pressed > 0), energy - 2 * pi_w * radius * pressed


def _pairs(bed: BedState, state: State, law: int) -> Array:
    """Of two grains. A pair within a chunk is listed once, one across chunks by both."""
    count = bed.grain_count
    position = state["position"].astype(float)
    i, j, back = touching_pairs(state)
    d = position[i, :3] - position[j, :3]
    d[:, :2] += back * bed.size[:2]
    slide = state["slide"].astype(float)
    turned = state["roll"].astype(float) if "roll" in state else np.zeros_like(d)
    ends = chunk_starts(*layout_of(state))[1:]
    own = np.searchsorted(ends, i, side="right") == np.searchsorted(ends, j, side="right")
    awake, _, _, fast, _ = state.get("sleep_numbers", (count, 0, 0, count, 0))
    share = np.where(own | (j >= np.where(i < fast, fast, awake)), 1.0, 0.5)
    if "sleep_numbers" in state:
        parts = zip((i, j, d, slide, turned, share), _asleep(bed, state), strict=True)
        i, j, d, slide, turned, share = (np.concatenate(pair) for pair in parts)
    length = np.linalg.norm(d, axis=1)
    r_i, r_j = position[i, 3], position[j, 3]
    overlap = r_i + r_j - length
    row = np.array(bed.engine.grain_pair[None], dtype=float)
    return _springs(law, row, overlap, r_i * r_j / (r_i + r_j), slide[:, :3], turned, d / length[:, None], share)


def _asleep(bed: BedState, state: State) -> tuple[Array, ...]:
    """Of two sleepers: grains, distance, history and share of each contact, as ``_pairs`` has them."""
    grains = state["sleep_store_who"] >= 0
    owner, who = (state[f"sleep_store_{name}"][grains].astype(np.int64) for name in ("owner", "who"))
    place = np.argsort(state["id"])
    i, j = place[owner], place[who]
    d = (state["position"][i] - state["position"][j])[:, :3].astype(float)
    size = np.array(bed.size[:2])
    d[:, :2] -= size * np.round(d[:, :2] / size)
    n = bed.grain_count
    share = np.where(_twice(np.minimum(owner, who) * n + np.maximum(owner, who)), 0.5, 1.0)  # kept by both, or by one
    slide, turned = (state[f"sleep_store_{name}"][grains].astype(float) for name in ("slide", "roll"))
    return i, j, d, slide, turned[:, :3], share


def _twice(keys: Array) -> Array:
    """Whether each key comes more than once."""
    _, which, counts = np.unique(keys, return_inverse=True, return_counts=True)
    return np.asarray(counts[which.reshape(-1)] > 1)


def _near(state: State, surfaces: Mapping[int, Gap], law: int) -> Array:
    rows = [state[name] for name in ("near_grain", "near_body", "near_slide", "near_roll")]
    if "sleep_numbers" in state:
        bodies = state["sleep_store_who"] < 0
        owner, who, *springs = (state[f"sleep_store_{name}"][bodies] for name in ("owner", "who", "slide", "roll"))
        more = (np.argsort(state["id"])[owner], -1 - who, *springs)
        rows = [np.concatenate(pair) for pair in zip(rows, more, strict=True)]
    total = np.zeros(3)
    for body, surface in surfaces.items():
        mine = rows[1] == body
        centres = state["position"][rows[0][mine]].astype(float)
        distance, normal, curvature = surface(centres[:, :3])
        overlap = centres[:, 3] - distance
        radius = centres[:, 3] / (1 + centres[:, 3] * curvature)
        slide, turned = (values[mine].astype(float) for values in rows[2:])
        row = state["body_pair"][body].astype(float)
        total += _springs(law, row, overlap, radius, slide[:, :3], turned[:, :3], normal, 1.0)
    return total
