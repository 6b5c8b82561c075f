"""Oblique and spinning impacts: Chung & Ooi's T4 to T8, and a spinning grain that is dropped.

While a contact slides from beginning to end, whatever the law along the normal, friction passes on mu times the normal
impulse (1 + e) m* v_n: e_t = 1 - mu (1 + e) / tan, omega = 5 mu (1 + e) v_n / 2 r. That holds as long as the tangential
speed at the contact is above 7/2 mu (1 + e) v_n.
"""

import math
from functools import partial

import numpy as np

from dem import Bed, Grains, Material
from experiments.validate.base.spheres import ALUMINA, RADIUS, contact_of, hertz, mass_of, meet_floor, plane_modulus

from ..base.case import Comparison, Curve, Outcome, Plot, Tell, compared, listed, near_zero, tracked, worst
from . import say
from .law_alone import LARGEST, one_spring, sliding_share, tangential_restitution

__all__ = ["ANGLES", "CASES", "E_N", "MU", "STEP", "oblique", "spin_impact"]

MU, E_N, SPEED = 0.092, 0.98, 3.9
_LIKE = {"friction": MU, "restitution": E_N, "poisson": ALUMINA["poisson"]}
T4_SPRING = "displacement"  # the spring that the figures of T4 are of
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
    return meet_floor(
        Material("t4", friction=MU, restitution=E_N, tangential=T4_SPRING, **ALUMINA),
        velocities,
        step=step,
        time=1.5e-5,
    )


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
    rows = compared("e_t", angles, quoted, found, band=PUBLISHED_BAND, form="{:.4g} deg")
    return Outcome(rows, [Plot("Tangential restitution", "angle of impact [deg]", "e_t [1]", curves)])


def _t4_spin(tell: Tell) -> Outcome:
    angles, quoted = SPIN.T
    found, fine = oblique(angles=angles).spin[:, 1], oblique(STEP / 5, angles).spin[:, 1]
    whole = oblique()  # how far the spins are from what angular momentum makes of e_t, relative
    whole_e_t = whole.velocity[:, 0] / (SPEED * np.sin(np.radians(ANGLES)))
    off_moment = float(np.abs(spin_of(ANGLES, whole_e_t) / whole.spin[:, 1] - 1).max())
    # Where the contact slides to its end no law comes in: what the figure is off by there is how well it was read.
    slides = angles > SLIDES_FROM - 0.5
    reading = float(np.abs(quoted - _sliding_spin(angles))[slides].max())
    line = np.linspace(SLIDES_FROM, 88, 60)
    curves = [
        Curve("5 mu (1 + e) v cos / 2 r", line, _sliding_spin(line), False),
        Curve("as quoted", angles, quoted, False),
        Curve("bed", angles, found),
    ]
    first = np.tan(np.radians(angles))
    like = Material("t4", friction=MU, restitution=E_N, tangential=T4_SPRING, **ALUMINA)
    overlap = np.array([contact_of(like, RADIUS, SPEED * math.cos(angle))[0] for angle in np.radians(angles)])
    unit, laws = overlap / LARGEST / RADIUS, ("undamped", "bed")
    after = (one_spring(first, law=law, unit=unit, steps=8000, **_LIKE)[0] for law in laws)
    bare, held = (spin_of(angles, along / first) - quoted for along in after)
    rows = [
        Comparison(
            f"spin at {a:.4g} deg, the law without a dashpot", "rad/s", one, one + off,
            max(PUBLISHED_BAND * one, reading), relative=False,
        )
        for a, one, off in zip(angles, quoted, bare, strict=True)
    ]  # fmt: skip
    # The law's spin is reckoned with an arm of r, the bed's friction has one shorter by the overlap.
    apart = float(np.abs(found - quoted - held).max() / found.max())
    rows.append(near_zero("bed less its own law, with the dashpot, over the largest spin", apart, ARM_BAND))
    curves.append(Curve("the law without a dashpot", angles, quoted + bare, False))
    slipping = spin_of(angles, np.array([tangential_restitution(angle, **_LIKE) for angle in angles]))
    ten = int(np.abs(angles - 10).argmin())
    worth = float((found[ten + 1] - found[ten - 1]) / (angles[ten + 1] - angles[ten - 1])) / 10
    rms, bare_rms = (float(np.sqrt((off**2).mean())) for off in (held, bare))
    beyond = [a for a, one, ours in zip(angles, quoted, found, strict=True)
              if abs(ours - one) > max(PUBLISHED_BAND * one, reading)]  # fmt: skip
    alone = {
        "ours": found[ten] - quoted[ten],
        "beyond": listed(beyond, ".4g") or "none",
        "off": held[ten],
        "bare_off": bare[ten],
        "rms": rms,
        "bare_rms": bare_rms,
    }
    lists = {"slipping": slipping, "angles": angles, "figure": quoted, "spring": bare + quoted}
    remarks = [
        say("figure_read", reading=reading, worth=worth, band=100 * PUBLISHED_BAND),
        say("law_alone", angle=angles[ten], finer=np.abs(fine - found).max(), book=100 * off_moment, **alone),
        say("rings", **{name: listed(values[:3], ".4g") for name, values in lists.items()}),
    ]
    curves.append(Curve("rings that slip one by one", angles, slipping, False))
    return Outcome(rows, [Plot("Spin after the impact", "angle of impact [deg]", "spin [rad/s]", curves)], remarks)


