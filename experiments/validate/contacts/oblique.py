"""Oblique impact: Chung & Ooi's T4 and T5.

While a contact slides from beginning to end, whatever the law along the normal, friction passes on mu times the normal
impulse (1 + e) m* v_n: e_t = 1 - mu (1 + e) / tan, omega = 5 mu (1 + e) v_n / 2 r. That holds as long as the tangential
speed at the contact is above 7/2 mu (1 + e) v_n.
"""

import math

import numpy as np

from dem import Grains, Material
from dem.contact.law import damping_factor
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, compared, told, worst

from ..base.spheres import ALUMINA, HERTZ_TIME, RADIUS, contact_of, hertz, mass_of, meet_floor, plane_modulus
from .microslip import tangential_restitution
from .words import say

__all__ = ["ANGLES", "CASES", "E_N", "MU", "STEP", "oblique"]

MU, E_N, SPEED = 0.092, 0.98, 3.9
ANGLES = np.array([5, 10, 15, 20, 25, 30, 35, 40, 50, 60, 70, 80, 85])
# The figures of T4 for alumina: points read from them, angle of impact [deg] and e_t [1] or spin [rad/s].
TANGENTIAL = np.array(
    [[5.168, 0.9481], [10.158, 0.6870], [14.990, 0.6244], [20.059, 0.6161], [25.050, 0.6343], [30.119, 0.6837],
     [35.030, 0.7372], [40.020, 0.7809], [50.0, 0.8451], [59.980, 0.8929], [69.960, 0.9316], [80.020, 0.9662],
     [85.010, 0.9827]]
)  # fmt: skip
SPIN = np.array(
    [[4.951, 19.27], [10.079, 213.0], [14.970, 377.8], [19.941, 510.6], [24.911, 599.4], [29.961, 616.5],
     [34.931, 582.3], [39.980, 544.8], [50.0, 457.0], [60.020, 357.5], [69.961, 246.2], [80.059, 126.3],
     [85.030, 63.15]]
)  # fmt: skip
PUBLISHED_BAND = 0.03
CLOSED_BAND, ARM_BAND = 1e-3, 4e-3  # the arm of the friction is shorter than r by the overlap, 0.3 %
STEP = 2e-8
SLIDES_FROM = 35  # [deg]: tan > 7/2 mu (1 + e), the contact slips to its end


def oblique(step: float = STEP, angles: np.ndarray = ANGLES) -> Grains:
    """T4: alumina spheres that meet the floor at 3.9 m/s, at angles from its normal [deg]."""
    angle = np.radians(angles)
    velocities = SPEED * np.column_stack([np.sin(angle), 0 * angle, -np.cos(angle)])
    return meet_floor(Material("t4", friction=MU, restitution=E_N, **ALUMINA), velocities, step=step, time=1.5e-5)


def law_alone(angles: np.ndarray, *, dashpot: bool = True, steps: int = 8000) -> np.ndarray:
    """e_t by the contact law alone, in numpy and with fine steps, shape of ``angles`` [deg].

    ``dashpot``: whether the tangential spring has one. m = v_n = k = 1, so that S_n = 3/2 sqrt(x); the arm of the spin
    is shorter than r by the overlap x, as in the bed.
    """
    ratio = 2 * (1 - ALUMINA["poisson"]) / (2 - ALUMINA["poisson"])  # S_t / S_n
    c, dt = damping_factor(E_N), 1.6 * HERTZ_TIME * 1.25**0.4 / steps
    normal = SPEED * np.cos(np.radians(angles))
    young = plane_modulus(ALUMINA["young"], ALUMINA["poisson"])
    mass = mass_of(ALUMINA["density"], RADIUS)
    unit = np.array([hertz(mass, RADIUS, young, v)[0] for v in normal]) / 1.25**0.4 / RADIUS  # of x, over r
    first = np.tan(np.radians(angles))
    x, rate, along, turning, stretch = 0.0 * first, 1.0 + 0 * first, first.copy(), 0 * first, 0 * first
    for _ in range(steps):
        x = x + rate * dt
        s_n = 1.5 * np.sqrt(np.maximum(x, 0.0))
        f_n = np.where(x > 0, np.maximum(0.0, s_n * x / 1.5 + c * np.sqrt(s_n) * rate), 0.0)
        arm = 1 - unit * x
        slip = along - arm * turning
        stretch = stretch + slip * dt
        f_t, bound = ratio * s_n * stretch, MU * f_n
        slides = np.abs(f_t) > bound
        stretch = np.where(slides, np.sign(f_t) * bound / np.where(s_n > 0, ratio * s_n, 1.0), stretch)
        if dashpot:
            f_t = f_t + np.where(slides, 0.0, c * math.sqrt(ratio) * np.sqrt(s_n) * slip)
        f_t = np.clip(f_t, -bound, bound)
        rate = rate - f_n * dt
        along = along - f_t * dt
        turning = turning + 2.5 * arm * f_t * dt
    return along / first


