"""Janssen's silo: what the floor of a narrow box with rough walls carries, at three depths of filling.

Four plane walls of width D stand in the periodic box. Grains are rained in and come to rest in a drag. Then the walls
rise slowly, so that friction acts upwards all along them, as Janssen 1895 assumes and as experiments arrange it. With
one K for the ratio of the stresses the floor carries
    W_f = W_s (1 - exp(-W / W_s)),  W_s = rho g D^3 / (4 mu_w K),
W the weight poured in. K is not known beforehand: one W_s is fitted to the three fillings. Coulomb's law bounds the
friction of the walls by mu_w times what presses on them; Janssen takes it as reached all over.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from dem import Bed, Facing, Material
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, listed, near_zero, tracked
from experiments.validate.base.spheres import upright_walls

from . import say

__all__ = ["CASES", "Filling", "fill"]

GRAIN, WIDTH = 0.0025, 0.02  # diameter, and D [m]
STUFF = Material("silo", 2600.0, 5e6, 0.25, 0.5, 0.5, 0.1)
WALL_FRICTION, GRAVITY = 0.3, 9.81
DEPTHS = (1.5, 3.0, 5.0)  # of the filling, over D
PACKING = 0.58  # expected, to choose how many grains
RISE, RISEN, WEIGHED = 2e-3, 0.25, 0.1  # speed of the walls [m/s], for how long, and over which time at its end [s]
DRAG, SETTLED = 0.02, 0.5  # time constant of the drag while it is filled [s], and for how long [s]


@dataclass(frozen=True)
class Filling:
    """A filling weighed while the walls rise."""

    weight: float  # of the grains [N]
    floor: float  # what the floor carries [N]
    friction: float  # of the walls together, upwards on the grains [N]
    pressing: float  # of the walls together, along the normal [N]
    height: float  # of the highest grain's centre [m]
    count: int  # of grains


def fill(depth: float, *, seed: int = 3) -> Filling:
    """Fill to a depth over D, let the walls rise, weigh."""
    rng = np.random.default_rng(seed)
    count = round(depth * WIDTH**3 * PACKING / (math.pi / 6 * GRAIN**3))
    side = int(WIDTH / (1.25 * GRAIN))
    pitch = WIDTH / side
    k = np.arange(count)
    places = np.column_stack([k % side + 0.5, k // side % side + 0.5, k // side**2 + 0.6]) * pitch
    places += rng.uniform(-0.05, 0.05, (count, 3)) * GRAIN
    margin = 1.5 * GRAIN
    bed = Bed.from_grains(
        STUFF, positions=places + [margin, margin, 0.0], radii=GRAIN / 2 * (1 + 0.1 * rng.uniform(-1, 1, count)),
        size=(WIDTH + 2 * margin, WIDTH + 2 * margin, depth * WIDTH), gravity=GRAVITY,
        floor=Facing(rolling_friction=0.0),
    )  # fmt: skip
    rough = {"friction": WALL_FRICTION, "rolling_friction": 0.0}
    upright = upright_walls(WIDTH, WIDTH, margin)
    walls = [(bed.add_body([wall], position=at, **rough), axis, sign) for axis, sign, wall, at in upright]
    fall = math.sqrt(2 * float(places[:, 2].max()) / GRAVITY)
    bed.advance(round((fall + SETTLED) / bed.time_step), drag_time=DRAG)
    for wall, _, _ in walls:
        bed.move_body(wall, velocity=(0.0, 0.0, RISE))
    bed.advance(round((RISEN - WEIGHED) / bed.time_step))
    bed.advance(round(WEIGHED / bed.time_step))
    forces = [(bed.reaction(wall)[0], axis, sign) for wall, axis, sign in walls]
    return Filling(
        weight=bed.weight, floor=bed.floor_force, friction=-sum(float(force[2]) for force, _, _ in forces),
        pressing=-sum(float(sign * force[axis]) for force, axis, sign in forces),
        height=float(bed.grains().position[:, 2].max()), count=count,
    )  # fmt: skip


def carried(weight: np.ndarray | float, scale: float) -> np.ndarray:
    """Janssen's W_f [N] for the weights poured in and W_s [N]."""
    return scale * (1 - np.exp(-np.asarray(weight) / scale))


def _compute(tell: Tell) -> Outcome:
    found = [fill(depth) for depth in tracked(DEPTHS, tell)]
    weights, floors = (np.array([getattr(one, name) for one in found]) for name in ("weight", "floor"))
    fit = minimize_scalar(
        lambda s: float((((carried(weights, s) - floors) / floors) ** 2).sum()),
        bounds=(0.1 * floors[-1], 10 * weights[-1]),
    )
    scale = float(fit.x)
    held = [one.friction / one.pressing for one in found]
    rows = []
    for depth, one, share in zip(DEPTHS, found, held, strict=True):
        borne, beyond = (one.floor + one.friction) / one.weight, max(0.0, share - WALL_FRICTION)
        fitted = float(carried(one.weight, scale))
        rows += [
            Comparison(f"floor and walls over the weight, {depth:g} D", "1", 1.0, borne, 0.01),
            near_zero(f"friction over pressing at the walls, beyond mu_w, {depth:g} D", beyond, 1e-3),
            Comparison(f"floor force, {depth:g} D, with one K for the three", "N", fitted, one.floor, 0.1),
        ]
    deepest = found[-1]
    bulk = deepest.weight / (GRAVITY * WIDTH**2 * deepest.height)
    ratio = bulk * GRAVITY * WIDTH**3 / (4 * held[-1] * scale)
    line = np.linspace(0, weights[-1], 60)
    curves = [
        Curve("Janssen", line, carried(line, scale), False),
        Curve("no friction", line, line, False),
        Curve("bed", weights, [one.floor for one in found]),
    ]
    shares = ", ".join(f"{100 * one.floor / one.weight:.0f} % at {d:g} D" for d, one in zip(DEPTHS, found, strict=True))
    remark = say(
        "silo", found=listed((one.count for one in found), "d"), grain=1e3 * GRAIN, wide=WIDTH / GRAIN, shares=shares,
        held=listed(held, ".3f"), wall_friction=WALL_FRICTION, ratio=ratio, bulk=bulk,
    )  # fmt: skip
    return Outcome(rows, [Plot("What the floor carries", "weight poured in [N]", "on the floor [N]", curves)], [remark])


CASES = {"janssen": _compute}