def _t4_sliding(tell: Tell) -> Outcome:
    after, angle, slides = oblique(), np.radians(ANGLES), ANGLES >= SLIDES_FROM
    e_t, e_n = after.velocity[:, 0] / (SPEED * np.sin(angle)), after.velocity[:, 2] / (SPEED * np.cos(angle))
    closed, sliding = 1 - MU * (1 + E_N) / np.tan(angle), partial(compared, form="{} deg", only=slides)
    return Outcome([
        *sliding("e_t", ANGLES, closed, e_t, band=CLOSED_BAND),
        *sliding("spin", ANGLES, _sliding_spin(ANGLES), after.spin[:, 1], unit="rad/s", band=ARM_BAND),
        *compared("e_n", ANGLES, E_N, e_n, band=1e-3, form="{} deg"),
    ])  # fmt: skip


T5 = {"steel": (7850.0, 208e9, 0.30), "polyethylene": (1400.0, 1e9, 0.40)}  # normal speed held, angle varied
T5_MU, T5_SPEED, T5_RADIUS = 0.3, 5.0, 1e-5
T5_RATIOS = np.array([0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 10.0, 15.0, 20.0])  # tan / mu


def _t5(tell: Tell) -> Outcome:
    rows: list[Comparison] = []
    curves = [Curve("sliding throughout, 5", [7.0, 20.0], [5.0, 5.0], False)]
    for name, numbers in tracked(T5.items(), tell):
        stuff = Material(name, *numbers, T5_MU, 1.0)
        overlap, _, time, _ = contact_of(stuff, T5_RADIUS, T5_SPEED)
        along = T5_RATIOS * T5_MU * T5_SPEED
        velocities = np.column_stack([along, 0 * along, np.full(len(along), -T5_SPEED)])
        after = meet_floor(stuff, velocities, radius=T5_RADIUS, step=time / 300, time=1.5 * time, max_overlap=0.2)
        unit, sliding = T5_MU * T5_SPEED, partial(compared, form="tan / mu = {:g}", only=T5_RATIOS > 7)
        scaled, lost = after.spin[:, 1] * T5_RADIUS / unit, (along - after.velocity[:, 0]) / unit
        rows += sliding(f"{name}: loss of v_t over mu v_n", T5_RATIOS, 2, lost, band=CLOSED_BAND)
        band = CLOSED_BAND + overlap / T5_RADIUS  # the arm is shorter by the overlap at most
        rows += sliding(f"{name}: spin r over mu v_n", T5_RATIOS, 5, scaled, band=band)
        e_n = worst(after.velocity[:, 2] / T5_SPEED, 1.0)
        rows.append(Comparison(f"{name}: e_n, worst", "1", 1.0, e_n, 1e-3))
        curves.append(Curve(name, T5_RATIOS, scaled))
    return Outcome(rows, [Plot("Spin after the impact", "tan / mu [1]", "spin r / (mu v_n) [1]", curves)])


