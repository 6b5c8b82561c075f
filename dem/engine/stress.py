"""The contacts of a bed at rest, with their forces, and the stress that they carry.

Forces are those of the springs, from overlaps and histories as the state keeps them: exact for a bed at rest, without
what dashpots add in one that moves.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dem.contact.cohesion import jkr_contact
from dem.contact.law import effective_moduli
from dem.shapes.basic import PLANE

from .state import BedState, touching_pairs
from .values import State

__all__ = ["Contacts", "find_contacts", "stress_profile"]

Array = np.ndarray


@dataclass(frozen=True)
class Contacts:
    """Every contact once.

    Attributes:
        first: grain ids, shape [contact_count].
        second: ids of the other grain; -1 less the body's number for a body, so -1 is the floor.
        position: of the first grain [m], shape [contact_count, 3].
        branch: to it from the other grain's centre, or from the touched point of a body [m], shape [contact_count, 3].
        force: on the first [N], shape [contact_count, 3].
        overlap: [m], shape [contact_count].
    """

    first: np.ndarray
    second: np.ndarray
    position: np.ndarray
    branch: np.ndarray
    force: np.ndarray
    overlap: np.ndarray


def find_contacts(bed: BedState) -> Contacts:
    """The contacts of a bed with their spring forces. Of its bodies those count that are planes, as the floor is."""
    state = bed.state()
    ids, position = state["id"], state["position"].astype(float)
    first, second, back = touching_pairs(state)
    once = first < second  # a pair across chunks is listed by both
    first, second, back, slide = first[once], second[once], back[once], state["slide"][once, :3].astype(float)
    branch = position[first, :3] - position[second, :3]
    branch[:, :2] += back * bed.size[:2]
    length = np.linalg.norm(branch, axis=1)
    radii = position[first, 3], position[second, 3]
    overlap = radii[0] + radii[1] - length
    stuff = bed.material
    young, shear = effective_moduli(stuff.young, stuff.poisson, stuff.young, stuff.poisson)
    pair = (2 * young, 8 * shear, stuff.friction, 2 * math.pi * stuff.surface_energy)
    radius = radii[0] * radii[1] / (radii[0] + radii[1])
    force = _spring_force(stuff.cohesion, pair, branch / length[:, None], overlap, radius, slide)
    found = [Contacts(ids[first], ids[second], position[first, :3], branch, force, overlap)]
    for body, (start, end) in enumerate(state["body_primitives"][: int(state["numbers"][1])]):
        if end == start + 1 and state["primitive_kind"][start] == PLANE:
            found.append(_on_plane(state, body, stuff.cohesion))
    return Contacts(*(np.concatenate([getattr(part, name) for part in found]) for name in Contacts.__annotations__))


def _on_plane(state: State, body: int, cohesion: str) -> Contacts:
    row = state["primitive_row"][state["body_primitives"][body][0]].astype(float)
    turn = state["body_turn"][body].astype(float)
    normal = _turned(turn, row[3:6])
    point = state["body_position"][body].astype(float) + _turned(turn, row[:3])
    here = state["near_body"] == body
    grain = state["near_grain"][here]
    position = state["position"][grain].astype(float)
    overlap = position[:, 3] - (position[:, :3] - point) @ normal
    two_e, eight_g, _, friction, _, _, _, pi_w = state["body_pair"][body].astype(float)
    slide, normals = state["near_slide"][here, :3].astype(float), np.tile(normal, (len(grain), 1))
    force = _spring_force(cohesion, (two_e, eight_g, friction, pi_w), normals, overlap, position[:, 3], slide)
    touches = np.abs(force).sum(axis=1) > 0
    branch = (position[:, 3] - overlap)[:, None] * normal
    found = (state["id"][grain], np.full(len(grain), -1 - body), position[:, :3], branch, force, overlap)
    return Contacts(*(values[touches] for values in found))


def _turned(q: np.ndarray, x: np.ndarray) -> np.ndarray:
    """x turned by the unit quaternion q, scalar first."""
    t = 2 * np.cross(q[1:], x)
    return x + q[0] * t + np.cross(q[1:], t)


def _spring_force(
    cohesion: str, pair: tuple[float, float, float, float], normal: Array, overlap: Array, radius: Array, slide: Array
) -> Array:
    """The forces of ``dem.contact.law`` at rest; ``pair``: 2 E*, 8 G*, friction, pi w. Zero where there is no
    contact."""
    two_e, eight_g, friction, pi_w = pair
    deep = np.maximum(overlap, 0.0)
    a = np.sqrt(radius * deep)
    along = two_e * a * deep * (2 / 3)
    pull = np.zeros_like(a)
    touches = overlap > 0
    if cohesion == "dmt":
        pull = np.where(touches, 2 * pi_w * radius, 0.0)
        along = along - pull
    elif cohesion == "jkr" and pi_w > 0:
        for k, (d, r) in enumerate(zip(overlap, radius, strict=True)):
            try:
                a[k], along[k] = jkr_contact(
                    float(d), surface_energy=pi_w / (2 * math.pi), radius=float(r), effective_young=two_e / 2
                )
            except ValueError:  # not within reach
                continue
            pull[k] = 3 * pi_w * r
            touches[k] = True
    bound = friction * np.abs(along + pull)
    across = -eight_g * a[:, None] * (slide - (slide * normal).sum(axis=1)[:, None] * normal)
    size = np.linalg.norm(across, axis=1)
    share = np.where(size > bound, bound / np.where(size > 0, size, 1.0), 1.0)
    return np.where(touches[:, None], along[:, None] * normal + share[:, None] * across, 0.0)


def stress_profile(
    bed: BedState, edges: np.ndarray, *, contacts: Contacts | None = None, across: Sequence[float] | None = None
) -> np.ndarray:
    """Mean stress between horizontal planes [Pa], pressure positive: sum of f l over the volume (Love, Weber).

    A contact counts in a layer with the share of its branch that lies there. So the vertical stress on a level bed is
    the weight above over the area.

    Args:
        edges: heights of the planes [m], ascending, shape [layer_count + 1].
        contacts: those of ``find_contacts``, where they are known already.
        across: (from, to) [m]: only this part of the bed's width in x.

    Returns stress tensors, shape [layer_count, 3, 3].
    """
    found = find_contacts(bed) if contacts is None else contacts
    width, force, branch, top = bed.size[0], found.force, found.branch, found.position[:, 2]
    if across is not None:
        middle = np.mod(found.position[:, 0] - 0.5 * branch[:, 0], bed.size[0])
        inside = (middle >= across[0]) & (middle < across[1])
        width, force, branch, top = across[1] - across[0], force[inside], branch[inside], top[inside]
    low = np.minimum(top, top - branch[:, 2])
    high = np.maximum(low + 1e-12 * bed.size[2], np.maximum(top, top - branch[:, 2]))
    stresses = np.empty((len(edges) - 1, 3, 3))
    for k, (below, above) in enumerate(itertools.pairwise(edges)):
        share = np.clip((np.minimum(high, above) - np.maximum(low, below)) / (high - low), 0.0, 1.0)
        stresses[k] = np.einsum("n,na,nb->ab", share, force, branch) / (width * bed.size[1] * (above - below))
    return stresses
