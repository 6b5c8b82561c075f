"""The contact law's parameters and the time step: against the equation of motion and Hertz's closed forms."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dem import MATERIALS, SAND, SAND_WEAK, Bed, Facing, Material, material
from dem.contact.cohesion import jkr_contact
from dem.contact.law import damping_factor, effective_moduli, pair_parameters
from dem.contact.timestep import CHAIN, choose_young, contact_time, longest_step, time_step_for
from dem.grains.materials import CAVEATS, caveat, of_before


def rebound(factor):
    """Restitution of x'' = -max(0, x^1.5 + c sqrt(3/2) x^0.25 x'), in units of its mass, stiffness and speed."""
    c = factor * math.sqrt(1.5)

    def rates(_, y):
        x = max(y[0], 0.0)
        return [y[1], -max(0.0, x**1.5 + c * x**0.25 * y[1])]

    def lets_go(_, y):
        return max(y[0], 0.0) ** 1.25 + c * y[1]

    lets_go.terminal, lets_go.direction = True, -1
    path = solve_ivp(rates, (0, 500), [1e-12, 1.0], events=lets_go, rtol=1e-10, atol=1e-13, method="DOP853")
    return -path.y[1, -1]


@pytest.mark.parametrize("restitution", [0.02, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 0.901, 0.95, 0.98, 0.999])
def test_damping_gives_the_restitution_asked_for(restitution):
    """Thornton et al. 2013's fit below 0.9 (within 3e-4), the expansion above it."""
    assert rebound(damping_factor(restitution)) == pytest.approx(restitution, abs=3e-4)


def test_elastic_contacts_have_no_damping_and_none_is_out_of_bounds():
    assert damping_factor(1.0) == 0.0 == damping_factor(1.0, tensile=True)
    for e in (0.0, 1.1, -1.0, math.nan):
        with pytest.raises(ValueError, match=r"restitution = .* must lie between"):
            damping_factor(e)
    with pytest.raises(ValueError, match="must not be negative"):
        pair_parameters(effective_young=1e7, effective_shear=1e6, restitution=0.5, friction=-0.1)


def test_effective_moduli_are_those_of_hertz_and_mindlin():
    """1/E* = sum (1 - nu^2)/E, 1/G* = sum (2 - nu)/G with G = E / 2 (1 + nu); a rigid body adds nothing."""
    young, shear = effective_moduli(48e9, 0.2, 20e9, 0.25)
    assert young == pytest.approx(1 / ((1 - 0.04) / 48e9 + (1 - 0.0625) / 20e9))
    g1, g2 = 48e9 / 2.4, 20e9 / 2.5
    assert shear == pytest.approx(1 / (1.8 / g1 + 1.75 / g2))
    assert effective_moduli(48e9, 0.2, math.inf, 0.3) == pytest.approx((48e9 / 0.96, g1 / 1.8))


# ---------------------------------------------------------------------------- the time step

STUFF = Material("grain", 2600, 1e8, 0.25, 0.5, 0.5)


def test_the_contact_time_is_half_a_period_of_the_stiffest_contact():
    """pi sqrt(m* / S_n) with S_n = 2 E* sqrt(R* delta): on a rigid plane, which is the stiffest there is."""
    d, overlap = 0.002, 0.05
    mass = 2600 * math.pi * d**3 / 6
    stiff = 2 * 1e8 / (1 - 0.0625) * math.sqrt(d / 2 * overlap * d)
    pair = math.pi * math.sqrt(mass / 2 / (1e8 / (1 - 0.0625) * math.sqrt(d / 4 * overlap * d)))
    plane = math.pi * math.sqrt(mass / stiff)
    assert contact_time(STUFF, diameter=d, max_overlap=overlap) == pytest.approx(min(plane, pair))


def test_a_collision_lasts_longer_than_the_time_that_the_step_is_taken_from():
    """Hertz's t_c = 2.943275 delta / v at the largest overlap allowed is 1.28 times the contact time."""
    d, overlap = 0.002, 0.05
    mass = 2600 * math.pi * d**3 / 6
    k = 4 / 3 * effective_moduli(1e8, 0.25, 1e8, 0.25)[0] * math.sqrt(d / 4)
    speed = math.sqrt(4 * k * (overlap * d) ** 2.5 / (5 * mass / 2))
    ours = math.pi * math.sqrt(mass / 2 / (1.5 * k * math.sqrt(overlap * d)))
    assert 2.943275 * overlap * d / speed == pytest.approx(1.28 * ours, rel=5e-3)


def test_the_step_is_an_eighth_of_the_contact_time_and_a_longer_one_is_refused():
    """A fifth of the contact time where nothing is damped; what six sticking contacts bear for e = 0.5, mu > 0."""
    smooth = Material("smooth", 2600, 1e8, 0.25, 0.0, 1.0)
    shortest = contact_time(STUFF, diameter=0.002, max_overlap=0.05)
    for stuff, longest in ((smooth, shortest / 5), (STUFF, 0.1307 * shortest)):
        given = {"diameter": 0.002, "max_overlap": 0.05}
        assert time_step_for(stuff, **given) == shortest / 8
        assert longest_step(stuff, **given) == pytest.approx(longest, rel=1e-3)
        assert time_step_for(stuff, wanted=0.998 * longest, **given) == 0.998 * longest
        for wanted in (1.002 * longest, 1.0, 0.0, -1e-6, math.nan):
            with pytest.raises(ValueError, match=r"time_step = .* s is outside 0 to .* s, the longest that"):
                time_step_for(stuff, wanted=wanted, **given)


@pytest.mark.parametrize("restitution", [0.5, 0.6, 0.9, 1.0])
def test_the_beds_own_step_is_an_eighth_unless_damping_is_strong(restitution):
    for friction in (0.0, 0.5):
        stuff = Material("grain", 2600, 1e8, 0.25, friction, restitution)
        given = {"diameter": 0.002, "max_overlap": 0.05}
        assert time_step_for(stuff, **given) == contact_time(stuff, **given) / 8
        dead = Material("dead", 2600, 1e8, 0.25, friction, 0.2)
        assert time_step_for(dead, **given) == longest_step(dead, **given) < contact_time(stuff, **given) / 11


@pytest.mark.parametrize("bound", [0.01, 0.05])
def test_the_young_chosen_keeps_a_collision_within_the_bound_and_near_it(bound):
    """Two grains meet at the speed for which the modulus was chosen: the overlap is the bound, but for the step."""
    d, speed = 0.004, 2.0
    young = choose_young(SAND, pressure=0.0, speed=speed, max_overlap=bound)
    assert young < SAND.young
    stuff = Material("grain", SAND.density, SAND.young, SAND.poisson, 0.0, 1.0)
    bed = Bed.from_grains(
        stuff,
        young=young,
        positions=np.array([[0.02, 0.02, 0.02], [0.02 + d, 0.02, 0.02]]),
        radii=np.full(2, d / 2),
        velocities=np.array([[speed / 2, 0, 0], [-speed / 2, 0, 0]]),
        size=(0.045, 0.045, 0.04),
        height=0.045,
        gravity=0.0,
        floor=False,
        max_overlap=1.02 * bound,
    )
    bed.advance(20)
    assert bed.max_overlap == pytest.approx(bound, rel=5e-3)


def test_the_young_chosen_bears_the_largest_force_of_a_bed_under_pressure():
    """F = 2/3 E* d^2 (delta/d)^1.5 at the bound is CHAIN times p d^2."""
    young = choose_young(SAND, pressure=1e4, speed=0.0, max_overlap=0.05)
    star = young / (1 - SAND.poisson**2) / 2
    assert 2 / 3 * star * 0.05**1.5 == pytest.approx(CHAIN * 1e4)


def test_the_young_chosen_bears_the_pull_of_cohesion():
    """On a plane 4 pi gamma d / 2, as a pressure over d^2; and it asks for the diameter."""
    sticky = Material("sticky", 2600, 1e12, 0.25, 0.5, 0.5, 0.1, "jkr", 0.5)
    young = choose_young(sticky, pressure=0.0, speed=0.0, max_overlap=0.05, diameter=0.002)
    star = young / (1 - 0.25**2) / 2
    assert 2 / 3 * star * 0.002**2 * 0.05**1.5 == pytest.approx(4 * math.pi * 0.5 * 0.001)
    with pytest.raises(ValueError, match="diameter is needed for grains with cohesion 'jkr'"):
        choose_young(sticky, pressure=0.0, speed=0.0, max_overlap=0.05)


def test_jkrs_wider_contact_shortens_the_contact_time():
    """pi sqrt(m / 2 E* a) with JKR's a at the bound, on a rigid plane."""
    sticky = Material("sticky", 2600, 1e7, 0.25, 0.5, 0.5, 0.1, "jkr", 1.0)
    star = 1e7 / (1 - 0.0625)
    a, _ = jkr_contact(1e-4, surface_energy=1.0, radius=1e-3, effective_young=star)
    mass = 2600 * math.pi * 0.002**3 / 6
    assert contact_time(sticky, diameter=0.002, max_overlap=0.05) == pytest.approx(
        math.pi * math.sqrt(mass / (2 * star * a))
    )
    assert a > 1.05 * math.sqrt(1e-3 * 1e-4)


def test_the_young_chosen_is_never_above_the_materials_own():
    assert choose_young(SAND, pressure=0.0, speed=1000.0, max_overlap=0.01) == SAND.young


# ---------------------------------------------------------------------------- materials

GOOD = {"name": "x", "density": 1.0, "young": 1.0, "poisson": 0.2, "friction": 0.1, "restitution": 0.5}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("poisson", 0.5),
        ("poisson", -0.1),
        ("poisson", math.nan),
        ("restitution", 1.1),
        ("restitution", 0.0),
        ("density", -1.0),
        ("density", math.inf),
        ("density", math.nan),
        ("young", 0.0),
        ("young", math.nan),
        ("young", math.inf),
        ("friction", -0.1),
        ("friction", math.inf),
        ("rolling_friction", -0.1),
        ("surface_energy", 0.05),
    ],
)
def test_a_material_that_cannot_be_is_refused_by_key_and_value(key, value):
    with pytest.raises(ValueError, match=rf"material 'x': {key} = {value} must be"):
        Material(**GOOD | {key: value})


