"""Slow plates and a cone against 3D-RFT: one plate calibrates its stress xi_n, the others and the cone are predicted.

A level plate going straight down bears 0.876 xi_n z A, a cone xi_n alpha_z z^3 pi tan(b) / (3 cos(b)), b its
half-angle (`rigid.ground.rft` has alpha and xi_n). The law has one number of the material, xi_n. As in experiments (Li,
Zhang & Goldman 2013, Science 339:1408) it is taken from one plate, the largest, and not from the friction angle. The
cubic in mu that 3D-RFT gives for it is far from such grains (docs/validation.md). It says nothing about how forces
depend on area and shape, which is what the law is for.

Forces are means over the same depths for all, from half to the whole width of the largest plate: nearer to the surface
a plate bears in proportion to its width rather than to its depth, which no law of z A has. 3D-RFT is for grains small
against the body; here the largest plate is fifteen of them wide.
"""

import math
from collections.abc import Mapping

import numpy as np

from dem import Cone, Cylinder
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, listed, tracked
from experiments.validate.base.drops import BEADS, STRUCK, drive_down, part, prepared
from experiments.validate.measured.impact import BALL, K_OVER_M, MASS
from rigid.ground.laws import find_law
from rigid.ground.rft import flat_plate, stress_gradient, tractions

from . import say

__all__ = ["CASES", "cone_coefficient"]

GRAIN = 0.0257 / 6  # as in the coarser bed of the case katsuragi-durian
SIZE = (45 * GRAIN, 45 * GRAIN, 30 * GRAIN)
GRAVITY, SEEDS = 9.81, (1, 2, 3)
PLATES = (15.0, 10.0, 7.0)  # diameters, over d; the first calibrates
HALF_ANGLE = math.radians(30.0)
SPEED = 0.15  # [m/s]
DEPTHS = (7.5, 15.0)  # over which forces are taken, over d
STIFFER = 1.5  # than a bed would be by itself, which is made for half of what a plate bears
MU = 0.459  # shear over mean stress of six sheared samples of these beads at large strain, 2026-11-23
BAND = 0.25


def cone_coefficient(half_angle: float, *, surface_friction: float) -> float:
    """F / (xi_n z^3) of a cone that goes straight down, tip first [1]."""
    sine, cosine = math.sin(half_angle), math.cos(half_angle)
    alpha = float(tractions([[cosine, 0.0, -sine]], [0.0, 0.0, -1.0], surface_friction=surface_friction)[0, 2])
    return alpha * math.pi * math.tan(half_angle) / (3 * cosine)


def _driven(name: str, shape: Cone | Cylinder, seed: int) -> dict[str, np.ndarray]:
    def compute() -> Mapping[str, np.ndarray]:
        bed = prepared(grain=GRAIN, size=SIZE, gravity=GRAVITY, seed=seed, stiffer=STIFFER)
        bed.overlap_limit = STRUCK
        about = {"packing": np.array(bed.packing_fraction), "count": np.array(bed.grain_count)}
        at = (0.5 * SIZE[0], 0.5 * SIZE[1])
        return about | drive_down(bed, shape, at=at, speed=SPEED, depth=(DEPTHS[1] + 0.5) * GRAIN)

    numbers = {"grain": GRAIN, "size": SIZE, "stiffer": STIFFER, "speed": SPEED, "depth": DEPTHS[1]}
    return part("intrusion", {"body": name, "seed": seed, **numbers}, compute)


def _mean_over(run: Mapping[str, np.ndarray], law: np.ndarray) -> float:
    """Mean force over the mean of a law at the same depths: xi_n, where the law is of xi_n = 1."""
    inside = (run["depth"] >= DEPTHS[0] * GRAIN) & (run["depth"] <= DEPTHS[1] * GRAIN)
    return float(run["force"][inside].mean() / law[inside].mean())


def _compute(tell: Tell) -> Outcome:
    height = (DEPTHS[1] + 2) * GRAIN
    areas = [0.25 * math.pi * (across * GRAIN) ** 2 for across in PLATES]
    pointed = cone_coefficient(HALF_ANGLE, surface_friction=BEADS.friction)
    # Of each body its name, its shape, and F = xi_n a z^b by the law as (a, b).
    bodies: list[tuple[str, Cone | Cylinder, float, int]] = [
        (f"plate of {across:g} d", Cylinder(0.0, GRAIN, 0.5 * across * GRAIN), flat_plate() * area, 1)
        for across, area in zip(PLATES, areas, strict=True)
    ]
    bodies.append(("cone", Cone(0.0, height, 0.0, height * math.tan(HALF_ANGLE)), pointed, 3))
    jobs = [(name, shape, seed) for name, shape, _, _ in bodies for seed in SEEDS]
    runs = [_driven(*job) for job in tracked(jobs, tell)]
    each, curves = [], []
    grid = np.linspace(0.0, DEPTHS[1] * GRAIN, 50)
    for k, (name, _, factor, power) in enumerate(bodies):
        own = runs[k * len(SEEDS) : (k + 1) * len(SEEDS)]
        each.append(np.array([_mean_over(run, factor * run["depth"] ** power) for run in own]))
        law = each[0].mean() * factor * grid**power
        mean = np.mean([np.interp(grid, run["depth"], run["force"]) for run in own], axis=0)
        curves += [Curve(f"3D-RFT, {name}", 1e3 * grid, law, False), Curve(name, 1e3 * grid, mean)]
    found = float(each[0].mean())
    rows = [
        Comparison(f"force of the {name}, over the calibrated law", "1", 1.0, float(ratio.mean()) / found, BAND)
        for (name, *_), ratio in zip(bodies[1:], each[1:], strict=True)
    ]
    density = float(np.mean([run["packing"] for run in runs])) * BEADS.density
    cubic = stress_gradient(bulk_density=density, friction=MU, gravity=GRAVITY)
    spread = [100 * float(one.std(ddof=1)) / math.sqrt(len(one)) / float(one.mean()) for one in each]
    remark = say(
        "plates", found=1e-6 * found, seeds=len(SEEDS), cubic=1e-6 * cubic, mu=MU, density=density, largest=PLATES[0],
        spread=listed(spread, ".0f"), half_angle=math.degrees(HALF_ANGLE), speed=SPEED, grain=1e3 * GRAIN,
        wide=SIZE[0] / GRAIN, deep=SIZE[2] / GRAIN, first=DEPTHS[0], last=DEPTHS[1], count=int(runs[0]["count"]),
    )  # fmt: skip
    whole_ball, radius = find_law("rft"), 0.5 * BALL
    beads = {"radius": radius, "bulk_density": 1520.0, "friction": math.tan(math.radians(24)), "gravity": GRAVITY}
    asked = whole_ball.force(radius, 0.0, whole_ball.numbers(beads))
    beside = say("beside_beads", asked=asked, ball=1e3 * BALL, measured=K_OVER_M * MASS * radius)
    return Outcome(rows, [Plot("Plates and a cone going down", "depth [mm]", "force [N]", curves)], [remark, beside])


CASES = {"rft": _compute}
