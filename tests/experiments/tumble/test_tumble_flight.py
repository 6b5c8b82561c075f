"""How a platform lies on grains in flight: what carries it, how that scales, what is refused."""

import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dem.grains.materials import material
from experiments.grains.flight import PACKING, lies_in_flight
from experiments.grains.softening import bearing_gradient
from experiments.platform.surfaces import find_surface
from experiments.tumble import experiment as tumble
from experiments.tumble.on_grains import PlanarOnBed
from experiments.tumble.settings import TumbleSettings
from rigid.model.trial import Trial
from rigid.platform.rig import STANDARD_GRAVITY

SAND = material("sand")
HULL = {"surface": "sand", "material": SAND, "hull_radius": 0.14, "width": 0.072, "duration": 1.0}


def of(gravity, **more):
    return lies_in_flight(Trial(gravity_sim=gravity, gravity=gravity, **({"torque": 0.22} | more)), **HULL)


def test_it_lies_as_deep_under_any_gravity():
    """Strength and weight both go with g (Altshuler et al. 2014): the depth is the same, to round-off."""
    found = [of(share * STANDARD_GRAVITY) for share in (1.0, 1e-2, 1e-4, 1e-6)]
    for one in found[1:]:
        assert (one.sunk, one.deepest, one.reach) == pytest.approx((found[0].sunk, found[0].deepest, found[0].reach))
    assert found[0].on_hull and 0.044 < found[0].sunk < 0.06


def test_spikes_and_hull_together_carry_the_weight():
    """The hull's share: the plate law's pressure over the chord of a cylinder, summed here by the trapezium."""
    gravity = 0.1
    lying = of(gravity)
    level = 0.2 * math.cos(math.pi / 8)
    hull = lying.sunk - (level - 0.14)
    along = np.linspace(-1, 1, 20001) * math.sqrt(2 * 0.14 * hull)
    gradient = bearing_gradient(PACKING * SAND.density, gravity, SAND.friction)
    pressed = 0.072 * gradient * np.trapezoid(hull - along**2 / 0.28, along)
    stood = 2 * find_surface("sand").stiffness * gravity / STANDARD_GRAVITY * lying.sunk
    assert pressed + stood == pytest.approx(5.3 * gravity, rel=1e-6)
    assert lying.deepest == pytest.approx(0.2 - level + lying.sunk)


def test_a_light_platform_stands_on_its_spikes():
    lying = of(0.1, mass=0.5, inertia=0.01)
    assert not lying.on_hull
    assert lying.sunk == pytest.approx(0.5 * STANDARD_GRAVITY / (2 * find_surface("sand").stiffness))


def test_no_tip_is_faster_than_on_a_platform_that_spins_freely():
    assert of(0.1).fastest == pytest.approx(0.22 / 0.06 * 0.2)
    wheel = {"torque": 6.0, "actuator": "brake", "wheel_speed_0": 300.0}
    assert of(0.1, **wheel).fastest == pytest.approx(300 * 1.2e-3 / 0.06 * 0.2)


def test_one_that_sinks_in_to_its_middle_is_refused():
    with pytest.raises(ValueError, match=r"gravity = 0.1 m/s2: .* Use a lighter platform, or a rig"):
        lies_in_flight(Trial(gravity_sim=0.1, gravity=0.1, mass=500.0), **HULL)


def in_flight(**more):
    given = {
        "surface": "sand-weak", "ground": "bed", "grain": 0.0048, "bed_size": (0.5, 0.036, 0.096), "gravity": 0.0980665,
        "settle_gravity": 0.4903325, "max_overlap": 0.1, "duration": 1.2,
    }  # fmt: skip
    return TumbleSettings(**(given | more))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"gravity": None}, r"settle_gravity = 0.490333 m/s2 is for a platform without a rig.* give gravity"),
        ({"settle_gravity": 0.05}, r"settle_gravity = 0.05 m/s2 is below gravity = 0.0980665 m/s2"),
        ({"drop_speed": 0.05}, r"settle_gravity = 0.490333 m/s2 with drop_speed"),
        ({"sleep": True}, r"settle_gravity = 0.490333 m/s2 with sleep"),
        ({"ground": "spring-damper"}, r"belongs to ground = 'bed'"),
    ],
)
def test_a_gravity_to_settle_under_that_will_not_do_is_refused(given, said):
    with pytest.raises(ValueError, match=said):
        in_flight(**given)


@pytest.mark.parametrize(
    ("size", "said"),
    [
        (
            (0.36, 0.036, 0.096),
            r"bed_size = 0.36 m along .* turning on its hull, .* at both ends .* use 0.45 m",
        ),
        ((0.5, 0.036, 0.046), r"bed_size = 0.046 m deep .* turning on its hull, a tip goes 0.07 m .* use 0.094 m"),
    ],
)
def test_a_bed_too_small_for_a_platform_on_its_hull_is_refused_with_the_size_that_would_do(size, said):
    with pytest.raises(ValueError, match=said):
        tumble.check(in_flight(bed_size=size))


def test_the_bed_is_made_and_its_grains_chosen_under_the_gravity_to_settle_under():
    beds = [PlanarOnBed(in_flight()), PlanarOnBed(in_flight(settle_gravity=None))]
    assert [bed.first_gravity for bed in beds] == [0.4903325, 0.0980665]
    law, speed = beds[0].forecast, beds[0].lowering_speed
    for bed in beds:
        bed.forecast = replace(law, pushed=0.0)  # no torque, which presses as much under any gravity
    soft, softer = (bed.softening().pressure for bed in beds)
    assert soft > 1.5 * softer
    assert speed == pytest.approx(math.sqrt(0.4903325 * law.sunk))


@pytest.mark.parametrize("gravity", ["1e-2", "1e-4", "1e-6"])
@pytest.mark.parametrize("turn", ["0.22", "brake"])
def test_grains_chosen_for_what_a_torque_presses_with_would_have_kept_the_overlaps_that_were_met(gravity, turn):
    """By Hertz, from the kept runs of 0.22 N m and of the brake, whose grains had a modulus that was set by hand."""
    root, name = Path(__file__).parents[3], f"grains2-flight-{gravity}-{turn}"
    case = tomllib.loads((root / f"experiments/cases/grains/{name}.toml").read_text())
    kept = json.loads((root / f"docs/results/{name}/result.json").read_text())["grains"]
    settings = TumbleSettings(**case | {"young": None})
    chosen = PlanarOnBed(settings).softening().young
    needed = kept["young"] * (kept["max_overlap"] / settings.max_overlap) ** 1.5
    assert needed < chosen < 4 * needed, chosen / needed