def _sliding_spin(angles: np.ndarray) -> np.ndarray:
    return 2.5 * MU * (1 + E_N) * SPEED * np.cos(np.radians(angles)) / RADIUS


def spin_of(angles: np.ndarray, tangential: np.ndarray) -> np.ndarray:
    """5/2 v_t (1 - e_t) / r [rad/s]: angular momentum about the contact, whatever the law."""
    return 2.5 * SPEED * np.sin(np.radians(angles)) * (1 - tangential) / RADIUS


def _t4_tangential(tell: Tell) -> Outcome:
    angles, quoted = TANGENTIAL.T
    found = oblique(angles=angles).velocity[:, 0] / (SPEED * np.sin(np.radians(angles)))
    line = np.linspace(35, 88, 60)
    curves = [
        Curve("1 - mu (1 + e) / tan", line, 1 - MU * (1 + E_N) / np.tan(np.radians(line)), False),
        Curve("as quoted", angles, quoted, False),
        Curve("bed", angles, found),
    ]
    return Outcome(
        compared("e_t", [f"{a:.4g} deg" for a in angles], quoted, found, band=PUBLISHED_BAND),
        [Plot("Tangential restitution", "angle of impact [deg]", "e_t [1]", curves)],
    )


def _t4_spin(tell: Tell) -> Outcome:
    angles, quoted = SPIN.T
    found = oblique(angles=angles).spin[:, 1]
    fine = oblique(STEP / 5, angles).spin[:, 1]
    # Where the contact slides to its end no law comes in: what the figure is off by there is how well it was read.
    slides = angles > SLIDES_FROM - 0.5
    reading = float(np.abs(quoted - _sliding_spin(angles))[slides].max())
    rows = [
        Comparison(f"spin at {a:.4g} deg", "rad/s", one, ours, max(PUBLISHED_BAND * one, reading), relative=False)
        for a, one, ours in zip(angles, quoted, found, strict=True)
    ]
    line = np.linspace(SLIDES_FROM, 88, 60)
    curves = [
        Curve("5 mu (1 + e) v cos / 2 r", line, _sliding_spin(line), False),
        Curve("as quoted", angles, quoted, False),
        Curve("bed", angles, found),
    ]
    bare = spin_of(angles, law_alone(angles, dashpot=False)) - quoted
    held = spin_of(angles, law_alone(angles)) - quoted
    like = {"friction": MU, "restitution": E_N, "poisson": ALUMINA["poisson"]}
    slipping = spin_of(angles, np.array([tangential_restitution(angle, **like) for angle in angles]))
    ten = int(np.abs(angles - 10).argmin())
    worth = float((found[ten + 1] - found[ten - 1]) / (angles[ten + 1] - angles[ten - 1])) / 10
    alone = {"off": held[ten], "bare_off": bare[ten], "rms": _rms(held), "bare_rms": _rms(bare)}
    lists = {"slipping": slipping, "angles": angles, "figure": quoted, "spring": bare + quoted}
    remarks = [
        say("figure_read", reading=reading, worth=worth, band=100 * PUBLISHED_BAND),
        say("law_alone", angle=angles[ten], finer=np.abs(fine - found).max(), book=100 * _book(), **alone),
        say("rings", **{name: ", ".join(f"{v:.4g}" for v in values[:3]) for name, values in lists.items()}),
    ]
    curves.append(Curve("rings that slip one by one", angles, slipping, False))
    return Outcome(rows, [Plot("Spin after the impact", "angle of impact [deg]", "spin [rad/s]", curves)], remarks)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


