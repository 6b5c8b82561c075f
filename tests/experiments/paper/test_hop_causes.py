"""Why the planar model and rigid ground differ: friction under a sudden torque, and energy of the springs."""

import json
import math
from dataclasses import replace

import pytest
from golden import golden

from experiments.cli.main import BAD_INPUT, DONE, main
from experiments.hop.on_surface import hop_on_surface
from rigid.hop import Tumbler, flight, launch
from rigid.model.trial import Trial
from vis.page.page import text
from vis.page.report import Report
from vis.paper.answer import answer_tiles
from vis.paper.hop import write_hop_report

CUBE = """
format = "hedgebed-platform/1"
name = "Cube hopper"
[body]
mass = 5.0
inertia = [0.052, 0.052, 0.052]
[hull]
shape = "box"
size = [0.25, 0.25, 0.25]
[spikes]
clear = 0.04
diameter = 0.012
[wheels]
inertia = 1.2e-3
max_speed = 1050.0
motor_torque = 0.3
brake_torque = 12.6
axes = [[0.0, 1.0, 0.0]]
"""
pytestmark = pytest.mark.usefixtures("unreported")
LENGTH = 0.125 * math.sqrt(2)


@pytest.fixture
def cube(tmp_path):
    path = tmp_path / "cube.toml"
    path.write_text(CUBE)
    return str(path)


def model(tumbler, *, stiffness, damping, torque, wheel_speed):
    """The launch of the planar model of a free cube."""
    trial = Trial(
        mass=tumbler.mass, inertia=tumbler.inertia, spike_length=tumbler.spike_length, spike_count=4,
        stiffness=stiffness, damping=damping, mu_s=tumbler.mu_s, mu_d=tumbler.mu_d, gravity_sim=tumbler.gravity,
        gravity=tumbler.gravity, torque=torque, wheel_inertia=1.2e-3, actuator="brake", wheel_speed_0=wheel_speed,
    )  # fmt: skip
    return hop_on_surface(trial, expected_time=1.2e-3 * wheel_speed / torque, longest=3.0, radius=None)


def free_cube(mu_s, mu_d):
    return Tumbler(mass=5.0, inertia=0.052, spike_length=LENGTH, lean=math.pi / 4, gravity=0.0057, mu_s=mu_s, mu_d=mu_d)


@pytest.mark.parametrize(("mu_d", "slides"), [(0.6, True), (1.2, False)])
def test_the_stiff_limit_of_the_model_slides_where_sliding_friction_is_below_the_cotangent_of_the_lean(mu_d, slides):
    """mu_s = 1.2 > 1 = cot(lean): rigid tips hold. The model's slip first, and stick again only if mu_d > cot(lean)."""
    tumbler = free_cube(1.2, mu_d)
    there = model(tumbler, stiffness=1e8, damping=2.8e4, torque=1.26, wheel_speed=105.0)
    holds = launch(tumbler, 1.26, 0.1)
    assert not holds.slid and there.slides == slides
    limit = launch(replace(tumbler, mu_s=mu_d), 1.26, 0.1) if slides else holds
    assert there.launch.speed == pytest.approx(limit.speed, rel=5e-3)
    assert there.launch.angle == pytest.approx(limit.angle, abs=2e-3)
    assert (abs(there.launch.angle - holds.angle) > 0.2) == slides


def test_a_hop_names_friction_where_the_tips_slide_here_and_stick_on_rigid_ground(tmp_path, cube):
    words = [
        "--mu-s",
        "1.2",
        "--mu-d",
        "0.6",
        "--stiffness",
        "1e6",
        "--damping",
        "500",
        "--torque",
        "1.26",
        "--gravity",
        "0.0057",
        "--distance",
        "2",
    ]
    assert main(["hop", "--platform", cube, *words, "--quiet", "--out", str(tmp_path / "run")]) == DONE
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    golden("hop/slides_there", result["departures"]["sentences"])


def test_a_wheel_too_slow_for_rigid_ground_may_still_hop_from_springs_and_the_refusal_says_so(tmp_path, capsys, cube):
    words = ["--gravity", "0.5", "--wheel-speed-0", "150", "--torque", "1.8"]
    assert main(["hop", "--platform", cube, *words, "--quiet", "--out", str(tmp_path / "run")]) == BAD_INPUT
    golden("hop/only_from_springs", " ".join(capsys.readouterr().err.split()))


