"""What the cases with bodies in prepared beds are computed by, against closed forms; the cases themselves are slow."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dem import Bed
from experiments.validate.base.drops import BEADS, drop, part
from experiments.validate.beds import intrusion, low_gravity
from experiments.validate.beds.intrusion import cone_coefficient
from experiments.validate.beds.low_gravity import collapsed, power_of
from experiments.validate.measured.impact import KNOTS, Refit, energy, published, refit, separated
from rigid.ground.rft import flat_plate, tractions


def law(speed, d1, k_over_m):
    """z'' = g - z'^2 / d1 - k/m z, as a drop's arrays."""
    stops = lambda _, y: y[1]  # noqa: E731
    stops.terminal, stops.direction = True, -1
    found = solve_ivp(
        lambda _, y: [y[1], 9.81 - y[1] ** 2 / d1 - k_over_m * y[0]], (0, 1), [0, speed], events=stops,
        rtol=1e-9, atol=1e-12, dense_output=True,
    )  # fmt: skip
    time = np.linspace(0, found.t[-1], 400)
    return {"time": time, "depth": found.sol(time)[0], "velocity": found.sol(time)[1]}


def test_the_law_of_katsuragi_and_durian_is_read_off_its_own_trajectories():
    """F / m = v^2 / d1 + k z / m of drops that obey it: slope and rest bin by bin, and the stops that follow."""
    speeds = (0.3, 0.6, 1.0, 1.5, 2.0)
    falls = [law(speed, 0.05, 1500.0) for speed in speeds]
    for fall in falls:
        closed = energy(fall["depth"], start=fall["velocity"][0] ** 2, d1=0.05, k_over_m=1500.0)
        assert np.abs(closed - fall["velocity"] ** 2).max() < 1e-6 * fall["velocity"][0] ** 2
    found = separated(falls, speeds)
    known = found.regressed
    assert known.sum() > 10 and found.drag[known] == pytest.approx(1 / 0.05, rel=0.02)
    assert found.rest[known] == pytest.approx(1500.0 * found.depth[known], abs=0.5)
    plain, other = (Refit((slope,) * len(KNOTS), 1500.0) for slope in (1 / 0.05, 50.0))
    assert found.k_over_m == pytest.approx(1500.0, rel=0.02)
    assert found.misfit < 0.01 and found.misfit_of(plain) < 0.01 < 0.1 < found.misfit_of(other)
    again = refit(falls)
    assert again.k_over_m == pytest.approx(1500.0, rel=0.02) and found.misfit_of(again) < 0.02
    for fall, speed in zip(falls, speeds, strict=True):
        assert plain.stop(speed**2) == pytest.approx(fall["depth"][-1], rel=1e-3)
        assert again.stop(speed**2) == pytest.approx(fall["depth"][-1], rel=3e-3)
    assert published(2.0)[1] < published(0.5)[1]  # the faster, the sooner it stops


def test_a_cone_bears_the_sum_of_its_rings():
    """F = xi_n alpha int_0^z 2 pi h tan b (z - h) dh / cos b."""
    half = math.radians(30)
    alpha = tractions([[math.cos(half), 0, -math.sin(half)]], (0, 0, -1), surface_friction=0.5)[0, 2]
    h = (np.arange(4000) + 0.5) / 4000
    rings = alpha * (2 * math.pi * h * math.tan(half) / math.cos(half) * (1 - h)).mean()
    assert cone_coefficient(half, surface_friction=0.5) == pytest.approx(rings, rel=1e-6)


def test_bodies_that_obey_3d_rft_come_out_as_predicted_and_a_weak_cone_does_not(monkeypatch):
    """Plates F = 0.876 xi A z, a cone F = xi c z^3; the plate of 15 grains gives xi back."""
    depth = np.linspace(0.0, 0.08, 500)
    pointed = cone_coefficient(intrusion.HALF_ANGLE, surface_friction=BEADS.friction)

    def driven(name, shape, seed):
        pushed = pointed * depth**3
        if name != "cone":
            across = float(name.split()[2]) * intrusion.GRAIN
            pushed = flat_plate() * math.pi / 4 * across**2 * depth
        weak = 0.5 if name == "cone" and seed == weaker else 1.0
        return {"depth": depth, "force": 2e5 * weak * pushed, "packing": np.array(0.58), "count": np.array(9)}

    monkeypatch.setattr(intrusion, "_driven", driven)
    weaker = None
    found = intrusion.CASES["rft"](lambda done: None)
    assert [one.ours for one in found.comparisons] == pytest.approx([1.0] * 3) and found.status == "pass"
    assert "0.200 MPa/m" in found.remarks[0]
    weaker = intrusion.SEEDS[0]
    assert intrusion.CASES["rft"](lambda done: None).comparisons[-1].ours == pytest.approx(1 - 0.5 / 3)


def test_balls_of_two_sizes_on_one_curve_pass_and_one_that_goes_deeper_by_a_sixth_does_not(monkeypatch):
    def fall(drop):
        length = drop.ball + drop.grain
        unit, deeper = math.sqrt(length / drop.gravity), share if drop.ball == smallest else 1.0
        time = np.linspace(0.0, 3 * unit, 60)
        return {"time": time, "depth": deeper * length * (1 - np.exp(-time / unit)), "count": np.array(9)}

    monkeypatch.setattr(low_gravity.Drop, "run", fall)
    smallest, share = min(low_gravity.ACROSS) * low_gravity.GRAIN, 1.0
    found = low_gravity.CASES["size-collapse"](lambda done: None)
    assert found.status == "pass" and found.comparisons[1].ours == pytest.approx(0.0, abs=1e-12)
    share = 7 / 6
    found = low_gravity.CASES["size-collapse"](lambda done: None)
    assert found.status == "fail" and found.comparisons[0].ours / found.comparisons[0].reference == pytest.approx(7 / 6)


def test_curves_of_one_law_at_several_gravities_collapse():
    runs, units = [], []
    for gravity in (10.0, 0.1):
        unit = math.sqrt(0.1 / gravity)
        time = np.linspace(0, 3 * unit, 50)
        runs.append({"time": time, "depth": 0.05 * (1 - np.exp(-time / unit))})
        units.append(unit)
    _, depths = collapsed(runs, [0.1, 0.1], units)
    assert np.abs(depths[0] - depths[1]).max() < 1e-12 and depths[0, -1] == pytest.approx(0.5 * (1 - math.exp(-3)))
    assert power_of([1.0, 10.0, 100.0], [2.0, 0.2, 0.02]) == pytest.approx(-1)


def test_a_part_is_computed_once_for_its_settings(tmp_path, monkeypatch):
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path))
    calls = []

    def compute():
        calls.append(1)
        return {"depth": np.arange(3.0)}

    for _ in range(2):
        assert (part("x", {"speed": 1.0}, compute)["depth"] == np.arange(3.0)).all()
    part("x", {"speed": 2.0}, compute)
    assert len(calls) == 2


def layers(gravity):
    """A few grains on one another, as stiff against gravity at any gravity, and a ball that is let go on them."""
    d = 0.004
    k = np.arange(144)
    places = np.column_stack([k % 6 + 0.5, k // 6 % 6 + 0.5, k // 36 * 1.05 + 0.6]) * 1.05 * d
    places += np.random.default_rng(3).uniform(-0.04, 0.04, (144, 3)) * d
    unit = math.sqrt(d / gravity)
    bed = Bed.from_grains(
        BEADS, positions=places, radii=np.full(144, 0.49 * d), size=(6.3 * d, 6.3 * d, 4 * d), height=20 * d,
        gravity=gravity, young=2e6 * gravity,
    )  # fmt: skip
    bed.advance(round(3 * unit / bed.time_step), drag_time=unit)
    bed.measure_surface()
    middle = 3.15 * d
    found = drop(bed, radius=1.5 * d, density=8000.0, speed=0.5 * math.sqrt(gravity * d), at=(middle, middle),
                 longest=10 * unit)  # fmt: skip
    return found["depth"] / d, found["time"] / unit


@pytest.mark.long
def test_a_ball_falls_into_grains_at_a_millionth_of_gravity_as_at_1_g():
    """Depth over d is a function of t sqrt(g / d): with g a power of 4 smaller no rounding differs, and no bit may."""
    depth, time = layers(9.81)
    tiny_depth, tiny_time = layers(9.81 / 4**10)
    assert depth[-1] > depth[0] + 0.3
    assert len(depth) == len(tiny_depth) and np.abs(depth - tiny_depth).max() < 1e-9
    assert np.abs(time - tiny_time).max() < 1e-9 * time[-1]
