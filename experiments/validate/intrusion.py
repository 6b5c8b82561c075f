"""Slow plates and a cone against 3D-RFT, with the friction that a shear test of the same bed gives.

A level plate going straight down bears 0.876 xi_n z A, a cone xi_n alpha_z z^3 pi tan(b) / (3 cos(b)), b its
half-angle (`rigid.rft` has alpha and xi_n). Both are for grains small against the body. Here they are not, so both are
fitted in a form in which a margin of some grain around the body drops out: sqrt(dF/dz) of plates is linear in their
diameter, with the margin where it cuts the axis, and the cube root of a cone's force is linear in depth.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from dem import Cone, Cylinder
from dem.shearing import shear_bed
from experiments.bed_shear import strength_of
from rigid.rft import flat_plate, stress_gradient, tractions

from .case import Case, Comparison, Curve, Outcome, Plot
from .drops import BEADS, drive_down, prepared
from .parts import part

__all__ = ["CASES", "cone_coefficient", "plate_law"]

GRAIN = 0.0257 / 6  # as in the coarser bed of the case katsuragi-durian: the bed is the same
SIZE = (3.2 * 0.0257, 3.2 * 0.0257, 2.15 * 0.0257)
GRAVITY, SEED = 9.81, 1
PLACES = ((0.25, 0.25), (0.75, 0.75))
PLATES = (3.5, 5.0, 7.0)  # diameters, over d
HALF_ANGLE = math.radians(30.0)
SPEED = 0.15  # [m/s]
PLATE_DEPTHS, CONE_DEPTHS = (1.5, 5.0), (2.5, 7.0)  # over which the law is fitted, over d
PRESSURES, WAY, INERTIAL_NUMBER = (1.0, 3.0), 6.0, 5e-3  # of the shear test: over the bed's weight; over d
BAND = 0.25


def cone_coefficient(half_angle: float, *, surface_friction: float) -> float:
    """F / (xi_n z^3) of a cone that goes straight down, tip first [1]."""
    sine, cosine = math.sin(half_angle), math.cos(half_angle)
    alpha = float(tractions([[cosine, 0.0, -sine]], [0.0, 0.0, -1.0], surface_friction=surface_friction)[0, 2])
    return alpha * math.pi * math.tan(half_angle) / (3 * cosine)


def plate_law(diameters: Sequence[float], slopes: Sequence[float]) -> tuple[float, float]:
    """Stress gradient [Pa/m] and margin [m] from dF/dz [N/m] of plates: dF/dz = gradient pi / 4 (D + margin)^2."""
    rise, start = np.polyfit(diameters, np.sqrt(np.asarray(slopes) * 4 / math.pi), 1)
    return float(rise) ** 2, float(start / rise)


def _driven(name: str, shape: Cone | Cylinder, place: tuple[float, float], depth: float) -> dict[str, np.ndarray]:
    def compute() -> dict[str, np.ndarray]:
        bed = prepared(grain=GRAIN, size=SIZE, gravity=GRAVITY, seed=SEED)
        at = (place[0] * SIZE[0], place[1] * SIZE[1])
        return drive_down(bed, shape, at=at, speed=SPEED, depth=depth * GRAIN)

    return part("intrusion", {"body": name, "at": place, "depth": depth, "speed": SPEED, "size": SIZE}, compute)


def _sheared(pressure: float) -> dict[str, np.ndarray]:
    """Critical and peak stress ratio [1], normal stress [Pa], and the bed's density [kg/m3]."""

    def compute() -> dict[str, np.ndarray]:
        bed = prepared(grain=GRAIN, size=SIZE, gravity=GRAVITY, seed=SEED)
        density = bed.packing_fraction * BEADS.density
        run = shear_bed(
            bed, pressure=pressure * bed.weight / (SIZE[0] * SIZE[1]), way=WAY * GRAIN,
            inertial_number=INERTIAL_NUMBER, grain=GRAIN,
        )  # fmt: skip
        found = strength_of(run, GRAIN)
        numbers = {"critical": found.critical / found.normal, "peak": found.peak / found.normal, "density": density,
                   "error": found.critical_error / found.normal}  # fmt: skip
        return {key: np.array(value) for key, value in numbers.items()}

    return part("sheared", {"pressure": pressure, "way": WAY, "number": INERTIAL_NUMBER, "size": SIZE}, compute)


