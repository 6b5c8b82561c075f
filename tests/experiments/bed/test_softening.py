"""The modulus goes with pressure and overlap as Hertz says, and never above the real grains'."""

import math
from dataclasses import replace

import pytest
from golden import golden

from dem import Material
from dem.contact.timestep import choose_young, contact_time, longest_step, stable_step, time_step_for
from experiments.grains.softening import (
    Softening,
    bearing_gradient,
    chain,
    check_young,
    drop_depth,
    run_limit,
    soften_material,
    stable_overlap,
)

SAND = {"grain": 0.0024, "gravity": 9.81, "bed_height": 0.05, "depth": 0.02, "speed": 0.1}


def soften(*, surface_energy=0.0, **case):
    """Of grains of one size."""
    sticks = {"cohesion": "dmt", "surface_energy": surface_energy} if surface_energy else {}
    return soften_material(Material("stuff", 2650.0, 7e10, 0.25, 0.5, 0.5, 0.1, **sticks), spread=0.0, **case)


def test_bearing_of_a_plate_as_published():
    """3D-RFT at mu = 0.5: 894/8 - 386/4 + 89/2 = 59.75 times rho g, and 0.876 of that for a flat plate."""
    assert bearing_gradient(1600.0, 9.81, 0.5) == pytest.approx(0.876 * 59.75 * 1600 * 9.81)
    assert bearing_gradient(1600.0, 9.81, 5.0) == bearing_gradient(1600.0, 9.81, 0.9)


def test_overlap_to_the_power_of_minus_three_halves():
    """delta/d = (1.5 chain p / E*)^(2/3)."""
    soft, stiff = (soften(max_overlap=overlap, **SAND).young for overlap in (0.05, 0.0125))
    assert stiff / soft == pytest.approx(8.0 * chain(0.0125) / chain(0.05))


def test_stiff_grains_carry_more_on_a_chain_as_measured():
    """1.4 times what was measured: 2.8 at 3.9 % of a diameter, five grains across the tip; 5.2 at 1.02 %, ten."""
    assert chain(0.05) == chain(0.1) == 4.0 >= 1.4 * 2.8
    assert chain(0.01) == chain(0.001) == 7.4 >= 1.4 * 5.2
    assert chain(math.sqrt(0.05 * 0.01)) == pytest.approx((4.0 + 7.4) / 2)


def test_grains_that_stick_are_as_stiff_as_their_pull_asks_for():
    """Weightless and slow, 4 pi gamma R on a plane is F = 2/3 E* d^2 (delta/d)^1.5 at the bound, as ``dem`` has it."""
    bare = SAND | {"gravity": 0.0, "speed": 0.0}
    young = soften(max_overlap=0.05, surface_energy=0.5, **bare).young
    star = young / (2 * (1 - 0.25**2))
    assert 2 / 3 * star * 0.0024**2 * 0.05**1.5 == pytest.approx(4 * math.pi * 0.5 * 0.0012)
    sticky = Material("sticky", 2650, 7e10, 0.25, 0.5, 0.5, 0.1, "dmt", 0.5)
    assert young == pytest.approx(choose_young(sticky, pressure=0.0, speed=0.0, max_overlap=0.05, diameter=0.0024))


def test_the_smallest_of_wide_sizes_keep_the_bound():
    """Within 1 +- 0.15 nothing changes; within 1 +- 0.5 the mean grain is held to 0.5 / 0.85 of the bound."""
    stuff = Material("stuff", 2650, 7e10, 0.25, 0.5, 0.5)
    narrow, usual, wide = (soften_material(stuff, max_overlap=0.05, spread=s, **SAND).young for s in (0.05, 0.15, 0.5))
    assert narrow == usual == soften(max_overlap=0.05, **SAND).young
    assert wide == soften(max_overlap=0.05 * 0.5 / 0.85, **SAND).young > 2 * usual


def test_fast_spikes_need_stiffer_grains_and_real_grains_are_the_bound():
    assert soften(max_overlap=0.05, **(SAND | {"speed": 20.0})).young > 40 * soften(max_overlap=0.05, **SAND).young
    with pytest.raises(
        ValueError, match=r"drop_speeds = 1000 m/s .* even at their real E = 7e\+10 Pa: use at most 149 m/s"
    ):
        soften(max_overlap=0.05, fastest="drop_speeds", **(SAND | {"speed": 1000.0}))
    with pytest.raises(ValueError, match=r"max_overlap = 0.0001 .* is not possible at .* about 0.011, or less depth"):
        soften(max_overlap=1e-4, **(SAND | {"depth": 5.0, "speed": 0.01}))
    with pytest.raises(ValueError, match="max_overlap"):
        soften(max_overlap=0.0, **SAND)


