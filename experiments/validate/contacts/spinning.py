"""Spin: Chung & Ooi's T6 to T8, and a spinning grain that is dropped.

As in `oblique`: while a contact slides from beginning to end, friction passes on mu times the normal impulse.
"""

import math

import numpy as np

from dem import Bed, Grains, Material
from dem.contact.law import damping_factor
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, compared, near_zero, told
from experiments.validate.base.spheres import ALUMINA, RADIUS, contact_of, hertz, mass_of, meet_floor, plane_modulus

from .oblique import E_N, MU, STEP
from .words import say

__all__ = ["CASES", "sliding_share", "spin_impact"]

METALS = {"aluminium alloy": (2700.0, 70e9, 0.33), "copper": (8900.0, 120e9, 0.35)}
SPIN_MU, SPIN_E, SPIN_SPEED, SPIN_RADIUS = 0.4, 0.5, 0.2, 0.1
SPINS = np.array([0.175, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 7.0, 9.0, 12.0, 16.0, 22.0])
SLIDES = SPINS * SPIN_RADIUS > 3.5 * SPIN_MU * (1 + SPIN_E) * SPIN_SPEED
_KICK = SPIN_MU * (1 + SPIN_E) * SPIN_SPEED  # of the tangential speed
E_BAND = 1e-3  # Thornton's fit of the damping


def _t6(tell: Tell) -> Outcome:
    rows: list[Comparison] = []
    curves = [Curve("mu (1 + e) v_n", SPINS[SLIDES], np.full(SLIDES.sum(), _KICK), False)]
    for name, numbers in told(METALS.items(), tell):
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
    labels = [f"{s:g} rad/s" for s in SPINS[SLIDES]]
    closed = np.full(SLIDES.sum(), share * _KICK)
    lost = (SPINS - spin)[SLIDES]
    return [
        *compared(f"{name}: speed", labels, closed, along[SLIDES], unit="m/s", band=E_BAND),
        *compared(f"{name}: loss of spin", labels, 2.5 * closed / radius, lost, unit="rad/s", band=2 * E_BAND),
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
    for name in told(METALS, tell):
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
    shares = {
        held: 100 * sliding_share(SPIN_E, 22.0 * SPIN_RADIUS / SPIN_SPEED, spring_alone=held) for held in (False, True)
    }
    return say("sliding_law", alone=shares[True], together=shares[False])


def sliding_share(restitution: float, ratio: float, *, spring_alone: bool, steps: int = 30_000) -> float:
    """Friction's impulse over mu times the normal one in a collision that slides throughout, by the contact law alone.

    A sphere on a rigid plane with m = v_n = k = 1, E* for nu = 0.33, mu = 0.4, the slip's speed held at ``ratio`` v_n.

    ``spring_alone``: the bound holds the spring, and a sliding contact has no dashpot, as the bed (and LIGGGHTS) have
    it; else both together, and the stretch is set back to what their sum allows, as LAMMPS has it.
    """
    nu, mu = 0.33, 0.4
    stiffness_ratio = 2 * (1 - nu) / (2 - nu)  # S_t / S_n
    factor = damping_factor(restitution)
    dt = 4 * 2.943275 * 1.25**0.4 / steps
    x, v, u, friction, pushed = 0.0, 1.0, 0.0, 0.0, 0.0
    for _ in range(steps):
        x += v * dt
        if x <= 0:
            break
        s_n = 1.5 * math.sqrt(x)
        f_n = max(0.0, x**1.5 + factor * math.sqrt(s_n) * v)
        k_t, c_t = stiffness_ratio * s_n, factor * math.sqrt(stiffness_ratio) * math.sqrt(s_n)
        u += ratio * dt
        spring, dashpot = k_t * u, c_t * ratio
        force, bound = spring + dashpot, mu * f_n
        if abs(force) > bound:
            force = math.copysign(bound, force)
            u = (force if spring_alone else force - dashpot) / k_t
        friction += force * dt
        pushed += f_n * dt
        v -= f_n * dt
    return friction / (mu * pushed)


def _t7_same_way(tell: Tell) -> Outcome:
    """Turning the same way their surfaces meet at 2 r omega: they slide throughout."""
    rows: list[Comparison] = []
    for name in told(METALS, tell):
        after = _pair(name, ALIKE, TOGETHER, (22.0, 22.0))
        speed, lost = float(np.abs(after.velocity[0, 1])), 22.0 - after.spin[0, 2]
        rows.append(Comparison(f"{name}: tangential speed", "m/s", _KICK, speed, 2 * E_BAND))
        rows.append(Comparison(f"{name}: loss of spin", "rad/s", 2.5 * _KICK / SPIN_RADIUS, lost, 3 * E_BAND))
    return Outcome(rows, remarks=[_lost_in_sliding()])


def _t8(tell: Tell) -> Outcome:
    name, radii = "aluminium alloy", (SPIN_RADIUS, 5 * SPIN_RADIUS)
    after = [_pair(name, radii, (SPIN_SPEED, 0.0), (spin, 0.0)) for spin in told(SPINS, tell)]
    first, second = (mass_of(METALS[name][0], r) for r in radii)
    share = second / (first + second)
    speed, spin = np.array([a.velocity[0, 1] for a in after]), np.array([a.spin[0, 2] for a in after])
    other = np.array([a.spin[1, 2] for a in after])
    closed = np.full(SLIDES.sum(), 2.5 * first / (first + second) * _KICK / radii[1])
    labels = [f"{s:g} rad/s" for s in SPINS[SLIDES]]
    curves = [
        Curve("mu (1 + e) v_n m_2 / (m_1 + m_2)", SPINS[SLIDES], np.full(SLIDES.sum(), share * _KICK), False),
        Curve("small sphere", SPINS, np.abs(speed)),
    ]
    large = compared("large sphere: spin", labels, closed, np.abs(other)[SLIDES], unit="rad/s", band=2 * E_BAND)
    return Outcome(
        [*_spin_rows("small sphere", np.abs(speed), spin, share, radii[0]), *large],
        [Plot("Tangential speed of the small sphere after the impact", "spin before [rad/s]", "speed [m/s]", curves)],
    )


def spin_impact(tell: Tell) -> Outcome:
    """A grain that spins fast and meets the floor: v_x = mu (1 + e) v_n, the spin falls by 5/2 v_x / r."""
    speeds = np.linspace(0.5, 3.9, 16)
    after = meet_floor(
        Material("spin", friction=MU, restitution=E_N, **ALUMINA), np.outer(-speeds, [0.0, 0.0, 1.0]),
        spins=np.tile([0.0, 3000.0, 0.0], (16, 1)), step=STEP, time=2e-5,
    )  # fmt: skip
    closed, labels = MU * (1 + E_N) * speeds, [f"{v:.3g} m/s" for v in speeds]
    # A spin about +y takes the lowest point towards -x, so friction drives the grain towards +x.
    return Outcome(
        [
            *compared("v_x", labels, closed, after.velocity[:, 0], unit="m/s", band=1e-3),
            *compared("spin", labels, 3000 - 2.5 * closed / RADIUS, after.spin[:, 1], unit="rad/s", band=1e-3),
        ]
    )


CASES = {"t6": _t6, "t7": _t7, "t7-same-way": _t7_same_way, "t8": _t8, "spin-impact": spin_impact}
