"""K and C under a robot's feet where grains stick: those of the map of `hedgebed ground`, foot by foot."""

import pytest

from experiments.groundmap.maps import read_map
from experiments.platform.surfaces import find_surface
from experiments.robot.own_loop import law_of_run
from experiments.robot.plan import plan_robot
from experiments.robot.settings import RobotSettings

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

FEET = """<mujoco model="feet"><worldbody><body name="body" pos="0 0 0.2"><freejoint/>
  <geom name="small" type="sphere" size="0.006" pos="0.1 0 0" mass="1"/>
  <geom name="large" type="sphere" size="{radius}" mass="0.5"/></body></worldbody></mujoco>"""


def planned(tmp_path, gravity, *, radius=0.03, **given):
    """The plan of two balls of 12 mm and of this radius [m] on jsc1a, and K and C of each ball."""
    file = tmp_path / "feet.xml"
    file.write_text(FEET.format(radius=radius), encoding="utf-8")
    settings = RobotSettings(model=str(file), feet=("small", "large"), surface="jsc1a", gravity=gravity, **given)
    plan = plan_robot(settings)
    return plan, plan.feet_options(plan.robot())["under"]


@pytest.mark.parametrize("gravity", [1.62, 9.80665e-3, 9.80665e-6])
def test_each_foot_on_jsc1a_has_k_and_c_of_the_map_at_its_size_and_gravity(gravity, tmp_path):
    """Cohesion carries K where weight is small: then K goes with the diameter, and no longer falls with gravity."""
    plan, under = planned(tmp_path, gravity)
    sizes = {"small": 0.012, "large": 0.06}
    for name, size in sizes.items():
        found = read_map("jsc-1a-loose-cut").answer(gravity=gravity, diameter=size, grain=None, packing=None, load=None)
        # the outline of a ball, of 32 sides, has 0.6 % less area than its circle
        assert under[name]["stiffness"] == pytest.approx(found.stiffness.value, rel=8e-3)
        assert under[name]["damping"] == pytest.approx(found.damping.value, rel=8e-3)
    assert not [said for said in plan.warnings if "Earth's gravity" in said or "a row" in said]
    (said,) = [said for said in plan.warnings if "(95 %; K and C" in said]
    small = read_map("jsc-1a-loose-cut").answer(gravity=gravity, diameter=0.012, grain=None, packing=None, load=None)
    half = float(f"{1.96 * small.stiffness.std:.2g}")
    assert f"K = {small.stiffness.value:.3g} ± {half:g} N/m" in said and "(95 %" in said and "jsc1a" in said
    ratio = under["large"]["stiffness"] / small.stiffness.value
    assert f"{ratio:.3g} times under" in plan.numbers["stiffness"].origin
    if gravity < 1e-4:
        assert ratio == pytest.approx(5.0, rel=1e-2)


@pytest.mark.parametrize("gravity", [9.80665, 1.62, 9.80665e-3])
def test_k_that_only_cohesion_gives_is_said_to_hold_only_with_it(gravity, tmp_path):
    """K = exp(..) (w + s D / D0) with w = (1 - s) g / g0 (D / D0)^2; the 95 % interval of 24 ± 20 Pa reaches 0, where
    w is left. Said where w leaves less than the error of K."""
    plan, _ = planned(tmp_path, gravity)
    found, size = read_map("jsc-1a-loose-cut"), 0.06 / 0.012
    weight = (1 - found.law["share"]) * gravity / 9.80665 * size**2
    left = weight / (weight + found.law["share"] * size)
    k = found.answer(gravity=gravity, diameter=0.012, grain=None, packing=None, load=None).stiffness
    said = [said for said in plan.warnings if "only if" in said]
    assert len(said) == (left * (1 + 1.96 * k.std / k.value) < 1) == (gravity < 1.0)
    assert not said or (f"{left:.2g} times" in said[0] and f"{100 * (1 - left):.3g} %" in said[0])


def test_a_foot_that_the_map_does_not_reach_keeps_k_of_one_g_by_area_with_a_warning_that_says_why(tmp_path):
    """At 3 m/s2 the map ends at 0.157 / 3 = 52 mm; at 1 g a ball of 60 mm has the K of the surface times 25."""
    plan, under = planned(tmp_path, 3.0)
    half = 0.5 * find_surface("jsc1a").stiffness
    assert under["small"]["stiffness"] == pytest.approx(half, rel=8e-3)
    assert under["large"]["stiffness"] == pytest.approx(25 * half, rel=1e-2)
    (said,) = [said for said in plan.warnings if "Earth's gravity" in said]
    assert "beyond the map" in said
    _, fits = planned(tmp_path, 3.0, radius=0.02)
    assert fits["small"]["stiffness"] < 0.6 * half


def test_given_numbers_stay_and_a_loop_of_ones_own_has_the_map_too(tmp_path):
    import mujoco

    _, under = planned(tmp_path, 1.62, stiffness=7.0)
    assert {one["stiffness"] for one in under.values()} == {7.0}
    _, free = planned(tmp_path, 1.62)
    assert under["large"]["damping"] == free["large"]["damping"]
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "feet.xml"))
    model.opt.gravity[2] = -1.62
    own = law_of_run(model, ["small", "large"], surface="jsc1a")
    assert own.law["under"]["large"] == free["large"]
