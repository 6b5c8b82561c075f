"""Slow plates and a cone against 3D-RFT, with the friction that a shear test of the same grains gives.

A level plate going straight down bears 0.876 xi_n z A, a cone xi_n alpha_z z^3 pi tan(b) / (3 cos(b)), b its
half-angle (`rigid.ground.rft` has alpha and xi_n). Both are for grains small against the body. Here they are not, so
both are
fitted in a form in which a margin of some grain around the body drops out: a plate bears as one of its diameter and the
margin, and the cube root of a cone's force is linear in depth.

A plate's force is linear only once a cone of grains at rest has grown under it, which it then pushes along: it starts
above zero, as if the plate were as much deeper as that cone has volume over area, a share of its diameter (Kang, Feng,
Liu & Blumenfeld 2018, Nat. Commun. 9:1101). 3D-RFT, which is local, knows the slope alone; so the share is fitted too.

Its mu is that of a continuum, shear over mean stress at the critical state (the flow rule that it was found with, after
Dunatunga & Kamrin 2015, J. Fluid Mech. 779:483), not shear over normal stress on the plane of shear, which is some 7 %
less of the same grains.
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from dem import Cone, Cylinder
from dem.measure.element import shear_element
from experiments.calibrate.tests import summary_of
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, listed, tracked, within
from experiments.validate.base.drops import BEADS, SPREAD, drive_down, part, prepared
from rigid.ground.laws import find_law
from rigid.ground.rft import flat_plate, stress_gradient, tractions

from . import say
from .impact import BALL, K_OVER_M, MASS

__all__ = ["CASES", "cone_coefficient", "plate_law"]

GRAIN = 0.0257 / 6  # as in the coarser bed of the case katsuragi-durian
SIZE = (26 * GRAIN, 26 * GRAIN, 18 * GRAIN)
GRAVITY, SEED = 9.81, 1
PLACES = ((0.25, 0.25), (0.75, 0.75))
PLATES = (5.0, 7.0, 9.0)  # diameters, over d
HALF_ANGLE = math.radians(30.0)
SPEED = 0.15  # [m/s]
PLATE_DEPTHS, CONE_DEPTHS = (2.0, 7.0), (3.5, 8.5)  # over which the law is fitted, over d
SAMPLES, PRESSURE, STRAIN, INERTIAL_NUMBER = range(1, 7), 1000.0, 2.0, 5e-3  # of the shear test: seeds; [Pa]
BAND = 0.25


def cone_coefficient(half_angle: float, *, surface_friction: float) -> float:
    """F / (xi_n z^3) of a cone that goes straight down, tip first [1]."""
    sine, cosine = math.sin(half_angle), math.cos(half_angle)
    alpha = float(tractions([[cosine, 0.0, -sine]], [0.0, 0.0, -1.0], surface_friction=surface_friction)[0, 2])
    return alpha * math.pi * math.tan(half_angle) / (3 * cosine)


def plate_law(pushes: Sequence[tuple[float, np.ndarray, np.ndarray]]) -> tuple[float, float, float]:
    """Stress gradient [Pa/m], margin [m] and share [1] of F = gradient (z + share D) pi / 4 (D + margin)^2.

    ``pushes``: diameter D [m], depths [m] and forces [N] of each plate; each counts alike, as stress over depth.
    """
    across = np.concatenate([np.full(len(depth), diameter) for diameter, depth, _ in pushes])
    deep, stress = (np.concatenate([push[k] for push in pushes]) for k in (1, 2))
    area = 0.25 * math.pi * across**2
    weight = np.concatenate([np.full(len(depth), 1 / math.sqrt(len(depth))) for _, depth, _ in pushes])
    stress = stress / area
    scale, grain = float((stress * weight**2).sum() / (deep * weight**2).sum()), 0.1 * float(across.min())

    def misses(x: np.ndarray) -> np.ndarray:
        model = x[0] * scale * (deep + x[2] * across) * (1 + x[1] * grain / across) ** 2
        return weight * (model - stress) / (scale * deep)

    found = least_squares(misses, [0.7, 0.5, 0.2]).x
    return float(found[0]) * scale, float(found[1]) * grain, float(found[2])


def _driven(name: str, shape: Cone | Cylinder, place: tuple[float, float], depth: float) -> dict[str, np.ndarray]:
    def compute() -> dict[str, np.ndarray]:
        bed = prepared(grain=GRAIN, size=SIZE, gravity=GRAVITY, seed=SEED)
        at = (place[0] * SIZE[0], place[1] * SIZE[1])
        return drive_down(bed, shape, at=at, speed=SPEED, depth=depth * GRAIN)

    return part("intrusion", {"body": name, "at": place, "depth": depth, "speed": SPEED, "size": SIZE}, compute)


def _sheared(seed: int) -> dict[str, np.ndarray]:
    """One sample at large strain: shear over mean stress and over that on its plane [1], packing fraction [1]."""

    def compute() -> dict[str, np.ndarray]:
        run = shear_element(
            BEADS, pressure=PRESSURE, grain=GRAIN, spread=SPREAD, strain=STRAIN, inertial_number=INERTIAL_NUMBER,
            seed=seed,
        )  # fmt: skip
        said = summary_of(run, BEADS.density)
        late = run.inside_strain > 0.5 * STRAIN
        return {
            "over_mean": np.array(3 * said["shear"] / float(np.trace(said["tensor"]))),
            "over_normal": np.array(said["shear"] / said["normal"]),
            "packing": np.array(run.packing[late].mean()),
        }

    return part("sheared", {"seed": seed, "pressure": PRESSURE, "strain": STRAIN, "number": INERTIAL_NUMBER}, compute)


def _between(run: dict[str, np.ndarray], depths: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    inside = (run["depth"] >= depths[0] * GRAIN) & (run["depth"] <= depths[1] * GRAIN)
    return run["depth"][inside], run["force"][inside]


def _compute(tell: Tell) -> Outcome:
    samples = [_sheared(seed) for seed in tracked(SAMPLES, within(tell, 0.0, 0.4))]
    means_of = {key: np.array([float(one[key]) for one in samples]) for key in ("over_mean", "over_normal", "packing")}
    mu, density = float(means_of["over_mean"].mean()), float(means_of["packing"].mean()) * BEADS.density
    gradient = stress_gradient(bulk_density=density, friction=mu, gravity=GRAVITY)
    height = (CONE_DEPTHS[1] + 2) * GRAIN
    cone_shape = Cone(0.0, height, 0.0, height * math.tan(HALF_ANGLE))
    cones = [_driven("cone", cone_shape, place, CONE_DEPTHS[1] + 0.5) for place in PLACES]
    pushes, means, curves = [], [], []
    for across in tracked(PLATES, within(tell, 0.5, 1.0)):
        diameter = across * GRAIN
        shape, name = Cylinder(0.0, GRAIN, 0.5 * diameter), f"plate {across:g}"
        runs = [_driven(name, shape, place, PLATE_DEPTHS[1] + 0.5) for place in PLACES]
        pieces = [_between(run, PLATE_DEPTHS) for run in runs]
        pushes += [(diameter, *piece) for piece in pieces]
        law = flat_plate() * gradient * 0.25 * math.pi * diameter**2
        means.append([float(force.mean() / (law * depth.mean())) for depth, force in pieces])
        grid = np.linspace(0.0, PLATE_DEPTHS[1] * GRAIN, 50)
        mean = np.mean([np.interp(grid, run["depth"], run["force"]) for run in runs], axis=0)
        curves += [Curve(f"3D-RFT, {across:g} d", 1e3 * grid, law * grid, False),
                   Curve(f"plate of {across:g} d", 1e3 * grid, mean)]  # fmt: skip
    found, margin, share = plate_law(pushes)
    left_out = [plate_law([*pushes[:k], *pushes[k + 1 :]])[0] for k in range(len(pushes))]
    error = math.sqrt((len(left_out) - 1) * float(np.var(left_out)))
    roots = [np.polyfit(z, np.cbrt(np.maximum(f, 0.0)), 1)[0] for z, f in (_between(run, CONE_DEPTHS) for run in cones)]
    cone = float(np.mean(roots)) ** 3
    wanted_cone = gradient * cone_coefficient(HALF_ANGLE, surface_friction=BEADS.friction)
    rows = [
        Comparison("stress gradient under plates", "MPa/m", 1e-6 * flat_plate() * gradient, 1e-6 * found, BAND),
        Comparison("margin around the plates, over d", "1", 0.5, margin / GRAIN, 0.5, False),
        Comparison("F / z^3 of the cone", "MPa/m", 1e-6 * wanted_cone, 1e-6 * cone, BAND),
    ]
    steep = (3 * 894 * mu**2 - 2 * 386 * mu + 89) / (894 * mu**3 - 386 * mu**2 + 89 * mu)
    pairs = [" and ".join(f"{one:.2f}" for one in each) for each in means]
    shares = "; ".join(f"{pair} at {across:g} d" for across, pair in zip(PLATES, pairs, strict=True))
    stagnant = math.tan(math.radians(45) + 0.5 * math.asin(min(1.0, mu))) / 6
    remark = say(
        "plates", mu=mu, over_mean=listed(means_of["over_mean"], ".3g"), over_normal=means_of["over_normal"].mean(),
        density=density, steep=steep, shares=shares, gradient=1e-6 * found, error=1e-6 * error, share=share,
        stagnant=stagnant, half_angle=math.degrees(HALF_ANGLE), speed=SPEED, grain=1e3 * GRAIN, wide=SIZE[0] / GRAIN,
        deep=SIZE[2] / GRAIN, plate_depths=PLATE_DEPTHS[0], plate_depths_2=PLATE_DEPTHS[1],
        cone_depths=CONE_DEPTHS[0], cone_depths_2=CONE_DEPTHS[1], roots=listed(1e-6 * np.array(roots) ** 3, ".3g"),
    )  # fmt: skip
    whole_ball, radius = find_law("rft"), 0.5 * BALL
    beads = {"radius": radius, "bulk_density": 1520.0, "friction": math.tan(math.radians(24)), "gravity": GRAVITY}
    asked = whole_ball.force(radius, 0.0, whole_ball.numbers(beads))
    beside = say("beside_beads", asked=asked, ball=1e3 * BALL, measured=K_OVER_M * MASS * radius)
    return Outcome(rows, [Plot("Plates going down", "depth [mm]", "force [N]", curves)], [remark, beside])


CASES = {"rft": _compute}
