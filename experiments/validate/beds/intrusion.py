"""Slow plates and a cone against 3D-RFT: one plate calibrates its stress xi_n, the others and the cone are predicted.

A level plate going straight down bears 0.876 xi_n z A, a cone xi_n alpha_z z^3 pi tan(b) / (3 cos(b)), b its
half-angle (`rigid.ground.rft` has alpha and xi_n). The law has one number of the material, xi_n; as in experiments
(Li, Zhang & Goldman 2013, Science 339:1408) it is taken from one plate here, the largest, and not from the friction
angle: the cubic in mu that 3D-RFT gives for it is far from such grains (docs/validation.md), and says nothing about
how forces go with area and shape, which is what the law is for.

Forces are means over depths at which a plate's force is past its transient, in three beds. 3D-RFT is for grains small
against the body; here the largest plate is nine of them wide.
"""

import math
from collections.abc import Mapping

import numpy as np

from dem import Cone, Cylinder
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, listed, tracked
from experiments.validate.base.drops import BEADS, drive_down, part, prepared
from experiments.validate.measured.impact import BALL, K_OVER_M, MASS
from rigid.ground.laws import find_law
from rigid.ground.rft import flat_plate, stress_gradient, tractions

from . import say

__all__ = ["CASES", "cone_coefficient"]

GRAIN = 0.0257 / 6  # as in the coarser bed of the case katsuragi-durian
SIZE = (26 * GRAIN, 26 * GRAIN, 18 * GRAIN)
GRAVITY, SEEDS = 9.81, (1, 2, 3)
PLATES = (9.0, 7.0, 5.0)  # diameters, over d; the first calibrates
HALF_ANGLE = math.radians(30.0)
SPEED = 0.15  # [m/s]
PLATE_DEPTHS, CONE_DEPTHS = (2.0, 7.0), (3.5, 8.5)  # over which forces are taken, over d
MU = 0.459  # shear over mean stress of six sheared samples of these beads at large strain, 2026-11-23
BAND = 0.25


def cone_coefficient(half_angle: float, *, surface_friction: float) -> float:
    """F / (xi_n z^3) of a cone that goes straight down, tip first [1]."""
    sine, cosine = math.sin(half_angle), math.cos(half_angle)
    alpha = float(tractions([[cosine, 0.0, -sine]], [0.0, 0.0, -1.0], surface_friction=surface_friction)[0, 2])
    return alpha * math.pi * math.tan(half_angle) / (3 * cosine)


def _driven(name: str, shape: Cone | Cylinder, seed: int, depth: float) -> dict[str, np.ndarray]:
    def compute() -> Mapping[str, np.ndarray]:
        bed = prepared(grain=GRAIN, size=SIZE, gravity=GRAVITY, seed=seed)
        found = drive_down(bed, shape, at=(0.5 * SIZE[0], 0.5 * SIZE[1]), speed=SPEED, depth=depth * GRAIN)
        return found | {"packing": np.array(bed.packing_fraction)}

    return part("intrusion", {"body": name, "seed": seed, "depth": depth, "speed": SPEED, "size": SIZE}, compute)


def _work_over(run: Mapping[str, np.ndarray], depths: tuple[float, float], law: np.ndarray) -> float:
    """Mean force over the mean of a law at the same depths: xi_n, where the law is of xi_n = 1."""
    inside = (run["depth"] >= depths[0] * GRAIN) & (run["depth"] <= depths[1] * GRAIN)
    return float(run["force"][inside].mean() / law[inside].mean())


def _compute(tell: Tell) -> Outcome:
    height = (CONE_DEPTHS[1] + 2) * GRAIN
    bodies: list[tuple[str, Cone | Cylinder, tuple[float, float]]] = [
        (f"plate of {across:g} d", Cylinder(0.0, GRAIN, 0.5 * across * GRAIN), PLATE_DEPTHS) for across in PLATES
    ]
    bodies.append(("cone", Cone(0.0, height, 0.0, height * math.tan(HALF_ANGLE)), CONE_DEPTHS))
    areas = [0.25 * math.pi * (across * GRAIN) ** 2 for across in PLATES]
    pointed = cone_coefficient(HALF_ANGLE, surface_friction=BEADS.friction)
    jobs = [(k, seed) for k in range(len(bodies)) for seed in SEEDS]
    runs = [_driven(bodies[k][0], bodies[k][1], seed, bodies[k][2][1] + 0.5) for k, seed in tracked(jobs, tell)]
    each, curves = [], []
    for k, (name, _, depths) in enumerate(bodies):
        own = runs[k * len(SEEDS) : (k + 1) * len(SEEDS)]
        laws = [
            pointed * run["depth"] ** 3 if k == len(areas) else flat_plate() * areas[k] * run["depth"] for run in own
        ]
        each.append(np.array([_work_over(run, depths, law) for run, law in zip(own, laws, strict=True)]))
        grid = np.linspace(0.0, depths[1] * GRAIN, 50)
        law = each[0].mean() * (pointed * grid**3 if k == len(areas) else flat_plate() * areas[k] * grid)
        mean = np.mean([np.interp(grid, run["depth"], run["force"]) for run in own], axis=0)
        curves += [Curve(f"3D-RFT, {name}", 1e3 * grid, law, False), Curve(name, 1e3 * grid, mean)]
    found = float(each[0].mean())
    rows = [
        Comparison(f"force of the {name}, over the calibrated law", "1", 1.0, float(ratio.mean()) / found, BAND)
        for (name, _, _), ratio in zip(bodies[1:], each[1:], strict=True)
    ]
    density = float(np.mean([run["packing"] for run in runs])) * BEADS.density
    cubic = stress_gradient(bulk_density=density, friction=MU, gravity=GRAVITY)
    spread = [100 * float(one.std(ddof=1)) / math.sqrt(len(one)) / float(one.mean()) for one in each]
    remark = say(
        "plates", found=1e-6 * found, seeds=len(SEEDS), cubic=1e-6 * cubic, mu=MU, density=density, largest=PLATES[0],
        spread=listed(spread, ".0f"), half_angle=math.degrees(HALF_ANGLE), speed=SPEED, grain=1e3 * GRAIN,
        wide=SIZE[0] / GRAIN, deep=SIZE[2] / GRAIN, plate_depths=PLATE_DEPTHS[0], plate_depths_2=PLATE_DEPTHS[1],
        cone_depths=CONE_DEPTHS[0], cone_depths_2=CONE_DEPTHS[1],
    )  # fmt: skip
    whole_ball, radius = find_law("rft"), 0.5 * BALL
    beads = {"radius": radius, "bulk_density": 1520.0, "friction": math.tan(math.radians(24)), "gravity": GRAVITY}
    asked = whole_ball.force(radius, 0.0, whole_ball.numbers(beads))
    beside = say("beside_beads", asked=asked, ball=1e3 * BALL, measured=K_OVER_M * MASS * radius)
    return Outcome(rows, [Plot("Plates and a cone going down", "depth [mm]", "force [N]", curves)], [remark, beside])


CASES = {"rft": _compute}
