"""One collision: Hertz's closed forms, published numbers, the restitution asked for, oblique impact.

delta = (5 m* v^2 / 4 k)^(2/5), k = 4/3 E* sqrt(R*), F = k delta^1.5, t_c = 2.943275 delta / v (Johnson 1985, chapters
4 and 11). The cases T1 to T4 are those of Chung & Ooi 2011, Granular Matter 13:643.
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dem import Bed, Material
from dem.contact import effective_moduli

HERTZ_TIME = 2.943275


def hertz(reduced_mass, radius, young, speed):
    """Largest overlap [m], largest force [N], contact time [s], stiffness k [N/m^1.5]."""
    k = 4 / 3 * young * math.sqrt(radius)
    overlap = (5 * reduced_mass * speed**2 / (4 * k)) ** 0.4
    return overlap, k * overlap**1.5, HERTZ_TIME * overlap / speed, k


def mass_of(density, radius):
    return density * 4 / 3 * math.pi * radius**3


# ---------------------------------------------------------------------------- T1, T2: elastic, along the normal

SMALL, LARGE = 0.01, 0.1


def table_of_chung_and_ooi(material, speed_of_pair, speed_of_large, step):
    """Two spheres of 10 mm about to meet head-on, and one of 100 mm about to meet the floor."""
    positions = [(0.3 - SMALL, 0.3, 0.3), (0.3 + SMALL, 0.3, 0.3), (0.6, 0.6, LARGE)]
    velocities = [(speed_of_pair, 0, 0), (-speed_of_pair, 0, 0), (0, 0, -speed_of_large)]
    return Bed.from_grains(
        material,
        positions=np.array(positions),
        radii=np.array([SMALL, SMALL, LARGE]),
        velocities=np.array(velocities, dtype=float),
        size=(0.8, 0.8, 0.4),
        height=1.0,
        gravity=0.0,
        time_step=step,
    )


def measured_collision(bed, grain, contact_time, start_gap, other=None):
    """Largest force [N] and contact time [s] of a collision that starts at time 0.

    The force is read in nine steps about the middle; the end comes from the gap after it, divided by the speed.
    """
    half, step = round(0.5 * contact_time / bed.time_step), bed.time_step
    bed.advance(half - 4)
    forces = []
    for _ in range(9):
        forces.append(np.linalg.norm(bed.grains()["force"][grain]))
        bed.advance(1)
    bed.advance(round(1.1 * contact_time / step) - bed.steps)
    gap, speed = start_gap(bed.grains())
    return max(forces), bed.time - gap / speed


@pytest.mark.parametrize(
    ("name", "density", "young", "poisson", "published"),
    [  # overlap [um], force [kN], time [us]
        ("glass", 2800, 48e9, 0.20, (274.11, 10.697, 40.34)),
        ("limestone", 2500, 20e9, 0.25, (368.30, 7.108, 54.20)),
    ],
)
def test_two_spheres_head_on_t1(name, density, young, poisson, published):
    speed = 10.0
    stuff = Material(name, density, young, poisson, 0.35, 1.0)
    star, _ = effective_moduli(young, poisson, young, poisson)
    closed = hertz(mass_of(density, SMALL) / 2, SMALL / 2, star, 2 * speed)[:3]
    bed = table_of_chung_and_ooi(stuff, speed, 0.0, closed[2] / 1000)

    def gap(grains):
        apart = np.linalg.norm(grains["position"][0] - grains["position"][1]) - 2 * SMALL
        return apart, grains["velocity"][1, 0] - grains["velocity"][0, 0]

    force, time = measured_collision(bed, 0, closed[2], gap)
    measured = (bed.max_overlap * 2 * SMALL, force, time)
    assert measured == pytest.approx(closed, rel=1e-5)
    assert np.multiply(measured, (1e6, 1e-3, 1e6)) == pytest.approx(published, rel=5e-4)
    assert bed.grains()["velocity"][:2, 0] == pytest.approx([-speed, speed], rel=1e-5)


@pytest.mark.parametrize(
    ("name", "density", "young", "poisson", "published"),
    [
        ("aluminium alloy", 2699, 70e9, 0.30, (49.72, 11.370, 731.7)),
        ("magnesium alloy", 1800, 40e9, 0.35, (52.12, 7.233, 767.1)),
    ],
)
def test_a_sphere_on_a_rigid_plane_t2(name, density, young, poisson, published):
    speed = 0.2
    stuff = Material(name, density, young, poisson, 0.35, 1.0)
    star, _ = effective_moduli(young, poisson, math.inf, poisson)
    assert star == pytest.approx(young / (1 - poisson**2))
    closed = hertz(mass_of(density, LARGE), LARGE, star, speed)[:3]
    bed = table_of_chung_and_ooi(stuff, 0.0, speed, closed[2] / 1000)

    def gap(grains):
        return grains["position"][2, 2] - LARGE, grains["velocity"][2, 2]

    force, time = measured_collision(bed, 2, closed[2], gap)
    measured = (bed.max_overlap * 2 * LARGE, force, time)
    assert measured == pytest.approx(closed, rel=1e-5)
    assert np.multiply(measured, (1e6, 1e-3, 1e6)) == pytest.approx(published, rel=5e-4)


# ---------------------------------------------------------------------------- T3: restitution

RADIUS = 0.0025
ALUMINA = {"density": 4000, "young": 380e9, "poisson": 0.23}
IRON = {"density": 7000, "young": 100e9, "poisson": 0.25}


def row_of_grains(**options):
    """Sixteen grains of 2.5 mm that touch the floor but for nothing, 12.5 mm apart."""
    i = np.arange(16)
    positions = np.column_stack([0.00625 + 0.0125 * (i % 4), 0.00625 + 0.0125 * (i // 4), np.full(16, RADIUS)])
    options = {"size": (0.05, 0.05, 0.05), "height": 0.08, "gravity": 0.0} | options
    return positions, np.full(16, RADIUS), options


@pytest.mark.parametrize(("numbers", "published"), [(ALUMINA, (8.089, 0.6154, 6.105)), (IRON, (17.19, 0.5068, 12.97))])
def test_a_small_sphere_on_a_rigid_plane_t3(numbers, published):
    speed = 3.9
    star, _ = effective_moduli(numbers["young"], numbers["poisson"], math.inf, 0.3)
    overlap, force, time, _ = hertz(mass_of(numbers["density"], RADIUS), RADIUS, star, speed)
    assert (1e6 * overlap, 1e-3 * force, 1e6 * time) == pytest.approx(published, rel=5e-4)
    positions, radii, options = row_of_grains()
    bed = Bed.from_grains(
        Material("t3", friction=0.3, restitution=1.0, **numbers),
        positions=positions,
        radii=radii,
        velocities=np.tile([0.0, 0.0, -speed], (16, 1)),
        time_step=time / 500,
        **options,
    )
    bed.advance(600)
    assert bed.max_overlap * 2 * RADIUS == pytest.approx(overlap, rel=2e-5)
    assert bed.grains()["velocity"][:, 2] == pytest.approx(speed, rel=1e-5)


SPEEDS = np.geomspace(0.05, 5.0, 16)
RESTITUTIONS = (0.2, 0.4, 0.6, 0.8, 0.9, 1.0)


def rebound(restitution, tensile, step=None):
    """Rebound over approach speed on the floor, at sixteen speeds."""
    positions, radii, options = row_of_grains(tensile=tensile)
    bed = Bed.from_grains(
        Material("t3", friction=0.3, restitution=restitution, **ALUMINA),
        positions=positions,
        radii=radii,
        velocities=np.outer(-SPEEDS, [0.0, 0.0, 1.0]),
        max_overlap=0.004,
        time_step=step,
        **options,
    )
    longest = 6.105e-6 * (3.9 / SPEEDS[0]) ** 0.2  # t_c goes with v^(-1/5)
    bed.advance(math.ceil((4 if restitution < 0.5 else 2) * longest / bed.time_step))
    grains = bed.grains()
    assert (grains["position"][:, 2] > RADIUS).all()
    assert np.abs(grains["velocity"][:, :2]).max() == 0.0
    return grains["velocity"][:, 2] / SPEEDS


@pytest.mark.parametrize("restitution", RESTITUTIONS)
def test_the_rebound_is_the_restitution_asked_for_t3(restitution):
    """At every speed: with fine steps to the accuracy of Thornton's fit, and with the bed's own step (an eighth of
    the shortest contact time) to 0.015, at overlaps up to half their bound."""
    assert rebound(restitution, False, 2e-8) == pytest.approx(restitution, abs=1e-3)
    assert rebound(restitution, False) == pytest.approx(restitution, abs=0.015)


@pytest.mark.parametrize("restitution", RESTITUTIONS)
def test_the_rebound_is_the_restitution_asked_for_where_contacts_may_pull(restitution):
    """Tsuji et al. 1992's damping is exact then: the end of a contact is where the overlap vanishes."""
    assert rebound(restitution, True, 2e-8) == pytest.approx(restitution, abs=1e-3)