def _t4_sliding(tell: Tell) -> Outcome:
    after, angle = oblique(), np.radians(ANGLES)
    e_t, spin = after.velocity[:, 0] / (SPEED * np.sin(angle)), after.spin[:, 1]
    slides = ANGLES >= SLIDES_FROM
    labels = [f"{a} deg" for a in ANGLES]
    kept = [f"{a} deg" for a in ANGLES[slides]]
    e_n = after.velocity[:, 2] / (SPEED * np.cos(angle))
    return Outcome(
        [
            *compared("e_t", kept, (1 - MU * (1 + E_N) / np.tan(angle))[slides], e_t[slides], band=CLOSED_BAND),
            *compared("spin", kept, _sliding_spin(ANGLES)[slides], spin[slides], unit="rad/s", band=ARM_BAND),
            *compared("e_n", labels, np.full(13, E_N), e_n, band=1e-3),
        ]
    )


def _book() -> float:
    """How far the spins are from what angular momentum makes of e_t, relative."""
    after, start = oblique(), SPEED * np.sin(np.radians(ANGLES))
    return float(np.abs(spin_of(ANGLES, after.velocity[:, 0] / start) / after.spin[:, 1] - 1).max())


T5 = {"steel": (7850.0, 208e9, 0.30), "polyethylene": (1400.0, 1e9, 0.40)}  # normal speed held, angle varied
T5_MU, T5_SPEED, T5_RADIUS = 0.3, 5.0, 1e-5
T5_RATIOS = np.array([0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 10.0, 15.0, 20.0])  # tan / mu


def _t5(tell: Tell) -> Outcome:
    rows: list[Comparison] = []
    curves = [Curve("sliding throughout, 5", [7.0, 20.0], [5.0, 5.0], False)]
    for name, numbers in told(T5.items(), tell):
        stuff = Material(name, *numbers, T5_MU, 1.0)
        overlap, _, time, _ = contact_of(stuff, T5_RADIUS, T5_SPEED)
        along = T5_RATIOS * T5_MU * T5_SPEED
        velocities = np.column_stack([along, 0 * along, np.full(len(along), -T5_SPEED)])
        after = meet_floor(stuff, velocities, radius=T5_RADIUS, step=time / 300, time=1.5 * time, max_overlap=0.2)
        slides, unit = T5_RATIOS > 7, T5_MU * T5_SPEED
        scaled = after.spin[:, 1] * T5_RADIUS / unit
        labels = [f"tan / mu = {ratio:g}" for ratio in T5_RATIOS[slides]]
        lost, alike = (along - after.velocity[:, 0]) / unit, np.ones(slides.sum())
        rows += compared(f"{name}: loss of v_t over mu v_n", labels, 2 * alike, lost[slides], band=CLOSED_BAND)
        band = CLOSED_BAND + overlap / T5_RADIUS  # the arm is shorter by the overlap at most
        rows += compared(f"{name}: spin r over mu v_n", labels, 5 * alike, scaled[slides], band=band)
        e_n = worst(after.velocity[:, 2] / T5_SPEED, 1.0)
        rows.append(Comparison(f"{name}: e_n, worst", "1", 1.0, e_n, 1e-3))
        curves.append(Curve(name, T5_RATIOS, scaled))
    return Outcome(rows, [Plot("Spin after the impact", "tan / mu [1]", "spin r / (mu v_n) [1]", curves)])


CASES = {"t4-e-t": _t4_tangential, "t4-spin": _t4_spin, "t4-sliding": _t4_sliding, "t5": _t5}
