"""Oblique impact: Chung & Ooi's T4 and T5.

While a contact slides from beginning to end, whatever the law along the normal, friction passes on mu times the normal
impulse (1 + e) m* v_n: e_t = 1 - mu (1 + e) / tan, omega = 5 mu (1 + e) v_n / 2 r. That holds as long as the tangential
speed at the contact is above 7/2 mu (1 + e) v_n.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dem import Material

from .case import Case, Comparison, Curve, Outcome, Plot, compared
from .spheres import ALUMINA, RADIUS, Meeting, hertz, mass_of, meet_floor, plane_modulus

__all__ = [
    "AGAIN",
    "ANGLES",
    "CASES",
    "CHUNG_OOI",
    "E_N",
    "FAMILY",
    "IMPULSE",
    "MU",
    "STEP",
    "oblique",
    "plane_contact_time",
]

FAMILY = "Oblique impact and spin"
CHUNG_OOI = "Chung & Ooi 2011, Granular Matter 13:643"
IMPULSE = "impulse of a contact that slides throughout: mu (1 + e) m* v_n"
AGAIN = "(set-up as in the open reruns of PySPH and Kratos)"

MU, E_N, SPEED = 0.092, 0.98, 3.9
ANGLES = np.array([5, 10, 15, 20, 25, 30, 35, 40, 50, 60, 70, 80, 85])
TANGENTIAL = np.array([0.948, 0.687, 0.624, 0.616, 0.634, 0.684, 0.737, 0.781, 0.845, 0.893, 0.932, 0.966, 0.983])
SPIN = np.array([19.3, 213, 378, 511, 599, 617, 582, 545, 457, 357, 246, 126, 63])
PUBLISHED_BAND = 0.03  # probably measured
CLOSED_BAND, ARM_BAND = 1e-3, 4e-3  # the arm of the friction is shorter than r by the overlap, 0.3 %
STEP = 2e-8


def oblique(step: float = STEP) -> Meeting:
    """T4: thirteen alumina spheres that meet the floor at 3.9 m/s, at ``ANGLES`` from its normal."""
    angle = np.radians(ANGLES)
    velocities = SPEED * np.column_stack([np.sin(angle), 0 * angle, -np.cos(angle)])
    return meet_floor(Material("t4", friction=MU, restitution=E_N, **ALUMINA), velocities, step=step, time=1.5e-5)


def _t4(what: str) -> Callable[[Callable[[float], None]], Outcome]:
    def compute(tell: Callable[[float], None]) -> Outcome:
        after, angle = oblique(), np.radians(ANGLES)
        labels = [f"{a} deg" for a in ANGLES]
        e_t, spin = after.velocity[:, 0] / (SPEED * np.sin(angle)), after.spin[:, 1]
        line = np.radians(np.linspace(35, 88, 60))
        if what == "tangential":
            rows = compared("e_t", labels, TANGENTIAL, e_t, band=PUBLISHED_BAND)
            curves = [
                Curve("1 - mu (1 + e) / tan", np.degrees(line), 1 - MU * (1 + E_N) / np.tan(line), False),
                Curve("as quoted", ANGLES, TANGENTIAL, False),
                Curve("bed", ANGLES, e_t),
            ]
            return Outcome(rows, [Plot("Tangential restitution", "angle of impact [deg]", "e_t [1]", curves)])
        if what == "spin":
            rows = compared("spin", labels, SPIN, spin, unit="rad/s", band=PUBLISHED_BAND)
            implied = 2.5 * SPEED * np.sin(angle) * (1 - TANGENTIAL) / RADIUS
            curves = [
                Curve(
                    "5 mu (1 + e) v cos / 2 r",
                    np.degrees(line),
                    2.5 * MU * (1 + E_N) * SPEED * np.cos(line) / RADIUS,
                    False,
                ),
                Curve("as quoted", ANGLES, SPIN, False),
                Curve("bed", ANGLES, spin),
            ]
            remark = (
                "The quoted columns do not fit one another better than this: whatever the law, angular momentum "
                "about the "
                "contact makes the spin 5/2 v_t (1 - e_t) / r, and the quoted e_t make the quoted spins off by "
                f"{100 * np.abs(implied / SPIN - 1)[1]:.1f} % at 10 degrees and "
                f"{100 * np.abs(implied / SPIN - 1).max():.1f} % "
                f"at {ANGLES[np.abs(implied / SPIN - 1).argmax()]}. Ours fit to {100 * _book(after).max():.2f} "
                "%. With steps five "
                "times finer no spin of ours changes by more than "
                f"{100 * np.abs(oblique(STEP / 5).spin[:, 1] / spin - 1).max():.2g} %."
            )
            return Outcome(
                rows, [Plot("Spin after the impact", "angle of impact [deg]", "spin [rad/s]", curves)], [remark]
            )
        slides = ANGLES >= 35  # tan > 7/2 mu (1 + e): the contact slips to its end
        labels = [label for label, kept in zip(labels, slides, strict=True) if kept]
        normal = compared(
            "e_n",
            [f"{a} deg" for a in ANGLES],
            np.full(13, E_N),
            after.velocity[:, 2] / (SPEED * np.cos(angle)),
            band=1e-3,
        )
        return Outcome(
            [
                *compared("e_t", labels, (1 - MU * (1 + E_N) / np.tan(angle))[slides], e_t[slides], band=CLOSED_BAND),
                *compared(
                    "spin",
                    labels,
                    (2.5 * MU * (1 + E_N) * SPEED * np.cos(angle) / RADIUS)[slides],
                    spin[slides],
                    unit="rad/s",
                    band=ARM_BAND,
                ),
                *normal,
            ]
        )

    return compute


def _book(after: Meeting) -> np.ndarray:
    """How far each spin is from 5/2 v_t (1 - e_t) / r, relative."""
    start = SPEED * np.sin(np.radians(ANGLES))
    return np.abs(2.5 * (start - after.velocity[:, 0]) / RADIUS / after.spin[:, 1] - 1)


# ---------------------------------------------------------------------------- T5: normal speed held, angle varied

T5 = {"steel": (7850.0, 208e9, 0.30), "polyethylene": (1400.0, 1e9, 0.40)}
T5_MU, T5_SPEED, T5_RADIUS = 0.3, 5.0, 1e-5
T5_RATIOS = np.array([0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 10.0, 15.0, 20.0])  # tan / mu


def plane_contact_time(density: float, young: float, poisson: float, radius: float, speed: float) -> float:
    """Hertz's, of a sphere on a rigid plane [s]."""
    return hertz(mass_of(density, radius), radius, plane_modulus(young, poisson), speed)[2]