# ---------------------------------------------------------------------------- T4: oblique

MU, E_N, SPEED = 0.092, 0.98, 3.9
ANGLES = np.array([5, 10, 15, 20, 25, 30, 35, 40, 50, 60, 70, 80, 85])
TANGENTIAL = np.array([0.948, 0.687, 0.624, 0.616, 0.634, 0.684, 0.737, 0.781, 0.845, 0.893, 0.932, 0.966, 0.983])
SPIN = np.array([19.3, 213, 378, 511, 599, 617, 582, 545, 457, 357, 246, 126, 63])


def oblique():
    positions, radii, options = row_of_grains()
    angle = np.radians(np.concatenate([ANGLES, [60, 60, 60]]))
    velocities = SPEED * np.column_stack([np.sin(angle), 0 * angle, -np.cos(angle)])
    bed = Bed.from_grains(
        Material("t4", friction=MU, restitution=E_N, **ALUMINA),
        positions=positions,
        radii=radii,
        velocities=velocities,
        time_step=2e-8,
        **options,
    )
    bed.advance(round(1.5e-5 / 2e-8))
    grains = bed.grains()
    return grains["velocity"][:13, 0] / velocities[:13, 0], grains["spin"][:13], grains["velocity"][:13]


def test_oblique_impact_gives_the_published_rebound_t4():
    """Chung & Ooi's table, e_t and spin after the impact; probably measured, so within 3 %.

    At 10 degrees, where the contact sticks and swings back, the spin is 4.8 % low: it comes from the difference of two
    tangential velocities, and e_t is within the band (0.700 for 0.687).
    """
    tangential, spin, velocity = oblique()
    assert tangential == pytest.approx(TANGENTIAL, rel=0.03)
    others = ANGLES != 10
    assert spin[others, 1] == pytest.approx(SPIN[others], rel=0.03)
    assert spin[~others, 1] == pytest.approx(SPIN[~others], rel=0.05)
    assert velocity[:, 2] == pytest.approx(E_N * SPEED * np.cos(np.radians(ANGLES)), rel=1e-3)