def test_in_a_rig_a_slow_wheel_has_no_launch_from_rigid_ground_as_the_weight_holds_it_down():
    """After a brake N = W - M l c omega^2 > 0 for the omega of sliding: no launch; a stiff spring throws it briefly."""
    gravity = 0.01 * 9.80665
    counterweight = 5.0 * (9.80665 - gravity) / (9.80665 + gravity)
    rigged = replace(free_cube(0.5, 0.25), gravity=gravity, counterweight=counterweight)
    s = c = math.sqrt(0.5)
    lever = rigged.inertia + rigged.mass_y * LENGTH**2 * s * (s + 0.25 * c)
    for speed, leaves in ((150.0, False), (200.0, True)):
        held = rigged.mass_y * LENGTH * c * (1.2e-3 * speed / lever) ** 2 < rigged.weight
        assert held != leaves
        assert (launch(rigged, 1.8, 1.2e-3 * speed / 1.8) is not None) == leaves


def test_beyond_the_range_of_a_law_no_interval_is_stated(tmp_path):
    """K of sand is of grains at 1 g: at 1e-3 m/s2 it is 9,800 times too large, and its error says nothing."""
    words = ["--surface", "sand", "--gravity", "1e-3", "--wheel-speed-0", "400"]
    assert main(["hop", *words, "--quiet", "--out", str(tmp_path / "run")]) == DONE
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert result["quantities"]["model_launch_speed"]["std"] is None and result["law_spread"]["beyond"]
    assert any("the law's range" in said for said in result["departures"]["sentences"])
    rows = {tile.label: tile.errors[1] for tile in answer_tiles(result)}
    assert rows["Launch from sand"] == "beyond range"


def test_a_tumble_with_k_of_one_g_in_low_gravity_states_no_interval_either(tmp_path):
    words = ["--surface", "sand", "--gravity", "0.05", "--torque", "0.2", "--duration", "0.2"]
    assert main(["tumble", *words, "--quiet", "--out", str(tmp_path / "run")]) == DONE
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert result["law_spread"]["beyond"] and result["quantities"]["max_speed"]["std"] is None


def test_a_hop_states_its_spin_up_and_what_it_depends_on(tmp_path, cube):
    """By hand: mu_s W (J + m h^2) / (m h) slips, W l sin(lean) tips; the same search at half and twice mu_s."""
    words = ["--gravity", "0.0057", "--distance", "2", "--brake-time", "0.1"]
    assert main(["hop", "--platform", cube, *words, "--quiet", "--out", str(tmp_path / "run")]) == DONE
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    value = {name: entry["value"] for name, entry in result["quantities"].items()}
    slips = 0.5 * 5 * 0.0057 * (0.052 + 5 * 0.125**2) / (5 * 0.125)
    assert value["spin_up_torque"] == pytest.approx(slips) and slips < 5 * 0.0057 * 0.125
    assert value["spin_up_time"] == pytest.approx(1.2e-3 * value["wheel_speed"] / slips)
    for mu_s, speed in zip((0.25, 1.0), result["otherwise"]["mu_s"]["values"], strict=True):
        tumbler = free_cube(mu_s, mu_s / 2)
        left = launch(tumbler, 1.2e-3 * speed / 0.1, 0.1)
        assert flight(left.speed, left.angle, gravity=0.0057).distance == pytest.approx(2.0, rel=1e-3)
    golden("hop/cube", [*result["departures"]["sentences"], *(f"{t.label}: {t.value}" for t in answer_tiles(result))])


def test_the_title_of_a_hops_pictures_has_one_line_and_names_the_ground(tmp_path, monkeypatch):
    titles = []
    monkeypatch.setattr(Report, "draw", lambda self, key, drawing, **_: titles.append(self.about) or text(key))
    assert main(["hop", "--distance", "2", "--quiet", "--out", str(tmp_path / "run")]) == DONE
    write_hop_report(tmp_path / "run")
    golden("hop/title_of_pictures", sorted(set(titles)))