METALS = {"aluminium alloy": (2700.0, 70e9, 0.33), "copper": (8900.0, 120e9, 0.35)}
SPIN_MU, SPIN_E, SPIN_SPEED, SPIN_RADIUS = 0.4, 0.5, 0.2, 0.1
SPINS = np.array([0.175, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 7.0, 9.0, 12.0, 16.0, 22.0])
SLIDES = SPINS * SPIN_RADIUS > 3.5 * SPIN_MU * (1 + SPIN_E) * SPIN_SPEED
_KICK = SPIN_MU * (1 + SPIN_E) * SPIN_SPEED  # of the tangential speed
_sliding = partial(compared, form="{:g} rad/s", only=SLIDES)
E_BAND = 1e-3  # Thornton's fit of the damping


def _t6(tell: Tell) -> Outcome:
    rows: list[Comparison] = []
    curves = [Curve("mu (1 + e) v_n", SPINS[SLIDES], np.full(SLIDES.sum(), _KICK), False)]
    for name, numbers in tracked(METALS.items(), tell):
        stuff = Material(name, *numbers, SPIN_MU, SPIN_E)
        time = contact_of(stuff, SPIN_RADIUS, SPIN_SPEED)[2]
        after = meet_floor(
            stuff, np.tile([0.0, 0.0, -SPIN_SPEED], (len(SPINS), 1)), spins=np.outer(SPINS, [0.0, 1.0, 0.0]),
            radius=SPIN_RADIUS, step=time / 500, time=4 * time,
        )  # fmt: skip
        rows += _spin_rows(name, after.velocity[:, 0], after.spin[:, 1], 1.0, SPIN_RADIUS)
        curves.append(Curve(name, SPINS, after.velocity[:, 0]))
    plot = Plot("Tangential speed after the impact", "spin before [rad/s]", "speed [m/s]", curves)
    return Outcome(rows, [plot], [_lost_in_sliding()])


def _spin_rows(name: str, along: np.ndarray, spin: np.ndarray, share: float, radius: float) -> list[Comparison]:
    """Speed mu (1 + e) v_n and spin less 5/2 of it over r, where the contact slides; ``share`` is m* over the mass."""
    closed, lost = share * _KICK, SPINS - spin
    return [
        *_sliding(f"{name}: speed", SPINS, closed, along, unit="m/s", band=E_BAND),
        *_sliding(f"{name}: loss of spin", SPINS, 2.5 * closed / radius, lost, unit="rad/s", band=2 * E_BAND),
    ]


def _pair(name: str, radii: tuple[float, float], speeds: tuple[float, float], spins: tuple[float, float]) -> Grains:
    """Two spheres of a metal that touch at time 0 and come together along x; spins about z."""
    density, young, poisson = METALS[name]
    (r, s), (m, k) = radii, (mass_of(density, r) for r in radii)
    time = hertz(m * k / (m + k), r * s / (r + s), plane_modulus(young, poisson) / 2, speeds[0] - speeds[1])[2]
    middle, step = 2 * (r + s), time / 300
    bed = Bed.from_grains(
        Material(name, density, young, poisson, SPIN_MU, SPIN_E),
        positions=np.array([[middle - r, middle, middle], [middle + s, middle, middle]]),
        radii=np.array(radii), velocities=np.array([[speeds[0], 0, 0], [speeds[1], 0, 0]]),
        spins=np.outer(spins, [0.0, 0.0, 1.0]),
        size=(2 * middle + 6 * max(radii), 2 * middle + 6 * max(radii), 2 * middle), height=3 * middle, gravity=0.0,
        floor=False, time_step=step,
    )  # fmt: skip
    bed.advance(round(4 * time / step))
    return bed.grains()


ALIKE, TOGETHER = (SPIN_RADIUS, SPIN_RADIUS), (SPIN_SPEED, -SPIN_SPEED)