def test_the_fall_of_the_rain_asks_for_stiffness_only_past_five_percent():
    """From 80 mm, 1.25 m/s: at 1 % the fall alone would ask 0.05^2.5 / 0.01^2.5 = 56 times what 5 % asks."""
    assert soften(max_overlap=0.01, fall=0.08, **SAND).young == soften(max_overlap=0.01, **SAND).young
    high, higher = (soften(max_overlap=0.01, fall=fall, **SAND).young for fall in (100.0, 200.0))
    assert higher == pytest.approx(2 * high)
    assert soften(max_overlap=0.05, fall=100.0, **SAND).young == pytest.approx(high)


def test_small_gravity_makes_soft_grains():
    light = soften(max_overlap=0.05, **(SAND | {"gravity": 1e-4, "speed": 1e-3}))
    assert light.young < 1e-3 * soften(max_overlap=0.05, **SAND).young
    assert light.factor == pytest.approx(7e10 / light.young)


def test_a_drop_stops_where_the_energies_meet():
    depth = drop_depth(0.1, 2.6, 0.2, 100.0)
    assert 0.5 * 100 * depth**2 - 0.2 * depth == pytest.approx(0.5 * 2.6 * 0.1**2)
    assert drop_depth(0.0, 2.6, 0.2, 100.0) == pytest.approx(2 * 0.2 / 100)


def test_a_modulus_that_could_not_hold_the_bed_is_refused():
    """A tenth of what is chosen is (1/10)^(-2/3) = 4.6 times the overlap; nothing is asked of what is chosen itself."""
    chosen = soften(max_overlap=0.05, **SAND).young
    for young in (None, chosen, 0.11 * chosen):
        check_young(young, chosen=chosen, max_overlap=0.05)
    with pytest.raises(ValueError, match=r"young = 1 Pa is so soft .* max_overlap = 0.05: use .* Pa"):
        check_young(1.0, chosen=chosen, max_overlap=0.05)


def test_a_run_may_pass_its_bound_and_says_so():
    """F ~ E overlap^1.5 (Hertz): from 6 to 5 % of a diameter the modulus goes by 1.2^1.5 = 1.315."""
    soft = Softening(1e7, 1.0, 1.0, 7e10)
    assert soft.overlapping(0.049) is None
    past, allowed, meant = soft.overlapping(0.06), soft.overlapping(0.06, 0.1), soft.overlapping(0.02, 0.01)
    assert "6 % of" in past and "= 5 %" in past and "young = 1.3e+07" in past
    assert "6 % of" in allowed and "max_overlap = " not in allowed and "where 5 %" in allowed
    assert "2 % of" in meant and "= 1 %" in meant and "young = 2.8e+07" in meant
    golden("bed/past_its_overlap", {"past": past, "allowed": allowed, "meant": meant})
    assert [run_limit(bound) for bound in (0.01, 0.05, 0.15, 0.2)] == [0.02, 0.1, 0.2, 0.2]


def test_past_its_bound_a_step_is_stable_for_a_lattice_up_to_the_overlap_whose_longest_step_it_is():
    """At e = 0.5 six contacts that stick allow 0.1099 of a pair's half-period, 2^(1/4) of which a wall's is: where a
    step is an eighth of that, overlaps may be (0.1099 2^(1/4) 8)^4 = 1.195 times as large."""
    sand = Material("sand", 2650.0, 7e10, 0.25, 0.5, 0.5, 0.1)
    assert stable_step(0.5, neighbours=6, sticking=True) == pytest.approx(0.1099, abs=5e-5)
    found = stable_overlap(sand, 0.05)
    assert found / 0.05 == pytest.approx((0.1099 * 2**0.25 * 8) ** 4, rel=2e-3)
    step = time_step_for(sand, diameter=2.4e-3, max_overlap=0.05)
    assert longest_step(sand, diameter=2.4e-3, max_overlap=found) == pytest.approx(step, rel=1e-12)
    assert stable_overlap(replace(sand, restitution=0.3), 0.05) == 0.05  # its step is the longest already
    # A pair alone, at the overlap where a run ends: 1/6.7 of a wall's half-period, where 2 / pi of it is the most.
    share = step / contact_time(sand, diameter=2.4e-3, max_overlap=run_limit(0.05))
    assert share == pytest.approx(2**0.25 / 8) and share < stable_step(0.5, neighbours=3) / 4
    soft = Softening(1e7, 1e4, 0.1, 7e10)
    assert "above 5.97 %" in soft.overlapping(0.065, 0.05, found)
    assert "time step" not in soft.overlapping(0.055, 0.05, found)
