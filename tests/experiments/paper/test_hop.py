"""`hedgebed hop`: the wheel speed for a distance, what is said of escape, what is refused."""

import functools
import json
import math
import re
from dataclasses import replace

import pytest
from golden import golden

from experiments.cli.main import BAD_INPUT, DONE, main
from experiments.hop.experiment import check
from experiments.hop.numbers import plan_hop
from experiments.hop.on_surface import flight_path, hop_on_surface
from experiments.hop.settings import HopSettings
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import plan_tumble
from rigid.hop import Launch, Tumbler, brake_launch, flight
from rigid.model.trial import Trial
from rigid.planar.simulate import simulate
from rigid.platform.files import PLATFORM_FOLDER
from vis import write_report

pytestmark = pytest.mark.usefixtures("unreported")


def hop(tmp_path, capsys, *options, name="run"):
    capsys.readouterr()  # what another run of this test has printed
    status = main(["hop", *options, "--json", "--quiet", "--out", str(tmp_path / name)])
    said = capsys.readouterr()
    return status, json.loads(said.out) if status == DONE else said.err


@pytest.fixture(scope="module")
def result_of(tmp_path_factory):
    """The result of a hop with these options; what several tests ask for is run once."""

    @functools.cache
    def ask(*options):
        folder = tmp_path_factory.mktemp("hop")
        assert main(["hop", *options, "--quiet", "--out", str(folder / "run")]) == DONE
        return json.loads((folder / "run" / "result.json").read_text())

    return ask


def test_the_wheel_speed_takes_the_hedgehog_the_distance(tmp_path, capsys):
    """The wheel it names, put through launch and flight by hand, goes 5 m."""
    status, result = hop(tmp_path, capsys, "--gravity", "1e-3", "--distance", "5", "--body-radius", "300")
    assert status == DONE
    value = {key: quantity["value"] for key, quantity in result["quantities"].items()}
    tumbler = Tumbler(mass=5.3, inertia=0.06, spike_length=0.2, lean=math.pi / 8, gravity=1e-3, mu_s=0.5, mu_d=0.25)
    left = brake_launch(tumbler, 1.2e-3 * value["wheel_speed"], 6.0)
    assert flight(left.speed, left.angle, gravity=1e-3, radius=300.0).distance == pytest.approx(5.0, rel=1e-6)
    assert value["distance"] == pytest.approx(5.0, rel=1e-6)
    assert math.degrees(value["launch_angle"]) == pytest.approx(76.0, abs=0.1)  # tan = 1 / mu_d
    assert value["wheel_speed"] == pytest.approx(value["wheel_speed_impulsive"], rel=0.05)
    assert value["escape_speed"] == pytest.approx(math.sqrt(2 * 1e-3 * 300))
    assert value["escape_ratio"] == pytest.approx(value["launch_speed"] / value["escape_speed"])
    assert not any("escape" in warning for warning in result["warnings"])
    assert json.loads((tmp_path / "run" / "result.json").read_text()) == result


def test_without_a_radius_it_says_that_it_cannot_tell(result_of):
    result = result_of("--distance", "5")
    assert result["quantities"]["escape_speed"]["value"] is None
    golden("hop/without_a_radius", result["warnings"])


def test_near_escape_it_says_so_with_the_share(tmp_path, capsys):
    """Of the faster of the two launches; from 12 m on a body of 20 m radius springy ground takes it past escape."""
    _, result = hop(tmp_path, capsys, "--distance", "12", "--body-radius", "20")
    value = {key: quantity["value"] for key, quantity in result["quantities"].items()}
    assert 0.5 < value["escape_ratio"] < 1 < value["model_escape_ratio"]
    assert value["model_distance"] is None
    golden("hop/near_escape", result["warnings"])
    speed, share = f"{value['model_launch_speed']:.4g}", f"{100 * value['model_escape_ratio']:.3g}"
    assert any(speed in warning and share in warning for warning in result["warnings"])


