"""Several tumbles in a row and landings: the torque's schedule, what is noted, a drop's closed form, restart."""

import math

import numpy as np
import pytest
from golden import golden

from coupling import BedGround, Landing, LawGround, Rest, TumblesInARow, platform_members
from dem import Bed
from dem.grains.materials import SAND
from experiments.tumble.steppers import own_warning
from rigid import Trial

RIG = {"gravity_sim": 0.3, "counterweight": 0.28}
SMALL = {"mass": 0.3, "inertia": 2e-4, "spike_length": 0.04, "wheel_inertia": 1e-5, "mu_s": 0.8}


def row():
    """A small platform on ground whose damper lets it fall and lie; the torque is 1.5 times the least that tips."""
    trial = Trial(**RIG, **SMALL, stiffness=300.0, damping=30.0, torque=1.5 * 0.58 * 0.3 * 0.04 * math.sin(math.pi / 8))
    return TumblesInARow(trial, LawGround.of_trial(trial), tumbles=2, duration=8.0, substeps=20)


def test_a_tumble_follows_the_other_when_the_platform_lies_and_goes_on_from_a_checkpoint_to_the_same_bits():
    run = row()
    while run.time < 1.0:
        run.advance()
    kept = run.state()
    found, rests = run.run(), run.rests
    assert len(rests["time"]) == 3 and found.time[-1] < 8.0
    weight, stiffness = run.trial.weight, run.trial.stiffness
    assert rests["sinkage"] == pytest.approx(np.full(3, weight / (2 * stiffness)), rel=0.1)  # W / 2K on two rows
    assert rests["at_rest"].all() and (rests["rows_turned"][1:] >= 1).all()
    assert rests["theta"] == pytest.approx(np.cumsum(rests["rows_turned"]) * math.pi / 4, abs=5e-3)
    # The torque does work only on the way up to pi / rows, so each tumble costs at most torque times that and a step.
    work = np.interp(rests["time"], found.time, found.torque_work)
    assert (np.diff(work) < run.trial.torque * (math.pi / 8 + 0.02)).all() and (np.diff(work) > 0).all()
    other = row()
    other.restore(kept)
    other.run()
    assert np.array_equal(run.body.place, other.body.place) and run.body.torque_work == other.body.torque_work
    assert np.array_equal(run.rests["time"], other.rests["time"])


def test_rest_goes_with_gravity_in_flight_and_not_in_the_rig():
    """Froude: speeds go as sqrt(g) and times as 1 / sqrt(g), so that speed times wait and speed^2 / g stay."""
    rig, earth = Rest.of(Trial(**RIG, **SMALL)), Rest.of(Trial(gravity_sim=9.80665, **SMALL))
    assert rig == earth == (2e-3, 0.1, 3.0)  # to the bit: results of rows in the rig are kept
    for g in (9.80665e-2, 9.80665e-6):
        small = Rest.of(Trial(gravity_sim=g, **SMALL))
        assert small.speed**2 / g == pytest.approx(earth.speed**2 / 9.80665)
        assert small.speed * small.longest_wait == pytest.approx(earth.speed * earth.longest_wait)
        assert small.speed * small.lasts == pytest.approx(earth.speed * earth.lasts)


def test_a_row_that_gets_no_time_to_lie_says_so():
    """How many torques ended and after how many it lay are two numbers; a warning tells the others apart."""
    run = row()
    run.rest = run.rest._replace(speed=1e-9, longest_wait=0.4)
    run.run()
    assert run.ended == 2 and run.rests["at_rest"].tolist() == [1.0, 0.0, 0.0]
    said = own_warning(run)
    short = row()
    while not short.ended:
        short.advance()
    assert len(short.rests["time"]) == 1
    golden("tumble/not_at_rest", [said, own_warning(short)])
    whole = row()
    whole.run()
    assert whole.ended == 2 and own_warning(whole) is None


def test_a_landing_falls_on_as_it_came_and_bounces_off_a_spring():
    """Without damping and friction, flat on two rows: m_y v^2 / 2 is given back, so it leaves as fast as it came."""
    trial = Trial(**RIG, **(SMALL | {"mu_s": 0.0}), stiffness=2000.0, damping=0.0)
    run = Landing(trial, LawGround.of_trial(trial), speed=0.1, along=0.02, duration=0.3, substeps=1)
    found = run.run()
    assert found.state_names[0] == "hop" and found.torque_work[-1] == 0.0
    assert found.vx == pytest.approx(np.full(len(found.time), 0.02), abs=1e-12)
    up = float(found.vy.max())
    assert up == pytest.approx(0.1, rel=2e-3)
    with pytest.raises(ValueError, match="drop_speed is 0"):
        Landing(trial, LawGround.of_trial(trial), speed=0.0, duration=0.3)


def test_a_brake_turns_once():
    trial = Trial(**RIG, **SMALL, torque=0.1, actuator="brake", wheel_speed_0=30.0)
    with pytest.raises(ValueError, match="motor"):
        TumblesInARow(trial, LawGround.of_trial(trial), tumbles=2, duration=1.0)


@pytest.mark.slow
def test_a_landing_on_grains_keeps_the_momentum_that_it_came_with_in_the_books():
    """On one layer of 6 mm grains: body and grains less the impulses of weight and floor, to round-off."""
    d, rows, columns = 6e-3, 20, 6
    at = np.array([((i + 0.5) * d, (j + 0.5) * d, 0.5 * d) for i in range(rows) for j in range(columns)])
    bed = Bed.from_grains(
        SAND, positions=at, radii=np.full(len(at), 0.5 * d), young=1e7, size=(rows * d, columns * d, 0.03), height=0.3,
        max_overlap=0.1, threads=1, gravity=9.80665,
    )  # fmt: skip
    bed.surface = d
    members = platform_members(spike_length=0.04, count=8, diameter=8e-3, clear=0.015)
    trial = Trial(**RIG, **SMALL)
    footing = BedGround(bed, members, origin=(0.06, 0.018), copies=2.0, touch=1e-3 * trial.weight, friction=0.5)
    run = Landing(trial, footing, speed=0.1, along=0.05, spin=1.0, duration=0.02, substeps=8, tip_radius=4e-3,
                  energy_interval=2e-3)  # fmt: skip
    found = run.run()
    assert run.states[0] == "hop" and run.feet[:, 0].max() > trial.weight
    assert found.vx[0] == pytest.approx(0.05) and found.omega[0] == pytest.approx(1.0)
    assert run.samples["momentum_error"].max() < 1e-12
