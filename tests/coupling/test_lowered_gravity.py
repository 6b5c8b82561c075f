"""Grains under a small gravity are those under a large one, slower; and gravity that falls in a hand, to rest."""

import math

import numpy as np
import pytest

from coupling import BedGround, CoupledTumble, platform_members
from coupling.lowered_gravity import NEAR, pace_under
from coupling.platform_run import AT_REST
from dem import Bed, Material
from rigid import Trial

D = 6e-3
YOUNG = 2e7


def layers(gravity, *, young=YOUNG, steps=1500):
    """Grains of 6 mm in two layers, at rest but for what they still have to sink."""
    rows, columns = 20, 6
    low = [((i + 0.5) * D, (j + 0.5) * D, 0.5 * D) for i in range(rows) for j in range(columns)]
    high = [((i + 1.0) * D, (j + 1.0) * D, 0.5 * D + D * math.sqrt(0.5)) for i in range(rows) for j in range(columns)]
    stuff = Material(
        name="glass", density=2500.0, young=young, poisson=0.25, friction=0.5, restitution=0.3, rolling_friction=0.0
    )
    bed = Bed.from_grains(
        stuff, positions=np.array(low + high), radii=np.full(2 * rows * columns, 0.5 * D), gravity=gravity,
        size=(rows * D, columns * D, 0.03), height=0.3, max_overlap=0.1, threads=1,
    )  # fmt: skip
    bed.advance(steps)
    bed.surface = float((bed.grains().position[:, 2] + 0.5 * D).max())
    return bed


def run_on(bed, gravity, *, torque=0.0, duration=0.1, speed=0.02, **options):
    trial = Trial(
        mass=0.3,
        inertia=2e-4,
        spike_length=0.04,
        wheel_inertia=1e-5,
        mu_s=0.5,
        gravity_sim=gravity,
        gravity=gravity,
        torque=torque,
    )
    members = platform_members(spike_length=0.04, count=8, diameter=8e-3, clear=0.015, hull_radius=0.02, width=0.036)
    footing = BedGround(bed, members, origin=(0.06, 0.018), copies=2.0, touch=1e-3 * trial.weight, friction=0.5)
    return CoupledTumble(
        trial,
        footing,
        duration=duration,
        substeps=8,
        tip_radius=4e-3,
        lowering_speed=speed,
        energy_interval=0.01,
        **options,
    )


@pytest.mark.long
def test_a_quarter_of_gravity_modulus_and_torque_is_the_same_tumble_at_half_the_speed_to_the_bit():
    """Lengths in d, times in sqrt(d / g), forces in rho g d^3: a quarter of g and E, and all numbers are those before
    times powers of two (Froude's similarity, exact for Hertz contacts whose restitution and friction are numbers)."""
    found = []
    for share in (1.0, 0.25):
        bed = layers(9.80665 * share, young=YOUNG * share)
        assert bed.time_step == layers(9.80665, steps=1).time_step / math.sqrt(share)
        run = run_on(
            bed, 0.3 * share, torque=0.006 * share, duration=0.04 / math.sqrt(share), speed=0.02 * math.sqrt(share)
        )
        found.append(run.run())
        assert run.pace == pace_under(9.80665 * share)
    one, other = found
    assert one.theta[-1] > 0.005
    for name, scale in (("x", 1.0), ("y", 1.0), ("theta", 1.0), ("omega", 2.0), ("torque_work", 4.0)):
        assert np.array_equal(getattr(one, name), scale * getattr(other, name)), name


@pytest.mark.long
def test_gravity_lowered_in_the_hand_leaves_the_platform_at_rest_where_it_lay():
    """From 0.5 to 0.01 m/s2: it lies where it was put but for overlaps that are let out, stays there, and carries."""
    bed = layers(0.5, young=5e6)
    run = run_on(bed, 0.01, duration=0.5, lower_gravity=True)
    heights = {}
    while not run.placed:
        run.advance()
        assert run.lowered is not None
        heights.setdefault(run.lowered.begun is not None, float(run.body.place[1]))
    bounds = NEAR * D
    assert bed.gravity == (0.0, 0.0, -0.01)
    assert run.body.trial.gravity_sim == 0.01
    assert abs(run.body.place[1] - heights[True]) < bounds
    assert run.lowered.sees * run.ground.grain_speed() < bounds
    found = run.run()
    assert np.hypot(np.ptp(found.x), np.ptp(found.y)) < 2 * bounds
    carried = run.feet[:, 0].sum(axis=1)
    assert carried[len(carried) // 2 :].mean() == pytest.approx(run.trial.weight, rel=0.05)
    assert run.samples["momentum_error"].max() < 1e-14


@pytest.mark.slow
def test_a_run_goes_on_from_a_checkpoint_while_gravity_falls_to_the_same_bits(tmp_path):
    bed = layers(0.5, young=5e6)
    kept = bed.state()
    run = run_on(bed, 0.25, torque=0.01, duration=0.02, lower_gravity=True)
    while run.lowered.done < 3:
        run.advance()
    np.savez(tmp_path / "state.npz", **run.state())
    found = run.run()
    bed.restore(kept)
    bed.set_gravity(0.5)
    other = run_on(bed, 0.25, torque=0.01, duration=0.02, lower_gravity=True)
    with np.load(tmp_path / "state.npz") as state:
        other.restore(dict(state))
    again = other.run()
    for name in ("x", "y", "theta", "omega", "dissipated"):
        assert np.array_equal(getattr(found, name), getattr(again, name)), name


@pytest.mark.parametrize(
    ("gravity", "options", "said"),
    [
        (1.0, {}, r"settle_gravity is 0.5 m/s2: it must not be below that of the run, 1"),
        (0.1, {"speed": None}, "a platform that is placed on a bed"),
    ],
)
def test_what_cannot_be_lowered_is_refused(gravity, options, said):
    with pytest.raises(ValueError, match=said):
        run_on(layers(0.5, young=5e6, steps=1), gravity, lower_gravity=True, **options)


def test_the_hand_that_scales_with_gravity_is_that_of_1_g_there():
    assert pace_under(9.80665) == 1.0
    assert AT_REST < 1