def _t5(tell: Callable[[float], None]) -> Outcome:
    rows: list[Comparison] = []
    curves = [Curve("sliding throughout, 5", [7.0, 20.0], [5.0, 5.0], False)]
    for done, (name, (density, young, poisson)) in enumerate(T5.items(), 1):
        time = plane_contact_time(density, young, poisson, T5_RADIUS, T5_SPEED)
        along = T5_RATIOS * T5_MU * T5_SPEED
        velocities = np.column_stack([along, 0 * along, np.full(len(along), -T5_SPEED)])
        after = meet_floor(
            Material(name, density, young, poisson, T5_MU, 1.0),
            velocities,
            radius=T5_RADIUS,
            step=time / 300,
            time=1.5 * time,
            max_overlap=0.2,
        )
        slides = T5_RATIOS > 7
        scaled = after.spin[:, 1] * T5_RADIUS / (T5_MU * T5_SPEED)
        labels = [f"tan / mu = {ratio:g}" for ratio in T5_RATIOS[slides]]
        lost = (along - after.velocity[:, 0]) / (T5_MU * T5_SPEED)
        rows += compared(
            f"{name}: loss of v_t over mu v_n", labels, np.full(slides.sum(), 2.0), lost[slides], band=CLOSED_BAND
        )
        overlap = hertz(mass_of(density, T5_RADIUS), T5_RADIUS, plane_modulus(young, poisson), T5_SPEED)[0]
        arm = overlap / T5_RADIUS  # the arm is shorter by the overlap at most
        rows += compared(
            f"{name}: spin r over mu v_n", labels, np.full(slides.sum(), 5.0), scaled[slides], band=CLOSED_BAND + arm
        )
        rows.append(
            Comparison(f"{name}: e_n, worst", "1", 1.0, float(_worst(after.velocity[:, 2] / T5_SPEED, 1.0)), 1e-3)
        )
        curves.append(Curve(name, T5_RATIOS, scaled))
        tell(done / len(T5))
    return Outcome(rows, [Plot("Spin after the impact", "tan / mu [1]", "spin r / (mu v_n) [1]", curves)])


def _worst(found: np.ndarray, wanted: float) -> float:
    return found[np.argmax(np.abs(found - wanted))]


SMALL_ANGLES = (
    "only at 5 and 10 degrees, where the contact sticks and swings back: the spin comes from the small difference of "
    "two tangential velocities, and e_t, from which it follows, is within the band. At 5 degrees the quoted spin and "
    "e_t contradict one another by as much as ours is off (below). The step is not the cause (below); a law with "
    "micro-slip (Mindlin & Deresiewicz 1953) in place of the no-slip spring has not been tried"
)
CASES = [
    Case(
        "t4-e-t",
        FAMILY,
        "T4: tangential restitution, 5 to 85 degrees",
        "table of 13 angles",
        CHUNG_OOI,
        _t4("tangential"),
    ),
    Case(
        "t4-spin",
        FAMILY,
        "T4: spin after the impact, 5 to 85 degrees",
        "table of 13 angles",
        CHUNG_OOI,
        _t4("spin"),
        reason=SMALL_ANGLES,
    ),
    Case(
        "t4-sliding",
        FAMILY,
        "T4 past gross sliding, 35 to 85 degrees",
        "e_t = 1 - mu (1 + e) / tan, omega = 5 mu (1 + e) v cos / 2 r",
        f"{CHUNG_OOI}; {IMPULSE}",
        _t4("sliding"),
    ),
    Case(
        "t5",
        FAMILY,
        "T5: steel and polyethylene at 5 m/s along the normal, tan / mu up to 20",
        "sliding throughout (tan / mu > 7): v_t falls by 2 mu v_n, spin r = 5 mu v_n",
        f"{CHUNG_OOI} {AGAIN}; {IMPULSE}",
        _t5,
    ),
]