def test_escape_is_near_from_half_its_speed_on(result_of):
    """The larger launch decides: radii for which the model's is 0.45 and 0.55 of sqrt(2 g R), theory's below half."""
    speed = result_of("--distance", "5")["quantities"]["model_launch_speed"]["value"]
    near = {}
    for share in (0.45, 0.55):
        radius = (speed / share) ** 2 / (2 * 1e-3)
        result = result_of("--distance", "5", "--body-radius", f"{radius:.6g}")
        assert result["quantities"]["escape_ratio"]["value"] < 0.4
        ratio = result["quantities"]["model_escape_ratio"]["value"]
        near[ratio > 0.5] = any("escape is near" in warning for warning in result["warnings"])
        assert not any("body_radius" in warning for warning in result["warnings"])
    assert near == {True: True, False: False}


# On ground that gives


def test_springy_ground_throws_a_sliding_platform_faster_at_the_same_angle(result_of):
    """76 degrees, tan(angle) = 1 / mu_d, on both; the speed of an integration of its own."""
    result = result_of("--distance", "5", "--body-radius", "300")
    value = {key: quantity["value"] for key, quantity in result["quantities"].items()}
    trial = Trial(
        mass=5.3, inertia=0.06, spike_length=0.2, mu_s=0.5,
        gravity_sim=1e-3, gravity=1e-3, stiffness=1.5e4, damping=60.0, torque=6.0, actuator="brake",
        wheel_speed_0=value["wheel_speed"],
    )  # fmt: skip
    fallen = simulate(trial, duration=0.2)  # it leaves at 55 ms, and no tip has come down again
    assert fallen.state_names[-1] == "hop"
    speed = math.hypot(fallen.vx[-1], fallen.vy[-1] + 1e-3 * (0.2 - fallen.transitions[-1][0]))
    assert value["model_launch_speed"] == pytest.approx(speed, rel=1e-9)
    assert value["model_launch_angle"] == pytest.approx(math.atan(1 / 0.25), abs=2e-3)
    assert value["launch_angle"] == pytest.approx(math.atan(1 / 0.25), abs=2e-3)
    assert value["speed_factor"] == pytest.approx(value["model_launch_speed"] / value["launch_speed"])
    assert value["distance_factor"] == pytest.approx(value["speed_factor"] ** 2, rel=0.01)  # v^2 sin(2 angle) / g
    slower = replace(trial, wheel_speed_0=value["model_wheel_speed"])  # that goes 5 m from this ground
    there = hop_on_surface(slower, expected_time=0.02, longest=1.0, radius=300.0)
    assert there.flight.distance == pytest.approx(5.0, rel=1e-4)
    assert value["model_wheel_speed"] < 0.7 * value["wheel_speed"]
    golden("hop/springy_ground", result["departures"]["sentences"] + result["warnings"])


def test_springy_ground_throws_tips_that_hold_up_more_steeply(tmp_path, capsys):
    """Sticking: 22.5 degrees on rigid ground, 41 degrees at a tenth of critical damping (docs/planar.md)."""
    _, result = hop(tmp_path, capsys, "--mu-s", "20", "--mu-d", "20", "--distance", "5")
    value = {key: quantity["value"] for key, quantity in result["quantities"].items()}
    assert math.degrees(value["launch_angle"]) == pytest.approx(22.5, abs=1.0)
    assert math.degrees(value["model_launch_angle"]) > 35
    assert any("leave more steeply" in sentence for sentence in result["departures"]["sentences"])


def test_soft_ground_has_no_wheel_speed_for_what_it_cannot_throw(result_of):
    """On 82 N/m (sand-weak) it turns in place before it leaves: 2 m at most, whatever the wheel, so none is named."""
    result = result_of("--surface", "sand-weak", "--distance", "5")
    assert result["quantities"]["distance_factor"]["value"] < 0.4
    assert result["quantities"]["model_wheel_speed"]["value"] is None
    golden("hop/soft_ground", [result["title"], *result["departures"]["sentences"]])