def test_oblique_impact_past_gross_sliding():
    """e_t = 1 - mu (1 + e) / tan, omega = 5 mu (1 + e) v cos / 2 r; the arm is shorter than r by the overlap, 0.3 %."""
    tangential, spin, _ = oblique()
    angle = np.radians(ANGLES)
    slides = ANGLES >= 35  # tan > 7/2 mu (1 + e): the contact slips to its end
    assert tangential[slides] == pytest.approx(1 - MU * (1 + E_N) / np.tan(angle[slides]), rel=1e-3)
    closed = 5 * MU * (1 + E_N) * SPEED * np.cos(angle) / (2 * RADIUS)
    assert spin[slides, 1] == pytest.approx(closed[slides], rel=4e-3)


def test_a_spinning_grain_gains_tangential_speed():
    """v_x = mu (1 + e) v_n, while it slips throughout; the spin falls by 5/2 v_x / r."""
    positions, radii, options = row_of_grains()
    speeds = np.linspace(0.5, 3.9, 16)
    bed = Bed.from_grains(
        Material("spin", friction=MU, restitution=E_N, **ALUMINA),
        positions=positions,
        radii=radii,
        velocities=np.outer(-speeds, [0.0, 0.0, 1.0]),
        spins=np.tile([0.0, 3000.0, 0.0], (16, 1)),
        time_step=2e-8,
        **options,
    )
    bed.advance(round(2e-5 / 2e-8))
    grains = bed.grains()
    closed = MU * (1 + E_N) * speeds
    # A spin about +y takes the lowest point towards -x, so friction drives the grain towards +x.
    assert grains["velocity"][:, 0] == pytest.approx(closed, rel=1e-3)
    assert grains["spin"][:, 1] == pytest.approx(3000 - 2.5 * closed / RADIUS, rel=1e-3)


# ---------------------------------------------------------------------------- the equations of motion, integrated