def _t7(tell: Tell) -> Outcome:
    rows: list[Comparison] = []
    for name in tracked(METALS, tell):
        for spin in (0.5, 4.0, 22.0):
            after = _pair(name, ALIKE, TOGETHER, (spin, -spin))
            sideways, back = np.abs(after.velocity[:, 1:]).max(), after.velocity[1, 0] / SPIN_SPEED
            rows += [
                near_zero(f"{name}: tangential speed at {spin:g} rad/s", sideways, 1e-12, "m/s"),
                Comparison(f"{name}: spin at {spin:g} rad/s", "rad/s", spin, after.spin[0, 2], 1e-12),
                Comparison(f"{name}: e_n at {spin:g} rad/s", "1", SPIN_E, back, 2 * E_BAND),
            ]
    return Outcome(rows)


def _lost_in_sliding() -> str:
    """What the friction law alone makes of T6, as a remark."""
    ratio = 22.0 * SPIN_RADIUS / SPIN_SPEED
    alone, together = (100 * sliding_share(SPIN_E, ratio, spring_alone=held) for held in (True, False))
    return say("sliding_law", alone=alone, together=together)


def _t7_same_way(tell: Tell) -> Outcome:
    """Turning the same way their surfaces meet at 2 r omega: they slide throughout."""
    rows: list[Comparison] = []
    for name in tracked(METALS, tell):
        after = _pair(name, ALIKE, TOGETHER, (22.0, 22.0))
        speed, lost = float(np.abs(after.velocity[0, 1])), 22.0 - after.spin[0, 2]
        rows.append(Comparison(f"{name}: tangential speed", "m/s", _KICK, speed, 2 * E_BAND))
        rows.append(Comparison(f"{name}: loss of spin", "rad/s", 2.5 * _KICK / SPIN_RADIUS, lost, 3 * E_BAND))
    return Outcome(rows, remarks=[_lost_in_sliding()])


def _t8(tell: Tell) -> Outcome:
    name, radii = "aluminium alloy", (SPIN_RADIUS, 5 * SPIN_RADIUS)
    after = [_pair(name, radii, (SPIN_SPEED, 0.0), (spin, 0.0)) for spin in tracked(SPINS, tell)]
    first, second = (mass_of(METALS[name][0], r) for r in radii)
    share = second / (first + second)
    speed = np.abs([a.velocity[0, 1] for a in after])
    spin, other = np.array([a.spin[:, 2] for a in after]).T
    closed = 2.5 * first / (first + second) * _KICK / radii[1]
    curves = [
        Curve("mu (1 + e) v_n m_2 / (m_1 + m_2)", SPINS[SLIDES], np.full(SLIDES.sum(), share * _KICK), False),
        Curve("small sphere", SPINS, speed),
    ]
    large = _sliding("large sphere: spin", SPINS, closed, np.abs(other), unit="rad/s", band=2 * E_BAND)
    return Outcome(
        [*_spin_rows("small sphere", speed, spin, share, radii[0]), *large],
        [Plot("Tangential speed of the small sphere after the impact", "spin before [rad/s]", "speed [m/s]", curves)],
    )


def spin_impact(tell: Tell) -> Outcome:
    """A grain that spins fast and meets the floor: v_x = mu (1 + e) v_n, the spin falls by 5/2 v_x / r."""
    speeds = np.linspace(0.5, 3.9, 16)
    after = meet_floor(
        Material("spin", friction=MU, restitution=E_N, **ALUMINA), np.outer(-speeds, [0.0, 0.0, 1.0]),
        spins=np.tile([0.0, 3000.0, 0.0], (16, 1)), step=STEP, time=2e-5,
    )  # fmt: skip
    closed, each = MU * (1 + E_N) * speeds, partial(compared, band=1e-3, form="{:.3g} m/s")
    # A spin about +y takes the lowest point towards -x, so friction drives the grain towards +x.
    return Outcome([
        *each("v_x", speeds, closed, after.velocity[:, 0], unit="m/s"),
        *each("spin", speeds, 3000 - 2.5 * closed / RADIUS, after.spin[:, 1], unit="rad/s"),
    ])  # fmt: skip


CASES = {
    "t4-e-t": _t4_tangential,
    "t4-spin": _t4_spin,
    "t4-sliding": _t4_sliding,
    "t5": _t5,
    "t6": _t6,
    "t7": _t7,
    "t7-same-way": _t7_same_way,
    "t8": _t8,
    "spin-impact": spin_impact,
}
