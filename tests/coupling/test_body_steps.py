"""A body that takes several steps of its own from one exchange of forces to the next."""

import math
from dataclasses import replace

import numpy as np
import pytest

from coupling import LawGround, Master, PlanarBody, SpatialBody
from experiments.tumble.settings import TumbleSettings
from rigid import Trial, simulate
from rigid.platform.actuation import TorqueHistory
from rigid.platform.files import find_platform
from rigid.spatial.spatial import SpatialTrial

from .test_bed_footing import BASE, MASS, START, ball_on, bed_of
from .test_master import CASES, RIG, coupled

HEDGEHOG = find_platform("hedgehog")


def spun(trial, *, exchange, duration, body_steps=1, **start):
    """A body in space on the surface law of `trial`, exchanging forces every `exchange` [s]; its master."""
    footing = LawGround.of_spatial(trial)
    body = SpatialBody(trial, **start)
    footing.place(body.pose)
    master = Master(body, footing, substeps=round(exchange / footing.time_step), body_steps=body_steps)
    for _ in range(round(duration / exchange)):
        master.step()
    return master


def test_what_a_body_does_by_itself_is_followed_in_its_own_steps():
    """A free top with a driven wheel: ten steps of it in one exchange are, to the bit, ten exchanges of one."""
    platform = replace(HEDGEHOG, inertia=np.diag([0.05, 0.06, 0.08]))
    trial = SpatialTrial(
        platform=platform, gravity=0.1, torques=(TorqueHistory.constant(platform.wheel(), 0.2, 0.3),),
        torque_in_flight=True,
    )  # fmt: skip
    start = {"position": (0.0, 0.0, 5.0), "angular_velocity": (1.5, 0.4, 3.0)}
    ten = spun(trial, exchange=2e-2, duration=1.0, body_steps=10, **start).body
    fine = spun(trial, exchange=2e-3, duration=1.0, **start).body
    coarse = spun(trial, exchange=2e-2, duration=1.0, **start).body
    assert (ten.turn == fine.turn).all() and (ten.angular_momentum == fine.angular_momentum).all()
    assert np.abs(coarse.turn - fine.turn).max() > 1e-4


def test_a_spinning_landing_is_nearer_the_fine_run_with_the_bodys_own_steps():
    """Two turns a second into soft sand: the attitude turns faster than the spring-damper answers."""
    trial = SpatialTrial(
        platform=HEDGEHOG, gravity=0.0834, mu_s=0.6, ground_parameters={"stiffness": 41.0, "damping": 0.36}
    )
    start = {"position": (0.0, 0.0, 0.2), "angular_velocity": (6.0, 9.0, 8.0), "velocity": (0.0, 0.0, -0.1)}
    fine = spun(trial, exchange=2e-4, duration=0.4, **start)
    assert fine.exchange.largest_force > 0.5
    off = {}
    for steps in (1, 8):
        body = spun(trial, exchange=8e-3, duration=0.4, body_steps=steps, **start).body
        off[steps] = np.abs(body.turn - fine.body.turn).max()
    assert off[8] < 0.25 * off[1]


def test_tumble_and_exchange_stay_of_second_order_under_the_bodys_own_steps():
    """A pivot on brick against the located integrator, as `test_master` has it for one step an exchange."""
    trial = Trial(**RIG, **CASES["pivot"])
    model = simulate(trial, duration=0.5)
    end = np.array([model.x[-1], model.y[-1], model.theta[-1]])
    runs = [coupled(trial, step, 0.5, body_steps=2)[0] for step in (2e-3, 4e-4)]
    coarse, fine = (abs(run.body.place - end) for run in runs)
    assert (np.log(coarse / fine) / math.log(5) > 1.8).all()
    gaps = [abs(run.master.exchange.given - run.master.exchange.taken) for run in runs]
    assert math.log(gaps[0] / gaps[1], 5) > 1.8
    assert np.abs(runs[1].balance).max() < 1e-6 * trial.weight * trial.spike_length


def test_momentum_of_grain_and_body_is_kept_to_round_off():
    master = ball_on(bed_of(BASE), x=START[0], z=START[1], speed=0.1, substeps=4, body_steps=2)
    body, footing, met = master.body, master.ground, 0.0
    master.step()
    seen = []
    for _ in range(100):
        seen.append(footing.momentum()[[0, 2]] + MASS * body.rates[:2] - [0.0, -MASS * 9.81 * body.time])
        master.step()
        met = max(met, float(master.wrench.force[2]))
    assert met > 0.2 and np.ptp(seen, axis=0).max() < 1e-13 * MASS


def test_it_iterates_to_the_force_that_went_in_and_goes_on_from_a_kept_state_to_the_same_bits():
    trial = Trial(**RIG, **CASES["sand"])

    def made():
        body = PlanarBody(trial, z=trial.spike_length * math.cos(math.pi / 8) - 0.004)
        body.touching = True
        footing = LawGround.of_trial(trial)
        footing.place(body.pose)
        return Master(body, footing, substeps=40, body_steps=4, iterations=30)

    master = made()
    for _ in range(100):
        master.step()
    assert master.exchange.repeats and not master.exchange.unsettled
    kept = master.state()
    for _ in range(100):
        master.step()
    other = made()
    other.restore(kept)
    for _ in range(100):
        other.step()
    assert (other.body.place == master.body.place).all() and other.exchange == master.exchange


def test_a_rows_force_is_its_mean_over_the_exchange():
    trial = Trial(**RIG, **CASES["sand"])
    body = PlanarBody(trial, z=trial.spike_length * math.cos(math.pi / 8) - 0.004)
    footing = LawGround.of_trial(trial)
    footing.place(body.pose)
    master = Master(body, footing, substeps=40, body_steps=8)
    for _ in range(20):
        found = master.step()
        rows = sum(contact.normal_force for contact in found.contacts)
        assert rows == pytest.approx(float(found.force[2]), rel=1e-12) and rows > 0


def test_steps_that_do_not_go_into_one_another_are_refused():
    trial = Trial(**RIG, **CASES["sand"])
    for steps, said in ((3, "body_steps is 3: it must divide substeps = 10"), (0, "body_steps is 0"), (True, "True")):
        with pytest.raises(ValueError, match=said):
            Master(PlanarBody(trial, z=0.2), LawGround.of_trial(trial), substeps=10, body_steps=steps)
    with pytest.raises(ValueError, match="body_steps = 4 does not divide substeps = 10"):
        TumbleSettings(surface="sand", ground="bed", torque=0.22, body_steps=4)
    with pytest.raises(ValueError, match="body_steps = 5 belongs to ground = 'bed' or method = 'coupled'"):
        TumbleSettings(surface="sand", torque=0.22, body_steps=5)
    assert TumbleSettings(surface="sand", torque=0.22, method="coupled", body_steps=5).body_steps == 5
