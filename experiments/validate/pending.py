"""What the suite is to hold and the bed cannot do yet: each says what it waits for, and stays in the table "
"until then."""

from __future__ import annotations

from .case import Case

__all__ = ["CASES"]

FAMILY = "Not yet"
TESTS = "the material tests (shear, repose) that give mu or phi of the same bed"

CASES = [
    Case(
        "repose",
        FAMILY,
        "Angle of repose against material",
        "31 to 34 degrees for fine sand",
        "design data, unverified",
        waits_for=TESTS,
    ),
    Case(
        "friction-angle",
        FAMILY,
        "Friction angle by direct shear or triaxial",
        "30 to 33 degrees for Toyoura sand at critical state",
        "design data, from a second source",
        waits_for=TESTS,
    ),
    Case(
        "katsuragi-durian",
        FAMILY,
        "Drops of a 25.4 mm steel ball",
        "d1 = 8.7 cm, k/m = 1040 1/s2, over heights and seeds",
        "Katsuragi & Durian 2007, Nature Physics 3:420",
        waits_for="a bed of beads fine enough for the ball, prepared and stored",
    ),
    Case(
        "rft",
        FAMILY,
        "Slow plate and cone against 3D-RFT",
        "xi_n = rho_c g (894 mu^3 - 386 mu^2 + 89 mu)",
        "Agarwal et al. 2023, arXiv 2205.14920",
        waits_for=TESTS,
    ),
    Case(
        "gravity-sweep",
        FAMILY,
        "Gravity sweep at constant Froude number",
        "dimensionless curves collapse within 10 %",
        "Slonaker & Kamrin 2017, arXiv 1604.02490",
        waits_for="a sweep of prepared beds from 9.81 to 1e-5 m/s2",
    ),
    Case(
        "murdoch",
        FAMILY,
        "10 cm ball in low gravity",
        "depth linear in speed, free of g",
        "Murdoch et al. 2017, arXiv 1702.05980",
        waits_for="a sweep of prepared beds from 9.81 to 1e-5 m/s2",
    ),
    Case(
        "sink-from-rest",
        FAMILY,
        "Sinking from rest",
        "final depth free of g",
        "Altshuler et al. 2014",
        waits_for="a sweep of prepared beds from 9.81 to 1e-5 m/s2",
    ),
]
