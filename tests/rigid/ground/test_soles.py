"""How a surface law follows the size of a foot: similar motions, Bekker's plate, 3D-RFT over the foot's underside."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad

from rigid.ground.laws import GROUNDS, find_law
from rigid.ground.rft import flat_plate, stress_gradient, tractions
from rigid.ground.rft_foot import FLAT, LYING, ROUND
from rigid.ground.rft_table import law_force, mesh_pieces
from rigid.ground.soles import Sole, diameter_powers, ill_sized, shape_ratio, sized_law

SAND = {"bulk_density": 1500.0, "friction": 0.6, "gravity": 9.81}
BALL = Sole.of_spike(0.012)


def force(sized, depth, rate=0.0):
    law = find_law(sized.law)
    return law.force(depth, rate, law.numbers(sized.parameters, count=sized.count))


def plate(area, **others):
    return Sole(**{"area": area, "width": math.sqrt(area / math.pi)} | others)


@pytest.mark.parametrize("name", [name for name in GROUNDS if name != "bekker"])
def test_similar_feet_in_similar_motions_have_forces_as_the_cube_of_the_diameter(name):
    """F / (rho g D^3) is a function of z / D and v / sqrt(g D): three times the foot, depth, and three times v^2."""
    law = find_law(name)
    small, large = (Sole.of_spike(diameter) for diameter in (0.012, 0.036))
    one, other = (sized_law(name, law.values({}), sole, of=0.012) for sole in (small, large))
    for depth, rate in ((0.001, 0.0), (0.004, 0.3), (0.011, 0.05)):
        assert force(other, 3 * depth, math.sqrt(3) * rate) == pytest.approx(27 * force(one, depth, rate), rel=1e-9)


def test_the_tip_that_the_numbers_are_of_keeps_them():
    for name, law in GROUNDS.items():
        sized = sized_law(name, law.values({}), BALL, of=0.012)
        p = law.numbers({})
        for depth, rate in ((0.001, 0.2), (0.005, 0.0), (0.01, 0.4)):
            # The series of rft-foot is fitted to the force, that of rft to the traction: both within 0.3 %.
            assert force(sized, depth, rate) == pytest.approx(
                law.force(depth, rate, p), rel=5e-3 if name == "rft" else 1e-12
            )


def test_a_law_of_plates_has_the_area_of_the_foot_times_bekkers_pressure():
    """A (k_c / b + k_phi) z^n; b: the radius of a disc, the smaller side of a rectangle (Bekker 1969)."""
    values = find_law("bekker").values({"cohesive_modulus": 2e4, "frictional_modulus": 1e6, "exponent": 1.1})
    for sole in (plate(math.pi * 0.03**2), Sole(area=0.1 * 0.06, width=0.06)):
        pressure = (2e4 / sole.width + 1e6) * 0.01**1.1
        assert force(sized_law("bekker", values, sole, of=0.012), 0.01) == pytest.approx(sole.area * pressure, rel=1e-9)


def test_a_flat_foot_in_resistive_force_theory_bears_its_closed_form():
    """F = 0.876 xi A z + alpha_wall xi P z^2 / 2 + lambda rho A v^2."""
    sole, depth, rate = plate(2.83e-3, perimeter=0.19), 0.004, 0.5
    values = find_law("rft").values(SAND | {"inertia": 1.1})
    xi = stress_gradient(**SAND)
    wall = tractions([[1.0, 0.0, 0.0]], (0.0, 0.0, -1.0), surface_friction=0.4)[0, 2]
    wanted = flat_plate() * xi * sole.area * depth + wall * xi * sole.perimeter * depth**2 / 2
    sized = sized_law("rft", values, sole, of=0.012)
    assert force(sized, depth) == pytest.approx(wanted, rel=1e-9)
    assert force(sized, depth, rate) - force(sized, depth) == pytest.approx(1.1 * 1500 * sole.area * rate**2, rel=1e-9)
    assert force(sized, 0.3) > force(sized, 0.29) > wanted  # goes on below one radius of the foot


def test_a_wheel_in_resistive_force_theory_bears_the_integral_over_its_rim():
    """Against a cylinder of 2000 flat strips on each of which xi alpha acts (`law_force`), its ends left out."""
    radius, wide = 0.1, 0.05
    angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 2001)
    x, z = radius * np.sin(angles), radius * (1 - np.cos(angles))
    a, b = (np.column_stack([x[k], np.full(2000, -0.5 * wide), z[k]]) for k in (slice(0, -1), slice(1, None)))
    c, d = b + [0, wide, 0], a + [0, wide, 0]
    strips = mesh_pieces(np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)]), count=1)
    assert (strips.normals[:, 2] < 0).all()
    sole = Sole(area=2 * radius * wide, width=wide, height=radius, roundness=LYING)
    sized = sized_law("rft", find_law("rft").values(SAND | {"inertia": 0.0}), sole, of=0.012)
    xi = stress_gradient(**SAND)
    for depth in (0.003, 0.01, 0.03, 0.09):
        wanted = law_force((xi, xi, xi, 0.0), 0.4, strips, depth, (0.0, 0.0, -1.0))[2]
        assert force(sized, depth) == pytest.approx(wanted, rel=5e-3)


def test_the_inertia_of_grains_acts_on_the_area_that_moves_them():
    """lambda rho v^2 times the integral of cos^3: pi R^2 / 2 of a half ball, 4 R L / 3 of half a cylinder."""
    values = find_law("rft").values(SAND | {"inertia": 1.0})
    ball = plate(math.pi * 0.02**2, height=0.02, roundness=ROUND)
    wheel = Sole(area=2 * 0.02 * 0.05, width=0.04, height=0.02, roundness=LYING)
    for sole, area in ((ball, 0.5 * math.pi * 0.02**2), (wheel, 4 / 3 * 0.02 * 0.05)):
        sized = sized_law("rft", values, sole, of=0.012)
        assert force(sized, 0.02, 0.7) - force(sized, 0.02) == pytest.approx(1500 * area * 0.49, rel=5e-3)


@pytest.mark.parametrize("roundness", [FLAT, LYING, ROUND])
def test_the_work_of_a_foot_is_the_integral_of_its_force(roundness):
    law = find_law("rft-foot")
    shape = {"area": 0.004, "height": 0.02, "roundness": roundness, "perimeter": 0.2}
    p = law.numbers(shape)
    for depth in (1e-5, 0.005, 0.0199, 0.05):
        for of, work in (
            (lambda z: law.loading(z, p), law.loading_work(depth, p)),
            (lambda z: law.rate_force(z, 0.4, p), law.rate_work(depth, 0.4, p)),
        ):
            bends = [p[2]] if depth > p[2] else None
            expected, _ = quad(of, 0, depth, points=bends, epsabs=0, epsrel=1e-9, limit=200)
            assert float(work) == pytest.approx(expected, rel=1e-7)


def test_what_is_given_is_of_the_foot_already():
    sole = plate(math.pi * 0.03**2)
    values = find_law("katsuragi-durian").values({"stiffness": 500.0})
    sized = sized_law("katsuragi-durian", values, sole, of=0.012, given=("stiffness",))
    assert sized.parameters["stiffness"] == 500.0 and sized.parameters["drag"] == pytest.approx(25 * values["drag"])
    values = find_law("bekker").values({"radius": 0.01})
    assert sized_law("bekker", values, sole, of=0.012, given=("radius",)).parameters == values


def test_defaults_of_hard_ground_and_of_another_exponent_follow_no_foot():
    assert ill_sized("power", ()) == ["stiffness", "damping"]
    assert ill_sized("hunt-crossley", ("stiffness",)) == ["dissipation"]
    assert ill_sized("power", ("stiffness", "damping")) == []
    assert ill_sized("power-irreversible", ("exponent",)) == ["stiffness"]
    assert ill_sized("bekker", ("exponent",)) == ["cohesive_modulus", "frictional_modulus"]
    assert not any(ill_sized(name, ()) for name in GROUNDS if name not in ("power", "hunt-crossley"))


def test_the_powers_of_the_diameter_are_those_of_one_scale_of_length_and_time():
    """c z^n (dz/dt)^q has c in proportion to D^(3 - n - q / 2)."""
    assert diameter_powers("power", {"exponent": 1.5}) == {"stiffness": 1.5, "damping": 2.5}
    assert diameter_powers("katsuragi-durian", {}) == {"stiffness": 2.0, "drag": 2.0}
    assert set(GROUNDS) == {name for name in GROUNDS if isinstance(diameter_powers(name, {}), dict)}


@pytest.mark.parametrize(
    ("law", "values", "of", "said"),
    [
        ("mud", {}, 0.012, "no surface law 'mud'"),
        ("power", {"width": 1.0}, 0.012, "width is no parameter of power"),
        ("power", {}, 0.0, "of = 0.0 must be above 0"),
        ("power", {}, math.nan, "of = nan must be above 0"),
        ("bekker", {}, math.inf, "of = inf must be above 0 .* and finite"),
    ],
)
def test_what_cannot_be_sized_is_refused_by_name(law, values, of, said):
    with pytest.raises(ValueError, match=said):
        sized_law(law, values, BALL, of=of)


@pytest.mark.parametrize("law", ["spring-damper", "bekker", "rft"])
@pytest.mark.parametrize(
    ("size", "value", "said"),
    [
        ("area", 0.0, r"area = 0\.0 must be above 0 \(m2\)"),
        ("area", -1e-4, r"area = -0\.0001 must be above 0"),
        ("area", math.nan, "area = nan must be above 0"),
        ("width", 0.0, r"width = 0\.0 must be above 0 \(m\)"),
        ("width", math.inf, "width = inf must be above 0 .* and finite"),
        ("height", -1e-3, r"height = -0\.001 must be at least 0"),
        ("perimeter", math.nan, "perimeter = nan must be at least 0"),
    ],
)
def test_a_sole_of_no_size_is_refused_by_name_under_every_law(law, size, value, said):
    with pytest.raises(ValueError, match=said):
        sized_law(law, {}, dataclasses.replace(BALL, **{size: value}), of=0.012)


def test_a_roundness_there_is_not_and_a_round_foot_without_height_are_refused():
    law = find_law("rft-foot")
    with pytest.raises(ValueError, match=r"roundness = 0\.5 must be 0"):
        law.numbers({"roundness": 0.5})
    with pytest.raises(ValueError, match=r"height = 0 m of a round foot"):
        law.numbers({"roundness": 2.0, "height": 0.0})


def test_the_ratio_of_shapes_is_that_of_two_forces_of_3d_rft_whatever_size_and_grains():
    """A flat foot without walls has 0.876 xi A z, a ball of its area the law rft; a shape has itself once."""
    area, gradient = 3e-3, stress_gradient(bulk_density=1500.0, friction=0.6, gravity=9.80665)
    radius = math.sqrt(area / math.pi)
    flat = Sole(area=area, width=radius, perimeter=0.0)
    law = find_law("rft")
    for share in (0.05, 0.2, 1.0):
        depth = 2 * share * radius
        ball = law.force(depth, 0.0, law.numbers({"radius": radius}))
        found = shape_ratio(flat, Sole.of_spike(0.012), depth=share)
        assert found == pytest.approx(flat_plate() * gradient * area * depth / ball, rel=6e-3)  # the series: 0.5 %
    for tip in (Sole.of_spike(0.012), Sole.of_flat_tip(0.012)):
        assert shape_ratio(tip, tip, depth=0.3) == pytest.approx(1.0, rel=1e-12)
    with pytest.raises(ValueError, match="depth = 0"):
        shape_ratio(flat, flat, depth=0.0)
