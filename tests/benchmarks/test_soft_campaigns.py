"""The soft suite: MuJoCo's motions against closed forms and against the base model of `rigid`, and its campaigns."""

import math
from dataclasses import replace
from importlib.metadata import version

import numpy as np
import pytest
from import_graph import FOLDERS, loaded_with

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

from benchmarks.hidden.suite import suite
from benchmarks.second.campaigns import campaign_of
from benchmarks.second.sensing import record
from benchmarks.soft import motion, tumble
from benchmarks.soft.motion import CONTACT, ROWS, Contact, move
from experiments.campaign import read_campaign, write_campaign
from experiments.diagnose.tumble.problem import make_problem

BASE = {
    "mass": 5.3, "inertia": 0.06, "stiffness": 1.5e4, "damping": 4.0, "mu_s": 0.5, "gravity_sim": 0.1, "torque": 0.0,
    "torque_until": 10.0, "wheel_speed_0": 0.0, "wheel_sign": 1.0,
}  # fmt: skip
FLAT = 0.2 * math.cos(math.pi / 8) + 1e-5 * (1 - math.cos(math.pi / 8))
"""Height of the centre where two tips touch, which are balls of 1e-5 m [m]."""


def moved(duration, **numbers):
    """One motion as a dict of columns, with its times."""
    time, rows = move(BASE | numbers, duration)
    return {"time": time} | dict(zip(ROWS, rows.T, strict=True))


def gaps(settings, *, forms=(), numbers=None, contact=CONTACT):
    """Mean square of residuals over noise of each trial of 0.6 s, of `rigid`'s model with the true numbers."""
    random = np.random.default_rng(7)
    plan = tumble._draw_plan(random, 4)
    plan = replace(plan, true=plan.stated, gravity_factor=np.ones(4), duration=0.6, surface="sand")
    readings = tumble._Bench(plan, contact).measure([settings])[0]
    problem = make_problem(campaign_of(record(random, plan, readings, title="soft")))
    base = plan.stated | {f"gravity_sim[{n + 1:03d}]": t["gravity_sim"] for n, t in enumerate(plan.trials)}
    fitted = [form for form in problem.forms if form.id in forms]
    left = problem.evaluate([base | (numbers or {})], fitted, [f"{n:03d}" for n in range(1, 5)])[0]
    return np.array([float(np.mean(rows**2)) for rows in left.values()])


def test_the_motion_imports_nothing_from_rigid_coupling_or_experiments():
    found = loaded_with("mujoco", "benchmarks.soft.motion", "benchmarks.soft.forms") & {*FOLDERS}
    assert not found, found


