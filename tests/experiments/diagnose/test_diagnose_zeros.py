"""Sensors whose zero is another in each push, and beds that differ where no push repeats another."""

from types import SimpleNamespace

import numpy as np
import pytest
from penetration_campaigns import DAMPING, DEPTH_STD, FORCE_STD, STIFFNESS, campaign_of

from experiments.campaign import Recording, write_campaign
from experiments.diagnose.core.diagnosis import diagnose
from experiments.diagnose.experiment import diagnose_campaign
from experiments.diagnose.noise.lone_beds import _explained
from experiments.diagnose.push.problem import make_problem
from experiments.diagnose.push.zeros import find_force_zeros

SPEEDS = (0.01, 0.01, 0.03, 0.03, 0.1, 0.1)
OFF = np.array([1.3, -0.9, 0.4, -1.2, 1.1, -0.3])
"""What differs from push to push, of unit standard deviation and no mean."""


def straight(z, v):
    return STIFFNESS * z + DAMPING * max(v, 0.0)


def bent(z, v):
    return STIFFNESS * z * (1 + z / 0.02) + DAMPING * max(v, 0.0)


def approached(force, speed, *, zero=0.0, deeper=0.0, bed=1.0, seed=0):
    """From 4 mm above the surface to 15 mm and back at one speed; `zero` [N] on the force and `deeper` [m] on the depth
    are what the sensors add."""
    random = np.random.default_rng(seed)
    time = np.linspace(0.0, 0.038 / speed, 300)
    going = time < 0.019 / speed
    z = np.where(going, speed * time - 0.004, 0.034 - speed * time)
    values = np.array(
        [bed * force(a, b) if a > 0 else 0.0 for a, b in zip(z, np.where(going, speed, -speed), strict=True)]
    )
    return Recording({
        "t_s": time, "depth_m": z + deeper + DEPTH_STD * random.standard_normal(len(z)),
        "force_N": values + zero + FORCE_STD * random.standard_normal(len(z)),
    })  # fmt: skip


def problem_of(force, speeds=SPEEDS, *, zeros=None, deeper=None, beds=None):
    nothing = np.zeros(len(speeds))
    numbers = zip(speeds, nothing if zeros is None else zeros, nothing if deeper is None else deeper,
                  nothing if beds is None else beds, strict=True)  # fmt: skip
    return make_problem(campaign_of([
        (f"{k}", "driven", v, approached(force, v, zero=f, deeper=d, bed=1 + b, seed=60 + k))
        for k, (v, f, d, b) in enumerate(numbers)
    ]))  # fmt: skip


def test_zeros_of_the_force_are_read_above_the_surface():
    known = problem_of(straight, zeros=FORCE_STD * OFF).known_std
    assert known == {"force zero": pytest.approx(FORCE_STD, rel=0.3)}
    assert problem_of(straight).known_std == {}


def test_pushes_that_read_exactly_0_above_the_surface_have_no_zeros_that_differ():
    """As a simulation writes them."""
    time = np.linspace(0.0, 1.0, 40)
    path = SimpleNamespace(depth=time - 0.5, depth_std=np.full(40, 1e-3), speed=np.ones(40))
    read = {"driven": True, "path": path, "time": time, "other": np.where(time > 0.5, 900 * time, 0.0)}
    trials = [SimpleNamespace(info=SimpleNamespace(id=id), **read) for id in ("001", "002")]
    assert find_force_zeros(trials, FORCE_STD) is None


def test_a_zero_that_differs_by_one_noise_is_nothing_missing_and_is_said():
    found = diagnose(problem_of(straight, zeros=FORCE_STD * OFF))
    assert found.verdict == "none" and found.model_std["force zero"] == pytest.approx(FORCE_STD, rel=0.3)
    assert any("differs by 0.0" in finding.what for finding in found.findings)
    # The gap stays that of the stated noise.
    assert 1.5 < found.after.fit < 3.0


@pytest.mark.long
def test_a_zero_that_differs_hides_no_effect():
    found = diagnose(problem_of(bent, zeros=FORCE_STD * OFF))
    assert found.verdict == "named" and found.effects == ("depth-hardening",)


@pytest.mark.long
def test_a_depth_counted_from_another_height_in_each_push_is_nothing_missing():
    found = diagnose(problem_of(straight, deeper=DEPTH_STD * OFF))
    assert found.verdict == "none" and found.model_std == {"depth zero": pytest.approx(DEPTH_STD, rel=0.4)}