def test_ground_that_hardly_gives_and_gives_nothing_back_is_rigid_ground(tmp_path, capsys):
    """K = 1e8 N/m damped far beyond critical: theory and model agree, and no warning compares them."""
    _, result = hop(tmp_path, capsys, "--stiffness", "1e8", "--damping", "1e6", "--distance", "5")
    assert result["quantities"]["speed_factor"]["value"] == pytest.approx(1, abs=0.01)
    assert not any("times the distance" in warning for warning in result["warnings"])


@pytest.mark.parametrize("radius", [None, 20.0])
def test_the_path_that_is_drawn_begins_and_ends_on_the_ground_and_peaks_where_the_flight_does(radius):
    """Kepler's ellipse about a round body, with the vis-viva peak of `flight`."""
    left = Launch(speed=0.12, angle=1.2, spin=0.0, slid=True)
    flown = flight(left.speed, left.angle, gravity=1e-3, radius=radius)
    along, height = flight_path(left, flown, gravity=1e-3, radius=radius, count=201)
    assert (along[0], along[-1]) == (0, pytest.approx(flown.distance))
    assert height[[0, -1]] == pytest.approx([0, 0], abs=1e-12)
    assert height[100] == height.max() == pytest.approx(flown.height, rel=1e-9)
    steep = math.atan2(height[1], along[1])
    assert steep == pytest.approx(left.angle, abs=0.02)


def test_every_default_is_printed(tmp_path, capsys):
    assert main(["hop", "--mu-s", "0.4", "--out", str(tmp_path / "run")]) == DONE
    said = capsys.readouterr().err
    for line in (
        "gravity = 0.001 m/s2 (default)", "distance = 5 m (default)", "body_radius = none, a flat ground (default)",
        "platform = hedgehog (default)", "actuator = brake (default)", "surface = brick (default)",
        "torque = 6 N m (the brake of platform hedgehog, at its largest)", "mu_d = 0.2 (default: half of mu_s)",
        "stiffness = 15000 N/m (surface brick)", "damping = 60 N s/m (surface brick)",
        "mass = 5.3 kg (platform hedgehog)", "inertia = 0.06 kg m2 (platform hedgehog)",
        "wheel_inertia = 0.0012 kg m2 (platform hedgehog)", "max_wheel_speed = 1050 rad/s (platform hedgehog)",
        "spike_length = 0.2 m (platform hedgehog)", "lean = 0.392699 rad (platform hedgehog)",
    ):  # fmt: skip
        assert line in said, line
    assert "mu_s = 0.4 " not in said  # that was given


def test_a_surface_brings_its_friction(tmp_path, capsys):
    _, result = hop(tmp_path, capsys, "--surface", "steel", "--distance", "2")
    assert math.degrees(result["quantities"]["launch_angle"]["value"]) == pytest.approx(82.9, abs=0.1)  # mu_d = 0.125
    assert result["numbers"]["mu_d"] == {"value": 0.125, "unit": "1", "origin": "surface steel"}


def test_the_report_stands_on_its_own(tmp_path, capsys, reported):
    hop(tmp_path, capsys, "--distance", "5")
    page = (tmp_path / "run" / "report.html").read_text()
    assert page.count("data:image/png") == 2
    assert "http://" not in page and "https://" not in page and "<script" not in page
    (tmp_path / "run" / "report.html").unlink()
    assert write_report(tmp_path / "run").read_text() == page


def test_a_motor_slows_the_wheel_where_there_is_no_brake_and_unequal_sides_have_no_model(tmp_path, capsys, reported):
    """mascot.toml has no brake_torque: its motor's 0.1 N m slow the wheel."""
    status, error = hop(tmp_path, capsys, "--platform", "mascot", "--distance", "500")
    assert status == BAD_INPUT and "brake" not in error
    status, result = hop(tmp_path, capsys, "--platform", "mascot", "--distance", "0.01")
    assert status == DONE
    golden("hop/slowed_by_its_motor", [" ".join(error.split()), *result["departures"]["sentences"]])
    assert result["quantities"]["model_distance"]["value"] is None
    assert any("MASCOT does not have" in warning for warning in result["warnings"])
    assert (tmp_path / "run" / "report.html").exists()