def _between(run: dict[str, np.ndarray], depths: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    inside = (run["depth"] >= depths[0] * GRAIN) & (run["depth"] <= depths[1] * GRAIN)
    return run["depth"][inside], run["force"][inside]


def _compute(tell: Callable[[float], None]) -> Outcome:
    whole = len(PRESSURES) + len(PLACES) * (len(PLATES) + 1)
    done = 0

    def ticked(found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        nonlocal done
        done += 1
        tell(done / whole)
        return found

    tests = [ticked(_sheared(pressure)) for pressure in PRESSURES]
    # As `bed test shear`: the slope, since the weight between lid and shear band, the same in all, feigns a cohesion.
    normal = np.array(PRESSURES)
    mu = float(np.polyfit(normal, normal * [float(test["critical"]) for test in tests], 1)[0])
    density = float(tests[0]["density"])
    gradient = stress_gradient(bulk_density=density, friction=mu, gravity=GRAVITY)
    slopes, shares, curves = [], [], []
    for across in PLATES:
        radius = 0.5 * across * GRAIN
        runs = [
            ticked(_driven(f"plate {across:g}", Cylinder(0.0, GRAIN, radius), place, PLATE_DEPTHS[1] + 0.5))
            for place in PLACES
        ]
        pieces = [_between(run, PLATE_DEPTHS) for run in runs]
        law = flat_plate() * gradient * math.pi * radius**2
        shares.append(float(np.mean([force.mean() / (law * depth.mean()) for depth, force in pieces])))
        slopes.append(float(np.mean([np.polyfit(*piece, 1)[0] for piece in pieces])))
        grid = np.linspace(0.0, PLATE_DEPTHS[1] * GRAIN, 50)
        mean = np.mean([np.interp(grid, run["depth"], run["force"]) for run in runs], axis=0)
        curves += [Curve(f"3D-RFT, {across:g} d", 1e3 * grid, law * grid, False),
                   Curve(f"plate of {across:g} d", 1e3 * grid, mean)]  # fmt: skip
    found, margin = plate_law([across * GRAIN for across in PLATES], slopes)
    height = (CONE_DEPTHS[1] + 2) * GRAIN
    shape = Cone(0.0, height, 0.0, height * math.tan(HALF_ANGLE))
    cones = [ticked(_driven("cone", shape, place, CONE_DEPTHS[1] + 0.5)) for place in PLACES]
    roots = [np.polyfit(z, np.cbrt(np.maximum(f, 0.0)), 1)[0] for z, f in (_between(run, CONE_DEPTHS) for run in cones)]
    cone = float(np.mean(roots)) ** 3
    wanted_cone = gradient * cone_coefficient(HALF_ANGLE, surface_friction=BEADS.friction)
    rows = [
        Comparison("stress gradient under plates", "MPa/m", 1e-6 * flat_plate() * gradient, 1e-6 * found, BAND),
        Comparison("margin around the plates, over d", "1", 0.5, margin / GRAIN, 0.5, False),
        Comparison("F / z^3 of the cone", "MPa/m", 1e-6 * wanted_cone, 1e-6 * cone, BAND),
    ]
    steep = (3 * 894 * mu**2 - 2 * 386 * mu + 89) / (894 * mu**3 - 386 * mu**2 + 89 * mu)
    ratios = {key: ", ".join(f"{float(test[key]):.3f}" for test in tests) for key in ("critical", "peak")}
    presses = ", ".join(f"{pressure:g}" for pressure in PRESSURES)
    as_is = ", ".join(
        f"{slope / (0.25 * math.pi * (across * GRAIN) ** 2) / (flat_plate() * gradient):.2f} at {across:g} d"
        for across, slope in zip(PLATES, slopes, strict=True)
    )
    means = ", ".join(f"{share:.2f} at {across:g} d" for across, share in zip(PLATES, shares, strict=True))
    remark = (
        f"Critical friction of the bed {mu:.3f}, the slope of shear over normal stress (ratios {ratios['critical']} at "
        f"{presses} times its weight; peaks {ratios['peak']}), bulk density {density:.0f} kg/m3; 0.01 more of it are "
        f"{steep:.0f} % more of xi_n. Over the plate's own area, over 3D-RFT: dF/dz {as_is}; mean force over the same "
        f"depths {means}. Plates and cone (half-angle {math.degrees(HALF_ANGLE):g} degrees) at {SPEED:g} m/s, each at "
        f"two places of one bed of grains of {1e3 * GRAIN:.2f} mm, {SIZE[0] / GRAIN:.1f} of them wide and "
        f"{SIZE[2] / GRAIN:.1f} deep; plates fitted over {PLATE_DEPTHS[0]:g} to {PLATE_DEPTHS[1]:g} d of depth, the "
        f"cone over {CONE_DEPTHS[0]:g} to {CONE_DEPTHS[1]:g} d."
    )
    return Outcome(rows, [Plot("Plates going down", "depth [mm]", "force [N]", curves)], [remark])


CASES = [
    Case(
        "rft",
        "Bodies in beds",
        "Slow plates and a cone against 3D-RFT, friction from a shear test of the same bed",
        "F = 0.876 xi_n z A, xi_n = rho_c g (894 mu^3 - 386 mu^2 + 89 mu); a cone by integration",
        "Agarwal et al. 2023, PNAS 120, e2214017120 (arXiv 2205.14920); the bands are ours",
        _compute,
        slow=True,
        seconds=300,
        reason="the plates' force does not begin at zero where they touch, so that over these few grains of depth its "
        "mean lies 18 to 51 % above 3D-RFT's, what a margin of 0.6 to 0.8 grains makes, and its slope, held to the law "
        "here, falls short and scatters; the cone is 8 grains across where it is deepest and 3 where the fit begins. "
        "Bodies of more grains, driven deeper, are to tell whether more is behind it",
    )
]