def two_body_reference(y0, times, m, r, star, shear):
    """Two like grains, elastic and with no slip: y = (x, v, w of both, u); independent of the engine."""
    radius = r / 2

    def rates(_, y):
        x1, v1, w1, x2, v2, w2, u = y.reshape(7, 3)
        d = x1 - x2
        length = np.linalg.norm(d)
        n, overlap = d / length, max(0.0, 2 * r - length)
        arm = r - overlap / 2
        v = v1 - v2 - np.cross(arm * (w1 + w2), n)
        v_t = v - (v @ n) * n
        turn = ((v1 - v2) - ((v1 - v2) @ n) * n) / length
        du = v_t - (u @ turn) * n
        a = math.sqrt(radius * overlap)
        f = 4 / 3 * star * a * overlap * n - 8 * shear * a * u
        t = arm * np.cross(f, n)
        return np.concatenate([v1, f / m, t / (0.4 * m * r * r), v2, -f / m, t / (0.4 * m * r * r), du])

    return solve_ivp(rates, (0, times[-1]), y0, t_eval=times, method="DOP853", rtol=1e-11, atol=1e-14).y


def oblique_pair(step, *, steps, friction=50.0, along=False):
    """Two grains meet obliquely, spinning, among others that are far away; before and after, and lists made."""
    positions, radii, options = row_of_grains(floor=False)
    positions[:, 2] += 0.02
    n = np.array([0.8, 0.36, 0.48])
    positions[5] = positions[0] + 2 * RADIUS * n
    velocities, spins = np.zeros((16, 3)), np.zeros((16, 3))
    velocities[5] = -1.0 * n
    if not along:
        velocities[5] += 0.4 * np.array([-0.6, 0.48, 0.64])
        spins[0], spins[5] = (40.0, -30.0, 25.0), (-10.0, 60.0, 5.0)
    bed = Bed.from_grains(
        Material("pair", 2600, 1e8, 0.25, friction, 1.0),
        positions=positions,
        radii=radii,
        velocities=velocities,
        spins=spins,
        time_step=step,
        **options,
    )
    start = bed.grains()
    bed.advance(steps)
    return start, bed.grains(), bed.list_count


def errors_of_pair(along):
    """Errors of velocity, spin times radius and position over contact time, at four steps; their slopes in the step."""
    star, shear = effective_moduli(1e8, 0.25, 1e8, 0.25)
    m = mass_of(2600, RADIUS)
    contact = hertz(m / 2, RADIUS / 2, star, 1.0)[2]
    errors, counts = [], [50, 100, 200, 400]
    for count in counts:
        start, after, _ = oblique_pair(0.7 * contact / count, steps=count, along=along)
        if count == counts[0]:
            y0 = np.concatenate([start[k][i] for i in (0, 5) for k in ("position", "velocity", "spin")] + [np.zeros(3)])
            y = two_body_reference(y0, np.array([0.7 * contact]), m, RADIUS, star, shear)[:, -1].reshape(7, 3)
        errors.append(
            [
                np.abs(after["velocity"][[0, 5]] - y[[1, 4]]).max(),
                np.abs(after["position"][[0, 5]] - y[[0, 3]]).max() / contact,
                np.abs(after["spin"][[0, 5]] - y[[2, 5]]).max() * RADIUS,
            ]
        )
    errors = np.array(errors) if not along else np.array(errors)[:, :2]
    return errors, -np.polyfit(np.log(counts), np.log(errors), 1)[0]


def test_a_hertz_collision_converges_to_second_order():
    """Head-on, elastic, against the integrated equations of motion: the error falls as dt^2, as Verlet's does."""
    errors, slopes = errors_of_pair(along=True)
    assert slopes == pytest.approx(2.0, abs=0.1)
    assert errors[0].max() < 2e-4


def test_an_oblique_collision_follows_its_equations_of_motion():
    """With spins, friction and history, which take the normal at the end of a step, against 0.4 m/s of slip."""
    errors, slopes = errors_of_pair(along=False)
    assert errors[0].max() < 3e-4 and errors[-1].max() < 6e-6
    assert slopes.min() > 1.4


def test_contact_history_survives_new_lists(monkeypatch):
    """The same collision with new lists at every other step, which also sorts the grains anew."""
    _, seldom, made = oblique_pair(2e-7, steps=400)
    assert made < 10
    monkeypatch.setattr(Bed, "_adapt_skin", lambda self: None)
    monkeypatch.setattr("dem.bed._SKIN", 1e-4)
    _, often, made = oblique_pair(2e-7, steps=400)
    assert made > 100
    for name in ("position", "velocity", "spin"):
        assert np.abs(often[name] - seldom[name]).max() <= 1e-12 * np.abs(seldom[name]).max()
    assert np.linalg.norm(seldom["velocity"][0]) > 0.1