def test_what_is_said_reads_well(result_of):
    """The words that a person sees, under a brake and under a motor."""
    brake = result_of("--distance", "5")
    motor = result_of("--actuator", "motor", "--distance", "0.5")
    first = [result["departures"]["sentences"][0] for result in (brake, motor)]
    golden("hop/first_sentences", first)


def test_the_wheel_speeds_of_both_grounds_stand_side_by_side_and_say_which_is_which(result_of):
    result = result_of("--distance", "5")
    rigid, gives = (result["quantities"][name] for name in ("wheel_speed", "model_wheel_speed"))
    assert list(result["quantities"])[:2] == ["wheel_speed", "model_wheel_speed"]
    assert "rigid ground" in rigid["note"] and "on brick" in gives["note"]
    assert all(f"{speed['value']:.4g}" in result["title"] for speed in (rigid, gives))
    soft = result_of("--surface", "sand-weak", "--distance", "5")
    golden("hop/titles", [result["title"], soft["title"]])


def test_a_brake_beyond_the_platforms_own_is_said_as_a_tumble_says_it_and_not_of_another_wheel():
    """Of another wheel's brake nothing is known, as nothing is of its motor."""
    said = "torque = 8 N m is beyond the brake of hedgehog, 6 N m"
    brake = {"torque": 8.0, "actuator": "brake", "wheel_speed_0": 100.0}
    assert said in plan_hop(HopSettings(**brake)).warnings and said in plan_tumble(TumbleSettings(**brake)).warnings
    brake["wheel_inertia"] = 2e-3
    for plan in (plan_hop(HopSettings(**brake)), plan_tumble(TumbleSettings(**brake))):
        assert not any("beyond" in warning for warning in plan.warnings)
    slowed = plan_hop(HopSettings(torque=0.2, platform="mascot")).warnings
    golden("hop/beyond_its_motor", slowed)


def test_a_value_that_was_given_is_no_default_though_it_equals_it():
    for settings, origin in ((HopSettings(), "default"), (HopSettings(gravity=1e-3, actuator="brake"), "given")):
        plan = plan_hop(settings)
        assert plan.numbers["gravity"].value == 1e-3 and plan.numbers["gravity"].origin == origin
        assert any(line.startswith("actuator =") for line in plan.sentences()) == (origin == "default")


# Asked by what the flywheel does


def test_a_wheel_speed_that_is_given_goes_as_far_as_the_distance_it_was_found_for(result_of, tmp_path, capsys):
    sought = result_of("--distance", "5", "--body-radius", "300")
    value = {key: quantity["value"] for key, quantity in sought["quantities"].items()}
    speed = repr(value["wheel_speed"])
    status, result = hop(tmp_path, capsys, "--wheel-speed-0", speed, "--body-radius", "300", name="b")
    found = {key: quantity["value"] for key, quantity in result["quantities"].items()}
    assert status == DONE and found["model_wheel_speed"] is None and "distance" not in result["numbers"]
    assert found["distance"] == pytest.approx(5.0, rel=1e-6)
    for name in set(value) - {"model_wheel_speed", "distance"}:
        assert found[name] == pytest.approx(value[name], rel=1e-5), name
    assert not any("times the distance" in warning for warning in result["warnings"])


def test_a_wheel_speed_that_escapes_has_no_landing_and_says_so(tmp_path, capsys, reported):
    status, result = hop(tmp_path, capsys, "--wheel-speed-0", "300", "--body-radius", "5")
    value = {key: quantity["value"] for key, quantity in result["quantities"].items()}
    assert status == DONE and value["escape_ratio"] > 1
    assert value["distance"] is value["flight_time"] is value["distance_factor"] is None
    assert "it escapes" in result["departures"]["sentences"][0]
    assert any(warning.startswith("it escapes") for warning in result["warnings"])
    assert (tmp_path / "run" / "report.html").exists()