def test_an_unknown_law_of_cohesion_is_refused_and_the_nearest_offered():
    with pytest.raises(ValueError, match=r"cohesion = 'JRK' is no law; there is none, dmt, jkr; did you mean 'jkr'\?"):
        Material(**GOOD, cohesion="JRK", surface_energy=0.1)
    with pytest.raises(ValueError, match=r"cohesion = 'glue' is no law; there is none, dmt, jkr$"):
        Material(**GOOD, cohesion="glue")
    with pytest.raises(ValueError, match=r"tangential = 'rescale' is no law; .*did you mean 'rescaled'\?"):
        Material(**GOOD, tangential="rescale")
    for value in (0.0, -0.1, math.nan, math.inf):
        with pytest.raises(ValueError, match=f"surface_energy = {value} must be positive with cohesion 'jkr'"):
            Material(**GOOD, cohesion="jkr", surface_energy=value)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("friction", -0.1, "be 0 or more"),
        ("rolling_friction", math.inf, "be 0 or more"),
        ("surface_energy", -1.0, "be 0 or more"),
        ("restitution", 1.01, "lie between 0.01 and 1"),
        ("restitution", 0.0, "lie between 0.01 and 1"),
        ("young", 0.0, "be positive"),
        ("poisson", 0.5, "be at least 0 and below 0.5"),
        ("poisson", math.nan, "be at least 0 and below 0.5"),
    ],
)
def test_a_facing_that_cannot_be_is_refused_by_key_and_value(key, value, words):
    with pytest.raises(ValueError, match=rf"{key} = {value} must {words}"):
        Facing(**{key: value})