def test_a_motion_that_mujoco_begins_again_is_an_error(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log into the present folder
    with pytest.raises(RuntimeError, match="not stable"):
        moved(0.1, torque=1e12)


def test_a_drag_acts_on_all_tips_that_touch_whether_points_or_balls():
    """Tips that the platform's weight presses in by z_0 at rest, given a speed: drag is D v^2 on each that goes in."""
    import mujoco

    for ball in (0.0, 8e-3):
        p = BASE | {"length": 0.2, "drag": 3.0, "ball": ball}
        radius = max(ball, 1e-5)
        y = (0.2 - radius) * math.cos(math.pi / 8) + radius - 1e-5
        data = mujoco.MjData(mujoco.MjModel.from_xml_string(motion._mjcf(p | {"wheel_inertia": 1.2e-3}, CONTACT, 1e-4)))
        data.qpos[1], data.qvel[1] = y, -0.3
        (_, force, torque), _ = motion._push(p, 0.0, data, 0.5)
        assert force == pytest.approx(2 * 3.0 * 0.3**2) and torque == pytest.approx(0.0, abs=1e-12)


def test_a_platform_at_rest_sinks_by_half_its_weight_over_the_stiffness_and_stays():
    m = moved(0.2)
    assert FLAT - m["y"] == pytest.approx(np.full(len(m["y"]), 0.5 * 0.53 / 1.5e4), rel=1e-5)
    assert np.abs(m["theta"]).max() < 1e-9


def test_an_impedance_that_grows_with_depth_hardens_the_ground():
    """F = K r (1 + h r / w)^2 to first order in the impedance, 0.001: half the weight on each of two tips."""
    depth = FLAT - moved(0.1, harden=2.0, harden_depth=5e-5)["y"][-1]
    assert 1.5e4 * depth * (1.0 + 2.0 * depth / 5e-5) ** 2 == pytest.approx(0.265, rel=4e-3)


def test_friction_creeps_on_a_slope_by_less_than_the_cameras_noise():
    m = moved(1.0, slope=0.1)
    assert 0.0 < -m["x"][-1] < 5e-5


def test_a_motor_speeds_its_wheel_up_by_its_torque_while_a_spike_touches():
    m = moved(0.3, torque=0.16)
    assert m["wheel"] == pytest.approx(0.16 / 1.2e-3 * m["time"], abs=1e-6)


def test_without_anything_hidden_mujoco_stays_near_the_base_model_where_its_contacts_are_nearly_springs():
    """Of the noise: 1 a sample. MuJoCo's usual impedance adds 13 platforms to a tip that touches."""
    assert gaps({}).max() < 1.25
    assert gaps({}, contact=Contact(impedance=0.9)).max() > 2.5


@pytest.mark.parametrize(("settings", "form", "numbers"), [
    ({"slope": 0.2}, "slope:plane", {"slope.angle": 0.2}),
    ({"offset_x": 0.002, "offset_y": 0.03}, "com-offset:both", {"com-offset.x": 0.002, "com-offset.y": 0.03}),
    ({"ball": 0.02}, "tip-radius:ball", {"tip-radius.radius": 0.02}),
    ({"bearing": 0.02}, "bearing-drag:dry", {"bearing-drag.torque": 0.02}),
    ({"cable_drag": 0.1}, "umbilical:both", {"umbilical.stiffness": 0.0, "umbilical.drag": 0.1}),
    ({"rise": 0.02}, "torque-rise:first order", {"torque-rise.rise": 0.02}),
    ({"clock": 0.05}, "clock-offset:constant", {"clock-offset.offset": 0.05}),
])  # fmt: skip
def test_a_hidden_effect_is_that_of_its_name(settings, form, numbers):
    """With the inertia about the shaft, a mass off the shaft adds nothing to it."""
    assert gaps(settings).max() > 2.0
    assert gaps(settings, forms=(form,), numbers=numbers).max() < 1.3


def test_a_seed_makes_one_campaign_and_it_is_valid(tmp_path, monkeypatch):
    monkeypatch.setattr(tumble, "_DURATION", 0.05)
    monkeypatch.setattr(motion, "SETTLE", 0.05)
    case = {"seed": 3, "kind": "loose-mass", "strength": 2.0, "trials": 4}
    (made, told), (again, _) = tumble.make_soft(**case), tumble.make_soft(**case)
    assert (told.effects, told.outside) == ((), "loose-mass")
    assert told.extra["mujoco"] == version("mujoco")
    assert all(np.array_equal(made.columns[key][name], again.columns[key][name])
               for key in made.columns for name in made.columns[key])  # fmt: skip
    folder = write_campaign(tmp_path / "campaign", campaign_of(made))
    assert len(read_campaign(folder).tables.trial) == 4
    assert told.outside not in (folder / "campaign.toml").read_text(encoding="utf-8")


def test_a_suite_has_every_class_in_its_first_twenty_campaigns():
    kinds = [case["kind"] for case in suite("mujoco-tumble", 20, seed=1)]
    assert {"null", "pair"} < set(kinds)
    assert set(kinds) & set(tumble.OUTSIDE)
    assert len(set(kinds) & set(tumble.EFFECTS)) >= 9


def test_what_cannot_be_hidden_is_refused():
    with pytest.raises(ValueError, match="adhesion"):
        tumble.make_soft(1, kind="adhesion")