def test_a_motors_torque_that_is_given_goes_as_far_as_the_distance_it_was_found_for(result_of, tmp_path, capsys):
    sought = result_of("--actuator", "motor", "--distance", "0.5")
    torque = sought["quantities"]["torque"]["value"]
    _, result = hop(tmp_path, capsys, "--actuator", "motor", "--torque", repr(torque), name="b")
    assert result["quantities"]["distance"]["value"] == pytest.approx(0.5, rel=1e-6)


def test_a_body_of_ones_own_takes_the_closed_forms_wheel_speed(tmp_path, capsys):
    """The names of `tumble`: H = J_w omega_0 of a brake that takes no time, on ground that slides (rigid.hop)."""
    own = ("--mass", "4", "--inertia", "0.03", "--spike-length", "0.15", "--wheel-inertia", "2e-3")
    _, result = hop(tmp_path, capsys, *own, "--distance", "1")
    value = {key: quantity["value"] for key, quantity in result["quantities"].items()}
    s, c = math.sin(math.pi / 8), math.cos(math.pi / 8)
    up = math.sqrt(1e-3 * 1.0 / (2 * 0.25)) / 1.0  # distance = 2 vx vy / g with vx = mu_d vy
    spin = up / (0.15 * s)
    assert value["wheel_speed_impulsive"] == pytest.approx(spin * (0.03 + 4 * 0.15**2 * s * (s + 0.25 * c)) / 2e-3)
    assert value["wheel_speed"] == pytest.approx(value["wheel_speed_impulsive"], rel=0.05)
    assert result["numbers"]["max_wheel_speed"]["value"] is None  # of that wheel nothing is known
    _, result = hop(tmp_path, capsys, *own, "--distance", "3", "--actuator", "motor", name="motor")
    assert result["quantities"]["distance"]["value"] == pytest.approx(3.0, rel=1e-6)
    assert result["numbers"]["mass"] == {"value": 4.0, "unit": "kg", "origin": "given"}


@pytest.mark.long
def test_a_distance_too_far_says_what_each_ground_allows(tmp_path, capsys):
    """Between the two limits the wheel speed for the ground that gives is named, and goes there."""
    _, error = hop(tmp_path, capsys, "--distance", "5000")
    golden("hop/too_far", " ".join(error.split()))
    _, error = hop(tmp_path, capsys, "--distance", "40")
    speed = re.search(r"with a wheel at (\S+) rad/s\.", error)[1]
    _, result = hop(tmp_path, capsys, "--wheel-speed-0", speed)
    assert result["quantities"]["model_distance"]["value"] == pytest.approx(40, rel=1e-2)


