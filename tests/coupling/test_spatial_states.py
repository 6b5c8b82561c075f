"""States of runs in space: those of the plane for motion in the plane, those of the located events out of it."""

import numpy as np
import pytest

from coupling import CoupledTumble, LawGround, SpatialRun
from rigid import Trial
from rigid.platform.actuation import TorqueHistory
from rigid.platform.files import find_platform
from rigid.spatial.quaternions import from_turn
from rigid.spatial.spatial import SpatialTrial, simulate

HEDGEHOG = find_platform("hedgehog")
STIFF = {"stiffness": 7500.0, "damping": 30.0}


@pytest.mark.parametrize(
    ("torque", "duration", "states"),
    [(0.125, 1.4, ["stand", "slip", "pivot", "slip"]), (0.22, 0.8, ["stand", "slip", "hop"])],
)
def test_a_tumble_in_the_plane_has_the_states_of_the_planar_run(torque, duration, states):
    """The Hedgehog on brick, set down by the hand, K and C of a spike half a row's: each change at the same step."""
    shared = {"counterweight": 5.21, "mu_s": 0.5}
    rows = Trial(
        gravity_sim=0.0834, torque=torque, stiffness=15000.0, damping=60.0,
        spike_length=HEDGEHOG.stance().spike_length, **shared,
    )  # fmt: skip
    motor = TorqueHistory.constant(HEDGEHOG.wheel(), torque)
    tips = SpatialTrial(platform=HEDGEHOG, gravity=0.0834, ground_parameters=STIFF, torques=(motor,), **shared)
    options = {"duration": duration, "substeps": 5, "lowering_speed": 0.05}
    plane = CoupledTumble(rows, LawGround.of_trial(rows), **options)
    space = SpatialRun(tips, LawGround.of_spatial(tips), **options)
    plane.run()
    space.run()
    flat, spatial = plane.trajectory().transitions, space.transitions
    assert [state for _, state, _ in spatial] == [state for _, state, _ in flat] == states
    assert [time for time, _, _ in spatial] == pytest.approx([time for time, _, _ in flat], abs=1e-9)
    start = plane.columns["theta"][0]
    # Behind a change that is found to the step both are of first order in it: 8e-6 rad after 1.35 s.
    assert [turn for _, _, turn in spatial] == pytest.approx([abs(theta - start) for _, _, theta in flat], abs=5e-5)


def test_a_landing_on_one_corner_pivots_slips_and_hops_as_the_located_events_have_it():
    """`rigid.simulate_spatial` locates every tip that touches, sticks, slides and leaves; one at a time here."""
    start = {
        "position": (0.0, 0.0, 0.21), "quaternion": tuple(from_turn([0.3, -0.5, 0.2])), "velocity": (0.05, -0.03, -0.1),
        "angular_velocity": (0.5, 0.8, -0.3),
    }  # fmt: skip
    trial = SpatialTrial(platform=HEDGEHOG, gravity=0.0834, mu_s=0.5, ground_parameters=STIFF)
    model = simulate(trial, duration=0.6, sample_interval=0.6, tolerance=1e-9, **start)
    expected = [("hop", 0.0)]
    for time, touching, sticking in model.transitions:
        state = "hop" if touching == 0 else "pivot" if sticking == 1 else "slip"
        if state != expected[-1][0]:
            expected.append((state, time))
    run = SpatialRun(trial, LawGround.of_spatial(trial), duration=0.6, substeps=4, **start)
    run.run()
    found = [(state, time) for time, state, _ in run.transitions]
    assert [state for state, _ in found] == [state for state, _ in expected] and len(found) >= 3
    assert [time for _, time in found] == pytest.approx([time for _, time in expected], abs=2 * run.master.macro_step)
    feet = run.feet
    loaded = np.flatnonzero(feet[:, 0].any(axis=0))
    assert len(loaded) == 1 and feet.shape[1:] == (6, len(HEDGEHOG.tips) + 1)
    assert feet[:, 0, loaded[0]] == pytest.approx(run.columns["fz"], abs=1e-12)
    assert (feet[:, 5].max(axis=1) == run.columns["sinkage"]).all()


def test_a_checkpoint_with_the_names_of_an_earlier_version_goes_on_to_the_same_bits():
    """Balance and ground were called books and footing."""
    trial = SpatialTrial(platform=HEDGEHOG, gravity=0.0834, mu_s=0.5, ground_parameters=STIFF)
    start = {"position": (0.0, 0.0, 0.2), "velocity": (0.05, -0.03, -0.1)}
    run, again = (SpatialRun(trial, LawGround.of_spatial(trial), duration=0.1, **start) for _ in range(2))
    for _ in range(40):
        run.advance()
    state = {
        key.replace("master.exchange", "master.books")
        .replace("balance.", "books.")
        .replace("ground.", "footing."): value
        for key, value in run.state().items()
    }
    assert sum(key.startswith(("books.", "footing.", "master.books")) for key in state) > 5
    again.restore(state)
    assert {key: value.tobytes() for key, value in again.state().items()} == {
        key: value.tobytes() for key, value in run.state().items()
    }
    for _ in range(40):
        run.advance()
        again.advance()
    assert all((again.columns[name] == values).all() for name, values in run.columns.items())