ALONE = (0.01, 0.014, 0.02, 0.028, 0.04, 0.056, 0.08, 0.11)
BEDS = 0.05 * np.array([0.4, -1.3, 1.2, 0.2, -1.1, 1.4, -0.9, 0.1])


@pytest.mark.long
def test_beds_that_differ_where_no_push_repeats_another_are_scatter_and_said():
    found = diagnose(problem_of(straight, ALONE, beds=BEDS))
    assert found.verdict == "none" and found.model_std == {"bed": pytest.approx(0.05, rel=0.3)}
    assert any("no replicates" in finding.what for finding in found.findings)


@pytest.mark.long
def test_a_force_zero_of_each_push_in_noise_that_is_correlated_is_nothing_missing_though_none_repeats_another():
    """The colour shows once the zeros are out of the way, and with it nothing is left."""
    found = diagnose(make_problem(campaign_of(on_the_surface(ALONE, BEDS / 0.05, 0.7), depth_std=2e-5)))
    assert found.verdict == "none" and set(found.model_std) == {"force zero"}
    assert any("a zero that" in finding.what for finding in found.findings)


@pytest.mark.long
def test_a_stiffness_that_goes_with_the_speed_is_no_scatter():
    found = diagnose(problem_of(straight, ALONE, beds=np.sort(BEDS)))
    assert found.verdict != "none"
    assert any("the trial's speed" in finding.what for finding in found.findings)


def test_pushes_and_drops_that_differ_are_no_scatter():
    """A falling mass that is another than stated changes K / m of all drops alike."""
    kinds = {f"{k}": float(k > 3) for k in range(8)}
    noisy = {id: -0.06 * kind + 0.001 * (-1) ** int(id) for id, kind in kinds.items()}
    assert _explained(noisy, kinds, [list(kinds)]) > 0.95
    assert _explained(dict(zip(kinds, BEDS, strict=True)), kinds, [list(kinds)]) < 0.5


@pytest.mark.long
def test_one_bed_that_is_another_is_no_scatter():
    found = diagnose(problem_of(straight, ALONE, beds=np.where(np.arange(8) == 3, 0.2, 0.0)))
    assert found.verdict != "none"
    assert any(finding.trial == "3" and "differs in trial" in finding.what for finding in found.findings)


def on_the_surface(speeds, offs, persistence=0.0):
    """Trials that rest on the surface for 0.3 s and are pushed 12 mm in; `offs`: force zeros over 1.5 noises."""
    trials = []
    for k, (speed, off) in enumerate(zip(speeds, offs, strict=True)):
        random = np.random.default_rng(90 + k)
        time = np.arange(0.0, 0.3 + 0.012 / speed + 0.3, 0.004)
        z = np.clip(speed * (time - 0.3), 0.0, 0.012)
        v = np.where((time > 0.3) & (z < 0.012), speed, 0.0)
        depth = z + 2e-5 * random.standard_normal(len(z))
        noise = random.standard_normal(len(z))
        for row in range(1, len(noise) if persistence else 0):
            noise[row] = persistence * noise[row - 1] + np.sqrt(1 - persistence**2) * noise[row]
        force = STIFFNESS * z + DAMPING * v + FORCE_STD * (1.5 * off + noise)
        trials.append((f"{k}", "driven", speed, Recording({"t_s": time, "depth_m": depth, "force_N": force})))
    return trials


@pytest.mark.long
def test_a_force_zero_of_pushes_that_begin_at_the_surface_is_nothing_missing():
    # At rest on the surface no row reads the zero for certain; a depth's zero takes up most of it, but not there.
    found = diagnose(make_problem(campaign_of(on_the_surface(SPEEDS, OFF), depth_std=2e-5)))
    assert found.verdict == "none"
    assert found.model_std["force zero"] == pytest.approx(1.5 * FORCE_STD, rel=0.4)


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed, differs",
    [
        (740020, {"force zero"}),  # none repeats another, noise of correlation 0.74
        (5300002, {"bed", "bed damping"}),  # K alone differs, pushes and drops, none repeats another
        (5300011, {"bed", "depth zero"}),  # replicates: a layer explained what was fitted, and not what was held out
    ],
)
def test_nulls_of_the_rig_with_zeros_and_beds_of_their_own_have_no_name(tmp_path, seed, differs):
    from benchmarks.hidden.rig import make_rig

    write_campaign(tmp_path / "rig", make_rig(seed, kind="null")[0])
    found = diagnose_campaign(tmp_path / "rig")
    assert found.verdict == "none" and set(found.model_std) == differs