def test_a_motor_is_asked_for_its_torque(result_of):
    result = result_of("--actuator", "motor", "--distance", "0.5")
    value = {key: quantity["value"] for key, quantity in result["quantities"].items()}
    assert 0 < value["torque"] <= 0.22
    assert value["wheel_speed"] == pytest.approx(value["torque"] * value["torque_time"] / 1.2e-3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--distance", "5000"), "distance = 5000 m is too far"),
        (("--distance", "30", "--body-radius", "20"), "escapes"),
        (("--actuator", "motor", "--distance", "1"), "0.22 N m"),
        (
            ("--torque", "1", "--actuator", "motor"),
            "torque = 1 N m is beyond the motor of platform = 'hedgehog': at most",
        ),
        (("--torque", "0.2", "--actuator", "motor", "--distance", "2"), "leave one out"),
        (("--wheel-speed-0", "100", "--distance", "2"), "leave one out"),
        (("--wheel-speed-0", "100", "--actuator", "motor"), "use torque instead of distance"),
        (("--wheel-speed-0", "1100"), "beyond max_wheel_speed = 1050 rad/s (platform hedgehog)"),
        (("--wheel-speed-0", "0.001"), "does not make the platform leave rigid ground"),
        (("--inertia", "0.5"), "inertia = 0.5 kg m2 must not exceed mass spike_length^2"),
        (("--wheel-inertia", "0.1"), "inertia = 0.06 kg m2 must exceed wheel_inertia = 0.1"),
        (("--gravity", "9.81", "--torque", "1"), "does not tip"),
        (("--platform", "roomba"), "'roomba'"),
        (("--gravity", "-1"), "gravity"),
        (("--mu-s", "0.2", "--mu-d", "0.3"), "mu_d = 0.3"),
        (("--mu-d", "0.6"), "mu_d = 0.6 is above mu_s = 0.5 (surface brick)"),
        (("--surface", "snow"), "surface = 'snow'"),
        (("--stiffness", "0.01"), "stand"),
    ],
)
def test_a_hop_that_cannot_be_is_refused_before_there_is_a_folder(tmp_path, capsys, options, said):
    status, error = hop(tmp_path, capsys, *options)
    assert status == BAD_INPUT
    assert said in error
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "options",
    [
        ("--actuator", "motor", "--distance", "1"),
        ("--gravity", "9.81", "--torque", "1"),
        ("--wheel-speed-0", "5"),
    ],
)
def test_a_refusal_names_another_gravity_with_which_the_hop_is_possible(tmp_path, capsys, options):
    _, error = hop(tmp_path, capsys, *options)
    gravity = float(re.search(r"At gravity = (\S+) m/s2 it is possible", " ".join(error.split()))[1])
    own = [word for pair in zip(options[::2], options[1::2], strict=True) if pair[0] != "--gravity" for word in pair]
    check(HopSettings(**settings_of([*own, "--gravity", str(gravity)])))


def settings_of(words):
    """Settings by their names, of options."""
    values = {"distance": float, "torque": float, "gravity": float, "body_radius": float, "wheel_speed_0": float}
    pairs = [
        (key.removeprefix("--").replace("-", "_"), value) for key, value in zip(words[::2], words[1::2], strict=True)
    ]
    return {key: values.get(key, str)(value) for key, value in pairs}


def test_threads_are_taken_with_a_message_as_elsewhere(tmp_path, capsys):
    assert main(["hop", "--threads", "2", "--distance", "1", "--out", str(tmp_path / "run")]) == DONE
    assert "uses one thread" in " ".join(capsys.readouterr().err.split())


def test_a_platform_file_of_ones_own_will_do(tmp_path, capsys):
    shipped = (PLATFORM_FOLDER / "cubli.toml").read_text(encoding="utf-8")
    mine = tmp_path / "mine.toml"
    mine.write_text(shipped.replace('"Cubli"', '"Mine"'), encoding="utf-8")
    status, result = hop(tmp_path, capsys, "--platform", str(mine), "--distance", "3")
    assert status == DONE
    assert result["title"].startswith("Mine")


def test_a_hop_is_resumed_to_the_same_numbers(tmp_path, capsys):
    _, result = hop(tmp_path, capsys, "--distance", "2")
    (tmp_path / "run" / "result.json").unlink()
    (tmp_path / "run" / "status.json").write_text('{"status": "stopped", "reason": ""}')
    assert main(["resume", str(tmp_path / "run"), "--json", "--quiet"]) == DONE
    assert json.loads(capsys.readouterr().out) == result


@pytest.mark.parametrize(("surface", "gravity", "said"), [("sand", 1e-3, 1), ("brick", 1e-3, 0), ("sand", 9.0, 0)])
def test_k_of_one_g_under_a_hop_in_low_gravity_has_a_warning(surface, gravity, said):
    plan = plan_hop(HopSettings(distance=1.0, surface=surface, gravity=gravity))
    assert len([warning for warning in plan.warnings if "at 1 g" in warning]) == said