def test_a_facing_sticks_only_where_grains_have_a_law_for_it():
    with pytest.raises(
        ValueError, match=r"surface_energy = 0.1 J/m2 needs a law: the material 'sand' has cohesion 'none'"
    ):
        Facing(surface_energy=0.1).refuse_for(SAND)
    Facing(surface_energy=0.0).refuse_for(SAND)


def test_materials_are_found_by_name_and_the_nearest_is_offered():
    assert material("Sand") is SAND is material(SAND) and MATERIALS["sand"] is SAND
    with pytest.raises(ValueError, match=r"material = 'sandd' is not known.*did you mean 'sand'\?"):
        material("sandd")
    with pytest.raises(ValueError, match=r"material = 'jsc1a' is not known.*did you mean 'jsc-1a-loose-cut'\?"):
        material("jsc1a")  # The surface of that name has these grains
    with pytest.raises(ValueError, match="material = 'gold' is not known; there is "):
        material("gold")


def test_sand_is_the_calibrated_one_and_the_one_of_before_has_another_name():
    """Alike but for rolling friction; the earlier name of the first is still taken, and users are told."""
    assert (SAND.rolling_friction, SAND_WEAK.rolling_friction) == (0.356, 0.1)
    assert replace(SAND_WEAK, name="sand", rolling_friction=0.356) == SAND
    with pytest.warns(FutureWarning, match="'sand-calibrated' is called 'sand'"):
        assert material("sand-calibrated") is SAND
    older = {("sand", 0.1): SAND_WEAK, ("sand-calibrated", 0.356): SAND}
    for (name, rolling), today in older.items():
        assert of_before(replace(SAND, name=name, rolling_friction=rolling)) == today
    others = (replace(SAND, rolling_friction=0.2), replace(SAND_WEAK, name="sand-calibrated"))
    for stuff in (SAND, SAND_WEAK, *others):  # with numbers of its own a material keeps its name
        assert of_before(stuff) is stuff


def test_every_number_of_a_preset_has_a_source():
    for stuff in MATERIALS.values():
        assert set(stuff.sources) >= {"density", "young", "poisson", "friction", "restitution", "rolling_friction"}


def test_a_preset_whose_bulk_figures_are_off_says_so():
    """By the names that there are, and never of what a user calibrated."""
    assert set(CAVEATS) == set(MATERIALS) - {"sand", "jsc-1a-loose-cut"}
    assert CAVEATS["sand-weak"] in caveat(SAND_WEAK) and "docs/materials.md" in caveat(SAND_WEAK)
    assert caveat(SAND) is caveat(replace(SAND_WEAK, name="mine")) is None
    for said in CAVEATS.values():
        assert all(name in MATERIALS for name in re.findall(r"'([a-z0-9-]+)'", said))
